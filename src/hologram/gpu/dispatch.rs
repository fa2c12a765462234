//! Dispatches of the GPU engine: prepared cells in, a band of the field out.

use super::device::Device;
use super::{Band, CELL, Job, Point, Set, WAVE};
use crate::error::Result;
use crate::field::{Complex32, Field};
use crate::progress::Progress;
use pixels::wgpu;
use rayon::prelude::*;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Points of one dispatch.
pub(super) const CHUNK: usize = 1 << 19;

/// Wanted time of a dispatch.
const DISPATCH: Duration = Duration::from_millis(20);

/// Tiles of a cell; as in the shader.
const TILES: u32 = 64;

/// Cells of one dispatch: what every adapter takes as workgroups along an axis.
const CELLS: usize = 65_535;

/// Buffers of one computation, and how much a dispatch may take.
pub(super) struct Engine<'a> {
    device: &'a Device,
    job: wgpu::Buffer,
    points: wgpu::Buffer,
    cells: wgpu::Buffer,
    band: wgpu::Buffer,
    /// Pairs of a dispatch.
    pairs: f64,
}

impl<'a> Engine<'a> {
    pub(super) fn new(device: &'a Device, pixels: usize) -> Self {
        let buffer = |label: &str, size: usize, usage: wgpu::BufferUsages| {
            let descriptor = wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            };
            device.device.create_buffer(&descriptor)
        };
        let storage = wgpu::BufferUsages::STORAGE;
        Self {
            device,
            job: buffer("job", size_of::<Job>(), wgpu::BufferUsages::UNIFORM),
            points: buffer("points", CHUNK * size_of::<Point>(), storage),
            cells: buffer("cells", CELLS * 16, storage),
            band: buffer("band", 8 * pixels, storage | wgpu::BufferUsages::COPY_SRC),
            pairs: 4e6,
        }
    }

    /// Adds a set to the band: cells are prepared on the CPU while those before are summed.
    pub(super) fn sum(&mut self, band: &Band, set: &Set, progress: &Progress) -> Result<()> {
        let job = Job { width: band.grid.width as u32, height: band.rows as u32, ..set.job };
        self.device.queue.write_buffer(&self.job, 0, bytemuck::bytes_of(&job));
        let pipeline = &self.device.pipelines[set.pipeline];
        let bound = [&self.job, &self.points, &self.cells, &set.edges, &self.band];
        let entries: Vec<wgpu::BindGroupEntry> = (0..)
            .zip(bound)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let size = size_of::<Point>() * set.members.len().max(1);
        let together = (WAVE as usize / size).max(1);
        let cells = band.cells();
        let waves: Vec<&[[usize; 2]]> = cells.chunks(together).collect();
        let prepare = |wave: &[[usize; 2]]| -> Vec<([usize; 2], Vec<Point>)> {
            wave.par_iter().filter(|_| !progress.stopped()).map(|&cell| (cell, band.points(set, cell))).collect()
        };
        let mut ready = waves.first().map(|wave| prepare(wave)).unwrap_or_default();
        for i in 0..waves.len() {
            let now = std::mem::take(&mut ready);
            let next = waves.get(i + 1).copied().unwrap_or_default();
            let (later, done) = rayon::join(|| prepare(next), || self.dispatch(pipeline, &group, &now, band, progress));
            done?;
            ready = later;
        }
        Ok(())
    }

    /// Sums prepared cells, as many points at once as keep the wanted time.
    fn dispatch(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        prepared: &[([usize; 2], Vec<Point>)],
        band: &Band,
        progress: &Progress,
    ) -> Result<()> {
        let pixels =
            |[column, row]: [usize; 2]| (CELL.min(band.grid.width - column) * CELL.min(band.rows - row)) as f64;
        let (mut points, mut cells, mut pairs) = (Vec::new(), Vec::new(), 0.0);
        for (at, all) in prepared {
            let mut rest = &all[..];
            while !rest.is_empty() {
                let fits = ((self.pairs - pairs) / pixels(*at)).max(16.0) as usize;
                let (now, later) = rest.split_at(fits.min(CHUNK - points.len()).min(rest.len()));
                cells.push([at[0] as u32, at[1] as u32, points.len() as u32, now.len() as u32]);
                points.extend_from_slice(now);
                pairs += pixels(*at) * now.len() as f64;
                rest = later;
                // A cell stands in a dispatch once: two groups that add to the same pixels would lose one another's sums.
                let split = !rest.is_empty();
                if split || pairs >= self.pairs || points.len() == CHUNK || cells.len() == CELLS {
                    self.submit(pipeline, group, &points, &cells, progress)?;
                    points.clear();
                    cells.clear();
                    pairs = 0.0;
                }
            }
            progress.advance(all.len() as u64);
        }
        if cells.is_empty() { Ok(()) } else { self.submit(pipeline, group, &points, &cells, progress) }
    }

    fn submit(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        points: &[Point],
        cells: &[[u32; 4]],
        progress: &Progress,
    ) -> Result<()> {
        progress.check()?;
        let start = Instant::now();
        let queue = &self.device.queue;
        queue.write_buffer(&self.points, 0, bytemuck::cast_slice(points));
        queue.write_buffer(&self.cells, 0, bytemuck::cast_slice(cells));
        let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(TILES, cells.len() as u32, 1);
        }
        let submission = queue.submit([encoder.finish()]);
        self.device.wait(Some(submission))?;
        let spent = start.elapsed();
        if spent < DISPATCH / 2 {
            self.pairs *= 2.0;
        } else if spent > 2 * DISPATCH {
            self.pairs = (0.5 * self.pairs).max(1e5);
        }
        Ok(())
    }

    /// Begins to fetch the band, and leaves it dark for the next.
    pub(super) fn read_back(&self, band: &Band) -> Readback {
        let size = 8 * (band.grid.width * band.rows) as u64;
        let staging = self.device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.band, 0, &staging, 0, size);
        encoder.clear_buffer(&self.band, 0, None);
        self.device.queue.submit([encoder.finish()]);
        let (sender, mapped) = channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver is gone where the computation was given up.
            let _ = sender.send(result.map_err(|e| e.to_string()));
        });
        Readback { first: band.first, staging, mapped }
    }
}

/// A band on its way to the host.
pub(super) struct Readback {
    first: usize,
    staging: wgpu::Buffer,
    mapped: Receiver<std::result::Result<(), String>>,
}

impl Readback {
    pub(super) fn add_to(self, device: &Device, field: &mut Field) -> Result<()> {
        let mapped = loop {
            match self.mapped.try_recv() {
                Ok(mapped) => break mapped,
                Err(_) => device.wait(None)?,
            }
        };
        mapped.map_err(|what| device.failed(what))?;
        let bytes = self.staging.slice(..).get_mapped_range();
        let samples: &[Complex32] = bytemuck::cast_slice(&bytes);
        let from = self.first * field.grid.width;
        let to = &mut field.samples[from..from + samples.len()];
        to.par_chunks_mut(1 << 16).zip(samples.par_chunks(1 << 16)).for_each(|(to, from)| {
            to.iter_mut().zip(from).for_each(|(u, add)| *u += add);
        });
        Ok(())
    }
}
