//! Running the program in a temporary folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use moonmilk_io::exr;
use moonmilk_io::image::{Picture, Value};

/// Longest time that a run may take before it counts as hung.
const HUNG: Duration = Duration::from_secs(120);

/// Camera and lights before the world begins, with a size and a number of samples.
pub fn head(size: [u32; 2], spp: u32) -> String {
    format!(
        r#"LookAt 0 1 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "string filename" "scene.exr" "integer xresolution" {} "integer yresolution" {}
Sampler "independent" "integer pixelsamples" {spp}
Integrator "volpath" "integer maxdepth" 1000
WorldBegin
"#,
        size[0], size[1]
    )
}

/// Constant light from everywhere, and a disk above.
pub const LIGHTS: &str = r#"LightSource "infinite" "rgb L" [.4 .5 .6]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [6 5 4]
  Translate -1 3 -1
  Rotate 90 1 0 0
  Shape "disk" "float radius" 1
AttributeEnd
"#;

/// A ball of a medium without a refractive wall.
pub const CLOUD: &str = r#"MakeNamedMedium "cloud" "string type" "homogeneous" "rgb sigma_s" [4 3 2] "rgb sigma_a" [.1 .2 .4]
AttributeBegin
  Material "interface"
  MediumInterface "cloud" ""
  Shape "sphere" "float radius" 1
AttributeEnd
"#;

/// A dense ball with a refractive wall: many collisions per path.
pub const BALL: &str = r#"AttributeBegin
  Material "subsurface" "rgb sigma_s" [30 25 20] "rgb sigma_a" [.02 .1 .3] "float eta" 1.4
  Shape "sphere" "float radius" .9
AttributeEnd
"#;

/// A diffuse floor.
pub const FLOOR: &str = r#"AttributeBegin
  Material "diffuse" "rgb reflectance" [.6 .3 .2]
  Translate 0 -1 0
  Rotate -90 1 0 0
  Shape "disk" "float radius" 3
AttributeEnd
"#;

/// A folder that is removed when the test is done.
pub struct Folder(PathBuf);

/// How a run ended.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Folder {
    pub fn new() -> Self {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let n = COUNTER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("moonmilk-program-{}-{n}", std::process::id()));
        fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }

    /// Returns a folder with `scene.pbrt` made of these parts.
    pub fn with_scene(parts: &[&str]) -> Self {
        let folder = Self::new();
        folder.write("scene.pbrt", parts.concat());
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).expect("written");
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn exists(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    pub fn picture(&self, name: &str) -> Picture {
        exr::decode(&self.bytes(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Starts the program with arguments separated by blanks.
    pub fn start(&self, arguments: &str) -> Running {
        let child = command(&self.0, arguments).spawn().expect("the program starts");
        Running { child, start: Instant::now() }
    }

    /// Runs the program to its end.
    pub fn run(&self, arguments: &str) -> Ended {
        self.start(arguments).end()
    }

    /// Runs the program, which must succeed.
    pub fn succeed(&self, arguments: &str) -> Ended {
        let ended = self.run(arguments);
        assert_eq!(ended.code, Some(0), "moonmilk {arguments}: {ended:#?}");
        ended
    }

    /// Names of hidden files: those that are being written.
    pub fn hidden(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).expect("the folder").flatten();
        entries.filter_map(|e| e.file_name().into_string().ok()).filter(|n| n.starts_with('.')).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub fn command(folder: &Path, arguments: &str) -> Command {
    let mut c = Command::new(env!("CARGO_BIN_EXE_moonmilk"));
    c.args(arguments.split_whitespace()).current_dir(folder);
    c.env_remove("NO_COLOR").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    c
}

/// A run under way.
pub struct Running {
    child: Child,
    start: Instant,
}

impl Running {
    /// Sends a signal by name, as a terminal or a batch system would.
    pub fn signal(&self, name: &str) {
        let text = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &text]).status().expect("a shell").success(), "{text}");
    }

    pub fn kill(mut self) -> Ended {
        self.child.kill().expect("killed");
        self.end()
    }

    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_some()
    }

    /// Waits until a condition holds; fails if the run ends before.
    pub fn until(&mut self, what: &str, condition: impl Fn() -> bool) {
        while !condition() {
            if self.has_ended() || self.start.elapsed() > HUNG {
                panic!("the run ended, or hung, before {what}");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    pub fn end(mut self) -> Ended {
        // Messages are short enough for the pipes, except for data that is read as it comes.
        let stdout = self.child.stdout.take().expect("piped");
        let stderr = self.child.stderr.take().expect("piped");
        let read = |mut from: Box<dyn std::io::Read + Send>| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                let _ = from.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        };
        let (stdout, stderr) = (read(Box::new(stdout)), read(Box::new(stderr)));
        let code = loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                break status.code();
            }
            if self.start.elapsed() > HUNG {
                let _ = self.child.kill();
                panic!("the run hung");
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        Ended { code, stdout: stdout.join().expect("read"), stderr: stderr.join().expect("read") }
    }
}

/// Whether the long loops are wanted.
pub fn slow() -> bool {
    std::env::var_os("MOONMILK_SLOW").is_some()
}

pub fn channel<'a>(p: &'a Picture, name: &str) -> &'a [f32] {
    let found = p.channels.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("no channel {name}")).data
}

pub fn text<'a>(p: &'a Picture, name: &str) -> &'a str {
    match p.attributes.get(name) {
        Some(Value::Text(s)) => s,
        other => panic!("{name} is {other:?}"),
    }
}
