//! Input files of MCML \[Wang1995\], the standard program for layered tissue: one or several runs, lengths in cm.
//!
//! Blank lines and what follows `#` are comments; as in MCML, text after the numbers of a line is ignored, with a warning here.

use std::ops::Range;

use moonmilk_lab::experiment::Unit;
use moonmilk_lab::{Bins, Experiment, Law, LayerSpec, Source, Tallies};

use crate::pbrt::LoadError;

/// One run of an `.mci` file.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name of the output file that the run asks for.
    pub output: String,
    /// What is simulated.
    pub experiment: Experiment,
}

/// The runs of a file, and what was ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct Mci {
    /// The runs.
    pub runs: Vec<Run>,
    /// Text that was ignored, with its place.
    pub warnings: Vec<String>,
}

/// Most runs and layers that a file may announce.
const MOST: f64 = 10_000.0;

/// A word and the bytes it occupies.
type Word<'a> = (&'a str, Range<usize>);

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
    /// Lines with content: number from 1, and their words.
    lines: std::vec::IntoIter<(usize, Vec<Word<'a>>)>,
    warnings: Vec<String>,
}

/// Returns the content of the lines that have any.
fn content(text: &str) -> Vec<(usize, Vec<Word<'_>>)> {
    let mut lines = Vec::new();
    let mut start = 0;
    for (i, line) in text.split('\n').enumerate() {
        let code = line.split('#').next().unwrap_or("");
        let words: Vec<Word<'_>> = code
            .split_ascii_whitespace()
            .map(|w| {
                // The word is a part of the text: its address says where.
                let at = start + (w.as_ptr() as usize - line.as_ptr() as usize);
                (w, at..at + w.len())
            })
            .collect();
        if !words.is_empty() {
            lines.push((i + 1, words));
        }
        start += line.len() + 1;
    }
    lines
}

impl<'a> Reader<'a> {
    fn error(&self, span: Range<usize>, message: &str, help: &str) -> LoadError {
        LoadError::at(self.file, self.text.as_bytes(), span, message, Some(help.to_owned()))
    }

    /// Returns the first `n` words of the next line with content; `what` says what they should be.
    fn words(&mut self, n: usize, what: &str) -> Result<Vec<Word<'a>>, LoadError> {
        let end = self.text.len()..self.text.len();
        let Some((line, mut words)) = self.lines.next() else {
            return Err(self.error(
                end,
                &format!("the file ends where {what} should be"),
                "a line of MCML's input, version 1",
            ));
        };
        if words.len() < n {
            let last = words[words.len() - 1].1.clone();
            return Err(self.error(last, &format!("{} of {n} values, for {what}", words.len()), what));
        }
        if words.len() > n {
            self.warnings.push(format!("{}:{line}: \"{}\" is ignored behind {what}", self.file, words[n].0));
            words.truncate(n);
        }
        Ok(words)
    }

    fn number(&self, word: &Word<'a>, what: &str) -> Result<f64, LoadError> {
        let x = word.0.parse::<f64>().ok().filter(|x| !x.is_nan());
        x.ok_or_else(|| self.error(word.1.clone(), &format!("\"{}\" is not a number: {what}", word.0), what))
    }

    fn numbers(&mut self, n: usize, what: &str) -> Result<Vec<(f64, Range<usize>)>, LoadError> {
        let words = self.words(n, what)?;
        words.iter().map(|w| Ok((self.number(w, what)?, w.1.clone()))).collect()
    }

    fn counts(&mut self, n: usize, most: f64, what: &str) -> Result<Vec<(f64, Range<usize>)>, LoadError> {
        let numbers = self.numbers(n, what)?;
        for (x, span) in &numbers {
            if !(x.fract() == 0.0 && (1.0..=most).contains(x)) {
                return Err(self.error(
                    span.clone(),
                    &format!("{x} is not a whole number in [1, {most}]: {what}"),
                    what,
                ));
            }
        }
        Ok(numbers)
    }

    fn run(&mut self, seed: u64) -> Result<Run, LoadError> {
        let output = self.words(2, "the name and format (A or B) of the output")?[0].0.to_owned();
        let photons = self.counts(1, 1e12, "the number of photons")?[0].0 as u64;
        let steps = self.numbers(2, "dz and dr [cm]")?;
        let cells = self.counts(3, 1e6, "the numbers of dz, dr and da")?;
        let count = self.counts(1, MOST, "the number of layers")?[0].0 as usize;
        let place = cells[0].1.clone();
        let n_above = self.numbers(1, "the index of the medium above")?[0].0;
        let mut layers = Vec::new();
        let mut spans = Vec::new();
        for i in 0..count {
            let l = self.numbers(5, "n, mua, mus, g and d [cm] of a layer")?;
            // MCML's half-space is a very thick last layer.
            let last = i + 1 == count;
            let thickness = if last && l[4].0 >= 1e7 { f64::INFINITY } else { l[4].0 };
            layers.push(LayerSpec {
                name: (i + 1).to_string(),
                thickness,
                n: l[0].0,
                sigma_a: l[1].0,
                sigma_s: l[2].0,
                law: Law::HenyeyGreenstein(l[3].0 as f32),
            });
            spans.push(l[0].1.start..l[4].1.end);
        }
        let n_below = self.numbers(1, "the index of the medium below")?[0].0;
        let mut e = Experiment::new(layers, Source::Pencil { angle: 0.0 });
        e.unit = Unit::Centimetre;
        e.n_above = n_above;
        e.n_below = n_below;
        e.photons = photons;
        e.seed = seed;
        let bins = |step: f64, n: f64| Some(Bins { first: 0.0, max: step * n, bins: n as usize });
        e.tallies = Tallies {
            depth: bins(steps[0].0, cells[0].0),
            radius: bins(steps[1].0, cells[1].0),
            angle: Some(cells[2].0 as usize),
            ..Tallies::default()
        };
        e.check().map_err(|error| {
            let text = error.to_string();
            let layer = (0..spans.len()).find(|i| text.starts_with(&format!("layer {} ", i + 1)));
            self.error(layer.map_or(place, |i| spans[i].clone()), &text, "MCML's input, version 1; lengths in cm")
        })?;
        Ok(Run { output, experiment: e })
    }
}

/// Reads the runs of a file; run k has the seed 1 + k.
///
/// *Errors*: what is missing, is no number or out of its range, with its place.
pub fn parse(file: &str, text: &str) -> Result<Mci, LoadError> {
    let mut r = Reader { file, text, lines: content(text).into_iter(), warnings: Vec::new() };
    let version = r.words(1, "the version of the file, 1.0")?;
    if r.number(&version[0], "the version of the file, 1.0")? != 1.0 {
        let message = format!("version {} of MCML's input is not known", version[0].0);
        return Err(r.error(version[0].1.clone(), &message, "accepted: 1.0"));
    }
    let count = r.counts(1, MOST, "the number of runs")?[0].0 as u64;
    let runs = (0..count).map(|k| r.run(1 + k)).collect::<Result<Vec<_>, _>>()?;
    if let Some((line, words)) = r.lines.next() {
        r.warnings.push(format!(
            "{file}:{line}: \"{}\" and what follows is ignored: the file announces {count} runs",
            words[0].0
        ));
    }
    Ok(Mci { runs, warnings: r.warnings })
}
