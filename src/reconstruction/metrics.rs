//! How good a picture is: PSNR, SSIM, speckle contrast, uniformity; how good a field: its normalised error.

use super::{Picture, Scale};
use crate::field::{Complex32, Complex64};

/// Peak signal-to-noise ratio of values in [0, 1]: −10·log₁₀(mean squared difference) [dB]; infinite when equal.
///
/// # Panics
/// When their sizes differ, as all comparisons here do.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of one size are compared");
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    -10.0 * (sum / a.len() as f64).log10()
}

/// Mean structural similarity of values in [0, 1]: Gaussian window of 11 × 11, σ = 1.5, K₁ = 0.01, K₂ = 0.03, over
/// the windows that lie wholly inside (Wang, Bovik, Sheikh & Simoncelli, *IEEE Trans. Image Processing* 13 (2004),
/// eq. 13). Pictures smaller than the window give the value of one window over all of them.
///
/// # Panics
/// When `a` or `b` has not `width × height` values.
pub fn ssim(a: &[f32], b: &[f32], width: usize, height: usize) -> f64 {
    let windows = ssim_windows(a, b, width, height);
    windows.iter().sum::<f64>() / windows.len() as f64
}

/// Structural similarity in each of [`ssim`]'s windows, row-major by their places.
pub(super) fn ssim_windows(a: &[f32], b: &[f32], width: usize, height: usize) -> Vec<f64> {
    assert!(a.len() == b.len() && a.len() == width * height, "pictures of one size are compared");
    let (c1, c2) = (0.01f64.powi(2), 0.03f64.powi(2));
    let product =
        |p: &[f32], q: &[f32]| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| f64::from(*p) * f64::from(*q)).collect() };
    let wide = |p: &[f32]| -> Vec<f64> { p.iter().map(|v| f64::from(*v)).collect() };
    let [ma, mb, aa, bb, ab] =
        [wide(a), wide(b), product(a, a), product(b, b), product(a, b)].map(|v| blurred(&v, width, height));
    let window = |i: usize| {
        let (va, vb, cov) = (aa[i] - ma[i] * ma[i], bb[i] - mb[i] * mb[i], ab[i] - ma[i] * mb[i]);
        ((2.0 * ma[i] * mb[i] + c1) * (2.0 * cov + c2)) / ((ma[i] * ma[i] + mb[i] * mb[i] + c1) * (va + vb + c2))
    };
    (0..ma.len()).map(window).collect()
}

/// Gaussian means over the windows that lie inside.
fn blurred(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let kernel = |side: usize| -> Vec<f64> {
        let n = side.min(11);
        let middle = (n as f64 - 1.0) * 0.5;
        let weights: Vec<f64> = (0..n).map(|i| (-(i as f64 - middle).powi(2) / (2.0 * 1.5 * 1.5)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.into_iter().map(|w| w / sum).collect()
    };
    let (kx, ky) = (kernel(width), kernel(height));
    let out_width = width + 1 - kx.len();
    let rows: Vec<f64> = (0..height)
        .flat_map(|r| {
            let row = &values[r * width..(r + 1) * width];
            row.windows(kx.len()).map(|w| w.iter().zip(&kx).map(|(v, k)| v * k).sum()).collect::<Vec<f64>>()
        })
        .collect();
    (0..height + 1 - ky.len())
        .flat_map(|r| {
            let (rows, ky) = (&rows, &ky);
            (0..out_width).map(move |c| ky.iter().enumerate().map(|(i, k)| k * rows[(r + i) * out_width + c]).sum())
        })
        .collect()
}

/// Figures of a reconstruction against the picture that it should show; all simulated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Likeness {
    /// PSNR of the sRGB-coded pictures [dB].
    pub psnr: f64,
    /// SSIM of the sRGB-coded pictures.
    pub ssim: f64,
    /// PSNR after both are averaged over 5 × 5 blocks in linear light [dB]: what is left when speckle is averaged out.
    pub psnr_blocks: f64,
    /// Factor by which the reconstruction was multiplied: least squares in linear light.
    pub gain: f64,
}

/// The factor by which a reconstruction is most like its target, in least squares; white is `white`.
pub(super) fn gain(seen: &Picture, target: &Picture, white: f32) -> f64 {
    least_squares(seen.values.iter(), target.values.iter(), white)
}

/// The gain of values against targets. Those beyond white are shown as white; they must not decide it.
pub(super) fn least_squares<'a>(
    seen: impl Iterator<Item = &'a f32> + Clone,
    target: impl Iterator<Item = &'a f32>,
    white: f32,
) -> f64 {
    let norm: f64 = seen.clone().map(|v| f64::from(*v).powi(2)).sum();
    let product: f64 = seen.zip(target).map(|(a, b)| f64::from(*a) * f64::from(b.min(white))).sum();
    if norm > 0.0 { product / norm } else { 0.0 }
}

/// Compares a reconstruction with its target, both linear, after one least-squares gain; white is `white`.
///
/// # Panics
/// When their sizes differ.
pub fn likeness(seen: &Picture, target: &Picture, white: f32) -> Likeness {
    assert!(seen.width == target.width && seen.height == target.height, "pictures of one size are compared");
    let gain = gain(seen, target, white);
    let scaled = Picture { values: seen.values.iter().map(|v| (f64::from(*v) * gain) as f32).collect(), ..*seen };
    let scale = Scale::White(white);
    let (a, b) = (scaled.coded(scale), target.coded(scale));
    let (ba, bb) = (blocks(&scaled, 5).coded(scale), blocks(target, 5).coded(scale));
    Likeness { psnr: psnr(&a, &b), ssim: ssim(&a, &b, seen.width, seen.height), psnr_blocks: psnr(&ba, &bb), gain }
}

/// Means over `side × side` blocks; an incomplete rim is left out.
pub fn blocks(picture: &Picture, side: usize) -> Picture {
    let (width, height) = ((picture.width / side).max(1), (picture.height / side).max(1));
    let values = (0..width * height)
        .map(|i| {
            let (c0, r0) = (i % width * side, i / width * side);
            let (c1, r1) = ((c0 + side).min(picture.width), (r0 + side).min(picture.height));
            let sum: f32 = (r0..r1).flat_map(|r| &picture.values[r * picture.width + c0..r * picture.width + c1]).sum();
            sum / ((c1 - c0) * (r1 - r0)) as f32
        })
        .collect();
    Picture { width, height, values }
}

/// Speckle contrast σ/μ of intensities that should be equal; 1 is fully developed speckle.
pub fn speckle_contrast(values: &[f32]) -> f64 {
    let count = values.len() as f64;
    let mean: f64 = values.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
    let variance: f64 = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / count;
    if mean > 0.0 { variance.sqrt() / mean } else { 0.0 }
}

/// Uniformity 1 − (max − min)/(max + min) of intensities that should be equal; 1 where they are (Di Leonardo, Ianni & Ruocco,
/// *Optics Express* 15, 1913 (2007)).
pub fn uniformity(values: &[f32]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v.into()), h.max(v.into())));
    if high + low > 0.0 { 1.0 - (high - low) / (high + low) } else { 0.0 }
}

/// Normalised squared error of a wave field, min over complex factors c of Σ|c·seen − wanted|²/Σ|wanted|²; 0 … 1.
///
/// A piston and the brightness are taken out by c; what is left is wrong in amplitude or phase somewhere.
///
/// # Panics
/// When their sizes differ.
pub fn field_error(seen: &[Complex32], wanted: &[Complex32]) -> f64 {
    assert_eq!(seen.len(), wanted.len(), "fields of one size are compared");
    let wide = |u: &Complex32| Complex64::new(u.re.into(), u.im.into());
    let (mut cross, mut own, mut norm) = (Complex64::new(0.0, 0.0), 0.0, 0.0);
    for (g, u) in seen.iter().zip(wanted) {
        let (g, u) = (wide(g), wide(u));
        cross += g.conj() * u;
        own += g.norm_sqr();
        norm += u.norm_sqr();
    }
    if own > 0.0 && norm > 0.0 { (1.0 - cross.norm_sqr() / (own * norm)).max(0.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn psnr_and_ssim_of_known_pairs() {
        let a = vec![0.5f32; 400];
        let b = vec![0.6f32; 400];
        assert!((psnr(&a, &b) - 20.0).abs() < 1e-4);
        assert!(psnr(&a, &a).is_infinite());
        assert!((ssim(&a, &a, 20, 20) - 1.0).abs() < 1e-12);
        // Constant pictures differ in luminance only: (2μaμb + c1)/(μa² + μb² + c1).
        let expected = (2.0 * 0.5 * 0.6 + 1e-4) / (0.25 + 0.36 + 1e-4);
        assert!((ssim(&a, &b, 20, 20) - expected).abs() < 1e-6);
        let mut random = Random::new(5, 0);
        let noise: Vec<f32> = (0..400).map(|_| random.uniform_f32()).collect();
        let other: Vec<f32> = (0..400).map(|_| random.uniform_f32()).collect();
        assert!(ssim(&noise, &other, 20, 20) < 0.3);
        let inverted: Vec<f32> = noise.iter().map(|v| 1.0 - v).collect();
        assert!(ssim(&noise, &inverted, 20, 20) < 0.0);
    }

    #[test]
    fn uniformity_and_field_error_of_known_values() {
        assert!((uniformity(&[2.0; 9]) - 1.0).abs() < 1e-12);
        assert!((uniformity(&[1.0, 3.0]) - 0.5).abs() < 1e-12);
        let wanted: Vec<Complex32> =
            (0..100).map(|i| Complex32::from_polar(1.0 + 0.01 * i as f32, 0.3 * i as f32)).collect();
        let turned: Vec<Complex32> = wanted.iter().map(|u| u * Complex32::from_polar(0.2, 1.1)).collect();
        assert!(field_error(&turned, &wanted) < 1e-6);
        // Half of the samples of the wrong sign, in pairs of equal modulus: nothing is left in common.
        let pairs: Vec<Complex32> = (0..100).map(|i| wanted[i / 2]).collect();
        let half: Vec<Complex32> = pairs.iter().enumerate().map(|(i, u)| if i % 2 == 0 { *u } else { -u }).collect();
        assert!((field_error(&half, &pairs) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn gain_is_found_and_speckle_is_one_for_random_waves() {
        let target = Picture { width: 30, height: 20, values: (0..600).map(|i| (i % 37) as f32 / 37.0).collect() };
        let seen = Picture { values: target.values.iter().map(|v| v * 0.02).collect(), ..target.clone() };
        let found = likeness(&seen, &target, 1.0);
        assert!((found.gain - 50.0).abs() < 1e-3 && found.psnr > 100.0, "{found:?}");
        // Intensity of a sum of many random phasors is exponentially distributed: σ/μ = 1 (Goodman 1975). With 1e5
        // values the estimate scatters by √(2/1e5) ≈ 0.45 %, so 2 % is beyond four of those.
        let mut random = Random::new(9, 1);
        let speckle: Vec<f32> = (0..100_000).map(|_| -(1.0 - random.uniform()).ln() as f32).collect();
        assert!((speckle_contrast(&speckle) - 1.0).abs() < 0.02);
    }
}
