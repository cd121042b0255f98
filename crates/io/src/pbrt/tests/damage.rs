//! Damaged scenes end with an error or a scene, never with a panic.

use super::*;

/// A small generator of pseudo-random numbers [Marsaglia2003, xorshift64], fixed seed per test.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n.max(1) as u64) as usize
    }
}

const PIECES: [&str; 24] = [
    "[",
    "]",
    "\"",
    "\\",
    "#",
    "\n",
    "-1e999",
    "nan",
    "1e-40",
    "99999999999",
    "AttributeBegin ",
    "AttributeEnd ",
    "ObjectBegin \"o\" ",
    "ObjectEnd ",
    "ObjectInstance \"o\" ",
    "Include \"scene.pbrt\" ",
    "Import \"scene.pbrt\" ",
    "Scale 0 0 0 ",
    "WorldBegin ",
    "\"float x\" ",
    "Shape \"bilinearmesh\" ",
    "Texture \"t\" \"float\" \"mix\" ",
    "\u{0}",
    "\u{fffd}",
];

#[test]
fn damaged_scenes_never_panic() {
    let seeds = [
        MILK,
        "WorldBegin Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] Material \"subsurface\" \"texture reflectance\" \"t\" \"rgb mfp\" [1 2 3] ObjectBegin \"o\" Shape \"loopsubdiv\" \"integer levels\" 1 \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2] ObjectEnd ObjectInstance \"o\" Shape \"bilinearmesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  1 1 1] Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] Attribute \"material\" \"string moonmilk.set\" \"s\" MakeNamedMaterial \"a\" \"string type\" \"coatedconductor\" Material \"mix\" \"string materials\" [\"a\" \"a\"] LightSource \"spot\" LightSource \"infinite\" \"blackbody L\" 3000",
    ];
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let mut failed = 0;
    for round in 0..6000 {
        let mut bytes = seeds[round % 2].as_bytes().to_vec();
        for _ in 0..1 + dice.roll(4) {
            let (a, b) = (dice.roll(bytes.len()), dice.roll(bytes.len()));
            match dice.roll(5) {
                0 => drop(bytes.drain(a.min(b)..a.max(b).min(a.min(b) + 40))),
                1 => bytes[a] = dice.roll(256) as u8,
                2 => drop(bytes.splice(a..a, PIECES[dice.roll(PIECES.len())].bytes())),
                3 => bytes.truncate(a.max(1)),
                _ => {
                    let piece = bytes[a.min(b)..a.max(b).min(a.min(b) + 60)].to_vec();
                    drop(bytes.splice(a..a, piece));
                }
            }
            if bytes.is_empty() {
                bytes.push(b' ');
            }
        }
        let list = Memory(HashMap::from([("scene.pbrt", bytes)]));
        let options = Options { lenient: dice.roll(2) == 0, syntax_only: dice.roll(2) == 0, ..Options::default() };
        match load_with(&list, "scene.pbrt", &options) {
            Ok(_) => {}
            Err(error) => {
                failed += 1;
                assert!(!error.to_string().is_empty());
                if round % 50 == 0 {
                    assert!(!format!("{:?}", miette::Report::new(error)).is_empty());
                }
            }
        }
    }
    // The mutations must reach both outcomes, else they test nothing.
    assert!(failed > 1000 && failed < 5900, "{failed}");
}
