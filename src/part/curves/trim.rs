//! Facets of cylinders, cones and spheres that are cut off: a flat, a slot or a hole beside a faceted
//! round leaves facets whose corners lie on chords of the round ones. They belong to the round face.

use glam::DVec3;
use rustc_hash::FxHashSet;

use super::find::Face;
use super::fit::{Kind, Profile};
use super::grow::{Exactness, FREE, Found, Growth, SAG_RATIO};
use super::judge::arc_of;
use super::seed::{SPARE, STEEPEST, cylinder_along};

/// Difference of the depth of a strip's plane and that of the other strips', as a share of it, up to
/// which it is one of them.
const AS_DEEP: f64 = 0.05;
/// Difference of the sines and cosines of its angle to the axis and theirs, over the cosine of theirs.
const STEEP: f64 = 0.05;
/// Sine of the angle to the axis up to which the edge of a strip runs along it.
const ALONG: f64 = 0.02;

impl Face {
    /// The arc it covers, after it was given more facets.
    pub(super) fn turn_again(&mut self) {
        if matches!(self.found.kind, Kind::Cylinder | Kind::Cone) {
            let points = self.found.points.iter().chain(&self.rim).copied();
            let step = std::f64::consts::TAU / self.cut.facets;
            self.cut.turn = arc_of(self.found.surface.axis, points, step);
        }
    }
}

impl Growth<'_> {
    /// Adds the facets that are cut off to their faces; their corners go to [`Face::rim`].
    pub(super) fn join_cut(&mut self, faces: &mut [Face]) {
        // Facets that a plane cuts off a ball in one row make a cone: spheres come first.
        for is_sphere in [true, false] {
            for number in 0..faces.len() {
                let is_one = match faces[number].found.kind {
                    Kind::Sphere => is_sphere,
                    Kind::Cylinder | Kind::Cone => !is_sphere,
                    _ => false,
                };
                if is_one {
                    self.join_cut_to(number, faces);
                }
            }
        }
        self.join_same(faces);
    }

    fn join_cut_to(&mut self, number: usize, faces: &mut [Face]) {
        let mut members = std::mem::take(&mut faces[number].found.members);
        let (mut next, whole) = (0, members.len());
        while next < members.len() {
            let facet = members[next];
            next += 1;
            for border in self.net.borders.of(facet as usize) {
                let (other, owner) = (border.other, self.owner[border.other as usize]);
                let found = &faces[number].found;
                if owner == number as u32
                    || !self.net.is_smooth(facet, other)
                    || !self.is_cut(found, other)
                {
                    continue;
                }
                let from = members.len();
                if owner == FREE {
                    members.push(other);
                } else if self.is_cut_row(found, &faces[owner as usize].found) {
                    members.append(&mut faces[owner as usize].found.members);
                }
                for &joined in &members[from..] {
                    self.owner[joined as usize] = number as u32;
                }
            }
        }
        let face = &mut faces[number];
        let triangles = members[whole..].iter().flat_map(|&facet| self.net.triangles(facet));
        face.rim.extend(triangles.flat_map(|&t| self.net.part.mesh.corners(t)));
        face.found.members = members;
        if face.found.members.len() > whole {
            face.turn_again();
        }
    }

    /// A cylinder by the creases between strips whose ends something round cuts off: the other corners of
    /// those lie on chords.
    pub(super) fn by_creases(&mut self, seed: u32) -> Option<Found> {
        let net = self.net;
        let rows = self.rows(seed).into_iter();
        let rows = rows.filter(|(row, about)| {
            about.dot(net.normal(seed)).abs() < STEEPEST
                && row.iter().all(|&facet| self.owner[facet as usize] == FREE)
        });
        let found = rows.filter_map(|(row, about)| self.cut_cylinder(seed, row, about));
        // The first of the largest.
        found.min_by(|a, b| self.area_of(b).total_cmp(&self.area_of(a)))
    }

    /// Ends of the borders between some facets and others that carry on as they do, each once: along a
    /// direction, bent by about `step` \[rad\].
    fn crease_ends(&self, facets: &[u32], along: DVec3, step: f64) -> Vec<u32> {
        let net = self.net;
        let is_crease = |facet: u32, other: u32, [from, to]: [u32; 2]| {
            let edge = net.point(to) - net.point(from);
            net.is_smooth(facet, other)
                && edge.cross(along).length() < ALONG * edge.length() + 2.0 * net.floor
                && (0.4 * step..2.5 * step).contains(&net.bend(facet, other).abs())
        };
        let edges = facets.iter().flat_map(|&facet| {
            let edges = net.outer_edges(facet);
            edges.filter(move |&(other, edge)| is_crease(facet, other, edge))
        });
        let mut ends: Vec<u32> =
            edges.flat_map(|(_, edge)| edge).filter(|&vertex| net.is_corner(vertex)).collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    }

    fn cut_cylinder(&self, seed: u32, row: [u32; 3], about: DVec3) -> Option<Found> {
        let net = self.net;
        let step = net.bend(seed, row[0]).abs();
        let places = |facets: &[u32], along: DVec3| -> Vec<DVec3> {
            let ends = self.crease_ends(facets, along, step).into_iter();
            ends.map(|vertex| net.point(vertex)).collect()
        };
        let points = places(&row, about);
        let ends = self.crease_ends(&[seed], about, step);
        // Without corners on chords rows tell more.
        let is_whole = net.corners(seed).all(|corner| ends.contains(&corner));
        if is_whole || points.len() < Kind::Cylinder.freedoms() + SPARE {
            return None;
        }
        let surface = cylinder_along(about, &points)?.fitted(Kind::Cylinder, &points)?;
        let sign = self.sign(&surface, &row);
        let from = net.point(*ends.first()?) - surface.axis.origin;
        let sag = surface.radius() - sign * net.normal(seed).dot(from);
        let tolerance = self.tolerance(&surface, sag, Exactness::Exact);
        let mut found = Found {
            residual: surface.residual(&points),
            surface,
            kind: Kind::Cylinder,
            sign,
            members: row.to_vec(),
            points,
            sag,
            is_row: false,
        };
        if sag.is_nan() || sag <= tolerance || found.residual > tolerance {
            return None;
        }
        let mut taken = FxHashSet::from_iter(row);
        let mut next = 0;
        while next < found.members.len() {
            let facet = found.members[next];
            next += 1;
            for border in net.borders.of(facet as usize) {
                let other = border.other;
                if self.owner[other as usize] == FREE
                    && net.is_smooth(facet, other)
                    && self.is_cut(&found, other)
                    && taken.insert(other)
                {
                    found.members.push(other);
                }
            }
        }
        found.points = places(&found.members, found.surface.axis.direction);
        found.surface = found.surface.fitted(Kind::Cylinder, &found.points)?;
        found.residual = found.surface.residual(&found.points);
        let is_one = found.members.iter().all(|&facet| self.is_cut(&found, facet));
        (is_one && found.residual <= tolerance).then_some(found)
    }

    /// Whether a face is a row of facets that are cut off from a sphere, or a rest of it.
    fn is_cut_row(&self, sphere: &Found, row: &Found) -> bool {
        sphere.kind == Kind::Sphere
            && row.kind != Kind::Sphere
            && row.members.iter().all(|&facet| self.is_cut(sphere, facet))
    }

    /// Whether a facet is cut off from the surface.
    pub(super) fn is_cut(&self, found: &Found, facet: u32) -> bool {
        match found.surface.profile {
            Profile::Line { radius, slope } => self.is_cut_strip(found, radius, slope, facet),
            Profile::Circle { minor, .. } if found.kind == Kind::Sphere => {
                self.is_cut_cap(found, minor, facet)
            }
            Profile::Circle { .. } => false,
        }
    }

    /// Whether a facet is cut off from the surface, and has a border beyond which that does not go on.
    pub(super) fn is_cut_rim(&self, found: &Found, facet: u32) -> bool {
        let ends = |other: u32| !self.is_marked(other) && !self.is_cut(found, other);
        self.is_cut(found, facet)
            && self.net.borders.of(facet as usize).iter().any(|border| ends(border.other))
    }

    /// Whether a facet's plane cuts a cap off the sphere that is no higher than those of its facets are,
    /// and its corners lie on that cut.
    fn is_cut_cap(&self, found: &Found, radius: f64, facet: u32) -> bool {
        let net = self.net;
        let outward = found.sign * net.normal(facet);
        let tolerance = self.tolerance_of(found);
        let inside = -tolerance..=SAG_RATIO * found.sag + tolerance;
        let fits = |corner: DVec3| {
            let depth = radius - outward.dot(corner - found.surface.axis.origin);
            inside.contains(&depth) && inside.contains(&-found.surface.distance(corner))
        };
        net.triangles(facet).iter().all(|&t| net.part.mesh.corners(t).into_iter().all(fits))
    }

    /// Whether a facet's plane is a chord of the surface as deep as those of the strips, and its
    /// corners lie on the chord.
    fn is_cut_strip(&self, found: &Found, radius: f64, slope: f64, facet: u32) -> bool {
        let net = self.net;
        let axis = found.surface.axis;
        let outward = found.sign * net.normal(facet);
        let (rise, across) = (outward.dot(axis.direction), outward.reject_from(axis.direction));
        // As steep as the strips: a land beside a gentle cone is not.
        let off = STEEP * slope.cos();
        if across.length() < slope.cos() - off || (rise + slope.sin()).abs() > off {
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
