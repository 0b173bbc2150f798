//! Where the time of a batch goes: the device's own timestamps where the adapter has them, the
//! processor's clock for the rest. Nothing here is needed for an answer: without a running clock
//! no query is made, and without timestamps the device's steps are not told apart.

use std::time::Instant;

use super::Gpu;
use crate::error::{Error, Result};

/// Places of the timestamps of one chunk.
pub(super) const UPLOAD: u32 = 0;
pub(super) const BASIS: u32 = 1;
pub(super) const SEARCH: u32 = 3;
pub(super) const NEWTON: u32 = 5;
pub(super) const READBACK: u32 = 7;
pub(super) const QUERIES: u32 = 8;

/// From when to when \[s\], counted from the start of the clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Span {
    /// Beginning.
    pub from: f64,
    /// End.
    pub to: f64,
}

impl Span {
    /// Its length \[s\].
    pub fn seconds(self) -> f64 {
        self.to - self.from
    }

    /// Time \[s\] that it has in common with another.
    pub fn common(self, other: Self) -> f64 {
        (self.to.min(other.to) - self.from.max(other.from)).max(0.0)
    }
}

/// Steps of one chunk on the device, by its timestamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct DeviceSpans {
    /// From staging memory to the device's; `None` where timestamps are for kernels only.
    pub upload: Option<Span>,
    /// The basis kernel.
    pub basis: Span,
    /// The screen.
    pub search: Span,
    /// Newton's method on the loads without bounds.
    pub newton: Span,
    /// Records to memory that the processor reads; `None` where timestamps are for kernels only.
    pub readback: Option<Span>,
}

/// Steps of one chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct ChunkSpans {
    /// Loads in it.
    pub loads: usize,
    /// Grips in it; one with very many loads counts as several.
    pub grips: usize,
    /// Seeds that came back, and windows of loads left to the processor.
    pub entries: usize,
    /// Bytes to the device.
    pub bytes_up: u64,
    /// Bytes back.
    pub bytes_down: u64,
    /// The processor makes the records.
    pub make: Span,
    /// The processor copies them to staging memory and submits.
    pub send: Span,
    /// The processor waits for the device.
    pub wait: Span,
    /// The processor copies the answers.
    pub fetch: Span,
    /// The processor turns them into seeds, and finds those of the loads left to it.
    pub spread: Span,
    /// On the device; `None` without timestamps, or when the device was lost.
    pub device: Option<DeviceSpans>,
}

/// What happened while the clock ran, in the order of submission.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Timeline {
    /// One for each chunk.
    pub chunks: Vec<ChunkSpans>,
    /// The processor's exact answers, block by block.
    pub polish: Vec<Span>,
}

/// A running clock.
#[derive(Debug)]
pub(super) struct Clock {
    start: Instant,
    /// Seconds of a tick of the device; `None` without timestamps.
    tick: Option<f64>,
    /// A timestamp of the device and when it was taken.
    zero: (u64, f64),
    pub(super) timeline: Timeline,
}

impl Clock {
    pub(super) fn span(&self, from: Instant, to: Instant) -> Span {
        let since = |instant: Instant| instant.saturating_duration_since(self.start).as_secs_f64();
        Span { from: since(from), to: since(to) }
    }

    /// Ticks of one chunk on this clock. Copies have none where timestamps are for kernels only.
    pub(super) fn device(&self, ticks: &[u64], copies: bool) -> Option<DeviceSpans> {
        let (tick, (zero, offset)) = (self.tick?, self.zero);
        let first = if copies { UPLOAD } else { BASIS };
        let at = |place: u32| {
            let ticks = *ticks.get((place - first) as usize)?;
            Some(offset + (i128::from(ticks) - i128::from(zero)) as f64 * tick)
        };
        let span = |from: u32, to: u32| Some(Span { from: at(from)?, to: at(to)? });
        Some(DeviceSpans {
            upload: if copies { span(UPLOAD, BASIS) } else { None },
            basis: span(BASIS, BASIS + 1)?,
            search: span(SEARCH, SEARCH + 1)?,
            newton: span(NEWTON, NEWTON + 1)?,
            readback: if copies { span(NEWTON + 1, READBACK) } else { None },
        })
    }
}

impl Gpu {
    /// Whether the adapter tells the time of its kernels.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// From now on the steps of each chunk are timed.
    ///
    /// # Errors
    /// [`crate::error::ErrorKind::Device`] when the device does not answer.
    pub fn start_clock(&self) -> Result<()> {
        let start = Instant::now();
        let mut clock = Clock { start, tick: None, zero: (0, 0.0), timeline: Timeline::default() };
        if self.has_timestamps() {
            let queries = self.queries();
            let readback = self.buffer(
                "clock",
                queries.1.size(),
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            );
            let mut encoder = self.device.create_command_encoder(&Default::default());
            drop(encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("clock"),
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: &queries.0,
                    beginning_of_pass_write_index: Some(0),
                    end_of_pass_write_index: Some(1),
                }),
            }));
            encoder.resolve_query_set(&queries.0, 0..2, &queries.1, 0);
            encoder.copy_buffer_to_buffer(&queries.1, 0, &readback, 0, 16);
            let submission = self.queue.submit([encoder.finish()]);
            readback.map_async(wgpu::MapMode::Read, 0..16, |_| {});
            let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
            let failed = |why: String| Error::device(format!("starting the clock: {why}"));
            self.device.poll(wait).map_err(|error| failed(error.to_string()))?;
            let view =
                readback.get_mapped_range(0..16).map_err(|error| failed(error.to_string()))?;
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&view);
            clock.tick = Some(f64::from(self.queue.get_timestamp_period()) * 1e-9);
            clock.zero = (ticks[1], start.elapsed().as_secs_f64());
        }
        *self.clock() = Some(clock);
        Ok(())
    }

    /// Stops the clock; `None` when it did not run.
    pub fn stop_clock(&self) -> Option<Timeline> {
        self.clock().take().map(|clock| clock.timeline)
    }

    /// Notes on a running clock that the processor solved a block exactly from `start` until now.
    pub(crate) fn polished_since(&self, start: Instant) {
        if let Some(clock) = &mut *self.clock() {
            let span = clock.span(start, Instant::now());
            clock.timeline.polish.push(span);
        }
    }

    /// Room for the timestamps of a chunk, and a buffer that they can be resolved into.
    pub(super) fn queries(&self) -> (wgpu::QuerySet, wgpu::Buffer) {
        let queries = self.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: QUERIES,
        });
        let bytes = u64::from(QUERIES) * u64::from(wgpu::QUERY_SIZE);
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        (queries, self.buffer("times", bytes, usage))
    }
}
