//! Where a model fails: its error over pixels that have a measured quantity in common.

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
}

/// Returns the bin with the largest bias among those where it is significantly larger than in the rest of the pixels.
///
/// The rest of N values with the mean a (standard error s) without n of mean b (t) has the mean (N a - n b) / (N - n) and the error
/// sqrt((N s)^2 - (n t)^2) / (N - n).
pub fn worst(all: &Figures, axes: &[Bins]) -> Option<Worst> {
    let tests = axes.iter().flatten().flatten().count();
    let mut found: Option<(f64, Worst)> = None;
    for (axis, bins) in axes.iter().enumerate() {
        for (bin, f) in bins.iter().enumerate() {
            let Some(f) = f.filter(|f| f.pixels >= FEWEST && f.values < all.values) else {
                continue;
            };
            let (n, all_n) = (f.values as f64, all.values as f64);
            let rest = (all_n * all.bias2.mean - n * f.bias2.mean) / (all_n - n);
            let error = ((all_n * all.bias2.std_err).powi(2) - (n * f.bias2.std_err).powi(2)).max(0.0).sqrt();
            let z = (f.bias2.mean - rest) / f.bias2.std_err.hypot(error / (all_n - n));
            let p = if z > 0.0 { 0.5 * z_test(z) } else { 1.0 };
            if p < sidak(SIGNIFICANCE, tests) && found.is_none_or(|(b, _)| f.bias2.mean > b) {
                found = Some((f.bias2.mean, Worst { axis, bin, p }));
            }
        }
    }
    found.map(|f| f.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::Estimate;

    fn figures(pixels: u64, bias2: f64, std_err: f64) -> Figures {
        let one = |mean, std_err| Estimate { mean, std_err, n: pixels };
        Figures {
            pixels,
            values: 3 * pixels,
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
    fn every_axis_has_a_label_for_each_of_its_bins() {
        for a in &AXES {
            assert_eq!(a.labels.len(), a.edges.len() + 1, "{}", a.name);
            assert!(a.limits(0)[0].is_none() && a.limits(a.edges.len())[1].is_none());
        }
    }
}
