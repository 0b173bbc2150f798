//! The kernels on the graphics processor, through wgpu. Two sets of buffers: while one chunk
//! computes, the next is uploaded and the one before read back.
//!
//! Up go contacts and grips, each grip a pose of some 80 bytes, and the list of loads unless it lies
//! there already. The loads of a grip are made where they are searched; those without bounds get
//! estimates from Newton's method. Back come eight bytes for each grip, and 32 for each load that can
//! be its worst; loads with neither come back as bits. Of grips times loads grows only what says which
//! are open, a bit for each load of a chunk.

mod adapter;
mod buffers;
mod check;
mod chunk;
mod clock;
mod cut;
mod newton;
mod shader;
mod survivors;
mod twin;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Instant;

pub use adapter::{ADAPTER_VARIABLE, AdapterSummary, list};
pub use check::{Deviation, KernelCheck};
pub use clock::{ChunkSpans, DeviceSpans, Span, Timeline};

use super::layout::{
    CaseRecord, ContactHeader, EdgeRecord, FoundRecord, GAUSS, GripRecord, OutcomeRecord,
    TwistRecord,
};
use super::seeds::SeedSet;
use crate::error::{Error, Result};
use buffers::map;
use chunk::{Chunk, Limits, List};
use clock::Clock;
use shader::Kernel;

/// Most bytes of contacts, edges or basis in one chunk, so that two of each fit a small card.
const CHUNK_BYTES: u64 = 64 << 20;

/// Most loads in one chunk: so many that a submission's own cost (some 0.1 ms) is lost in the time
/// that the processor takes for their grips, and so few that a block has several chunks.
const CHUNK_LOADS: usize = 1 << 18;

/// Entries for each grip of a chunk that there is room for at least: some 5 to 40 come back of 500
/// loads ...
const ROOM: f64 = 96.0;
/// ... and for so many loads one.
const LOADS_A_ROOM: usize = 4;

/// What the count of entries takes in front of the outcomes.
const TALLY: u64 = 16;

/// Why a chunk did not come back.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The device is gone or out of memory: the chunk can be computed elsewhere.
    Lost(String),
    /// A mistake of ours or of the driver's.
    Fault(String),
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Lost(why) => Self::device(format!("the graphics processor was lost: {why}")),
            Failure::Fault(why) => Self::device(why),
        }
    }
}

/// A graphics processor with its kernels compiled.
#[derive(Debug)]
pub struct Gpu {
    info: wgpu::AdapterInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    fan: Kernel,
    screen: Kernel,
    newton: Kernel,
    gauss: wgpu::Buffer,
    limits: Limits,
    lost: Arc<AtomicBool>,
    /// Chunks that the processor computed because the device was lost.
    redone: AtomicU64,
    /// Grips that the processor looked at because there was no room for their entries.
    crowded: AtomicU64,
    /// Whether a lost device is an error.
    strict: bool,
    state: Mutex<State>,
    clock: Mutex<Option<Clock>>,
    /// Destroys the device before this chunk (counted from 1; 0: never), to see what happens then.
    destroy_before: AtomicU64,
}

/// Buffers that are kept between calls.
#[derive(Debug, Default)]
struct State {
    seeds: Option<(SeedSet, wgpu::Buffer)>,
    /// The lists of loads that lie on the device.
    lists: Vec<Arc<List>>,
    cases: Option<wgpu::Buffer>,
    slots: [Slot; 2],
    /// Entries for each grip that came of the last chunk.
    rate: f64,
}

/// One chunk's buffers; they only grow.
#[derive(Debug, Default)]
struct Slot {
    staging: Option<Staging>,
    contacts: Option<wgpu::Buffer>,
    edges: Option<wgpu::Buffer>,
    basis: Option<wgpu::Buffer>,
    grips: Option<wgpu::Buffer>,
    tally: Option<wgpu::Buffer>,
    found: Option<wgpu::Buffer>,
    readback: Option<wgpu::Buffer>,
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
}

type Mapped = mpsc::Receiver<std::result::Result<(), wgpu::BufferAsyncError>>;

/// Memory that the processor writes and the device copies from.
#[derive(Debug)]
struct Staging {
    buffer: wgpu::Buffer,
    /// Says when the device has copied and the processor may write again.
    mapped: Mapped,
}

/// A chunk in flight.
struct Ticket {
    submission: wgpu::SubmissionIndex,
    mapped: Mapped,
    readback: wgpu::Buffer,
    grips: usize,
    /// Entries that there is room for, and those that are read back in any case.
    entries: [usize; 2],
    /// Windows in front of them.
    windows: usize,
    found: wgpu::Buffer,
    timed: bool,
    spans: ChunkSpans,
}

/// What came back of a chunk.
#[derive(Debug)]
pub(crate) struct Answer {
    /// Of each grip.
    outcomes: Vec<OutcomeRecord>,
    /// Of all grips, in no order.
    entries: Vec<FoundRecord>,
}

impl Gpu {
    /// Opens the adapter `asked` for (index or part of its name) and
    /// compiles the kernels. `strict`: a lost device is an error, otherwise its chunk is computed
    /// on the processor.
    ///
    /// # Errors
    /// A device error when there is no such adapter or it cannot run the kernels.
    pub fn open(asked: Option<&str>, strict: bool) -> Result<Self> {
        let adapter = adapter::choose(asked)?;
        let (info, available) = (adapter.get_info(), adapter.limits());
        let refused = |why: String| Error::device(format!("{}: {why}", info.name));
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gripfast"),
            // For the clock only: no answer depends on them.
            required_features: adapter.features() & adapter::TIMESTAMPS,
            required_limits: available.clone(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| refused(error.to_string()))?;
        let lost = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&lost);
        device.set_device_lost_callback(move |_, _| flag.store(true, Ordering::Release));
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let fan = Kernel::new(&device, "fill_basis", shader::FAN, &shader::FAN_BINDINGS);
        let screen = Kernel::new(&device, "screen", shader::SCREEN, &shader::SCREEN_BINDINGS);
        let newton = Kernel::new(&device, "newton", shader::NEWTON, &shader::NEWTON_BINDINGS);
        let gauss = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("gauss"),
            size: size_of_val(&GAUSS) as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&gauss, 0, bytemuck::cast_slice(&GAUSS));
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(refused(error.to_string()));
        }
        let bytes = CHUNK_BYTES
            .min(available.max_storage_buffer_binding_size)
            .min(available.max_buffer_size);
        let rows = u64::from(available.max_compute_workgroups_per_dimension);
        let fit = |each: usize| (bytes / each as u64) as usize;
        // Grips fill a grid of GRID columns.
        let grid = (u64::from(shader::GRID) * rows) as usize;
        let limits = Limits {
            loads: CHUNK_LOADS,
            grips: fit(size_of::<GripRecord>()).min(grid),
            contacts: fit(size_of::<ContactHeader>()).min(rows as usize),
            edges: fit(size_of::<EdgeRecord>()),
            basis: fit(size_of::<[f32; 4]>()),
            cases: fit(size_of::<CaseRecord>()),
            entries: fit(size_of::<FoundRecord>()),
        };
        Ok(Self {
            info,
            device,
            queue,
            fan,
            screen,
            newton,
            gauss,
            limits,
            lost,
            redone: AtomicU64::new(0),
            crowded: AtomicU64::new(0),
            strict,
            state: Mutex::default(),
            clock: Mutex::default(),
            destroy_before: AtomicU64::new(0),
        })
    }

    /// Name, graphics interface and driver of the adapter.
    pub fn name(&self) -> String {
        let driver = format!("{} {}", self.info.driver, self.info.driver_info);
        format!("{} ({:?}, {})", self.info.name, self.info.backend, driver.trim())
    }

    /// Whether the adapter is software: nothing about speed can be learnt from it.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Chunks computed on the processor because the device was lost.
    pub fn chunks_redone(&self) -> u64 {
        self.redone.load(Ordering::Relaxed)
    }

    /// Grips (of one with very many loads, parts of it) that the processor looked at because more
    /// came back of their chunk than there was room for.
    pub fn grips_redone(&self) -> u64 {
        self.crowded.load(Ordering::Relaxed)
    }

    /// Rehearses the loss of the device: it goes before the chunk number `before` (from 1), and a
    /// chunk has no more than `loads` loads.
    pub fn lose_before(&mut self, before: u64, loads: usize) {
        self.limits.loads = self.limits.loads.min(loads.max(1));
        self.destroy_before = AtomicU64::new(before);
    }

    /// Whether the adapter tells the time of copies too, not of kernels only.
    fn times_copies(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
    }

    fn clock(&self) -> MutexGuard<'_, Option<Clock>> {
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn limits(&self) -> Limits {
        self.limits
    }

    /// Computes chunk after chunk, handing each chunk's answer to `take` in order; `None` when the
    /// device was lost. `next` makes the following chunk while the device works on the one before.
    pub(crate) fn run<T>(
        &self,
        seeds: &SeedSet,
        next: impl FnMut() -> Option<(Chunk, T)>,
        take: impl FnMut(Option<Answer>, T) -> Result<()>,
    ) -> Result<()> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let outcome = self.run_chunks(&mut state, seeds, next, take);
        if outcome.is_err() {
            // A chunk may still be in flight: its buffers are not used again.
            *state = State { seeds: state.seeds.take(), ..State::default() };
        }
        outcome
    }

    fn run_chunks<T>(
        &self,
        state: &mut State,
        seeds: &SeedSet,
        mut next: impl FnMut() -> Option<(Chunk, T)>,
        mut take: impl FnMut(Option<Answer>, T) -> Result<()>,
    ) -> Result<()> {
        let mut in_flight: Option<(T, std::result::Result<Ticket, Failure>)> = None;
        let mut slot = 0;
        loop {
            let begin = Instant::now();
            let submitted = next().map(|(chunk, rest)| {
                let ticket = self.submit(state, slot, &chunk, seeds, begin);
                if ticket.is_err() {
                    // What was sent may not have come.
                    state.lists.clear();
                }
                (rest, ticket)
            });
            slot = 1 - slot;
            let Some((rest, ticket)) = std::mem::replace(&mut in_flight, submitted) else {
                if in_flight.is_none() {
                    return Ok(());
                }
                continue;
            };
            let mut spans = ChunkSpans::default();
            let answer = match ticket.and_then(|ticket| self.collect(&ticket, &mut spans)) {
                Ok(answer) => {
                    state.rate = answer.entries.len() as f64 / answer.outcomes.len().max(1) as f64;
                    Some(answer)
                }
                Err(Failure::Lost(_)) if !self.strict => {
                    self.redone.fetch_add(1, Ordering::Relaxed);
                    None
                }
                Err(failure) => return Err(failure.into()),
            };
            let begin = Instant::now();
            take(answer, rest)?;
            if let Some(clock) = &mut *self.clock() {
                spans.spread = clock.span(begin, Instant::now());
                clock.timeline.chunks.push(spans);
            }
        }
    }

    fn check_lost(&self) -> std::result::Result<(), Failure> {
        if self.lost.load(Ordering::Acquire) {
            Err(Failure::Lost(format!("{} does not answer any more", self.info.name)))
        } else {
            Ok(())
        }
    }

    /// The failure that an error of wgpu means.
    fn failure(&self, error: &wgpu::Error) -> Failure {
        if self.lost.load(Ordering::Acquire) || matches!(error, wgpu::Error::OutOfMemory { .. }) {
            Failure::Lost(error.to_string())
        } else {
            Failure::Fault(error.to_string())
        }
    }

    /// Uploads a chunk, starts both kernels on it and the way back.
    fn submit(
        &self,
        state: &mut State,
        slot: usize,
        chunk: &Chunk,
        seeds: &SeedSet,
        begin: Instant,
    ) -> std::result::Result<Ticket, Failure> {
        let made = Instant::now();
        if self.destroy_before.load(Ordering::Relaxed) > 0
            && self.destroy_before.fetch_sub(1, Ordering::Relaxed) == 1
        {
            self.device.destroy();
        }
        self.check_lost()?;
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let ticket = self.encode(state, slot, chunk, seeds);
        let sent = Instant::now();
        let errors = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
        match errors.into_iter().flatten().next() {
            Some(error) => Err(self.failure(&error)),
            None => ticket.map(|mut ticket| {
                if let Some(clock) = &*self.clock() {
                    ticket.spans.make = clock.span(begin, made);
                    ticket.spans.send = clock.span(made, sent);
                }
                ticket
            }),
        }
    }

    /// The twists on the device, unless they are there.
    fn keep_seeds(&self, state: &mut State, seeds: &SeedSet) {
        if state.seeds.as_ref().is_some_and(|(known, _)| known == seeds) {
            return;
        }
        let pairs = seeds.twists().iter().zip(seeds.rings());
        let records: Vec<TwistRecord> =
            pairs.map(|(&twist, &ring)| TwistRecord { twist, ring, padding: [0; 2] }).collect();
        let bytes = bytemuck::cast_slice::<TwistRecord, u8>(&records);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.buffer("twists", bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        state.seeds = Some((seeds.clone(), buffer));
    }

    /// Entries of a chunk that there is room for, and those that are read back in any case: a
    /// quarter more than came of the one before.
    fn entries(&self, rate: f64, chunk: &Chunk) -> [usize; 2] {
        let grips = chunk.grips.len();
        // Each load, and each window of 128 with some left open.
        let most = (chunk.loads + chunk.loads / 128 + grips).min(self.limits.entries);
        let share = |each: f64| ((each * grips as f64) as usize + 64).min(most);
        if chunk.every {
            return [most; 2];
        }
        let room = share(ROOM.max(2.0 * rate)).max((chunk.loads / LOADS_A_ROOM).min(most));
        [room, share(1.25 * rate).min(room)]
    }

    fn encode(
        &self,
        state: &mut State,
        slot: usize,
        chunk: &Chunk,
        seeds: &SeedSet,
    ) -> std::result::Result<Ticket, Failure> {
        let (device, queue) = (&self.device, &self.queue);
        let timed = self.has_timestamps() && self.clock().is_some();
        let copies = timed && self.times_copies();
        self.keep_seeds(state, seeds);
        // Lists that lie there already are not sent again.
        let known = |(a, b): (&Arc<List>, &Arc<List>)| Arc::ptr_eq(a, b) || a == b;
        let there = state.lists.len() == chunk.lists.len()
            && state.lists.iter().zip(&chunk.lists).all(known);
        let cases: Vec<CaseRecord> = if there {
            Vec::new()
        } else {
            chunk.lists.iter().flat_map(|list| list.records.iter().copied()).collect()
        };
        let all = chunk.lists.iter().map(|list| list.records.len()).sum::<usize>();
        let case_bytes = (all * size_of::<CaseRecord>()) as u64;
        let [room, sure] = self.entries(state.rate, chunk);
        let State { seeds: known, lists, cases: on_device, slots, .. } = state;
        let slot = &mut slots[slot];
        let tally_bytes = TALLY + (chunk.grips.len() * size_of::<OutcomeRecord>()) as u64;
        let [found_bytes, back_bytes, window_bytes] = [chunk.windows + room, sure, chunk.windows]
            .map(|count| (count * size_of::<FoundRecord>()) as u64);
        let basis_bytes = (chunk.basis * size_of::<[f32; 4]>()) as u64;
        let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let output = input | wgpu::BufferUsages::COPY_SRC;
        let arrays: [&[u8]; 4] = [
            bytemuck::cast_slice::<ContactHeader, u8>(&chunk.contacts),
            bytemuck::cast_slice::<EdgeRecord, u8>(&chunk.edges),
            bytemuck::cast_slice::<GripRecord, u8>(&chunk.grips),
            bytemuck::cast_slice::<CaseRecord, u8>(&cases),
        ];
        let lengths = arrays.map(|array| array.len() as u64);
        let staging = self.staged(&mut slot.staging, &arrays)?;
        let inputs = [
            self.grown(&mut slot.contacts, "contacts", lengths[0], input),
            self.grown(&mut slot.edges, "edges", lengths[1], input),
            self.grown(&mut slot.grips, "grips", lengths[2], input),
            self.grown(on_device, "loads", case_bytes, input),
        ];
        lists.clone_from(&chunk.lists);
        let basis = self.grown(&mut slot.basis, "basis", basis_bytes, output);
        let tally = self.grown(&mut slot.tally, "tally", tally_bytes, output);
        let found = self.grown(&mut slot.found, "found", found_bytes, output);
        let times = u64::from(clock::QUERIES) * u64::from(wgpu::QUERY_SIZE);
        let readback = self.grown(
            &mut slot.readback,
            "readback",
            tally_bytes + back_bytes + times,
            wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        );
        let queries = timed.then(|| &*slot.queries.get_or_insert_with(|| self.queries()));
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("seed") });
        let stamp = |encoder: &mut wgpu::CommandEncoder, place: u32| {
            if let (true, Some((set, _))) = (copies, queries) {
                encoder.write_timestamp(set, place);
            }
        };
        let pass = |place: u32| wgpu::ComputePassDescriptor {
            label: Some("seed"),
            timestamp_writes: queries.map(|(set, _)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(place),
                end_of_pass_write_index: Some(place + 1),
            }),
        };
        stamp(&mut encoder, clock::UPLOAD);
        let mut offset = 0;
        for (buffer, length) in inputs.iter().zip(lengths).filter(|(_, length)| *length > 0) {
            encoder.copy_buffer_to_buffer(&staging, offset, buffer, 0, length);
            offset += length;
        }
        // Zero is UNWRITTEN, and no entry of an earlier chunk is taken for one of this.
        encoder.clear_buffer(&tally, 0, Some(tally_bytes));
        encoder.clear_buffer(&found, 0, Some(found_bytes));
        if let Some((seeds, twists)) = &*known {
            let twists = (twists, (seeds.len() * size_of::<TwistRecord>()) as u64);
            let [contacts, edges, grips] = [0, 1, 2].map(|i| (&inputs[i], lengths[i]));
            let cases = (&inputs[3], case_bytes);
            let (basis, gauss) = ((&basis, basis_bytes), (&self.gauss, size_of_val(&GAUSS) as u64));
            let fan = self.fan.bind(device, &[contacts, edges, twists, basis, gauss]);
            let (tally, found) = ((&tally, tally_bytes), (&found, found_bytes));
            let bound = [contacts, edges, twists, basis, cases, grips, tally, found];
            let screen = self.screen.bind(device, &bound);
            let bound = [contacts, edges, twists, basis, cases, grips, tally, found, gauss];
            let newton = self.newton.bind(device, &bound);
            let twists = seeds.len().div_ceil(super::layout::BASIS_GROUP) as u32;
            let count = chunk.grips.len() as u32;
            let grid = [count.min(shader::GRID), count.div_ceil(shader::GRID)];
            for (kernel, bound, place, [x, y]) in [
                (&self.fan, fan, clock::BASIS, [twists, chunk.contacts.len() as u32]),
                (&self.screen, screen, clock::SEARCH, grid),
                (&self.newton, newton, clock::NEWTON, grid),
            ] {
                let mut pass = encoder.begin_compute_pass(&pass(place));
                pass.set_pipeline(&kernel.pipeline);
                pass.set_bind_group(0, &bound, &[]);
                pass.dispatch_workgroups(x, y, 1);
            }
        }
        encoder.copy_buffer_to_buffer(&tally, 0, &readback, 0, tally_bytes);
        encoder.copy_buffer_to_buffer(&found, window_bytes, &readback, tally_bytes, back_bytes);
        stamp(&mut encoder, clock::READBACK);
        if let Some((set, resolved)) = queries {
            // Places that were not written are not read either.
            let first = if copies { clock::UPLOAD } else { clock::BASIS };
            let end = if copies { clock::QUERIES } else { clock::READBACK };
            encoder.resolve_query_set(set, first..end, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, &readback, tally_bytes + back_bytes, times);
        }
        let submission = queue.submit([encoder.finish()]);
        slot.staging =
            Some(Staging { mapped: map(&staging, wgpu::MapMode::Write), buffer: staging });
        let mapped = map(&readback, wgpu::MapMode::Read);
        let spans = ChunkSpans {
            loads: chunk.loads,
            bytes_up: lengths.iter().sum(),
            bytes_down: tally_bytes + back_bytes,
            grips: chunk.grips.len(),
            ..ChunkSpans::default()
        };
        let (grips, entries, windows) = (chunk.grips.len(), [room, sure], chunk.windows);
        Ok(Ticket { submission, mapped, readback, grips, entries, windows, found, timed, spans })
    }
}

#[cfg(test)]
mod tests;
