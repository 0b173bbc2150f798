//! What survives, whatever the order, the room and the number of loads; loads made in single
//! precision.

use super::*;

/// A search of many steps is shared by several workgroups: no driver breaks it off, and no load is
/// missed.
#[test]
fn many_loads_under_many_twists_are_all_looked_at() {
    let Some(gpu) = gpu(true) else { return };
    let seeds = SeedSet::new(15).unwrap();
    let (grips, list) = ball_grips(&mut Random(73), 3, 5000);
    let batch = on_ball(&grips, &list);
    let found = survivors(&gpu, &batch, &seeds);
    let contacts = Contacts::new(&batch.problems).unwrap();
    let expected =
        crate::backend::screen::survivors(&contacts, &batch, &seeds, Wanted::Worst).unwrap();
    for (a, b) in found.iter().zip(&expected) {
        assert!(a.is_sorted_by(|x, y| x.0 < y.0));
        let most = |all: &[(u32, Seed)]| {
            let value = |seed: &Seed| if seed.upper.is_finite() { seed.upper } else { 0.0 };
            all.iter()
                .map(|(load, seed)| (value(seed), *load))
                .fold((0.0, 0), |most, next| if next.0 > most.0 { next } else { most })
        };
        assert!((most(a).0 / most(b).0 - 1.0).abs() < 1e-3);
        // Loads without bounds are the same, but for a hair.
        let open = |all: &[(u32, Seed)]| {
            all.iter().filter(|(_, seed)| seed.upper.is_infinite()).map(|(load, _)| *load).collect()
        };
        let open: [Vec<u32>; 2] = [open(a), open(b)];
        let by_one = open[0].iter().filter(|load| !open[1].contains(load)).count();
        assert!(by_one <= 5 && open[0].len().abs_diff(open[1].len()) <= 5, "{open:?}");
        println!("{} and {} of 5000 loads, {} of them open", a.len(), b.len(), open[0].len());
    }
}

/// Every load has one place, and loads in a row lie far apart.
#[test]
fn the_order_on_the_device_has_every_load_once() {
    for count in [1, 2, 1024, 1025, 5000, 8192, 100_000] {
        let spread = super::chunk::Spread::new(count);
        let mut seen = vec![false; count];
        let piece = super::chunk::Piece { problem: 0, first: 0, count };
        spread.loads(&piece).for_each(|load| assert!(!std::mem::replace(&mut seen[load], true)));
        assert_eq!(spread.is_plain(), count <= 1024);
        if count > 1024 {
            // Of each tenth of the list a window has a tenth of its places, about.
            let window = super::chunk::Piece { problem: 0, first: 0, count: 1000 };
            let first = spread.loads(&window).filter(|load| *load < count / 10).count();
            assert!((80..=120).contains(&first), "{first}");
        }
    }
}

fn survivors(gpu: &Gpu, batch: &Batch<'_>, seeds: &SeedSet) -> Vec<Vec<(u32, Seed)>> {
    let contacts = Contacts::new(&batch.problems).unwrap();
    gpu.survivors(&contacts, batch, seeds, Wanted::Worst).unwrap()
}

/// A grip that no workgroup looked at is an error, also in buffers used before.
#[test]
fn a_grip_without_an_answer_is_an_error() {
    let Some(gpu) = gpu(true) else { return };
    let set = SeedSet::default();
    let (grips, list) = ball_grips(&mut Random(19), 30, 100);
    let batch = on_ball(&grips, &list);
    let contacts = Contacts::new(&batch.problems).unwrap();
    let chunks = chunks(&gpu, &contacts, &batch.problems, (&set, Wanted::Worst));
    for answer in answers(&gpu, &set, &[chunks.clone(), chunks.clone()].concat()) {
        assert!(answer.outcomes.iter().all(|outcome| outcome.entries != UNWRITTEN));
    }
    // The kernel's own word for it: fewer workgroups than grips leave zeros.
    let mut fewer = chunks[0].clone();
    let wanted = fewer.0.grips.len();
    fewer.0.grips.truncate(wanted - 1);
    let answer = answers(&gpu, &set, &[fewer]).remove(0);
    for (outcomes, word) in [
        (answer.outcomes.clone(), "only 29 answers"),
        ([answer.outcomes.clone(), vec![OutcomeRecord::default()]].concat(), "did not write"),
    ] {
        let answer = Answer { outcomes, entries: answer.entries.clone() };
        let said = gpu.kept_of(&contacts, &batch, &set, (answer, &chunks[0].1)).unwrap_err();
        assert!(said.to_string().contains(word), "{said}");
    }
}

/// In whatever order the device finds them, the same loads come out, bit by bit.
#[test]
fn the_order_in_which_loads_are_found_changes_nothing() {
    let Some(gpu) = gpu(true) else { return };
    let set = SeedSet::default();
    let (grips, list) = ball_grips(&mut Random(23), 40, 500);
    let batch = on_ball(&grips, &list);
    let contacts = Contacts::new(&batch.problems).unwrap();
    let chunks = chunks(&gpu, &contacts, &batch.problems, (&set, Wanted::Worst));
    let answer = answers(&gpu, &set, &chunks).remove(0);
    let kept = |entries: Vec<FoundRecord>| {
        let answer = Answer { outcomes: answer.outcomes.clone(), entries };
        gpu.kept_of(&contacts, &batch, &set, (answer, &chunks[0].1)).unwrap()
    };
    let expected = kept(answer.entries.clone());
    assert!(expected.iter().map(|(_, (found, _))| found.len()).sum::<usize>() > 100);
    let mut entries = answer.entries.clone();
    let mut random = Random(5);
    for _ in 0..5 {
        for place in (1..entries.len()).rev() {
            entries.swap(place, random.within(0.0, place as f64 + 1.0) as usize);
        }
        assert_ne!(entries, answer.entries);
        assert_eq!(kept(entries.clone()), expected);
    }
}

/// Where more come back than there is room for, no load is lost: the processor looks at those grips.
#[test]
fn no_load_is_lost_where_there_is_no_room() {
    let Some(mut gpu) = gpu(true) else { return };
    let set = SeedSet::default();
    let (grips, list) = ball_grips(&mut Random(29), 60, 300);
    let batch = on_ball(&grips, &list);
    let expected = survivors(&gpu, &batch, &set);
    assert_eq!(gpu.grips_redone(), 0);
    let whole: usize = expected.iter().map(Vec::len).sum();
    let score = |backend: &Backend| {
        let scored = backend.score(&batch, &set, &ScoreOptions::default()).unwrap();
        scored.into_iter().map(|scored| scored.worst.unwrap()).collect::<Vec<_>>()
    };
    let exact = score(&Backend::Cpu);
    for room in [0, 1, 100, whole] {
        gpu.limits.entries = room;
        let before = gpu.grips_redone();
        let found = survivors(&gpu, &batch, &set);
        println!("{room} of {whole}: {} grips by the processor", gpu.grips_redone() - before);
        assert_eq!(gpu.grips_redone() > before, room < whole / 2);
        // The processor has its own bounds: a load near the best lower one may be kept by one only.
        for (a, b) in found.iter().zip(&expected) {
            let most =
                |all: &[(u32, Seed)]| all.iter().map(|(_, seed)| seed.lower).fold(0.0, f64::max);
            assert!((most(a) - most(b)).abs() <= 1e-3 * most(b));
        }
        let backend = Backend::Gpu(Box::new(gpu));
        for ((load, a), (other, b)) in score(&backend).iter().zip(&exact) {
            let (a, b) = (a.mu_s.unwrap_or(0.0), b.mu_s.unwrap_or(0.0));
            assert!(load == other && (a - b).abs() <= 1e-9 * b, "{load} {a} {other} {b}");
        }
        let Backend::Gpu(back) = backend else { panic!("the backend changed") };
        gpu = *back;
    }
}

/// A load made in single precision is within the stated error of the exact one, wherever the grip is
/// on the part, and the bound is not far above what is seen.
#[test]
fn loads_made_from_a_pose_are_within_their_error() {
    let Some(gpu) = gpu(true) else { return };
    let mut random = Random(61);
    let set = SeedSet::new(1).unwrap();
    let mut most = 0.0_f64;
    for far in [0.0, 0.01, 0.3, 10.0] {
        for _ in 0..40 {
            let contact = random.two_stars();
            let mut pose = random.pose();
            pose.part_from_grip.origin = pose.centre_of_mass + random.vector() * far;
            let wrench = |random: &mut Random| {
                let size = 10_f64.powf(random.within(-8.0, 2.0));
                let arm = 10_f64.powf(random.within(-4.0, 1.0));
                Wrench { force: random.vector() * size, moment: random.vector() * size * arm }
            };
            let wrenches: Vec<Wrench> = (0..50).map(|_| wrench(&mut random)).collect();
            let problem = Problem {
                contact: &contact,
                distance: 0.02,
                force: 40.0,
                wrenches: &wrenches,
                pose: Some(pose),
            };
            let contacts = Contacts::new(&[problem]).unwrap();
            let (chunk, _) = chunks(&gpu, &contacts, &[problem], (&set, Wanted::All)).remove(0);
            let records = contacts.ready[0].records.as_ref().unwrap();
            for (load, listed) in chunk.lists[0].records.iter().enumerate() {
                let found = twin::make_load(&chunk.grips[0], listed);
                let error = f64::from(twin::load_error(&chunk.grips[0], listed));
                // Of a load that pulls a pad off there is no record: the numbers again, by hand.
                let seen = problem.wrench(load);
                let (o, by) = (records.origin, 1.0 / (problem.force * records.unit));
                let f = seen.force / problem.force;
                let exact = [
                    f.x,
                    f.y,
                    (seen.moment.z - (o.x * seen.force.y - o.y * seen.force.x)) * by,
                    f.z,
                    (seen.moment.x - o.y * seen.force.z) * by,
                    (seen.moment.y + o.x * seen.force.z) * by,
                ];
                let [x, y, z] = found.wrench.map(|x| f64::from(x) * f64::from(found.scale));
                let made = [x, y, z, found.f3.into(), found.m1.into(), found.m2.into()];
                for (a, b) in made.into_iter().zip(exact) {
                    most = most.max((a - b).abs() / error);
                }
            }
        }
    }
    println!("errors are {most:.3} of the bound at most");
    assert!(most < 1.0 && most > 0.02, "{most}");
}

/// The bounds that come back hold for the exact load, and are not wider than is said.
#[test]
fn bounds_of_loads_made_in_single_precision_hold() {
    let Some(gpu) = gpu(true) else { return };
    let mut random = Random(67);
    let set = SeedSet::default();
    let grips = grips(&mut random, 100, 80.0);
    let problems = problems(&grips);
    let batch = Batch { problems: problems.clone() };
    let backend = Backend::Gpu(Box::new(gpu));
    let found = backend.seed(&batch, &set).unwrap();
    let expected = Backend::Cpu.seed(&batch, &set).unwrap();
    let each = problems.iter().flat_map(|problem| {
        (0..problem.wrenches.len()).map(move |load| (problem, problem.wrench(load)))
    });
    let (mut bounded, mut widest) = (0, 0.0_f64);
    for ((seed, other), (problem, wrench)) in found.iter().zip(&expected).zip(each) {
        if !matches!(seed.status, SeedStatus::Bounded | SeedStatus::Coupled) {
            continue;
        }
        bounded += 1;
        let options = crate::mechanics::Options::default();
        let (distance, force) = (problem.distance, problem.force);
        let score = crate::mechanics::solve(problem.contact, distance, force, &wrench, &options);
        let mu = score.unwrap().mu_s.unwrap();
        assert!(seed.lower <= mu && mu <= seed.upper, "{seed:?} {mu}");
        if other.status == seed.status {
            widest = widest.max(1.0 - seed.lower / other.lower);
        }
    }
    println!("{bounded} bounds hold; lower by {widest:.1e} at most than the processor's");
    assert!(bounded > 500 && widest < f64::from(LOAD_MARGIN) + 1e-4);
}

/// The list of loads goes up once for all chunks and calls, and a grip of it costs less than a
/// kilobyte either way, not sixteen.
#[test]
fn the_list_lies_on_the_device_and_only_survivors_come_back() {
    let Some(mut gpu) = gpu(true) else { return };
    gpu.limits.loads = 25 * 500;
    let set = SeedSet::default();
    let (grips, list) = ball_grips(&mut Random(71), 100, 500);
    let batch = on_ball(&grips, &list);
    survivors(&gpu, &batch, &set);
    gpu.start_clock().unwrap();
    survivors(&gpu, &batch, &set);
    let chunks = gpu.stop_clock().unwrap().chunks;
    assert!(chunks.len() >= 4);
    let sum = |of: fn(&ChunkSpans) -> u64| chunks.iter().map(of).sum::<u64>() as f64 / 100.0;
    let (up, down) = (sum(|chunk| chunk.bytes_up), sum(|chunk| chunk.bytes_down));
    let entries = sum(|chunk| chunk.entries as u64);
    println!("bytes a grip: {up:.0} up, {down:.0} down, for {entries:.1} entries");
    assert!(up < 160.0 && down < 100.0 + 50.0 * entries);
    assert_eq!(sum(|chunk| chunk.grips as u64), 1.0);
    // Other loads: the list is sent again, once.
    let other: Vec<Wrench> = list.iter().map(|w| Wrench { moment: w.force, ..*w }).collect();
    gpu.start_clock().unwrap();
    survivors(&gpu, &on_ball(&grips, &other), &set);
    let chunks = gpu.stop_clock().unwrap().chunks;
    let more = |chunk: &ChunkSpans| chunk.bytes_up >= 500 * 32;
    assert!(more(&chunks[0]) && !chunks[1..].iter().any(more), "{chunks:?}");
}
