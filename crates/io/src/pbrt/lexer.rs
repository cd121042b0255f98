//! From bytes to words, strings and brackets, with their places.

use std::borrow::Cow;
use std::sync::Arc;

use super::number;

/// A file of scene text in memory.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name as the user knows it.
    pub name: Arc<str>,
    /// Content, unpacked.
    pub bytes: Cow<'static, [u8]>,
}

/// A piece of a source.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    /// Index of the source.
    pub source: u32,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
    /// Line, from 1.
    pub line: u32,
    /// First byte of that line.
    pub line_start: usize,
}

/// Kinds of tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A directive, number or bool.
    Word,
    /// A quoted string; the spot excludes the quotes.
    String {
        /// Whether it holds backslashes.
        escaped: bool,
    },
    /// `[`
    Open,
    /// `]`
    Close,
    /// End of an imported file.
    EndOfImport,
}

/// What is wrong with the text, and where.
pub(crate) type LexError = (Spot, &'static str);

/// Reads tokens off one source.
pub(crate) struct Cursor {
    source: Arc<Source>,
    id: u32,
    pos: usize,
    line: u32,
    line_start: usize,
}

impl Cursor {
    pub(crate) fn new(source: Arc<Source>, id: u32) -> Self {
        // Skip a UTF-8 byte order mark.
        let pos = if source.bytes.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
        Cursor { source, id, pos, line: 1, line_start: pos }
    }

    fn spot(&self, start: usize, end: usize) -> Spot {
        Spot { source: self.id, start, end, line: self.line, line_start: self.line_start }
    }

    /// Skips blanks and comments.
    #[inline]
    fn skip_blanks(&mut self) {
        let bytes = &self.source.bytes[..];
        while let Some(&byte) = bytes.get(self.pos) {
            match byte {
                b' ' | b'\t' | b'\r' => self.pos += 1,
                b'\n' => {
                    self.pos += 1;
                    self.line = self.line.saturating_add(1);
                    self.line_start = self.pos;
                }
                b'#' => {
                    self.pos += bytes[self.pos..].iter().position(|&b| b == b'\n').unwrap_or(bytes.len() - self.pos)
                }
                _ => break,
            }
        }
    }

    /// The next token, or `None` at the end of the source.
    pub(crate) fn next(&mut self) -> Result<Option<(Kind, Spot)>, LexError> {
        self.skip_blanks();
        let bytes = &self.source.bytes[..];
        let start = self.pos;
        let Some(&byte) = bytes.get(start) else {
            return Ok(None);
        };
        match byte {
            b'[' | b']' => {
                self.pos += 1;
                Ok(Some((if byte == b'[' { Kind::Open } else { Kind::Close }, self.spot(start, start + 1))))
            }
            b'"' => {
                let mut i = start + 1;
                let mut escaped = false;
                loop {
                    match bytes.get(i) {
                        Some(b'"') => break,
                        Some(b'\\') => {
                            escaped = true;
                            i += 2;
                        }
                        None | Some(b'\n') => {
                            // Whoever reads on does so on the next line.
                            self.pos = i.min(bytes.len());
                            return Err((
                                self.spot(start, i.min(bytes.len())),
                                "this string has no closing quote on its line",
                            ));
                        }
                        Some(_) => i += 1,
                    }
                }
                self.pos = i + 1;
                Ok(Some((Kind::String { escaped }, self.spot(start + 1, i))))
            }
            _ => {
                let mut i = start + 1;
                while !number::delimits(bytes.get(i)) {
                    i += 1;
                }
                self.pos = i;
                Ok(Some((Kind::Word, self.spot(start, i))))
            }
        }
    }

    /// Appends numbers up to the closing bracket, which it consumes; for use after `[`.
    pub(crate) fn numbers<T>(
        &mut self,
        out: &mut Vec<T>,
        mut convert: impl FnMut(f64) -> Option<T>,
        expected: &'static str,
    ) -> Result<(), LexError> {
        let opened = self.spot(self.pos.saturating_sub(1), self.pos);
        loop {
            self.skip_blanks();
            let bytes = &self.source.bytes[..];
            match bytes.get(self.pos) {
                None => return Err((opened, "this list has no closing `]`")),
                Some(b']') => {
                    self.pos += 1;
                    return Ok(());
                }
                Some(_) => {}
            }
            let parsed =
                number::float(&bytes[self.pos..]).filter(|&(_, used)| number::delimits(bytes.get(self.pos + used)));
            match parsed.and_then(|(value, used)| Some((convert(value)?, used))) {
                Some((value, used)) => {
                    out.push(value);
                    self.pos += used;
                }
                None => {
                    let start = self.pos;
                    let word = match self.next() {
                        Ok(Some((_, spot))) => spot,
                        _ => self.spot(start, start + 1),
                    };
                    return Err((word, expected));
                }
            }
        }
    }
}

/// Resolves the escapes of a string as pbrt does; `None` for an unknown one.
pub(crate) fn unescape(text: &str) -> Option<String> {
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        out.push(match c {
            '\\' => match chars.next()? {
                'b' => '\u{8}',
                'f' => '\u{c}',
                'n' => '\n',
                'r' => '\r',
                't' => '\t',
                c @ ('\\' | '\'' | '"') => c,
                _ => return None,
            },
            c => c,
        });
    }
    Some(out)
}
