//! A result to show, made from a shipped part with the real mechanics but without interference
//! checks: a fixture, not a plan.

#![allow(dead_code, reason = "each suite uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a failing fixture should stop the test")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine2, DMat3, DVec2, DVec3};
use gripfast::geometry::{overlay, polygon};
use gripfast::gripper::Gripper;
use gripfast::load::{LoadSet, wrench_in_grip};
use gripfast::mechanics::{Options, Pads, inverse, solve_pads, twist_out};
use gripfast::model::{Contact, Frame, Grip, Patch, Status};
use gripfast::part::{FacePair, Mesh, Part, ReadOptions};
use gripfast::request::Request;
use gripfast::results::{
    GripSet, LoadScore, PartSummary, Provenance, RankedGrip, Resolved, Summary,
};
use gripfast::units::Force;

/// Gripping force of the fixture [N].
const FORCE: f64 = 80.0;

pub(crate) fn data(path: &str) -> PathBuf {
    crate::support::root().join("data").join(path)
}

pub(crate) fn part(path: &Path) -> Part {
    Part::read(path, &ReadOptions::default()).unwrap()
}

/// Ranked grips of `part` on a coarse grid of places and `angles` approach directions, at most
/// `limit` of them.
pub(crate) fn plan(
    part: &Part,
    gripper: &str,
    loads: &str,
    mass: f64,
    (places, angles): (u32, u32),
    limit: usize,
) -> GripSet {
    let gripper = gripfast::gripper::find(gripper).unwrap();
    let unit = part.mass_properties(1.0);
    let mass = part.mass_properties(mass / unit.mass);
    let cases = LoadSet::parse("--loads", loads).unwrap().cases(&mass).unwrap();
    let pairs = part.pairs(gripper.stroke[0], gripper.stroke[1]);
    let mut summary = Summary { pairs: pairs.len() as u64, ..Summary::default() };
    let mut grips = Vec::new();
    for (pair, place, angle) in pairs.iter().flat_map(|pair| {
        (0..places * places)
            .flat_map(move |place| (0..angles).map(move |angle| (pair, place, angle)))
    }) {
        summary.candidates += 1;
        let turn = f64::from(angle) / f64::from(angles) * std::f64::consts::TAU;
        let Some(mut grip) =
            candidate(part, &gripper, pair, (place % places, place / places, places), turn)
        else {
            *summary.rejections.entry("contact_too_small".into()).or_default() += 1;
            continue;
        };
        let towards_palm = grip.part_from_grip.rotation.x_axis * -0.05 + grip.part_from_grip.origin;
        let (low, high) = part.mesh.bounding_box();
        if towards_palm.cmpge(low).all() && towards_palm.cmple(high).all() {
            *summary.rejections.entry("palm_inside_bounding_box".into()).or_default() += 1;
            continue;
        }
        grip.id = grips.len() as u64;
        grips.push(score(grip, &gripper, &cases, mass.centre_of_mass));
    }
    grips.sort_by(|a, b| {
        let key = |grip: &RankedGrip| grip.worst.mu_s.unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b)).then(a.grip.id.cmp(&b.grip.id))
    });
    grips.truncate(limit);
    for (rank, grip) in grips.iter_mut().enumerate() {
        grip.rank = rank as u64 + 1;
    }
    summary.ranked = grips.len() as u64;
    let (bbox_min, bbox_max) = part.mesh.bounding_box();
    let mut set = GripSet::new(
        provenance(part, loads, gripper.pad_friction),
        PartSummary {
            file: part.file.display().to_string(),
            unit_m: part.unit_m,
            triangles: part.mesh.triangles.len(),
            bbox_min,
            bbox_max,
            mass,
            symmetry: part.symmetry(),
        },
        serde_json::to_value(&gripper).unwrap(),
        cases,
    );
    set.summary = summary;
    set.grips = grips;
    set
}

fn provenance(part: &Part, loads: &str, friction: Option<f64>) -> Provenance {
    let mut request = Request::new(&part.file, "generic");
    request.loads = vec![loads.to_owned()];
    let mut resolved = Resolved::default();
    resolved.force = Force(FORCE);
    resolved.pad_friction = friction;
    let mut provenance = Provenance::new(request, resolved);
    provenance.command = ["test", "fixture", "of", "the", "report"].map(String::from).to_vec();
    provenance
}

/// The grip with its pads about a place of the grid over face I, when both pads touch enough.
fn candidate(
    part: &Part,
    gripper: &Gripper,
    pair: &FacePair,
    (column, row, places): (u32, u32, u32),
    angle: f64,
) -> Option<Grip> {
    let (face_i, face_ii) = (&part.faces[pair.face_i as usize], &part.faces[pair.face_ii as usize]);
    let bounds = polygon::bounds(&face_i.polygons);
    let step = |k: u32| (f64::from(k) + 0.5) / f64::from(places);
    let at = bounds.centre() + (DVec2::new(step(column), step(row)) - 0.5) * bounds.size();
    let on_face = face_i.part_from_face.point(at.extend(0.0));
    let x3 = face_i.normal;
    let x1 = face_i.part_from_face.rotation * DVec3::new(angle.cos(), angle.sin(), 0.0);
    let part_from_grip = Frame {
        rotation: DMat3::from_cols(x1, x3.cross(x1), x3),
        origin: on_face - x3 * (pair.width / 2.0),
    };
    let seen = |face: &gripfast::part::PlanarFace| -> Patch {
        let grip_from_face = part_from_grip.inverse().compose(&face.part_from_face);
        let column = |axis: DVec3| axis.truncate();
        let map = DAffine2::from_cols(
            column(grip_from_face.rotation.x_axis),
            column(grip_from_face.rotation.y_axis),
            grip_from_face.origin.truncate(),
        );
        let mut polygons: Vec<_> =
            face.polygons.iter().map(|outline| polygon::transform(outline, &map)).collect();
        polygons.iter_mut().for_each(polygon::normalise);
        overlay::intersect_convex(&gripper.pad, &polygons)
    };
    let contact = Contact { face_i: seen(face_i), face_ii: seen(face_ii) };
    let pad = polygon::ring_area(&gripper.pad).abs();
    let enough = |patch: &Patch| polygon::patch_area(patch) > 0.15 * pad;
    (enough(&contact.face_i) && enough(&contact.face_ii)).then(|| Grip {
        id: 0,
        part_from_grip,
        width: pair.width,
        face_i: pair.face_i,
        face_ii: pair.face_ii,
        angle,
        contact: Arc::new(contact),
        surfaces: None,
        inside: false,
        flip_of: None,
    })
}

fn score(
    grip: Grip,
    gripper: &Gripper,
    cases: &[gripfast::results::LoadCase],
    centre_of_mass: DVec3,
) -> RankedGrip {
    let pads = Pads::new(&grip.contact).unwrap();
    let options = Options::default();
    let wrench =
        |load: usize| wrench_in_grip(&cases[load].wrench, centre_of_mass, &grip.part_from_grip);
    let scores: Vec<_> = (0..cases.len())
        .map(|load| solve_pads(&pads, grip.distance(), FORCE, &wrench(load), &options))
        .collect();
    let key = |load: &usize| scores[*load].mu_s.unwrap_or(f64::INFINITY);
    let load = (0..cases.len()).max_by(|a, b| key(a).total_cmp(&key(b))).unwrap();
    let worst = scores[load];
    let levers = twist_out::TwistOut::new(&grip.contact);
    let lever = levers.least_lever().map_or(0.0, |lever| lever.width);
    let area = |patch: &Patch| polygon::patch_area(patch);
    let share = (worst.contact_area_i / area(&grip.contact.face_i))
        .min(worst.contact_area_ii / area(&grip.contact.face_ii));
    let friction = gripper.pad_friction;
    let mut ranked = RankedGrip::new(
        grip.clone(),
        LoadScore {
            load: load as u32,
            wrench: wrench(load),
            status: worst.status,
            mu_s: worst.mu_s,
            slip: worst.slip,
            pressure: worst.pressure,
            bounds: worst.bounds.filter(|bounds| bounds.upper.is_finite()),
            residual: worst.residual,
        },
    );
    let score = worst.mu_s.filter(|mu| *mu > 0.0).map(f64::recip);
    let alpha = twist_out::alpha(grip.width, lever, 0.0, 0.0);
    let delta_d = twist_out::delta_d(grip.width, lever);
    let contact_share = if worst.status == Status::TwistedOut { 0.0 } else { share.min(1.0) };
    let twist_margin = levers.margin(FORCE, &wrench(load));
    let safety =
        worst.mu_s.zip(friction).filter(|(mu, _)| *mu > 0.0).map(|(mu, friction)| friction / mu);
    let force_needed = friction.and_then(|friction| {
        inverse::force_needed(&pads, grip.distance(), &wrench(load), friction, &options)
    });
    let load_multiple = friction.map(|friction| {
        inverse::load_multiple(&pads, grip.distance(), FORCE, &wrench(load), friction, &options)
    });
    let mu_by_load =
        if cases.len() > 1 { scores.iter().map(|score| score.mu_s).collect() } else { Vec::new() };
    ranked.score = score;
    ranked.alpha = alpha;
    ranked.delta_d = delta_d;
    ranked.contact_share = contact_share;
    ranked.twist_margin = twist_margin;
    ranked.safety = safety;
    ranked.force_needed = force_needed;
    ranked.load_multiple = load_multiple;
    ranked.mu_by_load = mu_by_load;
    ranked
}

/// The same set repeated to `n` grips with new ids and ranks: only its size means anything.
pub(crate) fn repeated(set: &GripSet, n: usize) -> GripSet {
    let mut large = set.clone();
    large.grips = (0..n)
        .map(|i| {
            let mut grip = set.grips[i * set.grips.len() / n].clone();
            grip.grip.id = i as u64;
            grip.rank = i as u64 + 1;
            grip
        })
        .collect();
    large.summary.ranked = n as u64;
    large
}

/// The mesh with each triangle cut into `4^times`.
pub(crate) fn refined(mesh: &Mesh, times: u32) -> Mesh {
    let mut mesh = mesh.clone();
    for _ in 0..times {
        let mut middles = std::collections::HashMap::new();
        let (vertices, triangles) = (&mut mesh.vertices, std::mem::take(&mut mesh.triangles));
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i as usize] + vertices[j as usize]) / 2.0);
                    vertices.len() as u32 - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            mesh.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
    }
    mesh
}

/// A set of `n` grips under 500 loads whose table of loads is made up: only its size means
/// anything.
pub(crate) fn large(set: &GripSet, n: usize) -> GripSet {
    let mut large = repeated(set, n);
    large.loads = LoadSet::parse("--loads", "ball:500").unwrap().cases(&large.part.mass).unwrap();
    for grip in &mut large.grips {
        let mu = grip.worst.mu_s.unwrap_or(1.0);
        let axis = grip.grip.part_from_grip.rotation.y_axis;
        grip.mu_by_load = large
            .loads
            .iter()
            .map(|load| Some(mu * (0.55 + 0.45 * load.wrench.force.dot(axis))))
            .collect();
        grip.worst.load = (grip.grip.id % 500) as u32;
    }
    large
}
