//! Layers against the oracle and against a plain chain of whole transforms in f64.

use super::*;
use crate::field::{Complex64, Fft2, relative_error};
use crate::hologram::{Cull, oracle};
use crate::points::PointSource;
use crate::progress::least_time_to_stop;
use crate::random::Random;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::time::Instant;

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
fn nonsense_is_refused() {
    let layers = [Layer { z: -0.1, light: vec![Complex32::new(1.0, 0.0); 4], opaque: Vec::new() }];
    let grid = Grid::new(2, 2, 8e-6, 8e-6).expect("grid");
    let run = |layers: &[Layer], memory| compute(layers, &grid, &grid, WAVELENGTH, memory, &Progress::new());
    assert!(matches!(run(&layers, 100), Err(Error::Memory { .. })));
    assert!(run(&[Layer { z: f64::NAN, ..layers[0].clone() }], 1 << 20).is_err());
    assert!(run(&[Layer { opaque: vec![true; 3], ..layers[0].clone() }], 1 << 20).is_err());
    let stopped = Progress::new();
    stopped.stop();
    assert!(matches!(compute(&layers, &grid, &grid, WAVELENGTH, 1 << 20, &stopped), Err(Error::Interrupted)));
}

/// Factor of one plane wave by the equations, in f64.
fn plain(
    optics: &Optics,
    grid: &Grid,
    light: Emission,
    distance: f64,
    shift: [f64; 2],
    [kx, ky]: [usize; 2],
) -> Complex64 {
    let (fx, fy) = (grid.frequency_x(kx), grid.frequency_y(ky));
    let fz = (optics.wavelength.powi(-2) - fx * fx - fy * fy).max(0.0).sqrt();
    let turns = fz * distance + fx * shift[0] + fy * shift[1];
    let carried = Complex64::cis(TAU * (turns - turns.round()));
    match light {
        Emission::Field => carried,
        Emission::Points { behind } => {
            let weight = optics.taper[0].at(fx) * optics.taper[1].at(fy) / fz / (grid.pitch_x * grid.pitch_y);
            carried * Complex64::new(0.0, if behind { 1.0 } else { -1.0 }) * weight
        }
    }
}

#[test]
fn fast_factors_equal_those_in_double_precision() {
    // Long ways, and the finest pitch over a short one, where the band is widest.
    for (size, pitch, distance) in [
        ([240, 144], [8e-6, 6.5e-6], 0.5),
        ([400, 720], [3.74e-6, 3.74e-6], -0.5),
        ([4096, 2160], [8e-6, 8e-6], 0.5),
        ([1600, 1152], [1e-6, 1.3e-6], 1e-3),
        ([96, 80], [0.5e-6, 0.6e-6], -2e-5),
        ([96, 80], [8e-6, 8e-6], 0.0),
    ] {
        // Odd windows beside each other that leave nearly all of the period to the light.
        let grid = Grid::new(size[0], size[1], pitch[0], pitch[1]).expect("grid");
        let half = Grid::new(size[0] / 2 - 1, size[1] / 2 - 1, pitch[0], pitch[1]).expect("grid");
        let aside = half.centered_at([distance * 7e-3, distance * -3e-3]);
        let optics = Optics::new(&grid, WAVELENGTH).expect("optics");
        for to in [half, aside] {
            let window = Window::new(&half, &to);
            let shift = [to.x(0) - half.x(0), to.y(0) - half.y(0)];
            for light in [Emission::Field, Emission::Points { behind: true }, Emission::Points { behind: false }] {
                for set in InstructionSet::available() {
                    let leg = Leg::new(&optics, size, set).expect("leg");
                    let factor = leg.factor(light, distance, window);
                    let ones = vec![Complex32::new(1.0, 0.0); size[1]];
                    let mut sum = vec![Complex32::new(f32::NAN, 0.0); size[1]];
                    let (mut fast, mut exact) = (Vec::new(), Vec::new());
                    // Of large grids every fifteenth column, and those at the ends of both halves.
                    let step = if size[0] < 1000 { 1 } else { 15 };
                    for kx in (0..size[0]).filter(|kx| kx % step == 0 || [1, size[0] / 2, size[0] - 1].contains(kx)) {
                        sum.fill(Complex32::new(f32::NAN, 0.0));
                        if factor.dark(kx) {
                            sum.fill(Complex32::default());
                        } else {
                            leg.multiply(&factor, kx, &ones, &mut sum, true);
                        }
                        fast.extend_from_slice(&sum);
                        exact.extend((0..size[1]).map(|ky| {
                            let f = [grid.frequency_x(kx), grid.frequency_y(ky)];
                            let weights = [0, 1].map(|axis| window.weight(&optics, axis, f[axis], distance));
                            let scale = weights[0] * weights[1] / grid.len() as f64;
                            plain(&optics, &grid, light, distance, shift, [kx, ky]) * scale
                        }));
                    }
                    let error = relative_error(&fast, &exact);
                    let most = exact.iter().map(|u| u.norm()).fold(0.0, f64::max);
                    let lit = exact.iter().filter(|u| u.norm() > 0.5 * most).count();
                    let off = |(a, b): (&Complex32, &Complex64)| (Complex64::new(a.re.into(), a.im.into()) - b).norm();
                    let worst = fast.iter().zip(&exact).map(off).fold(0.0, f64::max) / most;
                    println!("{size:?} {distance} {light:?} {set:?}: {error:.1e}, worst {worst:.1e}, {lit} lit");
                    assert!(lit > 100 && error < 1e-5 && worst < 3e-5, "{error:.1e} {worst:.1e} {lit}");
                }
            }
        }
    }
}

/// Layers by whole transforms in f64, one step after another as the equations say, on a grid so wide that no light comes
/// round.
fn chain(layers: &[Layer], lattice: &Grid, panel: &Grid, [width, height]: [usize; 2]) -> Vec<Complex64> {
    let optics = Optics::new(panel, WAVELENGTH).expect("optics");
    let grid = Grid { width, height, ..*lattice };
    let transform = Fft2::<f64>::new(grid.width, grid.height);
    let progress = Progress::new();
    let inside = |i: usize| i % grid.width < lattice.width && i / grid.width < lattice.height;
    let place = |i: usize| i / grid.width * lattice.width + i % grid.width;
    let mut order: Vec<&Layer> = layers.iter().collect();
    order.sort_by(|a, b| a.z.total_cmp(&b.z));
    let mut sum = vec![Complex64::default(); grid.len()];
    let mut at = order[0].z;
    let times = |sum: &mut [Complex64], light: Emission, distance: f64, shift: [f64; 2]| {
        sum.par_iter_mut().enumerate().for_each(|(i, u)| {
            *u *= plain(&optics, &grid, light, distance, shift, [i % grid.width, i / grid.width]);
        });
    };
    for layer in order {
        times(&mut sum, Emission::Field, layer.z - at, [0.0; 2]);
        at = layer.z;
        if layer.opaque.contains(&true) {
            transform.inverse(&mut sum, &progress);
            for (i, u) in sum.iter_mut().enumerate() {
                if !inside(i) || layer.opaque[place(i)] {
                    *u = Complex64::default();
                }
            }
            transform.forward(&mut sum, &progress);
        }
        let value = |i: usize| {
            let u = if inside(i) { layer.light[place(i)] } else { Complex32::default() };
            Complex64::new(u.re.into(), u.im.into())
        };
        let mut own: Vec<Complex64> = (0..grid.len()).map(value).collect();
        transform.forward(&mut own, &progress);
        times(&mut own, Emission::Points { behind: layer.z <= 0.0 }, 0.0, [0.0; 2]);
        sum.iter_mut().zip(&own).for_each(|(sum, u)| *sum += u);
    }
    times(&mut sum, Emission::Field, -at, [panel.x(0) - lattice.x(0), panel.y(0) - lattice.y(0)]);
    transform.inverse(&mut sum, &progress);
    (0..panel.len()).map(|i| sum[i / panel.width * grid.width + i % panel.width]).collect()
}

/// Ragged discs of light, farther ones behind nearer ones; a layer in four hides nothing.
fn discs(lattice: &Grid, depths: &[f64]) -> Vec<Layer> {
    let layer = |(k, &z): (usize, &f64)| {
        let mut random = Random::new(5, k as u64);
        let middle = [0, 1].map(|axis| [lattice.width, lattice.height][axis] as f64 * (0.1 + 0.8 * random.uniform()));
        let radius = 0.3 * lattice.width.min(lattice.height) as f64;
        let inside = |i: usize| {
            let (x, y) = ((i % lattice.width) as f64 - middle[0], (i / lattice.width) as f64 - middle[1]);
            x.hypot(y) < radius * (1.0 + 0.2 * (5.0 * y.atan2(x)).sin())
        };
        let opaque: Vec<bool> = (0..lattice.len()).map(inside).collect();
        let mut light = |lit: &bool| {
            let phase = random.phase() as f32;
            if *lit { Complex32::from_polar(1.0, phase) } else { Complex32::default() }
        };
        Layer {
            z,
            light: opaque.iter().map(&mut light).collect(),
            opaque: if k % 4 == 2 { Vec::new() } else { opaque },
        }
    };
    depths.iter().enumerate().map(layer).collect()
}

#[test]
fn many_layers_that_hide_each_other_equal_whole_transforms_in_double_precision() {
    // Windows whole samples apart: light at the highest frequency, which hard edges make, has no value between samples.
    let panel = Grid::new(205, 131, 8e-6, 6.5e-6).expect("grid").centered_at([12.0 * 8e-6, -9.0 * 6.5e-6]);
    let wide = Grid::new(251, 161, 8e-6, 6.5e-6).expect("grid");
    let small = Grid::new(151, 97, 8e-6, 6.5e-6).expect("grid").centered_at([0.0, 6.5e-6]);
    for (lattice, from, step, count, period) in [
        (wide, -0.03, 1e-3, 6, [1080, 960]),
        (small, -0.012, 0.3e-3, 6, [900, 800]),
        (wide, -0.006, 1.1e-3, 5, [1080, 960]),
        // So far that most of the light misses the panel.
        (wide, -0.2, 5e-3, 3, [1200, 1536]),
    ] {
        let depths: Vec<f64> = (0..count).map(|k| from + step * f64::from(k)).collect();
        let layers = discs(&lattice, &depths);
        let field = compute(&layers, &lattice, &panel, WAVELENGTH, 1 << 30, &Progress::new()).expect("field");
        let error = relative_error(&field.samples, &chain(&layers, &lattice, &panel, period));
        println!("{}×{} from {from} m by {step} m: {error:.2e}", lattice.width, lattice.height);
        // What hard edges and random phases leave at the highest frequency has tails that fall as 1/n² only.
        assert!(error < 3e-3, "{error:.2e}");
    }
}

#[test]
fn layers_are_the_same_bits_for_any_number_of_threads() {
    let panel = Grid::new(205, 131, 8e-6, 6.5e-6).expect("grid");
    let layers = discs(&panel, &[-0.012, -0.011, -0.0105, -0.01, 0.002]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| compute(&layers, &panel, &panel, WAVELENGTH, 1 << 30, &Progress::new()).expect("field").samples)
    };
    let one = run(1);
    assert!([2, 3, 7].iter().all(|&threads| run(threads) == one));
}

#[test]
fn layers_that_are_asked_to_stop_end_within_a_transform() {
    let panel = Grid::new(960, 700, 8e-6, 8e-6).expect("grid");
    let layers = discs(&panel, &[-0.1, -0.09, -0.08, -0.07]);
    let begin = Instant::now();
    let run = |progress: &Progress| compute(&layers, &panel, &panel, WAVELENGTH, 1 << 30, progress);
    run(&Progress::new()).expect("field");
    let whole = begin.elapsed();
    let least = least_time_to_stop(run);
    println!("layers: {whole:?}, {least:?} after the stop");
    assert!(least < whole / 8, "{least:?} of {whole:?}");
}
