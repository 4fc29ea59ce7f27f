//! How long each dispatch took on the GPU, where the device has the feature `TIMESTAMP_QUERY`. The host submits and polls;
//! nothing here waits.

use super::pass::Pass;
use crate::pipeline::Stage;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Dispatches of a frame of the real-time filter that are timed at the most, and of a submission of the sequence filter.
pub(super) const MOST: u32 = 32;
pub(super) const MOST_OF_SEQUENCE: u32 = 512;
/// Results that wait for the host at the most; beyond it the oldest is dropped.
const WAITING: usize = 8;

/// What a dispatch took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// The pass.
    pub pass: &'static str,
    /// The stages that it ran.
    pub stages: &'static [Stage],
    /// Milliseconds from its begin to its end on the GPU.
    pub milliseconds: f64,
}

type Timed = (&'static str, &'static [Stage]);

/// Results that are not there yet: written by the encoder, mapped when that is submitted, filled when the host has polled.
#[derive(Debug)]
struct Waiting {
    buffer: wgpu::Buffer,
    is_mapped: Arc<AtomicBool>,
    timed: Vec<Timed>,
}

/// Timestamps of the last frame that was encoded.
#[derive(Debug)]
pub(super) struct Timings {
    label: String,
    most: u32,
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    timed: Vec<Timed>,
    waiting: VecDeque<Waiting>,
}

impl Timings {
    /// `None`: the device has no timestamps.
    pub(super) fn new(device: &wgpu::Device, label: &str, most: u32) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let label = format!("{label} timings");
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some(&label),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * most,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(&label),
            size: u64::from(2 * most * wgpu::QUERY_SIZE),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { label, most, queries, resolved, timed: Vec::new(), waiting: VecDeque::new() })
    }

    /// A frame begins.
    pub(super) fn clear(&mut self) {
        self.timed.clear();
    }

    /// Where the next dispatch writes its begin and end.
    pub(super) fn next(&mut self, pass: &Pass) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let index = u32::try_from(self.timed.len()).ok().filter(|i| *i < self.most)?;
        self.timed.push((pass.name, pass.stages));
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * index),
            end_of_pass_write_index: Some(2 * index + 1),
        })
    }

    pub(super) fn resolve(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.timed.len() as u32;
        if count == 0 {
            return;
        }
        let size = u64::from(count * wgpu::QUERY_SIZE);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(&self.label),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &buffer, 0, size);
        let is_mapped = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_mapped);
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, .., move |result| {
            flag.store(result.is_ok(), Ordering::Release);
        });
        self.waiting.push_back(Waiting { buffer, is_mapped, timed: std::mem::take(&mut self.timed) });
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
        }
    }

    /// `period`: nanoseconds of a tick.
    pub(super) fn take(&mut self, period: f64) -> Option<Vec<Timing>> {
        let at = self.waiting.iter().position(|w| w.is_mapped.load(Ordering::Acquire))?;
        // What was never submitted before it never will be.
        self.waiting.drain(..at);
        let Waiting { buffer, timed, .. } = self.waiting.pop_front()?;
        let bytes = buffer.get_mapped_range(..).ok()?;
        let (ticks, _) = bytes.as_chunks();
        let ticks: Vec<u64> = ticks.iter().map(|b| u64::from_le_bytes(*b)).collect();
        let took = timed.into_iter().zip(ticks.as_chunks().0).map(|((pass, stages), [begin, end])| Timing {
            pass,
            stages,
            milliseconds: end.saturating_sub(*begin) as f64 * period * 1e-6,
        });
        Some(took.collect())
    }
}
