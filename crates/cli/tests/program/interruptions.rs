//! Ctrl-C, kill -9 and full disks: no work is lost but the last moments, and no bit changes.

use std::fs;
use std::time::Duration;

use moonmilk_core::{Random, Stream};

use crate::common::{BALL, FLOOR, Folder, LIGHTS, head, slow};

/// A scene that takes about a second on two cores at this number of samples.
const SPP: u32 = 90;

fn scene() -> Folder {
    Folder::with_scene(&[&head([64, 48], SPP), LIGHTS, FLOOR, BALL])
}

/// Renders without interruption; returns how long it took.
fn uninterrupted(f: &Folder) -> Duration {
    let run = f.start("render scene.pbrt -o whole.exr");
    let start = std::time::Instant::now();
    let ended = run.end();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    start.elapsed()
}

#[test]
fn killed_at_random_and_resumed_the_picture_is_the_same() {
    let f = scene();
    let whole = uninterrupted(&f).as_secs_f64();
    let wanted = if slow() { 20 } else { 5 };
    let mut random = Stream::new(&[0x9111]);
    let (mut kills, mut with_checkpoint, mut chains) = (0, 0, 0);
    while kills < wanted {
        // One chain: start, kill, resume, kill, ... until it is done or was killed often enough.
        chains += 1;
        let _ = fs::remove_file(f.path("a.exr.checkpoint"));
        let _ = fs::remove_file(f.path("a.exr"));
        loop {
            let resume = if f.exists("a.exr.checkpoint") { "--resume" } else { "" };
            let mut run = f.start(&format!("render scene.pbrt --checkpoint-every 0.02 {resume} -o a.exr"));
            let delay = Duration::from_secs_f64(0.5 * whole * f64::from(random.uniform()));
            while kills < wanted && run.elapsed() < delay && !run.has_ended() {
                std::thread::sleep(Duration::from_millis(1));
            }
            if kills == wanted || run.has_ended() {
                let ended = run.end();
                assert_eq!(ended.code, Some(0), "{ended:?}");
                break;
            }
            // None: ended by a signal. A run that was done just before counts as done.
            if run.kill().code.is_some() {
                assert!(f.exists("a.exr"));
                break;
            }
            kills += 1;
            if f.exists("a.exr.checkpoint") {
                with_checkpoint += 1;
                f.succeed("merge a.exr.checkpoint -o look.exr");
            }
        }
        assert!(f.bytes("a.exr") == f.bytes("whole.exr"), "after {kills} kills in {chains} chains");
        assert_eq!(f.hidden(), Vec::<String>::new(), "leftovers of killed runs are removed");
    }
    println!("{kills} kills in {chains} chains, {with_checkpoint} after a checkpoint; one run takes {whole:.2} s");
    assert!(with_checkpoint > 0);
}

#[test]
fn an_interruption_leaves_checkpoint_and_picture_and_resume_completes() {
    let f = scene();
    uninterrupted(&f);
    for (name, signal) in [("int.exr", "INT"), ("term.exr", "TERM")] {
        let checkpoint = format!("{name}.checkpoint");
        let mut run = f.start(&format!("render scene.pbrt --checkpoint-every 0.02 -o {name}"));
        run.until("its first checkpoint", || f.exists(&checkpoint));
        run.signal(signal);
        let ended = run.end();
        assert_eq!(ended.code, Some(130), "{ended:?}");
        assert!(ended.stderr.contains("interrupted") && ended.stderr.contains("--resume"), "{ended:?}");
        let spp: u32 = crate::common::text(&f.picture(name), "moonmilk.spp").parse().expect("a number");
        assert!(spp < SPP, "{spp}");
        // The checkpoint knows where the run was to end.
        f.succeed(&format!("render scene.pbrt --resume -o {name}"));
        assert!(f.bytes(name) == f.bytes("whole.exr"), "{signal}");
    }
}

#[test]
fn a_budget_given_before_the_interruption_is_kept_by_resume() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 130 -o direct.exr");
    let mut run = f.start("render scene.pbrt --spp 130 --checkpoint-every 0.02 -o a.exr");
    run.until("its first checkpoint", || f.exists("a.exr.checkpoint"));
    run.signal("INT");
    assert_eq!(run.end().code, Some(130));
    f.succeed("render scene.pbrt --resume -o a.exr");
    assert!(f.bytes("a.exr") == f.bytes("direct.exr"));
}

#[test]
fn a_second_interruption_does_not_wait() {
    // So many pixels that the checkpoint of the first interruption takes a while.
    let f = Folder::with_scene(&[&head([1400, 1000], 100_000), LIGHTS]);
    let mut run = f.start("render scene.pbrt --checkpoint-every 0 -o a.exr");
    run.until("having rendered a little", || false_after(1.0));
    run.signal("INT");
    std::thread::sleep(Duration::from_millis(60));
    run.signal("INT");
    let ended = run.end();
    assert_eq!(ended.code, Some(130), "{ended:?}");
    assert!(ended.stderr.contains("interrupted again"), "{ended:?}");
    assert!(!f.exists("a.exr") && !f.exists("a.exr.checkpoint"), "nothing half done takes a name");
}

/// Returns true once these seconds have passed since the first call on this thread.
fn false_after(seconds: f64) -> bool {
    thread_local!(static START: std::time::Instant = std::time::Instant::now());
    START.with(|s| s.elapsed().as_secs_f64() > seconds)
}

#[test]
fn a_picture_that_cannot_be_written_costs_no_samples() {
    let f = scene();
    uninterrupted(&f);
    let mut run = f.start("render scene.pbrt --checkpoint-every 0.02 -o a.exr");
    run.until("its first checkpoint", || f.exists("a.exr.checkpoint"));
    // A folder takes the picture's place while it is rendered: renaming a file onto it fails for every user.
    fs::create_dir(f.path("a.exr")).expect("created");
    let ended = run.end();
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("a.exr.checkpoint") && ended.stderr.contains("--resume"), "{ended:?}");
    // And before rendering the same is found at once.
    let again = f.run("render scene.pbrt --resume -o a.exr");
    assert!(again.code == Some(1) && again.stderr.contains("it is a folder"), "{again:?}");
    fs::remove_dir(f.path("a.exr")).expect("removed");
    f.succeed("render scene.pbrt --resume -o a.exr");
    assert!(f.bytes("a.exr") == f.bytes("whole.exr"));
}
