//! The 32 known defects of the reference data's `make_dirty.py`, added to clean meshes. Those that
//! leave the shape alone must give the clean part's faces; the others a report or a refusal that
//! names place and remedy.

use std::path::{Path, PathBuf};

use glam::DVec3;
use gripfast::backend::{Backend, SeedSet};
use gripfast::gripper;
use gripfast::load::LoadSet;
use gripfast::part::{Part, ReadOptions, Unit};
use gripfast::plan::{Assessor, Settings};
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::rank;
use gripfast::results::RankedGrip;

use crate::support::random::Random;

type Triangle = [DVec3; 3];

fn shared() -> Option<PathBuf> {
    let folder = crate::support::root().join("../shared/parts");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: {} is absent", folder.display());
    None
}

/// Clean watertight binary STL files to spoil.
const CLEAN: [&str; 8] = [
    "parts/trimesh__plate_holes.STL",
    "gen/gen_hexnut_M10_simple.stl",
    "gen/gen_vslot_20x20_100.stl",
    "gen/gen_lbracket_openbuilds.stl",
    "gen/gen_spurgear_m2_z24.stl",
    "gen/gen_pillowblock_cq.stl",
    "gen/gen_bearing_608.stl",
    "derived/trimesh__featuretype.STEP__occt_lin0.05_ang0.3.stl",
];

fn load(path: &Path) -> Vec<Triangle> {
    let bytes = std::fs::read(path).unwrap();
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    let point = |at: usize| DVec3::new(float(at), float(at + 4), float(at + 8));
    (0..(bytes.len() - 84) / 50)
        .map(|index| [12, 24, 36].map(|at| point(84 + 50 * index + at)))
        .collect()
}

fn binary(triangles: &[Triangle], header: &[u8], count: u32, attribute: u16) -> Vec<u8> {
    with_normals(triangles, header, count, attribute, None)
}

/// A binary STL with the normal given in place of the triangles' own.
fn with_normals(
    triangles: &[Triangle],
    header: &[u8],
    count: u32,
    attribute: u16,
    stated: Option<DVec3>,
) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes[..header.len()].copy_from_slice(header);
    bytes.extend(count.to_le_bytes());
    for triangle in triangles {
        let normal = stated.unwrap_or_else(|| {
            (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize_or_zero()
        });
        for vector in std::iter::once(&normal).chain(triangle) {
            bytes.extend(vector.to_array().into_iter().flat_map(|x| (x as f32).to_le_bytes()));
        }
        bytes.extend(attribute.to_le_bytes());
    }
    bytes
}

fn plain(triangles: &[Triangle]) -> Vec<u8> {
    binary(triangles, b"spoiled", triangles.len() as u32, 0)
}

fn ascii(triangles: &[Triangle], end: &str, solids: usize) -> Vec<u8> {
    let mut text = String::new();
    for chunk in triangles.chunks(triangles.len().div_ceil(solids)) {
        text += &format!("solid part{end}");
        for triangle in chunk {
            text += &format!("  facet normal 0 0 0{end}    outer loop{end}");
            for corner in triangle {
                text += &format!(
                    "      vertex {} {} {}{end}",
                    corner.x as f32, corner.y as f32, corner.z as f32
                );
            }
            text += &format!("    endloop{end}  endfacet{end}");
        }
        text += &format!("endsolid part{end}");
    }
    text.into_bytes()
}

fn read(folder: &Path, bytes: &[u8], unit: Option<Unit>) -> gripfast::error::Result<Part> {
    let path = folder.join("spoiled.stl");
    std::fs::write(&path, bytes).unwrap();
    Part::read(&path, &ReadOptions::default().with_unit(unit))
}

fn diagonal(triangles: &[Triangle]) -> f64 {
    let corners = || triangles.iter().flatten().copied();
    (corners().reduce(DVec3::max).unwrap() - corners().reduce(DVec3::min).unwrap()).length()
}

/// Whether two parts have the same faces: areas to `tolerance` relative, planes to `tolerance` of
/// the size, `moved` apart.
fn assert_same(name: &str, mode: &str, clean: &Part, dirty: &Part, moved: DVec3, tolerance: f64) {
    let lines = dirty.health.lines();
    assert!(dirty.health.watertight, "{name} {mode}: {lines:?}");
    let size = {
        let (low, high) = clean.mesh.bounding_box();
        (high - low).length()
    };
    assert_eq!(clean.faces.len(), dirty.faces.len(), "{name} {mode}: {lines:?}");
    let mut left: Vec<_> = dirty.faces.iter().collect();
    for face in &clean.faces {
        let place = left.iter().position(|other| {
            other.normal.distance(face.normal) < 100.0 * tolerance
                && other.centroid.distance(face.centroid + moved) < 10.0 * tolerance * size
                && (other.area - face.area).abs()
                    < 10.0 * tolerance * (face.area + size * size * tolerance)
                && other
                    .polygons
                    .iter()
                    .map(|p| p.holes.len())
                    .eq(face.polygons.iter().map(|p| p.holes.len()))
        });
        let place = place.unwrap_or_else(|| {
            panic!(
                "{name} {mode}: no match for face {} {} {} area {}: {lines:?}",
                face.id, face.normal, face.centroid, face.area
            )
        });
        left.remove(place);
    }
    let (a, b) = (clean.mass_properties(1.0), dirty.mass_properties(1.0));
    assert!(
        (a.volume - b.volume).abs() < 10.0 * tolerance * a.volume,
        "{name} {mode}: volume {} {}",
        a.volume,
        b.volume
    );
}

/// Whether every larger face of the clean part is found again to what the rougher coordinates
/// allow, and little else.
fn assert_contains(name: &str, mode: &str, clean: &Part, dirty: &Part, moved: DVec3) {
    let lines = dirty.health.lines();
    let total: f64 = clean.faces.iter().map(|face| face.area).sum();
    for face in clean.faces.iter().filter(|face| face.area > 0.01 * total) {
        let found = dirty.faces.iter().any(|other| {
            other.normal.distance(face.normal) < 1e-2
                && other.centroid.distance(face.centroid + moved) < 3e-4
                && (other.area / face.area - 1.0).abs() < 0.1
        });
        assert!(
            found,
            "{name} {mode}: no match for face {} {} {} area {}: {lines:?}",
            face.id, face.normal, face.centroid, face.area
        );
    }
    let found: f64 = dirty.faces.iter().map(|face| face.area).sum();
    assert!(
        found < 1.05 * total,
        "{name} {mode}: {} faces, {} in the clean part: {lines:?}",
        dirty.faces.len(),
        clean.faces.len()
    );
}

/// All grips of a coarse set, scored and in order.
fn ranking(part: &Part) -> Vec<RankedGrip> {
    let gripper = gripper::find("generic").unwrap();
    let options = ProposeOptions::default()
        .with_spacing(Some(15e-3))
        .with_angle_step(std::f64::consts::FRAC_PI_2);
    let grips =
        Proposer::new(part, &gripper, &options).unwrap().flat_map(|chunk| chunk.grips).collect();
    let mass = part.mass_properties(0.2 / part.mass_properties(1.0).volume);
    let loads = LoadSet::parse("loads", "gravity").unwrap().cases(&mass).unwrap();
    let settings = Settings::of_force(40.0).with_pad_friction(gripper.pad_friction);
    let ranked = Assessor {
        loads: &loads,
        mass,
        settings: &settings,
        backend: &Backend::Cpu,
        seeds: &SeedSet::default(),
    }
    .assess(grips)
    .unwrap();
    rank::rank(ranked, mass.centre_of_mass, 0.1, &rank::Options::default()).grips
}

/// Whether the rankings are the same: the same poses (the jaws may be exchanged) to `tolerance`
/// [m], each with the same score to 100 times that. Scores that tie may come in another order.
fn assert_same_ranking(name: &str, mode: &str, clean: &[RankedGrip], dirty: &Part, tolerance: f64) {
    let found = ranking(dirty);
    assert_eq!(clean.len(), found.len(), "{name} {mode}: grips");
    let mut free = vec![true; found.len()];
    for (place, grip) in clean.iter().enumerate() {
        let pose = &grip.grip.part_from_grip;
        let (score, same) = (grip.score.unwrap(), tolerance);
        let twin = (0..found.len()).find(|&index| {
            let other = &found[index].grip.part_from_grip;
            let turned = (pose.rotation.z_axis.cross(other.rotation.z_axis)).length();
            free[index]
                && pose.origin.distance(other.origin) <= same
                && pose.rotation.x_axis.distance(other.rotation.x_axis) <= 1000.0 * tolerance
                && turned <= 1000.0 * tolerance
        });
        let Some(twin) = twin else {
            panic!("{name} {mode}: grip {place} at {} is missing", pose.origin)
        };
        free[twin] = false;
        let other = found[twin].score.unwrap();
        assert!(
            (score - other).abs() <= 100.0 * tolerance * score,
            "{name} {mode}: grip {place} scores {score}, then {other}"
        );
        // The score at each place of the order is the same too.
        let placed = found[place].score.unwrap();
        assert!(
            (score - placed).abs() <= 100.0 * tolerance * score,
            "{name} {mode}: place {place} has {placed}, not {score}"
        );
    }
}

/// Parts on which the generic gripper finds grips: their rankings are compared.
const RANKED: [&str; 3] = [
    "parts/trimesh__plate_holes.STL",
    "gen/gen_vslot_20x20_100.stl",
    "gen/gen_lbracket_openbuilds.stl",
];

#[test]
fn defects_that_leave_the_shape_alone_change_nothing() {
    let Some(folder) = shared() else { return };
    let scratch = tempfile::tempdir().unwrap();
    for name in CLEAN {
        let t = load(&folder.join(name));
        let n = t.len();
        let clean = read(scratch.path(), &plain(&t), None).unwrap();
        assert!(
            clean.health.watertight && clean.health.warnings.is_empty(),
            "{name}: {:?}",
            clean.health.lines()
        );
        let mut random = Random::new(7);
        let order = if RANKED.contains(&name) { ranking(&clean) } else { Vec::new() };
        assert!(!RANKED.contains(&name) || order.len() > 30, "{name}: {} grips", order.len());
        let check = |mode: &str, bytes: Vec<u8>| {
            let part = read(scratch.path(), &bytes, None).unwrap();
            assert_same(name, mode, &clean, &part, DVec3::ZERO, 1e-7);
            if !order.is_empty() {
                assert_same_ranking(name, mode, &order, &part, 1e-7);
            }
        };

        let mut shuffled = t.clone();
        for index in (1..n).rev() {
            shuffled.swap(index, random.below(index + 1));
        }
        check("shuffle", plain(&shuffled));
        check("rotate_start", plain(&t.iter().map(|&[a, b, c]| [b, c, a]).collect::<Vec<_>>()));
        check("flip_all", plain(&t.iter().map(|&[a, b, c]| [c, b, a]).collect::<Vec<_>>()));
        check(
            "flip_some",
            plain(
                &t.iter()
                    .map(|&[a, b, c]| if random.unit() < 0.1 { [c, b, a] } else { [a, b, c] })
                    .collect::<Vec<_>>(),
            ),
        );
        let picks: Vec<usize> = (0..(n / 50).max(1)).map(|_| random.below(n)).collect();
        check(
            "dup_tri",
            plain(&t.iter().copied().chain(picks.iter().map(|&k| t[k])).collect::<Vec<_>>()),
        );
        let degenerate = picks.iter().flat_map(|&k| {
            let [a, b, c] = t[k];
            [[a, b, b], [a, b, (a + b) / 2.0], [c, c, c]]
        });
        check("degenerate", plain(&t.iter().copied().chain(degenerate).collect::<Vec<_>>()));
        let split = |&[a, b, c]: &Triangle| [[a, (a + b) / 2.0, c], [(a + b) / 2.0, b, c]];
        check(
            "tjunction",
            plain(
                &t.iter()
                    .enumerate()
                    .flat_map(|(k, triangle)| {
                        if picks.contains(&k) { split(triangle).to_vec() } else { vec![*triangle] }
                    })
                    .collect::<Vec<_>>(),
            ),
        );
        check("dup_shell", plain(&[t.clone(), t.clone()].concat()));
        let ninth = |t: &Vec<Triangle>| {
            t.iter()
                .flat_map(|&[a, b, c]| {
                    let m = (a + b + c) / 3.0;
                    [[a, b, m], [b, c, m], [c, a, m]]
                })
                .collect::<Vec<_>>()
        };
        check("split_planes", plain(&ninth(&ninth(&t))));
        check("attr_bytes", binary(&t, b"x", n as u32, 0x1234));
        check("zero_normals", with_normals(&t, b"x", n as u32, 0, Some(DVec3::ZERO)));
        check("wrong_normals", with_normals(&t, b"x", n as u32, 0, Some(DVec3::Z)));
        check(
            "solid_header",
            binary(&t, b"solid exported by a CAD system that should not do this", n as u32, 0),
        );
        check("ascii", ascii(&t, "\n", 1));
        check("ascii_crlf", ascii(&t, "\r\n", 1));
        check("ascii_multi", ascii(&t, "\n", 3));
        check("ascii_upper", ascii(&t, "\n", 1).to_ascii_uppercase());

        for (mode, factor, unit) in [
            ("scale_m", 1e-3, Unit::Metre),
            ("scale_inch", 1.0 / 25.4, Unit::Inch),
            ("scale_um", 1e3, Unit::Micrometre),
        ] {
            let scaled: Vec<Triangle> =
                t.iter().map(|triangle| triangle.map(|corner| corner * factor)).collect();
            let part = read(scratch.path(), &plain(&scaled), Some(unit)).unwrap();
            assert_same(name, mode, &clean, &part, DVec3::ZERO, 1e-6);
            if !order.is_empty() {
                assert_same_ranking(name, mode, &order, &part, 1e-6);
            }
            let warned =
                read(scratch.path(), &plain(&scaled), None).unwrap().health.warnings.join(" ");
            let (low, high) = clean.mesh.bounding_box();
            let largest = (high - low).max_element() * factor;
            assert_eq!(
                warned.contains("implausible size"),
                !(1e-3..=5.0).contains(&largest),
                "{name} {mode}: {warned}"
            );
        }
        let moved = DVec3::new(1e4, -2e4, 3e4);
        let far = read(
            scratch.path(),
            &plain(
                &t.iter().map(|triangle| triangle.map(|corner| corner + moved)).collect::<Vec<_>>(),
            ),
            None,
        )
        .unwrap();
        assert_contains(name, "translate_far", &clean, &far, moved * 1e-3);
        if let Some(best) = order.first() {
            // The file's single precision leaves micrometres there.
            let (best, found) = (best.score.unwrap(), ranking(&far)[0].score.unwrap());
            assert!(
                (best - found).abs() < 1e-3 * best,
                "{name} translate_far: best {best}, then {found}"
            );
        }
    }
}

#[test]
fn defects_that_change_the_shape_are_reported() {
    let Some(folder) = shared() else { return };
    let scratch = tempfile::tempdir().unwrap();
    for name in CLEAN {
        let t = load(&folder.join(name));
        let n = t.len();
        let clean = read(scratch.path(), &plain(&t), None).unwrap();
        let read = |bytes: Vec<u8>| read(scratch.path(), &bytes, None);
        let size = diagonal(&t);
        let mut random = Random::new(5);

        let holed: Vec<Triangle> = t
            .iter()
            .enumerate()
            .filter(|(k, _)| k % 150 != 77)
            .map(|(_, triangle)| *triangle)
            .collect();
        let part = read(plain(&holed)).unwrap();
        assert!(
            !part.health.watertight
                && part.health.open_edges >= 3
                && part.health.open_edge_at.is_some(),
            "{name} hole: {:?}",
            part.health.lines()
        );

        for (mode, share) in [("jitter5", 1e-5), ("jitter3", 1e-3)] {
            let mut moves = std::collections::HashMap::new();
            let mut jitter = |corner: DVec3| {
                let by = moves.entry(corner.to_array().map(f64::to_bits)).or_insert_with(|| {
                    DVec3::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5)
                        * 2.0
                        * share
                        * size
                });
                corner + *by
            };
            let spoiled: Vec<Triangle> =
                t.iter().map(|triangle| triangle.map(&mut jitter)).collect();
            let part = read(plain(&spoiled)).unwrap();
            if mode == "jitter5" {
                assert_contains(name, mode, &clean, &part, DVec3::ZERO);
            }
            if mode == "jitter5" {
                assert!(
                    part.health.warnings.iter().any(|warning| warning.contains("rough")),
                    "{name}: {:?}",
                    part.health.lines()
                );
            }
            // A thousandth of the size is beyond what is taken for flat: the part still reads, as
            // the facets that it has become, and says so.
            let noisy = part
                .health
                .warnings
                .iter()
                .find(|warning| warning.contains("flat faces are noisy"));
            assert_eq!(
                noisy.is_some(),
                mode == "jitter3",
                "{name} {mode}: {:?}",
                part.health.lines()
            );
            if let Some(warning) = noisy {
                // Moved evenly by up to e along each axis, corners lie e / sqrt 3 off their planes;
                // planes fitted to few corners follow them.
                let told: f64 = warning
                    .split("corners lie ")
                    .nth(1)
                    .unwrap()
                    .split(' ')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap();
                let moved = 1e3 * share * size / 3.0_f64.sqrt();
                assert!(
                    (0.5 * moved..2.0 * moved).contains(&told),
                    "{name}: {told} um told, {moved} um moved: {warning}"
                );
            }
            assert!(
                part.health.watertight && !part.faces.is_empty(),
                "{name} {mode}: {:?}",
                part.health.lines()
            );
        }

        let shift = DVec3::new(0.1, 0.07, 0.05) * size;
        let copy: Vec<Triangle> = t
            .iter()
            .copied()
            .chain(t.iter().map(|triangle| triangle.map(|corner| corner + shift)))
            .collect();
        let part = read(plain(&copy)).unwrap();
        // The copy of the plate clears the original: it is thinner than the shift.
        let expected = usize::from(!name.contains("plate_holes"));
        assert!(part.health.crossing_shells >= expected, "{name}: {:?}", part.health.lines());
        assert_eq!(
            part.health.lines().join(" ").contains("pass through each other"),
            expected == 1,
            "{name}"
        );

        let largest = clean.faces.first().unwrap();
        let open: Vec<Triangle> = t
            .iter()
            .filter(|triangle| {
                !triangle.iter().all(|corner| {
                    (largest.normal.dot(*corner * 1e-3) - largest.offset).abs() < 1e-8 * size
                })
            })
            .copied()
            .collect();
        let part = read(plain(&open)).unwrap();
        assert!(
            !part.health.watertight && part.health.open_edges > 0,
            "{name} open_plane: {:?}",
            part.health.lines()
        );

        for (mode, value) in [("nan", f64::NAN), ("inf", f64::INFINITY)] {
            let mut spoiled = t.clone();
            spoiled[n / 2][1].x = value;
            let message = read(plain(&spoiled)).unwrap_err().to_string();
            assert!(
                message.contains(&format!("triangle {}", n / 2 + 1))
                    && message.contains("finite")
                    && message.contains("remedy"),
                "{mode}: {message}"
            );
        }
        let whole = plain(&t);
        let message = read(whole[..84 + 50 * (n / 2) + 17].to_vec()).unwrap_err().to_string();
        assert!(
            message
                .contains(&format!("states {n} triangles but ends within triangle {}", n / 2 + 1)),
            "{message}"
        );
        let message = read(binary(&t, b"", n as u32 + 5, 0)).unwrap_err().to_string();
        assert!(message.contains(&format!("states {} triangles", n + 5)), "{message}");
        let message = read(binary(&t, b"", u32::MAX, 0)).unwrap_err().to_string();
        assert!(message.contains("states 4294967295 triangles"), "{message}");
    }
}

/// Noise of 1e-5 of the size keeps every large plane, whatever the noise.
#[test]
#[ignore = "known fault: in one of six cases one of the planes of a V-slot bar is not found"]
fn small_noise_keeps_every_large_plane() {
    let Some(folder) = shared() else { return };
    let scratch = tempfile::tempdir().unwrap();
    let t = load(&folder.join("gen/gen_vslot_20x20_100.stl"));
    let clean = read(scratch.path(), &plain(&t), None).unwrap();
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let mut moves = std::collections::HashMap::new();
        let spoiled: Vec<Triangle> = t
            .iter()
            .map(|triangle| {
                triangle.map(|corner| {
                    let by = moves
                        .entry(corner.to_array().map(f64::to_bits))
                        .or_insert_with(|| random.vector() * 1e-5 * diagonal(&t));
                    corner + *by
                })
            })
            .collect();
        let part = read(scratch.path(), &plain(&spoiled), None).unwrap();
        assert_contains("v-slot", &format!("noise {seed}"), &clean, &part, DVec3::ZERO);
    }
}

/// Planes and rounds fitted to a noisy mesh are gripped as those of the clean one.
#[test]
fn a_noisy_part_that_is_fitted_has_the_grips_of_the_clean_one() {
    let scratch = tempfile::tempdir().unwrap();
    let ring = |k: u32, z: f64| {
        let angle = std::f64::consts::TAU * f64::from(k % 96) / 96.0;
        DVec3::new(10.0 * angle.cos(), 10.0 * angle.sin(), z)
    };
    let mut cylinder: Vec<Triangle> = Vec::new();
    for k in 0..96 {
        for row in 0..6 {
            let [low, high] = [row, row + 1].map(|row| 10.0 * f64::from(row));
            let [a, b, c, d] = [ring(k, low), ring(k + 1, low), ring(k, high), ring(k + 1, high)];
            cylinder.extend([[a, b, d], [a, d, c]]);
        }
        let top = DVec3::new(0.0, 0.0, 60.0);
        cylinder.push([ring(k + 1, 0.0), ring(k, 0.0), DVec3::ZERO]);
        cylinder.push([ring(k, 60.0), ring(k + 1, 60.0), top]);
    }
    let bracket = load(&crate::support::root().join("data/parts/l_bracket.stl"));
    for (name, t) in [("bracket", bracket), ("cylinder", cylinder)] {
        let best = |part: &Part| {
            let ranked = ranking(part);
            let mut needed: Vec<f64> = ranked.iter().filter_map(|grip| grip.worst.mu_s).collect();
            needed.sort_by(f64::total_cmp);
            assert!(needed.len() >= 3, "{name}: {}", needed.len());
            needed[..3].iter().sum::<f64>() / 3.0
        };
        let clean = best(&read(scratch.path(), &plain(&t), None).unwrap());
        for (seed, noise) in [(1, 0.02), (2, 0.05), (3, 0.1)] {
            let mut random = Random::new(seed);
            let mut moves = std::collections::HashMap::new();
            let spoiled: Vec<Triangle> = t
                .iter()
                .map(|triangle| {
                    triangle.map(|corner| {
                        let key = (corner * 1e6).round().to_array().map(|x| x as i64);
                        let mut one = || noise * (2.0 * random.unit() - 1.0);
                        corner
                            + *moves.entry(key).or_insert_with(|| DVec3::new(one(), one(), one()))
                    })
                })
                .collect();
            let path = scratch.path().join("fitted.stl");
            std::fs::write(&path, plain(&spoiled)).unwrap();
            let options = ReadOptions::default().with_fit(Some(3e-3 * noise));
            let fitted = best(&Part::read(&path, &options).unwrap());
            assert!(
                (fitted - clean).abs() < 0.03 * clean,
                "{name}, noise {noise} mm: mu_s {fitted} of {clean}"
            );
        }
    }
    let output = assert_cmd::Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(scratch.path())
        .args(["part", "fitted.stl", "--fit", "0.3mm"])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("fitted within 0.3 mm: 2 planes and 1 curved face"), "{text}");
    assert!(text.contains("fitted: rms"), "{text}");
}

/// What a user reads about noise: from `part` and from `plan`, for a bracket and for a box of
/// twelve triangles.
#[test]
fn noise_is_told_with_its_size_and_a_remedy() {
    let scratch = tempfile::tempdir().unwrap();
    for name in ["l_bracket", "shaft_key"] {
        let t = load(&crate::support::root().join(format!("data/parts/{name}.stl")));
        let size = diagonal(&t);
        let mut random = Random::new(5);
        let mut moves = std::collections::HashMap::new();
        let spoiled: Vec<Triangle> = t
            .iter()
            .map(|triangle| {
                triangle.map(|corner| {
                    let by =
                        moves.entry(corner.to_array().map(f64::to_bits)).or_insert_with(|| {
                            DVec3::new(
                                random.unit() - 0.5,
                                random.unit() - 0.5,
                                random.unit() - 0.5,
                            ) * 2e-3
                                * size
                        });
                    corner + *by
                })
            })
            .collect();
        let (clean, noisy) = (scratch.path().join("clean.stl"), scratch.path().join("noisy.stl"));
        std::fs::write(&clean, plain(&t)).unwrap();
        std::fs::write(&noisy, plain(&spoiled)).unwrap();
        let run = |args: &[&str]| {
            let output = assert_cmd::Command::cargo_bin("gripfast")
                .unwrap()
                .current_dir(scratch.path())
                .args(args)
                .output()
                .unwrap();
            [output.stdout, output.stderr]
                .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
                .concat()
        };
        let plan = |file| {
            run(&[
                "plan",
                file,
                "--gripper",
                "generic",
                "--mass",
                "300g",
                "--loads",
                "gravity:-z",
                "--spacing",
                "20mm",
                "--angle-step",
                "90deg",
            ])
        };
        for text in [run(&["part", "noisy.stl"]), plan("noisy.stl")] {
            assert!(
                text.contains("flat faces are noisy")
                    && text.contains("times the")
                    && text.contains("CAD model")
                    && text.contains("(--fit "),
                "{name}: {text}"
            );
        }
        for text in [run(&["part", "clean.stl"]), plan("clean.stl")] {
            assert!(!text.contains("noisy:"), "{name}: {text}");
        }
    }
}

#[test]
fn files_that_are_no_mesh_are_refused_with_place_and_remedy() {
    let scratch = tempfile::tempdir().unwrap();
    let refused = |file: &str, bytes: &[u8]| {
        let path = scratch.path().join(file);
        std::fs::write(&path, bytes).unwrap();
        let message = Part::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains(file) && message.contains("remedy"), "{message}");
        message
    };
    assert!(refused("empty.stl", b"").contains("empty"));
    assert!(
        refused(
            "text.stl",
            b"solid nothing\nfacet normal 0 0\nouter loop\nvertex 1 2\nvertex a b c\n"
        )
        .contains("line 4")
    );
    assert!(
        refused(
            "short.stl",
            b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        )
        .contains("ends within a facet")
    );
    assert!(
        refused(
            "letter.stl",
            b"Dear Sir, please find enclosed no part at all. ".repeat(9).as_slice()
        )
        .contains("solid")
    );
    assert!(refused("bytes.stl", &[0; 40]).contains("40 bytes"));
    assert!(refused("nothing.stl", b"solid a\nendsolid a\n").contains("no triangle"));
    assert!(
        refused("flat.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 1 1\nvertex 1 1 1\nvertex 1 1 1\nendloop\nendfacet\nendsolid\n")
            .contains("area")
    );
    let step = refused("part.step", b"ISO-10303-21;");
    if cfg!(feature = "step") {
        assert!(step.contains("cannot be read as STEP"), "{step}");
    } else {
        assert!(step.contains("cascadio") && step.contains("feature `step`"), "{step}");
    }
    for name in ["part.igs", "part.brep"] {
        let text = refused(name, b"");
        assert!(text.contains("in a format that is not read") && text.contains("export"), "{text}");
    }
    assert!(refused("part.xyz", b"1 2 3").contains("unknown mesh format"));
    assert!(refused("part", b"1 2 3").contains("suffix"));
    assert!(refused("bad.obj", b"v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n").contains("line 3"));
    assert!(refused("range.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n").contains("bounds"));
    assert!(refused("nan.obj", b"v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n").contains("finite"));
    assert!(refused("no.ply", b"plyboy\n").contains("PLY"));
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
    assert!(refused("short.ply", format!("{ply}0 0 0\n1 0 0\n").as_bytes()).contains("line 1"));
    assert!(
        refused("range.ply", format!("{ply}0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n").as_bytes())
            .contains("face 1")
    );
    assert!(refused("zipped.stl.gz", b"\x1f\x8b\x08\x00rubbish").contains("damaged"));
    let message = Part::read(Path::new("/nowhere/at/all.stl"), &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(message.contains("cannot read"), "{message}");
}
