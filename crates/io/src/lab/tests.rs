//! Files of the laboratory: what is read, what is refused and where, what is written.

use moonmilk_lab::{Law, Source, run};
use moonmilk_optics::phase::function::PhaseFunction;

use super::{experiment_toml, mci, npz, tables};

const SKIN: &str = r#"unit = "cm"
photons = 2e3
n_below = 1.4
[source]
type = "pencil"
angle = 30
[[layer]]
name = "epidermis"
thickness = 0.01
n = 1.45
sigma_a = 5
sigma_s = 100
g = 0.8
[[layer]]
thickness = inf
n = 1.4
sigma_a = 0.5
sigma_s = 80
phase = { type = "two-lobe", weight = 0.9, g1 = 0.9, g2 = -0.2 }
[tally]
radius = { max = 0.5, bins = 5 }
depth = { max = 0.2, bins = 4 }
angle = { bins = 3 }
"#;

/// MCML's own sample, as it is handed around: comments behind values, blank lines, two runs.
const SAMPLE: &str = "####\n# Template\n####\n1.0                      # file version\n2   \t\t\t# number of runs\n\n### Specify data for run 1\nslab.mco  A   # output filename, ASCII/Binary\n1000      # No. of photons\n0.002 .01 # dz, dr\n10 20 9   # No. of dz, dr & da.\n\n1   # No. of layers\n1   # n for medium above.\n1 10 90 0.75 2E-2   # layer 1\n1   # n for medium below.\r\n\n\
half.mco A\n500 photons\n0.01 0.01\n4 5 1\n2\n1.0\n1.5 0 0 1 0.1\n1.5 10.0 90 0 1E+9\n1.0\n";

#[test]
fn toml_experiments_are_read_with_defaults() {
    let e = experiment_toml::parse("skin.toml", SKIN).unwrap();
    assert_eq!((e.photons, e.seed, e.n_above, e.n_below, e.unit.symbol()), (2000, 1, 1.0, 1.4, "cm"));
    assert!(matches!(e.source, Source::Pencil { angle } if (angle.to_degrees() - 30.0).abs() < 1e-12));
    assert_eq!((e.layers[1].name.as_str(), e.layers[1].thickness), ("2", f64::INFINITY));
    assert_eq!(e.layers[1].law, Law::from(PhaseFunction::TwoLobes { w: 0.9, g_1: 0.9, g_2: -0.2 }));
    assert_eq!(e.tallies.radius.unwrap().bins, 5);
    run(&e).unwrap();
}

#[test]
fn mistakes_in_toml_are_shown_where_they_are() {
    for (from, to, place, words) in [
        ("sigma_a = 5", "sigma_q = 5", "skin.toml:11:1", "unknown field `sigma_q`"),
        ("sigma_a = 5", "sigma_a = -5", "skin.toml:11:11", "layer 1 (epidermis): sigma_a = -5 is outside [0, inf)"),
        ("g = 0.8", "g = 1", "skin.toml:13:5", "g = 1 is outside (-1, 1)"),
        ("unit = \"cm\"", "unit = \"inch\"", "skin.toml:1:8", "unknown unit \"inch\""),
        ("photons = 2e3", "photons = 2.5", "skin.toml:2:11", "not a whole number"),
        ("angle = 30", "angle = ", "skin.toml:6", ""),
        ("bins = 5", "bins = 0", "skin.toml:21", "radius: bins = 0 is outside"),
        ("type = \"pencil\"", "type = \"laser\"", "skin.toml:", "unknown variant `laser`"),
        ("bins = 4", "bins = 4, unit = \"mm\"", "skin.toml:22", "unknown field `unit`"),
    ] {
        assert!(SKIN.contains(from));
        let e = experiment_toml::parse("skin.toml", &SKIN.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(e.starts_with(place) && e.contains(words), "{to}: {e}");
    }
}

#[test]
fn mcml_files_are_read_as_mcml_reads_them() {
    let m = mci::parse("sample.mci", SAMPLE).unwrap();
    assert_eq!(m.runs.len(), 2);
    let (a, b) = (&m.runs[0], &m.runs[1].experiment);
    assert_eq!((a.output.as_str(), a.experiment.photons, a.experiment.unit.symbol()), ("slab.mco", 1000, "cm"));
    let t = &a.experiment.tallies;
    assert_eq!((t.depth.unwrap().bins, t.radius.unwrap().bins, t.angle), (10, 20, Some(9)));
    assert!((t.radius.unwrap().max - 0.2).abs() < 1e-15);
    // A clear layer's g = 1 means nothing; a thick last layer is a half-space.
    assert_eq!((b.layers[0].sigma_s, b.layers[1].thickness), (0.0, f64::INFINITY));
    assert_eq!(m.warnings.len(), 1);
    assert!(m.warnings[0].contains("photons"), "{:?}", m.warnings);
    for r in &m.runs {
        run(&r.experiment).unwrap();
    }
}

#[test]
fn mistakes_in_mcml_files_are_shown_where_they_are() {
    for (from, to, words) in [
        ("1.0                      # file", "2.0                      # file", "sample.mci:4:1: version 2.0"),
        ("1 10 90 0.75 2E-2", "1 10 90 1.75 2E-2", "sample.mci:15:1: layer 1 (1): g = 1.75 is outside (-1, 1)"),
        ("1 10 90 0.75 2E-2", "1 10 90 0.75", "sample.mci:15:9: 4 of 5 values"),
        ("1 10 90 0.75 2E-2", "1 10 9o 0.75 2E-2", "sample.mci:15:6: \"9o\" is not a number"),
        ("10 20 9", "10 0 9", "sample.mci:11:4: 0 is not a whole number"),
        ("0.002 .01", "0 .01", "depth: max = 0 is outside"),
        ("1E+9\n1.0\n", "1E+9\n", "the file ends where the index of the medium below"),
        ("2   \t", "1e99\t", "sample.mci:5:1"),
    ] {
        assert!(SAMPLE.contains(from), "{from}");
        let e = mci::parse("sample.mci", &SAMPLE.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(e.contains(words), "{to}: {e}");
    }
    // No prefix of a file and no damaged byte makes it panic.
    for i in 0..SAMPLE.len() {
        let _ = mci::parse("x", &SAMPLE[..i]);
        let mut bytes = SAMPLE.as_bytes().to_vec();
        bytes[i] = b'7';
        let _ = mci::parse("x", std::str::from_utf8(&bytes).unwrap());
    }
}

#[test]
fn results_are_written_whole_in_every_format() {
    let r = run(&experiment_toml::parse("skin.toml", SKIN).unwrap()).unwrap();
    let text = tables::csv(&r);
    let width = text.lines().map(|l| l.split(',').count());
    assert!(width.clone().all(|w| w == 10), "{:?}", width.collect::<Vec<_>>());
    assert!(text.lines().count() > 60);
    let reflected = r.scalar("reflected").unwrap().mean;
    let line = text.lines().find(|l| l.starts_with("reflected,1,")).unwrap();
    assert_eq!(line.split(',').nth(8).unwrap().parse::<f64>().unwrap(), reflected);
    let json = tables::json(&r);
    assert_eq!(json["scalars"]["reflected"]["mean"].as_f64().unwrap(), reflected);
    assert_eq!(json["grids"]["fluence_rz"]["mean"].as_array().unwrap().len(), 20);

    // The archive, read back by its own directory.
    let z = npz::encode(&r);
    let end = z.len() - 22;
    assert_eq!(&z[end..end + 4], b"PK\x05\x06");
    let u16_at = |i: usize| usize::from(u16::from_le_bytes([z[i], z[i + 1]]));
    let u32_at = |i: usize| u32::from_le_bytes([z[i], z[i + 1], z[i + 2], z[i + 3]]) as usize;
    let (count, mut at) = (u16_at(end + 10), u32_at(end + 16));
    let mut names = Vec::new();
    for _ in 0..count {
        assert_eq!(&z[at..at + 4], b"PK\x01\x02");
        let (size, length, local) = (u32_at(at + 24), u16_at(at + 28), u32_at(at + 42));
        let name = std::str::from_utf8(&z[at + 46..at + 46 + length]).unwrap();
        let data = &z[local + 30 + length..local + 30 + length + size];
        assert_eq!(&data[..6], b"\x93NUMPY");
        let header = usize::from(u16::from_le_bytes([data[8], data[9]]));
        assert_eq!((10 + header) % 64, 0);
        if name == "reflected.npy" {
            assert_eq!(f64::from_le_bytes(data[10 + header..].try_into().unwrap()), reflected);
        }
        if name == "fluence_rz.npy" {
            assert!(std::str::from_utf8(&data[10..10 + header]).unwrap().contains("(5, 4,)"));
        }
        names.push(name.to_owned());
        at += 46 + length;
    }
    assert_eq!(at, end);
    for name in ["reflected.npy", "fluence_rz.npy", "fluence_rz_std_err.npy", "edges_r.npy", "units.npy"] {
        assert!(names.iter().any(|n| n == name), "{name}");
    }
}
