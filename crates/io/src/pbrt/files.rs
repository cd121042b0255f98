//! Where a scene's bytes come from: a folder on disk, or bytes that the program carries.

use std::borrow::Cow;
use std::io::{self, Read};
use std::path::PathBuf;

/// Access to the files of a scene.
///
/// Paths arrive as the scene writes them. pbrt resolves every path against the folder of the *main* scene file, also
/// inside included files, and so do the implementations here.
pub trait Files {
    /// The bytes of `path`.
    ///
    /// # Errors
    /// As for [`std::fs::read`]; a file above the implementation's size limit is [`io::ErrorKind::FileTooLarge`].
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>>;
}

/// Files below a folder on disk.
#[derive(Clone, Debug)]
pub struct Disk {
    /// Folder that relative paths start from.
    pub folder: PathBuf,
    /// Largest file that is read \[bytes\].
    pub max_bytes: u64,
}

/// 8 GiB: larger than any published pbrt scene file, smaller than what brings a machine down without a word.
pub const DEFAULT_MAX_BYTES: u64 = 8 << 30;

impl Disk {
    /// Files below `folder`, with the default size limit.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Disk { folder: folder.into(), max_bytes: DEFAULT_MAX_BYTES }
    }
}

impl Files for Disk {
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>> {
        let path = self.folder.join(path);
        let file = std::fs::File::open(&path)?;
        let metadata = file.metadata()?;
        // Refuse pipes, devices and folders: they block or never end.
        if !metadata.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a regular file"));
        }
        if metadata.len() > self.max_bytes {
            return Err(too_large(self.max_bytes));
        }
        let mut bytes = Vec::with_capacity(metadata.len() as usize);
        file.take(self.max_bytes + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > self.max_bytes {
            return Err(too_large(self.max_bytes));
        }
        Ok(Cow::Owned(bytes))
    }
}

/// Files that the program carries: pairs of path and content.
#[derive(Clone, Copy, Debug)]
pub struct Embedded(pub &'static [(&'static str, &'static [u8])]);

impl Files for Embedded {
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>> {
        let wanted = path.strip_prefix("./").unwrap_or(path);
        self.0
            .iter()
            .find(|(name, _)| *name == wanted)
            .map(|(_, bytes)| Cow::Borrowed(*bytes))
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "is not among the embedded files"))
    }
}

/// `bytes`, unpacked if they start with gzip's magic number; at most `max_bytes` come out.
pub(crate) fn gunzip<'a>(bytes: Cow<'a, [u8]>, max_bytes: u64) -> io::Result<Cow<'a, [u8]>> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut out = Vec::new();
    flate2::read::MultiGzDecoder::new(&bytes[..]).take(max_bytes.saturating_add(1)).read_to_end(&mut out)?;
    if out.len() as u64 > max_bytes {
        return Err(too_large(max_bytes));
    }
    Ok(Cow::Owned(out))
}

fn too_large(max_bytes: u64) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, format!("is larger than the limit of {} MiB", max_bytes >> 20))
}
