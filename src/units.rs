//! Values with units at the edge of the program: `80N`, `350g`, `2mm`, `15deg`. Inside everything
//! is SI.
//!
//! [`Length`], [`Force`] and so on are numbers in SI that read and write themselves as such texts,
//! in files and on the command line, and read back bit for bit.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
    /// Kilogram square metres inside.
    Inertia,
    /// Radians inside.
    Angle,
    /// Metres per second squared inside.
    Acceleration,
    /// Kilograms per cubic metre inside.
    Density,
    /// Pascals inside.
    Pressure,
    /// Pascals per metre inside.
    Stiffness,
    /// Seconds inside.
    Time,
    /// Bytes inside.
    Memory,
}

/// Standard gravity [m/s^2] (exact by definition).
pub const STANDARD_GRAVITY: f64 = 9.80665;

impl Quantity {
    /// Every kind.
    pub const ALL: [Self; 12] = [
        Self::Length,
        Self::Mass,
        Self::Force,
        Self::Moment,
        Self::Inertia,
        Self::Angle,
        Self::Acceleration,
        Self::Density,
        Self::Pressure,
        Self::Stiffness,
        Self::Time,
        Self::Memory,
    ];

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
            Self::Inertia => &[("kgm2", 1.0), ("kgmm2", 1e-6), ("gcm2", 1e-7), ("gmm2", 1e-9)],
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
            Self::Stiffness => {
                &[("Pa/m", 1.0), ("MPa/mm", 1e9), ("N/mm3", 1e9), ("N/mm^3", 1e9), ("GPa/m", 1e9)]
            }
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("min", 60.0), ("h", 3600.0)],
            Self::Memory => &[
                ("B", 1.0),
                ("kB", 1e3),
                ("MB", 1e6),
                ("GB", 1e9),
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
        self.read(text).map_err(|(problem, remedy)| Error::input(place, problem, remedy))
    }

    /// The accepted units as a list.
    fn list(self) -> String {
        self.units().iter().map(|unit| unit.0).collect::<Vec<_>>().join(", ")
    }

    /// As [`Self::parse`]; an error is the problem and the remedy.
    fn read(self, text: &str) -> std::result::Result<f64, (String, String)> {
        let text = text.trim();
        // The longest prefix that is a number: units never look like digits, but `1e3g` must not
        // stop at `1`.
        let split = (1..=text.len()).rev().find(|&end| {
            text.is_char_boundary(end) && text[..end].trim_end().parse::<f64>().is_ok()
        });
        let Some(split) = split else {
            return Err((
                format!("'{text}' does not start with a number"),
                format!("write a number and a unit, one of: {}", self.list()),
            ));
        };
        let value: f64 = text[..split].trim_end().parse().unwrap_or(f64::NAN);
        let unit = text[split..].trim();
        if let Some(rest) =
            unit.strip_prefix(',').filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
        {
            return Err((
                format!("'{text}' has a decimal comma"),
                format!("write a point: {}.{rest}", text[..split].trim_end()),
            ));
        }
        if unit.is_empty() {
            return Err((format!("'{text}' has no unit"), format!("add one of: {}", self.list())));
        }
        let Some(factor) = self.units().iter().find(|known| known.0 == unit).map(|known| known.1)
        else {
            return Err((
                format!("'{text}': unknown unit '{unit}'"),
                format!("use one of: {}", self.list()),
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
            return Err((
                format!("'{text}' is longer than {LARGEST_LENGTH:.0e} m"),
                "check the number and its unit".to_owned(),
            ));
        }
        if !si.is_finite() {
            return Err((
                format!("'{text}' is not a finite value"),
                "give a finite number".to_owned(),
            ));
        }
        Ok(si)
    }

    /// The shortest text in SI or in `handy` units that [`Self::parse`] reads back bit for bit.
    fn write(self, si: f64, handy: &str) -> String {
        let unit = self.units().iter().find(|known| known.1 == 1.0).map_or("", |known| known.0);
        let plain = format!("{si}{unit}");
        let Some((unit, factor)) = self.units().iter().find(|known| known.0 == handy) else {
            return plain;
        };
        // To 12 digits: 15deg are 15.000000000000002 of them after a division.
        let rounded = format!("{:.11e}", si / factor).parse::<f64>().unwrap_or(f64::NAN);
        let short = format!("{rounded}{unit}");
        let same = self.read(&short).is_ok_and(|back| back.to_bits() == si.to_bits());
        if same && short.len() <= plain.len() { short } else { plain }
    }
}

/// Reads a quantity from a text; a bare number is refused with the list of units.
struct QuantityVisitor(Quantity);

impl Visitor<'_> for QuantityVisitor {
    type Value = f64;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "a text of a number and a unit, one of: {}", self.0.list())
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<f64, E> {
        self.0.read(text).map_err(|(problem, remedy)| E::custom(format!("{problem}; {remedy}")))
    }
}

/// Numbers in SI that are texts with a unit at the edge.
macro_rules! quantities {
    ($($(#[$doc:meta])* $name:ident, $handy:literal;)+) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f64);

        impl fmt::Display for $name {
            fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str(&Quantity::$name.write(self.0, $handy))
            }
        }

        impl FromStr for $name {
            type Err = Error;

            fn from_str(text: &str) -> Result<Self> {
                let place = stringify!($name).to_ascii_lowercase();
                Quantity::$name.parse(&place, text).map(Self)
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(
                &self,
                serializer: S,
            ) -> std::result::Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(
                deserializer: D,
            ) -> std::result::Result<Self, D::Error> {
                deserializer.deserialize_str(QuantityVisitor(Quantity::$name)).map(Self)
            }
        }
    )+};
}

quantities! {
    /// A length \[m\]; `2mm` as a text.
    Length, "mm";
    /// A mass \[kg\]; `350g` as a text.
    Mass, "g";
    /// A force \[N\]; `80N` as a text.
    Force, "N";
    /// A moment of inertia [kg m^2]; `90kgmm2` as a text.
    Inertia, "kgmm2";
    /// An angle \[rad\]; `15deg` as a text.
    Angle, "deg";
    /// An acceleration [m/s^2]; `2g` as a text.
    Acceleration, "g";
    /// A density [kg/m^3]; `2700kg/m3` as a text.
    Density, "kg/m3";
    /// A pressure \[Pa\]; `2MPa` as a text.
    Pressure, "MPa";
    /// A time \[s\]; `30s` as a text.
    Time, "s";
    /// A size in memory \[bytes\]; `2GB` as a text.
    Memory, "GB";
}

/// Unit of the numbers in a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Unit {
    /// 1 m.
    #[serde(rename = "m")]
    Metre,
    /// 0.01 m.
    #[serde(rename = "cm")]
    Centimetre,
    /// 0.001 m.
    #[serde(rename = "mm")]
    Millimetre,
    /// 1e-6 m.
    #[serde(rename = "um")]
    Micrometre,
    /// 0.0254 m.
    #[serde(rename = "in")]
    Inch,
    /// 0.3048 m.
    #[serde(rename = "ft")]
    Foot,
}

impl Unit {
    /// All units, the commonest in mesh files first.
    pub const ALL: [Self; 6] =
        [Self::Millimetre, Self::Metre, Self::Inch, Self::Centimetre, Self::Micrometre, Self::Foot];

    /// The unit of this length \[m\].
    pub fn of_metres(length: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| (unit.metres() / length - 1.0).abs() < 1e-9)
    }

    /// Length of the unit \[m\].
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 1e-2,
            Self::Millimetre => 1e-3,
            Self::Micrometre => 1e-6,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// Symbol as written in files and flags.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Micrometre => "um",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }
}

impl FromStr for Unit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|unit| unit.symbol() == text).ok_or_else(|| {
            Error::input(
                "unit",
                format!("unknown unit '{text}'"),
                "use one of: mm, cm, m, um, in, ft",
            )
            .with_options(&["unit"])
        })
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.symbol())
    }
}

/// A number with at most so many decimals, without zeros at its end.
#[must_use]
pub fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

/// The text that [`direction`] reads back bit for bit.
pub(crate) fn direction_text(direction: DVec3) -> String {
    let same =
        |axis: DVec3| axis.to_array().map(f64::to_bits) == direction.to_array().map(f64::to_bits);
    for (axis, letter) in [(DVec3::X, 'x'), (DVec3::Y, 'y'), (DVec3::Z, 'z')] {
        if same(axis) {
            return format!("+{letter}");
        }
        if same(-axis) {
            return format!("-{letter}");
        }
    }
    format!("{}/{}/{}", direction.x, direction.y, direction.z)
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
    fn numbers_end_without_zeros() {
        let told = [(12.0, 3), (1.25, 2), (-0.0004, 2), (100.0, 0), (0.1 + 0.2, 4)];
        let texts = told.map(|(value, decimals)| decimal(value, decimals));
        assert_eq!(texts, ["12", "1.25", "0", "100", "0.3"]);
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

    #[test]
    fn quantities_read_back_bit_for_bit() {
        fn kept<T: FromStr<Err = Error> + fmt::Display>(texts: &[&str]) {
            for text in texts {
                assert_eq!(text.parse::<T>().unwrap().to_string(), *text);
            }
        }
        kept::<Length>(&["2mm", "0m", "0.1m", "-1.5mm", "123.456mm"]);
        kept::<Angle>(&["15deg", "0.3rad"]);
        kept::<Force>(&["80N"]);
        kept::<Mass>(&["350g", "2kg"]);
        kept::<Acceleration>(&["2g", "1m/s2"]);
        kept::<Density>(&["2700kg/m3"]);
        kept::<Time>(&["30s"]);
        kept::<Memory>(&["2GB", "500B", "0.5GB"]);
        let mut state = 1_u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let value = f64::from_bits(state ^ (state >> 29));
            if !value.is_finite() {
                continue;
            }
            for value in [value, (state >> 40) as f64 / 1e4] {
                let back: Angle = Angle(value).to_string().parse().unwrap();
                assert_eq!(back.0.to_bits(), value.to_bits());
                let length = value % LARGEST_LENGTH;
                let back: Length = Length(length).to_string().parse().unwrap();
                assert_eq!(back.0.to_bits(), length.to_bits());
            }
        }
    }

    #[test]
    fn a_bare_number_in_a_file_is_refused_with_the_units() {
        for bad in ["80", "80.5", "\"80\"", "\"80 furlong\"", "true"] {
            let message = serde_json::from_str::<Force>(bad).unwrap_err().to_string();
            assert!(message.contains("kgf"), "{bad}: {message}");
        }
        assert_eq!(serde_json::from_str::<Length>("\"1.5 mm\"").unwrap(), Length(0.0015));
    }

    #[test]
    fn symbols_of_units_parse_back() {
        for unit in Unit::ALL {
            assert_eq!(unit.symbol().parse::<Unit>().unwrap(), unit);
            assert_eq!(serde_json::to_value(unit).unwrap(), unit.symbol());
        }
        assert!("yd".parse::<Unit>().is_err());
    }

    #[test]
    fn directions_read_back_bit_for_bit() {
        for text in ["+x", "-z", "y", "0/0.5/-1", "-0/0/1", "0/0/-1", "1e-200/3/4"] {
            let found = direction("here", text).unwrap();
            let again = direction("here", &direction_text(found)).unwrap();
            assert_eq!(again.to_array().map(f64::to_bits), found.to_array().map(f64::to_bits));
        }
        for bad in ["", "w", "++x", "+xy", "0/0/0", "1/2", "1/2/3/4", "1/nan/0"] {
            assert!(direction("here", bad).is_err(), "{bad}");
        }
    }
}
