//! `render --audit`: what a picture's own means are worth beside plain walks.

use moonmilk_render::audit::{Audit, audit};
use moonmilk_render::description::SceneDescription;
use moonmilk_render::integrator::{Integrator, Policy};
use moonmilk_render::scene::Scene;

use crate::args::Render;
use crate::failure::Failure;
use crate::{Outcome, output, render};

/// The mode that solves the inside exactly.
const EXACT: &str = "path";
/// Share of a picture's samples that are followed again.
const SHARE: u64 = 16;

/// Audits a render of so many samples per pixel, and prints what was found.
///
/// *Errors*: a check failed, if walks that are exact differ by more than noise.
pub fn run(
    a: &Render,
    d: &SceneDescription,
    scene: &Scene,
    integrator: &Integrator,
    crop: [u32; 4],
    spp: u64,
) -> Outcome {
    let exact = a.subsurface == EXACT;
    if exact && integrator.policy == Policy::Classic {
        return output::print("audit: these are plain walks, there is nothing to compare").map(drop);
    }
    // Its warnings were printed once.
    let (plain, _) = render::make(d, a.open, EXACT)?;
    let found = audit(scene, integrator, &plain, crop, spp.div_ceil(SHARE));
    let name =
        if exact { format!("--walk {}", integrator.policy.name()) } else { format!("--subsurface {}", a.subsurface) };
    output::print(&text(&name, &found))?;
    if found.invalid > 0 {
        tracing::warn!("{} pairs of the audit were left out: a path was not finite", found.invalid);
    }
    if exact && (found.differs() || found.blocks_differ()) {
        return Err(Failure::Check(format!("{name} differs from plain walks by more than noise, which it must not")));
    }
    Ok(())
}

/// Returns what is printed of an audit.
fn text(name: &str, a: &Audit) -> String {
    if a.plain.mean == 0.0 {
        return format!("audit of {name} against plain walks: no light was found");
    }
    let (relative, interval) = a.relative();
    let noise = |differs: bool| if differs { "more than noise" } else { "within noise" };
    format!(
        "audit of {name} against plain walks: {} pairs of paths, mean {:.5} (standard error {:.5})\n  \
         difference {:+.3} % +- {:.3} % (95 %, {} independent values): {}\n  \
         blocks of 16 x 16 pixels: {} compared, the largest standard score is {:.1}: {}",
        a.pairs,
        a.plain.mean,
        a.plain.std_err,
        100.0 * relative,
        100.0 * interval,
        a.difference.n,
        noise(a.differs()),
        a.blocks,
        a.worst_block.abs(),
        noise(a.blocks_differ()),
    )
}
