//! Load lists and trajectories from files: exact values, agreement of the forms a motion can be
//! given in, refusals with file and line.

use std::fmt::Write as _;
use std::path::PathBuf;

use glam::{DMat3, DQuat, DVec3};
use gripfast::load::{LoadSet, LoadSource};
use gripfast::model::Frame;
use gripfast::part::MassProperties;
use gripfast::results::LoadCase;

const G: f64 = 9.80665;

fn mass() -> MassProperties {
    MassProperties {
        volume: 1e-4,
        mass: 2.0,
        centre_of_mass: DVec3::new(0.01, -0.02, 0.03),
        inertia: DMat3::from_diagonal(DVec3::new(1e-3, 2e-3, 4e-3)),
    }
}

struct File {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

fn file(name: &str, text: &[u8]) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    File { path, _folder: folder }
}

fn set(file: &File) -> LoadSet {
    LoadSet::new(vec![LoadSource::File(file.path.clone())])
}

fn csv(text: &str) -> Vec<LoadCase> {
    set(&file("loads.csv", text.as_bytes())).cases(&mass()).unwrap()
}

fn refusal(name: &str, text: &[u8]) -> String {
    set(&file(name, text)).cases(&mass()).unwrap_err().to_string()
}

fn close(a: DVec3, b: DVec3, tolerance: f64) {
    assert!((a - b).length() <= tolerance, "{a} is not {b}");
}

#[test]
fn a_csv_list_with_units_points_and_frames() {
    let text = "# comment\nname,fx[kN], fy [N],fz (N),mx[Nmm],my,mz,px[mm],py[mm],pz[mm],frame\npush,0.01,0,0,1000,0,0,10,-20,130,part\nhang,0,0,-4,0,0,0,0,0,0,world\n";
    let file = file("loads.csv", text.as_bytes());
    let mut set = set(&file);
    // World: the part turned by 90 degrees about x, so world -z is part -y; and moved.
    set.world_from_part = Frame {
        rotation: DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2),
        origin: DVec3::new(1.0, 2.0, 3.0),
    };
    let found = set.cases(&mass()).unwrap();
    assert_eq!(found[0].name, "push");
    close(found[0].wrench.force, DVec3::new(10.0, 0.0, 0.0), 1e-15);
    // The point lies 100 mm above the centre of mass: z x x = y.
    close(found[0].wrench.moment, DVec3::new(1.0, 1.0, 0.0), 1e-15);
    close(found[1].wrench.force, DVec3::new(0.0, -4.0, 0.0), 1e-15);
    let point_in_part = set.world_from_part.point_inverse(DVec3::ZERO);
    close(
        found[1].wrench.moment,
        (point_in_part - mass().centre_of_mass).cross(DVec3::new(0.0, -4.0, 0.0)),
        1e-14,
    );
}

#[test]
fn a_bare_header_is_si_about_the_centre_of_mass() {
    let found = csv("fx,fy,fz,mx,my,mz\n1,2,3,4,5,6\n");
    assert_eq!(
        (found[0].wrench.force, found[0].wrench.moment),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0))
    );
    assert_eq!(found[0].name, "loads.csv row 1");
    assert_eq!(csv("\u{feff}mx,my,mz\r\n4,5,6\r\n")[0].wrench.force, DVec3::ZERO);
}

#[test]
fn a_json_list() {
    let text = r#"{"units": {"force": "kN", "length": "mm"}, "loads": [{"name": "a", "force": [0.001, 0, 0], "point": [10, -20, 1030]}, {"moment": [0, 0, 2]}]}"#;
    let found = set(&file("loads.json", text.as_bytes())).cases(&mass()).unwrap();
    close(found[0].wrench.force, DVec3::X, 1e-15);
    close(found[0].wrench.moment, DVec3::Y, 1e-14);
    assert_eq!(
        (found[1].name.as_str(), found[1].wrench.moment),
        ("load 2", DVec3::new(0.0, 0.0, 2.0))
    );
}

#[test]
fn sources_join_in_order() {
    let file = file("loads.csv", b"fx,fy,fz\n1,2,3\n");
    let found = LoadSet::parse("--loads", &format!("gravity:-z,{},ball:20", file.path.display()))
        .unwrap()
        .cases(&mass())
        .unwrap();
    assert_eq!(found.len(), 22);
    assert_eq!(found[1].wrench.force, DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn files_that_are_wrong_are_named_with_their_line() {
    for (text, line) in [
        ("fx,fy,fz\n1,2,3\n1,2\n", "loads.csv:3"),
        ("fx,fy,fz\n1,2,3\n1,nan,3\n", "loads.csv:3, column fy"),
        ("# two\n# comments\nfx,fy,fz\n1,2,3 N\n", "loads.csv:4, column fz"),
        ("fx,fy,fz\n1e999,0,0\n", "loads.csv:2"),
        ("fx,fy,fz\n,0,0\n", "loads.csv:2"),
        ("fx,fy\n1,2\n", "loads.csv:1"),
        ("fx,fx,fz\n1,2,3\n", "loads.csv:1"),
        ("fx[lb],fy,fz\n1,2,3\n", "loads.csv:1"),
        ("fx,fy,fz,colour\n1,2,3,4\n", "loads.csv:1"),
        ("fx,fy,fz,frame\n1,2,3,moon\n", "loads.csv:2"),
        ("fx,fy,fz,px,py,pz\n1e300,0,0,0,1e300,0\n", "loads.csv:2"),
        ("fx,fy,fz\n", "loads.csv"),
        ("", "loads.csv"),
        ("x,y,z\n1,2,3\n", "loads.csv:1"),
        ("t,frame\n0,world\n", "loads.csv:1"),
        ("t,alx,aly,alz\n0,1,2,3\n", "loads.csv:1"),
        ("t,ax,ay,az,alx,aly,alz\n0,1,2,3,1,2,3\n", "loads.csv:1"),
        ("t,ax,ay,az\n0,1,2,3\n0,1,2,3\n", "loads.csv:3"),
        ("t,vx,vy,vz\n0,1,2,3\n", "loads.csv:2"),
        ("t,x,y,z\n0,1,2,3\n1,1,2,3\n", "loads.csv:2"),
        ("t,qx,qy,qz,qw\n0,0,0,0,1\n1,0,0,0,1\n", "loads.csv:2"),
        ("t,qx,qy,qz,qw\n0,0,0,0,1\n1,0,0,0,2\n2,0,0,0,1\n", "loads.csv:3"),
        ("t,qx,qy,qz,qw\n0,0,0,0,1\n1,0,0,1,0\n2,0,0,0,1\n", "loads.csv:3"),
        ("t,qx,qy,qz\n0,0,0,0\n", "loads.csv:1"),
        ("t,ax,ay,az,frame\n0,1,2,3,world\n1,1,2,3,part\n", "loads.csv:3"),
    ] {
        let message = refusal("loads.csv", text.as_bytes());
        assert!(message.contains(line), "{text:?}: {message}");
    }
    for binary in [&b"fx,fy,fz\n1,2,\xff\n"[..], b"\x00\x01\x02", b"fx,fy,fz\n1,2,3\n\"1,2,3\n"] {
        assert!(refusal("loads.csv", binary).contains("loads.csv"));
    }
    for (text, place) in [
        ("{", "loads.json:1"),
        ("{\n\"loads\": [{\"force\": [1,2]}]}", "loads.json:2"),
        ("{\"loads\": []}", "no loads"),
        ("{\"loads\": [{\"torque\": [1,2,3]}]}", "torque"),
        ("{\"units\": {\"force\": \"stone\"}, \"loads\": [{}]}", "units.force"),
        ("{\"loads\": [{}, {\"frame\": \"moon\"}]}", "loads[1]"),
        ("[1]", "loads.json:1"),
    ] {
        let message = refusal("loads.json", text.as_bytes());
        assert!(message.contains(place), "{text:?}: {message}");
    }
}

#[test]
fn a_part_at_rest_weighs_and_one_in_free_fall_does_not() {
    let found = csv("time,ax,ay,az\n0,0,0,0\n0.5,0,0,-9.80665\n1,0,3,0\n");
    close(found[0].wrench.force, DVec3::new(0.0, 0.0, -2.0 * G), 1e-14);
    assert_eq!(found[1].wrench.force, DVec3::ZERO);
    close(found[2].wrench.force, DVec3::new(0.0, -6.0, -2.0 * G), 1e-14);
    assert_eq!(found[1].name, "loads.csv t=0.500000s");
    assert!(found.iter().all(|case| case.wrench.moment == DVec3::ZERO));
}

#[test]
fn a_spin_about_a_fixed_axis_throws_the_centre_of_mass_outwards() {
    let file = file(
        "loads.csv",
        b"t[ms],wx[rpm],wy[rpm],wz[rpm],frame\n0,0,0,60,part\n100,0,0,60,part\n200,0,0,60,part\n",
    );
    let mut set = set(&file);
    set.world_gravity = DVec3::ZERO;
    for case in set.cases(&mass()).unwrap() {
        let omega = std::f64::consts::TAU;
        close(case.wrench.force, DVec3::new(0.01, -0.02, 0.0) * (2.0 * omega * omega), 1e-12);
        close(case.wrench.moment, DVec3::ZERO, 1e-15);
    }
}

/// A smooth motion with everything in it, and its derivatives in closed form.
struct Motion;

impl Motion {
    fn angles(t: f64) -> ([f64; 2], [f64; 2], [f64; 2]) {
        (
            [1.5 * (2.0 * t).sin(), 1.1 * (3.0 * t).cos()],
            [3.0 * (2.0 * t).cos(), -3.3 * (3.0 * t).sin()],
            [-6.0 * (2.0 * t).sin(), -9.9 * (3.0 * t).cos()],
        )
    }

    fn rotation(t: f64) -> DQuat {
        let ([a, b], ..) = Self::angles(t);
        DQuat::from_rotation_z(a) * DQuat::from_rotation_x(b)
    }

    /// World: `a' z + b' R_z(a) x`.
    fn omega(t: f64) -> DVec3 {
        let ([a, _], [da, db], _) = Self::angles(t);
        DVec3::Z * da + DQuat::from_rotation_z(a) * DVec3::X * db
    }

    fn alpha(t: f64) -> DVec3 {
        let ([a, _], [da, db], [dda, ddb]) = Self::angles(t);
        let side = DQuat::from_rotation_z(a) * DVec3::X;
        DVec3::Z * dda + side * ddb + DVec3::Z.cross(side) * (da * db)
    }

    fn position(t: f64) -> DVec3 {
        DVec3::new((3.0 * t).sin(), t * t, (2.0 * t).cos())
    }

    fn velocity(t: f64) -> DVec3 {
        DVec3::new(3.0 * (3.0 * t).cos(), 2.0 * t, -2.0 * (2.0 * t).sin())
    }

    fn acceleration(t: f64) -> DVec3 {
        DVec3::new(-9.0 * (3.0 * t).sin(), 2.0, -4.0 * (2.0 * t).cos())
    }

    /// The wrench from first principles: numerical derivatives of linear and angular momentum.
    fn wrench(t: f64) -> (DVec3, DVec3) {
        let part = mass();
        let h = 1e-4;
        let com = |t: f64| Self::position(t) + Self::rotation(t) * part.centre_of_mass;
        let spin = |t: f64| {
            Self::rotation(t) * (part.inertia * (Self::rotation(t).conjugate() * Self::omega(t)))
        };
        let acceleration = (com(t + h) - com(t) * 2.0 + com(t - h)) / (h * h);
        let back = Self::rotation(t).conjugate();
        (
            back * ((DVec3::NEG_Z * G - acceleration) * part.mass),
            back * (-(spin(t + h) - spin(t - h)) / (2.0 * h)),
        )
    }

    fn table(columns: &str, frame: &str, rows: usize) -> String {
        let mut text = "t".to_owned();
        for column in columns.chars() {
            text += match column {
                'x' => ",x,y,z",
                'q' => ",qx,qy,qz,qw",
                'v' => ",vx,vy,vz",
                'a' => ",ax,ay,az",
                'w' => ",wx,wy,wz",
                _ => ",alx,aly,alz",
            };
        }
        text += ",frame\n";
        for row in 0..rows {
            let t = row as f64 / rows as f64;
            write!(text, "{t}").unwrap();
            let turn =
                if frame == "part" { Self::rotation(t).conjugate() } else { DQuat::IDENTITY };
            for column in columns.chars() {
                let vector = match column {
                    'x' => Self::position(t),
                    'v' => turn * Self::velocity(t),
                    'a' => turn * Self::acceleration(t),
                    'w' => turn * Self::omega(t),
                    'q' => {
                        let q = Self::rotation(t);
                        write!(text, ",{},{},{},{}", q.x, q.y, q.z, q.w).unwrap();
                        continue;
                    }
                    _ => turn * Self::alpha(t),
                };
                write!(text, ",{},{},{}", vector.x, vector.y, vector.z).unwrap();
            }
            writeln!(text, ",{frame}").unwrap();
        }
        text
    }
}

#[test]
fn every_form_of_one_motion_gives_the_same_wrenches() {
    let rows = 400;
    // Forces reach 40 N, moments 0.1 N m (weighted here by 50 /m). Differentiated columns carry the
    // error of fourth-order differences (third at the ends), orientations carried on by the angular
    // velocity that of second order.
    for (columns, tolerance) in [
        ("qawl", 1e-5),
        ("qvw", 1e-4),
        ("xq", 1e-3),
        ("awl", 1e-3),
        ("vw", 1e-3),
        ("xw", 1e-3),
        ("qv", 1e-3),
    ] {
        for frame in ["world", "part"] {
            let file = file("loads.csv", Motion::table(columns, frame, rows).as_bytes());
            let mut set = set(&file);
            set.world_from_part.rotation = DMat3::from_quat(Motion::rotation(0.0));
            for (row, case) in set.cases(&mass()).unwrap().iter().enumerate() {
                let (force, moment) = Motion::wrench(row as f64 / rows as f64);
                let error = (case.wrench.force - force)
                    .length()
                    .max((case.wrench.moment - moment).length() * 50.0);
                assert!(error < tolerance, "{columns} {frame} row {row}: {error}");
            }
        }
    }
}

#[test]
fn a_body_tumbling_freely_needs_no_moment() {
    // Euler's equations for torque-free motion, integrated by small steps; the wrench's moment must
    // vanish.
    let inertia = DVec3::new(1e-3, 2e-3, 4e-3);
    let rate = |w: DVec3| -(w.cross(inertia * w)) / inertia;
    let mut w = DVec3::new(3.0, 5.0, 1.0);
    let mut text = "t,wx,wy,wz,frame\n".to_owned();
    let h = 1e-3;
    for row in 0..300 {
        writeln!(text, "{},{},{},{},part", f64::from(row) * h, w.x, w.y, w.z).unwrap();
        let k1 = rate(w);
        let k2 = rate(w + k1 * (h / 2.0));
        let k3 = rate(w + k2 * (h / 2.0));
        let k4 = rate(w + k3 * h);
        w += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
    }
    for case in csv(&text) {
        assert!(case.wrench.moment.length() < 1e-6, "{}: {}", case.name, case.wrench.moment);
    }
}

#[test]
fn uneven_sampling_and_few_rows_keep_polynomials_exact() {
    // Position t^2 has the acceleration 2 from three rows on, whatever their spacing.
    for times in
        [&[0.0, 0.1, 0.5][..], &[0.0, 0.1, 0.5, 0.55], &[0.0, 0.1, 0.5, 0.55, 2.0, 2.1, 7.0]]
    {
        let mut text = "t,x,y,z\n".to_owned();
        for t in times {
            writeln!(text, "{t},{},0,0", t * t).unwrap();
        }
        for case in csv(&text) {
            close(case.wrench.force, DVec3::new(-4.0, 0.0, -2.0 * G), 1e-9);
        }
    }
}
