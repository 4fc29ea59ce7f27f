//! Timestamps of the tracer's and the display's passes. Nothing waits: times come home frames later.

use quell::gpu::wgpu;
use quell::pipeline::Stage;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Passes of a frame that are timed, at most.
const MOST: u32 = 64;
/// Results that wait, at most.
const WAITING: usize = 8;

/// What a pass of a frame took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// Its name.
    pub name: &'static str,
    /// Stages of the denoiser that it runs; none of the tracer's, the baselines' and the display's passes.
    pub stages: &'static [Stage],
    /// Of all passes of this name together.
    pub milliseconds: f64,
}

impl PassTime {
    /// Milliseconds of these stages at 1280x720 in the talk's table, on its GPU of 2017; `None` where it has none.
    pub fn paper_milliseconds(&self) -> Option<f64> {
        let known = self.stages.iter().filter_map(|stage| stage.paper_milliseconds());
        known.map(f64::from).reduce(|a, b| a + b)
    }
}

/// Times of a frame's passes, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times(pub Vec<PassTime>);

impl Times {
    pub(crate) fn add(&mut self, name: &'static str, stages: &'static [Stage], milliseconds: f64) {
        match self.0.iter_mut().find(|known| known.name == name) {
            Some(known) => known.milliseconds += milliseconds,
            None => self.0.push(PassTime { name, stages, milliseconds }),
        }
    }

    /// Milliseconds of all passes.
    pub fn sum(&self) -> f64 {
        self.0.iter().map(|pass| pass.milliseconds).sum()
    }

    /// Milliseconds of the passes that the talk's table has, here and there: stages 3 to 10. `None`: none of them ran.
    pub fn beside_paper(&self) -> Option<[f64; 2]> {
        let both = self.0.iter().filter_map(|pass| Some([pass.milliseconds, pass.paper_milliseconds()?]));
        both.reduce(|[a, b], [c, d]| [a + c, b + d])
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
            times.add(name, &[], end.saturating_sub(*begin) as f64 * period * 1e-6);
        }
        Some(times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_stand_beside_the_table_of_the_talk() {
        let mut times = Times::default();
        times.add("trace primary", &[], 3.0);
        assert_eq!(times.beside_paper(), None);
        times.add("matte blend", &[Stage::Disocclusion, Stage::Firefly], 0.5);
        times.add("matte blend", &[Stage::Disocclusion, Stage::Firefly], 0.25);
        times.add("composite", &[Stage::DirectTaa, Stage::Composite], 1.0);
        assert_eq!(times.0.len(), 3);
        assert_eq!(times.sum(), 4.75);
        let [here, there] = times.beside_paper().unwrap();
        assert!(here == 0.75 && (there - 1.31).abs() < 1e-6, "{here} {there}");
        assert_eq!(times.0[2].paper_milliseconds(), None);
        // All of them: the talk's sum.
        let mut times = Times::default();
        times.add("all", &Stage::ALL, 1.0);
        assert!((times.beside_paper().unwrap()[1] - 9.17).abs() < 1e-6);
    }
}
