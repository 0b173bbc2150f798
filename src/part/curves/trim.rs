//! Strips of cylinders and cones that are cut off along their length, or at an angle: a flat, a
//! slot or a hole beside a faceted round leaves facets whose corners lie on chords of the round
//! ones. They belong to the round face.

use glam::DVec3;

use super::find::Face;
use super::fit::{Kind, Profile};
use super::grow::{FREE, Found, Growth};
use super::judge::arc_of;

/// Difference of the depth of a strip's plane and that of the other strips', as a share of it, up to
/// which it is one of them.
const AS_DEEP: f64 = 0.05;
/// Difference of the sines and cosines of its angle to the axis and theirs.
const STEEP: f64 = 0.05;

impl Growth<'_> {
    /// Adds the strips that are cut off to their faces; their corners go to [`Face::rim`].
    pub(super) fn join_cut(&mut self, faces: &mut [Face]) {
        for (number, face) in faces.iter_mut().enumerate() {
            if !matches!(face.found.kind, Kind::Cylinder | Kind::Cone) {
                continue;
            }
            let mut next = 0;
            let whole = face.found.members.len();
            while next < face.found.members.len() {
                let facet = face.found.members[next];
                next += 1;
                for border in self.net.borders.of(facet as usize) {
                    let other = border.other;
                    if self.owner[other as usize] == FREE
                        && self.net.is_smooth(facet, other)
                        && self.is_cut_strip(&face.found, other)
                    {
                        self.owner[other as usize] = number as u32;
                        face.found.members.push(other);
                        let triangles = self.net.triangles(other).iter();
                        face.rim.extend(triangles.flat_map(|&t| self.net.part.mesh.corners(t)));
                    }
                }
            }
            if face.found.members.len() > whole {
                let axis = face.found.surface.axis;
                let points = face.found.points.iter().chain(&face.rim).copied();
                face.cut.turn = arc_of(axis, points, std::f64::consts::TAU / face.cut.facets);
            }
        }
    }

    /// Whether a facet's plane is a chord of the surface as deep as those of the strips, and its
    /// corners lie on the chord.
    pub(super) fn is_cut_strip(&self, found: &Found, facet: u32) -> bool {
        let net = self.net;
        let (axis, Profile::Line { radius, slope }) = (found.surface.axis, found.surface.profile)
        else {
            return false;
        };
        let normal = net.normal(facet);
        let outward = found.sign * normal;
        let (rise, across) = (outward.dot(axis.direction), outward.reject_from(axis.direction));
        // As steep as the strips.
        if across.length() < slope.cos() - STEEP || (rise + slope.sin()).abs() > STEEP {
            return false;
        }
        let away = across.normalize();
        let tolerance = self.tolerance_of(found);
        // The narrow end of a cone has flatter strips.
        let least = if found.kind == Kind::Cylinder { 1.0 - AS_DEEP } else { 0.0 };
        let [least, most] = [least, 1.0 + AS_DEEP].map(|share| share * found.sag);
        let (plane, inside) = (least - tolerance..=most + tolerance, -tolerance..=most + tolerance);
        let fits = |corner: DVec3| {
            let s = axis.along(corner);
            let crest = axis.origin + s * axis.direction + (radius + s * slope.tan()) * away;
            plane.contains(&outward.dot(crest - corner))
                && inside.contains(&-found.surface.distance(corner))
        };
        net.triangles(facet).iter().all(|&t| net.part.mesh.corners(t).into_iter().all(fits))
    }
}
