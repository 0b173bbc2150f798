//! The figures as SVG, by plotters.

use std::ops::Range;

use glam::DVec2;
use plotters::coord::Shift;
use plotters::prelude::*;

use super::prism::{FACES, PrismRow};
use super::shapes;
use super::studies::{
    BAR_MASS, BarRow, DistanceSweep, FORCE, LINE_SHARE, LineRow, SHAPE_MOMENT, SIDE,
    SeparationSweep, ShapeRow, Trend,
};
use crate::error::{Error, Result};
use crate::model::Patch;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Outcome = std::result::Result<(), DrawingAreaErrorKind<std::io::Error>>;

// Colours that remain apart for colour-blind readers (Okabe and Ito).
const BLUE: RGBColor = RGBColor(0, 114, 178);
const ORANGE: RGBColor = RGBColor(213, 94, 0);
const GREEN: RGBColor = RGBColor(0, 158, 115);
const PURPLE: RGBColor = RGBColor(204, 121, 167);
const SKY: RGBColor = RGBColor(86, 180, 233);
const AMBER: RGBColor = RGBColor(230, 159, 0);
const INK: RGBColor = RGBColor(40, 40, 40);
const PAPER: RGBColor = RGBColor(255, 255, 255);
const GRID: RGBColor = RGBColor(228, 228, 228);
const SHAPE: RGBColor = RGBColor(205, 220, 232);

const FONT: &str = "sans-serif";

/// Drawing units per pixel: plotters rounds to whole units, which shows as steps in a curve drawn
/// at one.
const FINE: i32 = 8;
const FINE_U: u32 = FINE as u32;

/// A drawing of the given size [px].
fn svg((width, height): (u32, u32), draw: impl FnOnce(&Area<'_>) -> Outcome) -> Result<String> {
    let mut text = String::new();
    let (fine_width, fine_height) = (width * FINE_U, height * FINE_U);
    {
        let root =
            SVGBackend::with_string(&mut text, (fine_width, fine_height)).into_drawing_area();
        let drawn = root.fill(&PAPER).and_then(|()| draw(&root)).and_then(|()| root.present());
        drawn.map_err(|error| Error::input("figure", error.to_string(), "report this"))?;
    }
    // Shown at its real size; the view box keeps the fine units.
    let fine = format!("width=\"{fine_width}\" height=\"{fine_height}\" viewBox");
    Ok(text.replacen(&fine, &format!("width=\"{width}\" height=\"{height}\" viewBox"), 1))
}

/// One curve of a chart.
struct Curve<'a> {
    label: &'a str,
    colour: RGBColor,
    width: u32,
    points: Vec<(f64, f64)>,
}

/// Titles and ranges of a chart.
struct Axes<'a> {
    title: &'a str,
    x: (&'a str, Range<f64>),
    y: (&'a str, Range<f64>),
    legend: SeriesLabelPosition,
}

fn chart(area: &Area<'_>, axes: Axes<'_>, curves: &[Curve<'_>]) -> Outcome {
    text(area, axes.title, (f64::from(area.dim_in_pixel().0) / f64::from(2 * FINE), 14.0), 16)?;
    let mut chart = ChartBuilder::on(area)
        .margin(14 * FINE)
        .margin_top(42 * FINE)
        .x_label_area_size(46 * FINE)
        .y_label_area_size(62 * FINE)
        .build_cartesian_2d(axes.x.1, axes.y.1)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.stroke_width(FINE_U))
        .axis_style(INK.stroke_width(FINE_U))
        .set_all_tick_mark_size(5 * FINE)
        .x_desc(axes.x.0)
        .y_desc(axes.y.0)
        .label_style((FONT, 13 * FINE, &INK))
        .axis_desc_style((FONT, 14 * FINE, &INK))
        .draw()?;
    for curve in curves {
        let style = ShapeStyle::from(curve.colour).stroke_width(curve.width * FINE_U);
        let series = chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
        if !curve.label.is_empty() {
            series
                .label(curve.label)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 20 * FINE, y)], style));
        }
    }
    if curves.iter().any(|curve| !curve.label.is_empty()) {
        chart
            .configure_series_labels()
            .position(axes.legend)
            .background_style(PAPER.mix(0.85))
            .border_style(GRID.stroke_width(FINE_U))
            .legend_area_size(30 * FINE)
            .margin(10 * FINE)
            .label_font((FONT, 13 * FINE, &INK))
            .draw()?;
    }
    Ok(())
}

/// A contact shape with its caption, in a square panel.
fn shape_panel(area: &Area<'_>, patch: &Patch, title: &str, caption: &str) -> Outcome {
    let width = f64::from(area.dim_in_pixel().0) / f64::from(FINE);
    let scale = 0.62 * width / SIDE;
    let at = |x: DVec2| fine(width / 2.0 + scale * x.x, 38.0 + 0.31 * width - scale * x.y);
    for polygon in patch {
        for (ring, fill) in std::iter::once((&polygon.outer, SHAPE))
            .chain(polygon.holes.iter().map(|hole| (hole, PAPER)))
        {
            let mut points: Vec<(i32, i32)> = ring.iter().map(|&x| at(x)).collect();
            area.draw(&Polygon::new(points.clone(), fill.filled()))?;
            points.extend_from_within(..2);
            area.draw(&PathElement::new(points, INK.stroke_width(2 * FINE_U)))?;
        }
    }
    text(area, title, (width / 2.0, 12.0), 15)?;
    text(area, caption, (width / 2.0, 48.0 + 0.62 * width), 14)
}

/// Pixels in drawing units.
fn fine(x: f64, y: f64) -> (i32, i32) {
    ((f64::from(FINE) * x).round() as i32, (f64::from(FINE) * y).round() as i32)
}

/// Text centred below a point given in pixels.
fn text(area: &Area<'_>, text: &str, (x, y): (f64, f64), size: i32) -> Outcome {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    let style = TextStyle::from((FONT, size * FINE).into_font())
        .color(&INK)
        .pos(Pos::new(HPos::Center, VPos::Top));
    area.draw(&Text::new(text.to_owned(), fine(x, y), style))
}

/// Figure 5: the three shapes with their friction coefficients, and the two families of shapes.
pub(super) fn figure_5(rows: &[ShapeRow]) -> Result<String> {
    svg((900, 700), |root| {
        let (top, bottom) = root.split_vertically(270 * FINE);
        let panels = top.split_evenly((1, 3));
        let near = |shape: &str, parameter: f64| {
            rows.iter().find(|row| row.shape == shape && (row.parameter - parameter).abs() < 1e-9)
        };
        let shown = [
            ("a: square", shapes::square(SIDE), near("square", 0.0)),
            ("b: hollow square, hole 1/2", shapes::hollow(SIDE, 0.5), near("hollow", 0.5)),
            ("c: cross, arms 1/3", shapes::cross(SIDE, 1.0 / 3.0), near("cross", 1.0 / 3.0)),
        ];
        for (panel, (title, patch, row)) in panels.iter().zip(shown) {
            let caption = row.map_or(String::new(), |row| {
                format!("mu_s = {:.4} ({:+.1} %)", row.mu_s, 100.0 * (row.ratio - 1.0))
            });
            shape_panel(panel, &patch, title, &caption)?;
        }
        let curve = |shape: &str, label, colour| Curve {
            label,
            colour,
            width: 3,
            points: rows
                .iter()
                .filter(|row| row.shape == shape)
                .map(|row| (row.parameter, row.ratio))
                .collect(),
        };
        let title = format!(
            "mu_s over the square's, under a moment of {SHAPE_MOMENT} N m about the closing axis ({FORCE} N, side 20 mm)"
        );
        let axes = Axes {
            title: &title,
            x: ("side of the hole, or width of the arms, over the side of the square", 0.0..1.0),
            y: ("mu_s / mu_s of the square", 0.6..1.6),
            legend: SeriesLabelPosition::UpperRight,
        };
        let square =
            Curve { label: "square", colour: INK, width: 1, points: vec![(0.0, 1.0), (1.0, 1.0)] };
        chart(
            &bottom,
            axes,
            &[square, curve("hollow", "hollow square", BLUE), curve("cross", "cross", ORANGE)],
        )
    })
}

/// Figure 6: both methods against the distance from the centre of mass.
pub(super) fn figure_6(rows: &[BarRow]) -> Result<String> {
    svg((820, 520), |root| {
        let curve = |label, colour, width, value: fn(&BarRow) -> f64| Curve {
            label,
            colour,
            width,
            points: rows.iter().map(|row| (1e3 * row.distance, value(row))).collect(),
        };
        let title = format!("{BAR_MASS} kg bar, square pads of 20 mm, {FORCE} N");
        let axes = Axes {
            title: &title,
            x: ("distance of the grip from the centre of mass [mm]", 0.0..100.0),
            y: ("mu_s", 0.0..0.7),
            legend: SeriesLabelPosition::UpperLeft,
        };
        chart(
            root,
            axes,
            &[
                curve("slip centre at the centroid (earlier method)", ORANGE, 4, |row| row.old),
                curve("true slip centre", BLUE, 2, |row| row.new),
            ],
        )
    })
}

/// Figure 4: the lines of zero pressure on face I, and their angle.
pub(super) fn figure_4(rows: &[LineRow]) -> Result<String> {
    svg((960, 500), |root| {
        let (left, right) = root.split_horizontally(420 * FINE);
        let scale = 300.0 / SIDE;
        let at = |x: DVec2| fine(210.0 + scale * x.x, 240.0 - scale * x.y);
        let pad = &shapes::square(SIDE)[0].outer;
        left.draw(&Polygon::new(pad.iter().map(|&x| at(x)).collect::<Vec<_>>(), SHAPE.filled()))?;
        let shown = [0.01, 0.2, 0.4, 0.6, 0.8];
        let colours = [INK, BLUE, GREEN, AMBER, ORANGE];
        text(&left, "face I: the pad is lifted below each line", (210.0, 40.0), 15)?;
        text(&left, "axis of the out-of-plane moment: horizontal", (210.0, 402.0), 13)?;
        for (moment, colour) in shown.iter().zip(colours) {
            let Some(row) = rows.iter().find(|row| (row.moment - moment).abs() < 1e-9) else {
                continue;
            };
            if let Some([a, b]) = zero_line(row.pressure) {
                left.draw(&PathElement::new([at(a), at(b)], colour.stroke_width(3 * FINE_U)))?;
            }
        }
        let mut outline: Vec<_> = pad.iter().map(|&x| at(x)).collect();
        outline.extend_from_within(..2);
        left.draw(&PathElement::new(outline, INK.stroke_width(2 * FINE_U)))?;
        for (k, (moment, colour)) in shown.iter().zip(colours).enumerate() {
            let x = 44.0 + 76.0 * k as f64;
            left.draw(&PathElement::new(
                [fine(x, 444.0), fine(x + 20.0, 444.0)],
                colour.stroke_width(3 * FINE_U),
            ))?;
            text(&left, &format!("{moment} N m"), (x + 10.0, 452.0), 12)?;
        }
        let title = format!("M1 = {LINE_SHARE} of twist-out, faces one side apart, {FORCE} N");
        let axes = Axes {
            title: &title,
            x: ("moment about the closing axis M3 [N m]", 0.0..0.8),
            y: ("angle of the separation line from the axis of M1 [deg]", 0.0..60.0),
            legend: SeriesLabelPosition::UpperLeft,
        };
        let points = rows.iter().map(|row| (row.moment, row.angle.to_degrees())).collect();
        chart(&right, axes, &[Curve { label: "", colour: BLUE, width: 3, points }])
    })
}

/// Where the line `p = 0` crosses the boundary of the square pad.
fn zero_line([a0, a1, a2]: [f64; 3]) -> Option<[DVec2; 2]> {
    let ring = &shapes::square(SIDE)[0].outer;
    let value = |x: DVec2| a0 + a1 * x.x + a2 * x.y;
    let edges = ring.iter().zip(ring.iter().cycle().skip(1));
    let cuts: Vec<DVec2> = edges
        .filter(|(a, b)| (value(**a) < 0.0) != (value(**b) < 0.0))
        .map(|(a, b)| a.lerp(*b, value(*a) / (value(*a) - value(*b))))
        .collect();
    <[DVec2; 2]>::try_from(cuts).ok()
}

/// Paper 5.1: one curve for each behaviour of `mu_s`, and the contact left under the same loads.
pub(super) fn distance(sweeps: &[DistanceSweep]) -> Result<String> {
    svg((1000, 480), |root| {
        let halves = root.split_evenly((1, 2));
        let colours = [BLUE, ORANGE, GREEN, PURPLE];
        let mut shown: Vec<(&DistanceSweep, String)> = Vec::new();
        for trend in [Trend::Constant, Trend::Up, Trend::Down, Trend::Mixed] {
            // The sweep of each kind that changes most shows it best.
            let change = |sweep: &&DistanceSweep| {
                let values = || sweep.points.iter().map(|point| point[1]);
                values().fold(0.0, f64::max) / values().fold(f64::INFINITY, f64::min)
            };
            let mut of_kind = sweeps.iter().filter(|sweep| sweep.trend == trend);
            let most = if trend == Trend::Constant {
                of_kind.next()
            } else {
                of_kind.max_by(|a, b| change(a).total_cmp(&change(b)))
            };
            shown.extend(most.map(|sweep| {
                (sweep, format!("{}, {}, {:.2}", sweep.shape, sweep.load, sweep.moment_share))
            }));
        }
        let curves = |value: fn(&DistanceSweep, usize) -> f64| -> Vec<Curve<'_>> {
            let of = |sweep: &DistanceSweep| {
                (0..sweep.points.len()).map(|i| (sweep.points[i][0], value(sweep, i))).collect()
            };
            shown
                .iter()
                .zip(colours)
                .map(|((sweep, label), colour)| Curve {
                    label,
                    colour,
                    width: 2,
                    points: of(sweep),
                })
                .collect()
        };
        let ratio = curves(|sweep, i| sweep.points[i][1] / sweep.points[0][1]);
        let (low, high) = ratio
            .iter()
            .flat_map(|curve| &curve.points)
            .fold((1.0_f64, 1.0_f64), |(low, high), point| (low.min(point.1), high.max(point.1)));
        let margin = 0.05 * (high - low);
        let axes = Axes {
            title: "mu_s (shape, load in the pad plane, share of twist-out)",
            x: ("distance of the faces over the side", 0.0..5.0),
            y: ("mu_s over that at distance 0", low - margin..high + 6.0 * margin),
            legend: SeriesLabelPosition::UpperLeft,
        };
        chart(&halves[0], axes, &ratio)?;
        let axes = Axes {
            title: "contact left",
            x: ("distance of the faces over the side", 0.0..5.0),
            y: ("share of the smaller contact", 0.0..1.05),
            legend: SeriesLabelPosition::LowerRight,
        };
        chart(&halves[1], axes, &curves(|sweep, i| sweep.points[i][2]))
    })
}

/// Section 6: friction of prisms over that of the cylinder, up to where they twist out.
pub(super) fn prisms(rows: &[PrismRow]) -> Result<String> {
    svg((820, 520), |root| {
        let colours = [INK, SKY, ORANGE, GREEN, BLUE, PURPLE];
        let shown = FACES.map(f64::from);
        let curves: Vec<Curve<'_>> = rows
            .iter()
            .zip(colours)
            .map(|(row, colour)| Curve {
                label: row.load,
                colour,
                width: 2,
                points: shown
                    .iter()
                    .zip(&row.prisms)
                    .map_while(|(n, mu)| Some((n.log2(), (*mu)? / row.cylinder)))
                    .collect(),
            })
            .collect();
        let axes = Axes {
            title: "prism between plane pads; a curve ends where the next one twists out",
            x: ("log2 of the number of faces", 2.5..8.6),
            y: ("mu_s over that of the cylinder", -0.05..1.25),
            legend: SeriesLabelPosition::LowerRight,
        };
        chart(root, axes, &curves)
    })
}

/// Paper 3.6: contact left under an out-of-plane moment, one direction of each shape.
pub(super) fn separation(sweeps: &[SeparationSweep]) -> Result<String> {
    svg((1000, 480), |root| {
        let halves = root.split_evenly((1, 2));
        let curves = |value: fn(&(f64, f64, u32)) -> f64| -> Vec<Curve<'_>> {
            let shown = sweeps.iter().filter(|sweep| sweep.direction == 0.0);
            let curve = |(sweep, colour): (&'_ SeparationSweep, RGBColor)| Curve {
                label: sweep.shape,
                colour,
                width: 2,
                points: sweep.points.iter().map(|point| (point.0, value(point))).collect(),
            };
            shown.zip([INK, BLUE, SKY, ORANGE, GREEN, PURPLE]).map(curve).collect()
        };
        let axes = Axes {
            title: "contact left",
            x: ("out-of-plane moment over twist-out", 0.0..1.0),
            y: ("share of the smaller contact", 0.0..1.05),
            legend: SeriesLabelPosition::LowerLeft,
        };
        chart(&halves[0], axes, &curves(|point| point.1))?;
        let axes = Axes {
            title: "rounds of clip and solve",
            x: ("out-of-plane moment over twist-out", 0.0..1.0),
            y: ("rounds until the pressure stays", 0.0..60.0),
            legend: SeriesLabelPosition::UpperLeft,
        };
        chart(&halves[1], axes, &curves(|point| f64::from(point.2)))
    })
}
