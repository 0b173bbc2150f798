use glam::DVec3;
use proptest::prelude::*;

use super::*;

/// Every field set to something that is not its default.
fn full() -> Request {
    let text = r#"
part = "a/b c.stl"
unit = "in"
max_memory = "2GB"
outside_buffers = true
faceted = true
fit = "0.2mm"
gripper = "my.toml"
density = "2.7 g/cm3"
com = "1in,-2mm,0mm"
inertia = "67kgmm2,107kgmm2,91kgmm2,0kgm2,1kgmm2,30kgmm2"
force = "18lbf"
loads = "gravity, ball:12:5N"
accel = "2g"

[candidates]
spacing = "2.5 mm"
angle_step = "7deg"
edge_angles = false
curved = true
min_contact = 0.3
min_pad_share = 0.1
max_offset = "0.1ft"
approach = "-z:45deg"
ground = "0/0.1/1:-3mm"
keep_out = ["0mm,0mm,0mm:10mm,20mm,5mm", "-1in,0m,0m:1in,1in,1in"]
faces = [0, 4]
faces_in = ["0mm,0mm,0mm:10mm,20mm,5mm"]
grips = "both"
flips = true
opening = "4mm"
min_opening = "1mm"
clearance = "0.5mm"
approach_distance = "80mm"

[scoring]
backend = "cpu"
adapter = "0"
seeds = 200
k1 = 2
k2 = 0.5
pad_friction = 0.7
safety = 1.5
position_error = "0.2mm"
closing_friction = 0.1
separation = "discard"
polish = "all"
refiner = "shanno"
threads = 2

[selection]
top = 3
diverse = true
merge_symmetric = true
every_turn = true
ids = [3, 17]
keep = 77
pose_noise = "1mm,2deg"
noise_samples = 9
compare = "1,2,3,4mm"
negatives = 20

[output]
output = "grips.json"
report = "grips.html"
json = true
quiet = true
yes = true
resume = true
checkpoint = "2min"
"#;
    Request::from_toml("here", text).unwrap()
}

#[test]
fn a_request_reads_back_from_toml_and_json() {
    for request in [full(), Request::new("part.stl", "generic"), Request::default()] {
        let text = request.to_toml();
        assert_eq!(Request::from_toml("here", &text).unwrap(), request, "{text}");
        let json = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<Request>(&json).unwrap(), request, "{json}");
        request.check().unwrap();
    }
    assert_eq!(full().loads, ["gravity", "ball:12:5N"]);
    assert_eq!(full().candidates.keep_out[1].low, DVec3::new(-0.0254, 0.0, 0.0));
    // A choice of grips that differ is made among many more than it keeps.
    assert_eq!(full().kept(), 10_000);
    let mut plain = full();
    plain.selection.diverse = false;
    assert_eq!(plain.kept(), 77);
}

#[test]
fn no_field_of_the_full_request_has_its_default() {
    let value = |request: &Request| serde_json::to_value(request).unwrap();
    let (full, default) = (value(&full()), value(&Request::new("p", "g")));
    for (name, group) in full.as_object().unwrap() {
        match group.as_object() {
            Some(group) => group.iter().for_each(|(field, set)| {
                assert_ne!(Some(set), default[name].get(field), "{field}")
            }),
            None => assert_ne!(Some(group), default.get(name), "{name}"),
        }
    }
}

/// TOML has no null, and other readers stumble over it.
#[test]
fn what_is_not_given_is_not_written() {
    let json = serde_json::to_string(&Request::default()).unwrap();
    assert!(!json.contains("null"), "{json}");
}

#[test]
fn what_is_no_request_is_refused_with_line_and_reason() {
    for (text, needles) in [
        ("part = \"a\"\nforce = 80", ["here:2", "kgf"]),
        (
            "part = \"a\"\n\n[candidates]\nspacing = \"2\"\n",
            ["here:4", "no unit; add one of: m, mm"],
        ),
        ("part = \"a\"\npert = \"b\"", ["here:2", "unknown field `pert`"]),
        ("[scoring]\npolish = \"most\"", ["here:2", "`worst`, `top`, `all`"]),
        ("[candidates]\nground = \"+z\"", ["here:2", "no colon; give DIR:HEIGHT"]),
        ("[candidates]\nfaces_in = [\"0mm:1mm\"]", ["here:2", "not three lengths"]),
        ("[selection]\npose_noise = \"1mm\"", ["here:2", "a length and an angle"]),
        ("loads = 3", ["here:1", "a list of texts"]),
        ("part = [", ["here:1", "not a request"]),
    ] {
        let message = Request::from_toml("here", text).unwrap_err().to_string();
        assert!(needles.iter().all(|needle| message.contains(needle)), "{text}: {message}");
    }
}

#[test]
fn values_out_of_their_range_are_refused_by_field() {
    let check = |change: &dyn Fn(&mut Request)| {
        let mut request = Request::new("part.stl", "generic");
        change(&mut request);
        request.check().unwrap_err().to_string()
    };
    for (place, change) in [
        ("k1", &(|r: &mut Request| r.scoring.k1 = f64::NAN) as &dyn Fn(&mut Request)),
        ("k2", &|r| r.scoring.k2 = f64::INFINITY),
        ("position_error", &|r| r.scoring.position_error = Length(-1e-3)),
        ("closing_friction", &|r| r.scoring.closing_friction = -0.1),
        ("pad_friction", &|r| r.scoring.pad_friction = Some(f64::NAN)),
        ("safety", &|r| r.scoring.safety = 0.0),
        ("inertia", &|r| r.inertia = Some(InertiaMatrix([1.0, 1.0, 2.1, 0.0, 0.0, 0.0]))),
        ("inertia", &|r| r.inertia = Some(InertiaMatrix([1.0, 1.0, 1.0, 0.0, 0.0, 0.6]))),
        ("max_memory", &|r| r.max_memory = Some(Memory(0.0))),
        ("threads", &|r| r.scoring.threads = Some(0)),
        ("polish", &|r| (r.scoring.polish, r.scoring.k1) = (Polish::Top, -1.0)),
        ("mass", &|r| (r.mass, r.density) = (Some(Mass(1.0)), Some(Density(1.0)))),
        ("pose_noise", &|r| r.selection.pose_noise = "-1mm,2deg".parse().ok()),
        ("noise_samples", &|r| r.selection.noise_samples = 0),
        ("compare", &|r| r.selection.compare = "1,1,1,0mm".parse().ok()),
        ("compare", &|r| r.selection.compare = "1,-1,1,1mm".parse().ok()),
        ("checkpoint", &|r| r.output.checkpoint = Time(-1.0)),
    ] {
        let message = check(change);
        assert!(message.starts_with(&format!("{place}: ")), "{place}: {message}");
    }
}

proptest! {
    #[test]
    fn texts_of_several_values_read_back_bit_for_bit(
        v in prop::array::uniform6(prop::num::f64::NORMAL | prop::num::f64::ZERO),
    ) {
        let v = v.map(|value| value % 1e9); // no length is longer
        let (low, high) = (DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5]));
        let bits = |v: DVec3| v.to_array().map(f64::to_bits);
        let region = Region { low, high };
        let back: Region = region.to_string().parse().unwrap();
        prop_assert_eq!((bits(back.low), bits(back.high)), (bits(low), bits(high)));
        let back: Position = Position(low).to_string().parse().unwrap();
        prop_assert_eq!(bits(back.0), bits(low));
        let back: InertiaMatrix = InertiaMatrix(v).to_string().parse().unwrap();
        prop_assert_eq!(back.0.map(f64::to_bits), v.map(f64::to_bits));
        prop_assume!(low != DVec3::ZERO);
        let cone = Cone { axis: low, half_angle: v[3] };
        let back: Cone = cone.to_string().parse().unwrap();
        prop_assert_eq!((bits(back.axis), back.half_angle.to_bits()), (bits(low), v[3].to_bits()));
        let ground = Ground { normal: low, offset: v[3] };
        let back: Ground = ground.to_string().parse().unwrap();
        prop_assert_eq!((bits(back.normal), back.offset.to_bits()), (bits(low), v[3].to_bits()));
        let weights = EarlierWeights { k1: v[0], k2: v[1], k3: v[2], epsilon: v[3] };
        let back: EarlierWeights = weights.to_string().parse().unwrap();
        prop_assert_eq!(
            [back.k1, back.k2, back.k3, back.epsilon].map(f64::to_bits),
            [v[0], v[1], v[2], v[3]].map(f64::to_bits)
        );
        let noise = PoseError { shift: Length(v[0]), turn: Angle(v[1]) };
        let back: PoseError = noise.to_string().parse().unwrap();
        prop_assert_eq!(
            (back.shift.0.to_bits(), back.turn.0.to_bits()),
            (v[0].to_bits(), v[1].to_bits())
        );
    }
}
