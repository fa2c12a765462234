//! Neighbouring pixels whose phases run into each other.
//!
//! Fringing fields blur the phase over the panel. At a pixel's middle it is that of the pixels about it with the shares of a
//! Gaussian's integrals; nearer its border the neighbour's share is larger. The light of a whole pixel is the mean over it of
//! what these phases make, not what its mean phase makes: beside a wrap a pixel shows all phases at once and hardly any light.

use crate::field::Complex32;
use rayon::prelude::*;

/// Places along each side of a pixel at which its phase is taken.
const PLACES: usize = 3;

/// Values of an array of that width blended by a Gaussian of standard deviation `sigma` [samples]; beyond the border the
/// border's values go on.
pub(crate) fn blurred(values: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    convolved(values, width, &gaussian(sigma))
}

/// The same by half of a kernel's weights, the middle one first.
fn convolved(values: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let (reach, height) = (kernel.len() - 1, values.len() / width);
    let mut rows = vec![0.0; values.len()];
    rows.par_chunks_mut(width).zip(values.par_chunks(width)).for_each_init(
        || vec![0.0f32; width + 2 * reach],
        |wide, (out, row)| {
            wide[..reach].fill(row[0]);
            wide[reach..reach + width].copy_from_slice(row);
            wide[reach + width..].fill(row[width - 1]);
            for (k, &weight) in kernel.iter().enumerate() {
                add_both(out, weight, [&wide[reach - k..][..width], &wide[reach + k..][..width]], k == 0);
            }
        },
    );
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (k, &weight) in kernel.iter().enumerate() {
            let line = |row: usize| &rows[row * width..][..width];
            add_both(out, weight, [line(row.saturating_sub(k)), line((row + k).min(height - 1))], k == 0);
        }
    });
    out
}

/// Adds a weight's share of the values on both sides; of the middle once, in place of what there is.
fn add_both(out: &mut [f32], weight: f32, [before, after]: [&[f32]; 2], is_middle: bool) {
    if is_middle {
        out.iter_mut().zip(before).for_each(|(out, v)| *out = weight * v);
    } else {
        out.iter_mut().zip(before.iter().zip(after)).for_each(|(out, (a, b))| *out += weight * (a + b));
    }
}

/// Half of a Gaussian's weights, integrated over cells: weight i is the share that lands i cells away; sums to one with
/// its mirror image.
fn gaussian(sigma: f64) -> Vec<f32> {
    // Beyond five standard deviations 6e-7 of the weight is left.
    let reach = (5.0 * sigma).ceil() as usize + 1;
    let integral = |x: f64| 0.5 * libm::erf(x / (sigma * std::f64::consts::SQRT_2));
    let weights: Vec<f64> = (0..=reach).map(|i| integral(i as f64 + 0.5) - integral(i as f64 - 0.5)).collect();
    let sum = 2.0 * weights.iter().sum::<f64>() - weights[0];
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// For each place along a pixel: the shares there of the pixel and its neighbours, from the first of them to the last.
fn shares(sigma: f64) -> Vec<Vec<f64>> {
    let sigma = sigma.max(0.02);
    // Beyond 3.5 standard deviations 2e-4 is left.
    let reach = (3.5 * sigma + 0.5).ceil() as i32;
    let below = |x: f64| 0.5 * libm::erf(x / (sigma * std::f64::consts::SQRT_2));
    let at = |place: usize| {
        let x = (place as f64 + 0.5) / PLACES as f64 - 0.5;
        let share = |k: i32| below(f64::from(k) + 0.5 - x) - below(f64::from(k) - 0.5 - x);
        let all: Vec<f64> = (-reach..=reach).map(share).collect();
        let sum: f64 = all.iter().sum();
        all.iter().map(|w| w / sum).collect()
    };
    (0..PLACES).map(at).collect()
}

/// The mean over each pixel of what its places make of their phases [rad] (or amplitudes), each blended from the pixels' by a
/// Gaussian of that standard deviation [pixels]; beyond the border the border's values go on.
pub(crate) fn mixed(
    values: &[f32],
    width: usize,
    sigma: f64,
    modulate: impl Fn(f32) -> Complex32 + Sync,
) -> Vec<Complex32> {
    let shares: Vec<Vec<f32>> = shares(sigma).iter().map(|w| w.iter().map(|w| *w as f32).collect()).collect();
    let (reach, height) = (shares[0].len() / 2, values.len() / width);
    let mut out = vec![Complex32::new(0.0, 0.0); values.len()];
    let even = 1.0 / (PLACES * PLACES) as f32;
    out.par_chunks_mut(width).enumerate().for_each_init(
        || vec![0.0f32; width + 2 * reach],
        |line, (row, out)| {
            for down in &shares {
                line.fill(0.0);
                for (t, share) in down.iter().enumerate() {
                    let from = (row + t).saturating_sub(reach).min(height - 1);
                    let source = &values[from * width..][..width];
                    line[reach..reach + width].iter_mut().zip(source).for_each(|(v, p)| *v += share * p);
                }
                let ends = (line[reach], line[reach + width - 1]);
                line[..reach].fill(ends.0);
                line[reach + width..].fill(ends.1);
                for along in &shares {
                    for (i, u) in out.iter_mut().enumerate() {
                        let value: f32 = along.iter().zip(&line[i..]).map(|(w, v)| w * v).sum();
                        *u += modulate(value) * even;
                    }
                }
            }
        },
    );
    out
}

/// Values blended by the mean share that each neighbour has in a pixel: slopes of pixels' phases as slopes of what they were
/// blended from.
pub(crate) fn spread(values: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let shares = shares(sigma);
    let middle = shares[0].len() / 2;
    let mean = |k: usize| shares.iter().map(|s| s[middle + k]).sum::<f64>() / PLACES as f64;
    convolved(values, width, &(0..=middle).map(|k| mean(k) as f32).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::phasor;

    /// Against phases blended on a lattice sixty times as fine, one axis at a time.
    #[test]
    fn a_pixel_beside_a_wrap_mixes_the_phases_that_it_shows() {
        let (width, sigma) = (21usize, 0.4);
        let phase = |i: usize| if i < 10 { 0.3f32 } else { 5.9 };
        let values: Vec<f32> = (0..width * 3).map(|i| phase(i % width)).collect();
        let light = mixed(&values, width, sigma, |v| phasor(v / std::f32::consts::TAU));
        for (i, u) in light[width..2 * width].iter().enumerate() {
            let fine = |k: usize| {
                let x = i as f64 + (k as f64 + 0.5) / 60.0 - 10.0;
                let phase = 0.3 + 5.6 * 0.5 * (1.0 + libm::erf(x / (sigma * std::f64::consts::SQRT_2)));
                crate::field::Complex64::cis(phase)
            };
            let wanted = (0..60).map(fine).sum::<crate::field::Complex64>() / 60.0;
            // Three places a side against sixty.
            let off = (f64::from(u.re) - wanted.re).hypot(f64::from(u.im) - wanted.im);
            assert!(off < 0.08, "{i}: {u} {wanted}");
        }
        let sum: f32 = spread(&vec![1.0; 63], width, sigma).iter().sum();
        assert!((sum - 63.0).abs() < 1e-3);
    }
}
