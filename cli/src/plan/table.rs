//! What a user of `plan` reads: a summary, the grips, and what was asked for besides.

use std::io::Write;

use comfy_table::{CellAlignment, Table, presets};
use gripfast::gripper::Gripper;
use gripfast::lab::compare::places_by_score;
use gripfast::model::{Slip, Status};
use gripfast::plan::OUTRANKED;
use gripfast::results::{Comparison, GripSet, RankedGrip};

/// A column: its name, whether numbers stand to the right, and the text of a grip.
type Column<'a> = (&'static str, bool, Box<dyn Fn(&RankedGrip) -> String + 'a>);

/// Summary and table; `shown` are grips of the set.
pub(super) fn print(
    out: &mut impl Write,
    set: &GripSet,
    shown: &[&RankedGrip],
    gripper: &Gripper,
) -> anyhow::Result<()> {
    summary(out, set, gripper)?;
    if set.grips.is_empty() {
        writeln!(out, "\nno grip holds this part: see the reasons above")?;
        if set.summary.pairs == 0 {
            writeln!(
                out,
                "no two opposite planar faces lie within the stroke of {:.1} to {:.1} mm",
                gripper.stroke[0] * 1e3,
                gripper.stroke[1] * 1e3
            )?;
        }
        return Ok(());
    }
    writeln!(out, "\n{}", grid(&columns(set, shown), shown))?;
    writeln!(
        out,
        "\nmu_s: smallest friction coefficient that holds the worst load. Slip centre from the grip's middle in the pad plane."
    )?;
    if let Some(friction) = set.provenance.resolved.pad_friction {
        writeln!(
            out,
            "Pads with a friction of {friction}: gripping force needed for the worst load, and the factor by which all of that load can grow (multiple)."
        )?;
    }
    writeln!(out, "Position of the grip's middle in the part frame.")?;
    if shown.iter().any(|grip| !grip.merged.is_empty()) {
        writeln!(
            out,
            "Rank (+n): stands for n more grips that a symmetry of the part maps to it (`merged` in the result file)."
        )?;
    }
    let selection = &set.provenance.request.selection;
    if let Some(noise) = selection.pose_noise {
        let (shift, turn, samples) =
            (noise.shift.0 * 1e3, noise.turn.0.to_degrees(), selection.noise_samples);
        writeln!(
            out,
            "Noise: mu_s at {samples} poses off by up to {shift} mm along both pad axes and {turn:.3} deg about the closing axis; 95 % of them hold\nwith the first, all with the second; lost: no contact or no equilibrium. Interference is not tested again."
        )?;
    }
    if let Some(comparison) = &set.summary.comparison {
        compared(out, set, comparison)?;
    }
    Ok(())
}

fn summary(out: &mut impl Write, set: &GripSet, gripper: &Gripper) -> std::io::Result<()> {
    let mass = &set.part.mass;
    let size = (set.part.bbox_max - set.part.bbox_min) * 1e3;
    writeln!(
        out,
        "{}: {:.1} x {:.1} x {:.1} mm, {} triangles, {:.4} kg, centre of mass ({:.2}, {:.2}, {:.2}) mm",
        set.part.file,
        size.x,
        size.y,
        size.z,
        set.part.triangles,
        mass.mass,
        mass.centre_of_mass.x * 1e3,
        mass.centre_of_mass.y * 1e3,
        mass.centre_of_mass.z * 1e3
    )?;
    writeln!(
        out,
        "{} at {} N, {} loads, {} face pairs, {} candidates, {} grips hold",
        gripper.name,
        set.provenance.resolved.force.0,
        set.loads.len(),
        set.summary.pairs,
        set.summary.candidates,
        set.summary.ranked
    )?;
    if let Some(outranked) = set.summary.rejections.get(OUTRANKED) {
        writeln!(
            out,
            "{outranked} more were not solved: their bounds put them behind the best {}",
            set.grips.len()
        )?;
    }
    let mut reasons: Vec<_> =
        set.summary.rejections.iter().filter(|(reason, _)| *reason != OUTRANKED).collect();
    if !reasons.is_empty() {
        reasons.sort_by(|a, b| b.1.cmp(a.1));
        writeln!(
            out,
            "rejected: {}",
            reasons
                .iter()
                .map(|(reason, count)| format!("{count} {}", reason.replace('_', " ")))
                .collect::<Vec<_>>()
                .join(", ")
        )?;
    }
    Ok(())
}

fn columns<'a>(set: &'a GripSet, shown: &[&RankedGrip]) -> Vec<Column<'a>> {
    let mut columns: Vec<Column<'a>> = vec![
        ("rank", true, Box::new(rank)),
        ("id", true, Box::new(|grip| grip.grip.id.to_string())),
        (
            "mu_s",
            true,
            Box::new(|grip| {
                format!(
                    "{}{}",
                    option(grip.worst.mu_s, 5),
                    if grip.worst.status == Status::Ambiguous { "?" } else { "" }
                )
            }),
        ),
        ("safety", true, Box::new(|grip| option(grip.safety, 2))),
        (
            "force needed",
            true,
            Box::new(|grip| {
                grip.force_needed.map_or_else(|| "-".into(), |force| format!("{force:.2} N"))
            }),
        ),
        ("multiple", true, Box::new(|grip| option(grip.load_multiple, 2))),
        ("worst load", false, Box::new(|grip| set.loads[grip.worst.load as usize].name.clone())),
        ("slip centre mm", false, Box::new(slip)),
        ("contact", true, Box::new(|grip| format!("{:.0} %", grip.contact_share * 100.0))),
        ("alpha", true, Box::new(|grip| format!("{:.1} deg", grip.alpha.to_degrees()))),
        ("score", true, Box::new(|grip| option(grip.score, 3))),
        (
            "width mm",
            true,
            Box::new(|grip| {
                format!(
                    "{}{:.2}",
                    if grip.grip.inside { "inside " } else { "" },
                    grip.grip.width * 1e3
                )
            }),
        ),
        (
            "position mm",
            false,
            Box::new(|grip| tuple(&(grip.grip.part_from_grip.origin * 1e3).to_array())),
        ),
    ];
    if shown.iter().any(|grip| grip.pose_noise.is_some()) {
        let lost =
            |value: Option<f64>| value.map_or_else(|| "lost".into(), |mu| format!("{mu:.5}"));
        columns.extend::<[Column<'a>; 3]>([
            (
                "noise 95 %",
                true,
                Box::new(move |grip| {
                    grip.pose_noise.map_or_else(|| "-".into(), |noise| lost(noise.mu_s_95))
                }),
            ),
            (
                "worst",
                true,
                Box::new(move |grip| {
                    grip.pose_noise.map_or_else(|| "-".into(), |noise| lost(noise.mu_s_worst))
                }),
            ),
            (
                "lost",
                true,
                Box::new(|grip| {
                    grip.pose_noise
                        .map_or_else(|| "-".into(), |noise| percent(noise.lost, noise.samples))
                }),
            ),
        ]);
    }
    if shown.iter().any(|grip| grip.earlier.is_some()) {
        columns.extend::<[Column<'a>; 2]>([
            (
                "earlier",
                true,
                Box::new(|grip| option(grip.earlier.as_ref().map(|earlier| earlier.evaluation), 3)),
            ),
            (
                "place",
                true,
                Box::new(|grip| {
                    grip.earlier
                        .as_ref()
                        .map_or_else(|| "-".into(), |earlier| earlier.place.to_string())
                }),
            ),
        ]);
    }
    columns
}

fn grid(columns: &[Column<'_>], shown: &[&RankedGrip]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(columns.iter().map(|column| column.0));
    for grip in shown {
        table.add_row(columns.iter().map(|column| (column.2)(grip)));
    }
    for (index, _) in columns.iter().enumerate().filter(|(_, column)| column.1) {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// How the earlier method orders the same grips, and where the two differ most.
fn compared(out: &mut impl Write, set: &GripSet, comparison: &Comparison) -> std::io::Result<()> {
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
    let columns: Vec<Column<'_>> = vec![
        ("id", true, Box::new(|grip| grip.grip.id.to_string())),
        (
            "place",
            true,
            Box::new(|grip| {
                find(&grip.grip.id).map_or_else(String::new, |(_, place)| place.to_string())
            }),
        ),
        (
            "earlier",
            true,
            Box::new(|grip| {
                grip.earlier.as_ref().map_or_else(String::new, |earlier| earlier.place.to_string())
            }),
        ),
        ("mu_s", true, Box::new(|grip| option(grip.worst.mu_s, 5))),
        (
            "earlier mu_s",
            true,
            Box::new(|grip| option(grip.earlier.as_ref().map(|earlier| earlier.mu_s), 5)),
        ),
        (
            "slip centre moved",
            true,
            Box::new(|grip| {
                moved(grip).map_or_else(|| "-".into(), |moved| format!("{:.2} mm", moved * 1e3))
            }),
        ),
        (
            "from centre of mass",
            true,
            Box::new(|grip| {
                grip.earlier
                    .as_ref()
                    .map_or_else(String::new, |earlier| format!("{:.2} mm", earlier.distance * 1e3))
            }),
        ),
        ("contact", true, Box::new(|grip| format!("{:.0} %", grip.contact_share * 100.0))),
        ("alpha", true, Box::new(|grip| format!("{:.1} deg", grip.alpha.to_degrees()))),
        ("worst load", false, Box::new(|grip| set.loads[grip.worst.load as usize].name.clone())),
    ];
    for (title, ids) in [
        ("ranked higher than by the earlier method", risen),
        ("ranked lower than by the earlier method", fallen),
    ] {
        let shown: Vec<&RankedGrip> =
            ids.iter().filter_map(|id| find(id).map(|(ranked, _)| ranked)).collect();
        if !shown.is_empty() {
            writeln!(out, "\n{title}:\n{}", grid(&columns, &shown))?;
        }
    }
    Ok(())
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
        Some(Slip::Rotation { c, .. }) => tuple(&[c[0] * 1e3, c[1] * 1e3]),
        Some(Slip::Translation { .. }) => "slides".into(),
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

/// Numbers to two places in brackets, without negative zeros.
fn tuple(numbers: &[f64]) -> String {
    let text = numbers
        .iter()
        .map(|x| format!("{x:.2}"))
        .map(|x| if x == "-0.00" { "0.00".into() } else { x })
        .collect::<Vec<_>>();
    format!("({})", text.join(", "))
}
