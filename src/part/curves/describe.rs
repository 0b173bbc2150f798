//! What is told of a curved face.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::find::Face;
use super::fit::{Kind, Profile, Surface};
use super::{Axis, CurvedFace, Shape};
use crate::part::given::{GivenFace, Stated};
use crate::part::orient::Role;
use crate::part::regions::Regions;
use crate::part::repair::Repaired;
use crate::part::{FaceSource, Residual};

/// Gaps between triangles about an axis that are rounding \[rad\].
const GAP: f64 = 1e-9;

/// A surface with its triangles, however it was found.
struct Draft<'a> {
    kind: Kind,
    surface: Surface,
    /// 1 where the material lies on the side of the axis or tube, else -1.
    sign: f64,
    triangles: Vec<u32>,
    /// Points between which the face lies.
    points: Vec<&'a [DVec3]>,
    residual: f64,
    turn: f64,
    facets: Option<f64>,
    source: FaceSource,
    fit: Option<Residual>,
}

/// A surface found among the facets.
pub(super) fn found(part: &Repaired, regions: &Regions, face: &Face) -> Option<CurvedFace> {
    let found = &face.found;
    let mut triangles: Vec<u32> = found
        .members
        .iter()
        .flat_map(|&facet| regions.triangles(facet as usize))
        .copied()
        .collect();
    triangles.sort_unstable();
    let draft = Draft {
        kind: found.kind,
        surface: found.surface,
        sign: found.sign,
        triangles,
        points: vec![&found.points, &face.rim],
        residual: found.residual,
        turn: face.cut.turn,
        facets: Some(face.cut.facets),
        source: FaceSource::Mesh,
        fit: None,
    };
    describe(part, draft)
}

/// A face that the file states, or that was fitted; `None` for a plane.
pub(super) fn given(part: &Repaired, face: &GivenFace) -> Option<CurvedFace> {
    let Stated::Round { kind, surface } = face.surface else { return None };
    let (turn, facets) = match kind {
        Kind::Cylinder | Kind::Cone => {
            let (turn, widest) = arcs(part, &face.triangles, surface.axis);
            (turn, Some(TAU / widest))
        }
        _ => (0.0, None),
    };
    let draft = Draft {
        kind,
        surface,
        sign: face.sign,
        triangles: face.triangles.clone(),
        points: vec![&face.corners],
        residual: face.fit.map_or(face.residual, |fit| fit.greatest),
        turn,
        facets,
        source: face.source(),
        fit: face.fit,
    };
    describe(part, draft)
}

/// The arc that triangles cover about an axis, and that of the widest of them \[rad\].
pub(in crate::part) fn arcs(part: &Repaired, triangles: &[u32], axis: Axis) -> (f64, f64) {
    let (u, v) = axis.direction.any_orthonormal_pair();
    let mut widest = 0.0_f64;
    let mut spans: Vec<[f64; 2]> = Vec::with_capacity(triangles.len());
    for &triangle in triangles {
        let corners = part.mesh.corners(triangle).map(|corner| corner - axis.origin);
        let angle = |corner: DVec3| corner.dot(v).atan2(corner.dot(u));
        // The apex of a cone has no angle.
        let reach = corners.map(|corner| corner.reject_from(axis.direction).length());
        let farthest = reach.into_iter().fold(0.0, f64::max);
        let seen = (0..3).filter(|&k| reach[k] > 1e-6 * farthest).map(|k| angle(corners[k]));
        let mut first = None;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for angle in seen {
            let from = *first.get_or_insert(angle);
            let step = (angle - from + PI).rem_euclid(TAU) - PI;
            (low, high) = (low.min(step), high.max(step));
        }
        let from = first.unwrap_or(0.0) + low;
        widest = widest.max(high - low);
        let from = from.rem_euclid(TAU);
        spans.push([from, from + high - low]);
    }
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(&[first, _]) = spans.first() else { return (0.0, TAU) };
    // The widest gap, also that over the zero of the angles.
    let (mut reached, mut gap) = (first, 0.0_f64);
    for &[from, to] in &spans {
        gap = gap.max(from - reached);
        reached = reached.max(to);
    }
    gap = gap.max(first + TAU - reached);
    (if gap < GAP { TAU } else { TAU - gap }, widest)
}

fn describe(part: &Repaired, draft: Draft<'_>) -> Option<CurvedFace> {
    let Draft { kind, surface, triangles, .. } = draft;
    let (mut area, mut centroid) = (0.0, DVec3::ZERO);
    for &triangle in &triangles {
        let [a, b, c] = part.mesh.corners(triangle);
        let own = (b - a).cross(c - a).length() / 2.0;
        area += own;
        centroid += (a + b + c) / 3.0 * own;
    }
    let axis = surface.axis;
    // The greatest component of the direction is positive, so that the search does not decide.
    let sense = axis.direction[axis.direction.abs().max_position()].signum();
    let mut axis = Axis { direction: axis.direction * sense, ..axis };
    let extent = |axis: Axis| {
        let places = draft.points.iter().copied().flatten().map(|&point| axis.along(point));
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |along, place| {
            [along[0].min(place), along[1].max(place)]
        })
    };
    let centred = |axis: &mut Axis| {
        let [low, high] = extent(*axis);
        axis.origin += axis.direction * (low + high) / 2.0;
        extent(*axis)
    };
    let shape = match (kind, surface.profile) {
        (Kind::Revolution, _) => {
            let along = centred(&mut axis);
            Shape::Revolution { axis, along }
        }
        (Kind::Cone, Profile::Line { radius, slope }) => {
            let apex = surface.axis.origin - surface.axis.direction * (radius / slope.tan());
            let axis = surface.axis.direction * slope.signum();
            let along = extent(Axis { origin: apex, direction: axis });
            Shape::Cone { apex, axis, half_angle: slope.abs(), along }
        }
        (_, Profile::Line { radius, .. }) => {
            let along = centred(&mut axis);
            Shape::Cylinder { axis, radius, along, turn: draft.turn }
        }
        (Kind::Sphere, Profile::Circle { minor, .. }) => {
            Shape::Sphere { centre: axis.origin, radius: minor }
        }
        (_, Profile::Circle { major, minor }) => Shape::Torus { axis, major, minor },
    };
    let shell = part.shell_of[*triangles.first()? as usize];
    Some(CurvedFace {
        id: 0,
        shape,
        outside: draft.sign > 0.0,
        residual: draft.residual,
        facets: draft.facets,
        source: draft.source,
        fit: draft.fit,
        area,
        centroid: centroid / area,
        triangles,
        shell,
        reachable: part.shells[shell as usize].role == Role::Body,
    })
}
