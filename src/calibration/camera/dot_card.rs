//! The dot card: a hologram of dots on a jittered lattice in the Fourier plane, which no turn and no mirror takes to itself.

use crate::error::Result;
use crate::field::Complex64;
use crate::panel::{Frame, PanelProfile, Pattern, PhasePattern, drive};
use crate::random::Random;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Dots along columns and rows.
const LATTICE: [usize; 2] = [7, 6];
/// Share of the window's half width that the lattice reaches to.
const REACH: f64 = 0.85;
/// Iterations that make the dots alike.
const ITERATIONS: usize = 6;

/// Distance of neighbouring dots [cycles/pixel] on a card for a window of that half width.
pub(super) fn spacing(half: f64) -> f64 {
    2.0 * REACH * half / (LATTICE[0] - 1) as f64
}

/// The dots' frequencies [cycles/pixel] in a window of that half width about the zero order; none near that.
pub(super) fn dots(half: f64) -> Vec<[f64; 2]> {
    let mut random = Random::new(0xd07, 1);
    let step = LATTICE.map(|n| 2.0 * REACH * half / (n - 1) as f64);
    let mut jitter = |axis: usize| 0.44 * (random.uniform() - 0.5) * step[axis];
    let mut out = Vec::new();
    for row in 0..LATTICE[1] {
        for column in 0..LATTICE[0] {
            let at = |axis: usize, i: usize| (i as f64 - 0.5 * (LATTICE[axis] - 1) as f64) * step[axis];
            let dot = [at(0, column) + jitter(0), at(1, row) + jitter(1)];
            if dot[0].hypot(dot[1]) > 0.8 * step[0] {
                out.push(dot);
            }
        }
    }
    out
}

/// Phases [rad] that send the light of `width × height` pixels into the dots, all alike (Gerchberg and Saxton, weighted: Di
/// Leonardo et al., *Optics Express* 15, 1913 (2007)).
fn phases(dots: &[[f64; 2]], width: usize, height: usize) -> Vec<f32> {
    let wave = |axis: usize, count: usize| -> Vec<Vec<Complex64>> {
        let at = |i: usize| i as f64 - 0.5 * (count as f64 - 1.0);
        dots.iter().map(|dot| (0..count).map(|i| Complex64::cis(TAU * dot[axis] * at(i))).collect()).collect()
    };
    let (x, y) = (wave(0, width), wave(1, height));
    let mut random = Random::new(0xd07, 2);
    let mut amplitudes: Vec<Complex64> = dots.iter().map(|_| Complex64::cis(random.phase())).collect();
    let mut phase = vec![0.0f32; width * height];
    for iteration in 0..=ITERATIONS {
        phase.par_chunks_mut(width).enumerate().for_each_init(
            || vec![Complex64::new(0.0, 0.0); width],
            |line, (row, out)| {
                line.fill(Complex64::new(0.0, 0.0));
                for (k, amplitude) in amplitudes.iter().enumerate() {
                    let factor = amplitude * y[k][row];
                    line.iter_mut().zip(&x[k]).for_each(|(u, x)| *u += x * factor);
                }
                out.iter_mut().zip(line.iter()).for_each(|(out, u)| *out = u.arg() as f32);
            },
        );
        if iteration == ITERATIONS {
            break;
        }
        // Rows first, so that no sum depends on the number of threads.
        let rows: Vec<Vec<Complex64>> = phase
            .par_chunks(width)
            .map(|phase| {
                let light: Vec<Complex64> = phase.iter().map(|p| Complex64::cis(f64::from(*p))).collect();
                x.iter().map(|x| light.iter().zip(x).map(|(u, x)| u * x.conj()).sum()).collect()
            })
            .collect();
        let sums: Vec<Complex64> =
            (0..dots.len()).map(|k| rows.iter().zip(&y[k]).map(|(row, y)| row[k] * y.conj()).sum()).collect();
        let mean = sums.iter().map(|v| v.norm()).sum::<f64>() / sums.len() as f64;
        for (amplitude, sum) in amplitudes.iter_mut().zip(&sums) {
            *amplitude = sum / sum.norm() * amplitude.norm() * mean / sum.norm();
        }
    }
    phase
}

/// The card as a frame.
///
/// # Errors
/// As [`drive`].
pub(super) fn frame(profile: &PanelProfile, wavelength: f64, half: f64) -> Result<Frame> {
    let grid = profile.grid()?;
    let phase = phases(&dots(half), grid.width, grid.height);
    Ok(drive(&Pattern::Phase(PhasePattern::new(grid, wavelength, phase)?), None, profile)?.frame)
}
