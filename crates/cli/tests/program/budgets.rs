//! `--time`, and what the budget means.

use moonmilk_io::checkpoint;

use crate::common::{BALL, FLOOR, Folder, LIGHTS, head, text};

/// Smallest and largest number of samples of the tiles of a checkpoint.
fn levels(f: &Folder, name: &str) -> [u64; 2] {
    let (_, film) = checkpoint::load(&f.path(name)).expect("a checkpoint");
    let all: Vec<u64> = (0..film.tile_count()).map(|i| film.tile(i).samples).collect();
    [*all.iter().min().expect("tiles"), *all.iter().max().expect("tiles")]
}

/// Seconds of rendering that the program reports.
fn seconds(stderr: &str) -> f64 {
    let (_, rest) = stderr.rsplit_once("samples per pixel in ").expect("the last line of a render");
    rest.split_whitespace().next().and_then(|s| s.parse().ok()).expect("a number")
}

#[test]
fn a_time_budget_is_kept_and_all_tiles_end_level() {
    let f = Folder::with_scene(&[&head([80, 64], 16), LIGHTS, FLOOR, BALL]);
    let ended = f.succeed("render scene.pbrt --time 2s -o a.exr");
    let s = seconds(&ended.stderr);
    let [least, most] = levels(&f, "a.exr.checkpoint");
    println!("{s} s, {least} to {most} samples");
    // The clock is read every 20 ms, a sample takes less than a millisecond; the rest is room for a busy machine.
    assert!((1.5..=2.5).contains(&s), "{s} s");
    // A pass is a twentieth of the budget at the measured rate, which is within a factor of two of the mean; tiles commit
    // four samples at a time.
    assert!(least > 0 && most - least <= most / 10 + 4, "{least} to {most}");
    assert_eq!(text(&f.picture("a.exr"), "moonmilk.spp"), least.to_string());
}

#[test]
fn a_time_too_short_for_a_sample_is_told() {
    let f = Folder::with_scene(&[&head([800, 600], 16), LIGHTS, FLOOR, BALL]);
    let ended = f.succeed("render scene.pbrt --time 30ms -o a.exr");
    assert!(ended.stderr.contains("no time for a first sample"), "{ended:?}");
    assert!(f.picture("a.exr").channels.iter().all(|c| c.data.iter().all(|x| x.is_finite())));
}

#[test]
fn a_run_by_error_equals_the_run_with_its_number_of_samples() {
    let f = Folder::with_scene(&[&head([24, 24], 16), LIGHTS, BALL]);
    f.succeed("render scene.pbrt --error 3% --aov variance -o a.exr");
    let spp = text(&f.picture("a.exr"), "moonmilk.spp").to_owned();
    f.succeed(&format!("render scene.pbrt --spp {spp} --aov variance -o b.exr"));
    assert!(f.bytes("a.exr") == f.bytes("b.exr"), "{spp} samples");
    let n: u64 = spp.parse().expect("a number");
    assert!(n.is_power_of_two() && n >= 16, "{n}");
    // Asking for less of a finished run changes nothing, asking for more goes on.
    f.succeed("render scene.pbrt --resume --error 5% --aov variance -o a.exr");
    assert!(f.bytes("a.exr") == f.bytes("b.exr"));
    f.succeed("render scene.pbrt --resume --error 2% --aov variance -o a.exr");
    let m: u64 = text(&f.picture("a.exr"), "moonmilk.spp").parse().expect("a number");
    assert!(m > n && m.is_power_of_two(), "{n} {m}");
}
