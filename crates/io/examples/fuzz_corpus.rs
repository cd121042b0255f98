//! Feeds the readers with mutated files and prints what came of them: panics, the slowest file, the peak of memory.
//!
//! `cargo run --release -p moonmilk-io --example fuzz_corpus -- [FILES] [SEED]` (default 100 000 files of seed 1). A file that takes longer
//! than 10 s ends the program with its number; a peak of more than 1 GiB is a failure.

#[path = "../tests/corpus/mod.rs"]
mod corpus;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use corpus::{Corpus, Kind};
use moonmilk_io::fuzz;

/// Most memory of the whole run \[MiB\]: files are at most 64 KiB, and what they unpack to at most 16 MiB.
const MEMORY: u64 = 1024;

/// Peak of the process's resident memory in MiB, where the system tells it.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? >> 10)
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (files, seed) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(1));
    // A watchdog: a hang must end with the file's number.
    let begun: Arc<(AtomicU64, Mutex<(String, Instant)>)> =
        Arc::new((AtomicU64::new(0), Mutex::new((String::new(), Instant::now()))));
    let watched = begun.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let (what, since) = watched.1.lock().expect("no panic holds it").clone();
            if since.elapsed() > Duration::from_secs(10) {
                println!("HANG: {what}");
                std::process::exit(4);
            }
        }
    });
    std::panic::set_hook(Box::new(|info| println!("  {info}")));
    let corpus = Corpus::new();
    let mut panics = 0;
    for (kind, share) in [(Kind::Scene, 4), (Kind::Ply, 2), (Kind::Exr, 2), (Kind::Png, 2)] {
        let n = files * share / 10;
        let (mut accepted, mut slowest, start) = (0, (Duration::ZERO, 0), Instant::now());
        for i in 0..n {
            let bytes = corpus.file(kind, seed, i);
            begun.0.fetch_add(1, Ordering::Relaxed);
            let begin = Instant::now();
            *begun.1.lock().expect("no panic holds it") = (format!("{kind:?} {i} of seed {seed}"), begin);
            let outcome = std::panic::catch_unwind(|| match kind {
                Kind::Scene => fuzz::scene(&bytes, &corpus.others),
                Kind::Ply => fuzz::ply(&bytes),
                Kind::Exr => fuzz::exr(&bytes),
                Kind::Png => fuzz::texture(&bytes),
            });
            slowest = slowest.max((begin.elapsed(), i));
            match outcome {
                Ok(ok) => accepted += u64::from(ok),
                Err(_) => {
                    panics += 1;
                    println!("PANIC: {kind:?} {i} of seed {seed}");
                }
            }
        }
        println!(
            "{kind:?}: {n} files, {accepted} accepted, slowest {:.3} s (file {}), {:.1} s in all, peak memory {} MiB",
            slowest.0.as_secs_f64(),
            slowest.1,
            start.elapsed().as_secs_f64(),
            peak().map_or("?".into(), |p| p.to_string())
        );
    }
    println!("{} files, {panics} panics", begun.0.load(Ordering::Relaxed));
    if panics > 0 || peak().is_some_and(|p| p > MEMORY) {
        std::process::exit(4);
    }
}
