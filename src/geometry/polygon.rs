//! Measures of rings, polygons and patches: area, moments, bounds, sense, point location, rigid
//! maps.

use glam::{DAffine2, DMat2, DVec2};

use crate::model::{Polygon, Ring};

/// Area, centroid and second moments of a plane region.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    /// Area [m^2].
    pub area: f64,
    /// Centroid \[m\]; zero when the area is zero.
    pub centroid: DVec2,
    /// Second moments about the centroid, `int (x - c)(x - c)^T dA` [m^4].
    pub second: DMat2,
}

/// An axis-parallel rectangle. Empty (`min > max`) until a point is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds2 {
    /// Smallest coordinates \[m\].
    pub min: DVec2,
    /// Largest coordinates \[m\].
    pub max: DVec2,
}

impl Bounds2 {
    /// Contains nothing.
    pub const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    /// The smallest rectangle around `points`.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a DVec2>) -> Self {
        let Self { mut min, mut max } = Self::EMPTY;
        for &point in points {
            (min, max) = (min.min(point), max.max(point));
        }
        Self { min, max }
    }

    /// The smallest rectangle around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Grown by `margin` on every side \[m\].
    #[must_use]
    pub fn grown(self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Whether the closed rectangles share a point.
    #[inline]
    pub fn meets(self, other: Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Whether no point was added.
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Side lengths \[m\].
    pub fn size(self) -> DVec2 {
        self.max - self.min
    }

    /// Middle \[m\].
    pub fn centre(self) -> DVec2 {
        (self.min + self.max) / 2.0
    }
}

/// Area of a ring [m^2], positive when counter-clockwise. Computed about the ring's first point, so
/// that a small ring far from the origin loses no digits.
pub fn ring_area(ring: &[DVec2]) -> f64 {
    let Some(&base) = ring.first() else { return 0.0 };
    ring.windows(2).map(|edge| (edge[0] - base).perp_dot(edge[1] - base)).sum::<f64>() / 2.0
}

/// Area of a normalised polygon, holes taken off [m^2].
pub fn area(polygon: &Polygon) -> f64 {
    rings(polygon).map(ring_area).sum()
}

/// Area of a patch of normalised, disjoint polygons [m^2].
pub fn patch_area(patch: &[Polygon]) -> f64 {
    patch.iter().map(area).sum()
}

/// All rings of a polygon, the outer one first.
pub fn rings(polygon: &Polygon) -> impl Iterator<Item = &[DVec2]> {
    std::iter::once(polygon.outer.as_slice()).chain(polygon.holes.iter().map(Vec::as_slice))
}

/// Bounding rectangle of a patch.
pub fn bounds(patch: &[Polygon]) -> Bounds2 {
    Bounds2::of(patch.iter().flat_map(|polygon| &polygon.outer))
}

/// Moments of a normalised polygon.
pub fn moments(polygon: &Polygon) -> Moments {
    patch_moments(std::slice::from_ref(polygon))
}

/// Moments of a patch of normalised, disjoint polygons.
pub fn patch_moments(patch: &[Polygon]) -> Moments {
    let all: Vec<&[DVec2]> = patch.iter().flat_map(rings).collect();
    rings_moments(&all)
}

/// Moments of the region bounded by signed rings (outer counter-clockwise, holes clockwise).
pub fn rings_moments(rings: &[&[DVec2]]) -> Moments {
    let Some(&base) = rings.iter().find_map(|ring| ring.first()) else { return Moments::default() };
    // Sums over the triangles (base, a, b); `base` near the region keeps the digits.
    let (mut area, mut first, mut second) = (0.0, DVec2::ZERO, DMat2::ZERO);
    for ring in rings {
        for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let (a, b) = (a - base, b - base);
            let twice = a.perp_dot(b);
            area += twice / 2.0;
            first += (a + b) * (twice / 6.0);
            let sum = a + b;
            second += (outer(a, a) + outer(b, b) + outer(sum, sum)) * (twice / 24.0);
        }
    }
    if area == 0.0 {
        return Moments::default();
    }
    let centroid = first / area;
    Moments { area, centroid: centroid + base, second: second - outer(centroid, centroid) * area }
}

/// `a b^T`.
pub(crate) fn outer(a: DVec2, b: DVec2) -> DMat2 {
    DMat2::from_cols(a * b.x, a * b.y)
}

/// Turns the outer ring counter-clockwise and the holes clockwise, and drops repeated and
/// last-equals-first points and rings of fewer than three points.
pub fn normalise(polygon: &mut Polygon) {
    clean(&mut polygon.outer);
    if ring_area(&polygon.outer) < 0.0 {
        polygon.outer.reverse();
    }
    for hole in &mut polygon.holes {
        clean(hole);
        if ring_area(hole) > 0.0 {
            hole.reverse();
        }
    }
    polygon.holes.retain(|hole| hole.len() >= 3);
}

fn clean(ring: &mut Ring) {
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
}

/// The polygon under a rigid map (a reflection reverses the rings, so that the result is normalised
/// again).
#[must_use]
pub fn transform(polygon: &Polygon, map: &DAffine2) -> Polygon {
    transformed(polygon.clone(), map)
}

/// [`transform`] in place.
pub(crate) fn transformed(mut polygon: Polygon, map: &DAffine2) -> Polygon {
    let reflected = map.matrix2.determinant() < 0.0;
    for ring in std::iter::once(&mut polygon.outer).chain(&mut polygon.holes) {
        ring.iter_mut().for_each(|point| *point = map.transform_point2(*point));
        if reflected {
            ring.reverse();
        }
    }
    polygon
}

/// Whether `point` lies inside the polygon (even-odd over all its rings; exact predicates, so the
/// answer never depends on rounding). Points on the boundary may go either way, but neighbouring
/// polygons never both claim or both miss one.
pub fn contains(polygon: &Polygon, point: DVec2) -> bool {
    rings(polygon).fold(false, |inside, ring| inside ^ ring_contains(ring, point))
}

/// Even-odd membership of one ring, whatever its sense.
pub fn ring_contains(ring: &[DVec2], point: DVec2) -> bool {
    let mut inside = false;
    for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        inside ^= crosses_right(a, b, point);
    }
    inside
}

/// Whether the edge passes the height of `point` (its lower end included, its upper end not) at the
/// right of it.
pub(crate) fn crosses_right(a: DVec2, b: DVec2, point: DVec2) -> bool {
    if (a.y > point.y) == (b.y > point.y) {
        return false;
    }
    if a.x > point.x && b.x > point.x {
        return true;
    }
    if a.x <= point.x && b.x <= point.x {
        return false;
    }
    let (low, high) = if a.y < b.y { (a, b) } else { (b, a) };
    let coordinate = |point: DVec2| robust::Coord { x: point.x, y: point.y };
    robust::orient2d(coordinate(low), coordinate(high), coordinate(point)) > 0.0
}

/// Distance of a corner from the line between its neighbours, as a share of the ring's size, up to which
/// it is rounding.
const ON_LINE: f64 = 1e-10;

/// A ring without corners on straight lines: what the chords of a round end are, seen from the side.
pub(crate) fn straightened(ring: &[DVec2]) -> Ring {
    let least = ON_LINE * Bounds2::of(ring).size().max_element();
    let mut kept: Ring = Vec::with_capacity(ring.len());
    let Some(&last) = ring.last() else { return kept };
    for (index, &corner) in ring.iter().enumerate() {
        let before = kept.last().copied().unwrap_or(last);
        // Of two at one place, first and last, one stays.
        let after = ring.get(index + 1).or_else(|| kept.first()).copied().unwrap_or(last);
        let (along, way) = (after - before, corner - before);
        let is_on_line = along.perp_dot(way).abs() <= least * along.length()
            && (0.0..=along.length_squared()).contains(&along.dot(way));
        if !is_on_line {
            kept.push(corner);
        }
    }
    if kept.len() < 3 { ring.to_vec() } else { kept }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::rectangle;

    fn square_with_hole() -> Polygon {
        let mut polygon = Polygon {
            outer: rectangle(DVec2::splat(2.0)),
            holes: vec![rectangle(DVec2::splat(1.0))],
        };
        normalise(&mut polygon);
        polygon
    }

    #[test]
    fn corners_on_lines_are_none() {
        let at = |x: f64, y: f64| DVec2::new(x, y);
        // One on a side, one twice, and one a hair off a side; then one that stands out.
        let ring = [
            at(0., 0.),
            at(1., 0.),
            at(3., 0.),
            at(3., 2.),
            at(3., 2.),
            at(1., 2. + 1e-11),
            at(0., 2.),
        ];
        let corners = [at(0., 0.), at(3., 0.), at(3., 2.), at(0., 2.)];
        assert_eq!(straightened(&ring), corners);
        let mut out = corners.to_vec();
        out.insert(1, at(1.0, -1e-8));
        assert_eq!(straightened(&out), out);
        // One that is there twice, first and last, in either order.
        for other in [at(1e-17, -1e-17), at(-1e-17, 1e-17), at(0., 0.)] {
            for (first, last) in [(corners[0], other), (other, corners[0])] {
                let ring = [first, corners[1], corners[2], corners[3], last];
                assert!((ring_area(&straightened(&ring)) - 6.0).abs() < 1e-9, "{ring:?}");
            }
        }
        // A way back along itself stays.
        let spike = [at(0., 0.), at(2., 0.), at(1., 0.), at(1., 1.)];
        assert_eq!(ring_area(&straightened(&spike)), ring_area(&spike));
    }

    #[test]
    fn measures_a_hollow_square() {
        let polygon = square_with_hole();
        let moments = moments(&polygon);
        assert!((moments.area - 3.0).abs() < 1e-15 && moments.centroid.length() < 1e-15);
        // (2^4 - 1^4)/12 about each axis
        assert!(
            (moments.second - DMat2::from_diagonal(DVec2::splat(15.0 / 12.0)))
                .abs_diff_eq(DMat2::ZERO, 1e-14)
        );
        assert!(
            contains(&polygon, DVec2::new(0.75, 0.0))
                && !contains(&polygon, DVec2::ZERO)
                && !contains(&polygon, DVec2::new(3.0, 0.1))
        );
    }

    #[test]
    fn keeps_its_digits_far_from_the_origin() {
        let far = transform(
            &square_with_hole(),
            &DAffine2::from_angle_translation(0.3, DVec2::new(1e6, -2e6)),
        );
        let moments = moments(&far);
        assert!((moments.area - 3.0).abs() < 1e-9, "{moments:?}");
        assert!((moments.second.determinant() - 1.5625).abs() < 1e-8, "{moments:?}");
    }

    #[test]
    fn a_reflection_keeps_the_sense() {
        let mirror = DAffine2::from_mat2(DMat2::from_diagonal(DVec2::new(1.0, -1.0)));
        assert!((area(&transform(&square_with_hole(), &mirror)) - 3.0).abs() < 1e-15);
    }

    #[test]
    fn normalise_mends_sense_and_repeated_points() {
        let mut ring = rectangle(DVec2::ONE);
        ring.reverse();
        ring.push(ring[0]);
        ring.insert(1, ring[1]);
        let mut polygon = Polygon { outer: ring, holes: vec![vec![DVec2::ZERO; 4]] };
        normalise(&mut polygon);
        assert_eq!((polygon.outer.len(), polygon.holes.len()), (4, 0));
        assert!((area(&polygon) - 1.0).abs() < 1e-15);
    }
}
