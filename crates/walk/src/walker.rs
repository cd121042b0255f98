//! The state that a walk carries from event to event.

use moonmilk_core::{Spectrum, Vec3};

use crate::medium::Medium;

/// A light path inside a medium, on its way from the camera (or a source) to where it leaves.
#[derive(Clone, Copy, Debug)]
pub struct Walker<const N: usize> {
    /// Position \[length\].
    pub p: Vec3,
    /// Direction of flight, unit.
    pub d: Vec3,
    /// Weight per lane: contribution over the mean density of all lanes.
    pub beta: Spectrum<N>,
    /// Density of each lane over their mean; the mean of this is 1.
    pub ratio: Spectrum<N>,
    /// Density of each lane's guided walks over that of its plain ones ([`crate::guide`]); 0 where the path has no strategies to choose from.
    pub odds: Spectrum<N>,
    /// Whether it is guided.
    pub guided: bool,
    /// Density [1/sr] with which the last direction was drawn; `None` behind a specular event, which no light sampling
    /// competes with.
    pub direction_pdf: Option<f32>,
    /// Point from which that direction was drawn.
    pub scatter_point: Vec3,
    /// Collisions so far.
    pub collisions: u32,
    /// Factor that undoes the radiance scaling of refractive boundaries when weights are compared (roulette).
    pub eta_scale: f32,
    /// Lower bound of the distance from `p` to any wall; 0 if unknown \[length\].
    pub room: f32,
    /// The variate of the next flight's length, where it is not to be drawn.
    pub flight: Option<f32>,
    /// From where on this path takes the records of banks ([`crate::jump::Bank`]); `None` before it took any.
    pub deal: Option<u32>,
}

impl<const N: usize> Walker<N> {
    /// Returns a walker of weight one at `p`, flying along `d`.
    pub fn new(p: Vec3, d: Vec3) -> Self {
        Self {
            p,
            d,
            beta: Spectrum::ONE,
            ratio: Spectrum::ONE,
            odds: Spectrum::ZERO,
            guided: false,
            direction_pdf: None,
            scatter_point: p,
            collisions: 0,
            eta_scale: 1.0,
            room: 0.0,
            flight: None,
            deal: None,
        }
    }

    /// Restores mean(ratio) = 1, moving the factor into the weight; returns that factor.
    #[inline]
    pub fn renormalize(&mut self) -> f32 {
        let m = self.ratio.mean();
        // All densities can underflow only if the hero's did, which sampling makes impossible; guard against 0/0 alone.
        if m > 0.0 {
            self.beta /= m;
            self.ratio /= m;
        } else {
            self.beta = Spectrum::ZERO;
        }
        m
    }

    /// Goes on with the hero alone, from where the path depends on its wavelength: weight over the hero's share of the mean density, 1/N of its own.
    #[inline]
    pub fn hero_only(&mut self) {
        if N == 1 {
            return;
        }
        let (beta, own) = (self.beta[0], N as f32 / self.ratio[0]);
        let only = |x: f32| Spectrum::from_fn(|k| if k == 0 { x } else { 0.0 });
        (self.beta, self.ratio) = (only(beta * own), only(N as f32));
    }

    /// Applies the weights of a flight of length t that reached a wall: T_j against the density T_j of each lane.
    #[inline]
    pub fn pass<P>(&mut self, medium: &Medium<N, P>, t: f32) {
        let s0 = medium.sigma_t[0];
        // Light sampling competes with having got through: the density gains the mean transmittance.
        let hero = if self.direction_pdf.is_some() && s0 > 0.0 { (-s0 * t).exp() } else { 1.0 };
        let mut mean = 1.0;
        if N > 1 && !medium.is_gray() {
            // t was drawn with s0, so that s0 t < 17: the exponent is bounded above.
            let relative = medium.sigma_t.map(|s| ((s0 - s) * t).exp());
            self.beta *= relative;
            self.ratio *= relative;
            mean = self.renormalize();
        }
        if let Some(pdf) = &mut self.direction_pdf {
            *pdf *= hero * mean;
        }
    }

    /// Applies the weights of a flight of length t that ended in a collision, without the factor sigma_s or sigma_a:
    /// returns T_j / mean_i(sigma_t,i T_i), to be multiplied by the coefficient of what happens next.
    #[inline]
    pub fn collide<P>(&mut self, medium: &Medium<N, P>, t: f32) -> Spectrum<N> {
        if N == 1 || medium.is_gray() {
            return self.beta / medium.sigma_t[0];
        }
        let s0 = medium.sigma_t[0];
        let relative = medium.sigma_t.map(|s| ((s0 - s) * t).exp() / s0);
        self.beta *= relative;
        self.ratio *= relative * medium.sigma_t;
        self.renormalize();
        self.beta
    }
}
