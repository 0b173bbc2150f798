//! Exact volume integrals of a polyhedron: signed tetrahedra from a point to every triangle.

use glam::{DMat3, DVec3};

use super::{MassProperties, Mesh};

/// Integrals over tetrahedra from a common apex, relative to it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Integrals {
    /// Six times the volume.
    six_volume: f64,
    /// 24 times the integral of the position.
    first: DVec3,
    /// 120 times the integrals of xx, yy, zz and of yz, zx, xy.
    squares: DVec3,
    products: DVec3,
}

impl Integrals {
    /// Adds the tetrahedron from the origin to the triangle.
    #[inline]
    pub(super) fn add(&mut self, [a, b, c]: [DVec3; 3]) {
        let six = a.dot(b.cross(c));
        let sum = a + b + c;
        self.six_volume += six;
        self.first += six * sum;
        // int x_i x_j over (0, a, b, c) = 6V/120 (sum_k v_ki v_kj + s_i s_j), s the sum of the
        // corners.
        self.squares += six * (a * a + b * b + c * c + sum * sum);
        let cyclic = |p: DVec3| DVec3::new(p.y * p.z, p.z * p.x, p.x * p.y);
        self.products += six * (cyclic(a) + cyclic(b) + cyclic(c) + cyclic(sum));
    }

    /// Adds another surface's integrals about the same apex.
    pub(super) fn merge(&mut self, other: &Self) {
        self.six_volume += other.six_volume;
        self.first += other.first;
        self.squares += other.squares;
        self.products += other.products;
    }

    /// Turns the surface inside out.
    pub(super) fn negate(&mut self) {
        self.six_volume = -self.six_volume;
        self.first = -self.first;
        self.squares = -self.squares;
        self.products = -self.products;
    }

    pub(super) fn volume(&self) -> f64 {
        self.six_volume / 6.0
    }

    /// Mass properties at density 1 with the apex at `apex`. Without a positive volume there is no
    /// centre of mass: the apex stands for it.
    pub(super) fn properties(&self, apex: DVec3) -> MassProperties {
        let volume = self.volume();
        if volume <= 0.0 {
            return MassProperties {
                volume,
                mass: volume,
                centre_of_mass: apex,
                inertia: DMat3::ZERO,
            };
        }
        let centre = self.first / (24.0 * volume);
        let cyclic = DVec3::new(centre.y * centre.z, centre.z * centre.x, centre.x * centre.y);
        let squares = self.squares / 120.0 - volume * centre * centre;
        let products = self.products / 120.0 - volume * cyclic;
        let diagonal = DVec3::splat(squares.element_sum()) - squares;
        let inertia = DMat3::from_cols(
            DVec3::new(diagonal.x, -products.z, -products.y),
            DVec3::new(-products.z, diagonal.y, -products.x),
            DVec3::new(-products.y, -products.x, diagonal.z),
        );
        MassProperties { volume, mass: volume, centre_of_mass: centre + apex, inertia }
    }
}

/// Integrals over the given triangles about `apex`.
pub(super) fn integrate(
    mesh: &Mesh,
    triangles: impl Iterator<Item = u32>,
    apex: DVec3,
) -> Integrals {
    let mut integrals = Integrals::default();
    for triangle in triangles {
        integrals.add(mesh.corners(triangle).map(|corner| corner - apex));
    }
    integrals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Part;
    use crate::part::tests::cuboid;

    #[test]
    fn cuboid_off_the_origin_is_exact() {
        let (low, size) = (DVec3::new(0.3, -2.0, 7.0), DVec3::new(0.02, 0.03, 0.05));
        let (vertices, triangles) = cuboid(low, low + size);
        let part = Part::from_triangles("box", &vertices, &triangles).unwrap();
        let mass = part.mass_properties(1000.0);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
        near(mass.volume, 3e-5);
        near(mass.mass, 3e-2);
        assert!((mass.centre_of_mass - low - size / 2.0).length() < 1e-13);
        let expected = DVec3::new(
            0.03_f64.powi(2) + 0.05_f64.powi(2),
            0.02_f64.powi(2) + 0.05_f64.powi(2),
            0.02_f64.powi(2) + 0.03_f64.powi(2),
        ) * 3e-2
            / 12.0;
        assert!(
            (mass.inertia - DMat3::from_diagonal(expected))
                .to_cols_array()
                .iter()
                .all(|&x| x.abs() < 1e-12 * expected.x),
            "{}",
            mass.inertia
        );
    }
}
