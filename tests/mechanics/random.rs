//! Random contact pairs, loads, distances and units: every answer is put into the seven equations
//! anew, and every refusal and every claim to be the only limit state is looked over by a scan that
//! shares no code with the solver.

use std::collections::BTreeMap;

use crate::brute::cases::{Case, case};
use crate::brute::{Problem, check};
use crate::support::random::Random;
use gripfast::mechanics::{Options, solve};
use gripfast::model::Status;
use rayon::prelude::*;

/// Coupling `mu |d|/sqrt(A)` above which an answer counts as strongly coupled here.
const STRONG: f64 = 1.0;

/// Counts by name, and the disagreements in full.
#[derive(Default)]
struct Tally {
    counts: BTreeMap<String, u64>,
    wrong: Vec<String>,
    evaluations: u64,
}

impl Tally {
    fn count(&mut self, name: impl Into<String>) {
        *self.counts.entry(name.into()).or_default() += 1;
    }

    fn add(mut self, other: Self) -> Self {
        for (name, count) in other.counts {
            *self.counts.entry(name).or_default() += count;
        }
        self.wrong.extend(other.wrong);
        self.evaluations += other.evaluations;
        self
    }
}

/// Shares of the cases of each kind that are scanned.
#[derive(Clone, Copy)]
struct Scans {
    refused: f64,
    ambiguous: f64,
    strong: f64,
    weak: f64,
    rays: usize,
    rings: usize,
}

/// Solves the case in its own units and judges the answer.
fn judge(number: u64, scans: Scans) -> Tally {
    let mut tally = Tally::default();
    let unit = case(number);
    let (length, force) = Case::units(number);
    let posed = unit.scaled(length, force);
    let score =
        solve(&posed.contact, posed.distance, posed.force, &posed.wrench, &Options::default())
            .unwrap();
    tally.evaluations = u64::from(score.evaluations);
    tally.count(format!("status {:?}", score.status));
    let mut wrong = |what: String| {
        tally.wrong.push(format!("case {number}: {what}\n    {score:?}\n    {}", unit.json()))
    };
    let f3 = posed.wrench.force.z.abs();
    // Exactly at the limit rounding decides.
    if (f3 / (2.0 * posed.force) - 1.0).abs() > 1e-14
        && (score.status == Status::NoNormalForce) != (f3 > 2.0 * posed.force)
    {
        wrong(format!("|F3| = {f3}, 2 Fn = {}", 2.0 * posed.force));
    }
    let mut strength = None;
    match check(&posed, &score) {
        Some(check) => {
            strength = Some(check.coupling);
            let bounds = score.bounds.unwrap();
            let mu = score.mu_s.unwrap();
            if !score.status.holds() {
                wrong("has numbers but no usable status".into());
            }
            #[allow(
                clippy::neg_cmp_op_on_partial_ord,
                reason = "a residual that is no number is wrong"
            )]
            if !(check.residual <= 1e-10 + check.rounding) {
                wrong(format!("equations {check:?}"));
            }
            let lost = check.rounding.max(1e-12)
                / score.contact_area_i.min(score.contact_area_ii).max(1e-300)
                * (length * length);
            let areas = [score.contact_area_i, score.contact_area_ii];
            if !(0..2).all(|k| (areas[k] / check.areas[k] - 1.0).abs() <= 1e-7 + lost) {
                wrong(format!("areas {areas:?} are {:?}", check.areas));
            }
            let slack = 1e-9 + check.rounding / mu;
            if !(bounds.lower <= mu * (1.0 + slack) && mu <= bounds.upper * (1.0 + slack)) {
                wrong(format!("bounds {bounds:?} of {mu}"));
            }
            if bounds.upper.is_infinite() {
                tally.count("answers without a finite upper bound");
            }
            if check.rounding > 1e-10 {
                tally.count("answers whose small contact limits the check's tolerance");
            }
        }
        // Not solved and saying so: counted, and few.
        None if matches!(
            score.status,
            Status::TwistedOut | Status::NoNormalForce | Status::NotConverged
        ) => {}
        None => wrong("has no numbers".into()),
    }
    let strong = strength.is_some_and(|strength| strength > STRONG);
    let share = match score.status {
        Status::TwistedOut => scans.refused,
        Status::Ambiguous => scans.ambiguous,
        _ if strong => scans.strong,
        _ => scans.weak,
    };
    if strong {
        tally.count("strongly coupled answers");
    }
    if Random::new(number ^ 0x5ca_55ca).unit() < share
        && let Some(problem) = Problem::new(&unit)
    {
        look(number, &problem, &score, &unit, strength, scans, &mut tally);
    }
    tally
}

/// The scan's verdict on a refusal or on the claim to be the only limit state.
fn look(
    number: u64,
    problem: &Problem,
    score: &gripfast::model::Score,
    unit: &Case,
    strength: Option<f64>,
    scans: Scans,
    tally: &mut Tally,
) {
    let scan = problem.scan(scans.rays, scans.rings);
    let kind = match (score.status, strength) {
        (Status::TwistedOut, _) => "refusals".to_owned(),
        (Status::Ambiguous, _) => "ambiguous answers".to_owned(),
        (_, Some(strength)) => format!(
            "single answers at coupling {}",
            [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 100.0]
                .iter()
                .find(|bound| strength < **bound)
                .map_or("more".into(), |b| format!("< {b}"))
        ),
        _ => "answers without coupling".to_owned(),
    };
    tally.count(format!("scanned {kind}"));
    let mus: Vec<f64> = scan.zeros.iter().map(|zero| zero.mu).collect();
    let known = score
        .mu_s
        .map(|mu| scan.zeros.iter().filter(|zero| (zero.mu / mu - 1.0).abs() < 1e-5).count());
    let others = mus.len() - known.unwrap_or(0).min(mus.len());
    let mut wrong = |name: &str, what: String| {
        tally.wrong.push(format!(
            "case {number}: {name}: {what}; scan {mus:?} winding {:?} blind {}/{}\n    {score:?}\n    {}",
            scan.winding,
            scan.blind,
            scan.points,
            unit.json()
        ));
        *tally.counts.entry(format!("WRONG {name}")).or_default() += 1;
    };
    match score.status {
        Status::TwistedOut if !mus.is_empty() => {
            wrong("refused, but a limit state exists", String::new())
        }
        Status::Ok if others > 0 => wrong(
            "called the only limit state, but another exists",
            format!("coupling {strength:?}"),
        ),
        _ => {}
    }
    if score.mu_s.is_some()
        && (score.status == Status::Ambiguous || others > 0)
        && let Some(branch) = problem.branch(400)
        && (branch.mu / score.mu_s.unwrap() - 1.0).abs() > 1e-5
    {
        wrong("not the limit state on the branch from d = 0", format!("branch {}", branch.mu));
    }
    if score.status == Status::Ambiguous && others == 0 {
        tally.count("ambiguous, scan found no other");
    }
    if known == Some(0) {
        tally.count("scan did not find the answer itself");
    }
    if scan.blind * 10 > scan.points {
        tally.count("scans blind at more than a tenth of their points");
    }
}

fn run(first: u64, count: u64, scans: Scans) -> Tally {
    let tally = (first..first + count)
        .into_par_iter()
        .map(|number| judge(number, scans))
        .reduce(Tally::default, Tally::add);
    crate::support::say(&format!(
        "{count} random cases from number {first}, {:.1} evaluations each:",
        tally.evaluations as f64 / count as f64
    ));
    for (name, count) in &tally.counts {
        crate::support::say(&format!("  {count:8} {name}"));
    }
    tally
}

#[test]
fn ten_thousand_random_cases() {
    let tally = run(
        0,
        10_000,
        Scans { refused: 0.08, ambiguous: 0.3, strong: 0.03, weak: 0.005, rays: 32, rings: 16 },
    );
    assert!(
        tally.wrong.is_empty(),
        "{} disagreements:\n{}",
        tally.wrong.len(),
        tally.wrong.join("\n")
    );
    let share = |name: &str| tally.counts.get(name).copied().unwrap_or(0);
    assert!(share("status NotConverged") <= 10, "{:?}", tally.counts);
    // Every kind of answer was there, and looked at.
    for name in [
        "status TwistedOut",
        "status Ambiguous",
        "status NoNormalForce",
        "scanned refusals",
        "strongly coupled answers",
    ] {
        assert!(share(name) >= 10, "{name}: {:?}", tally.counts);
    }
}

#[test]
#[ignore = "a quarter of an hour on one core: a million cases by hand, GRIPFAST_CASES=1000000 cargo test --release -p gripfast --test mechanics random -- --ignored"]
fn many_random_cases() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap())
    };
    let (first, count) = (number("GRIPFAST_FIRST", 0), number("GRIPFAST_CASES", 100_000));
    let thousandths = |name: &str, default: u64| number(name, default) as f64 / 1000.0;
    let scans = Scans {
        refused: thousandths("GRIPFAST_SCAN_REFUSED", 100),
        ambiguous: thousandths("GRIPFAST_SCAN_AMBIGUOUS", 100),
        strong: thousandths("GRIPFAST_SCAN_STRONG", 20),
        weak: thousandths("GRIPFAST_SCAN_WEAK", 1),
        rays: number("GRIPFAST_RAYS", 48) as usize,
        rings: number("GRIPFAST_RINGS", 24) as usize,
    };
    let tally = run(first, count, scans);
    assert!(
        tally.wrong.is_empty(),
        "{} disagreements:\n{}",
        tally.wrong.len(),
        tally.wrong.join("\n")
    );
}
