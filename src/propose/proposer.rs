//! The stream of proposals: sites once, then chunk after chunk of work items.

mod progress;
mod share;
mod tally;

use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use progress::Progress;
use share::Share;
pub use tally::Tally;

use super::environment::{Environment, Way};
use super::options::{ProposeOptions, Rejection};
use super::patch::PatchIndex;
use super::site::{self, Places, Site, Sites};
use super::stroke::Stroke;
use super::work;
use crate::clash::{Sweep, Topology, Tree, sweeps};
use crate::error::{Error, Result};
use crate::gripper::{Gripper, Jaw, Jaws};
use crate::model::{Contact, Grip, Polygon};
use crate::part::{FacePair, PairKind, Part, Shape};

/// Positions per work item: large enough to share what an angle determines, small enough to spread
/// over the threads. Fixed, because contacts are shared within an item: results must not depend on
/// the chunk size.
const ITEM: usize = 2048;
/// Corners of contact polygons that a chunk may hold, about (16 bytes each): where pads cover
/// finely tessellated outlines, chunks have fewer candidates.
const MOST_CORNERS: usize = 4_000_000;
/// Candidates of a chunk on free form, where a grip may take seconds under many loads: a run can be
/// resumed from a chunk's beginning.
const MOST_FREE: usize = 1024;

/// Some candidates' outcome, in order.
#[derive(Debug, Clone, Default)]
pub struct Chunk {
    /// Grips free of interference.
    pub grips: Vec<Grip>,
    /// Candidates looked at for them.
    pub candidates: u64,
}

/// Proposes grips chunk by chunk: an iterator of [`Chunk`].
pub struct Proposer<'a> {
    pub(super) part: &'a Part,
    pub(super) gripper: &'a Gripper,
    pub(super) options: ProposeOptions,
    pub(super) environment: Environment,
    pub(super) sites: Vec<Site>,
    /// Number of those on planes; the others come after them.
    pub(super) plane: usize,
    /// Number of those before the ones on faces of free form.
    known: usize,
    pub(super) directions: Vec<DVec3>,
    shape: Arc<Topology>,
    /// Contact of a pad that lies wholly on both faces.
    pub(super) whole: Arc<Contact>,
    pub(super) symmetric: bool,
    /// How far the pads reach from the grip axis \[m\].
    pub(super) reach: f64,
    tally: Tally,
    /// The faces that come nearest to the stroke of those outside.
    pub(super) outside: Option<FacePair>,
    next: Cursor,
    /// Which candidates; absent: all.
    share: Option<Share>,
    /// Corners per candidate in the last chunk.
    corners: f64,
    pub(super) tree: Option<(usize, Arc<Tree>)>,
}

/// Where the next chunk starts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Cursor {
    site: usize,
    places: Places,
    angle: usize,
    position: usize,
    /// Number of the next candidate of a grid: these are counted first, over all sites.
    id: u64,
    /// Number of the next special candidate.
    special_id: u64,
    /// The same of the sites on curved faces, which are counted after all others.
    round_id: u64,
    round_special_id: u64,
    /// The same of the sites on faces of free form, the last.
    free_id: u64,
    free_special_id: u64,
}

/// Positions `positions` of a site at one angle; the first has the number `id`.
#[derive(Debug, Clone)]
pub(super) struct Item {
    pub(super) site: usize,
    pub(super) places: Places,
    pub(super) angle: usize,
    pub(super) positions: std::ops::Range<usize>,
    pub(super) id: u64,
}

/// What the items of one site share.
pub(super) struct Prepared<'a> {
    pub(super) site: &'a Site,
    /// Faces of side I and II; one entry where both are the same in the site's plane, as in every
    /// prism.
    pub(super) patches: Vec<PatchIndex>,
    /// Against the part, for each of [`Proposer::orientations`].
    pub(super) sweeps: Vec<Vec<Sweep>>,
    /// Against ground and keep-out boxes.
    pub(super) outer_sweeps: Vec<Vec<Sweep>>,
    /// Through the scene, where there is one.
    pub(super) way: Option<Way>,
}

impl<'a> Proposer<'a> {
    /// Finds the sites of `part` for `gripper`.
    ///
    /// # Errors
    /// When an option is out of its range or names a face that is not there, the grid is too fine,
    /// the gripper has no pad with area, or inside grips are asked of a gripper without outer pads.
    pub fn new(part: &'a Part, gripper: &'a Gripper, options: &ProposeOptions) -> Result<Self> {
        let mut proposer = Self::within_budget(part, gripper, options)?;
        if !proposer.tally.curved_left_out || proposer.is_any_free() {
            return Ok(proposer);
        }
        // Beside planes that give nothing there is nothing to be slow for.
        let every = ProposeOptions { curved: Some(true), ..options.clone() };
        Self::within_budget(part, gripper, &every)
    }

    /// Whether there are sites whose width holds along their own places only.
    pub(crate) fn has_rows(&self) -> bool {
        self.sites.iter().any(|site| site.row)
    }

    /// Whether faces can be gripped in more closing directions than are tried.
    pub(crate) fn has_round(&self) -> bool {
        self.part.curved.iter().any(|face| face.reachable && face.shape != Shape::Freeform)
    }

    /// Whether any candidate is free of interference; looks at them until one is.
    fn is_any_free(&mut self) -> bool {
        let (next, tally) = (self.next, self.tally.clone());
        let found = self.any(|chunk| !chunk.grips.is_empty());
        (self.next, self.tally) = (next, tally);
        found
    }

    /// With the sites on curved faces only where these are few, unless the options ask for them.
    fn within_budget(
        part: &'a Part,
        gripper: &'a Gripper,
        options: &ProposeOptions,
    ) -> Result<Self> {
        options.validate()?;
        if !gripper.pads(gripper.stroke[0]).iter().all(|pad| crate::geometry::is_convex(pad)) {
            return Err(Error::input(
                &gripper.name,
                "the pad is not a convex counter-clockwise polygon",
                "correct the gripper",
            ));
        }
        let mut tally = Tally::default();
        let mut pairs = Vec::new();
        let chosen = chosen_faces(part, options)?;
        let (chosen_faces, outside) = (chosen.as_deref(), &mut None);
        let mut choice =
            Choice { chosen: chosen_faces, pairs: &mut pairs, tally: &mut tally, outside };
        let stroke = |kind| Stroke::new(kind, gripper, options);
        if options.outside {
            choice.take(part.pairs(0.0, f64::INFINITY), &stroke(PairKind::External));
        }
        if options.inside {
            if gripper.outer_pad.is_none() {
                let remedy = "state pad.outer_face in the gripper file: the distance from the pad face to the finger's outer gripping face";
                return Err(Error::input(
                    &gripper.name,
                    "inside grips need outer pads, and this gripper states none",
                    remedy,
                ));
            }
            choice.take(part.internal_pairs(0.0, f64::INFINITY), &stroke(PairKind::Internal));
        }
        let outside = choice.outside.take();
        let environment = Environment::new(options);
        let Sites { sites, directions, plane, known, round } =
            site::sites(part, gripper, options, &environment, &pairs, chosen.as_deref())?;
        tally.pairs = pairs.len() as u64 + round.pairs;
        let outer = stroke(PairKind::External);
        round.widths.iter().for_each(|&width| tally.note_width(width, &outer));
        tally.curved_left_out = round.left_out;
        tally.note_leans(round.leans);
        for (reason, count) in round.rejections {
            *tally.rejections.entry(reason.name()).or_default() += count;
        }
        tally.nearest_approach = environment.nearest_approach(&sites);
        let stride = if options.flips || !gripper.is_symmetric() { 2 } else { 1 };
        let grid: usize = sites[..plane].iter().map(Site::grid).sum();
        let special: usize =
            sites[..plane].iter().flat_map(|site| &site.special).map(Vec::len).sum();
        let round_grid: usize = sites[plane..known].iter().map(Site::grid).sum();
        let of_angles = sites[plane..known].iter().flat_map(|site| &site.special);
        let before_free = grid + special + round_grid + of_angles.map(Vec::len).sum::<usize>();
        let free_grid: usize = sites[known..].iter().map(Site::grid).sum();
        let pad = vec![Polygon { outer: gripper.pad.clone(), holes: Vec::new() }]; // of both
        Ok(Self {
            part,
            gripper,
            options: options.clone(),
            environment,
            sites,
            directions,
            shape: Arc::new(Topology::new(&part.mesh)),
            whole: Arc::new(Contact { face_i: pad.clone(), face_ii: pad }),
            symmetric: gripper.is_symmetric(),
            reach: gripper.pad_reach(),
            tally,
            outside,
            plane,
            known,
            next: Cursor {
                special_id: grid as u64 * stride,
                round_id: (grid + special) as u64 * stride,
                round_special_id: (grid + special + round_grid) as u64 * stride,
                free_id: before_free as u64 * stride,
                free_special_id: (before_free + free_grid) as u64 * stride,
                ..Cursor::default()
            },
            share: None,
            corners: 400.0,
            tree: None,
        })
    }

    /// Number of candidates in all.
    pub fn candidates(&self) -> u64 {
        self.count(&self.sites)
    }

    /// Number of candidates on curved and drafted faces among them.
    pub fn curved_candidates(&self) -> u64 {
        self.count(&self.sites[self.plane..])
    }

    fn count(&self, sites: &[Site]) -> u64 {
        let poses: usize = sites.iter().map(Site::candidates).sum();
        poses as u64 * self.orientations().len() as u64
    }

    /// Counts so far.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Ways to put the jaws at one pose that must be tested by themselves.
    pub(super) fn orientations(&self) -> &'static [Jaws] {
        if self.symmetric { &[Jaws::Straight] } else { &Jaws::BOTH }
    }

    /// Numbers used up per pose.
    pub(super) fn stride(&self) -> u64 {
        if self.options.flips || !self.symmetric { 2 } else { 1 }
    }

    pub(super) fn prepare<'s>(&self, site: &'s Site) -> Prepared<'s> {
        let axes = site::axes(self.directions[site.direction]);
        let reach = self.reach;
        let (low, high) = self.part.mesh.bounding_box();
        let fingers = Jaw::BOTH.iter().flat_map(|&jaw| self.gripper.bodies(jaw));
        let bodies = fingers.chain(&self.gripper.palm);
        let extent = bodies
            .flat_map(crate::gripper::Body::bounds)
            .map(|corner| corner.length())
            .fold(0.0, f64::max);
        // Longer than the part and the gripper together: beyond it the gripper is clear of the
        // part.
        let clear = (high - low).length() + 2.0 * extent + self.gripper.stroke[1];
        let each = |approach: f64| -> Vec<Vec<Sweep>> {
            self.orientations()
                .iter()
                .map(|&jaws| {
                    sweeps(self.gripper, &site.motion(self.gripper, &self.options, approach, jaws))
                })
                .collect()
        };
        Prepared {
            site,
            patches: site.patches(self.part, &axes, reach),
            sweeps: each(clear),
            outer_sweeps: each(self.options.approach),
            way: self.environment.way(
                self.gripper,
                site.gap(self.gripper),
                site.kind == PairKind::Internal,
                self.options.opening,
            ),
        }
    }

    /// The tree in the axes of a direction; the last one is kept.
    fn tree(&mut self, direction: usize) -> Arc<Tree> {
        match &self.tree {
            Some((known, tree)) if *known == direction => Arc::clone(tree),
            _ => {
                self.tree = None; // frees the old one first
                let tree = Arc::new(self.new_tree(direction));
                self.tree = Some((direction, Arc::clone(&tree)));
                tree
            }
        }
    }

    pub(super) fn new_tree(&self, direction: usize) -> Tree {
        let axes: DMat3 = site::axes(self.directions[direction]);
        Tree::new(&self.shape, axes)
    }

    /// The next items: of one direction, and about a chunk of candidates; none when all are done.
    fn take_items(&mut self) -> Vec<Item> {
        let mut items: Vec<Item> = Vec::new();
        let mut candidates = 0;
        let most = ((MOST_CORNERS as f64 / self.corners) as usize).min(self.options.chunk).max(1);
        let most_here = |site: usize| if site < self.known { most } else { most.min(MOST_FREE) };
        while candidates < most_here(self.next.site) {
            let Some(site) = self.sites.get(self.next.site) else { break };
            if self.next.angle == site.angles.len() {
                let (site, places) = match self.next.places {
                    Places::Grid => (self.next.site, Places::Special),
                    Places::Special => (self.next.site + 1, Places::Grid),
                };
                self.next = Cursor { site, places, angle: 0, position: 0, ..self.next };
                continue;
            }
            if items.first().is_some_and(|first| self.sites[first.site].direction != site.direction)
            {
                break;
            }
            let count = site.places(self.next.places, self.next.angle).len();
            let end = (self.next.position + ITEM).min(count);
            let positions = self.next.position..end;
            let stride = self.stride();
            let site = self.next.site;
            let of_grid = self.next.places == Places::Grid;
            let next = match (site < self.plane, site < self.known, of_grid) {
                (true, _, true) => &mut self.next.id,
                (true, _, false) => &mut self.next.special_id,
                (false, true, true) => &mut self.next.round_id,
                (false, true, false) => &mut self.next.round_special_id,
                (false, false, true) => &mut self.next.free_id,
                (false, false, false) => &mut self.next.free_special_id,
            };
            let id = *next;
            *next += positions.len() as u64 * stride;
            let mut chosen = !positions.is_empty();
            if let Some(share) = &mut self.share {
                chosen &= share.takes(positions.len());
            }
            if chosen {
                candidates += positions.len();
                items.push(Item {
                    site: self.next.site,
                    places: self.next.places,
                    angle: self.next.angle,
                    positions,
                    id,
                });
            }
            self.next.position = end;
            if end == count {
                (self.next.angle, self.next.position) = (self.next.angle + 1, 0);
            }
        }
        items
    }
}

impl Iterator for Proposer<'_> {
    type Item = Chunk;

    fn next(&mut self) -> Option<Chunk> {
        let items = self.take_items();
        let first = items.first()?;
        let tree = self.tree(self.sites[first.site].direction);
        let this = &*self;
        let mut wanted: Vec<usize> = items.iter().map(|item| item.site).collect();
        wanted.dedup();
        let prepared: Vec<Prepared<'_>> =
            wanted.par_iter().map(|&site| this.prepare(&this.sites[site])).collect();
        let results: Vec<work::Outcome> = items
            .par_iter()
            .map_init(work::Buffers::default, |buffers, item| {
                let prepared = &prepared[wanted.partition_point(|&site| site < item.site)];
                this.evaluate(item, prepared, &tree, buffers)
            })
            .collect();
        drop(prepared);
        let mut chunk = Chunk::default();
        for outcome in results {
            chunk.candidates += outcome.candidates;
            self.tally.grips +=
                outcome.grips.iter().filter(|grip| grip.flip_of.is_none()).count() as u64;
            chunk.grips.extend(outcome.grips);
            for (reason, count) in outcome.rejections {
                *self.tally.rejections.entry(reason.name()).or_default() += count;
            }
        }
        self.tally.candidates += chunk.candidates;
        let corners = |contact: &Contact| {
            [&contact.face_i, &contact.face_ii]
                .into_iter()
                .flatten()
                .flat_map(crate::geometry::polygon::rings)
                .map(<[_]>::len)
                .sum::<usize>()
        };
        let total: usize = chunk
            .grips
            .iter()
            .filter(|grip| !Arc::ptr_eq(&grip.contact, &self.whole))
            .map(|grip| corners(&grip.contact))
            .sum();
        self.corners = (total as f64 / chunk.candidates.max(1) as f64).max(1.0);
        Some(chunk)
    }
}

/// Whether each face may be touched; `None`: all may.
fn chosen_faces(part: &Part, options: &ProposeOptions) -> Result<Option<Vec<bool>>> {
    if options.faces.is_none() && options.faces_in.is_empty() {
        return Ok(None);
    }
    let count = part.faces.len() + part.curved.len();
    let mut chosen = vec![false; count];
    for &face in options.faces.iter().flatten() {
        let Some(chosen) = chosen.get_mut(face as usize) else {
            let remedy = format!("the part has {count} of them, counted from 0");
            return Err(Error::input("faces", format!("there is no face {face}"), remedy));
        };
        *chosen = true;
    }
    for corners in &options.faces_in {
        let [low, high] = corners;
        // A face may touch the box from inside: coordinates come rounded to single precision.
        let (low, high) = (*low - 1e-6, *high + 1e-6);
        let within = |face: &crate::part::PlanarFace| {
            let points = face.polygons.iter().flat_map(|polygon| &polygon.outer);
            points
                .map(|point| face.part_from_face.point(point.extend(0.0)))
                .all(|point| point.cmpge(low).all() && point.cmple(high).all())
        };
        let curved = |face: &&crate::part::CurvedFace| {
            face.triangles
                .iter()
                .flat_map(|&triangle| part.mesh.corners(triangle))
                .all(|point| point.cmpge(low).all() && point.cmple(high).all())
        };
        let plane = part.faces.iter().filter(|face| within(face)).map(|face| face.id);
        let curved = part.curved.iter().filter(curved).map(|face| face.id);
        let mut any = false;
        for face in plane.chain(curved) {
            chosen[face as usize] = true;
            any = true;
        }
        if !any {
            // Without a sign before zero.
            let [a, b] = corners.map(|corner| (corner * 1e6).round() / 1e3 + 0.0);
            let problem = format!(
                "no face lies wholly between ({}, {}, {}) and ({}, {}, {}) mm",
                a.x, a.y, a.z, b.x, b.y, b.z
            );
            return Err(Error::input(
                "box of faces",
                problem,
                "make it larger; the list of the part's faces says where they lie",
            ));
        }
    }
    Ok(Some(chosen))
}

/// Sorts out the face pairs.
struct Choice<'a> {
    /// Faces that may be touched; `None`: all.
    chosen: Option<&'a [bool]>,
    pairs: &'a mut Vec<FacePair>,
    tally: &'a mut Tally,
    /// The pair nearest to the stroke of those outside.
    outside: &'a mut Option<FacePair>,
}

impl Choice<'_> {
    /// Takes the pairs that the jaws reach.
    fn take(&mut self, all: Vec<FacePair>, stroke: &Stroke) {
        for pair in all {
            let chosen = |face: u32| self.chosen.is_none_or(|chosen| chosen[face as usize]);
            let reason = if let Err(reason) = stroke.check(pair.width) {
                if reason == Rejection::Stroke {
                    self.tally.note_width(pair.width, stroke);
                    let beyond = |pair: &FacePair| stroke.beyond(pair.width);
                    if self.outside.as_ref().is_none_or(|known| beyond(&pair) < beyond(known)) {
                        *self.outside = Some(pair);
                    }
                }
                reason
            } else if !chosen(pair.face_i) || !chosen(pair.face_ii) {
                Rejection::FaceNotChosen
            } else {
                self.pairs.push(pair);
                continue;
            };
            *self.tally.rejections.entry(reason.name()).or_default() += 1;
        }
    }
}
