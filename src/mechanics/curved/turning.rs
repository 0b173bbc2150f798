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
    /// square times half of `d/2 - (d/2)^2 h''`, where `h` is the gap; with `d/2 - h` for `d/2`, and the
    /// slope's square, where the surface sinks in far. As the pressure is zero where it ends, integrals of
    /// the slopes are the force, and what is left is the second moment of the pressed areas times the
    /// pads' stiffness, less the force times the distance, and, of what bends or leans, half the stiffness
    /// times the integral of `delta^2 - h^2`: a circle turns about its middle without any work, however
    /// deep it is pressed.
    pub(crate) fn turning_stiffness(&self, distance: f64, force: f64) -> Option<f64> {
        let (mut resisting, mut sunk) = (DMat2::ZERO, 0.0);
        for face in &self.faces {
            let pressed = face.carry(force, DVec2::ZERO, None)?;
            resisting += pressed.second_moment();
            sunk += pressed.sunk();
        }
        Some(principal(resisting).0[0] - force * distance + sunk)
    }
}

impl Pressed<'_> {
    /// Half the stiffness times the integral of `delta^2 - h^2` over what is pressed and is no plane along
    /// the pad [N m].
    fn sunk(&self) -> f64 {
        let mut sum = 0.0;
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if field.gap.g != DVec2::ZERO || field.gap.l != DVec2::ZERO {
                region.points(|x, weight| {
                    let left = region.compression(x);
                    sum += 0.5 * weight * left * (2.0 * self.delta - left);
                });
            }
        }
        self.face.stiffness * sum
    }

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
                // A paraboloid is pressed by the square root of its depth, two thirds of which count.
                let deep = (FORCE
                    / (std::f64::consts::PI * STIFFNESS * (radius * meridian).sqrt()))
                .sqrt();
                let expected = FORCE * (2.0 * radius - distance + 2.0 * deep * 2.0 / 3.0);
                let found = stiffness(&piece, distance);
                assert!((found - expected).abs() < 1e-6 * FORCE * radius, "{found} {expected}");
            }
        }
    }

    /// A cylinder pressed deeply turns about its axis without any work: as strips of planes under its circle.
    #[test]
    fn a_circle_pressed_deeply_turns_freely() {
        let (radius, half, strips) = (0.01_f64, 0.0055_f64, 400);
        let height = |y: f64| radius - (radius * radius - y * y).sqrt();
        let strip = |k: i32| {
            let [from, to] = [k, k + 1].map(|k| half * f64::from(k) / f64::from(strips));
            let slope = (height(to) - height(from)) / (to - from);
            let gap =
                Gap::Plane { height: height(from) - slope * from, slope: DVec2::new(0.0, slope) };
            let outer = [(-0.02, from), (0.02, from), (0.02, to), (-0.02, to)];
            Piece { outer: outer.map(DVec2::from).to_vec(), holes: Vec::new(), gap }
        };
        let pieces: Vec<Piece> = (-strips..strips).map(strip).collect();
        let (face_i, face_ii) = (pieces.clone(), pieces);
        let surfaces = Surfaces { face_i, face_ii, stiffness: [STIFFNESS; 2], layer: None };
        let pads = Pads::new(&surfaces).unwrap();
        // Up to a depth of a tenth of the radius; without what it is sunk by, 6 % of the force times the
        // distance would be missing.
        for force in [50.0, 500.0, 1300.0] {
            let found = pads.turning_stiffness(2.0 * radius, force).unwrap();
            assert!(found.abs() < 1e-4 * force * 2.0 * radius, "{force}: {found}");
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
