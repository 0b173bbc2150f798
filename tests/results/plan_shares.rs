//! A run in shares of its candidates, put together, is the run: the same bytes.

use std::sync::atomic::AtomicBool;

use gripfast::plan::{Outcome, Plan};
use gripfast::request::{Choice, Polish, Request};
use gripfast::units::{Angle, Density, Length};

fn request(part: &str, gripper: &str) -> Request {
    let part = crate::support::root().join("data/parts").join(part);
    let mut request = Request::new(part, gripper);
    request.density = Some(Density(7850.0));
    request.candidates.spacing = Some(Length(0.008));
    request.candidates.angle_step = Angle(60_f64.to_radians());
    request.candidates.approach = Some(serde_json::from_value("-z:60deg".into()).unwrap());
    request.scoring.backend = Choice::Cpu;
    // Fewer than there are, so that the best are chosen from those of all shares.
    request.selection.keep = Some(25);
    request.selection.negatives = 40;
    request
}

fn bytes(outcome: &Outcome) -> Vec<u8> {
    let mut bytes = Vec::new();
    outcome.set.write_json_lines(&mut bytes).unwrap();
    bytes
}

fn unequal() -> tempfile::NamedTempFile {
    let text = "name = \"Arm with a fixed jaw\"\nstroke = [\"0mm\", \"90mm\"]\nforce = [\"5N\", \"40N\"]\n\
                [pad]\nrectangle = [\"20mm\", \"16mm\"]\nfriction = 0.5\n\
                [pad.II]\nrectangle = [\"30mm\", \"16mm\"]\n[motion]\nmoves = \"I\"\n";
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

#[test]
fn shares_put_together_are_the_run() {
    let never = AtomicBool::new(false);
    let unequal = unequal();
    let arm = unequal.path().to_str().unwrap();
    // One gripper that is the same both ways round, and one that is not; flips; faces from inside.
    for (part, gripper, flips) in [
        ("l_bracket.stl", "robotiq-2f85", false),
        ("l_bracket.stl", arm, false),
        ("shaft_key.stl", "generic", true),
    ] {
        let mut request = request(part, gripper);
        request.candidates.flips = flips;
        let plan = Plan::new(request).unwrap();
        let whole = plan.run(&mut (), &never).unwrap();
        let set = &whole.set;
        assert!(set.summary.ranked > 100 && set.grips.len() == 25, "{part}: {:?}", set.summary);
        assert!(!set.negatives.is_empty());
        for of in [1, 2, 7] {
            let shares: Vec<Vec<u8>> = (0..of)
                .map(|number| plan.run_share(number, of, &never).unwrap().unwrap())
                .collect();
            let found = plan.gather(&shares, &mut ()).unwrap();
            assert_eq!(found.set.summary, set.summary, "{part} {gripper}, {of} shares");
            assert!(bytes(&found) == bytes(&whole), "{part} {gripper}, {of} shares");
            assert_eq!(found.shown, whole.shown);
        }
    }
}

#[test]
fn what_is_no_share_of_the_run_is_refused() {
    let never = AtomicBool::new(false);
    let one = Plan::new(request("hex_nut.stl", "generic")).unwrap();
    let shares: Vec<Vec<u8>> =
        (0..3).map(|number| one.run_share(number, 3, &never).unwrap().unwrap()).collect();
    let said = |result: gripfast::error::Result<Outcome>| result.unwrap_err().to_string();
    assert!(said(one.gather(&shares[..2], &mut ())).contains("candidates"));
    let twice = [shares.clone(), shares.clone()].concat();
    assert!(said(one.gather(&twice, &mut ())).contains("candidates"));
    let mut cut = shares.clone();
    cut[1].truncate(40);
    assert!(said(one.gather(&cut, &mut ())).contains("share 1"));
    let mut other = request("hex_nut.stl", "generic");
    other.scoring.safety = 2.0;
    let said = said(Plan::new(other).unwrap().gather(&shares, &mut ()));
    assert!(said.contains("safety (1.0 there, 2.0 here)"), "{said}");
    assert!(one.run_share(3, 3, &never).is_err());
    assert_eq!(one.run_share(0, 3, &AtomicBool::new(true)).unwrap(), None);
    // Which grips are left unsolved hangs on those before.
    let mut raced = request("hex_nut.stl", "generic");
    raced.scoring.polish = Polish::Top;
    let error = Plan::new(raced).unwrap().run_share(0, 2, &never).unwrap_err();
    assert!(error.to_string().contains("share"), "{error}");
}
