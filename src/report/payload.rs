//! What the page carries: a JSON header in plain sight and one block of binary columns, compressed,
//! in base64.
//!
//! Columns are little-endian arrays, each at a multiple of eight bytes; the header's `sections` say
//! where. Numbers are single precision, which is more than the page prints; a missing number is
//! NaN.

use std::collections::BTreeMap;
use std::io::Write;

use base64::Engine;
use bytemuck::NoUninit;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::areas;
use super::display::{Display, TRIANGLE_BUDGET};
use super::obstacles;
use super::states::{self, Pressed};
use crate::error::{Error, ErrorKind, Result};
use crate::gripper::catalogue::{self, CATALOGUE};
use crate::gripper::{Body, Gripper, Shape};
use crate::model::{Frame, Miss};
use crate::part::Mesh;
use crate::rank;
use crate::request::Side;
use crate::results::{GripSet, Provenance, RankedGrip, Verdict};

/// Grips that the page lists; a longer ranking is cut there and the page says so.
pub(super) const MAX_GRIPS: usize = 100_000;
/// Values in the table of `mu_s` by load; grips beyond it keep their worst load only.
pub(super) const MAX_LOAD_VALUES: usize = 8_000_000;

/// Steps over the stroke in which the page knows the pads' way: a straight line over one leaves an
/// arc of 50 mm by hundredths of a millimetre.
const TRAVEL_STEPS: u32 = 32;

/// Header and data, ready to stand between `script` tags.
pub(super) struct Payload {
    /// JSON without any `<`.
    pub(super) header: String,
    /// Base64 of the compressed columns.
    pub(super) data: String,
}

/// Named columns one after another.
#[derive(Default)]
pub(super) struct Columns {
    bytes: Vec<u8>,
    sections: BTreeMap<&'static str, (&'static str, usize, usize)>,
}

impl Columns {
    pub(super) fn add<T: NoUninit>(
        &mut self,
        name: &'static str,
        kind: &'static str,
        values: &[T],
    ) {
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        self.sections.insert(name, (kind, self.bytes.len(), values.len()));
        self.bytes.extend_from_slice(bytemuck::cast_slice(values));
    }

    pub(super) fn f32(&mut self, name: &'static str, values: impl IntoIterator<Item = f64>) {
        self.add(name, "f32", &values.into_iter().map(|value| value as f32).collect::<Vec<_>>());
    }

    pub(super) fn f64(&mut self, name: &'static str, values: impl IntoIterator<Item = f64>) {
        self.add(name, "f64", &values.into_iter().collect::<Vec<_>>());
    }

    pub(super) fn u32(&mut self, name: &'static str, values: impl IntoIterator<Item = u32>) {
        self.add(name, "u32", &values.into_iter().collect::<Vec<_>>());
    }
}

impl Payload {
    /// Encodes `set`, the part, and rejected candidates.
    ///
    /// # Errors
    /// A mismatch when a grip names a load that is not in the list.
    pub(super) fn new(set: &GripSet, mesh: Option<&Mesh>, misses: &[Miss]) -> Result<Self> {
        if cfg!(target_endian = "big") {
            return Err(Error::new(
                ErrorKind::Unsupported,
                "report",
                "this machine stores numbers big-endian first",
                "write the page on a little-endian machine",
            ));
        }
        let mut columns = Columns::default();
        let grips = &set.grips[..set.grips.len().min(MAX_GRIPS)];
        if let Some(grip) = grips.iter().find(|grip| grip.worst.load as usize >= set.loads.len()) {
            let problem = format!(
                "grip {} names load {}, but the file lists {}",
                grip.grip.id,
                grip.worst.load,
                set.loads.len()
            );
            return Err(Error::new(
                ErrorKind::Mismatch,
                "result file",
                problem,
                "use a file that gripfast wrote",
            ));
        }
        let pressed = states::worst(set, grips);
        let statuses = poses_and_scores(&mut columns, set, grips, &pressed);
        let verdict = |grip| match set.verdict(grip) {
            Verdict::Unknown => 0,
            Verdict::Holds { .. } => 1,
            Verdict::Slips { .. } => 2,
        };
        columns.add("verdict", "u8", &grips.iter().map(verdict).collect::<Vec<u8>>());
        areas::contacts(&mut columns, grips);
        areas::surfaces(&mut columns, grips);
        let notes = areas::faces(&mut columns, grips);
        let by_load = loads(&mut columns, set, grips);
        let reasons = rejected(&mut columns, misses);
        let obstacles = obstacles::obstacles(&mut columns, set);
        let display = mesh
            .and_then(|mesh| Display::new(mesh, TRIANGLE_BUDGET))
            .map(|display| surface(&mut columns, display));
        let (gripper, gripper_problem) =
            match serde_json::from_value::<Gripper>(set.gripper.clone()) {
                Ok(gripper) => {
                    palm(&mut columns, &gripper, grips);
                    let place =
                        |miss: &Miss| gripper.palm_place(gripper.jaw_gap(&miss.pose.grip()));
                    let places = misses.iter().map(|miss| place(miss).origin);
                    columns.f32("miss_palm", places.flat_map(|origin| [origin.x, origin.z]));
                    (gripper_json(&gripper), Value::Null)
                }
                Err(error) => {
                    columns.f32("palm", grips.iter().flat_map(|_| [0.0; 2]));
                    columns.f32("miss_palm", misses.iter().flat_map(|_| [0.0; 2]));
                    (Value::Null, Value::String(error.to_string()))
                }
            };
        let header = json!({
            "format": "gripfast-report", "version": 1, "provenance": provenance(set), "part": set.part, "display": display,
            "gripper": gripper, "gripper_problem": gripper_problem, "loads": set.loads, "summary": set.summary,
            "grips": { "total": set.grips.len(), "shown": grips.len() }, "statuses": statuses, "by_load": by_load,
            "asked": asked(set), "reasons": reasons, "notes": notes, "obstacles": obstacles, "catalogue": known_grippers(), "sections": columns.sections,
        });
        Ok(Self { header: script_safe(&header)?, data: packed(&columns.bytes)? })
    }
}

/// Where the numbers come from, with every option of the run by name.
fn provenance(set: &GripSet) -> Value {
    let Provenance { gripfast, command, backend, request, resolved, complete, warnings, .. } =
        &set.provenance;
    let mut settings = Map::new();
    for value in [json!(request), json!(resolved), json!({ "complete": complete })] {
        let Value::Object(fields) = value else { continue };
        for (name, value) in fields {
            match value {
                Value::Object(group) => settings.extend(group),
                value => drop(settings.insert(name, value)),
            }
        }
    }
    json!({
        "gripfast": gripfast, "command": command, "backend": backend, "settings": settings,
        "warnings": warnings,
    })
}

/// JSON that cannot end the `script` element it stands in.
fn script_safe(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|error| {
        Error::input("result file", format!("cannot be written as JSON: {error}"), "")
    })?;
    Ok(text.replace('<', "\\u003c"))
}

fn packed(bytes: &[u8]) -> Result<String> {
    let failed = |error| Error::input("report", format!("compression failed: {error}"), "");
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(bytes).map_err(failed)?;
    Ok(base64::engine::general_purpose::STANDARD.encode(encoder.finish().map_err(failed)?))
}

/// One row per grip; answers with the names of the statuses in the order of their numbers.
/// `pressed`: the state of the pads under the worst load of each grip.
fn poses_and_scores(
    columns: &mut Columns,
    set: &GripSet,
    grips: &[RankedGrip],
    pressed: &[Pressed],
) -> Vec<Value> {
    let nan = f64::NAN;
    columns.f64("id", grips.iter().map(|g| g.grip.id as f64));
    columns.f64("flip_of", grips.iter().map(|g| g.grip.flip_of.map_or(nan, |id| id as f64)));
    if set.part.symmetry.is_some() {
        columns.f64("turn_of", rank::turned(set).into_iter().take(grips.len()).map(|id| id as f64));
    }
    columns.u32("rank", grips.iter().map(|g| u32::try_from(g.rank).unwrap_or(u32::MAX)));
    columns.f32("origin", grips.iter().flat_map(|g| g.grip.part_from_grip.origin.to_array()));
    columns
        .f32("rotation", grips.iter().flat_map(|g| g.grip.part_from_grip.rotation.to_cols_array()));
    columns.f32("width", grips.iter().map(|g| g.grip.width));
    columns.add("inside", "u8", &grips.iter().map(|g| u8::from(g.grip.inside)).collect::<Vec<_>>());
    columns.f32("angle", grips.iter().map(|g| g.grip.angle));
    columns.u32("face_i", grips.iter().map(|g| g.grip.face_i));
    columns.u32("face_ii", grips.iter().map(|g| g.grip.face_ii));
    columns.f32("score", grips.iter().map(|g| g.score.unwrap_or(nan)));
    columns.f32("alpha", grips.iter().map(|g| g.alpha));
    columns.f32("delta_d", grips.iter().map(|g| g.delta_d));
    columns.f32("contact_share", grips.iter().map(|g| g.contact_share));
    columns.f32("twist_margin", grips.iter().map(|g| g.twist_margin));
    columns.f32("safety", grips.iter().map(|g| g.safety.unwrap_or(nan)));
    columns.f32("force_needed", grips.iter().map(|g| g.force_needed.unwrap_or(nan)));
    columns.f32("load_multiple", grips.iter().map(|g| g.load_multiple.unwrap_or(nan)));
    columns.u32("load", grips.iter().map(|g| g.worst.load));
    columns.f32("mu", grips.iter().map(|g| g.worst.mu_s.unwrap_or(nan)));
    columns.f32(
        "wrench",
        grips
            .iter()
            .flat_map(|g| [g.worst.wrench.force.to_array(), g.worst.wrench.moment.to_array()])
            .flatten(),
    );
    columns.f32("pressure", pressed.iter().flat_map(|state| state.pressure));
    columns.f32("slip", pressed.iter().flat_map(|state| state.slip));
    columns.f32(
        "bounds",
        grips.iter().flat_map(|g| g.worst.bounds.map_or([nan; 2], |b| [b.lower, b.upper])),
    );
    columns.f32("residual", grips.iter().map(|g| g.worst.residual));
    let mut statuses: Vec<Value> = Vec::new();
    let numbers = grips.iter().map(|g| {
        let name = serde_json::to_value(g.worst.status).unwrap_or(Value::Null);
        let known = statuses.iter().position(|known| *known == name);
        known.unwrap_or_else(|| {
            statuses.push(name);
            statuses.len() - 1
        }) as u32
    });
    let numbers: Vec<u32> = numbers.collect();
    columns.u32("status", numbers);
    statuses
}

/// Where the palm stands in each grip along `x1` and `x3`, seen from where the gripper file places
/// it.
fn palm(columns: &mut Columns, gripper: &Gripper, grips: &[RankedGrip]) {
    let place = |grip: &RankedGrip| gripper.palm_place(gripper.jaw_gap(&grip.grip)).origin;
    columns.f32("palm", grips.iter().map(place).flat_map(|origin| [origin.x, origin.z]));
}

/// A `mu_s` below this share of the largest one is shown as zero: a colour scale has no use for
/// more.
const LEAST_SHARE: f64 = 1e-6;

/// `mu_s` of each load on a logarithmic scale of 65,533 steps (0: no limit state, 1: zero), for the
/// grips all of whose loads are known, as many as fit; their places in the list are a column of
/// their own.
fn loads(columns: &mut Columns, set: &GripSet, grips: &[RankedGrip]) -> Value {
    let n = set.loads.len();
    let whole = |grip: &RankedGrip| n > 0 && grip.mu_by_load.len() == n;
    let rows: Vec<usize> = (0..grips.len())
        .filter(|&index| whole(&grips[index]))
        .take(MAX_LOAD_VALUES / n.max(1))
        .collect();
    let finite = || {
        rows.iter()
            .flat_map(|&row| &grips[row].mu_by_load)
            .filter_map(|mu| *mu)
            .filter(|mu| mu.is_finite())
    };
    // A load along the closing axis needs no friction but for rounding; many decades of that would
    // leave few steps for the rest.
    let zero = LEAST_SHARE * finite().fold(0.0, f64::max);
    let positive = || finite().filter(|mu| *mu > zero);
    let (low, high) = positive()
        .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), mu| (low.min(mu), high.max(mu)));
    let (low, high) = if low < high {
        (low, high)
    } else {
        (if high > 0.0 { high } else { 1.0 }, high.max(1.0) * 2.0)
    };
    let code = |mu: Option<f64>| match mu {
        Some(mu) if mu > zero && mu.is_finite() => {
            2 + ((mu / low).ln() / (high / low).ln() * 65_533.0).round().clamp(0.0, 65_533.0) as u16
        }
        Some(mu) if mu <= zero => 1,
        _ => 0,
    };
    columns.u32("by_load_grip", rows.iter().map(|&row| row as u32));
    columns.add(
        "by_load",
        "u16",
        &rows
            .iter()
            .flat_map(|&row| grips[row].mu_by_load.iter().map(|&mu| code(mu)))
            .collect::<Vec<_>>(),
    );
    states::by_load(columns, set, grips, &rows);
    json!({ "rows": rows.len(), "low": low, "high": high })
}

/// Rejected candidates, a row each; answers with their reasons in the order of their numbers.
fn rejected(columns: &mut Columns, misses: &[Miss]) -> Vec<String> {
    let poses = || misses.iter().map(|miss| &miss.pose);
    let frames = || poses().map(|pose| &pose.part_from_grip);
    columns.f64("miss_id", poses().map(|pose| pose.id as f64));
    columns.f32("miss_origin", frames().flat_map(|frame| frame.origin.to_array()));
    columns.f32("miss_rotation", frames().flat_map(|frame| frame.rotation.to_cols_array()));
    columns.f32("miss_width", poses().map(|pose| pose.width));
    columns.u32("miss_faces", poses().flat_map(|pose| [pose.face_i, pose.face_ii]));
    columns.add("miss_inside", "u8", &poses().map(|p| u8::from(p.inside)).collect::<Vec<_>>());
    columns.f32("miss_by", misses.iter().map(|miss| miss.by.unwrap_or(f64::NAN)));
    let place = |miss: &Miss| miss.place.unwrap_or(glam::DVec3::NAN).to_array();
    columns.f32("miss_place", misses.iter().flat_map(place));
    let mut reasons: Vec<String> = Vec::new();
    let number = |pose: &crate::model::Negative| {
        let known = reasons.iter().position(|known| *known == pose.reason);
        known.unwrap_or_else(|| {
            reasons.push(pose.reason.clone());
            reasons.len() - 1
        }) as u32
    };
    let numbers: Vec<u32> = poses().map(number).collect();
    columns.u32("miss_reason", numbers);
    reasons
}

/// The drawable part; answers with what the page needs to read and to say about it.
fn surface(columns: &mut Columns, display: Display) -> Value {
    columns.add("positions", "u16", &display.positions);
    columns.add("normals", "i8", &display.normals);
    // Differences of neighbouring indices are small and repeat, which the compression needs.
    let differences = |indices: &[u32]| -> Vec<i32> {
        std::iter::once(0)
            .chain(indices.iter().copied())
            .zip(indices)
            .map(|(before, &now)| now.wrapping_sub(before) as i32)
            .collect()
    };
    columns.add("triangles", "delta", &differences(&display.triangles));
    columns.add("edges", "delta", &differences(&display.edges));
    json!({
        "origin": display.origin, "scale": display.scale, "triangles": display.original,
        "shown": display.triangles.len() / 3, "deviation": display.deviation,
    })
}

/// What the run was asked for, in SI under the page's own names, so that the page does not depend on
/// how the result file keeps it.
fn asked(set: &GripSet) -> Value {
    let Provenance { request, resolved, complete, .. } = &set.provenance;
    let (candidates, scoring) = (&request.candidates, &request.scoring);
    json!({
        "force": resolved.force.0, "pad_friction": resolved.pad_friction,
        "safety": resolved.safety,
        "k1": scoring.k1, "k2": scoring.k2,
        "spacing": resolved.spacing.0, "angle_step": candidates.angle_step.0,
        "min_contact": candidates.min_contact,
        "max_offset": candidates.max_offset.map(|offset| offset.0),
        "opening": candidates.opening.0, "clearance": candidates.clearance.0,
        "inside": candidates.grips != Side::Outside,
        "approach_cone": candidates
            .approach
            .map(|cone| json!({ "axis": cone.axis, "half_angle_rad": cone.half_angle })),
        "ground": candidates
            .ground
            .map(|ground| json!({ "normal": ground.normal, "height_m": ground.offset })),
        "keep_out": candidates
            .keep_out
            .iter()
            .map(|region| [region.low, region.high])
            .collect::<Vec<_>>(),
        "complete": complete,
    })
}

/// Grippers of the catalogue with what advice needs.
fn known_grippers() -> Vec<Value> {
    let known = CATALOGUE.iter().filter_map(|(name, _)| Some((name, catalogue::find(name).ok()?)));
    known
        .map(|(name, found)| json!({ "name": name, "stroke": found.stroke, "force": found.force }))
        .collect()
}

/// A frame as a column-major 4x4 matrix.
pub(super) fn matrix(frame: &Frame) -> Vec<f64> {
    let (r, o) = (frame.rotation, frame.origin);
    let column = |axis: glam::DVec3, w: f64| [axis.x, axis.y, axis.z, w];
    [column(r.x_axis, 0.0), column(r.y_axis, 0.0), column(r.z_axis, 0.0), column(o, 1.0)].concat()
}

/// Places of the palm along `x1` over the stroke, of pads that move along arcs: `[distance of the
/// pads, place]` at equal steps.
fn travel(gripper: &Gripper) -> Vec<[f64; 2]> {
    let [least, most] = gripper.stroke;
    let gaps =
        (0..=TRAVEL_STEPS).map(|k| least + f64::from(k) / f64::from(TRAVEL_STEPS) * (most - least));
    gaps.map(|gap| [gap, gripper.palm_place(gap).origin.x]).collect()
}

/// The gripper with each body's placement as a column-major 4x4 matrix.
fn gripper_json(gripper: &Gripper) -> Value {
    let body = |body: &Body| {
        let shape = match &body.shape {
            Shape::Box { half } => json!({ "type": "box", "half": half }),
            Shape::Cylinder { radius, half_height } => {
                json!({ "type": "cylinder", "radius": radius, "half_height": half_height })
            }
            Shape::Hull { points } => json!({ "type": "hull", "points": points }),
        };
        json!({ "name": body.name, "matrix": matrix(&body.grip_from_body), "shape": shape })
    };
    json!({
        "name": gripper.name, "stroke": gripper.stroke, "force": gripper.force, "pad": gripper.pad,
        "payload": gripper.payload, "moment": gripper.moment,
        "pad_friction": gripper.pad_friction, "pad_thickness": gripper.pad_thickness, "outer_pad": gripper.outer_pad,
        "flange": gripper.grip_from_flange.as_ref().map(matrix), "tool": gripper.grip_from_tool.as_ref().map(matrix),
        "pad_ii": gripper.pad_ii, "moving": gripper.moving, "travel": travel(gripper),
        "fingers_ii": gripper.fingers_ii.as_ref().map(|bodies| bodies.iter().map(body).collect::<Vec<_>>()),
        "fingers": gripper.fingers.iter().map(body).collect::<Vec<_>>(), "palm": gripper.palm.iter().map(body).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_cannot_end_its_script_element() {
        let text =
            script_safe(&json!({ "file": "</script><script>alert(1)</script><!--" })).unwrap();
        assert!(!text.contains('<'), "{text}");
        assert_eq!(
            serde_json::from_str::<Value>(&text).unwrap()["file"],
            "</script><script>alert(1)</script><!--"
        );
    }

    #[test]
    fn columns_are_aligned_and_named() {
        let mut columns = Columns::default();
        columns.add("a", "u8", &[1u8, 2, 3]);
        columns.f64("b", [1.5]);
        assert_eq!((columns.sections["a"], columns.sections["b"]), (("u8", 0, 3), ("f64", 8, 1)));
        assert_eq!(columns.bytes.len(), 16);
    }
}
