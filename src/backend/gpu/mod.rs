//! The kernels on the graphics processor, through wgpu. Two sets of buffers: while one chunk
//! computes, the next is uploaded and the one before read back.

mod adapter;
mod check;
mod clock;
mod shader;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Instant;

pub use adapter::{ADAPTER_VARIABLE, AdapterSummary, list};
pub use check::{Deviation, KernelCheck};
pub use clock::{ChunkSpans, DeviceSpans, Span, Timeline};

use super::job::Limits;
use super::layout::{ContactHeader, EdgeRecord, GAUSS, GroupRecord, LoadRecord, SeedRecord};
use super::prepare::Chunk;
use super::seeds::SeedSet;
use crate::error::{Error, Result};
use clock::Clock;
use shader::Kernel;

/// Most bytes of contacts, edges or basis in one chunk, so that two of each fit a small card.
const CHUNK_BYTES: u64 = 64 << 20;

/// Most loads in one chunk: so many that a submission's own cost (some 0.1 ms) is lost in the time
/// that the processor takes to make and spread them, and so few that a block has several chunks.
const CHUNK_LOADS: u64 = 1 << 17;

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
    search: Kernel,
    gauss: wgpu::Buffer,
    limits: Limits,
    lost: Arc<AtomicBool>,
    /// Chunks that the processor computed because the device was lost.
    redone: AtomicU64,
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
    seeds: Option<(SeedSet, wgpu::Buffer, wgpu::Buffer)>,
    slots: [Slot; 2],
}

/// One chunk's buffers; they only grow.
#[derive(Debug, Default)]
struct Slot {
    staging: Option<Staging>,
    contacts: Option<wgpu::Buffer>,
    edges: Option<wgpu::Buffer>,
    basis: Option<wgpu::Buffer>,
    loads: Option<wgpu::Buffer>,
    groups: Option<wgpu::Buffer>,
    seeds: Option<wgpu::Buffer>,
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
    /// Of the records; timestamps lie behind them.
    bytes: u64,
    timed: bool,
    spans: ChunkSpans,
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
        let search = Kernel::new(&device, "search", shader::SEARCH, &shader::SEARCH_BINDINGS);
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
        // A group per load is the worst case; they fill a grid of GRID columns.
        let loads = (bytes / size_of::<LoadRecord>() as u64)
            .min(u64::from(shader::GRID) * rows)
            .min(CHUNK_LOADS) as usize;
        let limits = Limits {
            loads,
            contacts: (bytes / size_of::<ContactHeader>() as u64).min(rows) as usize,
            edges: (bytes / size_of::<EdgeRecord>() as u64) as usize,
            basis: (bytes / size_of::<[f32; 4]>() as u64) as usize,
        };
        Ok(Self {
            info,
            device,
            queue,
            fan,
            search,
            gauss,
            limits,
            lost,
            redone: AtomicU64::new(0),
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

    /// Computes chunk after chunk, handing each chunk's records to `take` in order. `next` makes
    /// the following chunk while the device works on the one before.
    pub(crate) fn run<T>(
        &self,
        seeds: &SeedSet,
        next: impl FnMut() -> Option<(Chunk, T)>,
        take: impl FnMut(Vec<SeedRecord>, T) -> Result<()>,
    ) -> Result<()> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let outcome = self.run_chunks(&mut state, seeds, next, take);
        if outcome.is_err() {
            // A chunk may still be in flight: its buffers are not used again.
            state.slots = Default::default();
        }
        outcome
    }

    fn run_chunks<T>(
        &self,
        state: &mut State,
        seeds: &SeedSet,
        mut next: impl FnMut() -> Option<(Chunk, T)>,
        mut take: impl FnMut(Vec<SeedRecord>, T) -> Result<()>,
    ) -> Result<()> {
        let mut in_flight: Option<(Chunk, T, std::result::Result<Ticket, Failure>)> = None;
        let mut slot = 0;
        loop {
            let begin = Instant::now();
            let submitted = next().map(|(chunk, rest)| {
                let ticket = self.submit(state, slot, &chunk, seeds, begin);
                (chunk, rest, ticket)
            });
            slot = 1 - slot;
            let Some((chunk, rest, ticket)) = std::mem::replace(&mut in_flight, submitted) else {
                if in_flight.is_none() {
                    return Ok(());
                }
                continue;
            };
            let mut spans = ChunkSpans::default();
            let outcome = ticket.and_then(|ticket| {
                let records = self.collect(&ticket, &mut spans)?;
                Ok(records)
            });
            let records = match outcome {
                Ok(records) => records,
                Err(Failure::Lost(_)) if !self.strict => {
                    self.redone.fetch_add(1, Ordering::Relaxed);
                    super::cpu::run(&chunk, seeds)
                }
                Err(failure) => return Err(failure.into()),
            };
            let begin = Instant::now();
            take(records, rest)?;
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
        if state.seeds.as_ref().is_some_and(|(known, ..)| known == seeds) {
            return;
        }
        let upload = |name: &str, bytes: &[u8]| {
            let buffer = self.buffer(
                name,
                bytes.len() as u64,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            );
            self.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let (twists, rings) = (
            upload("twists", bytemuck::cast_slice(seeds.twists())),
            upload("rings", bytemuck::cast_slice(seeds.rings())),
        );
        state.seeds = Some((seeds.clone(), twists, rings));
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
        let State { seeds: known, slots } = state;
        let slot = &mut slots[slot];
        let records = (chunk.loads.len() * size_of::<SeedRecord>()) as u64;
        let basis_bytes = (chunk.basis * size_of::<[f32; 4]>()) as u64;
        let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let output = input | wgpu::BufferUsages::COPY_SRC;
        let arrays: [&[u8]; 4] = [
            bytemuck::cast_slice::<ContactHeader, u8>(&chunk.contacts),
            bytemuck::cast_slice::<EdgeRecord, u8>(&chunk.edges),
            bytemuck::cast_slice::<LoadRecord, u8>(&chunk.loads),
            bytemuck::cast_slice::<GroupRecord, u8>(&chunk.groups),
        ];
        let lengths = arrays.map(|array| array.len() as u64);
        let staging = self.staged(&mut slot.staging, &arrays)?;
        let inputs = [
            self.grown(&mut slot.contacts, "contacts", lengths[0], input),
            self.grown(&mut slot.edges, "edges", lengths[1], input),
            self.grown(&mut slot.loads, "loads", lengths[2], input),
            self.grown(&mut slot.groups, "groups", lengths[3], input),
        ];
        let basis = self.grown(&mut slot.basis, "basis", basis_bytes, output);
        let found = self.grown(&mut slot.seeds, "seeds", records, output);
        let times = u64::from(clock::QUERIES) * u64::from(wgpu::QUERY_SIZE);
        let readback = self.grown(
            &mut slot.readback,
            "readback",
            records + times,
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
        for (buffer, length) in inputs.iter().zip(lengths) {
            encoder.copy_buffer_to_buffer(&staging, offset, buffer, 0, length);
            offset += length;
        }
        // Zero is the status UNWRITTEN.
        encoder.clear_buffer(&found, 0, Some(records));
        if let Some((seeds, twists, rings)) = &*known {
            let (twists, rings) = (
                (twists, size_of_val(seeds.twists()) as u64),
                (rings, size_of_val(seeds.rings()) as u64),
            );
            let [contacts, edges, loads, groups] = [0, 1, 2, 3].map(|i| (&inputs[i], lengths[i]));
            let (basis, gauss) = ((&basis, basis_bytes), (&self.gauss, size_of_val(&GAUSS) as u64));
            let fan = self.fan.bind(device, &[contacts, edges, twists, basis, gauss]);
            let bound = [contacts, edges, twists, rings, basis, loads, groups, (&found, records)];
            let search = self.search.bind(device, &bound);
            let twists = seeds.len().div_ceil(super::layout::BASIS_GROUP) as u32;
            let count = chunk.groups.len() as u32;
            for (kernel, bound, place, [x, y]) in [
                (&self.fan, fan, clock::BASIS, [twists, chunk.contacts.len() as u32]),
                (
                    &self.search,
                    search,
                    clock::SEARCH,
                    [count.min(shader::GRID), count.div_ceil(shader::GRID)],
                ),
            ] {
                let mut pass = encoder.begin_compute_pass(&pass(place));
                pass.set_pipeline(&kernel.pipeline);
                pass.set_bind_group(0, &bound, &[]);
                pass.dispatch_workgroups(x, y, 1);
            }
        }
        encoder.copy_buffer_to_buffer(&found, 0, &readback, 0, records);
        stamp(&mut encoder, clock::READBACK);
        if let Some((set, resolved)) = queries {
            // Places that were not written are not read either.
            let first = if copies { clock::UPLOAD } else { clock::BASIS };
            let end = if copies { clock::QUERIES } else { clock::READBACK };
            encoder.resolve_query_set(set, first..end, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, &readback, records, times);
        }
        let submission = queue.submit([encoder.finish()]);
        slot.staging =
            Some(Staging { mapped: map(&staging, wgpu::MapMode::Write), buffer: staging });
        let mapped = map(&readback, wgpu::MapMode::Read);
        let spans = ChunkSpans {
            loads: chunk.loads.len(),
            bytes_up: lengths.iter().sum(),
            bytes_down: records,
            ..ChunkSpans::default()
        };
        Ok(Ticket { submission, mapped, readback, bytes: records, timed, spans })
    }

    /// The arrays, one behind the other, in memory that the device copies from: that of the chunk
    /// before the last, which was waited for, where it is large enough.
    fn staged(
        &self,
        place: &mut Option<Staging>,
        arrays: &[&[u8]],
    ) -> std::result::Result<wgpu::Buffer, Failure> {
        let bytes: usize = arrays.iter().map(|array| array.len()).sum();
        let used = place.take().filter(|staging| {
            staging.buffer.size() >= bytes as u64 && matches!(staging.mapped.try_recv(), Ok(Ok(())))
        });
        let buffer = used.map_or_else(
            || {
                self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("staging"),
                    size: (bytes as u64).next_power_of_two().max(16),
                    usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: true,
                })
            },
            |staging| staging.buffer,
        );
        let mut view = buffer
            .get_mapped_range_mut(0..bytes as u64)
            .map_err(|error| Failure::Lost(format!("memory for the upload: {error}")))?;
        let mut from = 0;
        for array in arrays {
            view.slice(from..from + array.len()).copy_from_slice(array);
            from += array.len();
        }
        drop(view);
        buffer.unmap();
        Ok(buffer)
    }

    /// Waits for a chunk and copies its records.
    fn collect(
        &self,
        ticket: &Ticket,
        spans: &mut ChunkSpans,
    ) -> std::result::Result<Vec<SeedRecord>, Failure> {
        let begin = Instant::now();
        let wait = wgpu::PollType::Wait {
            submission_index: Some(ticket.submission.clone()),
            timeout: None,
        };
        let outcome = self.device.poll(wait);
        let ready = Instant::now();
        self.check_lost()?;
        outcome.map_err(|error| match error {
            // A device that is gone takes no submission; its own word of that may come later.
            wgpu::PollError::WrongSubmissionIndex(..) => {
                Failure::Lost("it did not take the work".to_owned())
            }
            error => Failure::Fault(format!("waiting for the graphics processor: {error}")),
        })?;
        match ticket.mapped.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(Failure::Lost(format!("reading back: {error}"))),
            Err(_) => {
                return Err(Failure::Fault("the answers were not ready after the wait".to_owned()));
            }
        }
        let view = ticket
            .readback
            .get_mapped_range(..)
            .map_err(|error| Failure::Fault(error.to_string()))?;
        let (records, rest) = view.split_at(ticket.bytes as usize);
        let records = bytemuck::pod_collect_to_vec(records);
        if let Some(clock) = &*self.clock() {
            *spans = ticket.spans;
            spans.wait = clock.span(begin, ready);
            spans.fetch = clock.span(ready, Instant::now());
            if ticket.timed {
                let count = clock::QUERIES as usize * size_of::<u64>();
                let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&rest[..count]);
                spans.device = clock.device(&ticks, self.times_copies());
            }
        }
        drop(view);
        ticket.readback.unmap();
        Ok(records)
    }

    fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.max(16),
            usage,
            mapped_at_creation: false,
        })
    }

    /// The slot's buffer, replaced by a larger one where `size` needs it.
    fn grown(
        &self,
        place: &mut Option<wgpu::Buffer>,
        label: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        match place {
            Some(buffer) if buffer.size() >= size => buffer.clone(),
            _ => {
                let most = self.device.limits().max_buffer_size;
                place
                    .insert(self.buffer(label, size.next_power_of_two().min(most).max(size), usage))
                    .clone()
            }
        }
    }
}

/// Asks for the buffer's memory, once the device is done with it.
fn map(buffer: &wgpu::Buffer, mode: wgpu::MapMode) -> Mapped {
    let (sender, mapped) = mpsc::channel();
    buffer.map_async(mode, .., move |outcome| {
        // The receiver is gone only when the call was abandoned.
        let _ = sender.send(outcome);
    });
    mapped
}

#[cfg(test)]
mod tests;
