//! `compare`: figures, files, interruptions, and what is outside of a model's domain.

use std::fs;

use serde_json::Value;

use crate::common::{BALL, Ended, FLOOR, Folder, LIGHTS, channel, head};

fn scene() -> Folder {
    Folder::with_scene(&[&head([24, 18], 4), LIGHTS, FLOOR, BALL])
}

fn metrics(f: &Folder, folder: &str) -> Value {
    serde_json::from_slice(&f.bytes(&format!("{folder}/metrics.json"))).expect("JSON")
}

fn model<'a>(m: &'a Value, name: &str) -> &'a Value {
    let list = m["models"].as_array().expect("a list");
    list.iter().find(|v| v["name"] == name).unwrap_or_else(|| panic!("{name} in {list:?}"))
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v} is no number"))
}

#[test]
fn a_comparison_leaves_pictures_metrics_sheet_and_a_report_of_its_own() {
    let f = scene();
    fs::rename(f.path("scene.pbrt"), f.path("<b>&.pbrt")).expect("renamed");
    let r = f.succeed("compare <b>&.pbrt --subsurface dipole,normalized --spp 8 --reference-spp 16");
    let folder = "<b>&-compare";
    for name in ["path.exr", "dipole.exr", "normalized.exr", "tabulated.exr", "contact-sheet.png"] {
        assert!(f.exists(&format!("{folder}/{name}")), "{name}");
    }
    assert!(!f.exists(&format!("{folder}/dipole.exr.checkpoint")), "what is finished needs none");
    assert_eq!(f.bytes(&format!("{folder}/contact-sheet.png"))[1..4], *b"PNG");
    assert!(r.stdout.contains("dipole") && r.stdout.contains("geometry"), "{}", r.stdout);
    assert!(r.stdout.lines().take(12).all(|l| l.chars().count() <= 104), "{}", r.stdout);

    // The halves are those of the picture, and independent: they differ.
    let p = f.picture(&format!("{folder}/dipole.exr"));
    for c in ["R", "G", "B"] {
        let [a, b] = ["HalfA", "HalfB"].map(|l| channel(&p, &format!("{l}.{c}")));
        assert!(a != b);
        for ((a, b), m) in a.iter().zip(b).zip(channel(&p, c)) {
            // Rounding of three f32.
            assert!((0.5 * (a + b) - m).abs() <= 2e-7 * (a.abs() + b.abs()), "{a} {b} {m}");
        }
    }

    let m = metrics(&f, folder);
    assert_eq!(
        (&m["width"], &m["reference"]["name"], &m["budget"]),
        (&24.into(), &"path".into(), &"8 samples per pixel".into())
    );
    let body = &m["bodies"][0];
    // A sphere of radius .9 is sqrt(2) R thick everywhere by five rays; sigma_t' in red is 30.02.
    let thick = number(&body["thickness_transport_mfp"][0]);
    assert!((thick / (2f64.sqrt() * 0.9 * 30.02) - 1.0).abs() < 1e-3, "{thick}");
    assert!((number(&body["alpha_prime"][2]) - 20.0 / 20.3).abs() < 1e-5);
    let d = model(&m, "dipole");
    for (pointer, what) in [
        ("/ratio/mean", "energy"),
        ("/ratio/std_err", "its error"),
        ("/bias_rms/mean", "bias"),
        ("/rel_mse/total/mean", "relMSE"),
        ("/rel_mse/bias2/std_err", "error of the bias"),
        ("/rel_mse/variance/mean", "variance"),
        ("/flip", "FLIP"),
        ("/cost/seconds", "time"),
        ("/cost/spp", "samples"),
        ("/speed", "speed"),
        ("/error_budget/profile_l1", "profile"),
        ("/error_budget/geometry_energy", "geometry"),
        ("/error_budget/remaining_energy", "rest"),
        ("/fails/0/bins/0/ratio/mean", "bins"),
        ("/whole_picture/ratio/mean", "whole"),
    ] {
        let v = d.pointer(pointer).and_then(Value::as_f64);
        assert!(v.is_some_and(f64::is_finite), "{what}: {pointer} is {v:?} in {d}");
    }
    let b = &d["error_budget"];
    let parts = ["profile_energy", "geometry_energy", "remaining_energy"].map(|k| 1.0 + number(&b[k]));
    assert!((parts[0] * parts[1] * parts[2] - number(&d["ratio"]["mean"])).abs() < 1e-12);
    assert!(d["warnings"].is_array() && d["verdict"].is_string() && d["image"] == "dipole.exr");

    let html = String::from_utf8(f.bytes(&format!("{folder}/report.html"))).expect("text");
    for outside in ["http:", "https:", "src=\"/", "href=", "url(", "<b>&", "@import"] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(html.contains("&lt;b&gt;&amp;.pbrt") && html.matches("data:image/png;base64,").count() == 7);
}

#[test]
fn an_interrupted_comparison_keeps_what_is_finished_and_goes_on() {
    let f = scene();
    let command = "compare scene.pbrt --subsurface dipole --spp 256 --reference-spp 8 --checkpoint-every 0.02";
    f.succeed(&format!("{command} -o whole"));
    let mut run = f.start(&format!("{command} -o a"));
    run.until("a checkpoint of its second picture", || f.exists("a/dipole.exr.checkpoint"));
    run.signal("INT");
    let ended = run.end();
    assert_eq!(ended.code, Some(130), "{ended:?}");
    assert!(ended.stderr.contains("1 of 3 pictures are finished") && ended.stderr.contains("--resume"), "{ended:?}");
    let kept = f.bytes("a/path.exr");
    assert!(!f.exists("a/report.html") && f.exists("a/dipole.exr.checkpoint"));

    let other = f.run(&format!("{command} -o a --resume --seed 5"));
    assert!(other.code == Some(3) && other.stderr.contains("seed is \"5\", was \"0\""), "{other:?}");
    let other = f.run(&format!("{command} -o a --resume --spp 300").replace("--spp 256 ", ""));
    assert!(other.code == Some(3) && other.stderr.contains("the budget is samples 300, was samples 256"), "{other:?}");

    let resumed = f.succeed(&format!("{command} -o a --resume"));
    assert!(resumed.stderr.contains("1 of them finished"), "{}", resumed.stderr);
    assert!(f.bytes("a/path.exr") == kept, "what was finished was not rendered again");
    let [a, b] = ["a", "whole"].map(|d| f.picture(&format!("{d}/dipole.exr")));
    assert!(a.channels == b.channels, "interrupted and resumed, the picture is the same");
    assert!(!f.exists("a/dipole.exr.checkpoint"));
    let again = f.succeed(&format!("{command} -o a --resume"));
    assert!(again.stderr.contains("3 of them finished"), "{}", again.stderr);
}

#[test]
fn a_model_against_its_own_picture_has_no_bias() {
    let f = scene();
    f.succeed(
        "render scene.pbrt --subsurface dipole --wavelengths rgb --spp 256 --seed 77 --aov variance -o exact.exr",
    );
    f.succeed("compare scene.pbrt --subsurface dipole --reference exact.exr --spp 64 -o a");
    let m = metrics(&f, "a");
    let d = model(&m, "dipole");
    for (name, value) in [("ratio", 1.0), ("rel_mse/bias2", 0.0)] {
        let e = d.pointer(&format!("/{name}")).expect("there");
        let z = (number(&e["mean"]) - value) / number(&e["std_err"]);
        // 4.1 standard errors: 1e-4 two-sided after Sidak over the two.
        assert!(z.abs() < 4.1, "{name}: {e}");
    }
    // The test is sharp: were the noise of the picture taken for bias, it would be two standard errors and more.
    assert!(number(&d["rel_mse"]["bias2"]["std_err"]) < 0.5 * number(&d["rel_mse"]["variance"]["mean"]), "{d}");
    f.succeed("render scene.pbrt --subsurface dipole --wavelengths rgb --spp 4 -o plain.exr");
    let r = f.succeed("compare scene.pbrt --subsurface dipole --reference plain.exr --spp 2 -o b");
    assert!(r.stderr.contains("taken as free of noise"), "{}", r.stderr);
}

#[test]
fn models_outside_of_their_domain_are_told_and_unknown_ones_get_the_nearest() {
    let f = Folder::new();
    // Albedo .05, and a ball of half a mean free path.
    let thin = r#"AttributeBegin
  Material "subsurface" "rgb sigma_s" [.05 .05 .05] "rgb sigma_a" [.95 .95 .95] "float eta" 1.4
  Shape "sphere" "float radius" .4
AttributeEnd
"#;
    f.write("thin.pbrt", [&head([16, 12], 4), LIGHTS, thin].concat());
    let Ended { stderr, .. } = f.succeed("compare thin.pbrt --subsurface dipole --spp 2 -o a");
    assert!(stderr.contains("transport mean free paths thick"), "{stderr}");
    assert!(stderr.contains("dipole: sphere") && stderr.contains("outside of what the model describes"), "{stderr}");
    let m = metrics(&f, "a");
    assert!(m["notes"][0].as_str().is_some_and(|n| n.contains("thick")), "{m}");
    assert_eq!(model(&m, "dipole")["warnings"].as_array().map(Vec::len), Some(1));
    assert_eq!(model(&m, "tabulated")["warnings"].as_array().map(Vec::len), Some(0));

    // What cannot be rendered is an error if it was asked for by name, and left out of all.
    let r = f.run("compare thin.pbrt --subsurface dipole,dual-beam --spp 2 -o b");
    assert!(r.code == Some(3) && r.stderr.contains("dual-beam") && r.stderr.contains("eta"), "{r:?}");
    assert!(!f.exists("b/path.exr"), "found before anything is rendered");
    f.succeed("compare thin.pbrt --subsurface all --spp 2 --crop 4,12,3,9 -o d");
    let m = metrics(&f, "d");
    let left = &m["left_out"][0];
    assert!(left["name"] == "dual-beam" && left["reason"].as_str().is_some_and(|r| r.contains("eta")), "{left}");
    assert!(m["models"].as_array().is_some_and(|l| l.len() > 15 && l.iter().all(|v| v["name"] != "single")));
    for (list, told) in [("dipol", "did you mean \"dipole\"?"), ("dipole,hybrd", "available: path, "), ("", "or all")] {
        let r = f.run(&format!("compare thin.pbrt --subsurface={list} -o c"));
        assert!(r.code == Some(2) && r.stderr.contains(told), "{list}: {r:?}");
    }
    let r = f.run("compare thin.pbrt --spp 1 -o c");
    assert!(r.code == Some(2) && r.stderr.contains("2..="), "{r:?}");
}
