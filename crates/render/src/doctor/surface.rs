//! Whether a surface encloses one volume: holes, windings, shells, cuts through itself, normals.

use moonmilk_geometry::{Mesh, Shell};

use super::{Patient, is_subsurface};

/// Cuts searched for before a mesh counts as thoroughly bad.
const ENOUGH_CUTS: usize = 10_000;

/// Share of the area whose vertex normals point to the other side below which nothing is said: slivers of scans.
const FEW: f64 = 1e-3;

/// Examines the surface of an object that bounds a medium; returns whether it encloses a volume.
pub fn examine(p: &mut Patient, shape: usize) -> bool {
    let subsurface = is_subsurface(p.d, &p.d.shapes[shape]);
    let Some(mesh) = p.shapes[shape].mesh().cloned() else {
        return analytic(p, shape, subsurface);
    };
    let name = p.d.shapes[shape].name.clone();
    let t = mesh.topology();
    let duplicates = mesh.duplicates();
    if duplicates.same + duplicates.opposite > 0 {
        p.problem(
            "duplicates",
            shape,
            format!(
                "{name}: {} triangles stand twice ({} of them back to back), the first is triangle {}",
                duplicates.same + duplicates.opposite,
                duplicates.opposite,
                duplicates.first.unwrap_or_default()
            ),
            "remove double faces in the modeller: a wall that is crossed twice is no boundary",
        );
    }
    zero_area(p, shape, mesh.dropped());
    if t.boundary > 0 {
        let place = t.boundary_edges.first().map_or(String::new(), |e| format!(", the first near {}", point(e[0])));
        let message = format!("{name} is open: {} of its {} edges have one triangle only{place}", t.boundary, t.edges);
        let partners = partners(p, shape);
        if subsurface || partners == 0 {
            let advice = "close the mesh in the modeller; or render with --open cap (flat caps), --open profile (a profile instead of walks) or --open kill (light that finds no wall is lost and counted)";
            p.problem("open", shape, message, advice);
        } else {
            let message = format!("{message}; {partners} other shapes bound the same media");
            p.note(
                "open",
                shape,
                message,
                "together they must leave no gap: light that finds no wall is lost, and --stats counts it",
            );
        }
    }
    if t.misoriented > 0 {
        let message = format!("{name}: {} edges have triangles wound against each other", t.misoriented);
        p.problem(
            "misoriented",
            shape,
            message,
            "recalculate normals in the modeller so that all triangles face outward",
        );
    }
    if t.unbalanced > 0 {
        let message = format!("{name}: {} edges have three or more triangles that do not pair up", t.unbalanced);
        p.problem(
            "non-manifold",
            shape,
            message,
            "remove inner walls and stray faces (\"make manifold\" in the modeller)",
        );
    }
    let (label, shells) = mesh.shells();
    let apart = !cuts(p, shape, &mesh, &label);
    let closed = t.is_closed();
    if closed {
        facing(p, shape, &shells, subsurface, apart);
    }
    normals(p, shape, &mesh);
    closed
}

/// Examines a surface that bounds no medium: what matters for translucent objects alone is left out.
pub fn examine_opaque(p: &mut Patient, shape: usize) {
    let dropped = p.shapes[shape].mesh().map_or(0, Mesh::dropped);
    zero_area(p, shape, dropped);
}

/// Says of an analytic shape whether it encloses a volume.
fn analytic(p: &mut Patient, shape: usize, subsurface: bool) -> bool {
    let closed = p.shapes[shape].is_closed();
    let name = p.d.shapes[shape].name.clone();
    if !closed {
        let partners = partners(p, shape);
        let message = format!("{name} encloses no volume: of the analytic shapes only a whole sphere does");
        if subsurface || partners == 0 {
            p.problem("open", shape, message, "use a whole sphere or a closed mesh");
        } else {
            let message = format!("{message}; {partners} other shapes bound the same media");
            p.note(
                "open",
                shape,
                message,
                "together they must leave no gap: light that finds no wall is lost, and --stats counts it",
            );
        }
    } else if p.shapes[shape].volume() < 0.0 {
        inside_out(p, shape, subsurface);
    }
    closed
}

/// Returns the number of other shapes with the same media on their sides.
fn partners(p: &Patient, shape: usize) -> usize {
    let Some(media) = p.d.shapes[shape].media else {
        return 0;
    };
    let same =
        |m: crate::description::MediumInterface| m == media || (m.inside == media.outside && m.outside == media.inside);
    p.d.shapes.iter().filter(|s| s.media.is_some_and(same)).count() - 1
}

fn zero_area(p: &mut Patient, shape: usize, dropped: usize) {
    if dropped > 0 {
        let name = &p.d.shapes[shape].name;
        let message = format!("{name}: {dropped} triangles without area are left out");
        p.note("zero-area", shape, message, "harmless, unless the neighbours do not meet without them");
    }
}

/// Reports triangles that cut each other, within one shell and between shells; returns whether shells do.
fn cuts(p: &mut Patient, shape: usize, mesh: &Mesh, label: &[u32]) -> bool {
    let cuts = mesh.crossings(ENOUGH_CUTS);
    let name = p.d.shapes[shape].name.clone();
    let within = |pair: &[u32; 2]| label[pair[0] as usize] == label[pair[1] as usize];
    let more = if cuts.more { "more than " } else { "" };
    for (own, code, what, advice) in [
        (
            true,
            "self-intersecting",
            "cuts through itself",
            "remesh it or repair it in the modeller (\"intersect\", \"voxel remesh\")",
        ),
        (
            false,
            "overlapping-shells",
            "has pieces that cut through each other",
            "unite the pieces in the modeller (Boolean union), or make them objects of their own that do not overlap",
        ),
    ] {
        let of_kind: Vec<usize> = (0..cuts.pairs.len()).filter(|&i| within(&cuts.pairs[i]) == own).collect();
        if let Some(&first) = of_kind.first() {
            let message = format!(
                "{name} {what}: {more}{} pairs of triangles, the first near {} (triangles {} and {})",
                of_kind.len(),
                point(cuts.points[first]),
                cuts.pairs[first][0],
                cuts.pairs[first][1]
            );
            p.problem(code, shape, message, advice);
        }
    }
    cuts.pairs.iter().any(|pair| !within(pair))
}

/// Reports shells that face the wrong way; of shells that cut each other (not `apart`) it is only said what the largest does.
fn facing(p: &mut Patient, shape: usize, shells: &[Shell], subsurface: bool, apart: bool) {
    let reverse = p.shapes[shape].reverse;
    let name = p.d.shapes[shape].name.clone();
    // The largest shell stands for the object: if it faces inward, the whole is inside out.
    let Some(outer) = shells.iter().max_by(|a, b| a.volume.abs().total_cmp(&b.volume.abs())) else {
        return;
    };
    let inward = outer.faces_outward() == reverse;
    if inward {
        inside_out(p, shape, subsurface);
    }
    if !apart {
        return;
    }
    let odd: Vec<&Shell> = shells.iter().filter(|s| s.faces_outward() != outer.faces_outward()).collect();
    if let Some(first) = odd.first() {
        let message = if first.depth > 0 {
            format!(
                "{name}: {} of its {} shells lie inside others and are wound like them, the first near {}",
                odd.len(),
                shells.len(),
                point(first.vertex)
            )
        } else {
            format!(
                "{name}: {} of its {} pieces are inside out, the first near {}",
                odd.len(),
                shells.len(),
                point(first.vertex)
            )
        };
        let advice = "a cavity must be wound inward (flip the inner shell); a second wall inside a solid must be removed; pieces apart must all face outward";
        p.problem("shell-facing", shape, message, advice);
    } else if shells.len() > 1 {
        let cavities = shells.iter().filter(|s| s.depth % 2 == 1).count();
        let message = format!("{name} has {} closed pieces, {cavities} of them cavities", shells.len());
        p.note("shells", shape, message, "fine as long as they are meant to be one object");
    }
}

fn inside_out(p: &mut Patient, shape: usize, subsurface: bool) {
    let s = &p.d.shapes[shape];
    let name = s.name.clone();
    if subsurface {
        let message = format!("{name} is inside out: its normals point inward; it is rendered right side out");
        p.note("inside-out", shape, message, "flip its normals, or add or remove ReverseOrientation above it");
    } else if s.media.is_some_and(|m| m.inside.is_some() && m.outside.is_none()) {
        let message = format!(
            "{name} is inside out: its normals point inward, so its medium fills the world around it and not itself"
        );
        p.problem("inside-out", shape, message, "flip its normals, or add or remove ReverseOrientation above it");
    }
}

/// Compares vertex normals with faces.
fn normals(p: &mut Patient, shape: usize, mesh: &Mesh) {
    let name = p.d.shapes[shape].name.clone();
    let against = 1.0 - mesh.agreement_with_normals();
    if against > 0.5 {
        let message =
            format!("{name}: the vertex normals of {:.0} % of its area point against its faces", 100.0 * against);
        p.problem(
            "normals",
            shape,
            message,
            "the file winds its triangles one way and its normals the other: recalculate one of them, or leave the normals out",
        );
    } else if against > FEW {
        let message =
            format!("{name}: the vertex normals of {:.1} % of its area point against its faces", 100.0 * against);
        p.note("normals", shape, message, "recalculate the normals where the shading looks wrong");
    }
}

/// Returns a point in words.
pub fn point(p: moonmilk_core::Vec3) -> String {
    format!("({:.4}, {:.4}, {:.4})", p.x, p.y, p.z)
}
