//! Memory that both processors see: the way to the device, and back.

use std::sync::mpsc;
use std::time::Instant;

use super::super::layout::{FoundRecord, OutcomeRecord};
use super::clock;
use super::{Answer, ChunkSpans, Failure, Gpu, Mapped, Staging, TALLY, Ticket};

impl Gpu {
    /// The arrays, one behind the other, in memory that the device copies from: that of the chunk
    /// before the last, which was waited for, where it is large enough.
    pub(super) fn staged(
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

    /// Waits for a chunk and copies what came of it.
    pub(super) fn collect(
        &self,
        ticket: &Ticket,
        spans: &mut ChunkSpans,
    ) -> std::result::Result<Answer, Failure> {
        let begin = Instant::now();
        self.wait(&ticket.submission, &ticket.mapped)?;
        let ready = Instant::now();
        let fault = |error: wgpu::MapRangeError| Failure::Fault(error.to_string());
        let view = ticket.readback.get_mapped_range(..).map_err(fault)?;
        let [room, sure] = ticket.entries;
        let (tally, rest) = view.split_at(TALLY as usize);
        let (outcomes, rest) = rest.split_at(ticket.grips * size_of::<OutcomeRecord>());
        let (entries, times) = rest.split_at(sure * size_of::<FoundRecord>());
        // More are counted than there is room for.
        let count = bytemuck::pod_collect_to_vec::<u8, u32>(&tally[..4])[0] as usize;
        let written = count.min(room);
        let mut answer = Answer {
            outcomes: bytemuck::pod_collect_to_vec(outcomes),
            entries: bytemuck::pod_collect_to_vec(
                &entries[..written.min(sure) * size_of::<FoundRecord>()],
            ),
        };
        let more = written.saturating_sub(sure);
        if more > 0 {
            answer.entries.extend(self.rest(&ticket.found, ticket.windows + sure, more)?);
        }
        if let Some(clock) = &*self.clock() {
            *spans = ticket.spans;
            spans.entries = written;
            spans.bytes_down += (more * size_of::<FoundRecord>()) as u64;
            spans.wait = clock.span(begin, ready);
            spans.fetch = clock.span(ready, Instant::now());
            if ticket.timed {
                let count = clock::QUERIES as usize * size_of::<u64>();
                let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&times[..count]);
                spans.device = clock.device(&ticks, self.times_copies());
            }
        }
        drop(view);
        ticket.readback.unmap();
        Ok(answer)
    }

    /// Entries that were not read back with the others.
    pub(super) fn rest(
        &self,
        found: &wgpu::Buffer,
        from: usize,
        count: usize,
    ) -> std::result::Result<Vec<FoundRecord>, Failure> {
        let [from, bytes] = [from, count].map(|count| (count * size_of::<FoundRecord>()) as u64);
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readback = self.buffer("rest", bytes, usage);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(found, from, &readback, 0, bytes);
        let submission = self.queue.submit([encoder.finish()]);
        self.wait(&submission, &map(&readback, wgpu::MapMode::Read))?;
        let view = readback
            .get_mapped_range(0..bytes)
            .map_err(|error| Failure::Fault(error.to_string()))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }

    /// Waits until the device is done and a buffer's memory is there.
    pub(super) fn wait(
        &self,
        submission: &wgpu::SubmissionIndex,
        mapped: &Mapped,
    ) -> std::result::Result<(), Failure> {
        let wait =
            wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: None };
        let outcome = self.device.poll(wait);
        self.check_lost()?;
        outcome.map_err(|error| match error {
            // A device that is gone takes no submission; its own word of that may come later.
            wgpu::PollError::WrongSubmissionIndex(..) => {
                Failure::Lost("it did not take the work".to_owned())
            }
            error => Failure::Fault(format!("waiting for the graphics processor: {error}")),
        })?;
        match mapped.try_recv() {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) => Err(Failure::Lost(format!("reading back: {error}"))),
            Err(_) => Err(Failure::Fault("the answers were not ready after the wait".to_owned())),
        }
    }

    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.max(16),
            usage,
            mapped_at_creation: false,
        })
    }

    /// The slot's buffer, replaced by a larger one where `size` needs it.
    pub(super) fn grown(
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
pub(super) fn map(buffer: &wgpu::Buffer, mode: wgpu::MapMode) -> Mapped {
    let (sender, mapped) = mpsc::channel();
    buffer.map_async(mode, .., move |outcome| {
        // The receiver is gone only when the call was abandoned.
        let _ = sender.send(outcome);
    });
    mapped
}
