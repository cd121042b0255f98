//! Figures of what the transport did.

/// What the transport did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Paths started.
    pub paths: u64,
    /// Collisions inside media.
    pub collisions: u64,
    /// Look-ups of fields that were no collisions: null collisions of walks, all of shadow rays.
    pub null_collisions: u64,
    /// Rays cast outside media, to the nearest hit.
    pub rays: u64,
    /// Segments cast inside media.
    pub segments: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Paths that entered a closed body.
    pub entered: u64,
    /// Paths that left a closed body.
    pub left: u64,
    /// Paths that ended inside a closed body (absorbed, by roulette).
    pub ended_inside: u64,
    /// Walks that rounding put outside their body and that were set back on the nearest surface.
    pub rescued: u64,
    /// Walks in media that found no wall at all: open objects.
    pub lost: u64,
    /// Hits on a closed body from the side that the path did not know itself to be on: bodies that intersect themselves or
    /// each other, or a camera inside a body.
    pub contrary: u64,
    /// Paths given up after 2^24 events.
    pub endless: u64,
    /// Ways through bodies that a profile renders.
    pub probes: u64,
    /// Jumps over balls of a medium; the collisions within are not counted.
    pub jumps: u64,
}

impl Counters {
    /// Adds the figures of another part of the work.
    pub fn merge(&mut self, o: &Self) {
        let Self {
            paths,
            collisions,
            null_collisions,
            rays,
            segments,
            shadow_rays,
            entered,
            left,
            ended_inside,
            rescued,
            lost,
            contrary,
            endless,
            probes,
            jumps,
        } = o;
        self.paths += paths;
        self.collisions += collisions;
        self.null_collisions += null_collisions;
        self.rays += rays;
        self.segments += segments;
        self.shadow_rays += shadow_rays;
        self.entered += entered;
        self.left += left;
        self.ended_inside += ended_inside;
        self.rescued += rescued;
        self.lost += lost;
        self.contrary += contrary;
        self.endless += endless;
        self.probes += probes;
        self.jumps += jumps;
    }
}
