//! Pictures with depth and focal stacks, plane by plane: fast transforms instead of points, with occlusion.
//!
//! A sample of a layer is a point of the [definition](super::definition): its wave has the spectrum
//! i·W(f_x)·W(f_y)/f_z·exp(i2πf_z·d). So the whole layer's is that times the transform of its samples, and layers without
//! [`Layer::opaque`] give what the engines give for points on the lattice. Light goes from the farthest layer towards
//! the viewer, +z; at each layer what was carried so far is multiplied by what the layer lets through (silhouette by
//! silhouette, K. Matsushima & S. Nakahara, *Appl. Opt.* 48, H54 (2009)), and the layer's own light is added. From the
//! nearest layer the field is carried to the panel, back through it where that layer stands in front.
//!
//! Cost: one transform a layer, two more for a layer that occludes; memory: [`bytes`].

use super::definition::Optics;
use crate::error::{Error, Result};
use crate::field::{Complex, Complex32, Fft2, Field, Grid};
use crate::progress::Progress;
use crate::propagation::band;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Light on a plane parallel to the panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Depth of the plane; negative behind the panel [m].
    pub z: f64,
    /// Amplitude and phase of the point at each sample, row-major on the lattice; dark samples are zero.
    pub light: Vec<Complex32>,
    /// Samples that let nothing through from behind; none where empty.
    pub opaque: Vec<bool>,
}

/// Cuts a picture with depth into layers: amplitudes, phases [rad] and depths z [m] of each sample, on a lattice.
///
/// Planes stand evenly from the smallest depth to the largest, each sample goes to the nearest one and keeps its phase:
/// its depth is off by up to half their distance. A sample with light hides what is behind it where `occlude`.
///
/// # Errors
/// [`Error::Parameter`] for arrays of unequal length, numbers that are not finite, or no planes.
pub fn slice(amplitudes: &[f32], phases: &[f64], depths: &[f64], planes: usize, occlude: bool) -> Result<Vec<Layer>> {
    let count = amplitudes.len();
    if phases.len() != count || depths.len() != count {
        let what = format!("{count} amplitudes, {} phases and {} depths", phases.len(), depths.len());
        return Err(Error::parameter("layers", what));
    }
    if planes == 0 {
        return Err(Error::parameter("planes", "at least one is needed"));
    }
    if let Some(i) =
        (0..count).find(|&i| !(amplitudes[i].is_finite() && phases[i].is_finite() && depths[i].is_finite()))
    {
        let what = format!("sample {i}: {}, {} rad, {} m must be finite", amplitudes[i], phases[i], depths[i]);
        return Err(Error::parameter("layers", what));
    }
    let lit = || (0..count).filter(|&i| amplitudes[i] != 0.0);
    let (low, high) =
        lit().map(|i| depths[i]).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    if low > high {
        return Ok(Vec::new());
    }
    let step = if planes > 1 { (high - low) / (planes - 1) as f64 } else { 0.0 };
    let nearest = |z: f64| if step > 0.0 { ((z - low) / step).round() as usize } else { 0 };
    let middle = if planes > 1 { low } else { 0.5 * (low + high) };
    let dark = |k: usize| Layer {
        z: middle + k as f64 * step,
        light: vec![Complex32::default(); count],
        opaque: if occlude { vec![false; count] } else { Vec::new() },
    };
    let mut layers: Vec<Layer> = (0..planes).map(dark).collect();
    for i in lit() {
        let layer = &mut layers[nearest(depths[i]).min(planes - 1)];
        let (sin, cos) = phases[i].sin_cos();
        layer.light[i] = Complex32::new(amplitudes[i] * cos as f32, amplitudes[i] * sin as f32);
        if occlude {
            layer.opaque[i] = true;
        }
    }
    layers.retain(|layer| layer.light.iter().any(|u| u.norm_sqr() > 0.0));
    Ok(layers)
}

/// Size of the transforms: layers and panel beside each other, so that nothing comes round.
fn padded(lattice: &Grid, panel: &Grid) -> Result<Grid> {
    let size = |a: usize, b: usize| a + a.max(b);
    Grid::new(size(lattice.width, panel.width), size(lattice.height, panel.height), panel.pitch_x, panel.pitch_y)
}

/// Memory that [`compute`] takes beside layers and field [bytes]: the spectrum, a layer's, and a transform's copy.
pub fn bytes(lattice: &Grid, panel: &Grid) -> Result<u64> {
    Ok(3 * size_of::<Complex32>() as u64 * padded(lattice, panel)?.len() as u64)
}

/// The field of layers, all on `lattice`, on the panel.
///
/// # Errors
/// [`Error::Parameter`] for another pitch than the panel's, samples that do not fit the lattice, or a depth that is not
/// finite; [`Error::Memory`] when `memory` [bytes] is passed.
pub fn compute(
    layers: &[Layer],
    lattice: &Grid,
    panel: &Grid,
    wavelength: f64,
    memory: u64,
    progress: &Progress,
) -> Result<Field> {
    let optics = Optics::new(panel, wavelength)?;
    if [lattice.pitch_x, lattice.pitch_y] != [panel.pitch_x, panel.pitch_y] {
        return Err(Error::parameter("layers", "the lattice must have the panel's pitch"));
    }
    for layer in layers {
        let fits = layer.light.len() == lattice.len() && [0, lattice.len()].contains(&layer.opaque.len());
        if !fits || !layer.z.is_finite() {
            let what = format!("a layer at {} m has {} samples for {}", layer.z, layer.light.len(), lattice.len());
            return Err(Error::parameter("layers", what));
        }
    }
    let needed = bytes(lattice, panel)?;
    if needed > memory {
        let hint = "give more memory or a smaller lattice".to_owned();
        return Err(Error::Memory { what: "layers", needed: needed.div_ceil(1 << 20), budget: memory >> 20, hint });
    }
    progress.start("hologram: layers", layers.len() as u64 + 1);
    let mut order: Vec<&Layer> = layers.iter().collect();
    order.sort_by(|a, b| a.z.total_cmp(&b.z));
    let grid = padded(lattice, panel)?;
    let transform = Fft2::<f32>::new(grid.width, grid.height);
    let steps = Steps { optics, grid, fx: (0..grid.width).map(|k| grid.frequency_x(k)).collect() };
    let mut sum: Vec<Complex32> = bytemuck::zeroed_vec(grid.len());
    let mut own: Vec<Complex32> = bytemuck::zeroed_vec(grid.len());
    let mut at = order.first().map_or(0.0, |layer| layer.z);
    for layer in order {
        progress.check()?;
        if layer.z > at {
            steps.carry(&mut sum, layer.z - at, Window::default(), progress);
            at = layer.z;
        }
        if layer.opaque.contains(&true) {
            transform.inverse(&mut sum);
            progress.check()?;
            // What left the lattice is lost: it would come round at the next plane.
            for (row, line) in sum.chunks_exact_mut(grid.width).enumerate() {
                if row >= lattice.height {
                    line.fill(Complex32::default());
                    continue;
                }
                let opaque = &layer.opaque[row * lattice.width..][..lattice.width];
                line[lattice.width..].fill(Complex32::default());
                line.iter_mut().zip(opaque).filter(|(_, opaque)| **opaque).for_each(|(u, _)| *u = Complex32::default());
            }
            transform.forward(&mut sum);
            progress.check()?;
        }
        own.fill(Complex32::default());
        for (line, light) in own.chunks_exact_mut(grid.width).zip(layer.light.chunks_exact(lattice.width)) {
            line[..lattice.width].copy_from_slice(light);
        }
        transform.forward(&mut own);
        progress.check()?;
        steps.add_light(&mut sum, &own, if layer.z > 0.0 { -1.0 } else { 1.0 });
        progress.advance(1);
    }
    drop(own);
    let to = Window {
        first: [panel.x(0) - lattice.x(0), panel.y(0) - lattice.y(0)],
        middle: [panel.center[0] - lattice.center[0], panel.center[1] - lattice.center[1]],
    };
    steps.carry(&mut sum, -at, to, progress);
    progress.check()?;
    transform.inverse(&mut sum);
    progress.check()?;
    let mut field = Field::zeros(*panel, wavelength);
    for (row, line) in field.samples.chunks_exact_mut(panel.width).zip(sum.chunks_exact(grid.width)) {
        row.copy_from_slice(&line[..panel.width]);
    }
    Ok(field)
}

/// Where a window stands from the lattice: its first sample from the lattice's first, its middle from the middle [m].
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    first: [f64; 2],
    middle: [f64; 2],
}

/// Products with the spectrum.
struct Steps {
    optics: Optics,
    grid: Grid,
    fx: Vec<f64>,
}

impl Steps {
    /// f_z [cycles/m]; the taper ends before waves that do not travel.
    fn fz(&self, fx: f64, fy: f64) -> f64 {
        (self.optics.wavelength.powi(-2) - fx * fx - fy * fy).max(0.0).sqrt()
    }

    /// Carries the spectrum over a distance and onto a window; frequencies at which the factor aliases
    /// over the transform's period are dropped, as in [`crate::propagation`].
    fn carry(&self, sum: &mut [Complex32], distance: f64, to: Window, progress: &Progress) {
        let extent = [self.grid.extent_x(), self.grid.extent_y()];
        let [x, y] = [0, 1].map(|axis| band(self.optics.wavelength, distance, to.middle[axis], extent[axis]));
        let shift = to.first;
        sum.par_chunks_mut(self.grid.width).enumerate().for_each(|(ky, line)| {
            let fy = self.grid.frequency_y(ky);
            for (u, &fx) in line.iter_mut().zip(&self.fx).filter(|_| !progress.stopped()) {
                if fy < y[0] || fy > y[1] || fx < x[0] || fx > x[1] {
                    *u = Complex32::default();
                } else {
                    let turns = self.fz(fx, fy) * distance + fx * shift[0] + fy * shift[1];
                    *u *= cis(turns);
                }
            }
        });
    }

    /// Adds ±i·W·W/f_z times the transform of samples; + for a layer behind the panel.
    fn add_light(&self, sum: &mut [Complex32], own: &[Complex32], sign: f32) {
        let wx: Vec<f64> = self.fx.iter().map(|&f| self.optics.taper[0].at(f)).collect();
        // A sample of the transform stands for the lattice's cell of frequencies; its sum is 1/N of the integral.
        let area = 1.0 / (self.grid.pitch_x * self.grid.pitch_y);
        sum.par_chunks_mut(self.grid.width).zip(own.par_chunks(self.grid.width)).enumerate().for_each(
            |(ky, (line, own))| {
                let fy = self.grid.frequency_y(ky);
                let wy = self.optics.taper[1].at(fy) * area;
                for (((u, own), &fx), wx) in line.iter_mut().zip(own).zip(&self.fx).zip(&wx) {
                    let weight = (wx * wy / self.fz(fx, fy).max(1.0)) as f32;
                    *u += Complex::new(-own.im * weight * sign, own.re * weight * sign);
                }
            },
        );
    }
}

fn cis(turns: f64) -> Complex32 {
    let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
    Complex32::new(cos as f32, sin as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::relative_error;
    use crate::hologram::{Cull, oracle};
    use crate::points::PointSource;
    use crate::random::Random;
    use glam::DVec3;

    const WAVELENGTH: f64 = 532e-9;

    /// Points on samples of the lattice at two depths, and the layers that hold them.
    fn scene(lattice: &Grid, z: [f64; 2], count: u64) -> (Vec<PointSource>, Vec<Layer>) {
        let mut points = Vec::new();
        let dark = vec![Complex32::default(); lattice.len()];
        let mut layers = z.map(|z| Layer { z, light: dark.clone(), opaque: Vec::new() });
        for i in 0..count {
            let mut random = Random::new(8, i);
            let column = (random.uniform() * lattice.width as f64) as usize;
            let row = (random.uniform() * lattice.height as f64) as usize;
            let layer = &mut layers[i as usize % 2];
            let phase = random.phase();
            let position = DVec3::new(lattice.x(column), lattice.y(row), layer.z);
            points.push(PointSource { position, amplitude: 1.0, phase });
            let (sin, cos) = phase.sin_cos();
            layer.light[row * lattice.width + column] += Complex32::new(cos as f32, sin as f32);
        }
        (points, layers.to_vec())
    }

    #[test]
    fn layers_without_occlusion_are_the_points_of_the_definition() {
        let panel = Grid::new(205, 131, 8e-6, 6.5e-6).expect("grid").centered_at([0.1e-3, -0.05e-3]);
        let lattice = Grid::new(251, 160, 8e-6, 6.5e-6).expect("grid").centered_at([0.03e-3, 0.02e-3]);
        for (z, wanted) in [([-0.006, -0.004], 1e-3), ([0.001, -0.003], 1e-3)] {
            let (points, layers) = scene(&lattice, z, 24);
            let exact = oracle(&points, &panel, WAVELENGTH, Cull::Soft).expect("oracle");
            // The nearest layer in front makes every layer's light pass through it: the sign ±i is the point's own.
            let field = compute(&layers, &lattice, &panel, WAVELENGTH, 1 << 30, &Progress::new()).expect("field");
            let error = relative_error(&field.samples, &exact.samples);
            println!("layers at {z:?}: {error:.2e}");
            assert!(error < wanted, "{z:?}: {error:.2e}");
        }
    }

    #[test]
    fn an_opaque_layer_hides_what_is_behind_it_and_nothing_else() {
        let panel = Grid::new(160, 120, 8e-6, 8e-6).expect("grid");
        let at = |column: usize, row: usize| row * panel.width + column;
        let mut back = Layer { z: -0.0101, light: vec![Complex32::default(); panel.len()], opaque: Vec::new() };
        back.light[at(80, 60)] = Complex32::new(1.0, 0.0);
        let shutter = |low: usize, high: usize| {
            let inside = |i: usize| (low..high).contains(&(i % panel.width));
            let light = vec![Complex32::default(); panel.len()];
            Layer { z: -0.01, light, opaque: (0..panel.len()).map(inside).collect() }
        };
        let energy = |layers: &[Layer]| {
            compute(layers, &panel, &panel, WAVELENGTH, 1 << 30, &Progress::new()).expect("field").energy()
        };
        let free = energy(std::slice::from_ref(&back));
        // 0.1 mm on, the point's light is 5 pixels wide: a wide shutter before it takes it all, one beside it nothing.
        let hidden = energy(&[back.clone(), shutter(60, 100)]);
        let beside = energy(&[shutter(100, 160), back.clone()]);
        println!("free {free:.3e}, hidden {:.1e}, beside {:.4}", hidden / free, beside / free);
        assert!(hidden < 2e-3 * free && (beside / free - 1.0).abs() < 2e-3);
        // What passes on the left of an edge and what passes on its right are the whole.
        let run = |layers: &[Layer]| {
            compute(layers, &panel, &panel, WAVELENGTH, 1 << 30, &Progress::new()).expect("field").samples
        };
        let parts = [run(&[back.clone(), shutter(81, 160)]), run(&[back.clone(), shutter(0, 81)])];
        let sum: Vec<Complex32> = parts[0].iter().zip(&parts[1]).map(|(a, b)| a + b).collect();
        let error = relative_error(&sum, &run(&[back]));
        println!("two halves: {error:.2e}");
        assert!(error < 2e-3 && parts.iter().all(|part| part.iter().any(|u| u.norm_sqr() > 0.0)));
    }

    #[test]
    fn pictures_are_sliced_and_nonsense_is_refused() {
        let amplitudes = [1.0, 0.0, 2.0, 1.0];
        let layers = slice(&amplitudes, &[0.0; 4], &[-0.1, -9.0, -0.3, -0.19], 3, true).expect("layers");
        assert_eq!(layers.iter().map(|l| (l.z * 1e3).round()).collect::<Vec<_>>(), [-300.0, -200.0, -100.0]);
        assert!(layers[1].opaque == [false, false, false, true] && layers[0].light[2].re == 2.0);
        assert!(slice(&amplitudes, &[0.0; 3], &[0.0; 4], 3, true).is_err());
        assert!(slice(&amplitudes, &[0.0; 4], &[f64::NAN; 4], 3, true).is_err());
        let grid = Grid::new(2, 2, 8e-6, 8e-6).expect("grid");
        let run = |layers: &[Layer], memory| compute(layers, &grid, &grid, WAVELENGTH, memory, &Progress::new());
        assert!(matches!(run(&layers, 100), Err(Error::Memory { .. })));
        assert!(run(&[Layer { z: f64::NAN, ..layers[0].clone() }], 1 << 20).is_err());
        let stopped = Progress::new();
        stopped.stop();
        assert!(matches!(compute(&layers, &grid, &grid, WAVELENGTH, 1 << 20, &stopped), Err(Error::Interrupted)));
    }
}
