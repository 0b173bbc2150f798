//! Roughness that hides what a surface is: it is measured and told, not smoothed away.
//!
//! Whatever the form, near enough it is a paraboloid, and the corners lie off it by less the smaller
//! the patch. Those of a rough surface lie off by as much in a small patch as in a large one.

use super::free::{Hoods, Patch};
use crate::geometry::Paraboloid;
use crate::part::repair::Repaired;

/// Vertices of a small patch, at least: two rings.
const SMALL: usize = 16;
/// ... and of large ones: three to eight rings. The first that shows the form is taken.
const LARGE: [usize; 4] = [30, 60, 120, 240];
/// Places at which the surface is tried, and of those the fewest that tell something.
const PLACES: usize = 200;
const FEWEST: usize = 24;
/// Distance of corners from a paraboloid in a large patch as a multiple of that in the small one up
/// to which it is roughness. Measured: smooth forms 2.7 to 3.2, near the cube of the width; with
/// random distances that hide them 0.9 to 1.6.
const ALIKE: f64 = 2.0;
/// The same as a share of their distance from a plane, up to which the form shows. Measured on smooth
/// forms with noise 0.1 to 0.25; where edges run through the patch 0.4 and more.
const FORM: f64 = 0.3;
/// Share of the places that must be rough.
const SHARE: f64 = 0.6;
/// Share of the part's surface below which roughness is not told.
const LEAST: f64 = 0.1;

/// What is seen of the roughness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::part) struct Roughness {
    /// Share of the surface that it hides.
    pub share: f64,
    /// Root mean square distance of corners from the form beneath \[m\].
    pub distance: f64,
}

/// Roughness of the triangles that belong to no face, where it is what they have in common.
pub(in crate::part) fn roughness(part: &Repaired, is_taken: &[bool]) -> Option<Roughness> {
    let area = |triangle: usize| {
        let [a, b, c] = part.mesh.corners(triangle as u32);
        0.5 * (b - a).cross(c - a).length()
    };
    let loose: Vec<u32> =
        (0..is_taken.len() as u32).filter(|&triangle| !is_taken[triangle as usize]).collect();
    let total: f64 = (0..is_taken.len()).map(area).sum();
    let share = loose.iter().map(|&triangle| area(triangle as usize)).sum::<f64>() / total;
    if share < LEAST {
        return None;
    }
    let hoods = Hoods::new(&part.mesh, &loose);
    let (mut places, mut rough) = (0, Vec::new());
    for vertex in hoods.spread(PLACES) {
        let Some([small, _]) = scatter(&hoods.patch(vertex, SMALL), SMALL) else { continue };
        places += 1;
        let mut patches = LARGE.iter().map_while(|&size| scatter(&hoods.patch(vertex, size), size));
        if let Some([large, _]) = patches.find(|[large, bent]| *large < FORM * bent)
            && large < ALIKE * small
        {
            rough.push(small);
        }
    }
    if places < FEWEST || (rough.len() as f64) < SHARE * places as f64 {
        return None;
    }
    rough.sort_by(f64::total_cmp);
    Some(Roughness { share, distance: rough[rough.len() / 2] })
}

/// Distance of a patch's corners from the paraboloid and from the plane nearest to them: root mean
/// square \[m\], of what the parameters leave free. `None` where there are too few.
fn scatter(patch: &Patch, least: usize) -> Option<[f64; 2]> {
    let count = patch.points.len();
    if count < least {
        return None;
    }
    let points = || patch.points.iter().copied();
    let weighted = points().map(|point| (point, 1.0));
    let off = [Paraboloid::fit(weighted.clone())?, Paraboloid::flat(weighted)?]
        .map(|form| form.off(points()) * (count as f64).sqrt());
    Some([off[0] / (count as f64 - 6.0).sqrt(), off[1] / (count as f64 - 3.0).sqrt()])
}
