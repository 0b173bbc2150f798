//! Rust f32 against WGSL, record by record, and the loss of a device.

use super::super::layout::{BOUNDED, COUPLED, LOAD_MARGIN, SeedRecord, UNWRITTEN};
use super::super::prepare::Contacts;
use super::super::screen::Wanted;
use super::super::{
    Backend, Batch, F32_TOLERANCE, LOAD_TOLERANCE, Polish, Pose, Problem, ScoreOptions, Seed,
    SeedStatus,
};
use super::check::{Random, by_load, twins};
use super::chunk::{Maker, Plan, plans};
use super::*;
use crate::model::{Contact, Patch, Polygon, Wrench};
use glam::{DVec2, DVec3};

mod newton;
mod screen;

/// Largest difference allowed between the processor's and the shader's records, relative to values
/// of order one. Vulkan allows a logarithm 5e-7 off, fused products change the last bits, and a
/// bound divides by the twist spacing.
const RECORD_TOLERANCE: f32 = 2e-5;

/// A device for the tests, software included. Without any: a visible word, or a failure under
/// `GRIPFAST_GPU=require`.
fn gpu(strict: bool) -> Option<Gpu> {
    if list().is_empty() {
        assert!(
            std::env::var("GRIPFAST_GPU").as_deref() != Ok("require"),
            "GRIPFAST_GPU=require, but there is no graphics adapter"
        );
        eprintln!("SKIPPED: no graphics adapter, not even a software one");
        return None;
    }
    let gpu = Gpu::open(None, strict).or_else(|_| Gpu::open(Some("0"), strict)).unwrap();
    eprintln!("adapter: {}", gpu.name());
    Some(gpu)
}

impl Random {
    fn star(&mut self, size: f64) -> Patch {
        let (corners, centre) = (
            3 + (self.within(0.0, 1.0) * 8.0) as usize,
            DVec2::new(self.within(-0.01, 0.01), self.within(-0.01, 0.01)),
        );
        let turn = self.within(0.0, 1.0);
        let outer = (0..corners).map(|i| {
            let angle =
                (i as f64 + turn + self.within(-0.2, 0.2)) / corners as f64 * std::f64::consts::TAU;
            centre + DVec2::from_angle(angle) * size * self.within(0.4, 1.0)
        });
        vec![Polygon { outer: outer.collect(), holes: vec![] }]
    }

    fn two_stars(&mut self) -> Arc<Contact> {
        let face_i = self.star(0.02);
        let face_ii = if self.within(0.0, 1.0) < 0.5 { face_i.clone() } else { self.star(0.02) };
        Arc::new(Contact { face_i, face_ii })
    }
}

fn assert_same(found: &[SeedRecord], expected: &[SeedRecord]) {
    if let Err(why) = compare(found, expected) {
        panic!("{why}");
    }
}

fn compare(found: &[SeedRecord], expected: &[SeedRecord]) -> std::result::Result<(), String> {
    if found.len() != expected.len() {
        return Err(format!("{} records instead of {}", found.len(), expected.len()));
    }
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        if a.status != b.status {
            return Err(format!("record {i}: {a:?} instead of {b:?}"));
        }
        let numbers = |r: &SeedRecord| [r.lower, r.upper, r.twist[0], r.twist[1], r.twist[2]];
        if !numbers(a).iter().chain(&numbers(b)).all(|x| x.is_finite()) {
            return Err(format!("record {i} is not finite: {a:?} {b:?}"));
        }
        let close = |x: f32, y: f32, scale: f32| (x - y).abs() <= RECORD_TOLERANCE * scale.max(1.0);
        // Two twists of equal value may change places; the bound and the interpolated twist then
        // come from other triangles.
        let same_triangle = a.best == b.best;
        let twist = (0..3).all(|m| close(a.twist[m], b.twist[m], 40.0));
        if !close(a.lower, b.lower, b.lower)
            || same_triangle && !(close(a.upper, b.upper, b.upper) && twist)
        {
            return Err(format!("record {i}: {a:?} instead of {b:?}"));
        }
        if !same_triangle && !(0.9..1.1).contains(&(a.upper / b.upper)) {
            return Err(format!("record {i}, other triangle: {a:?} instead of {b:?}"));
        }
    }
    Ok(())
}

/// A contact, what acts on the part, and where it is there.
type Grip = (Arc<Contact>, Vec<Wrench>, Pose);

/// Grips near the middle of a part; every second one sees the first grip's loads.
fn grips(random: &mut Random, count: usize, most: f64) -> Vec<Grip> {
    (0..count)
        .map(|_| {
            let loads = (random.within(0.0, 1.0) * most) as usize;
            let wrench = |random: &mut Random| Wrench {
                force: random.vector() * 3.0,
                moment: random.vector() * 0.02 * random.within(0.0, 1.0),
            };
            let wrenches = (0..loads).map(|_| wrench(random)).collect();
            let mut pose = random.pose();
            pose.part_from_grip.origin = pose.centre_of_mass + random.vector() * 0.02;
            let hangs_over = random.within(0.0, 1.0) < 0.4;
            let contact =
                if hangs_over { Arc::new(random.contact(false)) } else { random.two_stars() };
            (contact, wrenches, pose)
        })
        .collect()
}

fn problems(grips: &[Grip]) -> Vec<Problem<'_>> {
    let problem = |index: usize| Problem {
        contact: &grips[index].0,
        distance: 0.001 * (index % 100) as f64,
        force: 40.0,
        wrenches: &grips[if index.is_multiple_of(2) { index } else { 0 }].1,
        pose: Some(grips[index].2),
    };
    (0..grips.len()).map(problem).collect()
}

/// Some grips on three contacts under the loads of a ball.
fn ball_grips(random: &mut Random, count: usize, loads: usize) -> (Vec<Grip>, Vec<Wrench>) {
    let directions = crate::geometry::sphere::directions(loads);
    let list = directions.into_iter().map(|force| Wrench { force, moment: DVec3::ZERO }).collect();
    let contacts =
        [random.contact(true), random.contact(false), random.contact(true)].map(Arc::new);
    let grip = |index: usize| {
        let mut pose = random.pose();
        pose.part_from_grip.origin = pose.centre_of_mass + random.vector() * 0.01;
        (Arc::clone(&contacts[index % 3]), Vec::new(), pose)
    };
    ((0..count).map(grip).collect(), list)
}

fn on_ball<'a>(grips: &'a [Grip], wrenches: &'a [Wrench]) -> Batch<'a> {
    let problem = |(contact, _, pose): &'a Grip| Problem {
        contact,
        distance: 0.02,
        force: 40.0,
        wrenches,
        pose: Some(*pose),
    };
    Batch { problems: grips.iter().map(problem).collect() }
}

/// The chunks of some problems.
fn chunks(
    gpu: &Gpu,
    contacts: &Contacts,
    problems: &[Problem<'_>],
    (seeds, wanted): (&SeedSet, Wanted),
) -> Vec<(Chunk, Plan)> {
    let users = contacts.slots.iter().copied().zip((0..problems.len()).map(|index| vec![index]));
    let users = users.filter(|(_, users)| !problems[users[0]].wrenches.is_empty());
    let plans = plans(contacts, problems, users.collect(), (gpu.limits(), seeds.len()));
    let mut maker = Maker::default();
    let chunk =
        |plan: Plan| (maker.chunk((contacts, problems), &plan, (seeds.len(), wanted)), plan);
    plans.into_iter().map(chunk).collect()
}

/// What came of some chunks.
fn answers(gpu: &Gpu, seeds: &SeedSet, chunks: &[(Chunk, Plan)]) -> Vec<Answer> {
    let (mut all, mut next) = (Vec::new(), chunks.iter().cloned());
    gpu.run(
        seeds,
        || next.next(),
        |answer, _| {
            all.extend(answer);
            Ok(())
        },
    )
    .unwrap();
    all
}

/// Kernel and twin leave the same loads open, but for a hair, and give the others the same seeds.
#[test]
fn shaders_give_the_records_of_the_processor() {
    let Some(gpu) = gpu(true) else { return };
    let mut random = Random(7);
    for frequency in [1, 4, 8, 13] {
        let seeds = SeedSet::new(frequency).unwrap();
        let grips = grips(&mut random, 150, 150.0);
        let problems = problems(&grips);
        let contacts = Contacts::new(&problems).unwrap();
        let chunks = chunks(&gpu, &contacts, &problems, (&seeds, Wanted::All));
        let (mut found, mut expected, mut changed, mut loads) = (vec![], vec![], 0, 0);
        for (answer, (chunk, _)) in answers(&gpu, &seeds, &chunks).iter().zip(&chunks) {
            let twins = twins(chunk, &seeds);
            for (grip, number) in chunk.grips.iter().zip(0..) {
                let [a, b] = [&answer.entries, &twins.entries].map(|all| by_load(all, number));
                assert_eq!(a.len(), grip.count as usize);
                assert!(a.keys().eq(b.keys()));
                for (a, b) in a.into_values().zip(b.into_values()) {
                    loads += 1;
                    changed += usize::from(a.is_some() != b.is_some());
                    if let (Some(a), Some(b)) = (a, b) {
                        found.push(a);
                        expected.push(b);
                    }
                }
            }
        }
        assert_same(&found, &expected);
        let count = |status: u32| found.iter().filter(|seed| seed.status == status).count();
        let bounded = [count(BOUNDED), count(COUPLED)];
        println!("{} twists, {loads} loads: {bounded:?} bounded, {changed} by one", seeds.len());
        assert!(bounded[0] > loads / 10 && bounded[1] > loads / 100 && changed <= loads / 1000);
        assert_eq!(bounded.iter().sum::<usize>(), found.len());
    }
}

/// Of the loads of a grip the kernel keeps those that its twin keeps, but for loads whose upper bound
/// is a hair from the best lower one, and the best lower bound is the same.
#[test]
fn the_same_loads_survive_on_both() {
    let Some(gpu) = gpu(true) else { return };
    let mut random = Random(17);
    let seeds = SeedSet::default();
    // More than a window of loads each, and more than one workgroup takes.
    let sizes = [(120, 500), (9, 4000), (3, 20_000)];
    let wanted = [Wanted::Worst, Wanted::Estimated];
    for ((count, loads), wanted) in sizes.into_iter().flat_map(|size| wanted.map(|all| (size, all)))
    {
        let (grips, list) = ball_grips(&mut random, count, loads);
        let problems = on_ball(&grips, &list).problems;
        let contacts = Contacts::new(&problems).unwrap();
        let chunks = chunks(&gpu, &contacts, &problems, (&seeds, wanted));
        let [mut kept, mut open, mut loads, mut apart] = [0; 4];
        for (answer, (chunk, _)) in answers(&gpu, &seeds, &chunks).iter().zip(&chunks) {
            let twins = twins(chunk, &seeds);
            for (grip, number) in chunk.grips.iter().zip(0..) {
                let [a, b] = [answer, &twins].map(|all| by_load(&all.entries, number));
                let of = |all: &Answer| all.outcomes[number as usize];
                let (outcome, floor) = (of(answer), of(&twins).floor);
                assert!((outcome.floor - floor).abs() <= 1e-4 * floor, "{outcome:?} {floor}");
                let entries = answer.entries.iter().filter(|entry| entry.grip == number).count();
                assert_eq!(outcome.entries as usize, entries + 1);
                for (one, other) in [(&a, &b), (&b, &a)] {
                    for (load, seed) in one.iter().filter(|(load, _)| !other.contains_key(load)) {
                        apart += 1;
                        // In a window before the last the floor was lower.
                        let near = seed.is_some_and(|seed| seed.upper <= floor * 1.0001);
                        assert!(near, "load {load}: {seed:?}, floor {floor}");
                    }
                }
                let bounded = a.values().flatten().count();
                (kept, open) = (kept + bounded, open + a.len() - bounded);
                loads += grip.count as usize;
            }
        }
        println!("{wanted:?}: {kept} of {loads} loads kept, {open} open, {apart} by one only");
        assert!(kept > 0 && kept < (loads - open) / 4 && apart <= kept / 50 + 1);
        assert!(wanted == Wanted::Worst || open < loads / 20, "{open}");
    }
}

#[test]
fn the_comparer_sees_one_wrong_number() {
    let right = SeedRecord {
        twist: [0.6, 0.0, 0.8],
        lower: 1.0,
        upper: 1.01,
        status: BOUNDED,
        best: 3,
        padding: 0,
    };
    assert!(compare(&[right; 3], &[right; 3]).is_ok());
    assert!(compare(&[right; 2], &[right; 3]).is_err());
    let wrong = [
        SeedRecord { lower: 1.0001, ..right },
        SeedRecord { upper: 1.0101, ..right },
        SeedRecord { twist: [0.602, 0.0, 0.8], ..right },
        SeedRecord { status: UNWRITTEN, ..right },
        SeedRecord { upper: f32::NAN, ..right },
        SeedRecord { best: 4, upper: 2.0, ..right },
    ];
    for wrong in wrong {
        assert!(compare(&[right, wrong, right], &[right; 3]).is_err(), "{wrong:?}");
    }
}

/// A device that is destroyed before its third chunk of 100 loads, and a batch of 350.
fn with_doomed_device<R>(mut gpu: Gpu, then: impl FnOnce(&Backend, &Batch<'_>) -> R) -> R {
    gpu.lose_before(3, 100);
    let mut random = Random(11);
    let contact = random.two_stars();
    let wrenches: Vec<Wrench> = (0..350)
        .map(|_| Wrench { force: random.vector(), moment: random.vector() * 0.01 })
        .collect();
    let batch = Batch {
        problems: vec![Problem {
            contact: &contact,
            distance: 0.03,
            force: 20.0,
            wrenches: &wrenches,
            pose: None,
        }],
    };
    then(&Backend::Gpu(Box::new(gpu)), &batch)
}

#[test]
fn a_lost_device_is_replaced_by_the_processor_under_auto() {
    let Some(gpu) = gpu(false) else { return };
    with_doomed_device(gpu, |backend, batch| {
        let set = SeedSet::default();
        let (found, expected) =
            (backend.seed(batch, &set).unwrap(), Backend::Cpu.seed(batch, &set).unwrap());
        assert_eq!(found.len(), expected.len());
        let most = 2.0 * F32_TOLERANCE + LOAD_TOLERANCE;
        for (a, b) in found.iter().zip(&expected) {
            assert!(
                a.status == b.status && (a.lower - b.lower).abs() <= most * b.lower.max(1e-9),
                "{a:?} instead of {b:?}"
            );
        }
        // Chunk two was in flight, three and four were never sent.
        assert_eq!(found[200..], expected[200..]);
        let Backend::Gpu(gpu) = backend else { panic!("the backend changed") };
        assert!((2..=3).contains(&gpu.chunks_redone()), "{} chunks redone", gpu.chunks_redone());
    });
}

#[test]
fn final_answers_are_right_when_the_device_is_lost_in_mid_batch() {
    let Some(gpu) = gpu(false) else { return };
    with_doomed_device(gpu, |backend, batch| {
        let (set, options) =
            (SeedSet::default(), ScoreOptions { polish: Polish::All, ..ScoreOptions::default() });
        let [found, expected] = [backend, &Backend::Cpu]
            .map(|backend| backend.score(batch, &set, &options).unwrap().remove(0));
        let Backend::Gpu(gpu) = backend else { panic!("the backend changed") };
        assert!(gpu.chunks_redone() > 0);
        let ((load, worst), (expected_load, expected_worst)) =
            (found.worst.unwrap(), expected.worst.unwrap());
        assert_eq!((load, worst.status), (expected_load, expected_worst.status));
        for (a, b) in found.all.iter().zip(&expected.all) {
            let same =
                a.mu_s.zip(b.mu_s).map_or(a.mu_s == b.mu_s, |(a, b)| (a / b - 1.0).abs() < 1e-9);
            assert!(same && a.status == b.status, "{a:?} instead of {b:?}");
        }
    });
}

#[test]
fn a_lost_device_is_an_error_under_gpu() {
    let Some(gpu) = gpu(true) else { return };
    with_doomed_device(gpu, |backend, batch| {
        let message = backend.seed(batch, &SeedSet::default()).unwrap_err().to_string();
        assert!(message.contains("lost"), "{message}");
    });
}

/// The tolerance that widens every bound covers what single precision does on this adapter, and the
/// basis is as good as the processor's.
#[test]
fn the_tolerance_of_the_bounds_holds_on_this_adapter() {
    let Some(gpu) = gpu(true) else { return };
    for frequency in [4, 8] {
        let seeds = SeedSet::new(frequency).unwrap();
        let check = gpu.check_kernels(&seeds, 40).unwrap();
        for deviation in &check.deviations {
            println!("{deviation:?}");
            // A margin holds twice the last step, which may be rounding.
            let most = if deviation.number.contains("margin") { 5e-3 } else { 2e-5 };
            assert!(deviation.count > 0 && deviation.from_twin < most, "{deviation:?}");
        }
        println!("{} twists: {:.1e} of {:.1e}", seeds.len(), check.largest, check.tolerance);
        assert!(check.tolerance_holds() && check.largest > 0.0, "{check:?}");
        assert!(check.bounded > check.loads / 3, "{check:?}");
        assert!(check.estimated > check.open / 3 && check.open > 200, "{check:?}");
        assert!(check.other_estimate <= check.open / 50 && check.estimate_error > 0.0, "{check:?}");
        assert!(check.other_status + check.other_twist <= check.loads / 200, "{check:?}");
    }
}

/// The kernels ask for no more than every implementation has.
#[test]
fn the_least_limits_are_enough_for_the_kernels() {
    if gpu(true).is_none() {
        return;
    }
    let adapter = adapter::choose(None).or_else(|_| adapter::choose(Some("0"))).unwrap();
    let descriptor =
        wgpu::DeviceDescriptor { required_limits: wgpu::Limits::default(), ..Default::default() };
    let (device, _) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    let kernels: [(&str, &str, &[shader::Access]); 3] = [
        ("fill_basis", shader::FAN, &shader::FAN_BINDINGS),
        ("screen", shader::SCREEN, &shader::SCREEN_BINDINGS),
        ("newton", shader::NEWTON, &shader::NEWTON_BINDINGS),
    ];
    for (name, text, bindings) in kernels {
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        Kernel::new(&device, name, text, bindings);
        let error = pollster::block_on(scope.pop());
        assert!(error.is_none(), "{name}: {error:?}");
    }
}

/// The clock changes no answer; its steps follow one another, and the device works on a chunk while
/// the processor makes the next.
#[test]
fn the_clock_shows_every_chunk_and_changes_nothing() {
    let Some(mut gpu) = gpu(true) else { return };
    gpu.limits.loads = 2000;
    let backend = Backend::Gpu(Box::new(gpu));
    let Backend::Gpu(gpu) = &backend else { panic!("the backend changed") };
    let set = SeedSet::new(8).unwrap();
    let mut random = Random(37);
    let contact = random.two_stars();
    let wrenches: Vec<Wrench> = (0..9000)
        .map(|_| Wrench { force: random.vector(), moment: random.vector() * 0.01 })
        .collect();
    let problem =
        Problem { contact: &contact, distance: 0.03, force: 20.0, wrenches: &wrenches, pose: None };
    let batch = Batch { problems: vec![problem] };
    let without = backend.seed(&batch, &set).unwrap();
    assert_eq!(gpu.stop_clock(), None);
    gpu.start_clock().unwrap();
    let with = backend.seed(&batch, &set).unwrap();
    let timeline = gpu.stop_clock().unwrap();
    assert_eq!(with, without);
    assert_eq!(timeline.chunks.iter().map(|chunk| chunk.loads).sum::<usize>(), wrenches.len());
    assert_eq!(timeline.chunks.len(), 5);
    let forward = |span: Span| span.from <= span.to;
    for chunk in &timeline.chunks {
        assert!(chunk.bytes_up > 0 && chunk.bytes_down as usize >= chunk.entries * 32);
        assert!(chunk.make.to <= chunk.send.from && chunk.send.to <= chunk.wait.from);
        assert!(chunk.wait.to <= chunk.fetch.from && chunk.fetch.to <= chunk.spread.from);
        assert_eq!(chunk.device.is_some(), gpu.has_timestamps());
        let Some(device) = chunk.device else { continue };
        assert!(forward(device.basis) && forward(device.search), "{device:?}");
        assert!(device.basis.to <= device.search.from, "{device:?}");
        for copy in [device.upload, device.readback].into_iter().flatten() {
            assert!(forward(copy), "{device:?}");
        }
    }
    // Two chunks are under way at a time: the next is sent before the one before is waited for.
    for pair in timeline.chunks.windows(2) {
        assert!(pair[1].send.to <= pair[0].wait.from, "{pair:?}");
        if let (Some(before), Some(after)) = (pair[0].device, pair[1].device) {
            assert!(before.search.from <= after.search.from, "{pair:?}");
        }
    }
}

/// While the processor solves a block exactly, the device works on the chunks of the next, and the
/// answers come in the order of the blocks.
#[test]
fn exact_answers_overlap_the_kernels_of_the_next_block() {
    let Some(mut gpu) = gpu(true) else { return };
    if !gpu.has_timestamps() {
        eprintln!("SKIPPED: the adapter has no timestamps");
        return;
    }
    gpu.limits.loads = 1500;
    let backend = Backend::Gpu(Box::new(gpu));
    let Backend::Gpu(gpu) = &backend else { panic!("the backend changed") };
    let set = SeedSet::new(8).unwrap();
    let mut random = Random(41);
    let contact = random.two_stars();
    let wrenches: Vec<Wrench> = (0..3000)
        .map(|_| Wrench { force: random.vector(), moment: random.vector() * 0.01 })
        .collect();
    let problem =
        Problem { contact: &contact, distance: 0.03, force: 20.0, wrenches: &wrenches, pose: None };
    let batch = Batch { problems: vec![problem; 4] };
    let expected = backend.seed(&Batch { problems: vec![problem] }, &set).unwrap();
    let mut order = Vec::new();
    // Threads of its own, so that other tests do not hold them up.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    gpu.start_clock().unwrap();
    pool.install(|| {
        backend.by_blocks((3000, Wanted::All), &batch, &set, |block| {
            order.push(block.range);
            assert_eq!(block.survivors.seeds, expected);
            std::thread::sleep(std::time::Duration::from_millis(200));
            Vec::<()>::new()
        })
    })
    .unwrap();
    let timeline = gpu.stop_clock().unwrap();
    assert_eq!(order, [0..1, 1..2, 2..3, 3..4]);
    assert_eq!((timeline.chunks.len(), timeline.polish.len()), (8, 4));
    // Chunks 2k and 2k + 1 are block k's.
    for (block, polish) in timeline.polish.iter().enumerate().take(3) {
        let next = &timeline.chunks[2 * block + 2..2 * block + 4];
        let common: f64 =
            next.iter().map(|chunk| chunk.device.unwrap().search.common(*polish)).sum();
        let whole: f64 = next.iter().map(|chunk| chunk.device.unwrap().search.seconds()).sum();
        println!("block {block}: {common:.4} s of {whole:.4} s of the next one's search hidden");
        assert!(common > 0.0, "{timeline:?}");
    }
}
