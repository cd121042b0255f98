//! The progress bar: samples, remaining time, estimated error; only on a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar, or nothing where standard error is no terminal.
pub struct Progress(ProgressBar);

impl Progress {
    /// Returns a bar that counts to 1000; hidden if not `wanted`.
    pub fn new(wanted: bool) -> Self {
        let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
        if !wanted || !std::io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let style = ProgressStyle::with_template("{wide_bar} {msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        Self(bar)
    }

    /// Shows how far it is: a share of the whole, samples per pixel, and error if known.
    pub fn show(&self, share: f64, samples: f64, left: Option<Duration>, error: Option<f64>) {
        self.0.set_position((share.clamp(0.0, 1.0) * 1000.0) as u64);
        let left = left.map_or_else(|| "--:--".into(), |d| format!("{:02}:{:02}", d.as_secs() / 60, d.as_secs() % 60));
        let error = error.filter(|e| e.is_finite()).map_or_else(String::new, |e| format!(", error {:.2} %", 100.0 * e));
        self.0.set_message(format!("{samples:.0} samples, {left} left{error}"));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
