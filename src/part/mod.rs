//! A part: its mesh read, welded and checked, its mass properties and its planar faces.
//!
//! [`Part::read`] does it all: a reader per format gives triangles, [`repair`](health) makes one
//! consistent outward surface of them and says what it did, and region growing finds the planar
//! faces with exact boundaries.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result};
use crate::model::{Frame, LARGEST_LENGTH, Polygon};
use crate::request::Request;

mod borders;
mod boundary;
mod cracks;
mod crossing;
mod curves;
pub mod drawing;
mod faces;
mod facets;
mod fitted;
mod given;
pub mod health;
mod mass;
mod noise;
mod order;
mod orient;
mod pairs;
mod patches;
mod read;
mod regions;
mod repair;
mod symmetry;
mod topology;
mod unit;
mod weld;

pub use crate::units::Unit;
pub use curves::{Axis, CurvedFace, Shape};
pub use health::Health;
pub(crate) use pairs::ANTIPARALLEL;
pub(crate) use read::{KNOWN as KNOWN_SUFFIXES, is_part};
#[cfg(feature = "step")]
pub use read::{StepProcess, serve_step};
pub use symmetry::Symmetry;
pub(crate) use unit::is_plausible;

/// A triangle mesh \[m\], welded, outward-oriented.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the part frame \[m\].
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The three corners of triangle `index` \[m\].
    #[inline]
    pub fn corners(&self, index: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[index as usize];
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }

    /// Smallest and largest corner of the bounding box \[m\]; zeros for an empty mesh.
    pub fn bounding_box(&self) -> (DVec3, DVec3) {
        let Some(&first) = self.vertices.first() else { return (DVec3::ZERO, DVec3::ZERO) };
        self.vertices
            .iter()
            .fold((first, first), |(low, high), &vertex| (low.min(vertex), high.max(vertex)))
    }
}

/// Mass properties of the solid at a uniform density.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// Volume [m^3].
    pub volume: f64,
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass in the part frame \[m\].
    pub centre_of_mass: DVec3,
    /// Inertia about the centre of mass, part axes [kg m^2].
    pub inertia: DMat3,
}

/// Where it is known from what a face is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum FaceSource {
    /// Recognised from the triangles of the mesh.
    Mesh,
    /// The file states it: STEP.
    File,
    /// Fitted within the tolerance asked for ([`ReadOptions::fit`]).
    Fit,
}

/// How far the corners of a noisy mesh lay off a face that was fitted to them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    /// Root mean square \[m\].
    pub rms: f64,
    /// The greatest \[m\].
    pub greatest: f64,
}

/// One planar face of the part with its boundary.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarFace {
    /// Stable number: faces are sorted by falling area, then by position. Equal to the index in
    /// [`Part::faces`].
    pub id: u32,
    /// Unit normal pointing out of the material, part frame.
    pub normal: DVec3,
    /// `normal . x` for points of the face \[m\].
    pub offset: f64,
    /// Area [m^2].
    pub area: f64,
    /// Area centroid, part frame \[m\].
    pub centroid: DVec3,
    /// Face frame: `z` is the normal, the origin is the centroid.
    pub part_from_face: Frame,
    /// The face in its own `(x, y)` \[m\]: disjoint polygons, outer rings counter-clockwise seen from
    /// outside.
    pub polygons: Vec<Polygon>,
    /// Indices of its triangles in the mesh.
    pub triangles: Vec<u32>,
    /// Where the plane comes from.
    pub source: FaceSource,
    /// Of a fitted face: how far the corners lay off it.
    pub fit: Option<Residual>,
    /// Number of the shell (connected surface) that the face lies on.
    pub shell: u32,
    /// False for the walls of an internal void, or of a body wholly inside another: no finger gets
    /// there.
    pub reachable: bool,
}

/// Where the material lies between two antiparallel faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PairKind {
    /// The outward normals point away from each other: the jaws close on the faces.
    External,
    /// The outward normals point towards each other, as in a slot: the jaws open against the faces.
    Internal,
}

/// Two antiparallel planar faces that can be gripped between the jaws.
#[derive(Debug, Clone, PartialEq)]
pub struct FacePair {
    /// [`PlanarFace::id`] of the face under pad I.
    pub face_i: u32,
    /// [`PlanarFace::id`] of the face under pad II.
    pub face_ii: u32,
    /// Distance of the planes \[m\].
    pub width: f64,
    /// Area in which the faces' projections overlap [m^2].
    pub overlap_area: f64,
    /// Gripped from outside or from inside.
    pub kind: PairKind,
}

/// How to read a part.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Unit of the file's numbers. `None`: the file's own where it states one (3MF, glTF),
    /// otherwise millimetres.
    pub unit: Option<Unit>,
    /// Most memory that reading may take \[bytes\]; a file that needs more is refused before it is
    /// taken. `None`: [`crate::memory::default_limit`].
    pub max_memory: Option<u64>,
    /// Whether a glTF file may name buffers outside of its own folder.
    pub outside_buffers: bool,
    /// Whether every facet is meant as a plane, so that none is taken for a curved face.
    pub faceted: bool,
    /// Distance \[m\] within which corners of a noisy mesh are taken for points of one plane or
    /// round face; they are moved onto the faces that fit them. `None`: nothing is fitted.
    pub fit: Option<f64>,
}

setters!(ReadOptions {
    with_unit: unit: Option<Unit>,
    with_max_memory: max_memory: Option<u64>,
    with_outside_buffers: outside_buffers: bool,
    with_faceted: faceted: bool,
    with_fit: fit: Option<f64>,
});

impl From<&Request> for ReadOptions {
    fn from(request: &Request) -> Self {
        Self {
            unit: request.unit,
            max_memory: request.max_memory.map(|memory| memory.0 as u64),
            outside_buffers: request.outside_buffers,
            faceted: request.faceted,
            fit: request.fit.map(|fit| fit.0),
        }
    }
}

/// Where the unit of a part's numbers comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum UnitSource {
    /// The file states it.
    File,
    /// The reader was told.
    Given,
    /// Neither: millimetres are assumed.
    Assumed,
}

/// A part, read and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// File name without folder and suffixes.
    pub name: String,
    /// The file it was read from (empty for a part made in memory).
    pub file: PathBuf,
    /// Unit of the file's numbers \[m\].
    pub unit_m: f64,
    /// Where that unit comes from.
    pub unit_source: UnitSource,
    /// The surface: welded, repaired, outward-oriented.
    pub mesh: Mesh,
    /// What was found and repaired.
    pub health: Health,
    /// Planar faces by falling area.
    pub faces: Vec<PlanarFace>,
    /// Curved faces by falling area, those of free form after the others; their numbers continue
    /// those of the planar faces.
    pub curved: Vec<CurvedFace>,
    /// Mass properties at a density of 1 kg/m^3.
    unit_mass: MassProperties,
}

/// Smallest extent of a part \[m\]: below it products of lengths leave the range of numbers.
const SMALLEST_EXTENT: f64 = 1e-9;

/// Refuses sizes with which nothing can be computed.
fn check_extent(soup: &weld::Soup, unit: Unit, place: &str) -> Result<()> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &vertex in &soup.vertices {
        (low, high) = (low.min(vertex), high.max(vertex));
    }
    let largest = low.abs().max(high.abs()).max_element() * unit.metres();
    let extent = (high - low).max_element() * unit.metres();
    let problem = if largest > LARGEST_LENGTH {
        format!("a coordinate is {largest:.3e} m; the largest is {LARGEST_LENGTH:.0e} m")
    } else if !soup.vertices.is_empty() && extent < SMALLEST_EXTENT && extent > 0.0 {
        format!("it measures {extent:.3e} m; the smallest part is {SMALLEST_EXTENT:.0e} m")
    } else {
        return Ok(());
    };
    let remedy = "check the unit of its numbers, or repair the file";
    Err(Error::new(ErrorKind::Geometry, place, problem, remedy).with_options(&["unit"]))
}

impl Part {
    /// Reads, welds, repairs and orients the mesh in `path`, and finds its planar faces.
    ///
    /// STL (binary, ASCII), OBJ, PLY, OFF, 3MF, glTF and GLB, each also as `.gz`; STEP with the
    /// feature `step`.
    ///
    /// # Errors
    /// When the file cannot be read, is not what its suffix says, is damaged, holds no triangle, or
    /// holds more triangles than can be indexed or than the memory allowed takes, or when its size
    /// is beyond 1e9 m or below 1e-9 m. An open or otherwise faulty surface is no error:
    /// see [`Part::health`].
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        let soup = read::read(path, options)?;
        let of_file = soup.unit;
        let (unit, source) = match (options.unit, of_file) {
            (Some(given), _) => (given, UnitSource::Given),
            (None, Some(stated)) => (stated, UnitSource::File),
            (None, None) => (Unit::Millimetre, UnitSource::Assumed),
        };
        let mut part = Self::build(soup, unit, options, &path.display().to_string())?;
        part.name = read::stem(path);
        part.file = path.to_path_buf();
        part.unit_source = source;
        if let Some(stated) = of_file.filter(|&stated| stated != unit) {
            part.health.warnings.push(format!(
                "the file states the unit {stated}; its numbers were read in {unit}, as asked"
            ));
        }
        let (low, high) = part.mesh.bounding_box();
        if let Some(warning) = unit::implausible_size(high - low, unit, source) {
            part.health.warnings.push(warning);
        }
        Ok(part)
    }

    /// A part from triangles in memory \[m\]; the same repairs as for a file.
    ///
    /// # Errors
    /// When a coordinate is not finite, an index points nowhere, or no triangle with an area is
    /// left.
    pub fn from_triangles(name: &str, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        Self::from_triangles_with(name, vertices, triangles, &ReadOptions::default())
    }

    /// As [`Part::from_triangles`], with [`ReadOptions::faceted`] and [`ReadOptions::fit`].
    ///
    /// # Errors
    /// As there, and when the tolerance of the fit is not above zero or not small against the part.
    pub fn from_triangles_with(
        name: &str,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
        options: &ReadOptions,
    ) -> Result<Self> {
        let mut welder = weld::Welder::default();
        for (number, triangle) in triangles.iter().enumerate() {
            let mut corners = [DVec3::ZERO; 3];
            for (corner, &index) in corners.iter_mut().zip(triangle) {
                *corner = *vertices.get(index as usize).ok_or_else(|| {
                    Error::new(
                        ErrorKind::Geometry,
                        format!("{name}, triangle {number}"),
                        format!("vertex {index} does not exist"),
                        "number vertices from 0",
                    )
                })?;
                if !corner.is_finite() {
                    return Err(Error::new(
                        ErrorKind::Geometry,
                        format!("{name}, triangle {number}"),
                        format!("vertex {index} is not finite"),
                        "correct the coordinates",
                    ));
                }
            }
            welder.triangle(corners);
        }
        let mut part = Self::build(welder.finish(None, Vec::new()), Unit::Metre, options, name)?;
        part.name = name.to_string();
        Ok(part)
    }

    fn build(mut soup: weld::Soup, unit: Unit, options: &ReadOptions, place: &str) -> Result<Self> {
        check_extent(&soup, unit, place)?;
        order::sort(&mut soup);
        let mut repaired = repair::repair(soup, unit.metres(), place)?;
        if let Some(fit) = options.fit {
            fitted::check(fit, repaired.diagonal)?;
        }
        let (faces, curved) = faces::faces(&mut repaired, options.faceted, options.fit);
        let unit_mass = repaired.mass();
        Ok(Self {
            name: String::new(),
            file: PathBuf::new(),
            unit_m: unit.metres(),
            unit_source: UnitSource::Given,
            mesh: repaired.mesh,
            health: repaired.health,
            faces,
            curved,
            unit_mass,
        })
    }

    /// Volume, mass, centre of mass and inertia at a uniform `density` [kg/m^3], by exact integrals
    /// over the polyhedron.
    ///
    /// For a surface that is not watertight they are an estimate only ([`Health::watertight`]).
    pub fn mass_properties(&self, density: f64) -> MassProperties {
        let unit = &self.unit_mass;
        MassProperties { mass: unit.mass * density, inertia: unit.inertia * density, ..*unit }
    }

    /// The curved face that a plane is a facet of as well: so few make its turn that either may be meant.
    pub(crate) fn round_of(&self, plane: &PlanarFace) -> Option<&CurvedFace> {
        let first = plane.triangles.first()?;
        let mut doubtful = self.curved.iter().filter(|face| face.is_doubtful());
        doubtful.find(|face| face.triangles.binary_search(first).is_ok())
    }

    /// The curved face of this number.
    pub fn curved_face(&self, id: u32) -> Option<&CurvedFace> {
        self.curved.get((id as usize).checked_sub(self.faces.len())?)
    }

    /// Area of the planar or curved face of this number [m^2].
    pub fn face_area(&self, id: u32) -> Option<f64> {
        let planar = self.faces.get(id as usize).map(|face| face.area);
        planar.or_else(|| Some(self.curved_face(id)?.area))
    }

    /// Numbers of the curved faces in groups that share an axis, each sorted, in the order of their
    /// first faces: the bodies of revolution that jaws may turn unnoticed. A face alone is a group
    /// of one.
    pub fn coaxial_faces(&self) -> Vec<Vec<u32>> {
        curves::coaxial_groups(&self.curved)
    }

    /// Puts the centre of mass elsewhere than a uniform density does \[m, part frame\]: that of an
    /// assembly.
    pub fn set_centre_of_mass(&mut self, centre: DVec3) {
        self.unit_mass.centre_of_mass = centre;
    }

    /// All reachable antiparallel face pairs that the jaws can close on, with widths in
    /// `min_width..=max_width` \[m\], by falling overlap area. `face_i < face_ii`.
    pub fn pairs(&self, min_width: f64, max_width: f64) -> Vec<FacePair> {
        pairs::pairs(
            &self.faces,
            PairKind::External,
            min_width,
            max_width,
            pairs::area_floor(&self.mesh),
        )
    }

    /// As [`Part::pairs`], for jaws that open against two faces of a slot or bore.
    pub fn internal_pairs(&self, min_width: f64, max_width: f64) -> Vec<FacePair> {
        pairs::pairs(
            &self.faces,
            PairKind::Internal,
            min_width,
            max_width,
            pairs::area_floor(&self.mesh),
        )
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An axis-parallel box: corners and outward triangles.
    pub(crate) fn cuboid(low: DVec3, high: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let corner = |i: u32| {
            DVec3::new(
                [low.x, high.x][(i & 1) as usize],
                [low.y, high.y][(i >> 1 & 1) as usize],
                [low.z, high.z][(i >> 2) as usize],
            )
        };
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        ((0..8).map(corner).collect(), triangles)
    }

    #[test]
    fn a_box_has_six_faces_and_three_pairs() {
        let (vertices, triangles) = cuboid(DVec3::ZERO, DVec3::new(0.02, 0.03, 0.05));
        let part = Part::from_triangles("box", &vertices, &triangles).unwrap();
        assert!(part.health.watertight, "{:?}", part.health.lines());
        assert_eq!(part.faces.len(), 6);
        for face in &part.faces {
            assert_eq!(
                (face.polygons.len(), face.polygons[0].outer.len(), face.polygons[0].holes.len()),
                (1, 4, 0)
            );
            assert!((face.normal.dot(face.centroid) - face.offset).abs() < 1e-15);
            assert!(
                face.normal.dot(face.centroid - DVec3::new(0.01, 0.015, 0.025)) > 0.0,
                "outward"
            );
        }
        let pairs = part.pairs(0.0, 0.04);
        assert_eq!(pairs.len(), 2, "{pairs:?}");
        assert!(
            (pairs[0].width - 0.02).abs() < 1e-15 && (pairs[0].overlap_area - 1.5e-3).abs() < 1e-12,
            "{:?}",
            pairs[0]
        );
        assert_eq!(part.pairs(0.0, 1.0).len(), 3);
        assert!(part.internal_pairs(0.0, 1.0).is_empty());
    }
}
