//! Binary patterns whose rounding noise keeps out of a band: direct search with a local carrier.
//!
//! A pattern q of zeros and ones stands for wishes t. Lit with r and seen in a direction that the unit wave s = r·conj(w)
//! takes out (w converges on the middle of an eye box), the noise that reaches the box is the low band of (q − t)·s. The
//! search turns single pixels over while that lowers E = Σ conj(d)·(H ∗ d), d = (q − t)·s, with H an even positive definite
//! kernel, H = g ∗ g of a windowed sinc g whose spectrum is the box: turning pixel x over by δ = ±1 changes E by
//! 2δ·Re(conj(s)·e)(x) + H(0), e = H ∗ d, and e by δ·s(x)·H (Seldowitz, Allebach & Sweeney, *Applied Optics* 26, 2788
//! (1987), on a band about a carrier; Analoui & Allebach, *Proc. SPIE* 1666, 96 (1992), for the bookkeeping of e).
//!
//! Blocks of a lattice fixed to the plate are gone through in four turns, those of a turn so far apart that none reads what
//! another writes: the result does not depend on threads.

use crate::field::Complex32;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Side of a block [px]; those of one turn lie this far from each other.
pub(crate) const BLOCK: i64 = 64;

/// Longest kernel on each side: two blocks of a turn must not reach each other [px].
const REACH: usize = BLOCK as usize / 2;

/// A kernel H along both axes.
#[derive(Clone, Debug)]
pub(crate) struct BandKernel {
    /// H along x and y at offsets −reach … +reach; 1 in the middle.
    taps: [Vec<f32>; 2],
}

/// H along an axis for a half width [cycles/px].
fn taps(half: f64) -> Vec<f32> {
    // As long as resolves the band's edge to a third of its width.
    let side = ((2.2 / half).ceil() as usize).clamp(2, REACH / 2);
    let g: Vec<f64> = (0..=2 * side)
        .map(|i| {
            let x = i as f64 - side as f64;
            let sinc = if x == 0.0 { 2.0 * half } else { (2.0 * PI * half * x).sin() / (PI * x) };
            sinc * 0.5 * (1.0 + (PI * x / (side as f64 + 1.0)).cos())
        })
        .collect();
    let at = |lag: usize| -> f64 { g.iter().zip(&g[lag..]).map(|(a, b)| a * b).sum() };
    let whole = at(0);
    (0..=4 * side).map(|i| (at(i.abs_diff(2 * side)) / whole) as f32).collect()
}

impl BandKernel {
    /// The kernel of a band of half widths along x and y [cycles/px], at most 1/2.
    pub(crate) fn new(half: [f64; 2]) -> Self {
        Self { taps: half.map(|half| taps(half.clamp(1e-3, 0.5))) }
    }

    fn reach(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.taps[axis].len() / 2)
    }

    /// H ∗ d for samples in rows of `width`; zero outside of them.
    fn filtered(&self, samples: &[Complex32], width: usize) -> Vec<Complex32> {
        let [across, down] = self.reach();
        let mut rows = vec![Complex32::default(); samples.len()];
        rows.par_chunks_mut(width).zip(samples.par_chunks(width)).for_each(|(out, line)| {
            for (x, u) in out.iter_mut().enumerate() {
                let (from, to) = (x.saturating_sub(across), (x + across + 1).min(width));
                let weights = &self.taps[0][from + across - x..];
                *u = line[from..to].iter().zip(weights).map(|(d, &h)| d * h).sum();
            }
        });
        let height = samples.len() / width;
        let mut out = vec![Complex32::default(); samples.len()];
        out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            let (from, to) = (y.saturating_sub(down), (y + down + 1).min(height));
            for (line, &h) in rows[from * width..to * width].chunks_exact(width).zip(&self.taps[1][from + down - y..]) {
                out.iter_mut().zip(line).for_each(|(u, v)| *u += v * h);
            }
        });
        out
    }

    /// Binary values for `wishes` in rows of `width`, whose first pixel is the plate's pixel `origin`; `unit` is s, of
    /// modulus one. Begins with what lies above one half.
    pub(crate) fn search(
        &self,
        wishes: &[f32],
        unit: &[Complex32],
        width: usize,
        origin: [i64; 2],
        sweeps: u32,
    ) -> Vec<f32> {
        let mut open: Vec<f32> = wishes.iter().map(|&t| if t > 0.5 { 1.0 } else { 0.0 }).collect();
        let d: Vec<Complex32> = open.iter().zip(wishes).zip(unit).map(|((q, t), s)| s * (q - t)).collect();
        let mut error = self.filtered(&d, width);
        drop(d);
        let height = wishes.len() / width;
        let cut = |from: i64, size: usize, parity: i64| -> Vec<[usize; 2]> {
            let end = from + size as i64;
            (from.div_euclid(BLOCK)..=(end - 1).div_euclid(BLOCK))
                .filter(|block| block.rem_euclid(2) == parity)
                .map(|block| {
                    [(block * BLOCK).max(from), ((block + 1) * BLOCK).min(end)].map(|edge| (edge - from) as usize)
                })
                .collect()
        };
        for turn in (0..4 * i64::from(sweeps)).map(|turn| turn % 4) {
            let (columns, rows) = (cut(origin[0], width, turn % 2), cut(origin[1], height, turn / 2));
            let blocks: Vec<([usize; 2], [usize; 2])> =
                rows.iter().flat_map(|&y| columns.iter().map(move |&x| (x, y))).collect();
            let whole = Whole { open: &open, error: &error, unit, width };
            let changed: Vec<Changed> = blocks.par_iter().map(|&(x, y)| self.block(&whole, x, y)).collect();
            for Changed { block: [x, y], open: bits, around: [ax, ay], error: near } in changed {
                for (row, line) in (y[0]..y[1]).zip(bits.chunks_exact(x[1] - x[0])) {
                    open[row * width..][x[0]..x[1]].copy_from_slice(line);
                }
                for (row, line) in (ay[0]..ay[1]).zip(near.chunks_exact(ax[1] - ax[0])) {
                    error[row * width..][ax[0]..ax[1]].copy_from_slice(line);
                }
            }
        }
        open
    }

    /// One sweep over a block.
    fn block(&self, whole: &Whole<'_>, x: [usize; 2], y: [usize; 2]) -> Changed {
        let &Whole { open, error, unit, width } = whole;
        let height = open.len() / width;
        let [across, down] = self.reach();
        let ax = [x[0].saturating_sub(across), (x[1] + across).min(width)];
        let ay = [y[0].saturating_sub(down), (y[1] + down).min(height)];
        let wide = ax[1] - ax[0];
        let mut bits: Vec<f32> = (y[0]..y[1]).flat_map(|row| &open[row * width..][x[0]..x[1]]).copied().collect();
        let mut near: Vec<Complex32> =
            (ay[0]..ay[1]).flat_map(|row| &error[row * width..][ax[0]..ax[1]]).copied().collect();
        let mut wave = vec![Complex32::default(); 2 * across + 1];
        for row in y[0]..y[1] {
            for column in x[0]..x[1] {
                let bit = &mut bits[(row - y[0]) * (x[1] - x[0]) + column - x[0]];
                let change = 1.0 - 2.0 * *bit;
                let s = unit[row * width + column];
                let e = near[(row - ay[0]) * wide + column - ax[0]];
                if 2.0 * change * (e.re * s.re + e.im * s.im) + 1.0 >= 0.0 {
                    continue;
                }
                *bit += change;
                wave.iter_mut().zip(&self.taps[0]).for_each(|(u, &h)| *u = s * (change * h));
                let (left, right) = (column.saturating_sub(across).max(ax[0]), (column + across + 1).min(ax[1]));
                let (top, bottom) = (row.saturating_sub(down).max(ay[0]), (row + down + 1).min(ay[1]));
                let wave = &wave[left + across - column..];
                for (line, &h) in near[(top - ay[0]) * wide..(bottom - ay[0]) * wide]
                    .chunks_exact_mut(wide)
                    .zip(&self.taps[1][top + down - row..])
                {
                    for (u, w) in line[left - ax[0]..right - ax[0]].iter_mut().zip(wave) {
                        *u += w * h;
                    }
                }
            }
        }
        Changed { block: [x, y], open: bits, around: [ax, ay], error: near }
    }
}

/// What a sweep begins with.
struct Whole<'a> {
    open: &'a [f32],
    error: &'a [Complex32],
    unit: &'a [Complex32],
    width: usize,
}

/// What a block became, and the error around it.
struct Changed {
    block: [[usize; 2]; 2],
    open: Vec<f32>,
    around: [[usize; 2]; 2],
    error: Vec<Complex32>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;
    use crate::random::Random;

    /// Wishes and a carrier of a third of a turn a pixel.
    fn case(width: usize, height: usize) -> (Vec<f32>, Vec<Complex32>) {
        let mut random = Random::new(5, 1);
        let wishes = (0..width * height).map(|_| 0.2 + 0.6 * random.uniform_f32()).collect();
        let unit = (0..width * height).map(|i| Complex32::from_polar(1.0, 2.1 * (i % width) as f32)).collect();
        (wishes, unit)
    }

    /// E by the double sum, in f64.
    fn noise(kernel: &BandKernel, open: &[f32], wishes: &[f32], unit: &[Complex32], width: usize) -> f64 {
        let d = |i: usize| {
            let s = Complex64::new(f64::from(unit[i].re), f64::from(unit[i].im));
            s * f64::from(open[i] - wishes[i])
        };
        let tap = |axis: usize, a: usize, b: usize| {
            let lag = a.abs_diff(b);
            let taps = &kernel.taps[axis];
            taps.get(taps.len() / 2 + lag).map_or(0.0, |&h| f64::from(h))
        };
        let pair = |i: usize, j: usize| tap(0, i % width, j % width) * tap(1, i / width, j / width);
        (0..open.len())
            .flat_map(|i| (0..open.len()).map(move |j| (i, j)))
            .filter(|&(i, j)| pair(i, j) != 0.0)
            .map(|(i, j)| pair(i, j) * (d(i).conj() * d(j)).re)
            .sum()
    }

    #[test]
    fn a_search_ends_where_no_pixel_lowers_the_noise() {
        let (width, height) = (40, 24);
        let (wishes, unit) = case(width, height);
        let kernel = BandKernel::new([0.15, 0.2]);
        let begun = kernel.search(&wishes, &unit, width, [100, -7], 0);
        assert!(begun.iter().zip(&wishes).all(|(q, t)| (*q == 1.0) == (*t > 0.5)));
        let mut open = kernel.search(&wishes, &unit, width, [100, -7], 60);
        let least = noise(&kernel, &open, &wishes, &unit, width);
        let first = noise(&kernel, &begun, &wishes, &unit, width);
        assert!(least < 0.3 * first, "{least} of {first}");
        for at in (0..open.len()).step_by(37) {
            open[at] = 1.0 - open[at];
            let turned = noise(&kernel, &open, &wishes, &unit, width);
            assert!(turned > least - 1e-3, "pixel {at}: {turned} below {least}");
            open[at] = 1.0 - open[at];
        }
    }

    #[test]
    fn kernels_are_even_and_their_spectra_positive_and_within_the_band() {
        for half in [0.05, 0.16, 0.3] {
            let taps = taps(half);
            let middle = (taps.len() / 2) as i64;
            assert!(taps.len() / 2 <= REACH && (taps[middle as usize] - 1.0).abs() < 1e-6);
            assert!(taps.iter().eq(taps.iter().rev()));
            let spectrum = |f: f64| -> f64 {
                taps.iter().zip(-middle..).map(|(&h, x)| f64::from(h) * (2.0 * PI * f * x as f64).cos()).sum()
            };
            assert!((0..=100).all(|i| spectrum(0.005 * f64::from(i)) > -1e-4));
            assert!(
                spectrum(0.4 * half) > 0.8 * spectrum(0.0) && spectrum(2.0 * half) < 0.02 * spectrum(0.0),
                "{half}"
            );
        }
    }
}
