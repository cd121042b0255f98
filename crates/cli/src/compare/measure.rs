//! From finished pictures to findings.

use moonmilk_core::Estimate;
use moonmilk_io::false_color::blue_red;
use moonmilk_io::flip;
use moonmilk_io::image::Picture;
use moonmilk_io::png::srgb_byte;
use moonmilk_io::sheet::Pixels;
use moonmilk_io::split::{self, Colour, Figures, Halves, Reference};
use moonmilk_optics::profile::{Info, find};
use moonmilk_render::seen::Seen;

use super::bins::{AXES, Bins, By, Worst, worst};
use super::bodies::{BodySeen, EXACT_PROFILE, Worth};
use super::shoot::Cost;
use crate::failure::Failure;

/// Scales that error maps may have.
const SCALES: [f32; 6] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0];

/// What is known of one model.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// Its description, if it is a model of the registry.
    pub info: Option<&'static Info>,
    /// What it took.
    pub cost: Cost,
    /// Its error over the pixels of translucent bodies.
    pub object: Figures,
    /// Its error over the whole picture.
    pub whole: Figures,
    /// Mean of HDR-FLIP over the whole picture.
    pub flip: f64,
    /// How often its time goes into that of the exact picture at equal noise.
    pub speed: f64,
    /// Its difference from the picture by the exact profile: the part of the error that is the profile's.
    pub profile: Option<Figures>,
    /// What its profile is worth.
    pub worth: Worth,
    /// Errors by kind of place, one entry for each of [`AXES`].
    pub bins: Vec<Bins>,
    /// Where it is worst.
    pub worst: Option<Worst>,
    /// Everything to be warned of.
    pub warnings: Vec<String>,
    /// The picture, for screens.
    pub shown: Pixels,
    /// Signed error per pixel, means over 3 x 3 pixels.
    pub error: Vec<f32>,
}

/// All that was found.
pub struct Findings {
    /// Name of the scene's file.
    pub scene: String,
    /// Its hash.
    pub hash: String,
    /// Size of the pictures.
    pub size: [usize; 2],
    /// Budget of a model, in words.
    pub budget: String,
    /// Settings in words: seed, wavelengths.
    pub settings: Vec<(&'static str, String)>,
    /// What is taken as exact.
    pub exact: Exact,
    /// Translucent bodies.
    pub bodies: Vec<BodySeen>,
    /// Pixels that show them; 0 if there are none and all pixels count.
    pub object_pixels: u64,
    /// The models.
    pub models: Vec<Measured>,
    /// Models that cannot render the scene, and why.
    pub left_out: Vec<(String, String)>,
    /// What holds for all models: thin bodies, a noisy reference.
    pub notes: Vec<String>,
    /// Signed error shown as full red.
    pub scale: f32,
    /// Exposure of the pictures for screens \[stops\].
    pub stops: f64,
}

impl Findings {
    /// Returns the figures of the picture by the exact profile, if there is one.
    pub fn planar(&self) -> Option<&Figures> {
        self.models.iter().find(|m| m.name == EXACT_PROFILE).map(|m| &m.object)
    }
}

/// The picture that the others are compared with.
pub struct Exact {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// What it took.
    pub cost: Cost,
    /// Its relative variance over the same pixels as the models'.
    pub variance: Estimate,
    /// What that would be with the budget of a model.
    pub at_equal: f64,
    /// Whether its noise is known, so that it can be taken off.
    pub known: bool,
    /// For screens.
    pub shown: Pixels,
}

/// What all measurements share.
pub struct Bench {
    /// Width of the pictures.
    pub width: usize,
    /// The exact picture.
    pub reference: Reference,
    /// Weights of the pixels.
    pub weights: Colour,
    /// What the camera sees.
    pub seen: Vec<Option<Seen>>,
    /// Halves of the picture by the exact profile.
    pub planar: Option<Halves>,
    /// Variance times cost of the exact picture.
    pub exact_work: f64,
    /// Exposure.
    pub stops: f64,
}

impl Bench {
    /// Returns whether a pixel shows a translucent body; all do if none does.
    fn shows(&self, any: bool, pixel: usize) -> bool {
        !any || self.seen[pixel].is_some()
    }

    /// Returns the figures of a picture over the pixels of translucent bodies (or all, if there are none).
    ///
    /// *Errors*: never with pixels.
    pub fn object(&self, test: &Halves, reference: &Reference) -> Result<Figures, Failure> {
        let any = self.seen.iter().any(Option::is_some);
        split::figures(test, reference, &self.weights, self.width, |i, _| self.shows(any, i))
            .ok_or_else(|| Failure::Run("the picture has no pixels".into()))
    }

    /// Measures the picture of a model.
    pub fn measure(&self, name: &str, picture: &Picture, cost: Cost, worth: Worth) -> Result<Measured, Failure> {
        let halves = Halves::of(picture)
            .ok_or_else(|| Failure::Input(format!("{name}.exr: it has no halves: not of a comparison")))?;
        let mean = halves.mean();
        let object = self.object(&halves, &self.reference)?;
        let whole = split::figures(&halves, &self.reference, &self.weights, self.width, |_, _| true)
            .ok_or_else(|| Failure::Run("the picture has no pixels".into()))?;
        let difference =
            flip::hdr(split::planes(&mean), split::planes(&self.reference.mean), self.width, flip::PIXELS_PER_DEGREE);
        let bins: Vec<Bins> = AXES
            .iter()
            .map(|axis| {
                let of_bin = |b: usize| {
                    let takes = |i: usize, c: usize| self.seen[i].as_ref().is_some_and(|s| axis.bin(s, c) == b);
                    split::figures(&halves, &self.reference, &self.weights, self.width, takes)
                };
                (0..axis.labels.len()).map(of_bin).collect()
            })
            .collect();
        // A picture against itself has no difference, and no independent halves to show it.
        let profile = match &self.planar {
            Some(planar) if *planar != halves => Some(self.object(&halves, &Reference::of_halves(planar))?),
            _ => None,
        };
        let error = split::signed_error(&mean, &self.reference.mean, &self.weights);
        let work = object.variance.mean * cost.cpu.unwrap_or(cost.seconds);
        Ok(Measured {
            name: name.into(),
            info: find(name).ok().map(|m| m.info),
            flip: flip::mean(&difference.map),
            speed: self.exact_work / work,
            worst: worst(&object, &bins),
            profile,
            warnings: worth.warnings.iter().chain(&cost.warnings).cloned().collect(),
            shown: for_screens(&mean, self.width, self.stops),
            error: smoothed(&error, self.width),
            bins,
            object,
            whole,
            cost,
            worth,
        })
    }
}

/// Returns the exposure in quarter stops that brings the 98th percentile of the largest channel of the pixels shown to .8.
pub fn exposure(picture: &Colour, seen: &[Option<Seen>]) -> f64 {
    let any = seen.iter().any(Option::is_some);
    let mut values: Vec<f32> = (0..picture[0].len())
        .filter(|&i| !any || seen[i].is_some())
        .map(|i| picture[0][i].max(picture[1][i]).max(picture[2][i]))
        .filter(|v| *v > 0.0)
        .collect();
    values.sort_by(f32::total_cmp);
    let Some(&bright) = values.get(values.len() * 98 / 100) else {
        return 0.0;
    };
    // Adding 0 turns -0 into 0.
    (4.0 * (0.8 / f64::from(bright)).log2()).round() / 4.0 + 0.0
}

/// Returns a picture in sRGB codes at an exposure.
pub fn for_screens(picture: &Colour, width: usize, stops: f64) -> Pixels {
    let factor = stops.exp2() as f32;
    let rgb = (0..picture[0].len()).map(|i| [0, 1, 2].map(|c| srgb_byte(factor * picture[c][i]))).collect::<Vec<_>>();
    Pixels { width, height: rgb.len() / width, rgb }
}

/// Returns the means over 3 x 3 pixels.
fn smoothed(map: &[f32], width: usize) -> Vec<f32> {
    let height = map.len() / width;
    let mean = |x: usize, y: usize| {
        let (mut sum, mut n) = (0.0, 0.0f32);
        for v in y.saturating_sub(1)..(y + 2).min(height) {
            for u in x.saturating_sub(1)..(x + 2).min(width) {
                sum += map[v * width + u];
                n += 1.0;
            }
        }
        sum / n
    };
    (0..map.len()).map(|i| mean(i % width, i / width)).collect()
}

/// Returns the scale of the error maps: the smallest round one that holds nine tenths of the bodies' pixels for half of the models.
pub fn scale(models: &[Measured], seen: &[Option<Seen>]) -> f32 {
    let any = seen.iter().any(Option::is_some);
    let mut typical: Vec<f32> = models
        .iter()
        .filter_map(|m| {
            let shown = m.error.iter().enumerate().filter(|(i, _)| !any || seen[*i].is_some());
            let mut values: Vec<f32> = shown.map(|(_, e)| e.abs()).collect();
            values.sort_by(f32::total_cmp);
            values.get(values.len() * 9 / 10).copied()
        })
        .collect();
    typical.sort_by(f32::total_cmp);
    let wanted = typical.get(typical.len() / 2).copied().unwrap_or(1.0);
    SCALES.into_iter().find(|s| *s >= wanted).unwrap_or(SCALES[SCALES.len() - 1])
}

/// Returns an error map in colours.
pub fn error_picture(error: &[f32], width: usize, scale: f32) -> Pixels {
    let rgb = error.iter().map(|e| blue_red(e / scale).map(|v| (255.0 * v).round() as u8)).collect::<Vec<_>>();
    Pixels { width, height: rgb.len() / width, rgb }
}

/// Returns the root of a mean square that noise may have made negative.
pub fn rms(square: f64) -> f64 {
    square.max(0.0).sqrt()
}

/// Returns a positive number with three digits.
pub fn three_digits(x: f64) -> String {
    match x {
        _ if x.abs() >= 100.0 => format!("{x:.0}"),
        _ if x.abs() >= 10.0 => format!("{x:.1}"),
        _ if x.abs() >= 1.0 => format!("{x:.2}"),
        _ if x.abs() >= 0.001 => format!("{x:.*}", (2.0 - x.abs().log10().floor()) as usize),
        _ => format!("{x:.2e}"),
    }
}

/// Returns the standard error of [`rms`] to first order; that of the square's own root where the square is within its noise.
pub fn rms_error(square: &Estimate) -> f64 {
    square.std_err / (2.0 * square.mean.max(square.std_err).sqrt())
}

impl Measured {
    /// Returns where the error comes from.
    pub fn budget(&self, planar: Option<&Figures>) -> Budget {
        // A walk has no profile whose geometry could be at fault.
        let planar = planar.filter(|_| self.worth.mean.is_some());
        let energy = self.object.ratio.mean;
        let profile_energy = self.worth.mean.map(|d| 1.0 + d.total);
        let geometry_energy = planar.map(|p| p.ratio.mean);
        let rest = profile_energy.zip(geometry_energy).map(|(p, g)| energy / (p * g) - 1.0);
        let own = self.profile.map_or(0.0, |p| p.bias2.mean);
        Budget {
            profile_l1: self.worth.mean.map(|d| d.l1),
            profile_energy: profile_energy.map(|e| e - 1.0),
            geometry_energy: geometry_energy.map(|e| e - 1.0),
            remaining_energy: rest,
            profile_rms: planar.map(|_| rms(own)),
            geometry_rms: planar.map(|p| rms(p.bias2.mean)),
            remaining_square: planar.map(|p| self.object.bias2.mean - own - p.bias2.mean),
        }
    }

    /// Returns in a sentence or two how good it is and where it fails.
    pub fn verdict(&self) -> String {
        let f = &self.object;
        let energy = 100.0 * (f.ratio.mean - 1.0);
        let error = 100.0 * f.ratio.std_err;
        let brightness = if energy.abs() < 2.0 * error {
            format!("As bright as the exact picture within {:.1} %", 2.0 * error)
        } else {
            let word = if energy > 0.0 { "bright" } else { "dark" };
            format!("In the mean {:.1} % too {word}", energy.abs())
        };
        let off = if f.bias2.mean > 2.0 * f.bias2.std_err {
            format!(", typically off by {:.1} %.", 100.0 * rms(f.bias2.mean))
        } else {
            let most = rms(f.bias2.mean.max(0.0) + 2.0 * f.bias2.std_err);
            format!("; pixel by pixel no error beyond the noise, less than {:.1} %.", 100.0 * most)
        };
        let place = match self.worst {
            Some(w) => {
                let label = AXES[w.axis].labels[w.bin];
                let label = if AXES[w.axis].name == "thickness" { format!("it is {label}") } else { label.into() };
                let bin = self.bins[w.axis][w.bin].as_ref();
                let signed = bin.map_or(0.0, |b| 100.0 * (b.ratio.mean - 1.0));
                let word = if signed > 0.0 { "bright" } else { "dark" };
                let signed = signed.abs();
                match w.by {
                    By::Squares => {
                        let rms = bin.map_or(0.0, |b| 100.0 * rms(b.bias2.mean));
                        format!(" Worst where {label}: off by {rms:.0} %, in the mean {signed:.1} % too {word}.")
                    }
                    By::Energy => format!(" Worst where {label}: {signed:.1} % too {word} there in the mean."),
                }
            }
            None => " No kind of place is significantly worse than the rest.".into(),
        };
        brightness + &off + &place
    }
}

/// Where a model's error comes from.
///
/// In the mean, (1 + profile) (1 + geometry) (1 + remaining) is the ratio of model to exact; of squares, profile² + geometry² + remaining is the bias².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Light that the profile puts at the wrong radius of a half-space.
    pub profile_l1: Option<f64>,
    /// Albedo of the profile over the exact one, minus 1.
    pub profile_energy: Option<f64>,
    /// Picture by the exact profile over exact picture, minus 1: curved and finite bodies taken for half-spaces, light from all sides for light along the normal.
    pub geometry_energy: Option<f64>,
    /// What both leave of the ratio: the direction of light, and how profile and geometry work together.
    pub remaining_energy: Option<f64>,
    /// Relative root mean square difference between the model's picture and that by the exact profile.
    pub profile_rms: Option<f64>,
    /// The same between the picture by the exact profile and the exact picture.
    pub geometry_rms: Option<f64>,
    /// What both leave of the squared error; negative where they cancel.
    pub remaining_square: Option<f64>,
}
