//! What all parts of the loader share: sources, files, and the lists of problems and warnings.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use moonmilk_render::description::{Place, Warning};

use super::Options;
use super::error::{Excerpt, Problem};
use super::files::{Files, gunzip};
use super::lexer::{Source, Spot};

/// More problems than this are not worth reading.
const MAX_PROBLEMS: usize = 100;

pub(crate) struct Context<'f> {
    pub files: &'f dyn Files,
    pub options: &'f Options,
    pub problems: Vec<Problem>,
    pub warnings: Vec<Warning>,
    /// Files that are not there, each once.
    pub missing: Vec<Problem>,
    /// An included file is missing: names that it may have defined are not reported.
    pub include_missing: bool,
    pub hasher: blake3::Hasher,
    /// Triangles that the loader has made of patches and subdivision surfaces.
    generated: usize,
    sources: Vec<Arc<Source>>,
    source_of: HashMap<String, u32>,
    hashed: HashSet<String>,
    missed: HashSet<String>,
    warned: HashSet<String>,
}

impl<'f> Context<'f> {
    pub(crate) fn new(files: &'f dyn Files, options: &'f Options) -> Self {
        Context {
            files,
            options,
            problems: Vec::new(),
            warnings: Vec::new(),
            missing: Vec::new(),
            include_missing: false,
            hasher: blake3::Hasher::new(),
            generated: 0,
            sources: Vec::new(),
            source_of: HashMap::new(),
            hashed: HashSet::new(),
            missed: HashSet::new(),
            warned: HashSet::new(),
        }
    }

    /// Whether reading on makes no sense.
    pub(crate) fn hopeless(&self) -> bool {
        self.problems.len() >= MAX_PROBLEMS
    }

    /// Whether `triangles` more may be generated; otherwise records a problem. A few words of text must not fill the memory.
    pub(crate) fn may_generate(&mut self, triangles: usize, spot: Spot) -> bool {
        self.generated = self.generated.saturating_add(triangles);
        let most = self.options.max_generated;
        if self.generated > most {
            self.error(spot, format!("patches and subdivision surfaces make more than {most} triangles"));
        }
        self.generated <= most
    }

    pub(crate) fn source(&self, id: u32) -> &Arc<Source> {
        &self.sources[id as usize]
    }

    /// The text at `spot`, lossily decoded.
    pub(crate) fn text(&self, spot: Spot) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.sources[spot.source as usize].bytes[spot.start..spot.end])
    }

    /// File, line and column of `spot`.
    pub(crate) fn place(&self, spot: Spot) -> Place {
        let source = &self.sources[spot.source as usize];
        let before = &source.bytes[spot.line_start.min(spot.start)..spot.start];
        // Count characters; on absurdly long lines count bytes, else many places on one line cost quadratic time.
        let column =
            if before.len() > 4096 { before.len() } else { before.iter().filter(|&&b| b & 0xc0 != 0x80).count() };
        Place { file: source.name.clone(), line: spot.line, column: u32::try_from(column).unwrap_or(u32::MAX - 1) + 1 }
    }

    fn problem(&self, spot: Spot, message: String, help: Option<String>) -> Problem {
        let source = &self.sources[spot.source as usize];
        Problem {
            place: Some(self.place(spot)),
            message,
            help,
            excerpt: Some(Excerpt::new(&source.name, &source.bytes, spot.line, spot.line_start, spot.start, spot.end)),
            order: (spot.source, spot.start),
        }
    }

    /// Records a problem.
    pub(crate) fn error(&mut self, spot: Spot, message: impl Into<String>) {
        let problem = self.problem(spot, message.into(), None);
        self.problems.push(problem);
    }

    /// Records a problem with advice.
    pub(crate) fn error_help(&mut self, spot: Spot, message: impl Into<String>, help: impl Into<String>) {
        let problem = self.problem(spot, message.into(), Some(help.into()));
        self.problems.push(problem);
    }

    /// A problem that `--lenient` turns into a warning.
    pub(crate) fn error_unless_lenient(&mut self, spot: Spot, message: impl Into<String>, help: impl Into<String>) {
        let (message, help) = (message.into(), help.into());
        if self.options.lenient {
            self.warn(spot, format!("{message}; ignored"));
        } else {
            self.error_help(spot, message, help);
        }
    }

    /// Records a warning.
    pub(crate) fn warn(&mut self, spot: Spot, message: impl Into<String>) {
        // A file may repeat one matter a million times; the list must not.
        if self.warnings.len() < 10_000 {
            self.warnings.push(Warning { place: Some(self.place(spot)), message: message.into() });
        }
    }

    /// Records a warning unless the same text was recorded before.
    pub(crate) fn warn_once(&mut self, spot: Spot, message: impl Into<String>) {
        let message = message.into();
        if self.warned.insert(message.clone()) {
            self.warn(spot, message);
        }
    }

    /// The bytes of a file; `None` after recording why not. Every file counts into the hash once.
    pub(crate) fn fetch(&mut self, path: &str, spot: Option<Spot>) -> Option<Cow<'static, [u8]>> {
        match self.files.read(path) {
            Ok(bytes) => {
                if self.hashed.insert(path.to_owned()) {
                    self.hasher.update(&(path.len() as u64).to_le_bytes());
                    self.hasher.update(path.as_bytes());
                    self.hasher.update(&(bytes.len() as u64).to_le_bytes());
                    self.hasher.update(&bytes);
                }
                Some(bytes)
            }
            Err(error) => {
                self.missed(path, spot, &error);
                None
            }
        }
    }

    fn missed(&mut self, path: &str, spot: Option<Spot>, error: &std::io::Error) {
        if !self.missed.insert(path.to_owned()) {
            return;
        }
        let message = if error.kind() == std::io::ErrorKind::NotFound {
            format!("file `{path}` is not there")
        } else {
            format!("file `{path}` cannot be read: {error}")
        };
        let help = "paths are relative to the folder of the main scene file".to_owned();
        let problem = match spot {
            Some(spot) => self.problem(spot, message, Some(help)),
            None => Problem { place: None, message, help: None, excerpt: None, order: (0, 0) },
        };
        self.missing.push(problem);
    }

    /// The scene text of a file, unpacked, read at most once; `None` after recording why not.
    pub(crate) fn open(&mut self, path: &str, name: &str, spot: Option<Spot>) -> Option<(Arc<Source>, u32)> {
        if let Some(&id) = self.source_of.get(path) {
            return Some((self.sources[id as usize].clone(), id));
        }
        let packed = self.fetch(path, spot)?;
        let bytes = match gunzip(packed, self.options.max_bytes) {
            Ok(bytes) => bytes,
            Err(error) => {
                self.missed(path, spot, &error);
                return None;
            }
        };
        let id = u32::try_from(self.sources.len()).expect("fewer than 2^32 files");
        let source = Arc::new(Source { name: name.into(), bytes });
        self.sources.push(source.clone());
        self.source_of.insert(path.to_owned(), id);
        if source.bytes.starts_with(&[0xff, 0xfe]) || source.bytes.starts_with(&[0xfe, 0xff]) {
            let spot = Spot { source: id, start: 0, end: 0, line: 1, line_start: 0 };
            self.error_help(spot, "the file is UTF-16 text", "save it as UTF-8");
            return None;
        }
        Some((source, id))
    }
}
