//! The sum over points on a graphics processor, through wgpu's compute shaders; any adapter, a software one too.
//!
//! f32 cannot hold a path of a million wavelengths, and a shading language promises no f64. So the field is cut into
//! cells of 256×256 pixels; for each cell and point the CPU computes distance and phase at the cell's centre in f64
//! ([`Point`]), and the shader only what differs from there: below 91 turns within the band, 2e-5 turns in f32. A
//! workgroup takes a tile of 32×32 pixels, where the sphere is the product of a column's and a row's factor
//! ([`super::tiles`] has the error bound); where that is not enough each pixel takes its own path from the cell's
//! centre. Phases are reduced to turns before every sine, the sine is a polynomial, the soft taper the same table as on
//! the CPU. Points near the panel stay on the CPU ([`super::near`]).
//!
//! Fields larger than a binding are computed in bands of rows; a dispatch is kept to some 20 ms, so that a stop is
//! noticed and no driver's watchdog bites; bands are read back while the next one is computed. The order of the sums
//! is fixed: the same bits on one adapter and driver.
//!
//! Recording planes have their own shaders: [`planes`].

mod device;
mod dispatch;
mod fft;
pub(crate) mod planes;
mod record;
mod strokes;

use super::Cull;
use super::definition::Optics;
use super::sources::{PointSum, PointWave};
use super::tiles::{Axis, Class, EdgeTable, Kernel, Limit, Products};
use crate::error::Result;
use crate::field::{Field, Grid};
use crate::progress::Progress;
use device::Device;
use dispatch::{CHUNK, Engine};
use pixels::wgpu;
use record::{Readback, upload};
use std::sync::OnceLock;
use std::time::Instant;

/// Side of a cell [px]; as in the shader.
pub(crate) const CELL: usize = 256;

/// Memory for the points of the cells that are prepared together [bytes].
const WAVE: u64 = 32 << 20;

/// Largest band [bytes].
const BAND: u64 = 64 << 20;

/// A point seen from a cell's centre, as the shader takes it.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Point {
    sine: [f32; 2],
    inverse: f32,
    base: f32,
    turns: f32,
    amplitude: f32,
    sign: f32,
    distance: f32,
}

/// Constants of a dispatch, as the shader takes them.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Constants {
    pitch: [f32; 2],
    scale: [f32; 2],
    offset: [f32; 2],
    edge: [f32; 2],
    tangent: [f32; 2],
    wavenumber: f32,
    lowest: f32,
    density: f32,
    levels: u32,
    limit: u32,
    width: u32,
    height: u32,
    unused: u32,
}

/// Pairs a second of a software adapter: a wide guess, since it is never chosen for its speed.
pub(crate) const SOFTWARE_RATE: f64 = 4e8;

/// Name of the adapter, or why there is none.
pub(crate) fn adapter() -> Result<&'static str> {
    device::device().map(|device| device.name.as_str())
}

/// Memory beside points and field [bytes], on the host: two waves of prepared points, a dispatch, two bands.
pub(crate) fn bytes(grid: &Grid, points: usize) -> u64 {
    let wave = WAVE.max((size_of::<Point>() * points) as u64);
    let band = BAND.min(8 * grid.len() as u64).max(8 * grid.width as u64);
    2 * wave + 2 * (CHUNK.min(points) * size_of::<Point>()) as u64 + 2 * band + (size_of::<PointWave>() * points) as u64
}

/// Predicted wall time of point–pixel pairs [s]; `None` without an adapter, or with one that is the CPU itself.
///
/// The adapter is measured once, with a sum of 4e9 pairs.
pub(crate) fn seconds(pairs: f64) -> Option<f64> {
    static RATE: OnceLock<Option<f64>> = OnceLock::new();
    let device = device::device().ok().filter(|device| !device.software)?;
    let rate = *RATE.get_or_init(|| measured_rate(device).ok());
    Some(0.02 + pairs / rate?)
}

/// Pairs a second of the product kernel, readback included.
fn measured_rate(device: &Device) -> Result<f64> {
    let grid = Grid::new(2048, 2048, 8e-6, 8e-6)?;
    let optics = Optics::new(&grid, 633e-9)?;
    let source = PointWave { x: 0.0, y: 0.0, distance: 0.3, sign: 1.0, amplitude: 1.0, turns: 0.0 };
    let sources = vec![source; 1024];
    let indexes: Vec<usize> = (0..sources.len()).collect();
    let progress = &Progress::new();
    let sum = PointSum { optics: &optics, grid: &grid, sources: &sources, cull: Cull::None, progress };
    let classes = super::tiles::classify(&sum, &indexes, Products::Shader, 1e-2);
    let mut field = Field::zeros(grid, optics.wavelength);
    let mut seconds = f64::INFINITY;
    // The first run compiles and raises clocks.
    for _ in 0..2 {
        let start = Instant::now();
        add_with(device, &mut field, &sum, &classes)?;
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    Ok(grid.len() as f64 * sources.len() as f64 / seconds)
}

/// Adds classes of far sources to the field.
///
/// # Errors
/// [`Error::Unsupported`](crate::Error::Unsupported) without an adapter, or with the driver's words when it fails.
pub(crate) fn add(field: &mut Field, sum: &PointSum, classes: &[Class]) -> Result<()> {
    add_with(device::device()?, field, sum, classes)
}

fn add_with(device: &Device, field: &mut Field, sum: &PointSum, classes: &[Class]) -> Result<()> {
    let PointSum { optics, grid, progress, .. } = *sum;
    let limits = device.device.limits();
    let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(BAND);
    let rows = ((binding / (8 * grid.width as u64)) as usize).clamp(1, grid.height);
    let sets: Vec<ClassOnDevice> = classes.iter().map(|class| ClassOnDevice::new(device, sum, class)).collect();
    progress.check()?;
    let mut engine = Engine::new(device, grid.width * rows);
    let mut behind: Option<(usize, Readback)> = None;
    let mut add = |(first, read): (usize, Readback)| {
        let rest = &mut field.samples[first * grid.width..];
        read.add_to(device, rest)
    };
    for first in (0..grid.height).step_by(rows) {
        let band = Band { grid, first, rows: rows.min(grid.height - first), wavenumber: 1.0 / optics.wavelength };
        for set in &sets {
            engine.sum(&band, set, progress)?;
        }
        let now = engine.read_back(&band);
        if let Some(previous) = behind.replace((first, now)) {
            add(previous)?;
        }
    }
    behind.map_or(Ok(()), add)
}

/// Rows of the field that are computed together.
struct Band<'a> {
    grid: &'a Grid,
    first: usize,
    rows: usize,
    wavenumber: f64,
}

impl Band<'_> {
    /// Column and row, from the band's first, of the cells.
    fn cells(&self) -> Vec<[usize; 2]> {
        let columns = (0..self.grid.width).step_by(CELL);
        (0..self.rows).step_by(CELL).flat_map(|row| columns.clone().map(move |column| [column, row])).collect()
    }

    /// The members that light a cell.
    fn points(&self, set: &ClassOnDevice, [column, row]: [usize; 2]) -> Vec<Point> {
        let [x, y] = self.grid.middle([column, self.first + row], [CELL; 2]);
        let half = self.grid.pitch().map(|pitch| 0.5 * CELL as f64 * pitch);
        let mut points = Vec::new();
        for s in &set.members {
            let (dx, dy) = (x - s.x, y - s.y);
            let lit = |d: f64, axis: usize| d.abs() - half[axis] <= set.tangent[axis] * s.distance;
            if !(lit(dx, 0) && lit(dy, 1)) {
                continue;
            }
            // A tenth of a wavelength keeps directions finite at a cell's centre that the point sits on.
            let r = (dx * dx + dy * dy + s.distance * s.distance).sqrt().max(0.1 / self.wavenumber);
            let turns = s.sign * r * self.wavenumber;
            let phase = turns + s.turns;
            points.push(Point {
                sine: [(dx / r) as f32, (dy / r) as f32],
                inverse: (1.0 / r) as f32,
                base: (phase - phase.round()) as f32,
                turns: turns as f32,
                amplitude: (s.amplitude / r) as f32,
                sign: s.sign as f32,
                distance: s.distance as f32,
            });
        }
        points
    }
}

/// A class of points with what the shader needs for it.
struct ClassOnDevice {
    members: Vec<PointWave>,
    /// Half width of the cone per metre of distance.
    tangent: [f64; 2],
    /// Index of the pipeline.
    pipeline: usize,
    edges: wgpu::Buffer,
    /// Constants, but for the band's size.
    constants: Constants,
}

impl ClassOnDevice {
    fn new(device: &Device, sum: &PointSum, class: &Class) -> Self {
        let (optics, cull) = (sum.optics, sum.cull);
        let table = class.edges(sum);
        let limit = Limit::new(cull, &table);
        let axes = [0, 1].map(|axis| Axis::new(optics, axis, limit));
        let constants = Constants {
            pitch: axes.map(|axis| axis.pitch as f32),
            scale: axes.map(|axis| axis.scale as f32),
            offset: axes.map(|axis| axis.offset as f32),
            edge: axes.map(|axis| axis.edge as f32),
            tangent: axes.map(|axis| axis.tangent as f32),
            wavenumber: (1.0 / optics.wavelength) as f32,
            lowest: table.lowest as f32,
            density: (1.0 / EdgeTable::STEP) as f32,
            levels: table.count.max(1) as u32,
            limit: match cull {
                Cull::None => 0,
                Cull::Hard => 1,
                Cull::Soft => 2,
            },
            width: 0,
            height: 0,
            unused: 0,
        };
        // A binding must not be empty.
        let values: &[f32] = if table.values.is_empty() { &[0.0; 4] } else { &table.values };
        let edges = upload(device, "edges", bytemuck::cast_slice(values));
        Self {
            members: class.members(sum.sources),
            tangent: class.tangent(optics, limit),
            pipeline: usize::from(class.shape.kernel == Kernel::Paths),
            edges,
            constants,
        }
    }
}

#[cfg(test)]
mod tests {
    /// The adapter, or `None` where the machine has none and none is required; says so.
    pub(super) fn device() -> Option<&'static super::Device> {
        match super::device::device() {
            Ok(device) => Some(device),
            Err(why) => {
                assert!(std::env::var_os("HOLODRIVE_REQUIRE_DISPLAY").is_none_or(|v| v != "1"), "{why}");
                println!("not run: {why}");
                None
            }
        }
    }
}
