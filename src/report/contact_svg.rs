//! A drawing of one contact pair at its limit state: both faces with the pressure, the separation
//! line, the slip centre and the directions in which friction acts on the body.

use std::fmt::Write;

use glam::DVec2;

use crate::contact::Loops;
use crate::geometry::polygon::contains;
use crate::model::{Contact, Patch, Pressure, Score, Slip};
use crate::svg::{escape, millimetres};

/// Panel size and margins [px].
const PANEL: f64 = 360.0;
const MARGIN: f64 = 56.0;
/// Friction arrows along the longer side.
const ARROWS: usize = 9;

/// Mapping from the pad plane \[m\] to a panel [px].
struct View {
    low: DVec2,
    scale: f64,
    left: f64,
    height: f64,
}

impl View {
    fn at(&self, x: DVec2) -> DVec2 {
        let p = (x - self.low) * self.scale;
        DVec2::new(self.left + p.x, MARGIN + self.height - p.y)
    }
}

/// The drawing as an SVG document; `x1` to the right, `x2` up, both faces seen along `-x3`.
pub fn draw(title: &str, contact: &Contact, score: &Score) -> String {
    let points: Vec<DVec2> = [&contact.face_i, &contact.face_ii]
        .into_iter()
        .flatten()
        .flat_map(|polygon| polygon.outer.iter().copied())
        .collect();
    let (low, high) = points
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let size = (high - low).max(DVec2::splat(f64::MIN_POSITIVE));
    let scale = PANEL / size.max_element();
    let height = size.y * scale;
    let width = 2.0 * PANEL + 3.0 * MARGIN;
    let pressure = score.pressure.unwrap_or_default();
    let peak = points
        .iter()
        .flat_map(|&x| [value(&pressure, 0, x), value(&pressure, 1, x)])
        .fold(0.0, f64::max);
    let mut svg = String::new();
    let total = height + 2.0 * MARGIN + 64.0;
    // Writing to a String cannot fail.
    let _ = write!(
        svg,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0} {total:.0}" font-family="system-ui, sans-serif" font-size="13" fill="#222"><rect width="100%" height="100%" fill="#fff"/><title>{}</title>"##,
        escape(title)
    );
    for (k, (patch, name)) in
        [(&contact.face_i, "face I  (x3 = +d/2)"), (&contact.face_ii, "face II  (x3 = -d/2)")]
            .into_iter()
            .enumerate()
    {
        let view = View { low, scale, left: MARGIN + k as f64 * (PANEL + MARGIN), height };
        let _ = write!(
            svg,
            r#"<text x="{:.1}" y="{:.1}" font-weight="600">{name}</text>"#,
            view.left,
            MARGIN - 22.0
        );
        area(&mut svg, &view, patch, &pressure, k, peak);
        separation(&mut svg, &view, patch, &pressure, k);
        if let Some(slip) = score.slip {
            arrows(&mut svg, &view, patch, &pressure, k, size, slip);
            centre(&mut svg, &view, low, high, slip);
        }
        axes(&mut svg, &view, size);
    }
    let y = MARGIN + height + 62.0;
    let mu = score.mu_s.map_or_else(
        || format!("no limit state ({:?})", score.status),
        |mu| format!("mu_s = {mu:.6}"),
    );
    let _ = write!(
        svg,
        r#"<text x="{MARGIN}" y="{y:.1}" font-weight="600">{}</text>"#,
        escape(&format!("{title}: {mu}"))
    );
    let text = format!(
        "pressure 0 (white) to {:.1} kPa (blue); arrows: friction on the body; dashed: separation line; cross: slip centre",
        peak * 1e-3
    );
    let _ = write!(
        svg,
        r##"<text x="{MARGIN}" y="{:.1}" fill="#555" font-size="12">{text}</text></svg>"##,
        y + 20.0
    );
    svg
}

fn value(p: &Pressure, k: usize, x: DVec2) -> f64 {
    if k == 0 { p.a_i0 + p.a1 * x.x + p.a2 * x.y } else { p.a_ii0 - p.a1 * x.x - p.a2 * x.y }
}

fn inside(patch: &Patch, x: DVec2) -> bool {
    patch.iter().any(|polygon| contains(polygon, x))
}

/// The contact area, filled with the pressure: a linear function is a linear gradient.
fn area(svg: &mut String, view: &View, patch: &Patch, pressure: &Pressure, k: usize, peak: f64) {
    let slope = DVec2::new(pressure.a1, pressure.a2) * if k == 0 { 1.0 } else { -1.0 };
    let at_origin = value(pressure, k, DVec2::ZERO);
    let rings =
        || patch.iter().flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes));
    let across =
        rings().flatten().map(|x| x.dot(slope)).fold(0.0, |most: f64, p| most.max(p.abs()));
    let fill = if across <= 1e-9 * peak {
        colour(if peak > 0.0 { (at_origin / peak).clamp(0.0, 1.0) } else { 0.0 })
    } else {
        let zero = -at_origin * slope / slope.length_squared();
        let (from, to) = (view.at(zero), view.at(zero + slope * (peak / slope.length_squared())));
        let _ = write!(
            svg,
            r#"<linearGradient id="p{k}" gradientUnits="userSpaceOnUse" x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}">"#,
            from.x, from.y, to.x, to.y
        );
        for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let _ = write!(svg, r#"<stop offset="{share}" stop-color="{}"/>"#, colour(share));
        }
        svg.push_str("</linearGradient>");
        format!("url(#p{k})")
    };
    let mut path = String::new();
    for ring in rings() {
        for (index, &x) in ring.iter().enumerate() {
            let x = view.at(x);
            let _ = write!(path, "{}{:.1} {:.1}", if index == 0 { 'M' } else { 'L' }, x.x, x.y);
        }
        path.push('Z');
    }
    let _ = write!(
        svg,
        r##"<path d="{path}" fill="{fill}" fill-rule="evenodd" stroke="#222" stroke-width="1.4"/>"##
    );
}

/// White for no pressure, blue for the peak, light enough for the arrows on it.
fn colour(share: f64) -> String {
    let mix = |from: f64, to: f64| (from + share.powf(0.8) * (to - from)).round();
    format!("rgb({},{},{})", mix(250.0, 86.0), mix(251.0, 152.0), mix(253.0, 214.0))
}

fn separation(svg: &mut String, view: &View, patch: &Patch, pressure: &Pressure, k: usize) {
    let edges: Vec<_> = Loops::new(patch).edges().collect();
    for (a, b) in crossing_pairs(&edges, pressure, k) {
        let (a, b) = (view.at(a), view.at(b));
        let _ = write!(
            svg,
            r##"<line x1="{:.2}" y1="{:.2}" x2="{:.2}" y2="{:.2}" stroke="#c2410c" stroke-width="2" stroke-dasharray="6 4"/>"##,
            a.x, a.y, b.x, b.y
        );
    }
}

/// Pieces of the zero-pressure line inside the area: its crossings with the boundary, in order, two
/// by two.
fn crossing_pairs(edges: &[(DVec2, DVec2)], pressure: &Pressure, k: usize) -> Vec<(DVec2, DVec2)> {
    let along = DVec2::new(-pressure.a2, pressure.a1);
    let mut crossings: Vec<DVec2> = edges
        .iter()
        .filter_map(|&(a, b)| {
            let (pa, pb) = (value(pressure, k, a), value(pressure, k, b));
            ((pa < 0.0) != (pb < 0.0)).then(|| a + (b - a) * (pa / (pa - pb)))
        })
        .collect();
    crossings.sort_by(|a, b| along.dot(*a).total_cmp(&along.dot(*b)));
    crossings.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
}

fn arrows(
    svg: &mut String,
    view: &View,
    patch: &Patch,
    pressure: &Pressure,
    k: usize,
    size: DVec2,
    slip: Slip,
) {
    let step = size.max_element() / ARROWS as f64;
    let (nx, ny) = ((size.x / step).ceil() as usize, (size.y / step).ceil() as usize);
    for j in 0..ny {
        for i in 0..nx {
            let x = view.low + DVec2::new(i as f64 + 0.5, j as f64 + 0.5) * step;
            if !inside(patch, x) || value(pressure, k, x) <= 0.0 {
                continue;
            }
            let velocity = match slip {
                Slip::Rotation { c, sense } => f64::from(sense) * (x - DVec2::from_array(c)).perp(),
                Slip::Translation { direction } => DVec2::from_array(direction),
                // The faces of a part that spins each move their own way.
                Slip::Spin { .. } | Slip::None => return,
            };
            // Beside the slip centre the direction of one arrow says nothing.
            let near = matches!(slip, Slip::Rotation { c, .. } if (x - DVec2::from_array(c)).length() < 0.35 * step);
            let Some(direction) = (-velocity).try_normalize().filter(|_| !near) else { continue };
            let half = 0.32 * step * direction;
            let (a, b) = (view.at(x - half), view.at(x + half));
            let back = (a - b) * 0.35;
            let wing = back.perp() * 0.5;
            let (w1, w2) = (b + back + wing, b + back - wing);
            let _ = write!(
                svg,
                r##"<path d="M{:.1} {:.1}L{:.1} {:.1}M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}" fill="none" stroke="#111" stroke-width="1.2"/>"##,
                a.x, a.y, b.x, b.y, w1.x, w1.y, b.x, b.y, w2.x, w2.y
            );
        }
    }
}

fn centre(svg: &mut String, view: &View, low: DVec2, high: DVec2, slip: Slip) {
    let Slip::Rotation { c, .. } = slip else { return };
    let c = DVec2::from_array(c);
    let margin = 0.1 * (high - low).max_element();
    if c.cmplt(low - margin).any() || c.cmpgt(high + margin).any() {
        return; // outside the drawing; the arrows tell where
    }
    let at = view.at(c);
    let _ = write!(
        svg,
        r##"<path d="M{:.1} {:.1}h16m-8 -8v16" stroke="#dc2626" stroke-width="2.4" fill="none"/><circle cx="{:.1}" cy="{:.1}" r="5" fill="none" stroke="#dc2626" stroke-width="1.6"/>"##,
        at.x - 8.0,
        at.y,
        at.x,
        at.y
    );
}

fn axes(svg: &mut String, view: &View, size: DVec2) {
    let mm = |value: f64| millimetres(value, 4);
    let (a, b) = (view.at(view.low), view.at(view.low + size));
    let _ = write!(
        svg,
        r##"<g fill="#555" font-size="11"><text x="{:.1}" y="{:.1}">x1 {}</text><text x="{:.1}" y="{:.1}" text-anchor="end">{} mm</text><text x="{:.1}" y="{:.1}" text-anchor="end">{}</text><text x="{:.1}" y="{:.1}" text-anchor="end">x2 {}</text></g>"##,
        a.x,
        a.y + 18.0,
        mm(view.low.x),
        b.x,
        a.y + 18.0,
        mm(view.low.x + size.x),
        a.x - 5.0,
        a.y,
        mm(view.low.y),
        a.x - 5.0,
        b.y + 9.0,
        mm(view.low.y + size.y)
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::{Options, solve};
    use crate::model::{Polygon, Wrench};

    #[test]
    fn draws_pressure_separation_line_and_slip_centre() {
        let ring = [(-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01)]
            .map(|(x, y)| DVec2::new(x, y))
            .to_vec();
        let patch = vec![Polygon { outer: ring, holes: Vec::new() }];
        let contact = Contact { face_i: patch.clone(), face_ii: patch };
        let wrench = Wrench { force: glam::DVec3::ZERO, moment: glam::DVec3::new(0.6, 0.0, 0.2) };
        let score = solve(&contact, 0.02, 50.0, &wrench, &Options::default()).unwrap();
        let svg = draw("square <I>", &contact, &score);
        assert_eq!(svg.matches("stroke-dasharray").count(), 2, "one separation line a face");
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("square &lt;I&gt;"));
        // Both faces are filled along the slope of their pressure, from its zero line on.
        assert_eq!(svg.matches("<linearGradient").count(), 2);
        assert!(svg.contains("fill=\"url(#p0)\"") && svg.contains("fill=\"url(#p1)\""));
        let level = solve(
            &contact,
            0.02,
            50.0,
            &Wrench { force: glam::DVec3::X, moment: glam::DVec3::ZERO },
            &Options::default(),
        )
        .unwrap();
        assert!(!draw("level", &contact, &level).contains("linearGradient"));
    }
}
