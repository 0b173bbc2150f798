//! What a user reads of a set of grips as a whole.

use std::collections::BTreeMap;
use std::io::Write;

use gripfast::gripper::Gripper;
use gripfast::plan::OUTRANKED;
use gripfast::results::GripSet;
use gripfast::text::counted;
use gripfast::units::decimal;

use super::layout::{significant, tuple};

pub(super) fn summary(
    out: &mut impl Write,
    set: &GripSet,
    gripper: &Gripper,
) -> std::io::Result<()> {
    writeln!(out, "{}", part(set))?;
    writeln!(
        out,
        "{} at {} N per jaw, {}, {}, {}",
        gripper.name,
        decimal(set.provenance.resolved.force.0, 3),
        counted(set.loads.len() as u64, "load"),
        counted(set.summary.pairs, "face pair"),
        counted(set.summary.candidates, "candidate"),
    )?;
    writeln!(out, "{}", verdict(set))?;
    if let Some(text) = unsolved(set) {
        writeln!(out, "{text}")?;
    }
    if let Some(reasons) = reasons(set) {
        writeln!(out, "rejected: {reasons}")?;
    }
    Ok(())
}

/// How many of the grips hold, with what, and what the best needs where none does.
pub(super) fn verdict(set: &GripSet) -> String {
    let (ranked, force) = (set.summary.ranked, decimal(set.provenance.resolved.force.0, 3));
    let pads = set.pads();
    let (Some(holding), Some(friction)) = (set.holding(), pads.value) else {
        return format!(
            "{ranked} grips have a limit state at {force} N per jaw; which hold is not known: the \
             friction of the pads is not stated (--pad-friction)"
        );
    };
    let safety = match pads.safety {
        1.0 => String::new(),
        safety => format!(" and a safety of {safety}"),
    };
    let best = set.grips.iter().filter_map(|grip| grip.force_needed).fold(f64::INFINITY, f64::min);
    // Of those that were not solved one may need a little less than the best in the order.
    let all = !set.summary.rejections.contains_key(OUTRANKED);
    let which = if all { "the best needs" } else { "the best of those solved needs" };
    let needs = match holding == 0 && best.is_finite() {
        true => format!(" ({which} {} N)", significant(best)),
        false => String::new(),
    };
    format!(
        "{holding} of {ranked} grips hold with the pads' {friction}{safety} at {force} N per \
         jaw{needs}"
    )
}

/// How many grips were not solved, where there are such.
pub(super) fn unsolved(set: &GripSet) -> Option<String> {
    let count = set.summary.rejections.get(OUTRANKED)?;
    let best = set.grips.len();
    Some(format!("{count} more were not solved: their bounds put them behind the best {best}"))
}

/// Why candidates fell and how many, the commonest first; nothing where none did.
pub(super) fn reasons(set: &GripSet) -> Option<String> {
    let mut reasons: Vec<_> =
        set.summary.rejections.iter().filter(|(reason, _)| *reason != OUTRANKED).collect();
    reasons.sort_by(|a, b| b.1.cmp(a.1));
    let texts =
        reasons.iter().map(|(reason, count)| format!("{count} {}", reason.replace('_', " ")));
    (!reasons.is_empty()).then(|| texts.collect::<Vec<_>>().join(", "))
}

/// The part: size, mesh and mass.
pub(super) fn part(set: &GripSet) -> String {
    let mass = &set.part.mass;
    let centre = tuple(&(mass.centre_of_mass * 1e3).to_array(), 2);
    format!("{}, {} kg, centre of mass {centre} mm", solid(set), kilograms(mass.mass))
}

/// The part without its mass.
pub(super) fn solid(set: &GripSet) -> String {
    let size = (set.part.bbox_max - set.part.bbox_min) * 1e3;
    format!(
        "{}: {} x {} x {} mm, {}",
        set.part.file,
        length(size.x),
        length(size.y),
        length(size.z),
        counted(set.part.triangles as u64, "triangle"),
    )
}

/// What a grip does with the force needed.
pub(super) fn usable(safety: f64) -> String {
    match safety {
        1.0 => "just holds".to_owned(),
        safety => format!("holds with a safety of {safety}"),
    }
}

/// Why no two faces come into question.
pub(super) fn no_pairs(rejections: &BTreeMap<String, u64>, gripper: &Gripper) -> String {
    let any = |reason: &str| rejections.contains_key(reason);
    let [least, most] = gripper.stroke.map(|end| end * 1e3);
    if any("face_pair_opening_too_small") {
        return format!(
            "opposite faces lie so near the end of the stroke of {least:.1} to {most:.1} mm that a jaw \
             opens by less than the least opening (--min-opening)"
        );
    }
    if any("face_pair_not_chosen") && !any("face_pair_outside_stroke") {
        return "no two of the faces chosen (--faces, --faces-in) are a pair: `gripfast part` lists \
                the pairs"
            .to_owned();
    }
    let stroke = format!("within the stroke of {least:.1} to {most:.1} mm");
    if any("face_pair_outside_stroke") {
        format!("no two opposite faces lie {stroke}")
    } else if any("bore_too_narrow_for_pads") {
        "the pads are too wide for the bores: half a pad may be 0.4 of a bore's radius wide"
            .to_owned()
    } else if any("face_pair_too_small") {
        "all faces that are opposite each other are too small for pads: those of a mesh may be \
         pieces of what is one face on the part (see `gripfast part`)"
            .to_owned()
    } else {
        format!("no two faces {stroke} come into question")
    }
}

/// A part that is smaller than the pads, as one is in a file of another unit than was taken.
pub(super) fn tiny(set: &GripSet, gripper: &Gripper) -> Option<String> {
    let size = set.part.bbox_max - set.part.bbox_min;
    let pad = gripper.pad_sizes()[0];
    (size.max_element() < pad.min_element()).then(|| {
        format!(
            "the whole part is {} x {} x {} mm, smaller than the pads ({} x {} mm): where its file is \
             in another unit, state that, e.g. --unit in, --unit cm or --unit m",
            length(size.x * 1e3),
            length(size.y * 1e3),
            length(size.z * 1e3),
            length(pad.x * 1e3),
            length(pad.y * 1e3),
        )
    })
}

/// A length in millimetres to 0.1 mm; to 0.01 mm where that tells more, and to two digits where it
/// is less than a millimetre.
fn length(mm: f64) -> String {
    let digits = if mm > 0.0 { (1.0 - mm.log10().floor()).clamp(1.0, 9.0) } else { 1.0 };
    let digits =
        if (mm * 10.0 - (mm * 10.0).round()).abs() < 0.05 { digits } else { digits.max(2.0) };
    format!("{mm:.*}", digits as usize)
}

/// A mass in kilograms to 0.1 g, or to three digits where it is less than 0.1 kg.
fn kilograms(mass: f64) -> String {
    let digits = if mass > 0.0 { (2.0 - mass.log10().floor()).clamp(4.0, 12.0) } else { 4.0 };
    format!("{mass:.*}", digits as usize)
}
