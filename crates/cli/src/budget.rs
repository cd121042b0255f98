//! When a render is done: samples, time or error.

use std::fmt;
use std::time::{Duration, Instant};

/// What a render may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Samples per pixel, absolute number of the end.
    Samples(u64),
    /// Time from the start of rendering.
    Time(Duration),
    /// Relative error, tested only when the sample count doubles.
    Error(f64),
}

/// First sample count at which the error is tested: two samples per scrambling.
const FIRST_TEST: u64 = 16;

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Standing {
    /// Smallest and largest end of the samples of a tile, absolute numbers.
    pub samples: [u64; 2],
    /// Samples per pixel and second of this run, if known.
    pub rate: Option<f64>,
    /// Start of this run.
    pub start: Instant,
}

impl Budget {
    /// Returns the sample number up to which to go next, or `None` when done; `error` gives the present relative error.
    pub fn next(&self, at: &Standing, error: impl FnOnce() -> f64) -> Option<u64> {
        let [samples, most] = at.samples;
        match *self {
            // Doubling passes, so that an early look or an interruption finds the whole picture.
            Self::Samples(end) => (samples < end).then(|| end.min((samples + 1).next_power_of_two())),
            Self::Time(limit) => {
                let left = limit.checked_sub(at.start.elapsed())?.as_secs_f64();
                // Passes of about a twentieth of the budget, so that the end finds all tiles nearly level.
                let Some(rate) = at.rate else {
                    return Some(samples + 1);
                };
                let fit = (rate * left).floor() as u64;
                let pass = ((rate * limit.as_secs_f64() / 20.0) as u64).clamp(1, fit.max(1));
                (fit >= 1).then_some(samples + pass)
            }
            Self::Error(goal) => {
                // A run that was stopped amid a pass left some tiles ahead: the pass must end before its test.
                let at_test = samples >= FIRST_TEST && samples.is_power_of_two() && samples == most;
                if at_test && error() <= goal { None } else { Some((samples + 1).next_power_of_two().max(FIRST_TEST)) }
            }
        }
    }

    /// Returns the budget in the words of [`Budget`]'s `Display`, if they are such.
    pub fn parse(text: &str) -> Option<Self> {
        let (kind, value) = text.split_once(' ')?;
        match kind {
            "samples" => value.parse().ok().map(Self::Samples),
            "seconds" => value.parse().ok().and_then(|s| Duration::try_from_secs_f64(s).ok()).map(Self::Time),
            "error" => value.parse().ok().filter(|e| *e > 0.0).map(Self::Error),
            _ => None,
        }
    }
}

impl Budget {
    /// Returns the budget as people say it.
    pub fn words(&self) -> String {
        match self {
            Self::Samples(n) => format!("{n} samples per pixel"),
            Self::Time(t) => format!("{} s", t.as_secs_f64()),
            Self::Error(e) => format!("error {} %", 100.0 * e),
        }
    }
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(n) => write!(f, "samples {n}"),
            Self::Time(t) => write!(f, "seconds {}", t.as_secs_f64()),
            Self::Error(e) => write!(f, "error {e}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(least: u64, most: u64) -> Standing {
        Standing { samples: [least, most], rate: None, start: Instant::now() }
    }

    #[test]
    fn errors_are_tested_only_at_doublings_of_a_level_film() {
        let never = || unreachable!("no test here");
        assert_eq!(Budget::Error(0.1).next(&at(0, 0), never), Some(16));
        assert_eq!(Budget::Error(0.1).next(&at(20, 20), never), Some(32));
        assert_eq!(Budget::Error(0.1).next(&at(16, 20), never), Some(32));
        assert_eq!(Budget::Error(0.1).next(&at(32, 32), || 0.2), Some(64));
        assert_eq!(Budget::Error(0.1).next(&at(64, 64), || 0.09), None);
        assert_eq!(Budget::Samples(100).next(&at(64, 70), || 0.0), Some(100));
        assert_eq!(Budget::Samples(100).next(&at(100, 100), || 0.0), None);
    }

    #[test]
    fn budgets_survive_being_recorded() {
        for b in [Budget::Samples(77), Budget::Time(Duration::from_millis(1500)), Budget::Error(0.0125)] {
            assert_eq!(Budget::parse(&b.to_string()), Some(b));
        }
        assert_eq!((Budget::parse("seconds -1"), Budget::parse("error 0"), Budget::parse("now")), (None, None, None));
    }
}
