//! Values with units at the edge of the program: `80N`, `350g`, `2mm`, `15deg`. Inside everything
//! is SI.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::model::LARGEST_LENGTH;

/// A kind of quantity with the units accepted for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Metres inside.
    Length,
    /// Kilograms inside.
    Mass,
    /// Newtons inside.
    Force,
    /// Newton metres inside.
    Moment,
    /// Radians inside.
    Angle,
    /// Metres per second squared inside.
    Acceleration,
    /// Kilograms per cubic metre inside.
    Density,
    /// Pascals inside.
    Pressure,
    /// Seconds inside.
    Time,
    /// Bytes inside.
    Memory,
}

/// Standard gravity [m/s^2] (exact by definition).
pub const STANDARD_GRAVITY: f64 = 9.80665;

impl Quantity {
    /// Name and factor to SI of each accepted unit.
    pub fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &[
                ("m", 1.0),
                ("mm", 1e-3),
                ("cm", 1e-2),
                ("um", 1e-6),
                ("in", 0.0254),
                ("ft", 0.3048),
            ],
            Self::Mass => &[
                ("kg", 1.0),
                ("g", 1e-3),
                ("mg", 1e-6),
                ("t", 1e3),
                ("lb", 0.453_592_37),
                ("oz", 0.028_349_523_125),
            ],
            Self::Force => &[
                ("N", 1.0),
                ("mN", 1e-3),
                ("kN", 1e3),
                ("lbf", 4.448_221_615_260_5),
                ("kgf", STANDARD_GRAVITY),
            ],
            Self::Moment => {
                &[("Nm", 1.0), ("Nmm", 1e-3), ("mNm", 1e-3), ("lbfin", 0.112_984_829_027_616_7)]
            }
            Self::Angle => &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)],
            Self::Acceleration => {
                &[("m/s2", 1.0), ("m/s^2", 1.0), ("mm/s2", 1e-3), ("g", STANDARD_GRAVITY)]
            }
            Self::Density => &[("kg/m3", 1.0), ("kg/m^3", 1.0), ("g/cm3", 1e3), ("g/cm^3", 1e3)],
            Self::Pressure => &[
                ("Pa", 1.0),
                ("kPa", 1e3),
                ("MPa", 1e6),
                ("GPa", 1e9),
                ("bar", 1e5),
                ("psi", 6_894.757_293_168),
            ],
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("min", 60.0), ("h", 3600.0)],
            Self::Memory => &[
                ("GB", 1e9),
                ("MB", 1e6),
                ("kB", 1e3),
                ("B", 1.0),
                ("GiB", 1073741824.0),
                ("MiB", 1048576.0),
                ("KiB", 1024.0),
            ],
        }
    }

    /// Parses `text` (number, then unit, spaces allowed between) to SI. `place` is the flag or
    /// field for the message.
    ///
    /// # Errors
    /// When the number does not parse or is not finite, or the unit is missing or unknown; the
    /// message lists the units.
    pub fn parse(self, place: &str, text: &str) -> Result<f64> {
        let list = || self.units().iter().map(|unit| unit.0).collect::<Vec<_>>().join(", ");
        let text = text.trim();
        // The longest prefix that is a number: units never look like digits, but `1e3g` must not
        // stop at `1`.
        let split = (1..=text.len()).rev().find(|&end| {
            text.is_char_boundary(end) && text[..end].trim_end().parse::<f64>().is_ok()
        });
        let Some(split) = split else {
            return Err(Error::input(
                place,
                format!("'{text}' does not start with a number"),
                format!("write a number and a unit, one of: {}", list()),
            ));
        };
        let value: f64 = text[..split].trim_end().parse().unwrap_or(f64::NAN);
        let unit = text[split..].trim();
        if unit.is_empty() {
            return Err(Error::input(
                place,
                format!("'{text}' has no unit"),
                format!("add one of: {}", list()),
            ));
        }
        let Some(factor) = self.units().iter().find(|known| known.0 == unit).map(|known| known.1)
        else {
            return Err(Error::input(
                place,
                format!("'{text}': unknown unit '{unit}'"),
                format!("use one of: {}", list()),
            ));
        };
        // 350 g is 350/1000 kg to the last digit, which 350 * 1e-3 is not.
        let inverse = (1.0 / factor).round();
        let si = if factor < 1.0 && (inverse * factor - 1.0).abs() < 1e-15 {
            value / inverse
        } else {
            value * factor
        };
        if self == Self::Length && si.abs() > LARGEST_LENGTH && si.is_finite() {
            return Err(Error::input(
                place,
                format!("'{text}' is longer than {LARGEST_LENGTH:.0e} m"),
                "check the number and its unit",
            ));
        }
        if !si.is_finite() {
            return Err(Error::input(
                place,
                format!("'{text}' is not a finite value"),
                "give a finite number",
            ));
        }
        Ok(si)
    }
}

/// A direction: `+x`, `x`, `-z`, ... or three numbers joined by slashes, e.g. `0/0.5/-1`; its
/// length is as given. `place` is the flag or field for the message.
///
/// # Errors
/// When the text is none of these, or the numbers are not finite or all zero.
pub fn direction(place: &str, text: &str) -> Result<DVec3> {
    let text = text.trim();
    let axes = [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)];
    for (letter, axis) in axes {
        if text == letter || text.strip_prefix('+') == Some(letter) {
            return Ok(axis);
        }
        if text.strip_prefix('-') == Some(letter) {
            return Ok(-axis);
        }
    }
    let numbers: Option<Vec<f64>> =
        text.split('/').map(|number| number.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .map(DVec3::from_array)
        .filter(|direction| direction.is_finite() && *direction != DVec3::ZERO)
        .ok_or_else(|| {
            Error::input(
                place,
                format!("'{text}' is not a direction"),
                "give +x, -x, +y, -y, +z, -z or three numbers joined by slashes, e.g. 0/0.5/-1",
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_values_with_units() {
        assert_eq!(Quantity::Mass.parse("--mass", "350g").unwrap(), 0.35);
        assert_eq!(Quantity::Length.parse("x", "1e3 mm").unwrap(), 1.0);
        assert_eq!(Quantity::Acceleration.parse("x", "2g").unwrap(), 19.6133);
        assert!(
            (Quantity::Angle.parse("x", "180deg").unwrap() - std::f64::consts::PI).abs() < 1e-15
        );
    }

    #[test]
    fn refuses_what_is_not_a_value_with_a_unit() {
        for bad in ["80", "", "N", "80 furlong", "nanN", "infN", "--3N", "1e999N"] {
            assert!(Quantity::Force.parse("--force", bad).is_err(), "{bad}");
        }
        let message = Quantity::Force.parse("--force", "80").unwrap_err().to_string();
        assert!(message.contains("--force") && message.contains("kN"), "{message}");
    }

    #[test]
    fn directions_are_axes_or_three_numbers() {
        for (text, expected) in [
            ("x", DVec3::X),
            ("+y", DVec3::Y),
            (" -z ", -DVec3::Z),
            ("0/0.5/-1", DVec3::new(0.0, 0.5, -1.0)),
            ("1e-200/0/0", DVec3::X * 1e-200),
        ] {
            assert_eq!(direction("--ground", text).unwrap(), expected, "{text}");
        }
        for bad in ["", "+", "w", "xx", "+-x", "1/2", "1/2/3/4", "0/0/0", "1/nan/0", "1/2/inf"] {
            let message = direction("--ground", bad).unwrap_err().to_string();
            assert!(message.contains("--ground") && message.contains("0/0.5/-1"), "{message}");
        }
    }
}
