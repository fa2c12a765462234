//! The two precisions of the exact sum, and the functions that both need.
//!
//! All are plain scalars without a branch or a call, so that a loop over them is compiled to vectors of whatever width there
//! is. What keeps a loop from it: `array::map` and `array::from_fn`, inclusive ranges, slices of terms of unknown length.

use crate::field::Complex64;
use std::f64::consts::{LN_2, LOG2_E, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A float that the taper and the wave are computed in; paths are always in double precision.
pub(super) trait Real:
    Copy
    + PartialOrd
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Zero, and one.
    const ZERO: Self;
    const ONE: Self;
    /// v² over 1 + q² from which on the taper is flat: e^{−FLAT} is below the precision of the sum.
    const FLAT: Self;
    /// Terms of the sine and the cosine, and of the exponential.
    const WAVE: u32;
    const POWER: u32;

    fn of(value: f64) -> Self;
    fn double(self) -> f64;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn round(self) -> Self;
    fn mul_add(self, by: Self, more: Self) -> Self;
    /// 2ⁿ and the rest of `x`, n the nearest integer; |x| ≤ 1000 (100 in single precision).
    fn split_power(x: Self) -> (Self, Self);
}

/// What both floats have of their own.
macro_rules! own_functions {
    () => {
        #[inline(always)]
        fn sqrt(self) -> Self {
            self.sqrt()
        }
        #[inline(always)]
        fn abs(self) -> Self {
            self.abs()
        }
        #[inline(always)]
        fn mul_add(self, by: Self, more: Self) -> Self {
            self.mul_add(by, more)
        }
    };
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const FLAT: Self = 24.0;
    const WAVE: u32 = 10;
    const POWER: u32 = 13;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn double(self) -> f64 {
        self
    }
    own_functions!();
    #[inline(always)]
    fn round(self) -> Self {
        round(self)
    }
    #[inline(always)]
    fn split_power(x: Self) -> (Self, Self) {
        let shifted = x + ROUND;
        (f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52), x - (shifted - ROUND))
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const FLAT: Self = 12.0;
    const WAVE: u32 = 5;
    const POWER: u32 = 6;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn double(self) -> f64 {
        f64::from(self)
    }
    own_functions!();
    #[inline(always)]
    fn round(self) -> Self {
        (self + ROUND_F32) - ROUND_F32
    }
    #[inline(always)]
    fn split_power(x: Self) -> (Self, Self) {
        let shifted = x + ROUND_F32;
        (f32::from_bits(shifted.to_bits().wrapping_add(127) << 23), x - (shifted - ROUND_F32))
    }
}

/// 1.5·2⁵², and 1.5·2²³: added, the nearest integer stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
const ROUND_F32: f32 = 12_582_912.0;

/// The nearest integer of |x| < 2⁵¹.
#[inline(always)]
pub(super) fn round(x: f64) -> f64 {
    (x + ROUND) - ROUND
}

/// The smaller and the larger of two numbers, in the one instruction that there is for it.
#[inline(always)]
pub(super) fn least<T: Real>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn most<T: Real>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// a·b + c, in one rounding where the instruction set has it: without, it would be a call.
#[inline(always)]
pub(super) fn fused<T: Real, const FMA: bool>(a: T, b: T, c: T) -> T {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// (a + ib)·(c + id).
#[inline(always)]
pub(super) fn product<T: Real, const FMA: bool>([a, b]: [T; 2], [c, d]: [T; 2]) -> [T; 2] {
    [fused::<T, FMA>(a, c, -(b * d)), fused::<T, FMA>(a, d, b * c)]
}

/// e^{−x}; 1 below 0, and as at 700 (80 in single precision) beyond.
#[inline(always)]
pub(super) fn exp_minus<T: Real, const FMA: bool>(x: T) -> T {
    let x = least(most(x, T::ZERO), T::of(if T::POWER > 10 { 700.0 } else { 80.0 }));
    let (power, rest) = T::split_power(-x * T::of(LOG2_E));
    let f = rest * T::of(LN_2);
    let mut sum = T::ONE;
    for n in (1..T::POWER + 1).rev() {
        sum = fused::<T, FMA>(sum * f, T::of(1.0 / f64::from(n)), T::ONE);
    }
    power * sum
}

/// exp(i2πt) for |t| ≤ ½ turns: Taylor about the nearest half turn, of at most a quarter turn.
#[inline(always)]
pub(super) fn turned<T: Real, const FMA: bool>(t: T) -> [T; 2] {
    let half = (t + t).round();
    let side = T::ONE - T::of(2.0) * half.abs();
    let x = (t - T::of(0.5) * half) * T::of(TAU);
    let square = x * x;
    let (mut sin, mut cos) = (T::ONE, T::ONE);
    for n in (1..T::WAVE + 1).rev() {
        let (s, c) = (1.0 / f64::from(2 * n * (2 * n + 1)), 1.0 / f64::from(2 * n * (2 * n - 1)));
        sin = fused::<T, FMA>(sin * square, T::of(-s), T::ONE);
        cos = fused::<T, FMA>(cos * square, T::of(-c), T::ONE);
    }
    [cos * side, sin * x * side]
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
    cis_into::<false>(turns, &mut out);
    out
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn cis_avx2(turns: &[f64], out: &mut [Complex64]) {
    cis_into::<true>(turns, out);
}

#[inline(always)]
fn cis_into<const FMA: bool>(turns: &[f64], out: &mut [Complex64]) {
    for (t, out) in turns.iter().zip(out) {
        let [re, im] = turned::<f64, FMA>(t - round(*t));
        *out = Complex64::new(re, im);
    }
}
