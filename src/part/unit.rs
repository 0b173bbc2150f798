//! Whether a part has the size of a part in the unit that its file was read in.

use glam::DVec3;

use super::UnitSource;
use crate::units::Unit;

/// Largest extents \[m\] between which a part is taken for what a two-finger gripper might handle.
const PLAUSIBLE: (f64, f64) = (1e-3, 5.0);

/// Whether the largest of `extents` \[m\] is one of a part that a gripper might handle.
pub(crate) fn is_plausible(extents: DVec3) -> bool {
    (PLAUSIBLE.0..=PLAUSIBLE.1).contains(&extents.max_element())
}

/// A warning when the largest of `extents` \[m\], read in `unit`, is implausible, with the unit that
/// would fit.
pub(super) fn implausible_size(extents: DVec3, unit: Unit, source: UnitSource) -> Option<String> {
    let largest = extents.max_element();
    if largest <= 0.0 || is_plausible(extents) {
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
    let origin = match source {
        UnitSource::Assumed => "assumed",
        UnitSource::File | UnitSource::Given => "stated",
    };
    let mut text = format!(
        "implausible size: {:.4} x {:.4} x {:.4} mm with the {origin} unit {unit}",
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
        let warning = implausible_size(extents, Unit::Millimetre, UnitSource::Assumed).unwrap();
        assert!(warning.contains("the unit m "), "{warning}");
        assert!(implausible_size(extents * 1e3, Unit::Metre, UnitSource::File).is_none());
        let warning =
            implausible_size(DVec3::splat(2e4) * 1e-3, Unit::Millimetre, UnitSource::Assumed)
                .unwrap();
        assert!(warning.contains("the unit um "), "{warning}");
    }
}
