//! One face under its pad: the pressure for a given tilt and normal force, and what it carries.

use glam::DVec2;
use nalgebra::{Matrix3, SVector, Vector3, Vector6};

use crate::contact::quadric::{Dissipation, Region};
use crate::contact::surface::{Field, Piece, is_behind};
use crate::model::Gap;

/// A face made ready.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) fields: Vec<Field>,
    /// Stiffness of the pad [Pa/m].
    pub(super) stiffness: f64,
    /// +1 on face I, -1 on face II.
    pub(super) sign: f64,
    reach: f64,
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
    pub(super) moved: Moved,
    /// `int p x^2`.
    second: f64,
}

/// What a pressure carries, linear in it: the normal force, `int p x`, `int p grad h`, and the moment
/// about `x3` of the push against the slope.
pub(super) type Carried = Vector6<f64>;

/// What a tilt moves besides, linear in it and in the pressure: of what turns with the body the force on
/// it along the pad and its moment about the closing axis; and of what rolls on the pad the normal force
/// times the tilt, and the first moment by which the pressure moves on the body.
pub(super) type Moved = SVector<f64, 7>;

/// A face under some compression and tilt, with the derivatives of what it carries.
#[derive(Debug, Clone)]
pub(super) struct Trial<'a> {
    pub(super) face: &'a Face,
    regions: Vec<Region>,
    pub(super) carried: Carried,
    /// Per compression, and per tilt in each of the directions asked for.
    pub(super) by: [Carried; 3],
    /// The derivatives as of `by`.
    pub(super) moved: Moved,
    pub(super) moved_by: [Moved; 3],
}

/// Dissipation and its derivatives in the planar twist of a face.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FaceDissipation {
    pub(super) value: f64,
    pub(super) gradient: Vector3<f64>,
    pub(super) hessian: Matrix3<f64>,
}

/// Most steps towards a normal force.
const STEPS: u32 = 200;
/// Share of a force that rounding may leave.
const ROUNDING: f64 = 1e-13;
/// Share of it from which one step is enough but for the rounding.
const NEAR: f64 = 1e-7;
/// Share of it below which nothing is gained.
const EXACT: f64 = 2e-16;

impl Face {
    pub(super) fn new<'p>(
        pieces: impl Iterator<Item = &'p Piece> + Clone,
        stiffness: f64,
        sign: f64,
    ) -> Self {
        let fields = pieces
            .clone()
            .filter(|piece| piece.outer.len() >= 3)
            .map(Field::new)
            .filter(|field| field.area() > 0.0)
            .collect();
        let corners = pieces.flat_map(|piece| &piece.outer);
        let reach = corners.map(|corner| corner.length()).fold(0.0, f64::max);
        Self { fields, stiffness, sign, reach }
    }

    /// Area of all pieces [m^2].
    pub(super) fn area(&self) -> f64 {
        self.fields.iter().map(Field::area).sum()
    }

    /// Distance of the farthest corner from the origin of the pad plane \[m\].
    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    /// The area pressed at a compression and tilt, and the normal force.
    fn press(&self, delta: f64, tilt: DVec2) -> (f64, f64) {
        let sums = self.fields.iter().map(|field| field.area_and_load(delta, self.sign * tilt));
        let (area, load) = sums.fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        (area, self.stiffness * load)
    }

    /// What a compression and tilt carry, with the derivatives for the compression and for more tilt
    /// in the `directions`, at most two.
    pub(super) fn trial(&self, delta: f64, tilt: DVec2, directions: &[DVec2]) -> Trial<'_> {
        let body = tilt;
        let tilt = self.sign * tilt;
        let mut trial = Trial {
            face: self,
            regions: Vec::with_capacity(self.fields.len()),
            carried: Carried::zeros(),
            by: [Carried::zeros(); 3],
            moved: Moved::zeros(),
            moved_by: [Moved::zeros(); 3],
        };
        for field in &self.fields {
            let region = field.pressed(delta, tilt);
            if !region.is_empty() {
                let sums = region.moments(&field.gap);
                let by = sums.map(|row| self.stiffness * Carried::from(field.carried(&row)));
                trial.carried += by[0];
                trial.by[0] += by[1];
                trial.moved += self.moved(field, &by[0], body);
                trial.moved_by[0] += self.moved(field, &by[1], body);
                for (i, direction) in directions.iter().enumerate() {
                    let (one, rise) = self.rise(field, *direction);
                    let more = one * by[1] + rise.x * by[2] + rise.y * by[3];
                    trial.by[1 + i] += more;
                    trial.moved_by[1 + i] +=
                        self.moved(field, &more, body) + self.moved(field, &by[0], *direction);
                }
            }
            trial.regions.push(region);
        }
        trial
    }

    /// What a tilt in a direction changes of the compression: a constant, and a slope in the
    /// surface's axes.
    fn rise(&self, field: &Field, direction: DVec2) -> (f64, DVec2) {
        let felt = self.sign * field.inward(field.felt(direction));
        (self.sign * direction.dot(field.origin), felt)
    }

    /// What a tilt moves of a pressure on a piece that carries so much.
    fn moved(&self, field: &Field, carried: &Carried, tilt: DVec2) -> Moved {
        let (load, first) = (carried[0], DVec2::new(carried[1], carried[2]));
        let felt = field.felt(tilt);
        let (push, turn) = (self.sign * load * felt, self.sign * first.perp_dot(felt));
        let (rest, rolled) = (load * (tilt - felt), load * field.rolled(tilt));
        Moved::from([push.x, push.y, turn, rest.x, rest.y, rolled.x, rolled.y])
    }

    /// The pressure that carries `load` at a tilt; `start`: a compression near that of the pad's plane.
    pub(super) fn carry(&self, load: f64, tilt: DVec2, start: Option<f64>) -> Option<Pressed<'_>> {
        let delta = self.carrying(load, tilt, start, EXACT)?;
        let (area, _) = self.press(delta, tilt);
        Some(self.measure(delta, tilt, self.regions(delta, tilt), load, area))
    }

    /// What a compression presses without tilt; `None` where that is nothing.
    pub(super) fn pressed_by(&self, delta: f64) -> Option<Pressed<'_>> {
        let (area, load) = self.press(delta, DVec2::ZERO);
        let regions = || self.regions(delta, DVec2::ZERO);
        (load > 0.0).then(|| self.measure(delta, DVec2::ZERO, regions(), load, area))
    }

    fn regions(&self, delta: f64, tilt: DVec2) -> Vec<Region> {
        self.fields.iter().map(|field| field.pressed(delta, self.sign * tilt)).collect()
    }

    /// The compression of [`Self::carry`] without tilt, and what it presses.
    pub(super) fn squeezed(&self, load: f64) -> Option<(f64, Vec<Region>)> {
        let delta = self.squeeze(load)?;
        Some((delta, self.regions(delta, DVec2::ZERO)))
    }

    /// Greatest pressure on regions \[Pa\].
    pub(super) fn greatest(&self, regions: &[Region]) -> f64 {
        self.stiffness * regions.iter().map(Region::greatest).fold(0.0, f64::max)
    }

    /// Greatest compression without tilt at one of the pad's plane \[m\].
    pub(super) fn compressed(&self, delta: f64) -> f64 {
        self.fields.iter().map(|field| field.greatest(delta)).fold(0.0, f64::max)
    }

    /// The compression of [`Self::carry`] without tilt.
    pub(super) fn squeeze(&self, load: f64) -> Option<f64> {
        self.carrying(load, DVec2::ZERO, None, EXACT)
    }

    /// The compression that carries `load` at a tilt, but for a share of `within` of it, or for
    /// rounding. The force grows convexly with the compression, so that Newton's method comes down to
    /// the answer from above after its first step.
    fn carrying(&self, load: f64, tilt: DVec2, start: Option<f64>, within: f64) -> Option<f64> {
        let nearest = self
            .fields
            .iter()
            .map(|field| field.nearest(self.sign * tilt))
            .fold(f64::INFINITY, f64::min);
        let mut step = load / (self.stiffness * self.area());
        let mut delta = start.unwrap_or(nearest + step);
        let mut best: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            let (area, carried) = self.press(delta, tilt);
            let error = carried - load;
            if !error.is_finite() {
                return None;
            }
            if carried <= 0.0 || area <= 0.0 {
                delta = delta.max(nearest) + step;
                step *= 2.0;
                continue;
            }
            if error.abs() <= within * load
                || best.is_some_and(|(_, least)| error.abs() >= least)
                    && error.abs() <= ROUNDING * load
            {
                return Some(delta);
            }
            // The step from so near leaves the square of it.
            if within > EXACT && error.abs() <= NEAR * load {
                return Some(delta - error / (self.stiffness * area));
            }
            if best.is_none_or(|(_, least)| error.abs() < least) {
                best = Some((delta, error.abs()));
            }
            delta -= error / (self.stiffness * area);
        }
        let (delta, error) = best?;
        (error <= 1e-9 * load).then_some(delta)
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
            moved: Moved::zeros(),
            second: 0.0,
        };
        for (field, region) in self.fields.iter().zip(&pressed.regions) {
            if region.is_empty() {
                continue;
            }
            let [sums @ .., second] =
                region.pressure_moments(&field.gap).map(|sum| self.stiffness * sum);
            let carried = field.carried(&sums);
            let [load, x1, x2, slope1, slope2, turn] = carried;
            let (first, around) = (DVec2::new(x1, x2), field.origin);
            pressed.first += first;
            pressed.slope += DVec2::new(slope1, slope2);
            pressed.turn += turn;
            pressed.moved += self.moved(field, &Carried::from(carried), tilt);
            // About the origin of the pad plane, from that of the surface's axes.
            pressed.second += second + around.dot(2.0 * first - load * around);
        }
        pressed
    }
}

impl<'a> Trial<'a> {
    /// As the pressure that carries `load`, which it does but for rounding.
    pub(super) fn pressed(self, delta: f64, tilt: DVec2, load: f64) -> Pressed<'a> {
        let area = self.by[0][0] / self.face.stiffness;
        self.face.measure(delta, tilt, self.regions, load, area)
    }

    /// Middle of pressure.
    pub(super) fn centre(&self) -> DVec2 {
        DVec2::new(self.carried[1], self.carried[2]) / self.carried[0]
    }

    /// The dissipation, and how its gradient changes with the compression and with more tilt in
    /// each of the `directions`.
    pub(super) fn dissipation(
        &self,
        v: &Vector3<f64>,
        directions: &[DVec2],
    ) -> (FaceDissipation, [Vector3<f64>; 3]) {
        let mut sum = FaceDissipation::default();
        let mut by = [Vector3::zeros(); 3];
        if v.amax() == 0.0 {
            return (sum, by);
        }
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if region.is_empty() {
                continue;
            }
            let (found, rows) = region.dissipation_by_pressure(local(field, v));
            sum.add(field, &found);
            let rows = rows.map(|row| back(field, row));
            by[0] += rows[0];
            for (sum, direction) in by[1..].iter_mut().zip(directions) {
                let (one, rise) = self.face.rise(field, *direction);
                *sum += one * rows[0] + rise.x * rows[1] + rise.y * rows[2];
            }
        }
        let k = self.face.stiffness;
        (sum.times(k), by.map(|row| k * row))
    }
}

/// The compression at the plane of a pad on `pieces` that carries `load` without tilt, looked for from
/// `start` on \[m\].
pub(super) fn compression(pieces: &[Piece], stiffness: f64, load: f64, start: f64) -> Option<f64> {
    let is_plane = |piece: &Piece| matches!(piece.gap, Gap::Plane { .. });
    let round = || pieces.iter().filter(|piece| !is_plane(piece));
    let found = |face: Face| face.carrying(load, DVec2::ZERO, Some(start), ROUNDING);
    // Without the planes beside round pieces the compression is greater, if anything: mostly they are out
    // of reach.
    if round().next().is_some()
        && let Some(delta) = found(Face::new(round(), stiffness, 1.0))
        && pieces.iter().filter(|piece| is_plane(piece)).all(|plane| is_behind(plane, delta))
    {
        return Some(delta);
    }
    found(Face::new(pieces.iter(), stiffness, 1.0))
}

/// A twist of the pad plane in a surface's own axes.
fn local(field: &Field, v: &Vector3<f64>) -> [f64; 3] {
    let (o, e) = (field.origin, field.axis);
    let (u1, u2) = (v.x - v.z * o.y, v.y + v.z * o.x);
    [e.x * u1 + e.y * u2, e.x * u2 - e.y * u1, v.z]
}

/// What does work on such a twist, for one of the pad plane.
fn back(field: &Field, [g1, g2, g3]: [f64; 3]) -> Vector3<f64> {
    let (o, e) = (field.origin, field.axis);
    let (f1, f2) = (e.x * g1 - e.y * g2, e.y * g1 + e.x * g2);
    Vector3::new(f1, f2, g3 + o.x * f2 - o.y * f1)
}

impl FaceDissipation {
    fn add(&mut self, field: &Field, found: &Dissipation) {
        self.value += found.value;
        self.gradient += back(field, found.gradient);
        // Once for the rows, once for the columns.
        let rows = found.hessian.map(|row| back(field, row));
        for j in 0..3 {
            let column = back(field, [rows[0][j], rows[1][j], rows[2][j]]);
            for i in 0..3 {
                self.hessian[(i, j)] += column[i];
            }
        }
    }

    fn times(self, k: f64) -> Self {
        Self { value: k * self.value, gradient: k * self.gradient, hessian: k * self.hessian }
    }
}

impl Pressed<'_> {
    /// Visits points of the pressed area: place, slope of the gap there, normal force of the point.
    pub(super) fn points(&self, mut visit: impl FnMut(DVec2, DVec2, f64)) {
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            region.points(|x, weight| {
                let p = self.face.stiffness * weight * region.compression(x);
                visit(field.origin + field.outward(x), field.slope(x), p);
            });
        }
    }

    /// What the pressure carries.
    pub(super) fn carried(&self) -> Carried {
        let Self { load, first, slope, turn, .. } = *self;
        Carried::new(load, first.x, first.y, slope.x, slope.y, turn)
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
        let mut sum = FaceDissipation::default();
        if v.amax() == 0.0 {
            return sum;
        }
        for (field, region) in self.face.fields.iter().zip(&self.regions) {
            if !region.is_empty() {
                sum.add(field, &region.dissipation(local(field, v)));
            }
        }
        sum.times(self.face.stiffness)
    }

    /// The gradient alone, of a translation without any integral.
    pub(super) fn support(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let speed = v.x.hypot(v.y);
        if v.z != 0.0 || speed == 0.0 {
            return self.dissipation(v).gradient;
        }
        let e = DVec2::new(v.x, v.y) / speed;
        Vector3::new(self.load * e.x, self.load * e.y, self.first.perp_dot(e))
    }
}
