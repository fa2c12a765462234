//! Far points at one pixel: the definition's far form with its cross term, eight points at a time in double precision.
//!
//! Plain loops over eight values, compiled for the instruction sets there are; all give the oracle's values to 1e-10.

use crate::field::Complex64;
use crate::hologram::Cull;
use crate::hologram::definition::{Optics, TERMS, series};
use crate::hologram::sources::PointWave;
use std::f64::consts::{PI, TAU};

/// Points that are computed together.
const LANES: usize = 8;

/// A value for each of them.
type Lanes = [f64; LANES];

/// v² over 1 + q² from which on the taper is flat: e^{−40} = 4e-18.
const FLAT: f64 = 40.0;

/// What is the same for all points.
pub(super) struct Waves {
    cull: Cull,
    wavelength: f64,
    inverse: f64,
    /// b·λ and 1/(s·λ): the taper by the sine of the angle.
    middle: [f64; 2],
    steepness: [f64; 2],
    /// q·r on the axis.
    blur: [f64; 2],
    /// Slope of the cone, for the hard cut.
    cone: [f64; 2],
    /// s·λ.
    width: [f64; 2],
}

/// Complex values.
#[derive(Clone, Copy)]
struct Pair {
    re: Lanes,
    im: Lanes,
}

impl Waves {
    pub(super) fn new(optics: &Optics, cull: Cull) -> Self {
        let taper = optics.taper;
        let width = taper.map(|taper| taper.width * optics.wavelength);
        Self {
            cull,
            wavelength: optics.wavelength,
            inverse: 1.0 / optics.wavelength,
            middle: taper.map(|taper| taper.middle * optics.wavelength),
            steepness: width.map(|width| 1.0 / width),
            blur: taper.map(|taper| 1.0 / (PI * optics.wavelength * taper.width * taper.width)),
            cone: [0, 1].map(|axis| optics.cone(axis, 1.0)),
            width,
        }
    }

    /// The field of points at one place [m].
    pub(super) fn sum(&self, points: &[PointWave], at: [f64; 2]) -> Complex64 {
        #[cfg(target_arch = "x86_64")]
        {
            let fma = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") && fma {
                // SAFETY: the features were detected.
                return unsafe { sum_avx512(self, points, at) };
            }
            if fma {
                // SAFETY: the features were detected.
                return unsafe { sum_avx2(self, points, at) };
            }
        }
        sum(self, points, at)
    }
}

/// exp(i2πt) of turns of any size.
pub(super) fn cis(turns: &[f64]) -> Vec<Complex64> {
    let mut out = vec![Complex64::default(); turns.len()];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the features were detected.
        unsafe { cis_avx2(turns, &mut out) };
        return out;
    }
    cis_into(turns, &mut out);
    out
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn cis_avx2(turns: &[f64], out: &mut [Complex64]) {
    cis_into(turns, out);
}

#[inline(always)]
fn cis_into(turns: &[f64], out: &mut [Complex64]) {
    for (turns, out) in turns.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let t = each(|i| turns.get(i).map_or(0.0, |t| t - t.round()));
        let waves = turned(t);
        out.iter_mut().enumerate().for_each(|(i, out)| *out = Complex64::new(waves.re[i], waves.im[i]));
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
unsafe fn sum_avx512(waves: &Waves, points: &[PointWave], at: [f64; 2]) -> Complex64 {
    sum(waves, points, at)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn sum_avx2(waves: &Waves, points: &[PointWave], at: [f64; 2]) -> Complex64 {
    sum(waves, points, at)
}

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> Lanes {
    std::array::from_fn(f)
}

#[inline(always)]
fn sum(waves: &Waves, points: &[PointWave], at: [f64; 2]) -> Complex64 {
    let mut total = Pair { re: [0.0; LANES], im: [0.0; LANES] };
    let dark = PointWave { x: at[0], y: at[1], distance: 1.0, sign: 1.0, amplitude: 0.0, turns: 0.0 };
    for chunk in points.chunks(LANES) {
        let p: [PointWave; LANES] = std::array::from_fn(|i| chunk.get(i).copied().unwrap_or(dark));
        let d = [each(|i| at[0] - p[i].x), each(|i| at[1] - p[i].y)];
        let r = each(|i| (d[0][i] * d[0][i] + d[1][i] * d[1][i] + p[i].distance * p[i].distance).sqrt());
        let over = each(|i| 1.0 / r[i]);
        let limited = match waves.cull {
            Cull::Soft => {
                let Some(limited) = tapered(waves, d, over) else { continue };
                limited
            }
            Cull::Hard => {
                let inside = |i: usize| (0..2).all(|axis| d[axis][i].abs() <= waves.cone[axis] * p[i].distance);
                let re = each(|i| if inside(i) { over[i].min(waves.inverse) } else { 0.0 });
                Pair { re, im: [0.0; LANES] }
            }
            Cull::None => Pair { re: each(|i| over[i].min(waves.inverse)), im: [0.0; LANES] },
        };
        // A converging wave is the conjugate of a diverging one; the phase φ is not conjugated.
        let turns = each(|i| {
            let path = r[i] * waves.inverse;
            let all = p[i].sign * (path - path.round()) + p[i].turns;
            all - all.round()
        });
        let wave = turned(turns);
        for (i, point) in p.iter().enumerate() {
            let (a, b) = (point.amplitude * limited.re[i], point.amplitude * point.sign * limited.im[i]);
            total.re[i] += a * wave.re[i] - b * wave.im[i];
            total.im[i] += a * wave.im[i] + b * wave.re[i];
        }
    }
    Complex64::new(total.re.iter().sum(), total.im.iter().sum())
}

/// [T·T + i λ f_x f_y/(2πr)·T′·T′]/r; `None` where all of it is dark.
#[inline(always)]
fn tapered(waves: &Waves, d: [Lanes; 2], over: Lanes) -> Option<Pair> {
    let sine = [0, 1].map(|axis: usize| each(|i| d[axis][i].abs() * over[i]));
    let v = [0, 1].map(|axis: usize| each(|i| (sine[axis][i] - waves.middle[axis]) * waves.steepness[axis]));
    let q = [0, 1].map(|axis: usize| each(|i| (1.0 - sine[axis][i] * sine[axis][i]) * waves.blur[axis] * over[i]));
    let is_edge = |axis: usize, i: usize| v[axis][i] * v[axis][i] <= FLAT * (1.0 + q[axis][i] * q[axis][i]);
    let (mut lit, mut edges) = (false, [false; 2]);
    for (i, (&x, &y)) in v[0].iter().zip(&v[1]).enumerate() {
        let edge = [is_edge(0, i), is_edge(1, i)];
        let here = (edge[0] || x < 0.0) && (edge[1] || y < 0.0);
        lit |= here;
        edges = [edges[0] | (edge[0] & here), edges[1] | (edge[1] & here)];
    }
    if !lit {
        return None;
    }
    let flat = |axis: usize| {
        let step = Pair { re: each(|i| f64::from(u8::from(v[axis][i] < 0.0))), im: [0.0; LANES] };
        (step, Pair { re: [0.0; LANES], im: [0.0; LANES] })
    };
    let axes = [0, 1].map(|axis: usize| {
        let (step, none) = flat(axis);
        if !edges[axis] {
            return (step, none);
        }
        let (t, slope) = edge(v[axis], q[axis], waves.width[axis]);
        let chosen = |edge: Lanes, flat: Lanes| each(|i| if is_edge(axis, i) { edge[i] } else { flat[i] });
        let t = Pair { re: chosen(t.re, step.re), im: chosen(t.im, step.im) };
        (t, Pair { re: chosen(slope.re, none.re), im: chosen(slope.im, none.im) })
    });
    let [(tx, ex), (ty, ey)] = axes;
    // With T′ by the sine instead of the frequency, λ f_x f_y/2πr is λ s_x s_y/2πr.
    let cross = each(|i| waves.wavelength * sine[0][i] * sine[1][i] * over[i] / TAU);
    let re = each(|i| {
        let product = tx.re[i] * ty.re[i] - tx.im[i] * ty.im[i];
        (product - cross[i] * (ex.re[i] * ey.im[i] + ex.im[i] * ey.re[i])) * over[i]
    });
    let im = each(|i| {
        let product = tx.re[i] * ty.im[i] + tx.im[i] * ty.re[i];
        (product + cross[i] * (ex.re[i] * ey.re[i] - ex.im[i] * ey.im[i])) * over[i]
    });
    Some(Pair { re, im })
}

/// T and its slope by the sine's modulus, of a diverging wave.
#[inline(always)]
fn edge(v: Lanes, q: Lanes, width: f64) -> (Pair, Pair) {
    let (scale, terms): (f64, &[f64; TERMS]) = series();
    // 1/√(1 − iq) = (re + iq/2re)/√(1 + q²).
    let modulus = each(|i| (1.0 + q[i] * q[i]).sqrt());
    let root = each(|i| (0.5 * (modulus[i] + 1.0)).sqrt());
    let inverse = Pair { re: each(|i| root[i] / modulus[i]), im: each(|i| 0.5 * q[i] / (root[i] * modulus[i])) };
    let z = Pair { re: each(|i| v[i].abs() * inverse.re[i]), im: each(|i| v[i].abs() * inverse.im[i]) };
    let fall = each(|i| exp_minus(z.re[i] * z.re[i] - z.im[i] * z.im[i]));
    let wave = turned(each(|i| {
        let turns = -2.0 * z.re[i] * z.im[i] / TAU;
        turns - turns.round()
    }));
    let gauss = Pair { re: each(|i| fall[i] * wave.re[i]), im: each(|i| fall[i] * wave.im[i]) };
    // Weideman's series in Z = (L − z)/(L + z).
    let norm = each(|i| 1.0 / ((scale + z.re[i]) * (scale + z.re[i]) + z.im[i] * z.im[i]));
    let outer = Pair { re: each(|i| (scale + z.re[i]) * norm[i]), im: each(|i| -z.im[i] * norm[i]) };
    let ratio = Pair {
        re: each(|i| (scale - z.re[i]) * outer.re[i] + z.im[i] * outer.im[i]),
        im: each(|i| (scale - z.re[i]) * outer.im[i] - z.im[i] * outer.re[i]),
    };
    let mut sum = Pair { re: [0.0; LANES], im: [0.0; LANES] };
    for term in terms.iter().rev() {
        let re = each(|i| sum.re[i] * ratio.re[i] - sum.im[i] * ratio.im[i] + term);
        let im = each(|i| sum.re[i] * ratio.im[i] + sum.im[i] * ratio.re[i]);
        sum = Pair { re, im };
    }
    // erfc(z) = e^{−z²}·outer·(2·outer·sum + 1/√π), and 2 − erfc(−z) on the other side.
    let inner = Pair {
        re: each(|i| 2.0 * (outer.re[i] * sum.re[i] - outer.im[i] * sum.im[i]) + 1.0 / PI.sqrt()),
        im: each(|i| 2.0 * (outer.re[i] * sum.im[i] + outer.im[i] * sum.re[i])),
    };
    let series = Pair {
        re: each(|i| outer.re[i] * inner.re[i] - outer.im[i] * inner.im[i]),
        im: each(|i| outer.re[i] * inner.im[i] + outer.im[i] * inner.re[i]),
    };
    let half = Pair {
        re: each(|i| 0.5 * (gauss.re[i] * series.re[i] - gauss.im[i] * series.im[i])),
        im: each(|i| 0.5 * (gauss.re[i] * series.im[i] + gauss.im[i] * series.re[i])),
    };
    let t = Pair {
        re: each(|i| if v[i] < 0.0 { 1.0 - half.re[i] } else { half.re[i] }),
        im: each(|i| if v[i] < 0.0 { -half.im[i] } else { half.im[i] }),
    };
    let by = -1.0 / (width * PI.sqrt());
    let slope = Pair {
        re: each(|i| by * (gauss.re[i] * inverse.re[i] - gauss.im[i] * inverse.im[i])),
        im: each(|i| by * (gauss.re[i] * inverse.im[i] + gauss.im[i] * inverse.re[i])),
    };
    (t, slope)
}

/// e^{−x} for 0 ≤ x ≤ 700.
#[inline(always)]
fn exp_minus(x: f64) -> f64 {
    // 1.5·2⁵²: added, the nearest integer stands in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let scaled = -x.clamp(0.0, 700.0) * std::f64::consts::LOG2_E;
    let shifted = scaled + ROUND;
    let f = (scaled - (shifted - ROUND)) * std::f64::consts::LN_2;
    let power = f64::from_bits((shifted.to_bits().wrapping_add(1023)) << 52);
    let mut sum = 1.0;
    for n in (1..14u32).rev() {
        sum = 1.0 + sum * f / f64::from(n);
    }
    power * sum
}

/// exp(i2πt) for |t| ≤ ½ turns: Taylor about the nearest half turn, to x²¹/21! of a quarter turn, 3e-16.
#[inline(always)]
fn turned(t: Lanes) -> Pair {
    let half = each(|i| (2.0 * t[i]).round());
    let side = each(|i| 1.0 - 2.0 * half[i].abs());
    let x = each(|i| (t[i] - 0.5 * half[i]) * TAU);
    let square = each(|i| x[i] * x[i]);
    let (mut sin, mut cos) = ([1.0; LANES], [1.0; LANES]);
    for n in (1..=10u32).rev() {
        let (s, c) = (1.0 / f64::from(2 * n * (2 * n + 1)), 1.0 / f64::from(2 * n * (2 * n - 1)));
        sin = each(|i| 1.0 - sin[i] * square[i] * s);
        cos = each(|i| 1.0 - cos[i] * square[i] * c);
    }
    Pair { re: each(|i| cos[i] * side[i]), im: each(|i| sin[i] * x[i] * side[i]) }
}
