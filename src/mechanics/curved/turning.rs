//! Whether a squeeze alone turns the part out of the grip.

use glam::{DMat2, DVec2};

use super::Pads;
use super::face::Pressed;
use crate::geometry::principal;

impl Pads {
    /// Stiffness of two faces at a `distance` \[m\], squeezed with `force` \[N\], against turning about
    /// that axis along the pads about which it is least, without friction [N m per rad]: negative where
    /// the part rolls out of the grip. `None` without contact.
    ///
    /// A turn by a small angle lifts the surface above `x` by the angle times `x - d/2 h'`, and by its
    /// square times half of `d/2 - (d/2)^2 h''`, where `h` is the gap. As the pressure is zero where it
    /// ends, integrals of the slopes are the force, and what is left is the second moment of the
    /// pressed areas times the pads' stiffness, less the force times the distance.
    pub(crate) fn turning_stiffness(&self, distance: f64, force: f64) -> Option<f64> {
        let mut resisting = DMat2::ZERO;
        for face in &self.faces {
            resisting += face.carry(force, DVec2::ZERO, None)?.second_moment();
        }
        Some(principal(resisting).0[0] - force * distance)
    }
}

impl Pressed<'_> {
    /// Second moment of the pressed area about its middle, times the pad's stiffness [N m].
    pub(super) fn second_moment(&self) -> DMat2 {
        let outer = |a: DVec2, b: DVec2| DMat2::from_cols(a * b.x, a * b.y);
        let (mut area, mut first, mut second) = (0.0, DVec2::ZERO, DMat2::ZERO);
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if region.is_empty() {
                continue;
            }
            let [_, of_one, of_x, of_y] = region.moments(&field.gap);
            let own = field.outward(DVec2::new(of_one[1], of_one[2]));
            let turned = DMat2::from_cols(field.axis, field.axis.perp());
            let around = DMat2::from_cols_array(&[of_x[1], of_x[2], of_y[1], of_y[2]]);
            area += of_one[0];
            first += field.origin * of_one[0] + own;
            second += turned * around * turned.transpose()
                + outer(field.origin, own)
                + outer(own, field.origin)
                + outer(field.origin, field.origin) * of_one[0];
        }
        (second - outer(first, first) * area.recip()) * self.face.stiffness
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::surface::{Piece, Surfaces};
    use crate::model::Gap;

    const STIFFNESS: f64 = 5e9;
    const FORCE: f64 = 60.0;

    fn square(half: f64) -> Vec<DVec2> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| half * DVec2::new(x, y))
            .to_vec()
    }

    fn stiffness(piece: &Piece, distance: f64) -> f64 {
        let surfaces = Surfaces {
            face_i: vec![piece.clone()],
            face_ii: vec![piece.clone()],
            stiffness: [STIFFNESS; 2],
            layer: None,
        };
        Pads::new(&surfaces).unwrap().turning_stiffness(distance, FORCE).unwrap()
    }

    /// Crests are as stiff as the force times what their radii are more than half of the distance, the
    /// smaller of both if they have two.
    #[test]
    fn crests_roll_where_their_radii_fall_short_of_the_distance() {
        for (radius, meridian) in [(0.01, 0.01), (0.01, 0.03), (0.02, 0.04)] {
            let gap =
                Gap::Barrel { radius, meridian, axis: DVec2::X, at: DVec2::ZERO, height: 0.0 };
            let piece = Piece { outer: square(0.02), holes: Vec::new(), gap };
            for distance in [0.01, 0.02, 0.05] {
                let expected = FORCE * (2.0 * radius - distance);
                let found = stiffness(&piece, distance);
                assert!((found - expected).abs() < 1e-6 * FORCE * radius, "{found} {expected}");
            }
        }
    }

    /// A square is as stiff as its pads under its second moment, less what the force turns it with.
    #[test]
    fn a_small_flat_on_a_long_part_rolls() {
        for half in [1e-3_f64, 3e-3, 8e-3] {
            let gap = Gap::Plane { height: 0.0, slope: DVec2::ZERO };
            let outer = square(half).into_iter().map(|x| x + DVec2::new(2e-3, -1e-3)).collect();
            let piece = Piece { outer, holes: Vec::new(), gap };
            let expected = 2.0 * STIFFNESS * 4.0 / 3.0 * half.powi(4) - FORCE * 0.05;
            let found = stiffness(&piece, 0.05);
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }
}
