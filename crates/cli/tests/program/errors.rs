//! What goes wrong: exit codes, places, suggestions, and formats of messages.

use crate::common::{CLOUD, FLOOR, Folder, LIGHTS, command, head};

fn scene() -> Folder {
    Folder::with_scene(&[&head([16, 16], 4), LIGHTS, FLOOR, CLOUD])
}

#[test]
fn faults_of_the_scene_are_shown_where_they_are() {
    let f = scene();
    let text = [&head([16, 16], 4), LIGHTS, CLOUD].concat();
    f.write("word.pbrt", text.replace("sigma_s", "sgma_s"));
    let r = f.run("render word.pbrt -o a.exr");
    assert_eq!((r.code, r.stdout.as_str()), (Some(3), ""));
    // 6 lines of head, 7 of lights: the medium is on line 14; its word begins in column 58.
    assert!(r.stderr.contains("word.pbrt:14:58"), "{}", r.stderr);
    assert!(r.stderr.contains("did you mean `sigma_s`?") && r.stderr.contains("──"), "{}", r.stderr);
    f.write("several.pbrt", text.replace("sigma_s", "sgma_s").replace("\"interface\"", "\"intreface\""));
    let r = f.run("render several.pbrt -o a.exr");
    assert!(r.stderr.contains("did you mean `interface`?") && r.stderr.contains("sgma_s"), "{}", r.stderr);
    // Ends amid a string.
    f.write("cut.pbrt", text.split_once("sphere").expect("a sphere").0);
    for (scene, told) in [("cut.pbrt", "cut.pbrt:"), ("nowhere.pbrt", "nowhere.pbrt")] {
        let r = f.run(&format!("render {scene} -o a.exr"));
        assert!(r.code == Some(3) && r.stderr.contains(told), "{r:?}");
    }
    assert!(!f.exists("a.exr") && !f.exists("a.exr.checkpoint"));
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_rendering() {
    let f = scene();
    f.write("file", "");
    std::fs::create_dir(f.path("folder.exr")).expect("created");
    std::fs::create_dir(f.path("b.exr.checkpoint")).expect("created");
    let mut cases = vec!["missing/a.exr", "file/a.exr", "folder.exr", "b.exr"];
    if cfg!(target_os = "linux") {
        // Not even root creates files there.
        cases.push("/proc/a.exr");
    }
    for output in cases {
        // A budget that nobody could wait for.
        let r = f.run(&format!("render scene.pbrt --spp 1000000000 -o {output}"));
        assert!(r.code == Some(1) && r.stderr.contains("cannot be written"), "{output}: {r:?}");
        let r = f.run(&format!("merge nothing.checkpoint -o {output}"));
        assert!(r.code == Some(1) && r.stderr.contains("cannot be written"), "{output}: {r:?}");
    }
    assert_eq!(f.hidden(), Vec::<String>::new());
    let r = f.run("render scene.pbrt -o a.jpg");
    assert!(r.code == Some(2) && r.stderr.contains(".exr or .png"), "{r:?}");
}

#[test]
fn diff_tells_noise_from_a_difference() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 64 --aov variance --seed 1 -o a.exr");
    f.succeed("render scene.pbrt --spp 64 --aov variance --seed 2 -o b.exr");
    let text = String::from_utf8(f.bytes("scene.pbrt")).expect("text");
    f.write("brighter.pbrt", text.replace("[6 5 4]", "[9 7 6]"));
    f.succeed("render brighter.pbrt --spp 64 --aov variance --seed 3 -o c.exr");
    f.succeed("render scene.pbrt --spp 4 -o plain.exr");
    let same = f.succeed("diff a.exr b.exr --test -o error.png");
    assert!(same.stdout.contains("FLIP") && same.stderr.is_empty() && f.exists("error.png"), "{same:?}");
    let other = f.run("diff a.exr c.exr --test");
    assert!(other.code == Some(4) && other.stderr.contains("the means differ"), "{other:?}");
    assert_eq!(f.succeed("diff a.exr c.exr").stderr, "");
    let plain = f.run("diff a.exr plain.exr --test");
    assert!(plain.code == Some(3) && plain.stderr.contains("--aov variance"), "{plain:?}");
    assert_eq!(f.run("diff a.exr missing.exr").code, Some(3));
    assert_eq!(f.run("diff a.exr scene.pbrt").code, Some(3));
    f.succeed("render scene.pbrt --crop 0,8,0,8 -o crop.exr");
    assert_eq!(f.run("diff a.exr crop.exr").code, Some(3));
    assert_eq!(f.run("diff a.exr b.exr -o error.exr").code, Some(2));
}

#[test]
fn json_messages_are_one_object_per_line() {
    let f = scene();
    f.write("word.pbrt", [&head([16, 16], 4), LIGHTS, "Materiel \"diffuse\"\n"].concat());
    f.write("shallow.pbrt", [&head([16, 16], 4).replace("1000", "5"), LIGHTS].concat());
    for (arguments, code, least) in [
        ("render scene.pbrt -o a.exr", 0, 1),
        ("render shallow.pbrt -o a.exr", 0, 2),
        ("render word.pbrt -o a.exr", 3, 1),
        ("render scene.pbrt -o missing/a.exr", 1, 1),
        ("render scene.pbrt --spp 0", 2, 1),
        ("scene.pbrt", 2, 1),
        ("diff a.exr nothing.exr", 3, 1),
    ] {
        let r = f.run(&format!("--log-format json {arguments}"));
        assert_eq!(r.code, Some(code), "{arguments}: {r:?}");
        let lines: Vec<serde_json::Value> =
            r.stderr.lines().map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{l}: {e}"))).collect();
        assert!(lines.len() >= least, "{arguments}: {r:?}");
        assert!(lines.iter().all(|l| l["fields"]["message"].is_string() && l["level"].is_string()), "{r:?}");
    }
    let r = f.run("render word.pbrt -o a.exr --log-format json");
    let line: serde_json::Value = serde_json::from_str(r.stderr.lines().next().expect("a line")).expect("JSON");
    assert_eq!(line["fields"]["place"], "word.pbrt:14:1");
    assert!(line["fields"]["help"].as_str().is_some_and(|h| h.contains("Material")), "{line}");
}

#[test]
fn data_go_to_standard_output_and_everything_else_to_standard_error() {
    let f = scene();
    let plain = f.succeed("render scene.pbrt -o a.exr");
    assert!(plain.stdout.is_empty() && plain.stderr.contains("a.exr: 4 samples per pixel"), "{plain:?}");
    // No terminal: no bar, no escape sequences.
    assert!(!plain.stderr.contains(['\x1b', '\r']), "{plain:?}");
    let quiet = f.succeed("render scene.pbrt --quiet -o a.exr");
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
    let stats = f.succeed("render scene.pbrt --stats -o a.exr");
    for figure in ["samples", "collisions", "rays", "closed bodies", "sides", "invalid", "scene"] {
        assert!(stats.stdout.lines().any(|l| l.starts_with(figure)), "{figure}: {}", stats.stdout);
    }
    assert!(stats.stdout.contains("1024 in"), "16 x 16 pixels of 4 samples: {}", stats.stdout);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let f = scene();
    let program = env!("CARGO_BIN_EXE_moonmilk");
    let line =
        format!("'{program}' render scene.pbrt --pixel 8,8 --spp 20000 2>err | head -n 3; echo ${{PIPESTATUS[0]}}");
    let out = std::process::Command::new("bash").args(["-c", &line]).current_dir(f.path(".")).output();
    // Where there is no bash there are no pipes of it.
    if let Ok(out) = out {
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(text.starts_with("sample,R,G,B,valid\n0,") && text.ends_with("\n0\n"), "{text}");
        assert_eq!(f.bytes("err"), b"");
    }
}

/// Runs the program on a pseudo-terminal by the tool `script`; nothing where that is missing.
fn on_a_terminal(f: &Folder, arguments: &str, no_color: bool) -> Option<String> {
    let line = format!("'{}' {arguments}", env!("CARGO_BIN_EXE_moonmilk"));
    let mut c = command(&f.path("."), "");
    let mut script = std::process::Command::new("script");
    script
        .args(["-qec", &line, "/dev/null"])
        .current_dir(c.get_current_dir().unwrap_or(&f.path(".")))
        .env("TERM", "xterm");
    script.stdin(std::process::Stdio::null()).env_remove("NO_COLOR");
    if no_color {
        script.env("NO_COLOR", "1");
    }
    c.arg("");
    let out = script.output().ok()?;
    Some(String::from_utf8_lossy(&out.stdout).into_owned())
}

#[test]
fn a_terminal_gets_a_bar_and_colours_unless_they_are_unwanted() {
    let f = scene();
    f.write("word.pbrt", [&head([16, 16], 4), LIGHTS, "Materiel \"diffuse\"\n"].concat());
    let Some(bar) = on_a_terminal(&f, "render scene.pbrt --time 600ms -o a.exr", false) else {
        return;
    };
    assert!(bar.contains("samples, 00:00 left"), "{bar:?}");
    let quiet = on_a_terminal(&f, "render scene.pbrt --quiet --time 300ms -o a.exr", false).expect("script is there");
    assert!(!quiet.contains("left"), "{quiet:?}");
    // Sequences that set colours end in m.
    let coloured = |text: &str| {
        text.split('\x1b').skip(1).any(|s| {
            s.starts_with('[') && s[1..].trim_start_matches(|c: char| c.is_ascii_digit() || c == ';').starts_with('m')
        })
    };
    for arguments in ["render word.pbrt -o a.exr", "render scene.pbrt -o a.exr", "render --spp 0"] {
        let [with, without] = [false, true].map(|no| on_a_terminal(&f, arguments, no).expect("script is there"));
        assert!(coloured(&with), "{arguments}: {with:?}");
        assert!(!coloured(&without), "{arguments}: {without:?}");
    }
}
