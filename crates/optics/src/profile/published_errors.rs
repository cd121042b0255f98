//! Errors of the models against a Monte Carlo of 2e7 histories per index, as they were printed: pinned, and measured again by `moonmilk validate`.
//!
//! Light along the normal of a half-space of isotropic scatterers with unit extinction. The error of R(r) is that of the mean over the ring from
//! r / 1.05 to 1.05 r; the measured R has its own standard error. *Source*: physics notes, 9 and 5.11; L1 errors 5.8.

/// Radii of the table \[mean free paths\].
pub const RADII: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];

/// A printed number: its value and half of its last digit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// The value.
    pub value: f64,
    /// Half of a unit of its last printed digit.
    pub half_digit: f64,
}

/// The simulation of one medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Single-scattering albedo.
    pub alpha: f64,
    /// Relative index, inside / outside.
    pub eta: f64,
    /// R at [`RADII`] \[1/mfp^2\].
    pub rings: [Printed; 5],
    /// Standard error of R \[%\].
    pub std_err: [f64; 5],
    /// The models' errors.
    pub models: Vec<Model>,
}

/// The errors of one model \[%\].
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its name in the registry.
    pub name: &'static str,
    /// Error of the albedo.
    pub albedo: Printed,
    /// Errors of R at [`RADII`], where they were printed.
    pub rings: [Option<Printed>; 5],
    /// Mean absolute error of the energy per logarithmic ring over the albedo (L1), where it was printed.
    pub l1: Option<Printed>,
}

/// Returns the table.
pub fn table() -> Vec<Medium> {
    let mut media: Vec<Medium> = Vec::new();
    for line in include_str!("published_errors.csv").lines().filter(|l| !l.starts_with('#')) {
        let mut fields = line.split(',');
        let name = fields.next().expect("a line has a name");
        let fields: Vec<Option<Printed>> = fields.map(printed).collect();
        let number = |k: usize| fields[k].expect("a number of the medium");
        if name == "medium" {
            media.push(Medium {
                alpha: number(0).value,
                eta: number(1).value,
                rings: std::array::from_fn(|k| number(2 + k)),
                std_err: std::array::from_fn(|k| number(7 + k).value),
                models: Vec::new(),
            });
        } else {
            let rings = std::array::from_fn(|k| fields[1 + k]);
            let l1 = fields.get(6).copied().flatten();
            media.last_mut().expect("a medium comes first").models.push(Model { name, albedo: number(0), rings, l1 });
        }
    }
    media
}

/// Reads a number with its digits; `-` alone is none.
fn printed(text: &str) -> Option<Printed> {
    let value = text.parse().ok()?;
    let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let decimals = digits.split_once('.').map_or(0, |(_, d)| d.len()) as i32;
    let exponent: i32 = exponent.parse().expect("an exponent");
    Some(Printed { value, half_digit: 0.5 * 10f64.powi(exponent - decimals) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole_and_digits_are_counted() {
        let media = table();
        assert_eq!((media.len(), media.iter().map(|m| m.models.len()).sum::<usize>()), (15, 15 * 8 + 10));
        assert!(media.iter().flat_map(|m| &m.models).all(|m| crate::profile::find(m.name).is_ok()));
        let close = |text: &str, half: f64| (printed(text).unwrap().half_digit / half - 1.0).abs() < 1e-12;
        assert!(close("-8.8", 0.05) && close("+28", 0.5) && close("4.59e-05", 0.5e-7) && printed("-").is_none());
    }
}
