//! `material`: a measured material in the numbers of any program, with what each of them loses.

use std::fmt::Write as _;
use std::io::{self, Write};

use moonmilk_optics::conventions::Conventions;
use moonmilk_optics::materials::{self, Material as Measured};
use moonmilk_optics::skin::{self, Skin};
use moonmilk_optics::{Error, OpticalProperties};

use crate::Outcome;
use crate::args::{Convention, Material};
use crate::failure::Failure;

/// A name and the number that stands for it.
type Row = (&'static str, fn(&Conventions) -> f64);

/// Wavelengths that stand for red, green and blue where a spectrum is reduced to three numbers \[nm\].
const RGB_NM: [f64; 3] = [610.0, 550.0, 465.0];

/// Skins by name: fractions of melanin, eumelanin in it, blood, and oxygenation. Melanin after \[Jacques1998\]: 1.3 to 6.3, 11 to 16, 18 to 43 % of the epidermis.
const SKINS: [(&str, [f64; 4]); 3] = [
    ("Skin Light", [0.03, 0.7, 0.02, 0.75]),
    ("Skin Moderate", [0.13, 0.7, 0.02, 0.75]),
    ("Skin Dark", [0.3, 0.9, 0.02, 0.75]),
];

/// A material with the coefficients of its three colours in 1/mm.
struct Colours {
    name: &'static str,
    source: &'static str,
    /// Exactly what the source measured, or only its reduction.
    anisotropic: bool,
    rgb: [Conventions; 3],
    layered: Option<Skin>,
}

/// Prints one material or the list.
pub fn run(a: &Material) -> Outcome {
    let text = match &a.name {
        None => list(),
        Some(name) => {
            let m = find(name).map_err(|e| Failure::Usage(e.to_string()))?;
            m.print(a.convention)
        }
    };
    // A reader that has seen enough closes the pipe; that is no failure.
    let _ = io::stdout().write_all(text.as_bytes());
    Ok(())
}

fn list() -> String {
    let mut text =
        format!("{:<28}{:<17}{:<7}{}\n", "material", "source", "index", "sigma_s', sigma_a of red, green, blue [1/mm]");
    for m in &materials::MATERIALS {
        let _ =
            writeln!(text, "{:<28}{:<17}{:<7}{}  {}", m.name, m.source, m.eta, row(m.sigma_s_prime), row(m.sigma_a));
    }
    for (name, f) in SKINS {
        let [melanin, eumelanin, blood, _] = f;
        let _ = writeln!(
            text,
            "{name:<28}{:<17}{:<7}spectral, two layers: melanin {melanin}, eumelanin {eumelanin}, blood {blood}",
            "Donner2006",
            skin::ETA
        );
    }
    text + "\n`moonmilk material NAME --as CONVENTION`: coefficients, reduced, albedo-mfp, pbrt, mitsuba, openpbr, cycles, gltf\n"
}

fn row(x: [f32; 3]) -> String {
    format!("[{} {} {}]", x[0], x[1], x[2])
}

/// Returns the colours of a measured material or a skin.
fn find(name: &str) -> Result<Colours, Error> {
    let plain = |s: &str| s.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
    if let Some((name, [melanin, eumelanin, blood, oxygenation])) = SKINS.iter().find(|(n, _)| plain(n) == plain(name))
    {
        let skin = Skin::new(*melanin, *eumelanin, *blood, *oxygenation)?;
        let dermis = |l: f64| Conventions::new(&skin.layers(l)?[1]);
        let rgb = [dermis(RGB_NM[0])?, dermis(RGB_NM[1])?, dermis(RGB_NM[2])?];
        return Ok(Colours { name, source: "Donner2006", anisotropic: false, rgb, layered: Some(skin) });
    }
    let m = materials::find(name)?;
    let colour = |k: usize| Conventions::new(&properties(m, k)?);
    let rgb = [colour(0)?, colour(1)?, colour(2)?];
    Ok(Colours { name: m.name, source: m.source, anisotropic: m.anisotropic().is_some(), rgb, layered: None })
}

fn properties(m: &Measured, k: usize) -> Result<OpticalProperties, Error> {
    m.properties(k)
}

impl Colours {
    /// Formats one number of each colour, with enough digits to compute with.
    fn numbers(&self, f: impl Fn(&Conventions) -> f64) -> String {
        self.rgb.iter().map(|c| number(f(c))).collect::<Vec<_>>().join(" ")
    }

    fn list(&self, f: impl Fn(&Conventions) -> f64) -> String {
        self.rgb.iter().map(|c| number(f(c))).collect::<Vec<_>>().join(", ")
    }

    /// The mean asymmetry, for programs that have one for all colours.
    fn mean_g(&self) -> f64 {
        self.rgb.iter().map(|c| c.properties.g()).sum::<f64>() / 3.0
    }

    fn one_g(&self) -> bool {
        self.rgb.iter().all(|c| c.properties.g() == self.rgb[0].properties.g())
    }

    fn eta(&self) -> f64 {
        self.rgb[0].properties.eta()
    }

    fn print(&self, convention: Convention) -> String {
        let mut text = format!(
            "# {}, source {}, index {}; lengths in mm, coefficients in 1/mm, red green blue\n",
            self.name,
            self.source,
            self.eta()
        );
        let (body, lost) = match convention {
            Convention::Coefficients => self.coefficients(),
            Convention::Reduced => self.reduced(),
            Convention::AlbedoMfp => self.albedo_mfp(),
            Convention::Pbrt => self.pbrt(),
            Convention::Mitsuba => self.mitsuba(),
            Convention::Openpbr => self.openpbr(),
            Convention::Cycles => self.cycles(),
            Convention::Gltf => self.gltf(),
        };
        text += &body;
        for l in lost.into_iter().chain(self.lost_before()) {
            let _ = writeln!(text, "# lost: {l}");
        }
        text
    }

    /// What the table itself has lost already.
    fn lost_before(&self) -> Vec<String> {
        if self.layered.is_some() {
            return vec![
                "the epidermis, a layer of about .25 mm over this dermis, with its melanin (--as coefficients prints both over the wavelength)".into(),
                "the spectrum: three wavelengths stand for red, green and blue".into(),
            ];
        }
        let mut lost = vec!["the spectrum: the source has three colours".into()];
        if !self.anisotropic {
            lost.push("the phase function: the table holds reduced coefficients, g = 0 stands for them".into());
        }
        lost
    }

    fn coefficients(&self) -> (String, Vec<String>) {
        let mut text = String::new();
        if let Some(s) = &self.layered {
            let _ = writeln!(
                text,
                "{:<8}{:>12}{:>12}{:>12}{:>12}",
                "nm", "sigma_a epi", "sigma_s'", "sigma_a derm", "sigma_s'"
            );
            for l in (0..=32).map(|i| 380.0 + 12.5 * f64::from(i)) {
                let [e, d] = s.layers(l).expect("within the table of haemoglobin");
                let _ = writeln!(
                    text,
                    "{l:<8}{:>12}{:>12}{:>12}{:>12}",
                    number(e.sigma_a()),
                    number(e.sigma_s()),
                    number(d.sigma_a()),
                    number(d.sigma_s())
                );
            }
        }
        let _ = writeln!(text, "sigma_a = {}", self.numbers(|c| c.properties.sigma_a()));
        let _ = writeln!(text, "sigma_s = {}", self.numbers(|c| c.properties.sigma_s()));
        let _ = writeln!(text, "g       = {}", self.numbers(|c| c.properties.g()));
        let _ = writeln!(text, "alpha   = {}", self.numbers(|c| c.properties.alpha()));
        (text, Vec::new())
    }

    fn reduced(&self) -> (String, Vec<String>) {
        let rows: [Row; 6] = [
            ("sigma_a", |c| c.properties.sigma_a()),
            ("sigma_s'", |c| c.properties.sigma_s_prime()),
            ("alpha'", |c| c.properties.alpha_prime()),
            ("D [mm]", |c| c.properties.diffusion()),
            ("sigma_tr", |c| c.properties.sigma_tr()),
            ("dmfp [mm]", |c| c.dmfp),
        ];
        let text = rows.iter().fold(String::new(), |t, (n, f)| t + &format!("{n:<10}= {}\n", self.numbers(f)));
        let lost = if self.anisotropic {
            vec![
                "g and sigma_s apart: only sigma_s (1 - g) remains; near the source and in thin parts that shows"
                    .into(),
            ]
        } else {
            Vec::new()
        };
        (text, lost)
    }

    fn albedo_mfp(&self) -> (String, Vec<String>) {
        let rows: [Row; 5] = [
            ("albedo, normal", |c| c.albedo_normal),
            ("albedo, diffuse", |c| c.albedo_diffuse),
            ("mfp [mm]", |c| c.mfp),
            ("reduced mfp [mm]", |c| c.mfp_reduced),
            ("dmfp [mm]", |c| c.dmfp),
        ];
        let text = rows.iter().fold(String::new(), |t, (n, f)| t + &format!("{n:<17}= {}\n", self.numbers(f)));
        let mut lost = vec!["nothing if index and g go along: albedo (of entered light, with the boundary) and mfp determine the medium".into()];
        if !self.rgb.iter().all(|c| c.properties.g() == 0.0) {
            lost.push("exactness of the albedo: for g other than 0 it is that of the reduced medium (1 % off above .5, 30 % at .1)".into());
        }
        (text, lost)
    }

    fn pbrt(&self) -> (String, Vec<String>) {
        let g = self.mean_g();
        // One g for all colours: keep sigma_s (1 - g).
        let s = self.numbers(|c| c.properties.sigma_s_prime() / (1.0 - g));
        let text = format!(
            "Material \"subsurface\"\n    \"rgb sigma_a\" [ {} ]\n    \"rgb sigma_s\" [ {s} ]\n    \"float g\" {} \"float eta\" {} \"float scale\" 1\n",
            self.numbers(|c| c.properties.sigma_a()),
            number(g),
            self.eta()
        );
        let mut lost = vec!["the unit: pbrt's coefficients are per scene unit; scale = mm per scene unit".into()];
        if !self.one_g() {
            lost.push("g per colour: their mean is used, sigma_s chosen so that sigma_s (1 - g) stays".into());
        }
        (text, lost)
    }

    fn mitsuba(&self) -> (String, Vec<String>) {
        let g = self.mean_g();
        // sigma_t and albedo with one g: keep sigma_a and sigma_s (1 - g).
        let sigma_s = |c: &Conventions| c.properties.sigma_s_prime() / (1.0 - g);
        let sigma_t = self.list(|c| c.properties.sigma_a() + sigma_s(c));
        let albedo = self.list(|c| sigma_s(c) / (c.properties.sigma_a() + sigma_s(c)));
        let text = format!(
            "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"{}\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>\n\
             <medium name=\"interior\" type=\"homogeneous\">\n    <rgb name=\"sigma_t\" value=\"{sigma_t}\"/>\n    <rgb name=\"albedo\" value=\"{albedo}\"/>\n    \
             <float name=\"scale\" value=\"1\"/>\n    <phase type=\"hg\"><float name=\"g\" value=\"{}\"/></phase>\n</medium>\n",
            self.eta(),
            number(g)
        );
        let mut lost = vec!["the unit: Mitsuba's coefficients are per scene unit; scale = mm per scene unit".into()];
        if !self.one_g() {
            lost.push("g per colour: their mean is used, sigma_s chosen so that sigma_s (1 - g) stays".into());
        }
        (text, lost)
    }

    fn openpbr(&self) -> (String, Vec<String>) {
        let g = self.mean_g();
        let sigma_s = |c: &Conventions| c.properties.sigma_s_prime() / (1.0 - g);
        let radius: [f64; 3] = [0, 1, 2].map(|k| 1.0 / (self.rgb[k].properties.sigma_a() + sigma_s(&self.rgb[k])));
        let largest = radius.iter().fold(0.0f64, |m, &r| m.max(r));
        let colour = self.list(|c| {
            moonmilk_optics::conventions::kulla_conty_albedo(sigma_s(c) / (c.properties.sigma_a() + sigma_s(c)), g)
        });
        let scale = radius.map(|r| number(r / largest)).join(", ");
        let text = format!(
            "subsurface_weight = 1\nsubsurface_color = {colour}\nsubsurface_radius = {}\nsubsurface_radius_scale = {scale}\nsubsurface_scatter_anisotropy = {}\nspecular_ior = {}\n",
            number(largest),
            number(g),
            self.eta()
        );
        let mut lost = vec![
            "the meaning of the colour: these lead back to the medium through the formula that the specification suggests, which is the albedo for diffuse light \
             without boundary; the specification defines normal incidence"
                .into(),
            "the unit: the radius is in scene units".into(),
        ];
        if !self.one_g() {
            lost.push("g per colour: their mean is used, sigma_s chosen so that sigma_s (1 - g) stays".into());
        }
        (text, lost)
    }

    fn cycles(&self) -> (String, Vec<String>) {
        let largest = self.rgb.iter().fold(0.0f64, |m, c| m.max(c.mfp_reduced));
        let text = format!(
            "Principled BSDF, Subsurface Method: Random Walk (linear colours)\nBase Color = {}\nSubsurface Weight = 1\nSubsurface Radius = {}\nSubsurface Scale = {}\nIOR = {}\nSubsurface Anisotropy = 0\n",
            self.list(|c| c.colour_reduced),
            self.list(|c| c.mfp_reduced / largest),
            number(largest),
            self.eta()
        );
        let mut lost = vec![
            "the boundary inside the object: paths enter diffusely and are not reflected back in, so that the object is brighter and sharper than measured".into(),
            "the unit: the scale is in scene units (Blender's metres unless set otherwise)".into(),
        ];
        if self.rgb.iter().any(|c| c.properties.g() != 0.0) {
            lost.push("g: the reduced medium is used, since the meaning of the radius changes with the anisotropy between versions".into());
        }
        (text, lost)
    }

    fn gltf(&self) -> (String, Vec<String>) {
        let g = self.mean_g();
        let sigma_s = |c: &Conventions| c.properties.sigma_s_prime() / (1.0 - g);
        let sigma_t = |c: &Conventions| c.properties.sigma_a() + sigma_s(c);
        let distance = 3.0 / self.rgb.iter().map(sigma_t).sum::<f64>();
        let text = format!(
            "\"KHR_materials_ior\": {{ \"ior\": {} }},\n\"KHR_materials_volume\": {{ \"thicknessFactor\": 1, \"attenuationDistance\": {}, \"attenuationColor\": [{}] }},\n\
             \"KHR_materials_volume_scatter\": {{ \"multiscatterColor\": [{}], \"scatterAnisotropy\": {} }}\n",
            self.eta(),
            number(distance),
            self.list(|c| (-sigma_t(c) * distance).exp()),
            self.list(|c| moonmilk_optics::conventions::kulla_conty_albedo(sigma_s(c) / sigma_t(c), g)),
            number(g)
        );
        let mut lost = vec![
            "stability: the scattering extension is a draft, being replaced by KHR_materials_scatter; attenuation is that of sigma_t here".into(),
            "the unit: glTF's is the metre, lengths here are in mm; thicknessFactor depends on the object".into(),
        ];
        if !self.one_g() {
            lost.push("g per colour: their mean is used, sigma_s chosen so that sigma_s (1 - g) stays".into());
        }
        (text, lost)
    }
}

/// Formats with six significant digits, without trailing zeros.
fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = (5 - x.abs().log10().floor() as i32).clamp(0, 17) as usize;
    let s = format!("{x:.digits$}");
    if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_owned() } else { s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_optics::conventions::kulla_conty_alpha;

    #[test]
    fn every_material_is_listed_and_prints_in_every_convention() {
        let text = list();
        let names: Vec<&str> = materials::MATERIALS.iter().map(|m| m.name).chain(SKINS.iter().map(|s| s.0)).collect();
        for name in names {
            assert!(text.contains(name), "{name}");
            let m = find(name).expect("listed");
            for c in [
                Convention::Coefficients,
                Convention::Reduced,
                Convention::AlbedoMfp,
                Convention::Pbrt,
                Convention::Mitsuba,
                Convention::Openpbr,
                Convention::Cycles,
                Convention::Gltf,
            ] {
                let text = m.print(c);
                assert!(text.contains("# lost:") && !text.contains("NaN"), "{name} {c:?}\n{text}");
            }
        }
        assert_eq!(
            find("marbel").err().expect("unknown").to_string(),
            "unknown material \"marbel\"; did you mean \"Marble\"?"
        );
    }

    #[test]
    fn openpbrs_numbers_lead_back_to_the_medium() {
        let m = find("Marble").expect("listed");
        for c in &m.rgb {
            let alpha = kulla_conty_alpha(c.colour, 0.0);
            // The fit's inverse has six digits in its constants.
            assert!((alpha - c.properties.alpha()).abs() < 1e-4, "{alpha}");
        }
        assert!(m.print(Convention::Openpbr).contains("subsurface_radius = 0.456"));
    }

    #[test]
    fn numbers_keep_six_digits_and_no_zeros() {
        let written = [0.0021, 12.5, 1.0 / 3.0, 8.9053e-5, 123_456.7].map(number);
        assert_eq!(written, ["0.0021", "12.5", "0.333333", "0.000089053", "123457"]);
    }
}
