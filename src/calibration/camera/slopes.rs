//! A first wavefront from photos, however far the panel is bent: each part of the panel makes a speckle picture of its own,
//! and a slope of the wavefront moves it.
//!
//! The light of one part alone is known from what it shows; its brightness correlates with the photo (all other parts' light
//! is noise to it, which averages out over thousands of speckles). Where the correlation peaks tells the part's slope, as a
//! Shack–Hartmann sensor does, and how high it peaks tells how much light falls there.

use super::mapping::Mapping;
use super::model::Model;
use super::photo::CameraPhoto;
use super::shapes::Products;
use super::solve::solve;
use crate::field::{Complex32, Fft2};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Parts along x and y.
pub(super) const PARTS: [usize; 2] = [7, 5];
/// Degree of the first wavefront.
const DEGREE: usize = 4;
/// Peaks of less than this many standard deviations of the correlation are none.
const SIGNIFICANT: f32 = 6.0;

/// What the parts tell.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// The wavefront's numbers, as the model's.
    pub(super) wave: Vec<f64>,
    /// Numbers of the source's logarithm, as the model's.
    pub(super) source: Vec<f64>,
    /// Mean slope [cycles/pixel]: what the mapping is off by.
    pub(super) tilt: [f64; 2],
    /// Parts whose correlation peaks, and their mean height in standard deviations.
    pub(super) found: usize,
    pub(super) height: f64,
}

/// Contrast of a picture against its own blurred self, limited against the zero order.
fn contrast(values: &[f32], width: usize) -> Vec<Complex32> {
    let mean = crate::panel::crosstalk::blurred(values, width, 6.0);
    let floor = 0.1 * values.iter().sum::<f32>() / values.len() as f32 + f32::MIN_POSITIVE;
    values.iter().zip(&mean).map(|(v, m)| Complex32::new(((v - m) / m.max(floor)).clamp(-1.0, 3.0), 0.0)).collect()
}

/// The start from pictures of frames with these levels; `curve` are the model's numbers of the curve.
pub(super) fn start(
    model: &Model,
    mapping: &Mapping,
    values: &[f64],
    frames: &[(&[u16], &CameraPhoto)],
    progress: &Progress,
) -> Start {
    let zoom = &model.zoom;
    let padded = zoom.padded();
    let [mx, my] = padded.map(|n| n / 2);
    let inner = |k: usize, m: usize, n: usize| if k < m / 2 { k } else { n - m + k };
    let plan = Fft2::<f32>::new(mx, my);
    // The photos on the transform's samples.
    let pixels: Vec<Option<[f64; 2]>> = (0..mx * my)
        .into_par_iter()
        .map(|i| {
            let f = [zoom.frequency(0, inner(i % mx, mx, padded[0])), zoom.frequency(1, inner(i / mx, my, padded[1]))];
            mapping.pixel(f)
        })
        .collect();
    // Middle of the window in the middle of the array, where blurring does not wrap.
    let centred = |i: usize| ((i / mx + my / 2) % my) * mx + (i % mx + mx / 2) % mx;
    let in_order = |values: Vec<f32>| {
        let mut out = vec![0.0; values.len()];
        values.iter().enumerate().for_each(|(i, v)| out[centred(i)] = *v);
        let mut out = contrast(&out, mx);
        plan.forward(&mut out, progress);
        out
    };
    let seen: Vec<Vec<Complex32>> = frames
        .iter()
        .map(|(_, picture)| {
            let taken: Vec<Option<f32>> = pixels.iter().map(|p| picture.at((*p)?)).collect();
            let known: Vec<f32> = taken.iter().flatten().copied().collect();
            let mean = known.iter().sum::<f32>() / known.len().max(1) as f32;
            in_order(taken.iter().map(|v| v.unwrap_or(mean)).collect())
        })
        .collect();
    let incident = model.incident(values);
    let lattices: Vec<Vec<Complex32>> = frames
        .iter()
        .map(|(levels, _)| zoom.gather(&model.modulated(values, &incident, levels, values[model.layout.crosstalk])))
        .collect();
    let [nx, ny] = zoom.counts();
    let sides = [model.light.width as f64, model.light.height as f64];
    let reach = (mx.min(my) / 5).min(48) as isize;
    let parts: Vec<_> = (0..PARTS[0] * PARTS[1])
        .into_par_iter()
        .map(|part| {
            let center = [(part % PARTS[0]) as f64, (part / PARTS[0]) as f64];
            let center = [0, 1].map(|a| (2.0 * center[a] + 1.0) / PARTS[a] as f64 - 1.0);
            let window = |axis: usize, j: usize| {
                let x = 2.0 * zoom.position(axis, j) / sides[axis];
                (-0.5 * ((x - center[axis]) * PARTS[axis] as f64 * 0.9).powi(2)).exp()
            };
            let windows = [(0..nx).map(|i| window(0, i)).collect::<Vec<_>>(), (0..ny).map(|j| window(1, j)).collect()];
            let mut sum = vec![Complex32::new(0.0, 0.0); mx * my];
            for (lattice, seen) in lattices.iter().zip(&seen) {
                let plane = zoom.transform(lattice, |i, j| Complex32::new((windows[0][i] * windows[1][j]) as f32, 0.0));
                let alone: Vec<f32> = (0..mx * my)
                    .map(|i| plane[inner(i / mx, my, padded[1]) * padded[0] + inner(i % mx, mx, padded[0])].norm_sqr())
                    .collect();
                let alone = in_order(alone);
                sum.iter_mut().zip(seen.iter().zip(&alone)).for_each(|(s, (a, b))| *s += a * b.conj());
            }
            plan.inverse(&mut sum, progress);
            let at = |dx: isize, dy: isize| {
                sum[(dy.rem_euclid(my as isize) as usize) * mx + dx.rem_euclid(mx as isize) as usize].re
            };
            let near: Vec<(isize, isize)> =
                (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))).collect();
            let best = near.iter().copied().max_by(|a, b| at(a.0, a.1).total_cmp(&at(b.0, b.1))).unwrap_or((0, 0));
            let spread = (sum.iter().map(|s| s.re * s.re).sum::<f32>() / sum.len() as f32).sqrt();
            let peak = at(best.0, best.1);
            let vertex = |l: f32, m: f32, r: f32| {
                let bend = l - 2.0 * m + r;
                if bend < 0.0 { f64::from(0.5 * (l - r) / bend).clamp(-0.5, 0.5) } else { 0.0 }
            };
            let dx = best.0 as f64 + vertex(at(best.0 - 1, best.1), peak, at(best.0 + 1, best.1));
            let dy = best.1 as f64 + vertex(at(best.0, best.1 - 1), peak, at(best.0, best.1 + 1));
            let shift = [dx / (padded[0] * zoom.step) as f64, dy / (padded[1] * zoom.step) as f64];
            (center, shift, peak / spread)
        })
        .collect();
    gathered(model, &parts, sides)
}

fn gathered(model: &Model, parts: &[([f64; 2], [f64; 2], f32)], sides: [f64; 2]) -> Start {
    let all = Products::new(1, DEGREE);
    let n = all.len();
    let slope = |x: f64, y: f64, axis: usize| -> Vec<f64> {
        let d = 1e-4;
        let (a, b) = if axis == 0 { ([x + d, y], [x - d, y]) } else { ([x, y + d], [x, y - d]) };
        all.values(a[0], a[1]).iter().zip(all.values(b[0], b[1])).map(|(a, b)| (a - b) / (2.0 * d)).collect()
    };
    let mut used: Vec<_> = parts.iter().filter(|p| p.2 > SIGNIFICANT).collect();
    let mut coefficients = vec![0.0; n];
    for _ in 0..4 {
        let (mut normal, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for ([x, y], shift, height) in &used {
            for axis in 0..2 {
                let (row, wanted) = (slope(*x, *y, axis), TAU * shift[axis] * 0.5 * sides[axis]);
                for a in 0..n {
                    right[a] += row[a] * wanted * f64::from(*height);
                    (0..n).for_each(|b| normal[a * n + b] += row[a] * row[b] * f64::from(*height));
                }
            }
        }
        let trace: f64 = (0..n).map(|a| normal[a * n + a]).sum::<f64>() / n as f64;
        (0..n).for_each(|a| normal[a * n + a] += 1e-3 * trace + 1e-9);
        coefficients = solve(&normal, &right).unwrap_or(coefficients);
        let miss = |([x, y], shift, _): &([f64; 2], [f64; 2], f32)| {
            let found = |axis| slope(*x, *y, axis).iter().zip(&coefficients).map(|(s, c)| s * c).sum::<f64>();
            let off = [0, 1].map(|axis| found(axis) - TAU * shift[axis] * 0.5 * sides[axis]);
            off[0].hypot(off[1])
        };
        let mut misses: Vec<f64> = used.iter().map(|p| miss(p)).collect();
        misses.sort_by(f64::total_cmp);
        let limit = 4.0 * misses.get(misses.len() / 2).copied().unwrap_or(0.0) + 0.5;
        used.retain(|p| miss(p) < limit);
    }
    let mut wave = vec![0.0; model.light.wave.len()];
    let mut tilt = [0.0; 2];
    for (term, c) in all.terms.iter().zip(&coefficients) {
        match model.light.wave.terms.iter().position(|t| t == term) {
            Some(at) => wave[at] = *c,
            None => tilt[usize::from(term[1] == 1)] = c / TAU / (0.5 * sides[usize::from(term[1] == 1)]),
        }
    }
    let height = used.iter().map(|p| f64::from(p.2)).sum::<f64>() / used.len().max(1) as f64;
    Start { wave, source: brightness(model, &used), tilt, found: used.len(), height }
}

/// The source's logarithm from the peaks' heights, a polynomial of the second degree.
fn brightness(model: &Model, used: &[&([f64; 2], [f64; 2], f32)]) -> Vec<f64> {
    let all = Products::new(0, 2);
    let n = all.len();
    let (mut normal, mut right) = (vec![0.0; n * n], vec![0.0; n]);
    for ([x, y], _, height) in used {
        let row = all.values(*x, *y);
        for a in 0..n {
            right[a] += row[a] * 0.5 * f64::from(*height).ln();
            (0..n).for_each(|b| normal[a * n + b] += row[a] * row[b]);
        }
    }
    (0..n).for_each(|a| normal[a * n + a] += 1e-2);
    let found = solve(&normal, &right).unwrap_or_else(|| vec![0.0; n]);
    let mut out = vec![0.0; model.light.source.len()];
    for (term, c) in all.terms.iter().zip(&found) {
        if let Some(at) = model.light.source.terms.iter().position(|t| t == term) {
            out[at] = *c;
        }
    }
    out
}
