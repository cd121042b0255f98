//! Any division of the work gives the same bits.

use crate::common::{BALL, CLOUD, FLOOR, Folder, LIGHTS, head};

/// Several tiles, some of them cut, of unequal cost.
fn scene() -> Folder {
    Folder::with_scene(&[&head([40, 36], 20), LIGHTS, FLOOR, BALL])
}

#[test]
fn threads_and_folders_do_not_change_a_bit() {
    let f = scene();
    for (name, options) in
        [("hero", "--aov all"), ("rgb", "--wavelengths rgb"), ("mono", "--wavelengths 560 --crop 5,33,2,30")]
    {
        f.succeed(&format!("render scene.pbrt {options} -o {name}.exr"));
        let expected = f.bytes(&format!("{name}.exr"));
        for threads in [1, 2, 5] {
            f.succeed(&format!("render scene.pbrt {options} --threads {threads} -o {name}-{threads}.exr"));
            assert!(f.bytes(&format!("{name}-{threads}.exr")) == expected, "{name}, {threads} threads");
        }
        // The place of the scene on the disk is no part of it.
        let other = Folder::new();
        other.succeed(&format!("render {} {options} -o x.exr", f.path("scene.pbrt").display()));
        assert!(other.bytes("x.exr") == expected, "{name} from another folder");
    }
}

#[test]
fn sample_ranges_merge_to_the_bits_of_one_run() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 20 --aov all -o whole.exr");
    for (name, range) in [("a", "0..5"), ("b", "5..6"), ("c", "6..20")] {
        f.succeed(&format!("render scene.pbrt --samples {range} --aov all -o {name}.exr"));
    }
    f.succeed("merge c.exr.checkpoint a.exr.checkpoint b.exr.checkpoint -o merged.exr");
    assert!(f.bytes("merged.exr") == f.bytes("whole.exr"));
    assert!(f.bytes("merged.exr.checkpoint") == f.bytes("whole.exr.checkpoint"));
    // What was merged can be continued like any run.
    f.succeed("render scene.pbrt --resume --spp 27 --aov all -o merged.exr");
    f.succeed("render scene.pbrt --spp 27 --aov all -o longer.exr");
    assert!(f.bytes("merged.exr") == f.bytes("longer.exr"));

    let gap = f.run("merge a.exr.checkpoint c.exr.checkpoint -o gap.exr");
    assert_eq!(gap.code, Some(3));
    assert!(gap.stderr.contains("samples 6.. do not follow 0..5") && !f.exists("gap.exr"), "{gap:?}");
    f.succeed("render scene.pbrt --samples 5..6 --seed 9 --aov all -o other.exr");
    let other = f.run("merge a.exr.checkpoint other.exr.checkpoint -o x.exr");
    assert!(other.code == Some(3) && other.stderr.contains("seed"), "{other:?}");
}

#[test]
fn resuming_with_more_samples_equals_the_long_run() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 37 -o long.exr");
    for (i, steps) in [&[3, 37][..], &[1, 2, 17, 37]].into_iter().enumerate() {
        let name = format!("steps{i}.exr");
        for (k, spp) in steps.iter().enumerate() {
            let resume = if k > 0 { "--resume" } else { "" };
            f.succeed(&format!("render scene.pbrt --spp {spp} {resume} -o {name}"));
        }
        assert!(f.bytes(&name) == f.bytes("long.exr"), "{steps:?}");
    }
    // A range goes on as a range.
    f.succeed("render scene.pbrt --samples 4..9 -o part.exr");
    f.succeed("render scene.pbrt --samples 4..15 --resume -o part.exr");
    f.succeed("render scene.pbrt --samples 4..15 -o range.exr");
    assert!(f.bytes("part.exr") == f.bytes("range.exr"));
}

#[test]
fn resuming_another_render_is_refused_and_says_what_differs() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 4 -o a.exr");
    let picture = f.bytes("a.exr");
    for (options, named) in [
        ("--seed 7 --spp 8", "seed is \"7\", was \"0\""),
        ("--wavelengths rgb --spp 8", "wavelengths"),
        ("--max-depth 5 --spp 8", "max_depth"),
        ("--crop 0,8,0,8 --spp 8", "crop"),
        ("--aov depth --spp 8", "aov"),
        ("--open cap --spp 8", "open"),
        ("--samples 2..8", "the first sample is 2, was 0"),
        ("--spp 3", "holds samples up to 4"),
    ] {
        let r = f.run(&format!("render scene.pbrt --resume {options} -o a.exr"));
        assert!(r.code == Some(3) && r.stderr.contains(named), "{options}: {r:?}");
    }
    f.write("scene.pbrt", [&head([40, 36], 20), LIGHTS, CLOUD].concat());
    let r = f.run("render scene.pbrt --resume --spp 8 -o a.exr");
    assert!(r.code == Some(3) && r.stderr.contains("the scene"), "{r:?}");
    assert!(f.bytes("a.exr") == picture);
}

#[test]
fn damaged_or_missing_checkpoints_are_refused() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 2 -o a.exr");
    let good = f.bytes("a.exr.checkpoint");
    // Cut short at several places; one bit changed in header, hash and body; another file altogether.
    let mut bad: Vec<Vec<u8>> = [0, 20, 40, good.len() / 2, good.len() - 1].map(|n| good[..n].to_vec()).into();
    for at in [3, 30, 41, good.len() / 2, good.len() - 1] {
        bad.push(good.clone());
        bad.last_mut().expect("pushed")[at] ^= 4;
    }
    bad.push(f.bytes("a.exr"));
    for (i, bytes) in bad.iter().enumerate() {
        f.write("a.exr.checkpoint", bytes);
        let r = f.run("render scene.pbrt --resume --spp 4 -o a.exr");
        assert!(r.code == Some(3) && r.stderr.contains("damaged") && r.stderr.contains("anew"), "{i}: {r:?}");
        assert_eq!(f.run("merge a.exr.checkpoint -o m.exr").code, Some(3));
    }
    let r = f.run("render scene.pbrt --resume -o none.exr");
    assert!(r.code == Some(3) && r.stderr.contains("there is no checkpoint to resume"), "{r:?}");
}
