//! The corners of faces of free form: normals, bends, and the way from one to the next.

use glam::{DMat3, DVec2, DVec3};

use crate::geometry::Paraboloid;
use crate::part::{CurvedFace, Mesh};

/// Corners about one to which a paraboloid is fitted, at least.
const AROUND: usize = 16;
/// Radius of a bend over the width gripped beyond which the surface is straight along it.
const STRAIGHT: f64 = 20.0;
/// Radius of a hollow over the width below which there is no crest.
const HOLLOW: f64 = 2.0;
/// Cosine of the angle between a corner's normal and a direction beyond which its paraboloid says
/// nothing of the crest: 20 degrees.
const NEAR: f64 = 0.94;

/// Corners of faces; one on two faces is there twice.
pub(super) struct Net {
    pub(super) points: Vec<DVec3>,
    /// Unit, outwards, of the own face alone.
    pub(super) normals: Vec<DVec3>,
    /// A third of the triangles about each [m^2].
    pub(super) areas: Vec<f64>,
    /// Number of the face.
    pub(super) faces: Vec<u32>,
    /// Corners beside corner `k`: `beside[first[k]..first[k + 1]]`.
    first: Vec<u32>,
    beside: Vec<u32>,
    /// The surfaces about corners so far, and for each corner its place among them and one, or nought.
    fits: Vec<Option<Local>>,
    fit_of: Vec<u32>,
}

/// The surface about a corner in its own axes.
#[derive(Debug, Clone, Copy)]
struct Local {
    /// Rows: two tangents and the normal.
    axes: DMat3,
    form: Paraboloid,
    /// [`Paraboloid::principal`].
    principal: ([f64; 2], DVec2),
    /// Distance of the farthest corner that was fitted \[m\].
    size: f64,
}

/// Where a surface faces a direction, to second order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facing {
    /// The place \[m\].
    pub(super) point: DVec3,
    /// How the place moves with the direction \[m\]: radii along the principal directions; nought
    /// where it is straight.
    pub(super) radii: DMat3,
    /// Directions along which it is straight, each with what the direction lacks to face it \[rad\].
    pub(super) straight: [Option<(DVec3, f64)>; 2],
}

/// `e e^T`.
pub(super) fn square(e: DVec3) -> DMat3 {
    DMat3::from_cols(e * e.x, e * e.y, e * e.z)
}

impl Net {
    pub(super) fn new<'a>(mesh: &Mesh, faces: impl Iterator<Item = &'a CurvedFace>) -> Self {
        let mut net = Self {
            points: Vec::new(),
            normals: Vec::new(),
            areas: Vec::new(),
            faces: Vec::new(),
            first: vec![0],
            beside: Vec::new(),
            fits: Vec::new(),
            fit_of: Vec::new(),
        };
        for face in faces {
            let mut index: Vec<u32> = face
                .triangles
                .iter()
                .flat_map(|&triangle| mesh.triangles[triangle as usize])
                .collect();
            index.sort_unstable();
            index.dedup();
            let base = net.points.len();
            let place = |vertex: u32| index.partition_point(|&known| known < vertex);
            net.points.extend(index.iter().map(|&vertex| mesh.vertices[vertex as usize]));
            net.normals.resize(net.points.len(), DVec3::ZERO);
            net.areas.resize(net.points.len(), 0.0);
            net.faces.resize(net.points.len(), face.id);
            let mut links: Vec<(u32, u32)> = Vec::with_capacity(6 * face.triangles.len());
            for &triangle in &face.triangles {
                let corners = mesh.triangles[triangle as usize].map(|vertex| base + place(vertex));
                let [a, b, c] = corners.map(|corner| net.points[corner]);
                let twice = (b - a).cross(c - a);
                for (k, &corner) in corners.iter().enumerate() {
                    // By the angle, so that the way a face is cut into triangles does not tell.
                    let own = net.points[corner];
                    let sides = [1, 2].map(|step| net.points[corners[(k + step) % 3]] - own);
                    net.normals[corner] +=
                        twice.normalize_or_zero() * sides[0].angle_between(sides[1]);
                    net.areas[corner] += twice.length() / 6.0;
                    links
                        .extend([1, 2].map(|step| (corner as u32, corners[(k + step) % 3] as u32)));
                }
            }
            links.sort_unstable();
            links.dedup();
            for corner in base..net.points.len() {
                net.normals[corner] = net.normals[corner].normalize_or_zero();
                let from = links.partition_point(|link| (link.0 as usize) < corner);
                let own = links[from..].iter().take_while(|link| link.0 as usize == corner);
                net.beside.extend(own.map(|link| link.1));
                net.first.push(net.beside.len() as u32);
            }
        }
        net.fit_of.resize(net.points.len(), 0);
        net
    }

    pub(super) fn beside(&self, corner: u32) -> &[u32] {
        let [from, to] = [corner, corner + 1].map(|k| self.first[k as usize] as usize);
        &self.beside[from..to]
    }

    /// About `most` corners spread by area.
    pub(super) fn sample(&self, most: usize) -> Vec<u32> {
        if self.points.len() <= most {
            return (0..self.points.len() as u32).collect();
        }
        let step = self.areas.iter().sum::<f64>() / most as f64;
        let mut next = 0.5 * step;
        let mut found = Vec::with_capacity(most);
        let mut sum = 0.0;
        for (corner, area) in self.areas.iter().enumerate() {
            sum += area;
            if sum > next {
                found.push(corner as u32);
                next = sum + step - (sum - next) % step;
            }
        }
        found
    }

    /// The corner that faces a direction best, from one to the next.
    pub(super) fn walk(&self, mut corner: u32, direction: DVec3) -> u32 {
        loop {
            let facing = |corner: u32| self.normals[corner as usize].dot(direction);
            let (mut best, mut most) = (corner, f64::NEG_INFINITY);
            for &other in self.beside(corner) {
                let value = facing(other);
                if value >= most {
                    (best, most) = (other, value);
                }
            }
            if most <= facing(corner) + 1e-12 {
                return corner;
            }
            corner = best;
        }
    }

    fn local(&mut self, corner: u32) -> Option<&Local> {
        let mut known = self.fit_of[corner as usize];
        if known == 0 {
            let local = self.fit(corner);
            self.fits.push(local);
            known = self.fits.len() as u32;
            self.fit_of[corner as usize] = known;
        }
        self.fits[known as usize - 1].as_ref()
    }

    fn fit(&self, corner: u32) -> Option<Local> {
        let normal = self.normals[corner as usize];
        if normal == DVec3::ZERO {
            return None;
        }
        let mut near = vec![corner];
        let mut inner = 0;
        // Ring after ring, so that both sides count alike.
        while inner < near.len() && near.len() < AROUND {
            let ring = inner..near.len();
            inner = near.len();
            for index in ring {
                for &other in self.beside(near[index]) {
                    if !near.contains(&other) {
                        near.push(other);
                    }
                }
            }
        }
        let (x, y) = normal.any_orthonormal_pair();
        let axes = DMat3::from_cols(x, y, normal).transpose();
        let origin = self.points[corner as usize];
        let points = near.iter().map(|&other| (axes * (self.points[other as usize] - origin), 1.0));
        let size = points.clone().map(|(point, _)| point.truncate().length()).fold(0.0, f64::max);
        let form = Paraboloid::fit(points)?;
        Some(Local { axes, principal: form.principal(), form, size })
    }

    /// Whether the surface about a corner bulges outwards in all directions, or nearly.
    pub(super) fn is_convex(&mut self, corner: u32) -> bool {
        self.local(corner).is_some_and(|local| {
            let ([low, high], _) = local.principal;
            low < 0.0 && high < -0.2 * low
        })
    }

    /// The place near a corner where the surface faces a direction, for a grip of a `width`.
    pub(super) fn facing(&mut self, corner: u32, direction: DVec3, width: f64) -> Option<Facing> {
        let Local { axes, form, principal, size } = *self.local(corner)?;
        let towards = axes * direction;
        if towards.z < NEAR {
            return None;
        }
        let lacks = -towards.truncate() / towards.z - form.slope;
        let ([low, high], first) = principal;
        let mut step = DVec2::ZERO;
        let mut radii = DMat3::ZERO;
        let mut straight = [None; 2];
        for (k, (bend, along)) in [(low, first), (high, first.perp())].into_iter().enumerate() {
            if bend * HOLLOW * width > 1.0 {
                return None;
            }
            let of_part = axes.transpose() * along.extend(0.0);
            if -bend * STRAIGHT * width < 1.0 {
                // Two rows of corners leave a slope along them open; the triangles' normals do not.
                straight[k] = Some((of_part, -along.dot(towards.truncate())));
            } else {
                step += along * (along.dot(lacks) / bend);
                radii -= square(of_part) * bend.recip();
            }
        }
        step = step.clamp_length_max(size);
        let point = self.points[corner as usize] + axes.transpose() * step.extend(form.at(step));
        Some(Facing { point, radii, straight })
    }
}

/// Corners by their normals.
pub(super) struct Normals {
    /// Of cell `k`: `corners[first[k]..first[k + 1]]`.
    first: Vec<u32>,
    corners: Vec<u32>,
}

impl Normals {
    /// Distance within which all are found: of unit vectors 12.6 degrees apart.
    const CELL: f64 = 0.22;
    /// Cells along an axis, with one beyond either end.
    const CELLS: i32 = 12;

    pub(super) fn new(corners: &[u32], net: &Net) -> Self {
        let cell = |corner: u32| Self::cell(net.normals[corner as usize]) as u32;
        let mut sorted: Vec<(u32, u32)> = corners.iter().map(|&id| (cell(id), id)).collect();
        // Those of one cell stay in order.
        sorted.sort_by_key(|(cell, _)| *cell);
        let cells = 0..=Self::CELLS.pow(3) as u32;
        let first = cells.map(|cell| sorted.partition_point(|one| one.0 < cell) as u32).collect();
        Self { first, corners: sorted.into_iter().map(|(_, corner)| corner).collect() }
    }

    fn cell(normal: DVec3) -> i32 {
        let [x, y, z] = ((normal / Self::CELL).floor().as_ivec3() + Self::CELLS / 2).to_array();
        (x * Self::CELLS + y) * Self::CELLS + z
    }

    /// Corners whose normals may be that near to `normal`, and others.
    pub(super) fn near(&self, normal: DVec3) -> impl Iterator<Item = u32> + '_ {
        let middle = Self::cell(normal);
        (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x * Self::CELLS + y) * Self::CELLS)).flat_map(
            move |row| {
                // Three cells one after the other.
                let [from, to] = [-1, 2].map(|z| self.first[(middle + row + z) as usize] as usize);
                self.corners[from..to].iter().copied()
            },
        )
    }
}
