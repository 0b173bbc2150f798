//! Tori that lie flat under the pads, their axes along the closing direction: the crest is a circle.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::Finder;
use super::survey::LEVEL;
use crate::geometry::polygon::Bounds2;
use crate::model::{Gap, Ring};
use crate::part::CurvedFace;

/// Share of the half width of what a pad may touch of a torus that lies flat by which the straight
/// crest of a sector may lie off the arc; the same of a rounded rim, which carries a part of what its plane
/// does.
pub(super) const OFF_ARC: f64 = 0.02;
pub(super) const OFF_RIM: f64 = 0.1;
/// Sectors of a whole turn of such a torus.
const LEAST_SECTORS: usize = 16;
const MOST_SECTORS: usize = 240;
/// Arcs of a whole turn of the crest.
const LEAST_ARCS: usize = 8;
const MOST_ARCS: usize = 64;

/// Whether a torus lies flat under the pads and has a circle for them to touch: its axis along the closing
/// direction, its `major` radius more than none.
pub(super) fn is_flat(axis: DVec3, major: f64, closing: DVec3) -> bool {
    major > 0.0 && axis.cross(closing).length() < LEVEL
}

/// A torus about the closing direction within `across` of its crest, a circle of the radius `major`
/// about `at`, in sectors: each a strip of a cylinder whose straight crest stands for the arc, up to `off`
/// away from it \[m\]. Those that a region meets.
pub(super) fn sectors(
    at: DVec2,
    [major, across, off]: [f64; 3],
    (radius, height): (f64, f64),
    region: Bounds2,
) -> Vec<(Ring, Gap)> {
    let count = TAU / (12.0 * off / major).sqrt();
    let count = (count.ceil() as usize).clamp(LEAST_SECTORS, MOST_SECTORS);
    let half = 0.5 * TAU / count as f64;
    // The straight crest lies as far off the arc at its middle as, on average, elsewhere.
    let middle = major * half.sin() / half;
    let sector = |index: usize| {
        let [from, out, to] =
            [-half, 0.0, half].map(|side| DVec2::from_angle(2.0 * half * index as f64 + side));
        let (near, far) = ((major - across).max(0.0), (major + across) / half.cos());
        let mut ring = vec![at + near * from, at + far * from, at + far * to];
        if near > 0.0 {
            ring.push(at + near * to);
        }
        (ring, Gap::Cylinder { radius, axis: out.perp(), at: at + middle * out, height })
    };
    let sectors = (0..count).map(sector);
    sectors.filter(|(ring, _)| Bounds2::of(ring).meets(region)).collect()
}

impl Finder<'_> {
    /// The crest of a torus that lies flat, in arcs so short that their chords are crests too: the ends
    /// of those that the face reaches, at the height of its `centre`.
    pub(super) fn arcs(
        &self,
        face: &CurvedFace,
        closing: DVec3,
        (centre, [major, minor]): (DVec3, [f64; 2]),
    ) -> Vec<[DVec3; 2]> {
        let count = (PI * (major / minor).sqrt()).ceil();
        let count = (count as usize).clamp(LEAST_ARCS, MOST_ARCS);
        let step = TAU / count as f64;
        let (first, second) = closing.any_orthonormal_pair();
        let mut is_there = vec![false; count];
        for &triangle in &face.triangles {
            let corners = self.part.mesh.corners(triangle).map(|corner| corner - centre);
            if !corners.iter().any(|corner| corner.dot(closing) > 0.97 * minor) {
                continue;
            }
            let angles = corners.map(|x| DVec2::new(x.dot(first), x.dot(second)).to_angle());
            // From the first corner the short way round.
            let turns = angles.map(|angle| {
                let turn = (angle - angles[0]).rem_euclid(TAU);
                if turn > PI { turn - TAU } else { turn }
            });
            let from = (angles[0] + turns[0].min(turns[1]).min(turns[2])) / step;
            let to = (angles[0] + turns[0].max(turns[1]).max(turns[2])) / step;
            for index in from.floor() as i64..=to.floor() as i64 {
                is_there[index.rem_euclid(count as i64) as usize] = true;
            }
        }
        let corner = |index: usize| {
            let turn = DVec2::from_angle(step * index as f64);
            centre + major * (turn.x * first + turn.y * second)
        };
        let there = (0..count).filter(|&index| is_there[index]);
        there.map(|index| [corner(index), corner(index + 1)]).collect()
    }
}
