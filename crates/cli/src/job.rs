//! Running a render: passes on a worker, and beside it progress, checkpoints, time limits and interruptions.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use moonmilk_io::checkpoint;
use moonmilk_render::film::Film;
use moonmilk_render::integrator::Integrator;
use moonmilk_render::scene::Scene;
use moonmilk_render::session::{self, Statistics};

use crate::budget::Budget;
use crate::display::Display;
use crate::failure::Failure;
use crate::progress::Progress;

/// A render to be run.
pub struct Job<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Settings of transport.
    pub integrator: &'a Integrator,
    /// Sums, possibly of earlier runs.
    pub film: &'a Film,
    /// When it is done.
    pub budget: Budget,
    /// Where checkpoints go, and the settings recorded in them.
    pub checkpoint: Option<(PathBuf, String)>,
    /// Time between checkpoints; `None` for that of an interruption alone.
    pub checkpoint_every: Option<Duration>,
    /// Factor on the finished picture.
    pub factor: f32,
}

/// How a render ended.
pub struct Done {
    /// What was done.
    pub statistics: Statistics,
    /// Whether it was interrupted.
    pub interrupted: bool,
    /// Time spent.
    pub elapsed: Duration,
}

/// Set by Ctrl-C or a request to terminate.
static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

fn interruption() -> Arc<AtomicBool> {
    Arc::clone(INTERRUPTED.get_or_init(|| {
        let flag = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&flag);
        // The second request does not wait for the checkpoint.
        let handler = move || {
            if seen.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        };
        if let Err(e) = ctrlc::set_handler(handler) {
            tracing::warn!("interruptions cannot be caught ({e}); a checkpoint is written at intervals alone");
        }
        flag
    }))
}

impl Job<'_> {
    /// Renders until the budget is used, or until interrupted.
    pub fn run(&self, progress: &Progress, display: &mut Display) -> Result<Done, Failure> {
        let interrupted = interruption();
        let (stop, count, finished) = (AtomicBool::new(false), AtomicU64::new(0), AtomicBool::new(false));
        let total = Mutex::new(Statistics::default());
        let target = AtomicU64::new(0);
        let start = Instant::now();
        let first = self.film.first + self.film.samples();
        let pixels = {
            let [x0, x1, y0, y1] = self.film.crop;
            f64::from((x1 - x0) * (y1 - y0))
        };
        let failed: Mutex<Option<Failure>> = Mutex::new(None);
        std::thread::scope(|s| {
            // The worker: passes until the budget says so.
            s.spawn(|| {
                loop {
                    let at = self.film.first + self.film.samples();
                    let seconds = start.elapsed().as_secs_f64();
                    let rate = (at > first).then(|| (at - first) as f64 / seconds);
                    let next = self.budget.next(at, start, rate, || self.film.develop(self.factor).relative_error());
                    let Some(end) = next.filter(|_| !stop.load(Ordering::Relaxed)) else {
                        break;
                    };
                    target.store(end, Ordering::Relaxed);
                    let statistics = session::render(self.scene, self.integrator, self.film, end, &stop, &count);
                    total.lock().unwrap_or_else(PoisonError::into_inner).merge(&statistics);
                }
                finished.store(true, Ordering::Release);
            });

            // This thread: looks after the worker without deciding any value.
            let (mut saved, mut shown, mut error, mut judged) = (Instant::now(), Instant::now(), None, Instant::now());
            while !finished.load(Ordering::Acquire) {
                std::thread::sleep(Duration::from_millis(20));
                if interrupted.load(Ordering::SeqCst) {
                    stop.store(true, Ordering::Relaxed);
                }
                if let Budget::Time(limit) = self.budget
                    && start.elapsed() > limit
                {
                    stop.store(true, Ordering::Relaxed);
                }
                if let (Some(every), Some((path, settings))) = (self.checkpoint_every, &self.checkpoint)
                    && saved.elapsed() > every
                {
                    if let Err(e) = checkpoint::save(path, settings, self.film) {
                        tracing::warn!("{e}; rendering goes on without this checkpoint");
                    }
                    saved = Instant::now();
                }
                if judged.elapsed() > Duration::from_secs(2) {
                    error = Some(self.film.develop(self.factor).relative_error());
                    judged = Instant::now();
                }
                if display.is_open() && shown.elapsed() > Duration::from_secs(1) {
                    display.show(&self.film.develop(self.factor));
                    shown = Instant::now();
                }
                let done = first as f64 + count.load(Ordering::Relaxed) as f64 / pixels;
                let (share, left) = self.estimate(done, first as f64, start, error);
                progress.show(share, done, left, error);
            }
        });
        progress.finish();
        if let Some(f) = failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return Err(f);
        }
        display.show(&self.film.develop(self.factor));
        if let Some((path, settings)) = &self.checkpoint {
            checkpoint::save(path, settings, self.film).map_err(|e| Failure::Run(e.to_string()))?;
        }
        let statistics = total.into_inner().unwrap_or_else(PoisonError::into_inner);
        let was_interrupted = interrupted.load(Ordering::SeqCst);
        Ok(Done { statistics, interrupted: was_interrupted, elapsed: start.elapsed() })
    }

    /// Returns the share of the work done and the time left, as far as they can be told.
    fn estimate(&self, done: f64, first: f64, start: Instant, error: Option<f64>) -> (f64, Option<Duration>) {
        let elapsed = start.elapsed().as_secs_f64();
        let share = match self.budget {
            Budget::Samples(end) => (done - first) / (end as f64 - first).max(1.0),
            Budget::Time(limit) => {
                return (elapsed / limit.as_secs_f64(), limit.checked_sub(start.elapsed()));
            }
            // Error falls with the root of the samples.
            Budget::Error(goal) => match error {
                Some(e) if e.is_finite() => (goal / e).powi(2).min(1.0),
                _ => return (0.0, None),
            },
        };
        let left = (share > 0.0).then(|| elapsed * (1.0 / share - 1.0)).filter(|s| s.is_finite() && *s < 1e9);
        (share, left.map(Duration::from_secs_f64))
    }
}
