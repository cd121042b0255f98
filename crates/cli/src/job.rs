//! Running a render: passes on a worker, and beside it progress, checkpoints, time limits and interruptions.
//!
//! Three threads besides those that trace: the *worker* goes from pass to pass, the *keeper* does what takes time (checkpoints,
//! the viewer, estimates of the error), and the caller's thread watches the clock and interruptions, so that neither a slow
//! disk nor a hung viewer delays an end. None of them decides the value of a sample.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use moonmilk_io::checkpoint::{self, CheckpointError};
use moonmilk_render::film::Film;
use moonmilk_render::integrator::Integrator;
use moonmilk_render::scene::Scene;
use moonmilk_render::session::{self, Statistics};

use crate::budget::{Budget, Standing};
use crate::display::Display;
use crate::failure::Failure;
use crate::output::levels;
use crate::progress::Progress;

/// How often the clock, interruptions and the time for a checkpoint are looked at.
const TICK: Duration = Duration::from_millis(20);
/// Time between estimates of the error for the progress bar.
const JUDGED_EVERY: Duration = Duration::from_secs(2);
/// Time between pictures sent to a viewer.
const SHOWN_EVERY: Duration = Duration::from_secs(1);

/// Where and when checkpoints are written.
pub struct Checkpoint<'a> {
    /// The file.
    pub path: PathBuf,
    /// Returns the text recorded in it, given the time spent in this run.
    pub record: Box<dyn Fn(Duration) -> String + Sync + 'a>,
    /// Time between two; `None` for one at the end alone.
    pub every: Option<Duration>,
}

impl Checkpoint<'_> {
    fn save(&self, film: &Film, elapsed: Duration) -> Result<(), CheckpointError> {
        checkpoint::save(&self.path, &(self.record)(elapsed), film)
    }
}

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
    /// Checkpoints, if any.
    pub checkpoint: Option<Checkpoint<'a>>,
    /// Factor on the finished picture.
    pub factor: f32,
}

/// How a render ended.
pub struct Done {
    /// What was done.
    pub statistics: Statistics,
    /// Whether it was interrupted before its budget was used.
    pub interrupted: bool,
    /// Whether the last checkpoint was written, if one was wanted.
    pub saved: Result<(), CheckpointError>,
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
                tracing::error!("interrupted again; ended at once");
                std::process::exit(130);
            }
        };
        if let Err(e) = ctrlc::set_handler(handler) {
            tracing::warn!("interruptions cannot be caught ({e}); a checkpoint is written at intervals alone");
        }
        flag
    }))
}

/// Lets the first panic print its message and silences the rest: one fault strikes in every tile.
fn tell_one_panic_alone() {
    static TOLD: AtomicBool = AtomicBool::new(false);
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !TOLD.swap(true, Ordering::SeqCst) {
            hook(info);
        }
    }));
}

/// What the threads of a job share.
struct Shared {
    start: Instant,
    /// Sample number that the job began at.
    first: u64,
    stop: AtomicBool,
    /// Samples taken in this run, over all pixels.
    count: AtomicU64,
    /// Last estimate of the relative error.
    error: Mutex<Option<f64>>,
}

impl Job<'_> {
    /// Renders until the budget is used, or until interrupted.
    ///
    /// *Errors*: rendering panicked, which is a bug; the checkpoint is written all the same.
    pub fn run(&self, progress: &Progress, mut display: Display) -> Result<Done, Failure> {
        let interrupted = interruption();
        tell_one_panic_alone();
        let shared = Shared {
            start: Instant::now(),
            first: self.film.first + self.film.samples(),
            stop: AtomicBool::new(false),
            count: AtomicU64::new(0),
            error: Mutex::new(None),
        };
        let pixels = {
            let [x0, x1, y0, y1] = self.film.crop;
            f64::from(x1 - x0) * f64::from(y1 - y0)
        };
        let outcome = std::thread::scope(|s| {
            // An end is told by dropping a sender, which a panic does as well.
            let (working, at_work) = channel::<()>();
            let (keeping, kept) = channel::<()>();
            let worker = s.spawn(|| {
                let _working = working;
                self.work(&shared)
            });
            s.spawn(|| self.keep(&shared, &mut display, kept));
            while at_work.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                let out_of_time = matches!(self.budget, Budget::Time(limit) if shared.start.elapsed() > limit);
                if out_of_time || interrupted.load(Ordering::SeqCst) {
                    shared.stop.store(true, Ordering::Relaxed);
                }
                let done = shared.first as f64 + shared.count.load(Ordering::Relaxed) as f64 / pixels;
                let error = *shared.error.lock().unwrap_or_else(PoisonError::into_inner);
                let (share, left) = self.estimate(done, &shared, error);
                progress.show(share, done, left, error);
            }
            drop(keeping);
            worker.join()
        });
        progress.finish();
        let elapsed = shared.start.elapsed();
        if display.is_open() {
            display.show(&self.film.develop(self.factor));
        }
        let saved = self.checkpoint.as_ref().map_or(Ok(()), |c| c.save(self.film, elapsed));
        let Ok((statistics, complete)) = outcome else {
            let fate = match &saved {
                Ok(()) if self.checkpoint.is_some() => "; the checkpoint holds what was done".into(),
                Ok(()) => String::new(),
                Err(e) => format!("; {e}"),
            };
            return Err(Failure::Run(format!("rendering failed by a fault of this program, told above{fate}")));
        };
        // What had to be done is done, whatever was asked in the last moment.
        Ok(Done { statistics, interrupted: !complete && interrupted.load(Ordering::SeqCst), saved, elapsed })
    }

    /// Goes from pass to pass; returns the figures and whether the budget was used.
    fn work(&self, shared: &Shared) -> (Statistics, bool) {
        let mut total = Statistics::default();
        loop {
            let samples = levels(self.film).map(|n| self.film.first + n);
            let done = samples[0] - shared.first;
            let rate = (done > 0).then(|| done as f64 / shared.start.elapsed().as_secs_f64());
            let at = Standing { samples, rate, start: shared.start };
            let Some(end) = self.budget.next(&at, || self.film.develop(self.factor).relative_error()) else {
                return (total, true);
            };
            if shared.stop.load(Ordering::Relaxed) {
                return (total, false);
            }
            total.merge(&session::render(self.scene, self.integrator, self.film, end, &shared.stop, &shared.count));
        }
    }

    /// Writes checkpoints, feeds the viewer and estimates the error until told to end.
    fn keep(&self, shared: &Shared, display: &mut Display, end: Receiver<()>) {
        let now = Instant::now();
        // The viewer gets a first picture soon.
        let (mut saved, mut judged, mut next_shown) = (now, now, now + SHOWN_EVERY / 4);
        while end.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
            if let Some(c) = &self.checkpoint
                && c.every.is_some_and(|every| saved.elapsed() >= every)
            {
                if let Err(e) = c.save(self.film, shared.start.elapsed()) {
                    tracing::warn!("{e}; rendering goes on without this checkpoint");
                }
                saved = Instant::now();
            }
            if judged.elapsed() > JUDGED_EVERY {
                let error = self.film.develop(self.factor).relative_error();
                *shared.error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                judged = Instant::now();
            }
            if display.is_open() && Instant::now() > next_shown {
                display.show(&self.film.develop(self.factor));
                next_shown = Instant::now() + SHOWN_EVERY;
            }
        }
    }

    /// Returns the share of the work done and the time left, as far as they can be told.
    fn estimate(&self, done: f64, shared: &Shared, error: Option<f64>) -> (f64, Option<Duration>) {
        let elapsed = shared.start.elapsed().as_secs_f64();
        let first = shared.first as f64;
        let share = match self.budget {
            Budget::Samples(end) => (done - first) / (end as f64 - first).max(1.0),
            Budget::Time(limit) => {
                return (elapsed / limit.as_secs_f64(), limit.checked_sub(shared.start.elapsed()));
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
