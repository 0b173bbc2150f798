//! The planar regions of a mesh as facets of curved surfaces.

use glam::DVec3;

use super::fit::Surface;
use crate::part::Mesh;
use crate::part::borders::Borders;
use crate::part::given::GivenFaces;
use crate::part::regions::Regions;
use crate::part::repair::Repaired;
use crate::part::topology::{NONE, ends};

/// Cosine of the greatest angle between neighbouring facets of one surface: 47.5 degrees, so that
/// an octagon (45) may be a round bar, and a hexagon may not.
const SMOOTH: f64 = 0.675_590_207_615_660_2;
/// Cosine of the angle between the mean normal of a facet and the surface's at its middle that is
/// too great: 37 degrees.
const ASKEW: f64 = 0.8;
/// Corners of a facet whose chords are looked at.
const FEW_CORNERS: usize = 8;

/// Regions, their borders, and the vertices where three of them meet: only those surely lie on a
/// curved surface, as facets may have been subdivided.
#[derive(Clone)]
pub(super) struct Net<'a> {
    pub part: &'a Repaired,
    pub regions: &'a Regions,
    pub borders: &'a Borders,
    pub given: &'a GivenFaces,
    is_corner: Vec<bool>,
    /// Uncertainty of a vertex \[m\].
    pub floor: f64,
}

impl<'a> Net<'a> {
    pub(super) fn new(
        part: &'a Repaired,
        regions: &'a Regions,
        borders: &'a Borders,
        given: &'a GivenFaces,
        floor: f64,
    ) -> Self {
        let vertices = part.mesh.vertices.len();
        // Two regions seen at a vertex; one that is open counts as one more.
        let mut seen = vec![[NONE; 2]; vertices];
        let mut is_corner = vec![false; vertices];
        for (triangle, corners) in part.mesh.triangles.iter().enumerate() {
            let region = regions.of[triangle];
            for (k, &vertex) in corners.iter().enumerate() {
                let vertex = vertex as usize;
                let [first, second] = &mut seen[vertex];
                if *first == NONE {
                    *first = region;
                } else if *first != region && *second == NONE {
                    *second = region;
                } else if *first != region && *second != region {
                    is_corner[vertex] = true;
                }
                let before = (k + 2) % 3;
                let open =
                    [k, before].iter().any(|side| part.edges.twin[triangle * 3 + side] == NONE);
                is_corner[vertex] |= open;
            }
        }
        Self { part, regions, borders, given, is_corner, floor }
    }

    /// The same with another uncertainty of a vertex \[m\].
    pub(super) fn with_floor(&self, floor: f64) -> Self {
        Self { floor, ..self.clone() }
    }

    pub(super) fn normal(&self, facet: u32) -> DVec3 {
        self.regions.all[facet as usize].plane.normal
    }

    pub(super) fn centre(&self, facet: u32) -> DVec3 {
        self.regions.all[facet as usize].centre
    }

    pub(super) fn area(&self, facet: u32) -> f64 {
        self.regions.all[facet as usize].area
    }

    pub(super) fn triangles(&self, facet: u32) -> &[u32] {
        self.regions.triangles(facet as usize)
    }

    /// Whether two neighbours may be facets of one surface, by the angle between them. What the file
    /// states is not looked for.
    pub(super) fn is_smooth(&self, a: u32, b: u32) -> bool {
        self.normal(a).dot(self.normal(b)) >= SMOOTH && !self.is_given(a) && !self.is_given(b)
    }

    /// Whether the file states the face that a facet belongs to.
    pub(super) fn is_given(&self, facet: u32) -> bool {
        !self.given.is_empty() && self.given.of(self.triangles(facet)[0]) != NONE
    }

    /// Angle between two neighbours \[rad\], positive where the edge is convex.
    pub(super) fn bend(&self, a: u32, b: u32) -> f64 {
        let (one, other) = (self.normal(a), self.normal(b));
        let between = self.centre(b) - self.centre(a);
        let angle = one.cross(other).length().atan2(one.dot(other));
        if (other - one).dot(between) >= 0.0 { angle } else { -angle }
    }

    /// The vertices of a facet that lie on the surface, some more than once.
    pub(super) fn corners(&self, facet: u32) -> impl Iterator<Item = u32> + '_ {
        let triangles = self.triangles(facet).iter();
        triangles
            .flat_map(|&triangle| self.part.mesh.triangles[triangle as usize])
            .filter(|&vertex| self.is_corner[vertex as usize])
    }

    /// Edges of a facet's triangles between it and others, each with the other and its ends.
    pub(super) fn outer_edges(&self, facet: u32) -> impl Iterator<Item = (u32, [u32; 2])> + '_ {
        let halves = self.triangles(facet).iter().flat_map(|&t| 3 * t..3 * t + 3);
        halves.filter_map(move |half| {
            let other = self.part.edges.twin[half as usize];
            let other = (other != NONE).then(|| self.regions.of[other as usize / 3])?;
            let (from, to) = ends(&self.part.mesh.triangles, half);
            (other != facet).then_some((other, [from, to]))
        })
    }

    /// Pairs of corners that follow each other along the rim of a facet, however finely that is cut.
    pub(super) fn rim(&self, facet: u32) -> Vec<[u32; 2]> {
        let Mesh { triangles, .. } = &self.part.mesh;
        let twin = &self.part.edges.twin;
        let mut edges: Vec<(u32, u32)> = Vec::new();
        for half in self.triangles(facet).iter().flat_map(|&t| 3 * t..3 * t + 3) {
            let other = twin[half as usize];
            if other == NONE || self.regions.of[other as usize / 3] != facet {
                edges.push(ends(triangles, half));
            }
        }
        edges.sort_unstable();
        let starts = edges.iter().filter(|edge| self.is_corner(edge.0));
        let pairs = starts.map(|&(from, mut to)| {
            // A rim of this many edges has no more to a corner.
            for _ in 0..edges.len() {
                let next = edges.partition_point(|edge| edge.0 < to);
                match edges.get(next) {
                    Some(edge) if edge.0 == to && !self.is_corner(to) => to = edge.1,
                    _ => break,
                }
            }
            [from, to]
        });
        pairs.collect()
    }

    /// Middles of the chords between the first few corners of a facet.
    pub(super) fn middles(&self, facet: u32) -> Vec<DVec3> {
        let mut corners: Vec<u32> = self.corners(facet).collect();
        corners.sort_unstable();
        corners.dedup();
        corners.truncate(FEW_CORNERS);
        let points: Vec<DVec3> = corners.iter().map(|&vertex| self.point(vertex)).collect();
        let pairs = points.iter().enumerate();
        pairs.flat_map(|(k, &a)| points[..k].iter().map(move |&b| (a + b) / 2.0)).collect()
    }

    /// Whether three regions meet at a vertex.
    pub(super) fn is_corner(&self, vertex: u32) -> bool {
        self.is_corner[vertex as usize]
    }

    pub(super) fn point(&self, vertex: u32) -> DVec3 {
        self.part.mesh.vertices[vertex as usize]
    }

    /// How far the facet lies inside the chords' surface at most \[m\] (its sag), when its corners lie
    /// within `tolerance` of `surface` and its normal agrees with `sign` times the surface's; `None`
    /// otherwise, and when the sag exceeds `limit`.
    pub(super) fn sag(
        &self,
        surface: &Surface,
        facet: u32,
        sign: f64,
        tolerance: f64,
        limit: f64,
    ) -> Option<f64> {
        let triangles = self.triangles(facet);
        let mut sag = 0.0_f64;
        // A facet may be subdivided into thousands.
        for (index, &triangle) in triangles.iter().step_by(triangles.len() / 16 + 1).enumerate() {
            let [a, b, c] = self.part.mesh.corners(triangle);
            if index == 0 {
                let (_, normal) = surface.distance_and_normal((a + b + c) / 3.0);
                if sign * normal.dot(self.normal(facet)) < ASKEW {
                    return None;
                }
            }
            for point in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0] {
                sag = sag.max(surface.distance(point).abs());
            }
            if sag > limit {
                return None;
            }
        }
        // Last, as a large plane has many triangles and few corners.
        let off = self.corners(facet).any(|v| surface.distance(self.point(v)).abs() > tolerance);
        (!off).then_some(sag)
    }
}
