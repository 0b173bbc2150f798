//! Sites on faces of free form, and on surfaces of revolution of any profile: closing directions along
//! which a crest of one lies opposite a crest of another, of a round face, or a plane.
//!
//! Two places are opposite each other where the line between them is normal to both surfaces, see
//! [`super::opposite`].

use glam::{DMat3, DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::crest::{Crests, FreeCrest, Pad, compression, half};
use super::net::Net;
use super::opposite::{End, Pair};
use super::round::{Crest, Outcomes, Round};
use super::survey::{Survey, ellipse, is_free};
use super::tapers::upright;
use super::{Finder, SAME_PLANE, Site, axes};
use crate::error::Result;
use crate::geometry::polygon::Bounds2;
use crate::geometry::principal;
use crate::mechanics::curved::Pads;
use crate::model::{Gap, Piece, Ring, Surfaces};
use crate::part::{CurvedFace, PairKind, Shape};
use crate::propose::options::Rejection;
use crate::propose::stroke::Stroke;

/// Share of the width by which the radii of two crests may fall short of it: fits are no better.
const ROLLS: f64 = 0.05;
/// Compressions behind a crest up to which what lies beside it counts: a load presses one pad by half
/// as much again, and tilts it by as much.
const DEPTH: f64 = 4.0;
/// Directions of one pair of faces, as a share of the step asked for, below which two are one.
const SAME_STEP: f64 = 0.6;
/// Pairs of crests looked at, at most, and triangles looked at for them.
const MOST_PAIRS: usize = 400;
const MOST_TRIANGLES: usize = 60_000_000;

/// What was found of one pair of crests.
struct Known {
    faces: [u32; 2],
    closing: DVec3,
    axes_from_part: DMat3,
    /// In these axes, those of the direction.
    boxes: [Bounds2; 2],
}

/// Whether crests of a face are looked for here: it is of free form, or has a profile that is known
/// by its triangles only.
fn has_form(face: &CurvedFace) -> bool {
    is_free(face) || face.outside && matches!(face.shape, Shape::Revolution { .. })
}

impl Finder<'_> {
    /// The sites on faces of free form.
    pub(super) fn free(&mut self, round: &mut Round) -> Result<Vec<Site>> {
        let wanted =
            |face: &&CurvedFace| has_form(face) && face.reachable && self.may_touch(face.id);
        if !self.options.outside || !self.part.curved.iter().any(|face| wanted(&face)) {
            return Ok(Vec::new());
        }
        let mut net = Net::new(&self.part.mesh, self.part.curved.iter().filter(wanted));
        let pairs = self.pairs(&mut net);
        let mut loose = self.loose();
        let of_revolution = self.part.curved.iter().filter(|face| has_form(face) && !is_free(face));
        loose.extend(of_revolution.flat_map(|face| &face.triangles));
        let triangles = self.part.mesh.triangles.len().max(1);
        let most = (MOST_TRIANGLES / triangles).clamp(MOST_PAIRS / 16, MOST_PAIRS);
        let mut sites = Vec::new();
        let mut seen = Outcomes::default();
        let mut known: Vec<Known> = Vec::new();
        let mut heights: Vec<f64> = Vec::new();
        let mut tried = 0;
        let near = (SAME_STEP * self.options.angle_step).sin();
        for pair in &pairs {
            let is_known = |known: &Known| self.is_known(known, pair, near, &net);
            if tried == most || known.iter().any(is_known) {
                continue;
            }
            tried += 1;
            self.budget.look();
            let first = sites.len();
            let faces = pair.ends.map(|end| self.face_of(end, &net));
            let axes_from_part = axes(pair.closing);
            let mut boxes = pair.places.map(|place| {
                let at = (axes_from_part * place.point).truncate();
                Bounds2 { min: at, max: at }
            });
            let vertices = self.part.mesh.vertices.iter();
            heights.clear();
            heights.extend(vertices.map(|vertex| pair.closing.dot(*vertex)));
            let outcome = match self.crests_of(pair, &net, &heights) {
                Err(reason) => Some(Some(reason)),
                Ok(None) => None,
                Ok(Some(crests)) => {
                    boxes = crests.each_ref().map(|crest| crest.bounds);
                    self.opposite(pair, &crests, (&loose, &heights), &mut sites)?
                }
            };
            known.push(Known { faces, closing: pair.closing, axes_from_part, boxes });
            sites[first..].iter().for_each(|site| self.budget.take(site));
            if self.budget.is_spent() {
                round.left_out = true;
                return Ok(Vec::new());
            }
            if matches!(outcome, Some(Some(Rejection::Stroke))) {
                round.widths.push(pair.width);
            }
            if let Some(outcome) = outcome {
                seen.add(faces[0], faces[1], outcome);
            }
        }
        round.count(seen);
        Ok(sites)
    }

    fn face_of(&self, end: End, net: &Net) -> u32 {
        match end {
            End::Free(corner) => net.faces[corner as usize],
            End::Plane(face) => face,
            End::Round(index) => self.part.curved[index].id,
        }
    }

    /// Whether a pair of crests is one that was looked at; `near`: the sine of the angle up to which
    /// two directions are one.
    fn is_known(&self, known: &Known, pair: &Pair, near: f64, net: &Net) -> bool {
        let reach = self.reach;
        let faces = pair.ends.map(|end| self.face_of(end, net));
        // Near the border between upright and not.
        let swapped = known.closing.dot(pair.closing) < 0.0;
        let [one, two] = if swapped { [1, 0] } else { [0, 1] };
        if [faces[one], faces[two]] != known.faces {
            return false;
        }
        if known.closing.cross(pair.closing).length() > near {
            return false;
        }
        [one, two].iter().zip(known.boxes).all(|(&end, bounds)| {
            let at = (known.axes_from_part * pair.places[end].point).truncate();
            let at = Bounds2 { min: at, max: at };
            matches!(pair.ends[end], End::Plane(_)) || bounds.grown(0.5 * reach).meets(at)
        })
    }

    /// The crests of a pair in the axes of its upright direction, the upper one first; `None` where
    /// there are none, or they do not face each other. `heights`: of the mesh's corners along it.
    fn crests_of(
        &self,
        pair: &Pair,
        net: &Net,
        heights: &[f64],
    ) -> std::result::Result<Option<[FreeCrest; 2]>, Rejection> {
        let axes_from_part = axes(pair.closing);
        let (mesh, pad) = (&self.part.mesh, self.pad());
        let crests = Crests { mesh, net, axes_from_part, heights, pad };
        let mut found = Vec::new();
        for (index, side) in [1.0, -1.0].into_iter().enumerate() {
            let crest = match pair.ends[index] {
                End::Free(corner) => {
                    let id = net.faces[corner as usize];
                    let Some(face) = self.part.curved_face(id) else { return Ok(None) };
                    crests.find(face, corner, &pair.places[index], side)
                }
                end => self.other_crest(end, side * pair.closing, side, net),
            };
            let Some(crest) = crest else { return Ok(None) };
            found.push(crest);
        }
        let Ok([top, bottom]) = <[FreeCrest; 2]>::try_from(found) else { return Ok(None) };
        let width = top.height + bottom.height;
        let reach = self.reach;
        if width <= 0.0 || !top.bounds.grown(reach).meets(bottom.bounds.grown(reach)) {
            return Ok(None);
        }
        Stroke::new(PairKind::External, self.gripper, self.options).check(width)?;
        let most = 1e3 * width;
        let give = top.tensor(most) + bottom.tensor(most);
        if principal(give).0[0] < width * (1.0 - ROLLS) {
            return Err(Rejection::RollsApart);
        }
        Ok(Some([top, bottom]))
    }

    /// The crest of a plane or round face.
    fn other_crest(&self, end: End, towards: DVec3, side: f64, net: &Net) -> Option<FreeCrest> {
        let id = self.face_of(end, net);
        let crest = self.crests(towards).into_iter().find(|crest| crest.face == id)?;
        let (radii, axis) = match end {
            End::Round(index) => match self.part.curved[index].shape {
                Shape::Cylinder { axis, radius, .. } => {
                    let along = (axes(upright(towards)) * axis.direction).truncate();
                    ([radius, f64::INFINITY], along.normalize())
                }
                _ => ([crest.radius; 2], DVec2::X),
            },
            _ => ([f64::INFINITY; 2], DVec2::X),
        };
        let closing = side * towards;
        let bounds = if side < 0.0 { self.flipped(crest.bounds, closing) } else { crest.bounds };
        Some(FreeCrest {
            face: id,
            height: crest.height,
            above: 0.0,
            bounds,
            ends: crest.ends.map(DVec3::truncate),
            radii,
            axis,
            delta: compression(radii, self.pad()).max(self.flat_compression(end)),
            smooth: None,
        })
    }

    /// Compression of the layer by a plane alone \[m\], which may be smaller than a pad.
    fn flat_compression(&self, end: End) -> f64 {
        let End::Plane(index) = end else { return 0.0 };
        let Pad { layer, force, .. } = self.pad();
        (force / (layer.stiffness * self.part.faces[index as usize].area)).min(layer.reach())
    }

    /// Whether a squeeze on these surfaces turns the part out of the grip: radii of crests do not tell
    /// where a flat is smaller than what is pressed.
    fn rolls_apart(&self, pieces: &[Vec<Piece>; 2], width: f64) -> bool {
        let [face_i, face_ii] = pieces.clone();
        let stiffness = [self.gripper.layer().stiffness; 2];
        let surfaces = Surfaces { face_i, face_ii, stiffness, layer: None };
        let force = self.options.force_on(self.gripper);
        let resists =
            Pads::new(&surfaces).ok().and_then(|pads| pads.turning_stiffness(width, force));
        resists.is_some_and(|stiffness| stiffness < -ROLLS * force * width)
    }

    fn pad(&self) -> Pad {
        Pad {
            layer: self.gripper.layer(),
            force: self.options.force_on(self.gripper),
            reach: self.reach,
        }
    }

    /// Adds the sites of two crests, as [`Finder::round_sites`]; triangles of no face and of free form,
    /// and the heights of all corners along the direction.
    #[allow(clippy::option_option, reason = "told apart by the caller at once")]
    fn opposite(
        &mut self,
        pair: &Pair,
        [top, bottom]: &[FreeCrest; 2],
        (loose, along): (&[u32], &[f64]),
        sites: &mut Vec<Site>,
    ) -> Result<Option<Option<Rejection>>> {
        let closing = pair.closing;
        let levels = [top, bottom].map(|crest| {
            let ends = crest.ends.map(|end| end.extend(0.0));
            let FreeCrest { face, height, bounds, radii: [radius, _], .. } = *crest;
            [Crest { face, height, radius, bounds, ends }]
        });
        if self.is_buried(closing, [&levels[0], &levels[1]], &mut None) {
            return Ok(Some(Some(Rejection::OutOfReach)));
        }
        let direction = self.direction(closing);
        let heights = [top.height, -bottom.height];
        let reach = self.reach;
        let common = Bounds2 {
            min: top.bounds.min.max(bottom.bounds.min),
            max: top.bounds.max.min(bottom.bounds.max),
        };
        let region = Bounds2 {
            min: common.min.min(common.max) - 2.0 * reach,
            max: common.max.max(common.min) + 2.0 * reach,
        };
        let taken: FxHashSet<u32> = [top, bottom]
            .iter()
            .filter_map(|crest| crest.smooth.as_ref())
            .flat_map(|smooth| smooth.triangles.iter().copied())
            .collect();
        let axes_from_part = axes(self.directions[direction]);
        let depth = self.gripper.layer().reach().min(DEPTH * top.delta.max(bottom.delta));
        // Those that come near enough to either pad's plane.
        let slack = SAME_PLANE * self.size;
        let (high, low) = (heights[0] - depth - slack, heights[1] + depth + slack);
        let is_near = |triangle: &u32| {
            let corners = self.part.mesh.triangles[*triangle as usize];
            corners.iter().map(|&id| along[id as usize]).any(|z| z >= high || z <= low)
        };
        let facets = loose.iter().copied().filter(is_near);
        let facets: Vec<u32> = facets.filter(|triangle| !taken.contains(triangle)).collect();
        let survey = Survey::without(self.part, &facets, axes_from_part, has_form);
        let found = survey.pieces(heights, [depth; 2], region);
        let mut smooth = [(top, 1.0), (bottom, -1.0)].map(|(crest, side)| {
            crest.smooth.as_ref().map_or(Vec::new(), |smooth| {
                let window = window(&smooth.gap, smooth.level, region);
                survey.outlined(&smooth.triangles, &window, smooth.gap, side)
            })
        });
        for (pieces, others) in smooth.iter_mut().zip(found) {
            pieces.extend(others);
        }
        let pieces: [Vec<Piece>; 2] = smooth;
        if self.rolls_apart(&pieces, heights[0] - heights[1]) {
            return Ok(Some(Some(Rejection::RollsApart)));
        }
        let sides = [vec![top.face], vec![bottom.face]];
        let rise = SAME_PLANE * self.size + top.above.max(bottom.above);
        let place = common.centre();
        // The places lie along the crest, however the part lies.
        let turn = crest_axis(&pieces).map(|axis| {
            let quarter = std::f64::consts::FRAC_PI_2;
            let turn = axis.to_angle().rem_euclid(quarter);
            if turn > 0.5 * quarter + 1e-6 { turn - quarter } else { turn }
        });
        let pads = (heights, place);
        let any = self.pressed_sites(direction, sides, pads, pieces, (rise, turn), sites)?;
        Ok(any.then_some(None))
    }
}

/// Direction of the first crest that has one.
fn crest_axis(pieces: &[Vec<Piece>; 2]) -> Option<DVec2> {
    pieces.iter().flatten().find_map(|piece| match piece.gap {
        Gap::Cylinder { axis, .. } | Gap::Barrel { axis, .. } => Some(axis),
        _ => None,
    })
}

/// What of the pads' plane a gap stands for.
fn window(gap: &Gap, level: f64, region: Bounds2) -> Ring {
    let size = region.size().length();
    match *gap {
        Gap::Barrel { radius, meridian, axis, at, .. } => {
            ellipse(at, axis, [half(meridian, level), half(radius, level)])
        }
        Gap::Cylinder { radius, axis, at, .. } => {
            let across = half(radius, level);
            let at = at + axis * axis.dot(region.centre() - at);
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| at + axis * (x * size) + axis.perp() * (y * across))
                .to_vec()
        }
        _ => {
            let Bounds2 { min, max } = region;
            vec![min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]
        }
    }
}
