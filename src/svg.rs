//! What every drawing of the program needs to write SVG.

use std::fmt::Write;

use glam::DVec2;

pub(crate) use crate::text::markup as escape;

/// Metres as millimetres with at most this many decimals, without trailing zeros.
pub(crate) fn millimetres(value: f64, decimals: usize) -> String {
    crate::units::decimal(value * 1e3, decimals)
}

/// Appends a closed ring to the data of a path; `place` maps it to pixels.
pub(crate) fn ring(data: &mut String, ring: &[DVec2], place: impl Fn(DVec2) -> DVec2) {
    for (index, &point) in ring.iter().enumerate() {
        let point = place(point);
        // Writing to a String cannot fail.
        let _ = write!(data, "{}{:.1} {:.1}", if index == 0 { "M" } else { "L" }, point.x, point.y);
    }
    data.push('Z');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_a_name_stays_text_and_numbers_are_short() {
        assert_eq!(escape("a<b> & c"), "a&lt;b&gt; &amp; c");
        let texts = [0.0125, 0.02, 0.1, -0.000_5].map(|value| millimetres(value, 2));
        assert_eq!(texts, ["12.5", "20", "100", "-0.5"]);
        assert_eq!(millimetres(0.1, 0), "100");
        let mut data = String::new();
        ring(&mut data, &[DVec2::ZERO, DVec2::X, DVec2::Y], |point| point * 2.0);
        assert_eq!(data, "M0.0 0.0L2.0 0.0L0.0 2.0Z");
    }
}
