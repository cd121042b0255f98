//! What leaves balls of a medium that does not scatter isotropically: a bank of simulated exits.
//!
//! A collision at p of light that arrived along w may stand for a walk inside any ball around it. The ball here is shifted, its centre at p + g l* w, l* = 1 / ((1 - g) sigma_t): to first order light
//! starts there, so that its exits lose their dipole from a radius of 2.5 l* on. Below that they do not, and position, direction and number N of collisions hang together. So a jump takes all of them
//! from one walk that was done before, flight by flight, without absorption, and is weighed with alpha^N: *exact* for any law of scattering, any albedo, any radius above |g| l*.
//!
//! *Bias*: none. A bank is drawn anew for every few samples of a picture; its records are independent walks, and a path never takes the same record twice ([`Bank::take`]), so that its law is that of flights.
//! What paths share is the luck of a bank: noise, common to a picture's pixels, that falls with the number of banks as all noise does. No table is kept, so that none can be wrong or damaged.
//!
//! *Identities* that hold for any law and radius without absorption, lengths in l*, for a start at -s w, mu the cosine of exit \[tests\]:
//!
//! $$ R\, E[n \cdot w] + E[d \cdot w] = g - s, \qquad 2 (1 - g) E[N] = R^2 + 2 R\, E[\mu] + 2 g s - s^2 . $$
//!
//! *Cost*: (R^2 / 2 + .8 R) / (1 - g) collisions per record; a jump takes the place of as many.
//!
//! *Source*: the shifted ball and its identities were found for moonmilk, not in the literature known to us.

use std::ops::Range;

use moonmilk_core::{Frame, Random, Stream, Vec3};

use crate::math;
use crate::phase::PhaseFunction;

/// Ratio of the radii of neighbouring levels.
const RATIO: f32 = 1.3;
/// Levels: the largest radius is 8.2 times the least.
const LEVELS: usize = 9;
/// Levels have half as many records as those two below, down to 2^-THINNED of the first: they cost more, and fewer jumps take them.
const THINNED: usize = 4;
/// Least radius [transport mean free paths]: has to be above |g|.
const LEAST: f32 = 1.0;

/// A walk from where light collides to where it leaves the ball, turned about the direction of arrival w so that it leaves at azimuth 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Record {
    /// Cosine between w and the normal of the exit.
    height: f32,
    /// The direction of exit away from w's axis, and along w; what is left of it, to either side.
    away: f32,
    along: f32,
    /// Collisions after the first.
    collisions: u32,
}

/// Records of a part of every level, for [`Bank::join`].
#[derive(Clone, Debug)]
pub struct Part(Vec<Vec<Record>>);

/// Exits of balls of a medium, for one law of scattering.
#[derive(Clone, Debug)]
pub struct Bank {
    g: f32,
    levels: Vec<Vec<Record>>,
}

/// What a jump found.
#[derive(Clone, Copy, Debug)]
pub struct Leap {
    /// Where it leads.
    pub p: Vec3,
    /// Direction of flight there.
    pub d: Vec3,
    /// Collisions on the way, besides that where it began.
    pub collisions: u32,
}

/// Returns the shift of a ball's centre [mean free paths].
fn shift(g: f32) -> f32 {
    g / (1.0 - g)
}

/// Returns the radius of a level [mean free paths].
pub(super) fn radius(g: f32, level: usize) -> f32 {
    (LEAST / (1.0 - g)).max(super::LEAST) * RATIO.powi(level as i32)
}

impl Bank {
    /// Simulates records number `range` of the first level, and fewer of larger ones, up to a radius [mean free paths]; a pure function of its arguments.
    ///
    /// *Domain*: ranges between multiples of 16.
    pub fn part(law: &impl PhaseFunction, key: u64, range: Range<u32>, most: f32) -> Part {
        let g = law.mean_cosine();
        let level = |k: usize| {
            let stream = |i| Stream::new(&[key, k as u64, u64::from(i)]);
            let fewer = (k / 2).min(THINNED);
            walks(law, radius(g, k), shift(g), range.start >> fewer..range.end >> fewer, stream)
        };
        Part((0..LEVELS).filter(|&k| k == 0 || radius(g, k) <= most).map(level).collect())
    }

    /// Joins parts to a bank for a law of mean cosine g. Numbers of records of the first level are a power of two in all.
    pub fn join(g: f32, parts: impl IntoIterator<Item = Part>) -> Self {
        let mut levels: Vec<Vec<Record>> = vec![];
        for part in parts {
            levels.resize(part.0.len(), vec![]);
            levels.iter_mut().zip(part.0).for_each(|(all, more)| all.extend(more));
        }
        assert!(levels.iter().all(|l| l.len().is_power_of_two()), "a number of records that is no power of two");
        Self { g, levels }
    }

    /// Simulates a bank of a number of records, a power of two from 16 on, for balls up to a radius [mean free paths].
    pub fn new(law: &impl PhaseFunction, key: u64, count: u32, most: f32) -> Self {
        Self::join(law.mean_cosine(), [Self::part(law, key, 0..count, most)])
    }

    /// Returns the mean cosine of the law.
    pub fn g(&self) -> f32 {
        self.g
    }

    /// Returns how far ahead of a collision the centre of its ball lies [mean free paths]; behind it if negative.
    #[inline]
    pub fn shift(&self) -> f32 {
        shift(self.g)
    }

    /// Returns the least radius [mean free paths].
    #[inline]
    pub fn least(&self) -> f32 {
        radius(self.g, 0)
    }

    /// Returns the largest radius [mean free paths].
    #[inline]
    pub fn most(&self) -> f32 {
        radius(self.g, self.levels.len() - 1)
    }

    /// Returns the largest level whose radius [mean free paths] is not above one, and its radius.
    #[inline]
    pub fn level(&self, at_most: f32) -> Option<(usize, f32)> {
        let mut found = None;
        let mut radius = self.least();
        for k in 0..self.levels.len() {
            if radius > at_most {
                break;
            }
            found = Some((k, radius));
            radius *= RATIO;
        }
        found
    }

    /// Returns where a jump from a collision leads that light arrived at along w, `center` and `radius` those of the ball.
    ///
    /// `number` says which of the level's records: whoever counts up never takes one twice, short of all of them.
    #[inline]
    pub fn take(
        &self,
        level: usize,
        number: u32,
        (center, radius): (Vec3, f32),
        w: Vec3,
        rng: &mut impl Random,
    ) -> Leap {
        let records = &self.levels[level];
        let r = records[number as usize & (records.len() - 1)];
        let u = rng.uniform2();
        let (s, c) = math::sin_cos_turn(u[0]);
        let f = Frame::new(w);
        let (away, side) = (f.s * c + f.t * s, f.t * c - f.s * s);
        let rest = (1.0 - r.away * r.away - r.along * r.along).max(0.0).sqrt();
        let rest = if u[1] < 0.5 { rest } else { -rest };
        let d = (away * r.away + side * rest + w * r.along).normalize();
        let n = away * (1.0 - r.height * r.height).max(0.0).sqrt() + w * r.height;
        Leap { p: center + n * radius, d, collisions: r.collisions }
    }
}

/// Walks advanced together.
const LANES: usize = 8;

/// As many numbers as there are lanes.
type Lane = [f32; LANES];

/// Walks in lanes: where each is, where it flies to next, whether that is outside of the ball.
struct Lanes {
    p: [Lane; 3],
    d: [Lane; 3],
    next: [Lane; 3],
    out: [bool; LANES],
}

impl Lanes {
    /// Turns all walks by the law and lets them fly, by the variates of each.
    #[inline(never)]
    fn step(&mut self, law: &impl PhaseFunction, radius: f32, [u, v, w]: &[Lane; 3]) {
        let isotropic = law.is_isotropic();
        let flights = w.map(math::exponential);
        for k in 0..LANES {
            let d = Vec3::new(self.d[0][k], self.d[1][k], self.d[2][k]);
            let uniform = math::uniform_sphere([u[k], v[k]]);
            let turned = math::deflect(d, law.cosine(u[k]), v[k]);
            let d = if isotropic { uniform } else { turned };
            let p = Vec3::new(self.p[0][k], self.p[1][k], self.p[2][k]) + d * flights[k];
            for axis in 0..3 {
                (self.d[axis][k], self.next[axis][k]) = (d[axis], p[axis]);
            }
            self.out[k] = p.length_squared() > radius * radius;
        }
    }

    /// Puts a walk back to the collision at (0, 0, -shift) of light that arrived along z.
    fn begin(&mut self, k: usize, shift: f32) {
        for axis in 0..3 {
            (self.p[axis][k], self.d[axis][k]) = if axis == 2 { (-shift, 1.0) } else { (0.0, 0.0) };
        }
    }
}

/// Walks from a collision at (0, 0, -shift) of light that arrived along z to where it leaves a ball around the origin, once for each number in a range; lengths in mean free paths.
///
/// Eight at a time, each by a stream of its own, so that records do not depend on what they are simulated with: 7 ns a collision at g .9 where one after the other takes 25.
fn walks(
    law: &impl PhaseFunction,
    radius: f32,
    shift: f32,
    range: Range<u32>,
    stream: impl Fn(u32) -> Stream,
) -> Vec<Record> {
    let count = range.len();
    let nothing = Record { height: 0.0, away: 0.0, along: 0.0, collisions: 0 };
    let mut records = vec![nothing; count];
    let mut lanes = Lanes { p: [[0.0; LANES]; 3], d: [[0.0; LANES]; 3], next: [[0.0; LANES]; 3], out: [false; LANES] };
    (0..LANES).for_each(|k| lanes.begin(k, shift));
    // Lanes without a record walk for nothing.
    let mut record: [usize; LANES] = std::array::from_fn(|k| k);
    let mut streams: [Stream; LANES] = std::array::from_fn(|k| stream(range.start + k as u32));
    let mut collisions = [0u32; LANES];
    let (mut begun, mut done) = (LANES, 0);
    let mut variates = [[0.0; LANES]; 3];
    while done < count {
        for (k, rng) in streams.iter_mut().enumerate() {
            [variates[0][k], variates[1][k]] = rng.uniform2();
            variates[2][k] = rng.uniform();
        }
        lanes.step(law, radius, &variates);
        for k in 0..LANES {
            if !lanes.out[k] {
                collisions[k] += 1;
                continue;
            }
            if record[k] < count {
                let at = |x: &[Lane; 3]| Vec3::new(x[0][k], x[1][k], x[2][k]);
                records[record[k]] = leaving(at(&lanes.p), at(&lanes.d), radius, collisions[k]);
                done += 1;
            }
            (record[k], collisions[k]) = (begun, 0);
            streams[k] = stream(range.start + begun as u32);
            begun += 1;
        }
        lanes.p = lanes.next;
        let out = lanes.out;
        (0..LANES).filter(|&k| out[k]).for_each(|k| lanes.begin(k, shift));
    }
    records
}

/// Returns the record of a walk that leaves a ball around the origin from p along d.
fn leaving(p: Vec3, d: Vec3, radius: f32, collisions: u32) -> Record {
    // Leave through the sphere; a start within rounding of it may lie beyond.
    let along = p.dot(d);
    let t = ((along * along + radius * radius - p.length_squared()).max(0.0).sqrt() - along).max(0.0);
    let n = (p + d * t).normalize();
    let across = n.x.hypot(n.y);
    let away = if across > 0.0 { (d.x * n.x + d.y * n.y) / across } else { d.x.hypot(d.y) };
    Record { height: n.z.clamp(-1.0, 1.0), away, along: d.z, collisions }
}

#[cfg(test)]
mod tests {
    use moonmilk_core::estimate::Accumulator;

    use super::*;
    use crate::phase::HenyeyGreenstein;

    #[test]
    fn exits_obey_the_martingales_of_a_walk() {
        // Two identities at nine radii for seven laws; 5.2 standard errors are a significance of 2e-5 over all.
        for g in [-0.9f32, -0.3, 0.2, 0.5, 0.8, 0.9, 0.98] {
            let bank = Bank::new(&HenyeyGreenstein { g }, 5, 1 << 13, f32::INFINITY);
            for (k, records) in bank.levels.iter().enumerate() {
                // In transport mean free paths.
                let (r, s) = (radius(g, k) * (1.0 - g), g);
                let (mut moved, mut length) = (Accumulator::default(), Accumulator::default());
                for x in records {
                    let across = (1.0 - x.height * x.height).max(0.0).sqrt();
                    let mu = f64::from(across * x.away + x.height * x.along);
                    let [r, s, g, n] = [r, s, g, x.collisions as f32].map(f64::from);
                    moved.add(r * f64::from(x.height) + f64::from(x.along) - (g - s));
                    length.add(2.0 * (1.0 - g) * n - (r * r + 2.0 * r * mu + 2.0 * g * s - s * s));
                }
                for (what, e) in [("moved", moved.estimate()), ("length", length.estimate())] {
                    assert!(e.std_err > 0.0 && e.z(0.0).abs() < 5.2, "g {g}, radius {r} l*: {what} {e}");
                }
            }
        }
    }

    #[test]
    fn walks_in_lanes_are_those_that_each_would_be_alone() {
        for (g, radius) in [(0.0, 3.0), (0.9, 25.0), (-0.5, 1.5)] {
            let law = HenyeyGreenstein { g };
            let stream = |i| Stream::new(&[8, u64::from(i)]);
            let together = walks(&law, radius, shift(g), 5..105, stream);
            assert_eq!(together.len(), 100);
            for (i, record) in (5..).zip(together) {
                let (mut p, mut d, mut collisions) = (Vec3::Z * -shift(g), Vec3::Z, 0);
                let mut rng = stream(i);
                let alone = loop {
                    d = law.scatter(d, &mut rng);
                    let next = p + d * math::exponential(rng.uniform());
                    if next.length_squared() > radius * radius {
                        break leaving(p, d, radius, collisions);
                    }
                    (p, collisions) = (next, collisions + 1);
                };
                // Products and sums may be fused in one and not in the other, which long walks amplify.
                let close = |a: f32, b: f32| (a - b).abs() < 1e-2;
                let same = record.collisions == alone.collisions && close(record.height, alone.height);
                assert!(
                    same && close(record.along, alone.along) && close(record.away, alone.away),
                    "{record:?} {alone:?}"
                );
            }
            assert!(walks(&law, radius, shift(g), 0..0, stream).is_empty());
        }
    }

    #[test]
    fn leaps_follow_records_at_any_turn() {
        let bank = Bank::new(&HenyeyGreenstein { g: 0.7 }, 6, 256, f32::INFINITY);
        let w = Vec3::new(0.48, -0.6, 0.64);
        let (level, radius) = bank.level(6.0).unwrap();
        assert_eq!((bank.levels[0].len(), bank.levels[level].len(), bank.levels[8].len()), (256, 128, 16));
        for number in 0..128 {
            let mut rng = Stream::new(&[7, u64::from(number)]);
            assert!(radius <= 6.0 && radius * RATIO > 6.0);
            let leap = bank.take(level, number + 512, (Vec3::X, radius), w, &mut rng);
            let record = bank.levels[level][number as usize];
            let n = (leap.p - Vec3::X) / radius;
            assert!((n.length() - 1.0).abs() < 1e-5 && (leap.d.length() - 1.0).abs() < 1e-5);
            assert!((n.dot(w) - record.height).abs() < 1e-5 && (leap.d.dot(w) - record.along).abs() < 1e-5);
            let mu = (1.0 - record.height.powi(2)).sqrt() * record.away + record.height * record.along;
            assert!((n.dot(leap.d) - mu).abs() < 1e-4 && mu > -1e-5, "{mu}");
            assert_eq!(leap.collisions, record.collisions);
        }
    }
}
