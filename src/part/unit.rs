//! Units of length of mesh files.

use std::str::FromStr;

use glam::DVec3;

use crate::error::Error;

/// Unit of the numbers in a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unit {
    /// 1 m.
    Metre,
    /// 0.01 m.
    Centimetre,
    /// 0.001 m.
    Millimetre,
    /// 1e-6 m.
    Micrometre,
    /// 0.0254 m.
    Inch,
    /// 0.3048 m.
    Foot,
}

impl Unit {
    /// All units, the commonest in mesh files first.
    pub const ALL: [Self; 6] =
        [Self::Millimetre, Self::Metre, Self::Inch, Self::Centimetre, Self::Micrometre, Self::Foot];

    /// Length of the unit [m].
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

    /// Symbol as users write it.
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

    fn from_str(text: &str) -> Result<Self, Error> {
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

impl std::fmt::Display for Unit {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.symbol())
    }
}

/// Largest extents [m] between which a part is taken for what a two-finger gripper might handle.
const PLAUSIBLE: (f64, f64) = (1e-3, 5.0);

/// A warning when the largest of `extents` [m], read in `unit`, is implausible, with the unit that
/// would fit.
pub(super) fn implausible_size(extents: DVec3, unit: Unit, stated: bool) -> Option<String> {
    let largest = extents.max_element();
    if largest <= 0.0 || (PLAUSIBLE.0..=PLAUSIBLE.1).contains(&largest) {
        return None;
    }
    // The part that would come nearest to 100 mm, a typical part for a gripper, in its largest
    // extent.
    let distance = |other: &Unit| (largest / unit.metres() * other.metres() / 0.1).ln().abs();
    let likely = Unit::ALL
        .into_iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .filter(|&likely| likely != unit);
    let size = extents * 1e3;
    let source = if stated { "stated" } else { "assumed" };
    let mut text = format!(
        "implausible size: {:.4} x {:.4} x {:.4} mm with the {source} unit {unit}",
        size.x, size.y, size.z
    );
    if let Some(likely) = likely {
        let size = extents / unit.metres() * likely.metres() * 1e3;
        text += &format!(
            "; the unit {likely} would give {:.4} x {:.4} x {:.4} mm",
            size.x, size.y, size.z
        );
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warns_of_metres_taken_for_millimetres() {
        let extents = DVec3::new(0.04, 0.04, 0.02) * 1e-3;
        let warning = implausible_size(extents, Unit::Millimetre, false).unwrap();
        assert!(warning.contains("the unit m "), "{warning}");
        assert!(implausible_size(extents * 1e3, Unit::Metre, true).is_none());
        let warning = implausible_size(DVec3::splat(2e4) * 1e-3, Unit::Millimetre, false).unwrap();
        assert!(warning.contains("the unit um "), "{warning}");
    }

    #[test]
    fn symbols_parse_back() {
        for unit in Unit::ALL {
            assert_eq!(unit.symbol().parse::<Unit>().unwrap(), unit);
        }
        assert!("yd".parse::<Unit>().is_err());
    }
}
