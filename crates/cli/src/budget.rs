//! When a render is done: samples, time or error.

use std::time::{Duration, Instant};

/// What a render may use.
#[derive(Clone, Copy, Debug)]
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

impl Budget {
    /// Returns the sample number up to which to go next, or `None` when done.
    ///
    /// `samples` is the number so far; `rate` the samples per pixel and second of this run, if known; `error` the present
    /// relative error.
    pub fn next(&self, samples: u64, start: Instant, rate: Option<f64>, error: impl FnOnce() -> f64) -> Option<u64> {
        match *self {
            Self::Samples(end) => (samples < end).then(|| end.min(doubled(samples))),
            Self::Time(limit) => {
                let left = limit.checked_sub(start.elapsed())?.as_secs_f64();
                // Passes of about a twentieth of the budget, so that the end finds all tiles nearly level.
                let Some(rate) = rate else {
                    return Some(samples + 1);
                };
                let fit = (rate * left).floor() as u64;
                let pass = ((rate * limit.as_secs_f64() / 20.0) as u64).clamp(1, fit.max(1));
                (fit >= 1).then_some(samples + pass)
            }
            Self::Error(goal) => {
                let at_test = samples >= FIRST_TEST && samples.is_power_of_two();
                if at_test && error() <= goal { None } else { Some(doubled(samples)) }
            }
        }
    }
}

/// Returns the next power of two, at least [`FIRST_TEST`].
fn doubled(samples: u64) -> u64 {
    (samples + 1).next_power_of_two().max(FIRST_TEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_tested_only_at_doublings() {
        let now = Instant::now();
        assert_eq!(Budget::Error(0.1).next(0, now, None, || unreachable!("no test at 0")), Some(16));
        assert_eq!(Budget::Error(0.1).next(20, now, None, || unreachable!("no test at 20")), Some(32));
        assert_eq!(Budget::Error(0.1).next(32, now, None, || 0.2), Some(64));
        assert_eq!(Budget::Error(0.1).next(64, now, None, || 0.09), None);
        assert_eq!(Budget::Samples(100).next(64, now, None, || 0.0), Some(100));
        assert_eq!(Budget::Samples(100).next(100, now, None, || 0.0), None);
    }
}
