//! `profile`.

use crate::common::Folder;

#[test]
fn models_are_judged_by_monte_carlo_and_drawn() {
    let f = Folder::new();
    let arguments =
        "profile sigma_a=0.05,sigma_s=0.95,eta=1.33 --models dipole,better-dipole,photon-beam --photons 20000";
    let r = f.succeed(&format!("{arguments} -o a.svg -o a.png -o a.csv -o a.json"));
    // The exact albedo of the light that entered, within the noise of 20000 paths.
    let line = r.stdout.lines().find(|l| l.starts_with("Monte Carlo")).expect("the measurement");
    let albedo: f64 = line.split_whitespace().nth(2).and_then(|w| w.parse().ok()).expect("a number");
    assert!((albedo - 0.395918).abs() < 5.0 * 0.004, "{line}");
    let json: serde_json::Value = serde_json::from_slice(&f.bytes("a.json")).expect("JSON");
    let models = json["models"].as_array().expect("a list");
    let names: Vec<&str> = models.iter().filter_map(|m| m["name"].as_str()).collect();
    assert_eq!(names, ["dipole", "better-dipole", "photon-beam"]);
    // The classical dipole's profile is far off, photon beam diffusion's is within a tenth (physics notes, 9) and the noise of about 3 %.
    let l1 = |k: usize| models[k]["l1_error"].as_f64().expect("a number");
    assert!(l1(0) > 0.15 && l1(2) < 0.12, "{} {}", l1(0), l1(2));
    let svg = String::from_utf8(f.bytes("a.svg")).expect("text");
    assert!(svg.contains("photon-beam") && svg.contains("</svg>"));
    assert!(f.bytes("a.png").starts_with(b"\x89PNG"));
    assert!(f.bytes("a.csv").starts_with(b"r_from,r_to,monte_carlo,std_err,dipole,better-dipole,photon-beam"));
}

#[test]
fn what_is_not_known_is_told() {
    let f = Folder::new();
    for (arguments, code, told) in [
        ("profile mlik", 3, "did you mean"),
        ("profile sigma_q=1", 3, "sigma_a=A, sigma_s=S"),
        ("profile sigma_a=-1,sigma_s=1", 3, "sigma_a"),
        ("profile sigma_a=1,sigma_s=1 --models diploe", 2, "dipole"),
        ("profile sigma_a=1,sigma_s=0 --models dipole", 3, "sigma_s"),
        ("profile sigma_a=1,sigma_s=1 -o a.pdf", 2, ".svg, .png"),
    ] {
        let r = f.run(arguments);
        assert_eq!(r.code, Some(code), "{arguments}: {r:#?}");
        assert!(r.stderr.contains(told), "{arguments}: {}", r.stderr);
    }
}
