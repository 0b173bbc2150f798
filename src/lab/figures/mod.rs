//! The paper's figures, computed again: each a drawing and a table.
//!
//! [`all`] runs the studies; `docs/figures.md` says what of the paper they confirm.

mod draw;
pub mod prism;
pub mod shapes;
pub mod studies;

use crate::error::Result;
use studies::Trend;

/// A figure with its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// File name without suffix.
    pub name: &'static str,
    /// What it shows, in a line.
    pub title: &'static str,
    /// The drawing, an SVG document.
    pub svg: String,
    /// Column names of the table, with units.
    pub columns: Vec<&'static str>,
    /// The table: one text per column.
    pub rows: Vec<Vec<String>>,
    /// What came out, in a line or two.
    pub finding: String,
}

/// A number for a table: ten significant digits, which every machine agrees on.
fn number(value: f64) -> String {
    format!("{value:.9e}")
        .parse::<f64>()
        .map_or_else(|_| value.to_string(), |rounded| rounded.to_string())
}

/// All figures, in the order of the paper's sections.
///
/// # Errors
/// Never for the inputs that the studies choose; passed on from the solver and the drawing.
pub fn all() -> Result<Vec<Figure>> {
    Ok(vec![separation()?, figure_4()?, figure_5()?, figure_6()?, distance()?, prism::figure()?])
}

fn figure_5() -> Result<Figure> {
    let rows = studies::figure_5()?;
    let ratio = |shape: &str, parameter: f64| {
        rows.iter()
            .find(|row| row.shape == shape && (row.parameter - parameter).abs() < 1e-9)
            .map_or(f64::NAN, |row| row.ratio)
    };
    let finding = format!(
        "Against the square, a hole of half its side needs {:+.1} % friction, a cross with arms of a third {:+.1} %.",
        100.0 * (ratio("hollow", 0.5) - 1.0),
        100.0 * (ratio("cross", 1.0 / 3.0) - 1.0)
    );
    let table = rows.iter().map(|row| {
        vec![
            row.shape.into(),
            number(row.parameter),
            number(row.area_share),
            number(row.mu_s),
            number(row.ratio),
        ]
    });
    Ok(Figure {
        name: "figure5",
        title: "Contact shapes under a moment about the closing axis",
        svg: draw::figure_5(&rows)?,
        columns: vec![
            "shape",
            "hole_side_or_arm_width_over_side",
            "area_share",
            "mu_s",
            "ratio_to_square",
        ],
        rows: table.collect(),
        finding,
    })
}

fn figure_6() -> Result<Figure> {
    let rows = studies::figure_6()?;
    let at = |distance: f64| rows.iter().find(|row| (row.distance - distance).abs() < 1e-9);
    let finding = [0.0, 0.01, 0.1]
        .iter()
        .filter_map(|&distance| at(distance))
        .map(|row| {
            format!(
                "{} mm: {:.5} (earlier method {:.5})",
                number(1e3 * row.distance),
                row.new,
                row.old
            )
        })
        .collect::<Vec<_>>()
        .join(", ");
    let table =
        rows.iter().map(|row| vec![number(1e3 * row.distance), number(row.new), number(row.old)]);
    Ok(Figure {
        name: "figure6",
        title: "A bar gripped at a distance from its centre of mass: both methods",
        svg: draw::figure_6(&rows)?,
        columns: vec!["distance_mm", "mu_s", "mu_s_earlier_method"],
        rows: table.collect(),
        finding: format!("mu_s at {finding}."),
    })
}

fn figure_4() -> Result<Figure> {
    let rows = studies::figure_4()?;
    let ends = [rows.first(), rows.last()]
        .map(|row| row.map_or((f64::NAN, f64::NAN), |row| (row.moment, row.angle.to_degrees())));
    let table = rows.iter().map(|row| {
        vec![
            number(row.moment),
            number(row.angle.to_degrees()),
            number(row.mu_s),
            number(row.contact_share),
        ]
    });
    Ok(Figure {
        name: "figure4",
        title: "The line of separation turns with the moment about the closing axis",
        svg: draw::figure_4(&rows)?,
        columns: vec!["M3_Nm", "angle_deg", "mu_s", "contact_share"],
        rows: table.collect(),
        finding: format!(
            "It turns by {:.2} deg at {} N m and {:.1} deg at {} N m.",
            ends[0].1, ends[0].0, ends[1].1, ends[1].0
        ),
    })
}

fn distance() -> Result<Figure> {
    let sweeps = studies::distance_sweeps()?;
    let count = |trend: Trend| sweeps.iter().filter(|sweep| sweep.trend == trend).count();
    let fall = |sweep: &studies::DistanceSweep| {
        1.0 - sweep.points.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min)
            / sweep.points[0][1]
    };
    let deepest =
        sweeps.iter().filter(|sweep| sweep.trend == Trend::Down).map(fall).fold(0.0, f64::max);
    let finding = format!(
        "Of {} sweeps of the distance, mu_s stays in {}, rises in {}, falls in {} (by {:.1} % at most), does both in {}.",
        sweeps.len(),
        count(Trend::Constant),
        count(Trend::Up),
        count(Trend::Down),
        100.0 * deepest,
        count(Trend::Mixed)
    );
    let table = sweeps.iter().map(|sweep| {
        let values = || sweep.points.iter().map(|point| point[1]);
        let last = sweep.points.last().copied().unwrap_or([f64::NAN; 3]);
        let first = sweep.points.first().copied().unwrap_or([f64::NAN; 3]);
        vec![
            sweep.shape.into(),
            number(sweep.moment_share),
            sweep.load.into(),
            format!("{:?}", sweep.trend).to_lowercase(),
            number(first[1]),
            number(values().fold(f64::INFINITY, f64::min)),
            number(values().fold(0.0, f64::max)),
            number(last[0]),
            number(last[1]),
            number(first[2]),
            number(last[2]),
            sweep.ambiguous.to_string(),
        ]
    });
    Ok(Figure {
        name: "distance",
        title: "mu_s and contact against the distance between the faces",
        svg: draw::distance(&sweeps)?,
        columns: vec![
            "shape",
            "moment_over_twist_out",
            "load_in_plane",
            "trend",
            "mu_s_at_0",
            "mu_s_least",
            "mu_s_most",
            "last_distance_over_side",
            "mu_s_at_last",
            "contact_share_at_0",
            "contact_share_at_last",
            "ambiguous_distances",
        ],
        rows: table.collect(),
        finding,
    })
}

fn separation() -> Result<Figure> {
    let sweeps = studies::separation_sweeps()?;
    let falls = sweeps
        .iter()
        .filter(|sweep| sweep.points.windows(2).all(|pair| pair[1].1 <= pair[0].1 + 1e-12))
        .count();
    let rounds = |share: f64| {
        sweeps
            .iter()
            .flat_map(|sweep| &sweep.points)
            .filter(|point| point.0 <= share)
            .map(|point| point.2)
            .max()
            .unwrap_or(0)
    };
    let finding = format!(
        "Contact never grows with the moment in {falls} of {} sweeps; clipping and solving again settles in at most {} rounds up to 0.9 of twist-out, {} at 0.999.",
        sweeps.len(),
        rounds(0.9),
        rounds(1.0)
    );
    let table = sweeps.iter().flat_map(|sweep| {
        sweep.points.iter().map(|&(share, left, rounds)| {
            vec![
                sweep.shape.into(),
                number(sweep.direction.to_degrees()),
                number(share),
                number(left),
                rounds.to_string(),
            ]
        })
    });
    Ok(Figure {
        name: "separation",
        title: "Contact left under an out-of-plane moment",
        svg: draw::separation(&sweeps)?,
        columns: vec![
            "shape",
            "direction_deg",
            "moment_over_twist_out",
            "contact_share",
            "rounds_of_clip_and_solve",
        ],
        rows: table.collect(),
        finding,
    })
}
