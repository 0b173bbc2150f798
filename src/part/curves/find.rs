//! Which regions of the mesh make curved faces.

use glam::DVec3;
use nalgebra::Matrix3;

use super::fit::{Kind, Profile, Surface, circle};
use super::{Axis, CurvedFace, Shape};
use crate::geometry::UnionFind;
use crate::part::facets::Facets;
use crate::part::orient::Role;
use crate::part::regions::Regions;
use crate::part::repair::Repaired;
use crate::part::topology::NONE;

/// Distance of a vertex from its shape as a share of the radius.
const RESIDUAL: f64 = 1e-3;

/// All curved faces of the part, by falling area, numbered from `first`.
pub(in crate::part) fn curved_faces(
    part: &Repaired,
    regions: &Regions,
    facets: &Facets,
    first: u32,
) -> Vec<CurvedFace> {
    let mut sets = UnionFind::new(regions.all.len());
    for (half, &twin) in part.edges.twin.iter().enumerate() {
        if twin == NONE {
            continue;
        }
        let pair = [half / 3, twin as usize / 3].map(|triangle| regions.of[triangle] as usize);
        if pair[0] != pair[1] && pair.iter().all(|&region| facets.is_facet[region]) {
            let [a, b] = pair.map(|region| regions.all[region].plane.normal);
            if a.dot(b) > 0.9 {
                sets.join(pair[0], pair[1]);
            }
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); regions.all.len()];
    for region in (0..regions.all.len()).filter(|&region| facets.is_facet[region]) {
        members[sets.root(region)].push(region);
    }
    let mut faces: Vec<CurvedFace> = members
        .iter()
        .filter(|members| members.len() >= 3)
        .filter_map(|members| cylinder(part, regions, members))
        .collect();
    faces.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.triangles.cmp(&b.triangles)));
    for (face, id) in faces.iter_mut().zip(first..) {
        face.id = id;
    }
    faces
}

fn cylinder(part: &Repaired, regions: &Regions, members: &[usize]) -> Option<CurvedFace> {
    let mut spread = Matrix3::zeros();
    for &region in members {
        let region = &regions.all[region];
        let normal = region.plane.normal;
        let normal = nalgebra::Vector3::new(normal.x, normal.y, normal.z);
        spread += normal * normal.transpose() * region.area;
    }
    let eigen = spread.symmetric_eigen();
    let column = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let direction = DVec3::new(column[0], column[1], column[2]).normalize();
    let (u, v) = direction.any_orthonormal_pair();
    let mut triangles: Vec<u32> =
        members.iter().flat_map(|&region| regions.triangles(region)).copied().collect();
    triangles.sort_unstable();
    let mut vertices: Vec<u32> =
        triangles.iter().flat_map(|&t| part.mesh.triangles[t as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<DVec3> =
        vertices.iter().map(|&vertex| part.mesh.vertices[vertex as usize]).collect();
    let (x, y, radius) = circle(points.iter().map(|point| (point.dot(u), point.dot(v))))?;
    let start = Surface {
        axis: Axis { origin: u * x + v * y, direction },
        profile: Profile::Line { radius, slope: 0.0 },
    };
    let surface = start.fitted(Kind::Cylinder, &points)?;
    let Profile::Line { radius, .. } = surface.profile else { return None };
    let residual = surface.residual(&points);
    if residual > RESIDUAL * radius + 1e-6 * part.diagonal {
        return None;
    }
    let (mut area, mut centroid, mut outward) = (0.0, DVec3::ZERO, 0.0);
    for &triangle in &triangles {
        let [a, b, c] = part.mesh.corners(triangle);
        let normal = (b - a).cross(c - a) / 2.0;
        let middle = (a + b + c) / 3.0;
        area += normal.length();
        centroid += middle * normal.length();
        outward += normal.dot(surface.distance_and_normal(middle).1);
    }
    let axis = surface.axis;
    let places = points.iter().map(|&point| axis.along(point));
    let along = places.fold([f64::INFINITY, f64::NEG_INFINITY], |along, place| {
        [along[0].min(place), along[1].max(place)]
    });
    let shell = part.shell_of[triangles[0] as usize];
    Some(CurvedFace {
        id: 0,
        shape: Shape::Cylinder { axis, radius, along, turn: std::f64::consts::TAU },
        outside: outward > 0.0,
        residual,
        facets: Some(members.len() as f64),
        area,
        centroid: centroid / area,
        triangles,
        shell,
        reachable: part.shells[shell as usize].role == Role::Body,
    })
}
