//! Shanno's conjugate-direction minimiser with Beale-Powell restarts: the optimiser the paper names
//! as its reference \[17\].
//!
//! D. F. Shanno, "Conjugate gradient methods with inexact searches", Mathematics of Operations
//! Research 3 (1978); the algorithm is the one known as CONMIN. It keeps two pairs of vectors (the
//! last step, and the last restart) and needs no matrix. The line search is inexact: Wolfe's
//! conditions with a cubic through the last two trial points.
//!
//! It finds a stationary point near the start. Whether that point answers the question asked is the
//! caller's to check.

/// Sufficient decrease of Wolfe's first condition, as published.
const DECREASE: f64 = 1e-4;
/// Allowed share of the old slope in Wolfe's second condition, as published.
const CURVATURE: f64 = 0.9;
/// Powell's test: restart when successive gradients are this far from orthogonal.
const POWELL: f64 = 0.2;
/// Largest growth of the step from one trial to the next. A badly scaled quadratic rightly asks for
/// thousands.
const LONGEST_JUMP: f64 = 1e6;
/// Trials of one line search before it is given up; a healthy one takes two to four.
const LINE_TRIALS: u32 = 40;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Options {
    /// Stop when `|g| <= gradient_tolerance * max(1, |x|)`; 0 asks for as much as the arithmetic
    /// gives.
    pub gradient_tolerance: f64,
    /// Stop when the value is at or below this; negative infinity for never.
    pub value_target: f64,
    /// Stop after this many evaluations.
    pub max_evaluations: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { gradient_tolerance: 1e-10, value_target: f64::NEG_INFINITY, max_evaluations: 2000 }
    }
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The gradient is as small as asked.
    Gradient,
    /// The value is as small as asked.
    Value,
    /// No lower point along the steepest descent: the value's rounding decides here.
    LineSearch,
    /// The evaluations are used up.
    EvaluationLimit,
    /// Value or gradient at the start is not finite.
    NotFinite,
    /// The caller's own condition (see [`minimise_until`]).
    Caller,
}

/// Where the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Minimum<const N: usize> {
    /// The best point.
    pub x: [f64; N],
    /// Value there.
    pub value: f64,
    /// Gradient there.
    pub gradient: [f64; N],
    /// Directions searched.
    pub iterations: u32,
    /// Values (each with its gradient) computed.
    pub evaluations: u32,
    /// Beale-Powell restarts among the iterations.
    pub restarts: u32,
    /// Why it ended.
    pub reason: StopReason,
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// `a + t b`.
fn plus<const N: usize>(a: &[f64; N], t: f64, b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + t * b[i])
}

/// The step and gradient change of the last restart: the two-vector approximation `H` of the
/// inverse Hessian.
struct Memory<const N: usize> {
    step: [f64; N],
    change: [f64; N],
    step_change: f64,
    change_change: f64,
}

impl<const N: usize> Memory<N> {
    /// `None` when the pair carries no curvature (rounding, or a concave stretch that Wolfe's test
    /// let through).
    fn new(step: [f64; N], change: [f64; N]) -> Option<Self> {
        let (step_change, change_change) = (dot(&step, &change), dot(&change, &change));
        (step_change > 0.0
            && change_change > 0.0
            && step_change.is_finite()
            && change_change.is_finite())
        .then_some(Self { step, change, step_change, change_change })
    }

    /// `H w`.
    fn apply(&self, w: &[f64; N]) -> [f64; N] {
        let (step_w, change_w) = (dot(&self.step, w), dot(&self.change, w));
        let along_change = -step_w / self.change_change;
        let along_step = 2.0 * step_w / self.step_change - change_w / self.change_change;
        let scale = self.step_change / self.change_change;
        std::array::from_fn(|i| {
            scale * w[i] + along_change * self.change[i] + along_step * self.step[i]
        })
    }

    /// The next direction from the last step and gradient change (Shanno's equation for a step
    /// within a restart cycle).
    fn direction(&self, gradient: &[f64; N], step: &[f64; N], change: &[f64; N]) -> [f64; N] {
        let (h_gradient, h_change) = (self.apply(gradient), self.apply(change));
        let step_change = dot(step, change);
        let step_gradient = dot(step, gradient) / step_change;
        let along_step = (1.0 + dot(change, &h_change) / step_change) * step_gradient
            - dot(change, &h_gradient) / step_change;
        std::array::from_fn(|i| -h_gradient[i] + step_gradient * h_change[i] - along_step * step[i])
    }
}

/// A point on the line: step length, value, slope along the direction.
#[derive(Clone, Copy)]
struct Trial {
    step: f64,
    value: f64,
    slope: f64,
}

/// Next step length from the cubic through two trials, kept between safe limits.
fn next_step(before: Trial, now: Trial) -> f64 {
    let u = before.slope + now.slope - 3.0 * (before.value - now.value) / (before.step - now.step);
    let root = (u * u - before.slope * now.slope).max(0.0).sqrt();
    let cubic = now.step
        - (now.step - before.step) * (now.slope + root - u)
            / (now.slope - before.slope + 2.0 * root);
    let (low, high) =
        if before.step < now.step { (before.step, now.step) } else { (now.step, before.step) };
    if before.slope * now.slope < 0.0 {
        // The minimum lies between the two; near the line's origin it may be arbitrarily close to
        // it.
        return if cubic > 1.01 * low && cubic < 0.99 * high { cubic } else { 0.5 * (low + high) };
    }
    if now.slope > 0.0 {
        // Both lie beyond it.
        return if cubic > 0.0 && cubic < 0.99 * low { cubic } else { 0.5 * low };
    }
    // Both lie before it. A cubic that runs away is held back.
    if cubic > 1.01 * high { cubic.min(LONGEST_JUMP * high) } else { 2.0 * high }
}

/// Minimises `evaluate` (value and gradient at a point) from `start`.
///
/// A point whose value or gradient is not finite is stepped back from, so `evaluate` may answer NaN
/// outside its domain.
pub(crate) fn minimise<const N: usize>(
    start: [f64; N],
    options: &Options,
    evaluate: impl FnMut(&[f64; N]) -> (f64, [f64; N]),
) -> Minimum<N> {
    minimise_until(start, options, evaluate, |_| false)
}

/// As [`minimise`], ending also when `stop` holds at the point that a line search arrives at.
pub(crate) fn minimise_until<const N: usize>(
    start: [f64; N],
    options: &Options,
    mut evaluate: impl FnMut(&[f64; N]) -> (f64, [f64; N]),
    mut stop: impl FnMut(&[f64; N]) -> bool,
) -> Minimum<N> {
    let (value, gradient) = evaluate(&start);
    let mut at = Minimum {
        x: start,
        value,
        gradient,
        iterations: 0,
        evaluations: 1,
        restarts: 0,
        reason: StopReason::NotFinite,
    };
    if !value.is_finite() || gradient.iter().any(|g| !g.is_finite()) {
        return at;
    }
    let mut direction = gradient.map(|g| -g);
    let mut slope = -dot(&gradient, &gradient);
    let mut steepest = true;
    let mut trial_step = 1.0 / (-slope).sqrt();
    let mut memory: Option<Memory<N>> = None;
    let mut since_restart = 0;
    loop {
        if let Some(reason) = finished(&at, options) {
            at.reason = reason;
            return at;
        }
        let previous = at;
        let Some(step) =
            search_line(&mut at, &direction, slope, trial_step, options, &mut evaluate)
        else {
            if at.evaluations >= options.max_evaluations {
                at.reason = StopReason::EvaluationLimit;
                return at;
            }
            if steepest {
                at.reason = StopReason::LineSearch;
                return at;
            }
            // The conjugate direction led nowhere: begin again downhill before giving up.
            (direction, slope) = (at.gradient.map(|g| -g), -dot(&at.gradient, &at.gradient));
            (steepest, memory, trial_step) = (true, None, 1.0 / (-slope).sqrt());
            continue;
        };
        at.iterations += 1;
        if stop(&at.x) {
            at.reason = StopReason::Caller;
            return at;
        }
        let moved = std::array::from_fn(|i| at.x[i] - previous.x[i]);
        let change = std::array::from_fn(|i| at.gradient[i] - previous.gradient[i]);
        since_restart += 1;
        let powell =
            dot(&at.gradient, &previous.gradient).abs() > POWELL * dot(&at.gradient, &at.gradient);
        let restart = steepest || powell || since_restart >= N as u32;
        let next = match (&memory, restart) {
            (Some(memory), false) if dot(&moved, &change) > 0.0 => {
                Some(memory.direction(&at.gradient, &moved, &change))
            }
            _ => {
                memory = Memory::new(moved, change);
                at.restarts += 1;
                since_restart = 0;
                memory.as_ref().map(|memory| memory.apply(&at.gradient).map(|g| -g))
            }
        };
        let old_slope = slope;
        let descent = next.filter(|d| {
            let next_slope = dot(d, &at.gradient);
            next_slope < 0.0 && next_slope.is_finite()
        });
        if let Some(next) = descent {
            direction = next;
            slope = dot(&direction, &at.gradient);
            steepest = false;
            trial_step = if since_restart == 0 { 1.0 } else { step * old_slope / slope };
        } else {
            (direction, slope) = (at.gradient.map(|g| -g), -dot(&at.gradient, &at.gradient));
            (steepest, memory, trial_step) = (true, None, 1.0 / (-slope).sqrt());
        }
    }
}

fn finished<const N: usize>(at: &Minimum<N>, options: &Options) -> Option<StopReason> {
    let gradient = dot(&at.gradient, &at.gradient).sqrt();
    if gradient <= options.gradient_tolerance * dot(&at.x, &at.x).sqrt().max(1.0) || gradient == 0.0
    {
        Some(StopReason::Gradient)
    } else if at.value <= options.value_target {
        Some(StopReason::Value)
    } else if at.evaluations >= options.max_evaluations {
        Some(StopReason::EvaluationLimit)
    } else {
        None
    }
}

/// Moves `at` to a point of the line that meets Wolfe's conditions, and returns its step length.
/// Without one, `at` moves to the lowest point tried if that is lower than the start (its step is
/// returned), else stays (`None`).
fn search_line<const N: usize>(
    at: &mut Minimum<N>,
    direction: &[f64; N],
    slope: f64,
    first: f64,
    options: &Options,
    evaluate: &mut impl FnMut(&[f64; N]) -> (f64, [f64; N]),
) -> Option<f64> {
    let origin = *at;
    let mut before = Trial { step: 0.0, value: origin.value, slope };
    let mut step = first;
    let mut best: Option<(f64, Minimum<N>)> = None;
    for trials in 1..=LINE_TRIALS {
        if at.evaluations >= options.max_evaluations || !step.is_finite() {
            break;
        }
        let x = plus(&origin.x, step, direction);
        if x == origin.x {
            break;
        }
        let (value, gradient) = evaluate(&x);
        at.evaluations += 1;
        let now = Trial { step, value, slope: dot(&gradient, direction) };
        if !value.is_finite() || !now.slope.is_finite() {
            // Outside the domain: back towards the last good point.
            step = if before.step < step { 0.5 * (before.step + step) } else { 0.5 * step };
            continue;
        }
        let point = Minimum { x, value, gradient, ..origin };
        let decreased = value <= origin.value + DECREASE * step * slope;
        let flat = now.slope.abs() <= CURVATURE * slope.abs();
        // At least two trials a line: one inexact trial leaves too little of the conjugacy that the
        // update relies on.
        if decreased && flat && (trials >= 2 || now.slope.abs() <= 1e-9 * slope.abs()) {
            best = Some((step, point));
            break;
        }
        if value < best.as_ref().map_or(origin.value, |(_, b)| b.value) {
            best = Some((step, point));
        }
        step = next_step(before, now);
        before = now;
    }
    let (step, point) = best?;
    *at = Minimum { evaluations: at.evaluations, ..point };
    Some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wood(x: &[f64; 4]) -> (f64, [f64; 4]) {
        let (a, b) = (x[1] - x[0] * x[0], x[3] - x[2] * x[2]);
        let (p, q, r, s) = (1.0 - x[0], 1.0 - x[2], x[1] - 1.0, x[3] - 1.0);
        let value =
            100.0 * a * a + p * p + 90.0 * b * b + q * q + 10.1 * (r * r + s * s) + 19.8 * r * s;
        let gradient = [
            -400.0 * x[0] * a - 2.0 * p,
            200.0 * a + 20.2 * r + 19.8 * s,
            -360.0 * x[2] * b - 2.0 * q,
            180.0 * b + 20.2 * s + 19.8 * r,
        ];
        (value, gradient)
    }

    fn rosenbrock(x: &[f64; 2]) -> (f64, [f64; 2]) {
        let a = x[1] - x[0] * x[0];
        (100.0 * a * a + (1.0 - x[0]).powi(2), [-400.0 * x[0] * a - 2.0 * (1.0 - x[0]), 200.0 * a])
    }

    #[test]
    fn woods_function_as_published() {
        let options = Options { gradient_tolerance: 1e-5, ..Options::default() };
        let found = minimise([-3.0, -1.0, -3.0, -1.0], &options, wood);
        println!(
            "Wood: {} iterations, {} evaluations, {} restarts",
            found.iterations, found.evaluations, found.restarts
        );
        assert_eq!(found.reason, StopReason::Gradient);
        assert!(found.x.iter().all(|x| (x - 1.0).abs() < 1e-5), "{:?}", found.x);
        // As published: 48 iterations, 106 evaluations. A little room, for another machine's
        // rounding.
        assert!(
            (46..=50).contains(&found.iterations) && (100..=112).contains(&found.evaluations),
            "{found:?}"
        );
    }

    #[test]
    fn rosenbrocks_valley() {
        let found = minimise([-1.2, 1.0], &Options::default(), rosenbrock);
        println!("Rosenbrock: {} iterations, {} evaluations", found.iterations, found.evaluations);
        assert!(found.x.iter().all(|x| (x - 1.0).abs() < 1e-9), "{found:?}");
        assert!(found.evaluations < 150, "{found:?}");
    }

    #[test]
    fn a_quadratic_of_n_variables_takes_about_n_lines() {
        // Two trials a line make the search exact on a quadratic, and then conjugate directions end
        // after n lines.
        const N: usize = 6;
        let quadratic = |x: &[f64; N]| {
            let weight = |i: usize| 1.0 + i as f64;
            let value = (0..N).map(|i| 0.5 * weight(i) * (x[i] - 1.0).powi(2)).sum();
            (value, std::array::from_fn(|i| weight(i) * (x[i] - 1.0)))
        };
        let options = Options { gradient_tolerance: 1e-8, ..Options::default() };
        let found = minimise([0.0; N], &options, quadratic);
        println!("quadratic: {} iterations, {} evaluations", found.iterations, found.evaluations);
        assert_eq!(found.reason, StopReason::Gradient);
        assert!(found.iterations <= N as u32 + 1, "{found:?}");
    }

    #[test]
    fn steps_back_from_where_the_function_is_not_defined() {
        let log = |x: &[f64; 1]| (x[0] - x[0].ln(), [1.0 - 1.0 / x[0]]);
        let found = minimise([8.0], &Options::default(), log);
        assert!((found.x[0] - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(minimise([-1.0], &Options::default(), log).reason, StopReason::NotFinite);
    }

    #[test]
    fn stops_for_each_reason() {
        let limited =
            Options { max_evaluations: 10, gradient_tolerance: 0.0, ..Options::default() };
        let found = minimise([-1.2, 1.0], &limited, rosenbrock);
        assert_eq!(found.reason, StopReason::EvaluationLimit);
        assert!(found.evaluations == 10 && found.value < 24.2);
        let target = Options { value_target: 1e-3, ..Options::default() };
        assert_eq!(minimise([-1.2, 1.0], &target, rosenbrock).reason, StopReason::Value);
        assert_eq!(minimise([1.0, 1.0], &Options::default(), rosenbrock).evaluations, 1);
        // A gradient that lies: no lower point is found and the iteration says so.
        assert_eq!(
            minimise([1.0], &Options::default(), |x| (x[0], [-1.0])).reason,
            StopReason::LineSearch
        );
    }
}
