//! Planar faces with their boundaries.

use glam::{DMat3, DVec2, DVec3};

use super::curves::{self, Curves};
use super::facets::Facets;
use super::fitted::{self, Tolerance};
use super::given::{GivenFace, GivenFaces, Stated};
use super::noise::{self, Noise};
use super::order;
use super::orient::Role;
use super::regions::{self, Flatness, Regions};
use super::repair::Repaired;
use super::topology::NONE;
use super::{CurvedFace, FaceSource, PlanarFace, Residual, boundary};
use crate::geometry::polygon::{Moments, patch_moments};
use crate::model::Frame;

/// Distance of a corner from its face's plane, as a share of the part's diagonal: 1 um on 100 mm;
/// the second value is for meshes that prove rougher.
const DISTANCE: [f64; 2] = [1e-5, 3e-5];
/// Uncertainty of a corner as a share of the diagonal, besides that of 32-bit floats; likewise.
const JITTER: [f64; 2] = [1e-7, 1e-5];
/// Uncertainty of a vertex of a curved surface as a share of the diagonal: rounding in the file.
const FLOOR: f64 = 5e-7;
/// Distance from a plane, in steps of the coordinates' rounding, that keeps planes from falling apart, and the
/// uncertainty of a corner where they do: it is moved by up to 0.87 of a step.
const SAFE: f64 = 2.0;
const ROUNDED: f64 = 1.4;
/// Width (twice area over half perimeter) below which a face is no place for a pad, as a share of
/// the diagonal.
const NARROWEST: f64 = 5e-4;

/// A planar face before its outline is known.
struct Flat {
    triangles: Vec<u32>,
    /// Whether it may be the flattest spot of a smooth surface.
    is_spot: bool,
    stated: Option<StatedFlat>,
}

/// What the file states of a plane, or a fit gave.
struct StatedFlat {
    /// A point of it \[m\], and its normal out of the material.
    plane: (DVec3, DVec3),
    source: FaceSource,
    fit: Option<Residual>,
}

impl StatedFlat {
    fn of(face: &GivenFace) -> Option<Self> {
        let Stated::Plane { origin, normal } = face.surface else { return None };
        Some(Self { plane: (origin, normal), source: face.source(), fit: face.fit })
    }
}

/// All planar faces of the part by falling area, and the curved ones: those that the file states
/// ([`GivenFaces`]), among the other triangles those that are recognised, and last what is left and
/// smooth (`free_faces`). There facets of curved
/// surfaces ([`Facets`]) and regions narrower than 5e-4 of the part's diagonal are left out. Says so
/// in the part's warnings when faces had to be found with wider tolerances, and when noise has broken
/// planes up. `faceted`: no facet is that of a curved surface. `fit`: distance \[m\] within which
/// faces are fitted to a noisy mesh; what is then on none of them is none.
pub(super) fn faces(
    part: &mut Repaired,
    faceted: bool,
    fit: Option<f64>,
) -> (Vec<PlanarFace>, Vec<CurvedFace>) {
    let (mut flats, mut curved) = recognised(part, faceted, fit);
    let number = order::restore(part);
    let flat = flats.iter_mut().map(|face| &mut face.triangles);
    for triangles in flat.chain(curved.iter_mut().map(|face| &mut face.triangles)) {
        triangles.iter_mut().for_each(|triangle| *triangle = number[*triangle as usize]);
        triangles.sort_unstable();
    }
    for face in &mut curved {
        face.shell = part.shell_of[face.triangles[0] as usize];
    }
    numbered(outline(part, flats), curved)
}

/// Which triangles make planar faces, and the curved faces by falling area.
fn recognised(
    part: &mut Repaired,
    faceted: bool,
    fit: Option<f64>,
) -> (Vec<Flat>, Vec<CurvedFace>) {
    let [fine, rough] = [0, 1].map(|level| {
        let factor = [1.0, 2.0][level];
        Flatness {
            distance: (DISTANCE[level] * part.diagonal).max(4.0 * factor * part.noise),
            uncertainty: (JITTER[level] * part.diagonal).max(factor * part.noise),
        }
    });
    let mut given = GivenFaces::new(part);
    let mut regions = regions::grow(part, &given, fine);
    let mut facets = Facets::new(part, &given, &regions);
    let step = curves::rounding(part, &regions, &facets.borders, &given);
    let is_rounded = SAFE * step > fine.distance;
    let is_rough = facets.are_rough(part, &regions, rough.distance, is_rounded);
    let exact = (FLOOR * part.diagonal).max(4.0 * part.noise).max(step);
    let mut floors = [if is_rough { rough.distance } else { exact }; 2];
    if is_rough && step > 0.0 {
        // The file says how rough it is where it rounds coordinates.
        floors[1] = floors[0].min(ROUNDED * step);
    }
    if is_rough {
        regions = regions::grow(part, &given, rough);
        facets = Facets::new(part, &given, &regions);
    } else if let Some(parted) =
        regions::without_crumbs(part, &given, &regions, &facets.is_facet, exact)
    {
        regions = parted;
        facets = Facets::new(part, &given, &regions);
    }
    if let Some(tolerance) = fit {
        let known = if faceted {
            Vec::new()
        } else {
            curves::curved_faces(part, &regions, &facets.borders, &given, floors).faces
        };
        let found = known.into_iter().filter(|face| face.source == FaceSource::Mesh).collect();
        fitted::fit(part, &mut given, found, Tolerance { distance: tolerance, faceted });
        return fitted_faces(part, &given, fine);
    }
    if is_rough {
        part.health.warnings.push(format!(
            "flat faces are rough: corners up to {:.2} um off a plane were taken for flat (a clean mesh of this size needs {:.2})",
            rough.distance * 1e6,
            fine.distance * 1e6
        ));
    }
    let taken = if is_rough { rough } else { fine }.distance;
    let mut is_smooth = vec![false; part.mesh.triangles.len()];
    if faceted {
        facets.is_facet.fill(false);
        let noise = noise::measure(part, &given, &regions, &is_smooth);
        part.health.warnings.extend(noise.map(|noise| noisy(noise, taken)));
        return (flats(part, &given, &regions, &facets, taken), Vec::new());
    }
    let Curves { faces: curved, is_curved, flats } =
        curves::curved_faces(part, &regions, &facets.borders, &given, floors);
    for (is_facet, is_curved) in facets.is_facet.iter_mut().zip(is_curved) {
        *is_facet |= is_curved;
    }
    for flat in flats {
        facets.is_facet[flat as usize] = false;
    }
    let mut planar = self::flats(part, &given, &regions, &facets, taken);
    let mut is_taken = vec![false; part.mesh.triangles.len()];
    let triangles = planar.iter().filter(|face| !face.is_spot).map(|face| &face.triangles);
    let triangles = triangles.chain(curved.iter().map(|face| &face.triangles)).flatten();
    triangles.for_each(|&triangle| is_taken[triangle as usize] = true);
    let free = curves::free_faces(part, &regions, &is_taken);
    let triangles = free.iter().flat_map(|face| &face.triangles);
    triangles.for_each(|&triangle| is_smooth[triangle as usize] = true);
    planar.retain(|face| !face.is_spot || !is_smooth[face.triangles[0] as usize]);
    let noise = noise::measure(part, &given, &regions, &is_smooth);
    part.health.warnings.extend(noise.map(|noise| noisy(noise, taken)));
    (planar, curved.into_iter().chain(free).collect())
}

/// What is said where noise has broken planes up; `taken`: distance within which corners count as
/// flat \[m\].
fn noisy(noise: Noise, taken: f64) -> String {
    format!(
        "flat faces are noisy: on {:.0} % of the surface corners lie {:.1} um (root mean square) off the planes that fit them, {:.1} times the {:.2} um \
         up to which they count as flat, so planes have fallen into single triangles and grips on them are missing or tilted; export the part \
         from its CAD model, or fit planes and round faces to corners within {} mm",
        noise.share * 100.0,
        noise.distance * 1e6,
        noise.distance / taken,
        taken * 1e6,
        noise.tolerance()
    )
}

/// Curved faces have the numbers after those of the planar ones.
fn numbered(
    planar: Vec<PlanarFace>,
    mut curved: Vec<CurvedFace>,
) -> (Vec<PlanarFace>, Vec<CurvedFace>) {
    for (face, id) in curved.iter_mut().zip(planar.len() as u32..) {
        face.id = id;
    }
    (planar, curved)
}

/// The faces of a noisy mesh: those that were fitted, or that the file states.
fn fitted_faces(
    part: &Repaired,
    given: &GivenFaces,
    flatness: Flatness,
) -> (Vec<Flat>, Vec<CurvedFace>) {
    let regions = regions::grow(part, given, flatness);
    let mut facets = Facets::new(part, given, &regions);
    for (index, is_facet) in facets.is_facet.iter_mut().enumerate() {
        *is_facet |= given.face(regions.triangles(index)[0]).is_none();
    }
    (flats(part, given, &regions, &facets, flatness.distance), curves::given_faces(part, given))
}

/// The planar faces among the regions. `within`: distance from a plane that corners may have \[m\].
fn flats(
    part: &Repaired,
    given: &GivenFaces,
    regions: &Regions,
    facets: &Facets,
    within: f64,
) -> Vec<Flat> {
    let mut flats = Vec::new();
    for (index, region) in regions.all.iter().enumerate() {
        let triangles = regions.triangles(index);
        let stated = given.face(triangles[0]).and_then(StatedFlat::of);
        let is_narrow =
            4.0 * region.area < NARROWEST * part.diagonal * facets.borders.perimeter[index];
        if facets.is_facet[index] || (is_narrow && stated.is_none()) {
            continue;
        }
        let is_spot = stated.is_none() && facets.is_spot(part, regions, index, within);
        flats.push(Flat { triangles: triangles.to_vec(), is_spot, stated });
    }
    flats
}

/// The planar faces with their boundaries, sorted and numbered.
fn outline(part: &Repaired, flats: Vec<Flat>) -> Vec<PlanarFace> {
    let tolerance = simplify_tolerance(part);
    let mut of = vec![NONE; part.mesh.triangles.len()];
    for (flat, number) in flats.iter().zip(0..) {
        flat.triangles.iter().for_each(|&triangle| of[triangle as usize] = number);
    }
    let mut faces: Vec<PlanarFace> = Vec::new();
    for (flat, number) in flats.into_iter().zip(0..) {
        let Flat { triangles, stated, .. } = flat;
        let (order, normal, centre) = match &stated {
            Some(StatedFlat { plane: (origin, normal), .. }) => {
                let centre = regions::middle(&part.mesh, &triangles, *origin, *normal);
                (triangles.clone(), *normal, centre)
            }
            None => match regions::gathered(part, &triangles, number, &mut of) {
                Some((order, plane, centre)) => (order, plane.normal, centre),
                None => continue,
            },
        };
        let mut frame = face_frame(normal, centre);
        let rings = |frame: &Frame| {
            boundary::polygons(
                &part.mesh,
                &part.edges.twin,
                &order,
                |triangle| of[triangle as usize] == number,
                frame,
                tolerance,
            )
        };
        let mut polygons = rings(&frame);
        let Moments { area, centroid, .. } = patch_moments(&polygons);
        if area <= 0.0 {
            continue;
        }
        frame.origin = frame.point(centroid.extend(0.0));
        let shift = |point: &mut DVec2| *point -= centroid;
        for polygon in &mut polygons {
            polygon.outer.iter_mut().for_each(shift);
            polygon.holes.iter_mut().flatten().for_each(shift);
        }
        let shell = part.shell_of[triangles[0] as usize];
        faces.push(PlanarFace {
            id: 0,
            normal,
            offset: normal.dot(frame.origin),
            area,
            centroid: frame.origin,
            part_from_face: frame,
            polygons,
            triangles,
            source: stated.as_ref().map_or(FaceSource::Mesh, |face| face.source),
            fit: stated.and_then(|face| face.fit),
            shell,
            reachable: part.shells[shell as usize].role == Role::Body,
        });
    }
    // Areas that agree to 1e-6 count as equal, so that rounding does not decide the order of a
    // part's equal faces.
    let key = |face: &PlanarFace| (face.area.log2() * 1e5).round() as i64;
    let step = (part.diagonal * 1e-6).max(f64::MIN_POSITIVE);
    let place = |face: &PlanarFace| {
        [face.centroid.x, face.centroid.y, face.centroid.z].map(|x| (x / step).round() as i64)
    };
    faces.sort_by_cached_key(|face| (std::cmp::Reverse(key(face)), place(face)));
    for (face, id) in faces.iter_mut().zip(0..) {
        face.id = id;
    }
    faces
}

/// Collinear points are left out within this distance: the rounding of the coordinates, but never
/// what a pad could feel.
fn simplify_tolerance(part: &Repaired) -> f64 {
    (4.0 * part.noise).max(1e-8 * part.diagonal)
}

/// Frame of a face: `z` is the normal, `x` the part axis most nearly in the plane (the first of
/// equals) projected into it.
fn face_frame(normal: DVec3, origin: DVec3) -> Frame {
    let flat = normal.abs();
    // A margin lets rounding not choose between axes that lie equally in the plane.
    let axis = if flat.x <= flat.y.min(flat.z) + 1e-6 {
        DVec3::X
    } else if flat.y <= flat.z + 1e-6 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let x = (axis - normal * normal.dot(axis)).normalize();
    Frame { rotation: DMat3::from_cols(x, normal.cross(x), normal), origin }
}
