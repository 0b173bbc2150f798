//! The grips as a user of `plan` reads them, and what was asked for besides.

use std::collections::BTreeMap;
use std::io::Write;

use comfy_table::Table;
use glam::DVec3;
use gripfast::geometry::patch_area;
use gripfast::gripper::Gripper;
use gripfast::lab::compare::places_by_score;
use gripfast::mechanics::curved::{LARGE_TILT, Note, SoftLimit};
use gripfast::mechanics::squeeze_pressure;
use gripfast::model::{Contact, Slip, Status};
use gripfast::results::{Comparison, EarlierScore, ForceRange, GripSet, RankedGrip};
use gripfast::units::decimal;

use super::layout::{Column, fixed, grid, number, significant, tuple, words, wrapped};
use super::summary::{no_pairs, summary, tiny, usable};

/// Summary and table in lines of `width` signs; `shown` are grips of the set.
pub(super) fn print(
    out: &mut impl Write,
    set: &GripSet,
    shown: &[&RankedGrip],
    gripper: &Gripper,
    width: usize,
) -> anyhow::Result<()> {
    summary(out, set, gripper)?;
    if set.grips.is_empty() {
        if !set.provenance.complete {
            writeln!(out, "\nno grip was found before the search was interrupted")?;
            return Ok(());
        }
        writeln!(out, "\nno grip holds this part: see the reasons above")?;
        if set.summary.pairs == 0 {
            writeln!(out, "{}", no_pairs(&set.summary.rejections, gripper))?;
        }
        if let Some(text) = tiny(set, gripper) {
            writeln!(out, "{text}")?;
        }
        return Ok(());
    }
    if shown.is_empty() {
        return Ok(());
    }
    let (table, left_out) = grid(&columns(set, shown, gripper), shown, width);
    writeln!(out, "\n{table}\n")?;
    for text in legend(set, shown, gripper, &left_out, width) {
        writeln!(out, "{}", wrapped(&text, width))?;
    }
    if let Some(comparison) = &set.summary.comparison {
        compared(out, set, comparison, width)?;
    }
    Ok(())
}

/// What the columns mean, a paragraph each.
fn legend(
    set: &GripSet,
    shown: &[&RankedGrip],
    gripper: &Gripper,
    left_out: &[&str],
    width: usize,
) -> Vec<String> {
    let pads = set.pads();
    let has = |column: &str| !left_out.contains(&column);
    let place = if has("position mm") { " and position of the grip's middle" } else { "" };
    let mut texts = vec![format!(
        "mu_s: smallest friction coefficient that holds the worst load. pad: share of the pad that \
         touches; left: share of that contact left under the worst load. approach{place} in the \
         part frame."
    )];
    match pads.value {
        Some(friction) => {
            let usable = usable(pads.safety);
            let multiple = match has("multiple") {
                true => " multiple: factor by which all loads can grow.",
                false => "",
            };
            texts.push(format!(
                "safety: the pads' friction {friction} over mu_s; a grip holds where it is at least \
                 {}. force N: gripping force per jaw with which it {usable} under every load{}.\
                 {multiple}",
                pads.safety,
                range_note(set, shown, gripper)
            ));
        }
        None => texts.push(
            "safety, force needed: not known without the friction of the pads (--pad-friction)."
                .to_owned(),
        ),
    }
    let limited = set.provenance.request.scoring.max_pressure.is_some();
    if limited || shown.iter().any(|grip| grip.grip.surfaces.is_some()) {
        texts.push(
            "contact: pressed area of the face where it is smaller, MPa: greatest pressure, both of \
             the squeeze without a load."
                .to_owned(),
        );
    }
    if shown.iter().any(|grip| !grip.merged.is_empty()) {
        texts.push(
            "Rank (+n): stands for n more grips that a symmetry of the part maps to it (`merged` in \
             the result file)."
                .to_owned(),
        );
    }
    if has("turns") && turns(set).is_some() {
        texts.push(
            "turns: the part is round; this many of the grips kept are this one turned about its \
             axis, and the others need as much friction or more (--every-turn lists them all)."
                .to_owned(),
        );
    }
    let selection = &set.provenance.request.selection;
    if let Some(noise) = selection.pose_noise {
        let (shift, turn, samples) =
            (noise.shift.0 * 1e3, noise.turn.0.to_degrees(), selection.noise_samples);
        texts.push(format!(
            "Noise: mu_s at {samples} poses off by up to {shift} mm along both pad axes and {turn:.3} \
             deg about the closing axis; 95 % of them hold with the first, all with the second; lost: \
             no contact or no equilibrium. Interference is not tested again."
        ));
    }
    texts.extend(cautions(shown));
    if !left_out.is_empty() {
        texts.push(format!("Left out to fit {width} columns: {}.", left_out.join(", ")));
    }
    texts
}

/// What to know of the grips shown beside their numbers, where they are near the end of what the theory
/// knows: ranks and the worst value of each kind.
fn cautions(shown: &[&RankedGrip]) -> Vec<String> {
    // Ranks, and the largest value.
    let of = |value: &dyn Fn(&Note) -> Option<f64>| {
        let found: Vec<(u64, f64)> = shown
            .iter()
            .filter_map(|grip| {
                let worst = grip.notes.iter().filter_map(value).reduce(f64::max)?;
                Some((grip.rank, worst))
            })
            .collect();
        let worst = found.iter().map(|grip| grip.1).reduce(f64::max)?;
        Some((ranks(found.iter().map(|grip| grip.0)), worst))
    };
    let soft = of(&|note| match note {
        Note::TooSoft { limit: SoftLimit::Compression, value, .. } => Some(*value),
        _ => None,
    });
    let unstable = of(&|note| match note {
        Note::Unstable { .. } => Some(0.0),
        _ => None,
    });
    let edge = of(&|note| match note {
        Note::OverEdge { force } => Some(force.abs()),
        _ => None,
    });
    let tilts = of(&|note| match note {
        Note::TiltsFirst { angle, .. } => Some(*angle),
        _ => None,
    });
    let mut texts = Vec::new();
    if let Some((ranks, most)) = soft {
        let beyond = if most < 1.0 { "" } else { " (more than there is: the pad bottoms out)" };
        texts.push(format!(
            "Soft: under rank {ranks} a pad's layer is compressed by up to {:.0} % of its \
             thickness{beyond}; mu_s is reliable up to a third. Less force (--force) or a stiffer pad \
             helps.",
            100.0 * most
        ));
    }
    if let Some((ranks, _)) = unstable {
        texts.push(format!(
            "Unstable: in rank {ranks} friction alone keeps the part from rolling out of the grip (see \
             `gripfast why`)."
        ));
    }
    if let Some((ranks, most)) = edge {
        texts.push(format!(
            "Pushed aside: in rank {ranks} a pad ends on a round face and pushes the part off sideways with \
             up to {most:.2} N, which friction bears."
        ));
    }
    if let Some((ranks, most)) = tilts {
        let beyond =
            if most > LARGE_TILT { "; tilts over 6 deg are beyond the theory" } else { "" };
        texts.push(format!(
            "Tilts: in rank {ranks} the part tilts by up to {:.1} deg before it slips under the worst \
             load, more than its pads give{beyond}.",
            most.to_degrees()
        ));
    }
    texts
}

/// Runs of ranks that are told one by one.
const RUNS: usize = 8;

/// Rising ranks as a text, those in a row by their ends, and how many more there are.
fn ranks(all: impl Iterator<Item = u64>) -> String {
    let mut runs: Vec<[u64; 2]> = Vec::new();
    for rank in all {
        match runs.last_mut() {
            Some(run) if run[1] + 1 == rank => run[1] = rank,
            _ => runs.push([rank; 2]),
        }
    }
    let texts = runs.iter().take(RUNS).map(|[first, last]| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first} to {last}"),
    });
    let told = texts.collect::<Vec<_>>().join(", ");
    let more: u64 = runs.iter().skip(RUNS).map(|[first, last]| last - first + 1).sum();
    if more == 0 { told } else { format!("{told} and {more} more") }
}

/// What the marks behind forces mean, where there are any.
fn range_note(set: &GripSet, shown: &[&RankedGrip], gripper: &Gripper) -> String {
    let is = |range| shown.iter().any(|grip| set.force_range(grip) == Some(range));
    let [least, most] = gripper.force.map(|force| decimal(force, 3));
    let above = format!("+ more than the gripper's {most} N");
    let below = format!("- less than its least, {least} N");
    match (is(ForceRange::Above), is(ForceRange::Below)) {
        (true, true) => format!(" ({above}, {below})"),
        (true, false) => format!(" ({above})"),
        (false, true) => format!(" ({below})"),
        (false, false) => String::new(),
    }
}

fn columns<'a>(set: &'a GripSet, shown: &[&RankedGrip], gripper: &'a Gripper) -> Vec<Column<'a>> {
    let mut columns =
        vec![number("rank", 0, rank), number("id", 0, |grip| grip.grip.id.to_string())];
    if let Some(turns) = turns(set) {
        let count = move |grip: &RankedGrip| turns.get(&grip.grip.id).map_or(1, |count| *count);
        columns.push(number("turns", 3, move |grip| count(grip).to_string()));
    }
    if shown.iter().any(|grip| set.verdict(grip).holds() == Some(false)) {
        columns.push(words("verdict", 0, |grip| set.verdict(grip).name().to_owned()));
    }
    columns.extend(measures(set, gripper));
    let limited = set.provenance.request.scoring.max_pressure.is_some();
    if limited || shown.iter().any(|grip| grip.grip.surfaces.is_some()) {
        let force = set.provenance.resolved.force.0;
        columns.extend([
            number("contact mm2", 2, |grip| {
                let Contact { face_i, face_ii } = &*grip.grip.contact;
                significant(patch_area(face_i).min(patch_area(face_ii)) * 1e6)
            }),
            number("MPa", 1, move |grip| {
                let pressure = squeeze_pressure(&grip.grip, force);
                pressure.map_or_else(|| "-".into(), |pressure| significant(pressure / 1e6))
            }),
        ]);
    }
    columns.extend([
        number("width mm", 2, |grip| {
            let side = if grip.grip.inside { "inside " } else { "" };
            format!("{side}{:.2}", grip.grip.width * 1e3)
        }),
        words("position mm", 5, |grip| {
            tuple(&(grip.grip.part_from_grip.origin * 1e3).to_array(), 1)
        }),
        words("worst load", 6, |grip| set.loads[grip.worst.load as usize].name.clone()),
        words("slip centre mm", 7, slip),
        number("alpha", 9, |grip| format!("{:.1} deg", grip.alpha.to_degrees())),
        number("score", 8, |grip| option(grip.score, 3)),
    ]);
    if shown.iter().any(|grip| grip.pose_noise.is_some()) {
        let lost =
            |value: Option<f64>| value.map_or_else(|| "lost".into(), |mu| format!("{mu:.5}"));
        let of = |grip: &RankedGrip, value: &dyn Fn(&gripfast::results::PoseNoise) -> String| {
            grip.pose_noise.as_ref().map_or_else(|| "-".into(), value)
        };
        columns.extend([
            number("noise 95 %", 1, move |grip| of(grip, &|noise| lost(noise.mu_s_95))),
            number("worst", 1, move |grip| of(grip, &|noise| lost(noise.mu_s_worst))),
            number("lost", 1, move |grip| of(grip, &|noise| percent(noise.lost, noise.samples))),
        ]);
    }
    if shown.iter().any(|grip| grip.earlier.is_some()) {
        columns.extend([
            number("earlier", 1, |grip| {
                option(grip.earlier.as_ref().map(|earlier| earlier.evaluation), 3)
            }),
            number("place", 1, |grip| {
                let place = grip.earlier.as_ref().map(|earlier| earlier.place.to_string());
                place.unwrap_or_else(|| "-".into())
            }),
        ]);
    }
    columns
}

/// How well a grip holds, from where, and with how much of the pad.
pub(super) fn measures<'a>(set: &'a GripSet, gripper: &'a Gripper) -> Vec<Column<'a>> {
    let ambiguous = |grip: &RankedGrip| match grip.worst.status {
        Status::Ambiguous => "?",
        _ => "",
    };
    vec![
        number("mu_s", 0, move |grip| format!("{}{}", option(grip.worst.mu_s, 5), ambiguous(grip))),
        number("safety", 0, |grip| option(grip.safety, 2)),
        number("force N", 0, |grip| {
            let mark = match set.force_range(grip) {
                Some(ForceRange::Above) => "+",
                Some(ForceRange::Below) => "-",
                _ => "",
            };
            format!("{}{mark}", option(grip.force_needed, 2))
        }),
        number("multiple", 4, |grip| option(grip.load_multiple, 2)),
        words("approach", 0, |grip| direction(grip.grip.part_from_grip.rotation.x_axis)),
        number("pad", 1, |grip| share(gripper.pad_share(&grip.grip.contact))),
        number("left", 3, |grip| share(grip.contact_share)),
    ]
}

/// A direction as `--approach` takes it, to two places.
fn direction(direction: DVec3) -> String {
    for (axis, name) in [(DVec3::X, 'x'), (DVec3::Y, 'y'), (DVec3::Z, 'z')] {
        let along = direction.dot(axis);
        if along.abs() > 1.0 - 1e-6 {
            return format!("{}{name}", if along > 0.0 { '+' } else { '-' });
        }
    }
    direction.to_array().map(|x| fixed(x, 2)).join("/")
}

fn share(value: f64) -> String {
    format!("{:.0} %", value * 100.0)
}

/// How the earlier method orders the same grips, and where the two differ most.
fn compared(
    out: &mut impl Write,
    set: &GripSet,
    comparison: &Comparison,
    width: usize,
) -> std::io::Result<()> {
    let Comparison { grips, k1, k2, k3, epsilon_m, spearman, kendall_tau_b, risen, fallen } =
        comparison;
    writeln!(
        out,
        "\nEarlier method (slip centre at the centroid): ({k1} Delta_d + {k2} tau_s/(mu_s N))/(D + {} mm) + {k3} alpha",
        epsilon_m * 1e3
    )?;
    match (spearman, kendall_tau_b) {
        (Some(spearman), Some(kendall)) => {
            writeln!(
                out,
                "rank correlation with the score over the {grips} grips kept: Spearman {spearman:.4}, Kendall tau-b {kendall:.4}"
            )?;
        }
        _ => writeln!(
            out,
            "rank correlation over the {grips} grips kept: none, as all of them tie in one of the orders"
        )?,
    }
    if *grips < set.summary.ranked {
        writeln!(out, "({} grips hold; raise --keep to compare more of them)", set.summary.ranked)?;
    }
    let places = places_by_score(&set.grips);
    let find = |id: &u64| set.grips.iter().zip(&places).find(|(ranked, _)| ranked.grip.id == *id);
    let place = |grip: &RankedGrip| {
        find(&grip.grip.id).map_or_else(String::new, |(_, place)| place.to_string())
    };
    let columns = differing(set, &place);
    for (title, ids) in [
        ("ranked higher than by the earlier method", risen),
        ("ranked lower than by the earlier method", fallen),
    ] {
        let shown: Vec<&RankedGrip> =
            ids.iter().filter_map(|id| find(id).map(|(ranked, _)| ranked)).collect();
        if !shown.is_empty() {
            let table: Table = grid(&columns, &shown, width).0;
            writeln!(out, "\n{title}:\n{table}")?;
        }
    }
    Ok(())
}

/// Columns of grips that the earlier method places elsewhere.
fn differing<'a>(set: &'a GripSet, place: &'a dyn Fn(&RankedGrip) -> String) -> Vec<Column<'a>> {
    let earlier = |grip: &RankedGrip, text: &dyn Fn(&EarlierScore) -> String| {
        grip.earlier.as_ref().map_or_else(String::new, text)
    };
    vec![
        number("id", 0, |grip| grip.grip.id.to_string()),
        number("place", 0, place),
        number("earlier", 0, move |grip| earlier(grip, &|score| score.place.to_string())),
        number("mu_s", 0, |grip| option(grip.worst.mu_s, 5)),
        number("earlier mu_s", 0, move |grip| earlier(grip, &|score| option(Some(score.mu_s), 5))),
        number("slip centre moved", 0, |grip| {
            moved(grip).map_or_else(|| "-".into(), |moved| format!("{:.2} mm", moved * 1e3))
        }),
        number("from centre of mass", 3, move |grip| {
            earlier(grip, &|score| format!("{:.2} mm", score.distance * 1e3))
        }),
        number("left", 4, |grip| share(grip.contact_share)),
        number("alpha", 5, |grip| format!("{:.1} deg", grip.alpha.to_degrees())),
        words("worst load", 2, |grip| set.loads[grip.worst.load as usize].name.clone()),
    ]
}

/// How far the slip centre lies from where the earlier method puts it \[m\]; infinite for a
/// translation.
fn moved(grip: &RankedGrip) -> Option<f64> {
    let [x, y] = grip.earlier.as_ref()?.slip_centre;
    match grip.worst.slip? {
        Slip::Rotation { c, .. } => Some((c[0] - x).hypot(c[1] - y)),
        Slip::Translation { .. } => Some(f64::INFINITY),
        Slip::Spin { .. } | Slip::None => None,
    }
}

/// How many grips of the set are one turned about the axis of a round part, by the id of the best
/// of them; where one is shown for all.
fn turns(set: &GripSet) -> Option<BTreeMap<u64, usize>> {
    if set.part.symmetry.is_none() || set.provenance.request.selection.every_turn {
        return None;
    }
    let mut turns = BTreeMap::new();
    gripfast::rank::turned(set).into_iter().for_each(|id| *turns.entry(id).or_default() += 1);
    turns.values().any(|count| *count > 1).then_some(turns)
}

fn rank(grip: &RankedGrip) -> String {
    if grip.merged.is_empty() {
        grip.rank.to_string()
    } else {
        format!("{} (+{})", grip.rank, grip.merged.len())
    }
}

/// A slip centre farther off than this \[m\] is no different from a translation to anybody who reads
/// a table.
const SLIDES: f64 = 1e3;

fn slip(grip: &RankedGrip) -> String {
    match grip.worst.slip {
        Some(Slip::Rotation { c, .. }) if c[0].hypot(c[1]) > SLIDES => "slides".into(),
        Some(Slip::Rotation { c, .. }) => tuple(&[c[0] * 1e3, c[1] * 1e3], 2),
        Some(Slip::Translation { .. }) => "slides".into(),
        Some(Slip::Spin { .. }) if grip.slides() => "slides".into(),
        Some(Slip::Spin { rolls_on: Some(_), .. }) => "rolls".into(),
        Some(Slip::Spin { .. }) => "spins".into(),
        _ => "-".into(),
    }
}

fn option(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_string(), |value| format!("{value:.digits$}"))
}

fn percent(count: u32, all: u32) -> String {
    format!("{:.1} %", f64::from(count) / f64::from(all) * 100.0)
}
