//! `simulate` on scenes.

use crate::common::Folder;

/// A translucent ball, a detector, and a light of some kind.
fn scene(light: &str) -> String {
    format!(
        r#"Camera "perspective"
WorldBegin
{light}
AttributeBegin
  Material "subsurface" "rgb sigma_a" [0 0 .5] "rgb sigma_s" [4 4 4] "float eta" 1.4
  Shape "sphere" "float radius" 1
AttributeEnd
AttributeBegin
  Material "diffuse"
  Translate 0 0 3
  Shape "disk" "float radius" 1
AttributeEnd
"#
    )
}

const SKY: &str = "LightSource \"infinite\" \"rgb L\" [1 1 1]";

fn number(text: &str, name: &str) -> f64 {
    let line =
        text.lines().find(|l| l.split_whitespace().next() == Some(name)).unwrap_or_else(|| panic!("{name}: {text}"));
    line.split_whitespace().nth(1).and_then(|w| w.parse().ok()).expect("a number")
}

#[test]
fn bodies_of_scenes_have_their_mean_path_and_their_grids() {
    let f = Folder::new();
    f.write("a.pbrt", scene(SKY));
    let r = f.succeed("simulate a.pbrt --photons 40000");
    // 4 eta^2 V / S of a ball: 4 / 3 eta^2. The detector takes light from one side: what shines on the ball is not uniform, and a path
    // from there is as long as any other in a ball that does not absorb, but for how it enters: 3 %, and noise of 1 %.
    let path = number(&r.stdout, "path.sphere") / number(&r.stdout, "incident.sphere");
    assert!((path / (4.0 / 3.0 * 1.96) - 1.0).abs() < 0.05, "{path}\n{}", r.stdout);
    assert!(number(&r.stdout, "detected.disk") > 0.05 && number(&r.stdout, "absorbed.sphere") == 0.0);
    assert!(r.stderr.contains("disk bounds no medium: it is a detector"), "{}", r.stderr);
    let blue = f.succeed("simulate a.pbrt --photons 4000 --channel blue");
    let share = number(&blue.stdout, "absorbed.sphere") / number(&blue.stdout, "incident.sphere");
    assert!(share > 0.1 && share < 1.0, "{}", blue.stdout);

    f.succeed("simulate a.pbrt --photons 2000 --tally fluence=12,absorption=6 --threads 1 -o a.csv");
    f.succeed("simulate a.pbrt --photons 2000 --tally fluence=12 --tally absorption=6 --threads 3 -o b.csv");
    assert_eq!(f.bytes("a.csv"), f.bytes("b.csv"));
    let csv = String::from_utf8(f.bytes("a.csv")).expect("text");
    assert!(csv.starts_with("quantity,unit,axis_1,from_1,to_1,axis_2,from_2,to_2,axis_3,from_3,to_3,mean,std_err\n"));
    assert_eq!(csv.lines().filter(|l| l.starts_with("fluence_xyz,1/mm^2,x,")).count(), 12 * 12 * 12);
    f.succeed("simulate a.pbrt --photons 2000 --tally fluence=5 -o a.npz -q");
    f.succeed("simulate a.pbrt --photons 2000 --tally fluence=5 -o a.json");
    let json: serde_json::Value = serde_json::from_slice(&f.bytes("a.json")).expect("JSON");
    assert_eq!(json["grids"]["fluence_xyz"]["axes"].as_array().map(Vec::len), Some(3));
}

#[test]
fn every_kind_of_light_that_is_accepted_shines() {
    let f = Folder::new();
    for (light, name) in [
        ("LightSource \"distant\" \"point3 from\" [0 0 -5] \"point3 to\" [0 0 0]", "incident.sphere"),
        ("LightSource \"point\" \"point3 from\" [0 0 -2]", "incident.sphere"),
        (
            "LightSource \"spot\" \"point3 from\" [0 0 -4] \"point3 to\" [0 0 0] \"float coneangle\" 1",
            "incident.sphere",
        ),
        ("LightSource \"point\" \"point3 from\" [0 .2 0]", "detected.disk"),
    ] {
        f.write("b.pbrt", scene(light));
        let r = f.succeed("simulate b.pbrt --photons 4000");
        assert!(number(&r.stdout, name) > 0.015, "{light}: {}", r.stdout);
    }
    // A square above the ball that shines down: from its middle the ball fills a cone of sine 1/3, so a share of 1/9 of Lambertian light.
    let square = r#"AttributeBegin
  AreaLightSource "diffuse" "rgb L" [1 1 1]
  Shape "trianglemesh" "point3 P" [-.01 3 -.01  .01 3 -.01  .01 3 .01  -.01 3 .01] "integer indices" [0 1 2 0 2 3]
AttributeEnd"#;
    f.write("c.pbrt", scene(square));
    let r = f.succeed("simulate c.pbrt --photons 20000");
    // 20000 paths: a standard error of .0022.
    let share = number(&r.stdout, "incident.sphere");
    assert!((share - 1.0 / 9.0).abs() < 5.0 * 0.0022, "{}", r.stdout);
}

#[test]
fn what_a_scene_has_beyond_that_is_refused_with_its_place() {
    let f = Folder::new();
    let good = scene(SKY);
    for (text, told) in [
        (scene(""), "there are 0 lights"),
        (scene(&format!("{SKY}\n{SKY}")), "there are 2 lights"),
        (
            good.replace("Material \"diffuse\"", "Material \"dielectric\""),
            "c.pbrt:11:3: a refractive surface without a medium",
        ),
        (good.replace("\"float eta\" 1.4", "\"float eta\" 1.4 \"float roughness\" .2"), "c.pbrt:6:3: rough boundaries"),
        (good.replace("Material \"diffuse\"", "AreaLightSource \"diffuse\""), "of the shapes that shine, meshes alone"),
        (good.replace("Shape \"sphere\"", "AreaLightSource \"diffuse\" Shape \"sphere\""), "bodies that shine"),
        (good.replace("Translate 0 0 3", "Translate 0 0 .5"), "sphere and disk overlap or touch"),
        (
            good.replace(
                "\"float radius\" 1\nAttributeEnd\nAttributeBegin",
                "\"float radius\" 1 \"float zmax\" .5\nAttributeEnd\nAttributeBegin",
            ),
            "sphere: its surface is open",
        ),
    ] {
        f.write("c.pbrt", text);
        let r = f.run("simulate c.pbrt --photons 4000");
        assert_eq!(r.code, Some(3), "{told}: {r:#?}");
        assert!(r.stderr.contains(told), "{told}: {}", r.stderr);
    }
    f.write("d.pbrt", good);
    for (arguments, told) in
        [("--tally radius=3", "fluence=N"), ("--tally fluence=x", "fluence=N"), ("--unit furlong", "um, mm, cm, m")]
    {
        let r = f.run(&format!("simulate d.pbrt {arguments}"));
        assert_eq!(r.code, Some(2), "{arguments}: {r:#?}");
        assert!(r.stderr.contains(told), "{arguments}: {}", r.stderr);
    }
    let r = f.run("simulate d.pbrt --tally fluence=1000");
    assert_eq!(r.code, Some(3), "{r:#?}");
    assert!(r.stderr.contains("1048576 are the most"), "{}", r.stderr);
    f.write("e.toml", "unit = \"mm\"\n[[layer]]\nname = \"a\"\nthickness = 1\nn = 1.0\nsigma_a = 1\nsigma_s = 1\n");
    let r = f.run("simulate e.toml --tally fluence=3");
    assert_eq!(r.code, Some(2), "{r:#?}");
}
