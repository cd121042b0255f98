//! What can be wrong with a scene, told with its place: file, line, column, the word underlined, and what would be accepted.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};
use moonmilk_render::description::Place;

/// One thing that is wrong.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Where, if it has a place.
    pub place: Option<Place>,
    /// What is wrong.
    pub message: String,
    /// What would be accepted.
    pub help: Option<String>,
    /// The piece of the file around the place.
    pub(crate) excerpt: Option<Excerpt>,
    /// For sorting: number of the file and byte within it.
    pub(crate) order: (u32, usize),
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{place}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}

impl std::error::Error for Problem {}

impl Diagnostic for Problem {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_ref().map(|excerpt| excerpt as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".into()), excerpt.span))))
    }
}

/// Why a scene could not be loaded: one or several [`Problem`]s, in the order of the text, file by file.
///
/// Prints the first with its place; as a [`miette::Diagnostic`] all of them, with the words underlined.
#[derive(Clone, Debug)]
pub struct LoadError {
    problems: Vec<Problem>,
}

impl LoadError {
    /// `problems` must not be empty; an empty list becomes one general problem.
    pub(crate) fn new(mut problems: Vec<Problem>) -> Self {
        if problems.is_empty() {
            problems.push(Problem {
                place: None,
                message: "the scene could not be loaded".into(),
                help: None,
                excerpt: None,
                order: (0, 0),
            });
        }
        // Names are looked up at the end of the files; tell the problems in the order of the text.
        problems.sort_by_key(|p| p.order);
        LoadError { problems }
    }

    /// Returns the error of one problem at a span of bytes of a text.
    pub fn at(file: &str, text: &[u8], span: Range<usize>, message: &str, help: Option<String>) -> Self {
        let start = span.start.min(text.len());
        let line_start = text[..start].iter().rposition(|&b| b == b'\n').map_or(0, |n| n + 1);
        let line = text[..start].iter().filter(|&&b| b == b'\n').count() as u32 + 1;
        let column = String::from_utf8_lossy(&text[line_start..start]).chars().count() as u32 + 1;
        let name: Arc<str> = file.into();
        let excerpt = Excerpt::new(&name, text, line, line_start, start, span.end);
        let place = Some(Place { file: name, line, column });
        Self::new(vec![Problem { place, message: message.into(), help, excerpt: Some(excerpt), order: (0, start) }])
    }

    /// All problems, at least one.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.problems[0].fmt(f)?;
        match self.problems.len() {
            1 => Ok(()),
            n => write!(f, " (and {} more)", n - 1),
        }
    }
}

impl std::error::Error for LoadError {}

impl Diagnostic for LoadError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.problems[0].help()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.problems[0].source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.problems[0].labels()
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        (self.problems.len() > 1).then(|| {
            Box::new(self.problems[1..].iter().map(|p| p as &dyn Diagnostic))
                as Box<dyn Iterator<Item = &dyn Diagnostic>>
        })
    }
}

/// The line around a place, cut to a readable length: a mesh may put a megabyte on one line.
#[derive(Clone, Debug)]
pub(crate) struct Excerpt {
    name: Arc<str>,
    text: String,
    /// Within `text`.
    span: SourceSpan,
    /// Line from 0.
    line: usize,
    /// Column from 0 of the first byte of `text`.
    column: usize,
}

/// Bytes shown on each side of the underlined word.
const REACH: usize = 90;

impl Excerpt {
    /// Cuts the line that starts at `line_start` around `start..end`.
    pub(crate) fn new(name: &Arc<str>, bytes: &[u8], line: u32, line_start: usize, start: usize, end: usize) -> Self {
        let start = start.min(bytes.len());
        let line_end = bytes[start..].iter().position(|&b| b == b'\n' || b == b'\r').map_or(bytes.len(), |n| start + n);
        let end = end.clamp(start, line_end);
        let (from, to) = (line_start.max(start.saturating_sub(REACH)), line_end.min(end + REACH));
        // Decode the three parts one by one so that the span stays right when bytes are not UTF-8.
        let before = String::from_utf8_lossy(&bytes[from.min(start)..start]);
        let word = String::from_utf8_lossy(&bytes[start..end]);
        let after = String::from_utf8_lossy(&bytes[end..to.max(end)]);
        Excerpt {
            name: name.clone(),
            span: (before.len(), word.len()).into(),
            text: format!("{before}{word}{after}"),
            line: line.saturating_sub(1) as usize,
            column: from.min(start).saturating_sub(line_start),
        }
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let (from, to) = (span.offset(), span.offset() + span.len());
        if to > self.text.len() {
            return Err(MietteError::OutOfBounds);
        }
        // Without context miette asks for the word itself, and takes line and column of the headline from it.
        let (text, span, column) = if before == 0 && after == 0 {
            (&self.text.as_bytes()[from..to], *span, self.column + from)
        } else {
            (self.text.as_bytes(), SourceSpan::from((0, self.text.len())), self.column)
        };
        Ok(Box::new(MietteSpanContents::new_named(self.name.to_string(), text, span, self.line, column, 1)))
    }
}
