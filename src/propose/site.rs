//! From antiparallel face pairs to sites: a stretch of two facing planes where pads can be put,
//! with its own frame, positions and approach angles.
//!
//! One pad may touch several faces that lie in one plane, so pairs whose planes coincide are joined
//! first, and split again into stretches too far apart for one pad.

mod beside;
mod crest;
mod freeform;
mod net;
mod opposite;
mod places;
mod planes;
mod relief;
mod round;
mod rows;
mod shapes;
mod skyline;
mod special;
mod survey;
mod tapers;
mod tori;

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use places::{angles, covered, main_direction, positions, straight_edges};
use planes::{Planes, heights, rise};
pub(super) use relief::Relief;
use round::Budget;
pub(super) use round::{MOST_CANDIDATES, Round};
pub(super) use rows::steepest;
use shapes::{project, same_shape, stretches, to_site};
use special::{Landmarks, Posture};
use survey::Surveys;

use super::environment::Environment;
use super::options::ProposeOptions;
use super::patch::PatchIndex;
use crate::clash::{Motion, Sweep, sweeps};
use crate::error::{Error, Result};
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::geometry::{contains, even_odd, overlay, ring_area};
use crate::gripper::{Gripper, Jaws};
use crate::model::{Frame, Patch, Polygon, Ring};
use crate::part::{FacePair, PairKind, Part};

/// Planes whose directions differ by less count as one direction, which saves a tree \[rad\]: 0.1 um
/// on 100 mm.
const SAME_DIRECTION: f64 = 1e-6;
/// Faces within this distance of one plane, as a share of the part's diagonal, lie in one plane:
/// twice the tolerance of the planes themselves.
const SAME_PLANE: f64 = 2e-5;
/// Share of its bounds that an overlap fills from which on a pad middle over middle covers the most of it.
const FULL: f64 = 0.5;
/// At most this many positions on one site; more is a slip of the unit.
const MOST_POSITIONS: f64 = 2e7;

/// Shapes of what is pressed on a curved face beyond which no special places are looked for: each
/// costs as many cuts of all of them.
const MOST_SHAPES: usize = 16;

/// Which places of a site.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) enum Places {
    /// Those tried at every angle.
    #[default]
    Grid,
    /// Those of one angle.
    Special,
}

/// A stretch of two facing planes.
#[derive(Debug)]
pub(super) struct Site {
    pub(super) kind: PairKind,
    /// Site frame in the part frame: `z` the closing axis (outward normal of face I), the origin
    /// midway between the planes.
    pub(super) part_from_site: Frame,
    /// Distance of the planes \[m\].
    pub(super) width: f64,
    /// Index into the list of directions.
    pub(super) direction: usize,
    /// Origin in the axes of the direction.
    pub(super) origin: DVec3,
    /// Angle of the site's `x` in the axes of the direction \[rad\].
    pub(super) turn: f64,
    /// Gripped faces on side I and II.
    pub(super) faces: [Vec<u32>; 2],
    /// How far the faces rise above the pads' planes \[m\]: their tilt and roughness.
    pub(super) rise: f64,
    /// Roughness of a plane \[m\].
    pub(super) flush: f64,
    /// Largest part of the two sides' overlap that a pad may cover: all of it, or what one covers as far as
    /// the places tell [m^2].
    pub(super) most: f64,
    /// Faces that pads may touch: the gripped ones and others in the same planes.
    pub(super) touched: [Vec<u32>; 2],
    /// Size of the overlap along the site's `x` and `y` \[m\].
    pub(super) extent: DVec2,
    /// Grip origins tried at every angle, in the site's `(x, y)` \[m\]: the grid and some points.
    pub(super) positions: Vec<DVec2>,
    /// Grip origins tried at one angle besides: see [`special`].
    pub(super) special: Vec<Vec<DVec2>>,
    /// Approach angles from the site's `x` \[rad\].
    pub(super) angles: Vec<f64>,
    /// Bounds of all positions.
    pub(super) bounds: Bounds2,
    /// What the pads touch, where it is not plane.
    pub(super) relief: Option<Relief>,
    /// Whether its width holds along its own places and at its own angles only.
    pub(super) row: bool,
}

/// Axes of a closing direction: rows of the matrix are the axes in the part frame, the third is the
/// direction.
pub(super) fn axes(direction: DVec3) -> DMat3 {
    let side = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let x = (side - direction * direction.dot(side)).normalize();
    DMat3::from_cols(x, direction.cross(x), direction).transpose()
}

/// Sites and their directions.
#[derive(Default)]
pub(super) struct Sites {
    /// In a stable order: those on planes by falling overlap of their largest pair, those on curved
    /// and drafted faces, those on faces of free form.
    pub(super) sites: Vec<Site>,
    pub(super) directions: Vec<DVec3>,
    /// Number of those on planes.
    pub(super) plane: usize,
    /// Number of those before the ones on faces of free form, which are the last.
    pub(super) known: usize,
    /// What came of the pairs of curved and drafted faces.
    pub(super) round: Round,
}

/// The sites of a part. `chosen`: the faces that may be touched; `None`: all.
pub(super) fn sites(
    part: &Part,
    gripper: &Gripper,
    options: &ProposeOptions,
    environment: &Environment,
    pairs: &[FacePair],
    chosen: Option<&[bool]>,
) -> Result<Sites> {
    let (low, high) = part.mesh.bounding_box();
    let size = (high - low).length();
    let planes = Planes::new(&part.faces, SAME_PLANE * size);
    let mut groups: Vec<(PairKind, Vec<&FacePair>)> = Vec::new();
    let mut group_of = rustc_hash::FxHashMap::default();
    for pair in pairs {
        let (a, b) = (planes.of[pair.face_i as usize], planes.of[pair.face_ii as usize]);
        let group = *group_of.entry((a.min(b), a.max(b), pair.kind)).or_insert_with(|| {
            groups.push((pair.kind, Vec::new()));
            groups.len() - 1
        });
        groups[group].1.push(pair);
    }
    let centre_of_mass = part.mass_properties(1.0).centre_of_mass;
    let mut finder = Finder {
        part,
        gripper,
        options,
        environment,
        size,
        reach: gripper.pad_reach(),
        centre_of_mass,
        planes: &planes,
        chosen,
        smallest: tapers::smallest(part, gripper, options),
        directions: Vec::new(),
        budget: Budget::NONE,
    };
    let mut sites = Vec::new();
    let mut leaning = Vec::new();
    let mut surveys = Surveys::default();
    for (kind, pairs) in &groups {
        let rows =
            if options.curved == Some(false) { None } else { finder.lean(pairs, &mut surveys) };
        match rows {
            Some(rows) => leaning.extend(rows),
            None => sites.extend(finder.sites(*kind, pairs, &mut surveys)?),
        }
    }
    let plane = sites.len();
    let mut round = Round::default();
    let named = |faces: &Vec<u32>| faces.iter().any(|&face| face as usize >= part.faces.len());
    let asked = options.faces.as_ref().is_some_and(named) || groups.is_empty();
    sites.extend(leaning);
    let budget = match options.curved {
        Some(true) => Some(Budget::NONE),
        Some(false) => None,
        None if asked => Some(Budget::NONE),
        None => Some(Budget::FEW),
    };
    let mut known = sites.len();
    if let Some(budget) = budget {
        let curved;
        finder.budget = budget;
        (curved, round) = finder.round()?;
        sites.extend(curved);
        finder.budget = budget;
        sites.extend(finder.leaning(&mut round)?);
        known = sites.len();
        finder.budget = budget;
        sites.extend(finder.free(&mut round)?);
    }
    Ok(Sites { sites, directions: finder.directions, plane, known, round })
}

/// What a site is made of, in the axes of its direction.
struct Base<'a> {
    kind: PairKind,
    direction: usize,
    sides: &'a [Vec<u32>; 2],
    /// Where both sides are touched.
    overlap: Patch,
    /// Angle of the site's `x`.
    turn: f64,
    /// Its origin.
    middle: DVec2,
    /// Heights of the pads' planes on side I and II.
    heights: [f64; 2],
    /// See [`Site::rise`].
    rise: f64,
}

/// Main direction of a stretch, unless it is known, and the middle of its bounds along it.
fn lie(overlap: &[Polygon], known: Option<f64>) -> (f64, DVec2) {
    let turn = known.unwrap_or_else(|| main_direction(overlap));
    let points: Vec<DVec2> = overlap
        .iter()
        .flat_map(|polygon| &polygon.outer)
        .map(|&point| DVec2::from_angle(-turn).rotate(point))
        .collect();
    (turn, DVec2::from_angle(turn).rotate(Bounds2::of(&points).centre()))
}

/// What all sites are found from.
struct Finder<'a> {
    part: &'a Part,
    gripper: &'a Gripper,
    options: &'a ProposeOptions,
    environment: &'a Environment,
    /// Diagonal of the part's bounding box \[m\].
    size: f64,
    /// How far the pads reach from the grip axis \[m\].
    reach: f64,
    /// Of the part \[m\].
    centre_of_mass: DVec3,
    planes: &'a Planes,
    chosen: Option<&'a [bool]>,
    /// See [`tapers::smallest`] [m^2].
    smallest: f64,
    /// Closing directions so far.
    directions: Vec<DVec3>,
    /// What may still be tried on curved faces.
    budget: Budget,
}

impl<'a> Finder<'a> {
    /// The sites of pairs whose planes coincide.
    fn sites(
        &mut self,
        kind: PairKind,
        pairs: &[&FacePair],
        surveys: &mut Surveys<'a>,
    ) -> Result<Vec<Site>> {
        let (part, size, reach) = (self.part, self.size, self.reach);
        let (direction, sides) = self.sides(pairs);
        let face = |id: u32| &part.faces[id as usize];
        let axis = self.directions[direction];
        let axes_from_part = axes(axis);
        let patches =
            [0, 1].map(|side| project(sides[side].iter().map(|&id| face(id)), &axes_from_part));
        let overlap = overlay::intersect(&patches[0], &patches[1]);
        let mut found = Vec::new();
        for overlap in stretches(overlap, 2.0 * reach) {
            let (turn, middle) = lie(&overlap, None);
            let heights = heights(face(sides[0][0]), face(sides[1][0]), &axes_from_part, middle);
            let rise =
                rise(&sides, part, &axes_from_part, axis, &overlap, heights) + SAME_PLANE * size;
            let sides = &sides;
            let bounds = polygon::bounds(&overlap);
            let base = Base { kind, direction, sides, overlap, turn, middle, heights, rise };
            let mut site = self.site(base, None)?;
            if let Some(survey) = surveys.of(self, direction)
                && let Some((relief, overlap)) = self.beside(&site, (heights, bounds), survey)
            {
                let (turn, middle) = lie(&overlap, Some(turn));
                let base = Base { kind, direction, sides, overlap, turn, middle, heights, rise };
                site = self.site(base, Some(relief))?;
            }
            site.touched = self.touched(&site, reach);
            found.push(site);
        }
        Ok(found)
    }

    /// A site with its places; `relief` in the axes of the direction.
    fn site(&self, base: Base<'_>, relief: Option<Relief>) -> Result<Site> {
        let Base { kind, direction, sides, overlap, turn, middle, heights, rise } = base;
        let (gripper, options, size) = (self.gripper, self.options, self.size);
        let axes_from_part = axes(self.directions[direction]);
        let [one, two] = gripper.pad_sizes();
        let spacing = options.spacing(gripper);
        let mid_height = (heights[0] + heights[1]) / 2.0;
        let origin = middle.extend(mid_height);
        let cells = polygon::bounds(&overlap).size() / spacing;
        if cells.element_product() > MOST_POSITIONS {
            let problem = format!(
                "{spacing} m makes {:.0} positions on one face pair",
                cells.element_product()
            );
            return Err(Error::input("spacing", problem, "choose a larger step"));
        }
        let local: Patch = overlap.iter().map(|polygon| to_site(polygon, middle, turn)).collect();
        let relief = relief.map(|relief| relief.moved(middle, turn));
        let centre = axes_from_part * self.centre_of_mass;
        let centre_of_mass = DVec2::from_angle(-turn).rotate(centre.truncate() - middle);
        let (positions, grid) =
            positions(&local, spacing, one.max(two).max_element() / 2.0, centre_of_mass);
        let frame = Frame {
            rotation: axes_from_part.transpose() * DMat3::from_rotation_z(turn),
            origin: axes_from_part.transpose() * origin,
        };
        let mut edges = straight_edges(&local);
        let angles = match &relief {
            Some(relief) if relief.is_round() => {
                edges.retain(|edge| !relief.runs_along(edge));
                let cone = options.approach_cone.map(|cone| frame.rotation.transpose() * cone.axis);
                relief.angles(options, cone)
            }
            _ => angles(&edges, options, one.min(two).min_element()),
        };
        let is_round = relief.as_ref().is_some_and(Relief::is_round);
        let overlap = polygon::patch_area(&local);
        let is_full = overlap > FULL * grid.bounds.size().element_product();
        let most = if is_full {
            overlap
        } else {
            let pads = gripper.pads((heights[0] - heights[1]).abs());
            let covered = covered(&local, &pads, &positions, &angles);
            let pad = pads.iter().map(|pad| ring_area(pad)).fold(0.0, f64::max);
            // A pad on planes covers enough of most shapes.
            let is_enough = covered >= options.min_contact * pad.min(overlap);
            if is_enough && !is_round { overlap } else { covered }
        };
        let mut site = Site {
            kind,
            part_from_site: frame,
            width: (heights[0] - heights[1]).abs(),
            direction,
            origin,
            turn,
            faces: sides.clone(),
            touched: sides.clone(),
            rise,
            flush: SAME_PLANE * size,
            most,
            extent: grid.bounds.size(),
            bounds: Bounds2::of(&positions),
            positions,
            special: vec![Vec::new(); angles.len()],
            angles,
            relief,
            row: false,
        };
        let landmarks = Landmarks {
            overlap: &local,
            grid: &grid,
            positions: &site.positions,
            edges: &edges,
            points: [centre_of_mass, polygon::patch_moments(&local).centroid, grid.bounds.centre()],
        };
        // A thread's crest has no edges to go by.
        if site.relief.is_none() || local.len() <= MOST_SHAPES {
            site.special = self.special(&site, &landmarks);
        }
        site.bounds =
            special::bounds(&site.special).map_or(site.bounds, |bounds| bounds.union(site.bounds));
        Ok(site)
    }

    /// Index of the closing direction of pairs, and their faces by the side that they lie on.
    fn sides(&mut self, pairs: &[&FacePair]) -> (usize, [Vec<u32>; 2]) {
        let face = |id: u32| &self.part.faces[id as usize];
        let first = pairs[0];
        let mut axis = (face(first.face_i).normal - face(first.face_ii).normal).normalize();
        // Which of the two is face I is free: one sign per direction keeps the number of directions
        // down.
        if axis[axis.abs().max_position()] < 0.0 {
            axis = -axis;
        }
        let direction = self.direction(axis);
        let axis = self.directions[direction];
        // Sides by the sign of the normal: pairs of one group may list their faces in either order.
        let mut sides: [Vec<u32>; 2] = [Vec::new(), Vec::new()];
        for id in pairs.iter().flat_map(|pair| [pair.face_i, pair.face_ii]) {
            sides[usize::from(face(id).normal.dot(axis) < 0.0)].push(id);
        }
        for side in &mut sides {
            side.sort_unstable();
            side.dedup();
        }
        (direction, sides)
    }

    /// Index of a closing direction.
    fn direction(&mut self, axis: DVec3) -> usize {
        let known =
            |known: &DVec3| known.dot(axis) > 0.0 && known.cross(axis).length() < SAME_DIRECTION;
        self.directions.iter().position(known).unwrap_or_else(|| {
            self.directions.push(axis);
            self.directions.len() - 1
        })
    }

    /// The special places of a site at each angle from which it may be approached.
    fn special(&self, site: &Site, landmarks: &Landmarks<'_>) -> Vec<Vec<DVec2>> {
        let ways: &[Jaws] =
            if self.gripper.is_symmetric() { &[Jaws::Straight] } else { &Jaws::BOTH };
        let ways: Vec<(Vec<Ring>, Vec<Sweep>)> = ways
            .iter()
            .map(|&jaws| {
                let motion = site.motion(self.gripper, self.options, self.options.approach, jaws);
                let mut pads = site.pads(self.gripper, jaws).to_vec();
                pads.dedup();
                (pads, sweeps(self.gripper, &motion))
            })
            .collect();
        let mut room = special::Room::default();
        site.angles
            .iter()
            .map(|&angle| {
                let mut found = Vec::new();
                let frame = super::work::frame(site, DVec2::ZERO, angle);
                if self.environment.allows(super::work::approach(&frame)) {
                    for (pads, sweeps) in &ways {
                        let borders = self.environment.borders(
                            sweeps,
                            &site.part_from_site,
                            &frame,
                            site.flush,
                        );
                        let posture = Posture { angle, pads, sweeps, borders: &borders };
                        landmarks.places(&posture, &mut room, &mut found);
                    }
                }
                found
            })
            .collect()
    }
}

impl Site {
    /// Number of candidates, at each of the ways to put the jaws.
    pub(super) fn candidates(&self) -> usize {
        self.grid() + self.special.iter().map(Vec::len).sum::<usize>()
    }

    /// Whether it lies on round or leaning surface.
    pub(super) fn is_round(&self) -> bool {
        self.relief.as_ref().is_some_and(Relief::is_round)
    }

    /// What its pads touch where it lies on planes beside which they press other surface.
    pub(super) fn beside(&self) -> Option<&Relief> {
        self.relief.as_ref().filter(|relief| !relief.is_round())
    }

    /// Number of candidates of the grid.
    pub(super) fn grid(&self) -> usize {
        self.positions.len() * self.angles.len()
    }

    /// Places at an angle: those of the grid, or the special ones.
    pub(super) fn places(&self, kind: Places, angle: usize) -> &[DVec2] {
        match kind {
            Places::Grid => &self.positions,
            Places::Special => &self.special[angle],
        }
    }

    /// How far a place is from those that the site is made for \[m\], and an angle likewise \[rad\].
    pub(super) fn off_row(&self, place: DVec2, angle: f64) -> [f64; 2] {
        let turn = std::f64::consts::TAU;
        let apart = |known: &f64| {
            let apart = (angle - known).rem_euclid(turn);
            apart.min(turn - apart)
        };
        let turned = self.angles.iter().map(apart).fold(turn, f64::min);
        let off = place.distance(place.clamp(self.bounds.min, self.bounds.max));
        if self.row { [off, turned] } else { [0.0; 2] }
    }

    /// Distance of the pads in its grips \[m\].
    pub(super) fn gap(&self, gripper: &Gripper) -> f64 {
        gripper.gap_on(self.width, self.kind == PairKind::Internal)
    }

    /// The outlines that touch side I and II, in the grip frame before the half turn.
    pub(super) fn pads(&self, gripper: &Gripper, jaws: Jaws) -> [Ring; 2] {
        let mut pads = gripper.pads(self.gap(gripper));
        if self.kind == PairKind::Internal {
            pads.reverse();
        }
        if jaws == Jaws::Exchanged {
            pads.reverse();
            pads = pads.map(|pad| super::work::mirrored(&pad));
        }
        pads
    }

    /// How the jaws move on to the site's faces.
    pub(super) fn motion(
        &self,
        gripper: &Gripper,
        options: &ProposeOptions,
        approach: f64,
        jaws: Jaws,
    ) -> Motion {
        let [least, most] = gripper.stroke;
        let room = match self.kind {
            PairKind::External => most - self.width,
            PairKind::Internal => self.gap(gripper) - least,
        };
        Motion {
            kind: self.kind,
            width: self.width,
            opening: options.opening.min(room / 2.0).max(0.0),
            touch: self.rise,
            flush: self.flush,
            clearance: options.clearance,
            approach,
            jaws,
        }
    }

    /// The two gripped planes' faces, indexed in the site's `(x, y)` for pads that reach `reach`
    /// from their origin; only one when both are the same.
    pub(super) fn patches(
        &self,
        part: &Part,
        axes_from_part: &DMat3,
        reach: f64,
    ) -> Vec<PatchIndex> {
        let [side_i, side_ii] = [0, 1].map(|side| -> Patch {
            if let Some(relief) = &self.relief {
                // Facets beside each other are one area.
                return match &relief.pressed[side] {
                    facets if relief.is_round() && facets.len() > 1 => even_odd(
                        &facets.iter().flat_map(rings).map(<[DVec2]>::to_vec).collect::<Vec<_>>(),
                    ),
                    one => one.clone(),
                };
            }
            let faces = self.touched[side].iter().map(|&id| &part.faces[id as usize]);
            project(faces, axes_from_part)
                .iter()
                .map(|polygon| to_site(polygon, self.origin.truncate(), self.turn))
                .collect()
        });
        let same = same_shape(&side_i, &side_ii, 1e-9 * reach);
        let index =
            |patch: Patch| PatchIndex::new(patch, self.bounds.grown(1.01 * reach), reach / 4.0);
        if same { vec![index(side_i)] } else { vec![index(side_i), index(side_ii)] }
    }

    /// The face of a side that holds `point` of the site's plane, or the first; of curved ones the
    /// nearest.
    pub(super) fn face_at(&self, side: usize, part: &Part, point: DVec2) -> u32 {
        let faces = &self.faces[side];
        if faces.len() == 1 {
            return faces[0];
        }
        let point = self.part_from_site.point(point.extend(0.0));
        if self.is_round() {
            let plane = part.faces.len();
            let centre = |id: u32| match (id as usize).checked_sub(plane) {
                Some(curved) => part.curved[curved].centroid,
                None => part.faces[id as usize].centroid,
            };
            let near = |&&id: &&u32| centre(id).distance(point);
            let nearest = faces.iter().min_by(|a, b| near(a).total_cmp(&near(b)));
            return nearest.copied().unwrap_or(faces[0]);
        }
        let holds = |&&id: &&u32| {
            let face = &part.faces[id as usize];
            let local = face.part_from_face.point_inverse(point).truncate();
            face.polygons.iter().any(|polygon| contains(polygon, local))
        };
        *faces.iter().find(holds).unwrap_or(&faces[0])
    }
}

/// Which way round the gripper is put in a grip frame, given in the site frame.
pub(super) fn jaws(site_from_grip: &Frame) -> Jaws {
    if site_from_grip.rotation.z_axis.z < 0.0 { Jaws::Exchanged } else { Jaws::Straight }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed() {
        for direction in [DVec3::X, DVec3::Y, DVec3::NEG_Z, DVec3::new(0.6, 0.0, 0.8)] {
            let axes = axes(direction);
            assert!(
                (axes.determinant() - 1.0).abs() < 1e-12
                    && (axes * direction - DVec3::Z).length() < 1e-12
            );
        }
    }
}
