//! Dispatches of the GPU engine: prepared cells in, a band of the field out.

use super::device::Device;
use super::record::{Readback, Recorder, group, storage, uniform};
use super::{Band, CELL, ClassOnDevice, Constants, Point, WAVE};
use crate::error::Result;
use crate::progress::Progress;
use pixels::wgpu;
use rayon::prelude::*;
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
    constants: wgpu::Buffer,
    points: wgpu::Buffer,
    cells: wgpu::Buffer,
    band: wgpu::Buffer,
    /// Pairs of a dispatch.
    pairs: f64,
}

impl<'a> Engine<'a> {
    pub(super) fn new(device: &'a Device, pixels: usize) -> Self {
        Self {
            device,
            constants: uniform(device, "constants", &[0; size_of::<Constants>()]),
            points: storage(device, "points", (CHUNK * size_of::<Point>()) as u64),
            cells: storage(device, "cells", CELLS as u64 * 16),
            band: storage(device, "band", 8 * pixels as u64),
            pairs: 4e6,
        }
    }

    /// Adds a set to the band: cells are prepared on the CPU while those before are summed.
    pub(super) fn sum(&mut self, band: &Band, set: &ClassOnDevice, progress: &Progress) -> Result<()> {
        let constants = Constants { width: band.grid.width as u32, height: band.rows as u32, ..set.constants };
        self.device.queue.write_buffer(&self.constants, 0, bytemuck::bytes_of(&constants));
        let pipeline = &self.device.pipelines[set.pipeline];
        let bound = [&self.constants, &self.points, &self.cells, &set.edges, &self.band];
        let group = group(self.device, pipeline, &bound);
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
        let start = Instant::now();
        let queue = &self.device.queue;
        queue.write_buffer(&self.points, 0, bytemuck::cast_slice(points));
        queue.write_buffer(&self.cells, 0, bytemuck::cast_slice(cells));
        let mut recorder = Recorder::new(self.device, progress);
        recorder.dispatch(pipeline, group, [TILES, cells.len() as u32])?;
        let submission = recorder.submit()?;
        self.device.wait(submission)?;
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
        Readback::new(self.device, &self.band, band.grid.width * band.rows, true)
    }
}
