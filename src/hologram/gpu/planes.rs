//! Recording planes on a graphics processor: the algorithm of [`crate::hologram::planes`], its sums in shaders.
//!
//! The CPU chooses planes, rank and tables as for its own engine, computes each point's factor in f64, and sorts the
//! points into lists of the tiles of 64×64 pixels that their kernels touch. A workgroup adds its tile's list: kernels
//! are evaluated from the tables into workgroup memory, eight points at a time, and each thread adds their products to
//! sixteen pixels. Transforms are Stockham's ([`super::fft`]). Phases of columns and rows of the spectrum are reduced
//! to turns in f64; the shader has only their residual. Every sum has a fixed order, and none is atomic: the same bits
//! on one adapter and driver.
//!
//! All moments of a plane, a spare, and the spectrum stay on the device, and each is one binding: a job whose planes
//! pass the adapter's largest is refused ([`cost`]).

use super::device::{Device, device, pipelines};
use super::fft::{Direction, Roots, Transform};
use super::record::{Readback, Recorder, group, storage, uniform, upload};
use super::strokes::{ENTRIES, Lists, STROKES, Stroke, chunks, span, tiles};
use crate::error::{Error, Result};
use crate::field::{Field, Grid};
use crate::hologram::definition::Optics;
use crate::hologram::dispersion::{Dispersion, reduced};
use crate::hologram::planes::{Cloud, Parameters, PlaneGrid, Slabs, Splat, Table, carrier, layout, mean_square, splat};
use crate::hologram::sources::PointWave;
use crate::progress::Progress;
use pixels::wgpu;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Threads of a workgroup that takes a line of pixels; as in the shader.
const THREADS: usize = 64;

/// Workgroups along an axis that every adapter takes.
const GROUPS: usize = 65_535;

/// Entries of the lists that one dispatch takes on hardware, and on a software adapter that must notice a stop.
const WORK: [usize; 2] = [1 << 20, 1 << 12];

/// Predicted cost of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cost {
    /// Wall time [s]; a guess.
    pub(crate) seconds: f64,
    /// Memory beside points and field, on the device and on the host together [bytes].
    pub(crate) bytes: u64,
}

/// The planes, and the grid of transforms whose lengths have the factors 2, 3 and 5 only.
fn arrangement(cloud: &Cloud, parameters: &Parameters) -> (Slabs, PlaneGrid) {
    let slabs = parameters.slabs(cloud);
    let layout = layout(cloud, parameters, &slabs, &[1]);
    (slabs, layout)
}

/// What the job takes.
///
/// The time is a guess, from the measured rate of the exact sum where the adapter is hardware ([`super::seconds`]).
///
/// # Errors
/// [`Error::Unsupported`] without an adapter, or where a plane or a table passes its largest binding.
pub(crate) fn cost(cloud: &Cloud, parameters: &Parameters) -> Result<Cost> {
    let device = device()?;
    let (optics, grid) = (cloud.optics, cloud.grid);
    if cloud.sources.is_empty() {
        return Ok(Cost { seconds: 0.0, bytes: 0 });
    }
    let (slabs, layout) = arrangement(cloud, parameters);
    let [width, height] = layout.size;
    let samples = (width * height) as u64;
    let tables: Vec<u64> = parameters.table_bytes(optics, slabs.half).iter().map(|bytes| bytes + 64).collect();
    let largest = tables.iter().copied().fold(8 * samples, u64::max).max(4 * ENTRIES as u64);
    let limits = device.device.limits();
    let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if largest > binding || width.max(height) > GROUPS {
        let (needed, name) = (largest.div_ceil(1 << 20), &device.name);
        return Err(Error::unsupported(format!(
            "planes of {width} × {height} samples need {needed} MB in one binding of {name}, which takes {} MB and {GROUPS} lines; take planes or tiles",
            binding >> 20
        )));
    }
    let count = cloud.sources.len();
    let chunk = count.min(STROKES);
    let own = size_of::<PointWave>() + size_of::<Splat>() + size_of::<[[u32; 2]; 2]>();
    // Strokes and lists stand on the host, wait there to be copied, and on the device; tables on both sides.
    let host = count * own + 2 * (chunk * size_of::<Stroke>() + 4 * ENTRIES) + 8 * grid.len();
    let on_device = (parameters.rank as u64 + 2) * 8 * samples + (STROKES * size_of::<Stroke>() + 4 * ENTRIES) as u64;
    let bytes = on_device + host as u64 + 2 * tables.iter().sum::<u64>();
    let area: f64 = [0, 1]
        .map(|axis| 2.0 * Table::half_width(optics, axis, slabs.half, parameters.tail) as f64 + 64.0)
        .iter()
        .product();
    let pairs = (parameters.rank * count) as f64 * area;
    let passes = (slabs.depths.len() * parameters.rank + 1) as f64 * 12.0;
    // A tenth of a nanosecond for a sample of a pass on hardware, tens on the CPU; tables are built on the CPU.
    let (paint, sample) = match super::seconds(pairs) {
        Some(seconds) => (seconds, 1e-10),
        None => (pairs / super::SOFTWARE_RATE, 2e-8),
    };
    let seconds = paint + passes * samples as f64 * sample + 2e-9 * tables.iter().sum::<u64>() as f64;
    Ok(Cost { seconds, bytes })
}

/// Pipelines of painting, of a plane's addition to the spectrum, and of the window.
fn shaders(device: &Device) -> &'static [wgpu::ComputePipeline; 3] {
    static PIPELINES: OnceLock<[wgpu::ComputePipeline; 3]> = OnceLock::new();
    PIPELINES.get_or_init(|| {
        pipelines(&device.device, wgpu::include_wgsl!("planes.wgsl"), ["paint_tile", "add_plane", "cut_window"])
    })
}

/// Constants of painting, as the shader takes them.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Paint {
    width: u32,
    height: u32,
    count: u32,
    across: u32,
    row: [u32; 2],
    middle: [i32; 2],
    lines: [u32; 2],
    moment: u32,
    unused: u32,
}

/// Constants of a plane's addition to the spectrum.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Carry {
    width: u32,
    height: u32,
    moment: u32,
    rank: u32,
    ratio: f32,
    kappa: f32,
    slope: f32,
    limit: [f32; 2],
    unused: [u32; 3],
}

/// Constants of the window.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Window {
    size: [u32; 2],
    panel: [u32; 2],
    first: [u32; 2],
    scale: f32,
    unused: u32,
}

/// Buffers and bindings of one moment.
struct Moment {
    plane: wgpu::Buffer,
    paint: wgpu::Buffer,
    painting: wgpu::BindGroup,
    transform: Transform,
    carry: wgpu::Buffer,
    carrying: wgpu::BindGroup,
}

/// Everything on the device.
struct Engine<'a> {
    optics: &'a Optics,
    layout: PlaneGrid,
    /// a and b, λ²f², by column and row of the transforms.
    dispersion: Dispersion,
    paint: Paint,
    carry: Carry,
    strokes: wgpu::Buffer,
    entries: wgpu::Buffer,
    tiles: wgpu::Buffer,
    columns: wgpu::Buffer,
    rows: wgpu::Buffer,
    roots: Roots,
    spare: wgpu::Buffer,
    sum: wgpu::Buffer,
    moments: Vec<Moment>,
}

impl<'a> Engine<'a> {
    /// `half` is the slabs' half depth [m].
    fn new(device: &Device, cloud: &'a Cloud, layout: PlaneGrid, tables: [&Table; 2], half: f64, rank: usize) -> Self {
        let [width, height] = layout.size;
        let optics = cloud.optics;
        let lambda = optics.wavelength;
        let lines = tables.map(Table::lines);
        let paint = Paint {
            width: width as u32,
            height: layout.painted as u32,
            count: 0,
            across: 1,
            row: lines.map(|(_, row, _, _)| row as u32),
            middle: lines.map(|(_, _, middle, _)| middle as i32),
            lines: lines.map(|(_, _, _, lines)| lines as u32),
            moment: 0,
            unused: 0,
        };
        let carry = Carry {
            width: width as u32,
            height: height as u32,
            moment: 0,
            rank: rank as u32,
            ratio: 0.0,
            kappa: (TAU * half / lambda) as f32,
            slope: (0.25 * lambda * lambda * mean_square(optics, 0)) as f32,
            limit: optics.taper.map(|taper| (lambda * taper.reach(5.0)).powi(2) as f32),
            unused: [0; 3],
        };
        let plane = |label| storage(device, label, 8 * (width * height) as u64);
        let first = upload(device, "table", bytemuck::cast_slice(lines[0].0));
        let is_one = std::ptr::eq(tables[0], tables[1]);
        let second = (!is_one).then(|| upload(device, "table", bytemuck::cast_slice(lines[1].0)));
        let [across, down] = tiles(&layout);
        let strokes = storage(device, "strokes", (cloud.sources.len().min(STROKES) * size_of::<Stroke>()) as u64);
        let entries = storage(device, "lists", 4 * ENTRIES as u64);
        let tiles = storage(device, "tiles", (across * down * size_of::<[u32; 4]>()) as u64);
        let (columns, rows) =
            (storage(device, "columns", 16 * width as u64), storage(device, "rows", 16 * height as u64));
        let roots = Roots::new(device, layout.size);
        let (spare, sum) = (plane("spare"), plane("spectrum"));
        let [painter, carrier, _] = shaders(device);
        let moments = (0..rank as u32)
            .map(|moment| {
                let own = plane("moment");
                let paint = uniform(device, "paint", bytemuck::bytes_of(&Paint { moment, ..paint }));
                let second = second.as_ref().unwrap_or(&first);
                let bound = [&paint, &strokes, &entries, &tiles, &first, second, &own];
                let painting = group(device, painter, &bound);
                let transform =
                    Transform::new(device, &roots, layout.painted, Direction::Forward, [&own, &spare], None);
                let carry = uniform(device, "carry", bytemuck::bytes_of(&Carry { moment, ..carry }));
                let transformed = [&own, &spare][transform.result];
                let carrying = group(device, carrier, &[&carry, &columns, &rows, transformed, &sum]);
                Moment { plane: own, paint, painting, transform, carry, carrying }
            })
            .collect();
        let dispersion = Dispersion::new(&layout.grid(optics), lambda);
        Self {
            optics,
            layout,
            dispersion,
            paint,
            carry,
            strokes,
            entries,
            tiles,
            columns,
            rows,
            roots,
            spare,
            sum,
            moments,
        }
    }

    /// Adds the strokes of one chunk to the moments.
    fn paint(&self, recorder: &mut Recorder, strokes: &[Stroke], lists: &Lists) -> Result<()> {
        let queue = &recorder.device.queue;
        queue.write_buffer(&self.strokes, 0, bytemuck::cast_slice(strokes));
        queue.write_buffer(&self.entries, 0, bytemuck::cast_slice(&lists.entries));
        let pipeline = &shaders(recorder.device)[0];
        for tiles in &lists.dispatches {
            queue.write_buffer(&self.tiles, 0, bytemuck::cast_slice(tiles));
            let across = tiles.len().min(GROUPS);
            let groups = [across as u32, tiles.len().div_ceil(across) as u32];
            for (moment, own) in (0..).zip(&self.moments) {
                let paint = Paint { count: tiles.len() as u32, across: across as u32, moment, ..self.paint };
                queue.write_buffer(&own.paint, 0, bytemuck::bytes_of(&paint));
                recorder.dispatch(pipeline, &own.painting, groups)?;
            }
            // What is written to the buffers next must come after these dispatches.
            recorder.submit()?;
        }
        Ok(())
    }

    /// Transforms the moments of the plane at the signed distance ζ before the panel [m] and adds them to the spectrum.
    fn add(&self, recorder: &mut Recorder, distance: f64) -> Result<Option<wgpu::SubmissionIndex>> {
        let lambda = self.optics.wavelength;
        let ratio = distance / lambda;
        let [mx, my] = [0, 1].map(|axis| lambda * lambda * mean_square(self.optics, axis));
        let column = |&a: &f64| {
            let root = (1.0 - a).max(0.0).sqrt();
            [a as f32, root as f32, reduced(ratio * root), (0.25 * my * (a - mx)) as f32]
        };
        let row = |&b: &f64| {
            let root = (1.0 - b).max(0.0).sqrt();
            [b as f32, root as f32, reduced(-ratio * b.min(1.0) / (1.0 + root)), 0.0]
        };
        let columns: Vec<[f32; 4]> = self.dispersion.columns.iter().map(column).collect();
        let rows: Vec<[f32; 4]> = self.dispersion.rows.iter().map(row).collect();
        let queue = &recorder.device.queue;
        queue.write_buffer(&self.columns, 0, bytemuck::cast_slice(&columns));
        queue.write_buffer(&self.rows, 0, bytemuck::cast_slice(&rows));
        let [width, height] = self.layout.size;
        for (moment, own) in (0..).zip(&self.moments) {
            let carry = Carry { moment, ratio: ratio as f32, ..self.carry };
            queue.write_buffer(&own.carry, 0, bytemuck::bytes_of(&carry));
            if own.transform.rows_end_in_second {
                recorder.clear(&self.spare, 8 * (width * self.layout.painted) as u64);
            }
            own.transform.run(recorder)?;
            let groups = [width.div_ceil(THREADS) as u32, height as u32];
            recorder.dispatch(&shaders(recorder.device)[1], &own.carrying, groups)?;
        }
        recorder.submit()
    }

    /// Transforms back: the field in the panel's window.
    fn finish(self, recorder: &mut Recorder, grid: &Grid) -> Result<Field> {
        let [width, height] = self.layout.size;
        let device = recorder.device;
        let planes = [&self.moments[0].plane, &self.spare];
        let back = Transform::new(device, &self.roots, height, Direction::Inverse, planes, Some(&self.sum));
        back.run(recorder)?;
        let first = |axis: usize| (-self.layout.origin[axis]).rem_euclid(self.layout.size[axis] as i64) as u32;
        let window = Window {
            size: [width as u32, height as u32],
            panel: [grid.width as u32, grid.height as u32],
            first: [first(0), first(1)],
            scale: 1.0 / (width as f32 * height as f32),
            unused: 0,
        };
        let window = uniform(device, "window", bytemuck::bytes_of(&window));
        let pipeline = &shaders(device)[2];
        // The spectrum was read by the first pass: its memory takes the panel's part.
        let bound = group(device, pipeline, &[&window, planes[back.result], &self.sum]);
        recorder.dispatch(pipeline, &bound, [grid.width.div_ceil(THREADS) as u32, grid.height as u32])?;
        recorder.submit()?;
        let mut field = Field::zeros(*grid, self.optics.wavelength);
        Readback::new(device, &self.sum, grid.len(), false).add_to(device, &mut field.samples)?;
        Ok(field)
    }
}

/// The cloud's field on the panel, by recording planes on the graphics processor.
///
/// # Errors
/// Those of [`cost`]; [`Error::Unsupported`] with the driver's words when it fails; [`Error::Interrupted`].
pub(crate) fn field(cloud: &Cloud, parameters: &Parameters, progress: &Progress) -> Result<Field> {
    let device = device()?;
    let Cloud { optics, grid, sources, .. } = cloud;
    if sources.is_empty() {
        return Ok(Field::zeros(**grid, optics.wavelength));
    }
    // A plan may come from another cloud, whose planes were smaller.
    cost(cloud, parameters)?;
    let (slabs, layout) = arrangement(cloud, parameters);
    let h = slabs.half;
    let plane_work = layout.size[0] as u64;
    progress.start("hologram: planes", sources.len() as u64 + plane_work * slabs.depths.len() as u64);
    let tables = parameters.tables(optics, h, progress);
    let tables = tables.each_ref().map(|table| &**table);
    progress.check()?;
    let carrier = carrier(optics, tables);
    let slope = [0, 1].map(|axis| optics.cone(axis, 1.0) / optics.pitch[axis]);
    let tiles = tiles(&layout);
    let engine = Engine::new(device, cloud, layout, tables, h, parameters.rank);
    device.check()?;
    let mut recorder = Recorder::new(device, progress);
    let mut before = None;
    for k in 0..slabs.depths.len() {
        let middle = slabs.plane(k);
        let is_here = |s: &&PointWave| slabs.index(s.sign * s.distance) == k;
        let to_splat = |s: &PointWave| splat(cloud, &layout, carrier, s, middle);
        let splats: Vec<Splat> = sources.par_iter().filter(is_here).map(to_splat).collect();
        let spans: Vec<_> = splats.par_iter().map(|splat| span(splat, slope, parameters.tail, tiles)).collect();
        // What is written waits in memory until the device has done what came before it.
        if let Some(submission) = before.take() {
            device.wait(Some(submission))?;
        }
        engine.moments.iter().for_each(|moment| recorder.clear(&moment.plane, 0));
        for (part, chunk) in chunks(&spans).into_iter().enumerate() {
            if part > 0 {
                device.wait(None)?;
            }
            let strokes: Vec<Stroke> =
                splats[chunk.clone()].par_iter().map(|splat| Stroke::new(splat, tables, h)).collect();
            let lists = Lists::new(&spans[chunk], tiles, WORK[usize::from(device.software)]);
            engine.paint(&mut recorder, &strokes, &lists)?;
            progress.advance(strokes.len() as u64);
        }
        before = engine.add(&mut recorder, middle)?;
        progress.advance(plane_work);
    }
    engine.finish(&mut recorder, grid)
}
