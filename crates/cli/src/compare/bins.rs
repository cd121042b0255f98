//! Where a model fails: its error over pixels that have a measured quantity in common.

use moonmilk_core::Estimate;
use moonmilk_core::stats::{sidak, z_test};
use moonmilk_io::split::Figures;
use moonmilk_render::seen::Seen;

/// Significance at which a kind of place counts as worse than the rest, after Sidak over all bins of a model.
pub const SIGNIFICANCE: f64 = 0.01;

/// Fewest pixels of a bin that is spoken of.
const FEWEST: u64 = 30;

/// A quantity that pixels are sorted by.
pub struct Axis {
    /// Name in results.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Limits between bins.
    edges: &'static [f32],
    /// What each bin is, as in "worst where ...".
    pub labels: &'static [&'static str],
    value: fn(&Seen, usize) -> f32,
}

/// The quantities, all measured at what the camera sees first.
pub static AXES: [Axis; 4] = [
    Axis {
        name: "thickness",
        what: "local thickness, in transport mean free paths",
        edges: &[1.0, 3.0, 10.0, 30.0],
        labels: &[
            "thinner than 1 transport mean free path",
            "1 to 3 transport mean free paths thin",
            "3 to 10 transport mean free paths thick",
            "10 to 30 transport mean free paths thick",
            "thicker than 30 transport mean free paths",
        ],
        value: |s, c| s.thickness * s.sigma_t_prime(c),
    },
    Axis {
        name: "albedo",
        what: "reduced albedo of the medium",
        edges: &[0.5, 0.8, 0.95, 0.99],
        labels: &[
            "the reduced albedo is below .5",
            "the reduced albedo is .5 to .8",
            "the reduced albedo is .8 to .95",
            "the reduced albedo is .95 to .99",
            "the reduced albedo is above .99",
        ],
        value: |s, c| s.alpha_prime(c),
    },
    Axis {
        name: "angle",
        what: "angle between normal and view, in degrees",
        edges: &[45.0, 60.0, 75.0],
        labels: &[
            "the surface faces the camera (0 to 45 degrees)",
            "the surface turns away (45 to 60 degrees)",
            "the surface turns away (60 to 75 degrees)",
            "the surface is seen at an edge (75 to 90 degrees)",
        ],
        value: |s, _| s.cosine.min(1.0).acos().to_degrees(),
    },
    Axis {
        name: "curvature",
        what: "curvature times transport mean free path",
        edges: &[0.03, 0.1, 0.3, 1.0],
        labels: &[
            "the surface is flat (curved by less than .03 per transport mean free path)",
            "it is curved by .03 to .1 per transport mean free path",
            "it is curved by .1 to .3 per transport mean free path",
            "it is curved by .3 to 1 per transport mean free path",
            "it is curved by more than 1 per transport mean free path",
        ],
        value: |s, c| s.curvature / s.sigma_t_prime(c),
    },
];

impl Axis {
    /// Returns the bin of a pixel and channel.
    pub fn bin(&self, seen: &Seen, channel: usize) -> usize {
        let x = (self.value)(seen, channel);
        self.edges.partition_point(|&e| e <= x)
    }

    /// Returns the limits of a bin; `None` is none.
    pub fn limits(&self, bin: usize) -> [Option<f32>; 2] {
        [bin.checked_sub(1).and_then(|i| self.edges.get(i)).copied(), self.edges.get(bin).copied()]
    }
}

/// The figures of the bins of one axis; `None` for those without pixels.
pub type Bins = Vec<Option<Figures>>;

/// The kind of place where a model is worst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Number of the axis.
    pub axis: usize,
    /// Number of the bin.
    pub bin: usize,
    /// One-sided p-value of its being no worse than the rest.
    pub p: f64,
    /// Whether the squared error tells, or the energy alone.
    pub by: By,
}

/// What tells that a place is worse than the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// Its bias^2.
    Squares,
    /// The deviation of its mean, where noise hides the squares.
    Energy,
}

/// Returns the bin with the largest bias^2 among those where it is significantly larger than in the rest of the pixels; failing that, the bin whose mean
/// is farthest from the exact one among those where it is significantly farther than that of the rest.
///
/// The rest of N values with the mean a (standard error s) without n of mean b (t) has the mean (N a - n b) / (N - n) and the error
/// sqrt((N s)^2 - (n t)^2) / (N - n). For ratios the weights are the sums of the reference.
pub fn worst(all: &Figures, axes: &[Bins]) -> Option<Worst> {
    let tests = 2 * axes.iter().flatten().flatten().count();
    let of_kind = |by: By| {
        let mut found: Option<(f64, Worst)> = None;
        for (axis, bins) in axes.iter().enumerate() {
            for (bin, f) in bins.iter().enumerate() {
                let Some(f) = f.filter(|f| f.pixels >= FEWEST && f.values < all.values) else {
                    continue;
                };
                let (size, p) = excess(all, &f, by);
                if p < sidak(SIGNIFICANCE, tests) && found.is_none_or(|(s, _)| size > s) {
                    found = Some((size, Worst { axis, bin, p, by }));
                }
            }
        }
        found.map(|f| f.1)
    };
    of_kind(By::Squares).or_else(|| of_kind(By::Energy))
}

/// Returns how wrong a bin is, and the one-sided p-value of its being no worse than the rest.
fn excess(all: &Figures, f: &Figures, by: By) -> (f64, f64) {
    let (n, all_n, of): (f64, f64, fn(&Figures) -> Estimate) = match by {
        By::Squares => (f.values as f64, all.values as f64, |f| f.bias2),
        By::Energy => (f.reference, all.reference, |f| Estimate { mean: f.ratio.mean - 1.0, ..f.ratio }),
    };
    let (bin, whole) = (of(f), of(all));
    let rest = (all_n * whole.mean - n * bin.mean) / (all_n - n);
    let error = ((all_n * whole.std_err).powi(2) - (n * bin.std_err).powi(2)).max(0.0).sqrt() / (all_n - n);
    let (size, rest) = match by {
        By::Squares => (bin.mean, rest),
        By::Energy => (bin.mean.abs(), rest.abs()),
    };
    let z = (size - rest) / bin.std_err.hypot(error);
    (size, if z > 0.0 { 0.5 * z_test(z) } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(pixels: u64, bias2: f64, std_err: f64) -> Figures {
        let one = |mean, std_err| Estimate { mean, std_err, n: pixels };
        Figures {
            pixels,
            values: 3 * pixels,
            reference: pixels as f64,
            ratio: one(1.0, 0.01),
            bias2: one(bias2, std_err),
            variance: one(0.1, 0.01),
            total: one(0.1 + bias2, 0.01),
        }
    }

    #[test]
    fn the_worst_place_is_named_only_where_it_is_significant() {
        let all = figures(1000, 0.02, 0.002);
        let bins = |error: f64| vec![vec![None, Some(figures(200, 0.08, error)), Some(figures(800, 0.005, 0.002))]];
        assert_eq!(worst(&all, &bins(0.005)).map(|w| (w.axis, w.bin)), Some((0, 1)));
        assert_eq!(worst(&all, &bins(0.05)), None, "within the noise");
        let few = vec![vec![Some(figures(5, 0.8, 0.001)), Some(figures(995, 0.015, 0.002))]];
        assert_eq!(worst(&all, &few), None, "too few pixels");
    }

    #[test]
    fn where_noise_hides_the_squares_the_mean_tells() {
        let with = |pixels, ratio, std_err| {
            let f = figures(pixels, 0.02, 0.5);
            Figures { ratio: Estimate { mean: ratio, std_err, n: pixels }, ..f }
        };
        let all = with(1000, 1.08, 0.01);
        let bins = vec![vec![Some(with(200, 1.4, 0.03)), Some(with(800, 1.0, 0.01))]];
        assert_eq!(worst(&all, &bins).map(|w| (w.bin, w.by)), Some((0, By::Energy)));
        let noisy = vec![vec![Some(with(200, 1.4, 0.3)), Some(with(800, 1.0, 0.1))]];
        assert_eq!(worst(&with(1000, 1.08, 0.1), &noisy), None);
    }

    #[test]
    fn every_axis_has_a_label_for_each_of_its_bins() {
        for a in &AXES {
            assert_eq!(a.labels.len(), a.edges.len() + 1, "{}", a.name);
            assert!(a.limits(0)[0].is_none() && a.limits(a.edges.len())[1].is_none());
        }
    }
}
