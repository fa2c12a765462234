//! Factors of pairs of points in 16-bit fixed point: what [`super::integer`] multiplies.
//!
//! A vector holds sixteen indexes of two points, one in the lower and one in the upper half of each 32-bit lane, as
//! `vpdpwssd` wants them. Phases count in 2⁻¹⁶ turn, cosines and sines have [`TABLE`] for 1, and a factor of the
//! batch's largest amplitude has [`UNIT`].

use std::arch::x86_64::*;

/// 1 of the cosine's table: the sums below, all roundings against it, stay inside 16 bits.
const TABLE: f64 = 32_600.0;

/// Largest modulus of [`cos_sin`]: found by trying every phase.
pub(super) const LONGEST: f64 = TABLE + 6.0;

/// Largest multiplier of a cosine, in 2⁻¹⁵: that of the largest amplitude of a batch.
pub(super) const FULL: f64 = 5_810.0;

/// What an amplitude of 1 in units of the batch's largest becomes.
pub(super) const UNIT: f64 = TABLE * FULL / 32_768.0;

const fn table(from: usize) -> [i16; 32] {
    // One eighth of the circle, cos(2πi/32), in units of 1e-9; the rest by symmetry.
    const FIRST: [i64; 9] =
        [1_000_000_000, 980_785_280, 923_879_533, 831_469_612, 707_106_781, 555_570_233, 382_683_432, 195_090_322, 0];
    let mut values = [0i16; 32];
    let mut i = 0;
    while i < 32 {
        let at = (i + from) % 32;
        let (near, negative) = match at {
            0..=8 => (at, false),
            9..=16 => (16 - at, true),
            17..=24 => (at - 16, true),
            _ => (32 - at, false),
        };
        let value = (FIRST[near] * TABLE as i64 + 500_000_000) / 1_000_000_000;
        values[i] = if negative { -value } else { value } as i16;
        i += 1;
    }
    values
}

/// cos(2πi/32) and sin(2πi/32).
static COS: [i16; 32] = table(0);
static SIN: [i16; 32] = table(24);

/// Cosine and sine of phases in 2⁻¹⁶ turn, 1 as [`TABLE`].
///
/// The phase's upper five bits choose from a table, δ = the rest is within ±π/32: sin δ is linear in it (minimax,
/// largest error 4e-5), cos δ = 1 − δ²/2, and the sums of angles do the rest.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn cos_sin(phase: __m512i) -> (__m512i, __m512i) {
    // δ = π/32 · rest/2¹⁵, so sin δ ≈ rest·(π/32)(1 − (π/32)²/8).
    const DELTA: f64 = std::f64::consts::PI / 32.0;
    const SINE: i16 = (DELTA * (1.0 - DELTA * DELTA / 8.0) * 32_768.0 + 0.5) as i16;
    // SAFETY: thirty-two values each.
    let (cosines, sines) = unsafe { (_mm512_loadu_epi16(COS.as_ptr()), _mm512_loadu_epi16(SIN.as_ptr())) };
    let index = _mm512_srli_epi16::<11>(_mm512_add_epi16(phase, _mm512_set1_epi16(1024)));
    let (c, s) = (_mm512_permutexvar_epi16(index, cosines), _mm512_permutexvar_epi16(index, sines));
    let sine = _mm512_mulhrs_epi16(_mm512_slli_epi16::<5>(phase), _mm512_set1_epi16(SINE));
    // The upper half of the 32-bit square is δ²/2 in 2⁻¹⁵.
    let bend = _mm512_mulhi_epi16(sine, sine);
    let turned_c = _mm512_add_epi16(_mm512_mulhrs_epi16(c, bend), _mm512_mulhrs_epi16(s, sine));
    let turned_s = _mm512_sub_epi16(_mm512_mulhrs_epi16(c, sine), _mm512_mulhrs_epi16(s, bend));
    (_mm512_sub_epi16(c, turned_c), _mm512_add_epi16(s, turned_s))
}

/// The lower halves of two vectors' lanes, `a` below and `b` above.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn pair(a: __m512i, b: __m512i) -> __m512i {
    _mm512_mask_blend_epi16(0xaaaa_aaaa, a, _mm512_slli_epi32::<16>(b))
}

/// One point's wave along an axis: 2⁻¹⁶ turns at index 0 and times u, u², u³.
#[derive(Clone, Copy)]
pub(super) struct Wave(pub(super) [f32; 4]);

impl Wave {
    /// The phase at indexes `u`, in 2⁻¹⁶ turn.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw")]
    fn phase(&self, u: __m512) -> __m512i {
        let power = |n: usize| _mm512_set1_ps(self.0[n]);
        let sum = _mm512_fmadd_ps(_mm512_fmadd_ps(power(3), u, power(2)), u, power(1));
        _mm512_cvtps_epi32(_mm512_fmadd_ps(sum, u, power(0)))
    }
}

/// Multiplier of a point's cosines in 2⁻¹⁵, and what it changes by in 128 indexes times 2.
#[derive(Clone, Copy, Default)]
pub(super) struct Strength {
    value: i16,
    slope: i16,
}

impl Strength {
    /// Of an amplitude in units of the batch's largest, which grows by the part `slope` an index.
    pub(super) fn of(amplitude: f64, slope: f64) -> Self {
        // Beyond 16 bits, which no tile within an error of 1 comes to, the slope is held at the end.
        Self { value: (amplitude * FULL).round() as i16, slope: (amplitude * FULL * slope * 256.0).round() as i16 }
    }
}

/// Sixteen indexes from a tile's centre: as numbers, and in 2⁻⁷ for both points of a pair.
#[derive(Clone, Copy)]
pub(super) struct Indexes {
    pub(super) u: __m512,
    position: __m512i,
}

impl Indexes {
    /// From `first` on, which is a whole number of halves and no further than 127 from the centre.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw")]
    pub(super) fn from(first: f32) -> Self {
        let lanes: [f32; 16] = std::array::from_fn(|i| i as f32 + first);
        // SAFETY: sixteen values.
        let u = unsafe { _mm512_loadu_ps(lanes.as_ptr()) };
        let position = _mm512_cvtps_epi32(_mm512_mul_ps(u, _mm512_set1_ps(128.0)));
        Self { u, position: pair(position, position) }
    }
    /// The next sixteen.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw")]
    pub(super) fn next(self) -> Self {
        let u = _mm512_add_ps(self.u, _mm512_set1_ps(16.0));
        Self { u, position: _mm512_add_epi16(self.position, _mm512_set1_epi16(16 * 128)) }
    }
}

/// Real part, imaginary part, and their sum, of two points' factors.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn evaluate(waves: [Wave; 2], strengths: [Strength; 2], at: Indexes) -> [__m512i; 3] {
    let (c, s) = cos_sin(pair(waves[0].phase(at.u), waves[1].phase(at.u)));
    let both = |low: i16, high: i16| _mm512_set1_epi32(i32::from(high) << 16 | i32::from(low as u16));
    let [low, high] = strengths;
    // value·slope·u: the upper half of (256·value·slope)·(128·u).
    let change = _mm512_mulhrs_epi16(at.position, both(low.slope, high.slope));
    let strength = _mm512_add_epi16(both(low.value, high.value), change);
    let (re, im) = (_mm512_mulhrs_epi16(c, strength), _mm512_mulhrs_epi16(s, strength));
    [re, im, _mm512_add_epi16(re, im)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::InstructionSet;
    use std::f64::consts::TAU;

    #[target_feature(enable = "avx512f,avx512bw")]
    fn whole_circle() -> Vec<[i16; 2]> {
        let mut found = Vec::new();
        for first in (0..1 << 16).step_by(32) {
            let phases: [i16; 32] = std::array::from_fn(|i| (first + i as i32) as u16 as i16);
            let mut parts = [[0i16; 32]; 2];
            // SAFETY: thirty-two values each.
            unsafe {
                let (c, s) = cos_sin(_mm512_loadu_epi16(phases.as_ptr()));
                _mm512_storeu_epi16(parts[0].as_mut_ptr(), c);
                _mm512_storeu_epi16(parts[1].as_mut_ptr(), s);
            }
            found.extend((0..32).map(|i| [parts[0][i], parts[1][i]]));
        }
        found
    }

    #[test]
    fn every_phase_has_its_cosine_and_sine_and_none_is_longer_than_stated() {
        if !InstructionSet::available().contains(&InstructionSet::Avx512Vnni) {
            return println!("not run: this machine has no AVX-512 VNNI");
        }
        // SAFETY: the set was detected.
        let found = unsafe { whole_circle() };
        assert_eq!(found.len(), 1 << 16);
        let (mut worst, mut longest, mut squares) = (0.0f64, 0.0f64, 0.0);
        for (phase, [c, s]) in found.into_iter().enumerate() {
            let (sin, cos) = (phase as f64 / 65_536.0 * TAU).sin_cos();
            let error = (f64::from(c) - TABLE * cos).hypot(f64::from(s) - TABLE * sin);
            (worst, squares) = (worst.max(error), squares + error * error);
            longest = longest.max(f64::from(c).hypot(f64::from(s)));
        }
        let mean = (squares / 65_536.0).sqrt();
        println!("largest error {worst:.2}, mean {mean:.2}, largest modulus {longest:.1}");
        // 4e-5 of the linear sine is 1.3; five roundings of at most one half, or a truncation, are the rest.
        assert!(worst < 4.0 && mean < 1.5, "{worst} {mean}");
        assert!(longest <= LONGEST, "{longest}");
    }
}
