//! Timestamps of the tracer's and the display's passes. Nothing waits: times come home frames later.

use quell::gpu::wgpu;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Passes of a frame that are timed, at most.
const MOST: u32 = 64;
/// Results that wait, at most.
const WAITING: usize = 8;

/// Names and milliseconds of a frame's passes, in their order; those of one name are added up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times(pub Vec<(&'static str, f64)>);

impl Times {
    pub(crate) fn add(&mut self, name: &'static str, milliseconds: f64) {
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += milliseconds,
            None => self.0.push((name, milliseconds)),
        }
    }

    /// Of all passes.
    pub fn sum(&self) -> f64 {
        self.0.iter().map(|(_, ms)| ms).sum()
    }
}

#[derive(Debug)]
struct Waiting {
    buffer: wgpu::Buffer,
    is_mapped: Arc<AtomicBool>,
    names: Vec<&'static str>,
}

/// The timestamps of a frame that is being encoded, and of those that are on their way.
#[derive(Debug)]
pub(crate) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    names: Vec<&'static str>,
    waiting: VecDeque<Waiting>,
}

impl Clock {
    /// `None`: the device has no timestamps.
    pub(crate) fn new(device: &wgpu::Device) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let label = Some("quell live times");
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label,
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST,
            }),
            resolved: device.create_buffer(&wgpu::BufferDescriptor {
                label,
                size: u64::from(2 * MOST * wgpu::QUERY_SIZE),
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            names: Vec::new(),
            waiting: VecDeque::new(),
        })
    }

    /// Where the next pass writes its timestamps.
    pub(crate) fn next(&mut self, name: &'static str) -> Option<(wgpu::QuerySet, u32)> {
        let index = u32::try_from(self.names.len()).ok().filter(|i| *i < MOST)?;
        self.names.push(name);
        Some((self.queries.clone(), 2 * index))
    }

    /// Ends a frame.
    pub(crate) fn resolve(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        let names = std::mem::take(&mut self.names);
        if names.is_empty() {
            return;
        }
        let count = 2 * names.len() as u32;
        let size = u64::from(count * wgpu::QUERY_SIZE);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("quell live times"),
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
        self.waiting.push_back(Waiting { buffer, is_mapped, names });
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
        }
    }

    /// The oldest times that have come home. `period`: nanoseconds of a tick.
    pub(crate) fn take(&mut self, period: f64) -> Option<Times> {
        let at = self.waiting.iter().position(|w| w.is_mapped.load(Ordering::Acquire))?;
        self.waiting.drain(..at);
        let Waiting { buffer, names, .. } = self.waiting.pop_front()?;
        let bytes = buffer.get_mapped_range(..).ok()?;
        let (ticks, _) = bytes.as_chunks();
        let ticks: Vec<u64> = ticks.iter().map(|b| u64::from_le_bytes(*b)).collect();
        let mut times = Times::default();
        for (name, [begin, end]) in names.into_iter().zip(ticks.as_chunks().0) {
            times.add(name, end.saturating_sub(*begin) as f64 * period * 1e-6);
        }
        Some(times)
    }
}
