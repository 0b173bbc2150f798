//! A dimensioned drawing of a gripper: front view (x3 to the right) and side view (x2 to the
//! right), approach downwards.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::check::outline;
use super::{Body, Gripper, Jaw, Moving};
use crate::geometry::Bounds2;
use crate::model::Ring;
use crate::svg::{escape, millimetres};

/// Height of the drawn gripper and margins [px].
const HEIGHT: f64 = 460.0;
const MARGIN: f64 = 90.0;

/// The drawing as a complete SVG document; lengths in its text are millimetres.
pub fn svg(gripper: &Gripper) -> String {
    let open = gripper.stroke[1];
    let bodies: Vec<(&str, Body)> = (gripper.palm_at(open).into_iter().map(|body| ("palm", body)))
        .chain(gripper.finger(Jaw::I, open).into_iter().map(|body| ("finger", body)))
        .chain(gripper.finger(Jaw::II, open).into_iter().map(|body| ("finger", body)))
        .collect();
    // Screen y runs down, and so does the approach axis: the screen shows (across, x1) as they are.
    let view = |across: DVec3| -> Vec<(&str, Ring)> {
        bodies.iter().map(|(class, body)| (*class, outline(body, across, DVec3::X))).collect()
    };
    let (front, side) = (view(DVec3::Z), view(DVec3::Y));
    let pads = gripper.pads(open);
    let pad = pads.iter().map(Bounds2::of).reduce(Bounds2::union).unwrap_or(Bounds2::of(&[]));
    let bounds = |rings: &[(&str, Ring)], pad_half: f64| {
        let pads =
            Bounds2 { min: DVec2::new(-pad_half, pad.min.x), max: DVec2::new(pad_half, pad.max.x) };
        rings.iter().fold(pads, |sum, (_, ring)| sum.union(Bounds2::of(ring)))
    };
    let (front_bounds, side_bounds) =
        (bounds(&front, open / 2.0), bounds(&side, pad.max.y.max(-pad.min.y)));
    let height = front_bounds.size().y.max(1e-6);
    let scale = (HEIGHT / height).min(560.0 / front_bounds.size().x);
    let place = |bounds: Bounds2, left: f64| Place {
        scale,
        shift: DVec2::new(left - bounds.min.x * scale, MARGIN - front_bounds.min.y * scale),
    };
    let front_place = place(front_bounds, MARGIN);
    let side_left = 2.2 * MARGIN + front_bounds.size().x * scale;
    let side_place = place(side_bounds, side_left);
    let width = side_left + side_bounds.size().x * scale + 1.4 * MARGIN;
    let total = height * scale + 2.2 * MARGIN;

    let mut drawing = Drawing { text: String::new() };
    let _ = writeln!(
        drawing.text,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {total:.1}\" width=\"{width:.0}\" height=\"{total:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <style>.palm{{fill:#b9c2cc;stroke:#444}}.finger{{fill:#8fa3b8;stroke:#333;fill-opacity:.8}}.pad{{fill:#d9822b;stroke:#8a4b0f}}.dim{{stroke:#06c;fill:none}}text{{fill:#013;stroke:#fff;stroke-width:4px;paint-order:stroke}}.axis{{stroke:#a00;stroke-dasharray:6 3 1 3}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"16\" y=\"24\" font-size=\"16\">{}</text>\n\
         <text x=\"16\" y=\"42\">jaws open to {} mm{}; dimensions in mm; approach downwards</text>",
        escape(&gripper.name),
        millimetres(open, 2),
        match gripper.moving {
            Moving::Both => "",
            Moving::I => "; the left one (II) is fixed",
            Moving::II => "; the right one (I) is fixed",
        },
    );
    for (rings, place) in [(&front, &front_place), (&side, &side_place)] {
        for (class, ring) in rings {
            drawing.polygon(class, ring, place);
        }
    }
    // Pads: thin plates in the front view, their outline in the side view.
    let thick = gripper.pad_thickness.unwrap_or(0.0).max(2.0 / scale);
    for (sign, ring) in [1.0, -1.0].into_iter().zip(&pads) {
        let (a, b) = (sign * open / 2.0, sign * (open / 2.0 + thick));
        let pad = Bounds2::of(ring);
        let ring = [(a, pad.min.x), (b, pad.min.x), (b, pad.max.x), (a, pad.max.x)]
            .map(|(x, y)| DVec2::new(x, y));
        drawing.polygon("pad", &ring, &front_place);
    }
    for ring in &pads[..if pads[0] == pads[1] { 1 } else { 2 }] {
        let ring: Ring = ring.iter().map(|point| DVec2::new(point.y, point.x)).collect();
        drawing.polygon("pad", &ring, &side_place);
    }
    for (place, bounds) in [(&front_place, front_bounds), (&side_place, side_bounds)] {
        let (a, b) = (
            place.point(DVec2::new(0.0, bounds.min.y)),
            place.point(DVec2::new(0.0, bounds.max.y)),
        );
        let _ = writeln!(
            drawing.text,
            "<path class=\"axis\" d=\"M{:.1} {:.1}V{:.1}\"/>",
            a.x,
            a.y - 12.0,
            b.y + 12.0
        );
    }
    let bottom = front_bounds.max.y;
    drawing.horizontal(&front_place, -open / 2.0, open / 2.0, bottom, 24.0, "stroke");
    drawing.horizontal(&front_place, front_bounds.min.x, front_bounds.max.x, bottom, 52.0, "width");
    drawing.horizontal(&side_place, pad.min.y, pad.max.y, bottom, 24.0, "pad");
    drawing.horizontal(&side_place, side_bounds.min.x, side_bounds.max.x, bottom, 52.0, "depth");
    drawing.vertical(&side_place, pad.min.x, pad.max.x, side_bounds.max.x, 18.0, "pad");
    drawing.vertical(
        &front_place,
        front_bounds.min.y,
        front_bounds.max.y,
        front_bounds.min.x,
        -46.0,
        "",
    );
    if let Some(throat) = super::check::throat(gripper).filter(|throat| *throat > 0.0) {
        drawing.vertical(
            &front_place,
            pad.min.x - throat,
            pad.min.x,
            front_bounds.max.x,
            14.0,
            "throat",
        );
        drawing.vertical(&front_place, front_bounds.min.y, 0.0, front_bounds.min.x, -22.0, "");
    }
    drawing.text.push_str("</svg>\n");
    drawing.text
}

struct Place {
    scale: f64,
    shift: DVec2,
}

impl Place {
    fn point(&self, point: DVec2) -> DVec2 {
        point * self.scale + self.shift
    }
}

struct Drawing {
    text: String,
}

impl Drawing {
    fn polygon(&mut self, class: &str, ring: &[DVec2], place: &Place) {
        let points: Vec<String> = ring
            .iter()
            .map(|&point| place.point(point))
            .map(|point| format!("{:.2},{:.2}", point.x, point.y))
            .collect();
        let _ = writeln!(self.text, "<polygon class=\"{class}\" points=\"{}\"/>", points.join(" "));
    }

    /// A dimension line from `x0` to `x1`, `gap` pixels below the height `y`.
    fn horizontal(&mut self, place: &Place, x0: f64, x1: f64, y: f64, gap: f64, label: &str) {
        let (a, b) = (place.point(DVec2::new(x0, y)), place.point(DVec2::new(x1, y)));
        let line = a.y + gap;
        let _ = writeln!(
            self.text,
            "<path class=\"dim\" d=\"M{0:.1} {2:.1}V{3:.1}M{1:.1} {2:.1}V{3:.1}M{0:.1} {4:.1}H{1:.1}\"/><text x=\"{5:.1}\" y=\"{6:.1}\" text-anchor=\"middle\">{label} {7}</text>",
            a.x,
            b.x,
            a.y + 4.0,
            line + 4.0,
            line,
            (a.x + b.x) / 2.0,
            line - 3.0,
            millimetres(x1 - x0, 2)
        );
    }

    /// A dimension line from `y0` to `y1`, `gap` pixels beside `x`.
    fn vertical(&mut self, place: &Place, y0: f64, y1: f64, x: f64, gap: f64, label: &str) {
        let (a, b) = (place.point(DVec2::new(x, y0)), place.point(DVec2::new(x, y1)));
        let line = a.x + gap;
        let (from, to) = (a.x + gap.signum() * 3.0, line + gap.signum() * 4.0);
        let middle = (a.y + b.y) / 2.0;
        // Left of the gripper there is room for upright text only.
        let place = if gap < 0.0 {
            format!(
                "transform=\"translate({:.1} {middle:.1}) rotate(-90)\" text-anchor=\"middle\"",
                line - 4.0
            )
        } else {
            format!("x=\"{:.1}\" y=\"{middle:.1}\"", line + 4.0)
        };
        let _ = writeln!(
            self.text,
            "<path class=\"dim\" d=\"M{from:.1} {0:.1}H{to:.1}M{from:.1} {1:.1}H{to:.1}M{line:.1} {0:.1}V{1:.1}\"/><text {place}>{label} {2}</text>",
            a.y,
            b.y,
            millimetres(y1 - y0, 2)
        );
    }
}
