//! Every type of every directive: it is read, a slip in its name is an error with advice, and so is a parameter that nobody reads.

use super::*;

/// What a type is, how it is written with its least parameters (`{}` stands for the type), and the number of warnings it gives.
struct Case {
    what: &'static str,
    text: &'static str,
    kinds: &'static [(&'static str, &'static str, usize)],
}

const P4: &str = "\"point3 P\" [0 0 0  1 0 0  0 1 0  0 0 1]";

const CASES: [Case; 10] = [
    Case {
        what: "accelerator",
        text: "Accelerator \"{}\" {p} WorldBegin",
        kinds: &[("bvh", "", 0), ("kdtree", "", 0)],
    },
    Case {
        what: "camera",
        text: "Camera \"{}\" {p} WorldBegin",
        kinds: &[
            ("perspective", "", 0),
            ("orthographic", "", 0),
            ("spherical", "", 0),
            ("realistic", "\"string lensfile\" \"lens.dat\"", 1),
        ],
    },
    Case {
        what: "film",
        text: "Film \"{}\" {p} WorldBegin",
        kinds: &[("rgb", "", 0), ("gbuffer", "", 0), ("spectral", "", 1)],
    },
    Case {
        what: "filter",
        text: "PixelFilter \"{}\" {p} WorldBegin",
        kinds: &[("box", "", 0), ("gaussian", "", 0), ("mitchell", "", 0), ("sinc", "", 0), ("triangle", "", 0)],
    },
    Case {
        what: "sampler",
        text: "Sampler \"{}\" {p} WorldBegin",
        kinds: &[
            ("halton", "", 0),
            ("independent", "", 0),
            ("paddedsobol", "", 0),
            ("pmj02bn", "", 0),
            ("sobol", "", 0),
            ("stratified", "", 0),
            ("zsobol", "", 0),
        ],
    },
    Case {
        what: "integrator",
        text: "Integrator \"{}\" {p} WorldBegin",
        kinds: &[
            ("path", "", 0),
            ("volpath", "", 0),
            ("simplepath", "", 0),
            ("simplevolpath", "", 0),
            ("bdpt", "", 1),
            ("mlt", "", 1),
            ("sppm", "", 1),
            ("lightpath", "", 1),
            ("randomwalk", "", 1),
            ("ao", "", 1),
            ("function", "", 1),
        ],
    },
    Case {
        what: "shape",
        text: "WorldBegin Shape \"{}\" {p}",
        kinds: &[
            ("sphere", "", 0),
            ("disk", "", 0),
            ("cylinder", "", 0),
            ("trianglemesh", "{P4} \"integer indices\" [0 1 2]", 0),
            ("bilinearmesh", "{P4} \"integer indices\" [0 1 2 3]", 0),
            ("loopsubdiv", "{P4} \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2]", 0),
            ("plymesh", "\"string filename\" \"a.ply\"", 0),
            ("curve", "{P4}", 0),
        ],
    },
    Case {
        what: "material",
        text: "WorldBegin Material \"{}\" {p} Shape \"sphere\"",
        kinds: &[
            ("coatedconductor", "", 0),
            ("coateddiffuse", "", 0),
            ("conductor", "", 0),
            ("dielectric", "", 0),
            ("diffuse", "", 0),
            ("diffusetransmission", "", 0),
            ("hair", "", 0),
            ("measured", "\"string filename\" \"a.bsdf\"", 1),
            ("subsurface", "", 0),
            ("thindielectric", "", 0),
        ],
    },
    Case {
        what: "light",
        text: "WorldBegin LightSource \"{}\" {p}",
        kinds: &[
            ("distant", "", 0),
            ("goniometric", "\"string filename\" \"sky.hdr\"", 0),
            ("infinite", "", 0),
            ("point", "", 0),
            ("projection", "\"string filename\" \"sky.hdr\"", 0),
            ("spot", "", 0),
        ],
    },
    Case {
        what: "area light",
        text: "WorldBegin AreaLightSource \"{}\" {p} Shape \"sphere\"",
        kinds: &[("diffuse", "", 0)],
    },
];

/// Loads a scene beside the files that the cases name.
fn load(text: &str) -> Result<Loaded, LoadError> {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x81";
    let files = Memory(HashMap::from([
        ("s", text.as_bytes().to_vec()),
        ("a.ply", ply.as_bytes().to_vec()),
        ("sky.hdr", sky.to_vec()),
        ("lens.dat", b"50 0.1 1.5 20 -50 5 1 20".to_vec()),
    ]));
    load_with(&files, "s", &Options::default())
}

fn text_of(case: &Case, kind: &str, parameters: &str) -> String {
    case.text.replace("{}", kind).replace("{p}", parameters).replace("{P4}", P4)
}

#[test]
fn every_type_is_read_with_at_most_one_warning() {
    for case in &CASES {
        for (kind, parameters, warnings) in case.kinds {
            let loaded = load(&text_of(case, kind, parameters)).unwrap_or_else(|e| panic!("{} {kind}: {e}", case.what));
            let given: Vec<&str> = loaded.warnings.iter().map(|w| w.message.as_str()).collect();
            assert_eq!(given.len(), *warnings, "{} {kind}: {given:?}", case.what);
        }
    }
}

#[test]
fn a_slip_in_a_type_is_an_error_that_suggests_it() {
    for case in &CASES {
        for (kind, parameters, _) in case.kinds {
            // Swap the second and third letter; two-letter names get a third.
            let mut slip: Vec<char> = kind.chars().collect();
            if slip.len() > 2 && slip[1] != slip[2] {
                slip.swap(1, 2)
            } else {
                slip.push('x')
            }
            let slip: String = slip.into_iter().collect();
            let error = load(&text_of(case, &slip, parameters)).expect_err("no such type");
            let first = &error.problems()[0];
            assert!(first.message.starts_with(&format!("`{slip}` is no type of {}", case.what)), "{first}");
            let help = first.help.as_deref().unwrap_or_default();
            assert!(help.contains(&format!("did you mean `{kind}`?")), "{slip}: {help}");
            assert!(first.place.is_some());
        }
    }
}

#[test]
fn a_parameter_that_nobody_reads_is_an_error_everywhere() {
    for case in &CASES {
        for (kind, parameters, _) in case.kinds {
            let error =
                load(&text_of(case, kind, &format!("{parameters} \"float zzyzx\" 1"))).expect_err("no such parameter");
            let first = &error.problems()[0];
            assert!(first.message.ends_with("has no parameter `zzyzx`"), "{} {kind}: {first}", case.what);
            assert!(
                first.help.as_deref().is_some_and(|h| h.starts_with("accepted: ") || h == "it takes none"),
                "{first}"
            );
        }
    }
}

#[test]
fn directives_are_known_or_an_error() {
    let (text, help) = problem("WorldBegin Shpe \"sphere\"");
    assert!(text.contains("`Shpe`") && help.contains("`Shape`"), "{text} {help}");
}
