//! One face under its pad: the pressure for a given tilt and normal force, and what it carries.

use glam::DVec2;
use nalgebra::{Matrix3, Vector3};

use crate::contact::quadric::Region;
use crate::contact::surface::{Field, Piece};

/// A face made ready.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) fields: Vec<Field>,
    /// Stiffness of the pad [Pa/m].
    stiffness: f64,
    /// +1 on face I, -1 on face II.
    pub(super) sign: f64,
}

/// A face with a pressure on it.
#[derive(Debug, Clone)]
pub(super) struct Pressed<'a> {
    pub(super) face: &'a Face,
    /// Compression at the origin of the pad plane \[m\].
    pub(super) delta: f64,
    /// The pressed part of each piece.
    pub(super) regions: Vec<Region>,
    /// Normal force \[N\].
    pub(super) load: f64,
    /// Pressed area [m^2].
    pub(super) area: f64,
    /// `int p x`.
    pub(super) first: DVec2,
    /// `int p grad h`: the pressure pushes the body along the pad by as much, the other way.
    pub(super) slope: DVec2,
    /// Moment about `x3` of that push.
    pub(super) turn: f64,
    /// What the tilt adds to the push, left out as for planar contacts.
    pub(super) tilted: DVec2,
    /// `int p x^2`.
    second: f64,
}

/// Dissipation and its derivatives in the planar twist of a face.
#[derive(Debug, Clone, Copy)]
pub(super) struct FaceDissipation {
    pub(super) value: f64,
    pub(super) gradient: Vector3<f64>,
    pub(super) hessian: Matrix3<f64>,
}

/// Most steps towards a normal force.
const STEPS: u32 = 200;

impl Face {
    pub(super) fn new(pieces: &[Piece], stiffness: f64, sign: f64) -> Self {
        let fields = pieces
            .iter()
            .filter(|piece| piece.outer.len() >= 3)
            .map(Field::new)
            .filter(|field| field.area() > 0.0)
            .collect();
        Self { fields, stiffness, sign }
    }

    /// Area of all pieces [m^2].
    pub(super) fn area(&self) -> f64 {
        self.fields.iter().map(Field::area).sum()
    }

    /// The regions pressed at a compression and tilt, their area, and the normal force.
    fn press(&self, delta: f64, tilt: DVec2) -> (Vec<Region>, f64, f64) {
        let regions: Vec<Region> =
            self.fields.iter().map(|field| field.pressed(delta, self.sign * tilt)).collect();
        let (area, load) = regions.iter().fold((0.0, 0.0), |(area, load), region| {
            let (a, l) = region.area_and_load();
            (area + a, load + l)
        });
        (regions, area, self.stiffness * load)
    }

    /// The pressure that carries `load` at a tilt. The force grows convexly with the compression,
    /// so that Newton's method comes down to the answer from above after its first step.
    pub(super) fn carry(&self, load: f64, tilt: DVec2, start: Option<f64>) -> Option<Pressed<'_>> {
        let nearest = self
            .fields
            .iter()
            .map(|field| field.nearest(self.sign * tilt))
            .fold(f64::INFINITY, f64::min);
        let mut step = load / (self.stiffness * self.area());
        let mut delta = start.unwrap_or(nearest + step);
        let mut best: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            let (regions, area, carried) = self.press(delta, tilt);
            let error = carried - load;
            if !error.is_finite() {
                return None;
            }
            if carried <= 0.0 || area <= 0.0 {
                delta = delta.max(nearest) + step;
                step *= 2.0;
                continue;
            }
            if error.abs() <= 2e-16 * load
                || best.is_some_and(|(_, least)| error.abs() >= least)
                    && error.abs() <= 1e-13 * load
            {
                return Some(self.measure(delta, tilt, regions, load, area));
            }
            if best.is_none_or(|(_, least)| error.abs() < least) {
                best = Some((delta, error.abs()));
            }
            delta -= error / (self.stiffness * area);
        }
        let (delta, error) = best?;
        let (regions, area, _) = self.press(delta, tilt);
        (error <= 1e-9 * load).then(|| self.measure(delta, tilt, regions, load, area))
    }

    fn measure(
        &self,
        delta: f64,
        tilt: DVec2,
        regions: Vec<Region>,
        load: f64,
        area: f64,
    ) -> Pressed<'_> {
        let mut pressed = Pressed {
            face: self,
            delta,
            regions,
            load,
            area,
            first: DVec2::ZERO,
            slope: DVec2::ZERO,
            turn: 0.0,
            tilted: DVec2::ZERO,
            second: 0.0,
        };
        let (mut first, mut slope, mut second) = (DVec2::ZERO, DVec2::ZERO, 0.0);
        let (mut turn, mut tilted) = (0.0, DVec2::ZERO);
        pressed.each(|field, x, grade, p| {
            first += p * x;
            slope += p * grade;
            second += p * x.length_squared();
            turn -= p * x.perp_dot(grade);
            tilted += p * self.sign * field.felt(tilt);
        });
        (pressed.first, pressed.slope, pressed.second) = (first, slope, second);
        (pressed.turn, pressed.tilted) = (turn, tilted);
        pressed
    }
}

impl Pressed<'_> {
    /// Visits points of the pressed area: place, slope of the gap there, normal force of the point.
    pub(super) fn points(&self, mut visit: impl FnMut(DVec2, DVec2, f64)) {
        self.each(|_, x, slope, p| visit(x, slope, p));
    }

    fn each(&self, mut visit: impl FnMut(&Field, DVec2, DVec2, f64)) {
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            region.points(|x, weight| {
                let p = self.face.stiffness * weight * region.compression(x);
                visit(field, field.origin + field.outward(x), field.slope(x), p);
            });
        }
    }

    /// Middle of pressure.
    pub(super) fn centre(&self) -> DVec2 {
        self.first / self.load
    }

    /// Mean square distance of the pressure from its middle [m^2].
    pub(super) fn spread(&self) -> f64 {
        (self.second / self.load - self.centre().length_squared()).max(0.0)
    }

    /// The different slopes along `across` of the pressed pieces, rising, if all are plane; else
    /// none.
    pub(super) fn slopes(&self, across: DVec2) -> Vec<f64> {
        let mut slopes = Vec::new();
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if region.is_empty() {
                continue;
            }
            if field.gap.l != DVec2::ZERO {
                return Vec::new();
            }
            slopes.push(across.dot(field.slope(DVec2::ZERO)));
        }
        slopes.sort_by(f64::total_cmp);
        slopes.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        slopes
    }

    /// Greatest compression \[m\].
    pub(super) fn compression(&self) -> f64 {
        self.regions.iter().map(Region::greatest).fold(0.0, f64::max)
    }

    /// Greatest pressure \[Pa\].
    pub(super) fn greatest(&self) -> f64 {
        self.face.stiffness * self.compression()
    }

    /// Smallest box around what is pressed: `[low, high]`.
    pub(super) fn extent(&self) -> [DVec2; 2] {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            for x in region.outline() {
                let x = field.origin + field.outward(x);
                low = low.min(x);
                high = high.max(x);
            }
        }
        [low, high]
    }

    /// Extent of the pressed part along a direction: lowest and highest `e . x`.
    pub(super) fn extent_along(&self, e: DVec2) -> [f64; 2] {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            for x in region.outline() {
                let along = e.dot(field.origin + field.outward(x));
                (low, high) = (low.min(along), high.max(along));
            }
        }
        [low, high]
    }

    /// `int p |v| dA` for a planar twist about the origin; zero with zero derivatives at rest.
    pub(super) fn dissipation(&self, v: &Vector3<f64>) -> FaceDissipation {
        let mut sum =
            FaceDissipation { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        if v.amax() == 0.0 {
            return sum;
        }
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if region.is_empty() {
                continue;
            }
            let (o, e) = (field.origin, field.axis);
            // The twist in the surface's own axes.
            let local = Matrix3::new(
                e.x,
                e.y,
                e.y * o.x - e.x * o.y, //
                -e.y,
                e.x,
                e.y * o.y + e.x * o.x, //
                0.0,
                0.0,
                1.0,
            );
            let found = region.dissipation((local * v).into());
            sum.value += found.value;
            sum.gradient += local.tr_mul(&Vector3::from(found.gradient));
            let bend = Matrix3::from_fn(|i, j| found.hessian[i][j]);
            sum.hessian += local.tr_mul(&bend) * local;
        }
        let k = self.face.stiffness;
        FaceDissipation {
            value: k * sum.value,
            gradient: k * sum.gradient,
            hessian: k * sum.hessian,
        }
    }
}
