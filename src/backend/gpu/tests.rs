//! Rust f32 against WGSL, record by record, and the loss of a device.

use super::super::job::Job;
use super::super::layout::{BOUNDED, UNWRITTEN};
use super::super::prepare::{Contacts, not_searched};
use super::super::{Backend, Batch, Polish, Problem, ScoreOptions, SeedStatus, cpu};
use super::check::Random;
use super::*;
use crate::model::{Contact, Patch, Polygon, Wrench};
use glam::DVec2;

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
        if a.status == UNWRITTEN || b.status == UNWRITTEN {
            return Err(format!("record {i} was not written"));
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

/// Records of both kernels for the same chunks.
fn records(
    gpu: &Gpu,
    problems: Vec<Problem<'_>>,
    seeds: &SeedSet,
) -> (Vec<SeedRecord>, Vec<SeedRecord>) {
    let batch = Batch { problems };
    let contacts = Contacts::new(&batch.problems).unwrap();
    let job = Job::new(&contacts, &batch, seeds).unwrap();
    let mut answers = vec![not_searched(SeedStatus::NoContact); job.loads];
    let mut chunks: Vec<Chunk> =
        job.plans(gpu.limits(), &mut answers).iter_mut().map(|plan| job.build(plan)).collect();
    let expected = chunks.iter().flat_map(|chunk| cpu::run(chunk, seeds)).collect();
    let mut found = Vec::new();
    let mut next =
        chunks.drain(..).filter(|chunk| !chunk.loads.is_empty()).map(|chunk| (chunk, ()));
    gpu.run(
        seeds,
        || next.next(),
        |records, ()| {
            found.extend(records);
            Ok(())
        },
    )
    .unwrap();
    (found, expected)
}

#[test]
fn shaders_give_the_records_of_the_processor() {
    let Some(gpu) = gpu(true) else { return };
    let mut random = Random(7);
    for frequency in [1, 4, 8, 13] {
        let seeds = SeedSet::new(frequency).unwrap();
        let grips: Vec<_> = (0..150)
            .map(|_| {
                let loads: Vec<Wrench> = (0..(random.within(0.0, 1.0) * 150.0) as usize)
                    .map(|_| Wrench {
                        force: random.vector() * 10.0,
                        moment: random.vector() * 0.1 * random.within(0.0, 1.0),
                    })
                    .collect();
                (random.two_stars(), random.within(0.0, 0.1), loads)
            })
            .collect();
        let problems = grips
            .iter()
            .map(|(contact, distance, wrenches)| Problem {
                contact,
                distance: *distance,
                force: 40.0,
                wrenches,
                pose: None,
            })
            .collect();
        let (found, expected) = records(&gpu, problems, &seeds);
        assert_same(&found, &expected);
        let bounded = found.iter().filter(|r| r.status == BOUNDED).count();
        let changed = found.iter().zip(&expected).filter(|(a, b)| a.status != b.status).count();
        println!(
            "{} twists: {} records, {bounded} bounded, {changed} with another status",
            seeds.len(),
            found.len()
        );
        assert!(bounded > found.len() / 10 && changed <= found.len() / 1000);
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
        for (a, b) in found.iter().zip(&expected) {
            assert!(
                a.status == b.status && (a.lower - b.lower).abs() <= 1e-4 * b.lower.max(1e-9),
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

/// Outputs start as zeros, also in buffers used before: a record that no invocation wrote is found
/// out.
#[test]
fn a_record_that_was_not_written_is_an_error() {
    let Some(gpu) = gpu(true) else { return };
    let set = SeedSet::default();
    let mut random = Random(19);
    let contact = random.two_stars();
    let wrenches: Vec<Wrench> = (0..130)
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
    let contacts = Contacts::new(&batch.problems).unwrap();
    let job = Job::new(&contacts, &batch, &set).unwrap();
    let run = |forget: bool| {
        let mut answers = vec![not_searched(SeedStatus::NoContact); job.loads];
        let mut plans = job.plans(gpu.limits(), &mut answers).into_iter();
        let next = || {
            plans.next().map(|mut plan| {
                let mut chunk = job.build(&mut plan);
                if forget {
                    chunk.groups.truncate(1);
                }
                (chunk, plan)
            })
        };
        gpu.run(&set, next, |records, plan| job.scatter(&records, plan))
    };
    // Twice each, for both slots of buffers have been written by then.
    for forget in [false, false, true, true] {
        match run(forget) {
            Ok(()) => assert!(!forget),
            Err(error) => assert!(forget && error.to_string().contains("did not write"), "{error}"),
        }
    }
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
            assert!(deviation.count > 0 && deviation.from_twin < 2e-5, "{deviation:?}");
        }
        println!("{} twists: {:.1e} of {:.1e}", seeds.len(), check.largest, check.tolerance);
        assert!(check.tolerance_holds() && check.largest > 0.0, "{check:?}");
        assert!(check.bounded > check.loads / 3, "{check:?}");
        assert!(check.other_status + check.other_twist <= check.loads / 200, "{check:?}");
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
        assert!(chunk.bytes_up > 0 && chunk.bytes_down == (chunk.loads * 32) as u64);
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
        backend.by_blocks((3000, true), &batch, &set, |block| {
            order.push(block.range);
            assert_eq!(block.survivors.seeds, expected);
            std::thread::sleep(std::time::Duration::from_millis(200));
            Vec::new()
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
