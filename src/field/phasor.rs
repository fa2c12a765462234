//! exp(i2πt) of many phases, and phases of many values, at once.

use super::Complex32;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// exp(i2πt) to 2e-6 of what `turns` say, |t| below 10⁶: of the nearest quarter's rest by Taylor's series, turned by the quarters.
/// Without branches, so that loops make several at once.
#[inline(always)]
pub(crate) fn phasor(turns: f32) -> Complex32 {
    // The nearest whole number, by the digits that a large one leaves; the sum's last digits count the quarters.
    const ROUND: f32 = 1.5 * (1 << 23) as f32;
    let rounded = 4.0 * turns + ROUND;
    let x = (turns - 0.25 * (rounded - ROUND)) * TAU;
    let s = x * x;
    let sin = x * (1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0))));
    let cos = 1.0 + s * (-0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0))));
    let quarter = rounded.to_bits();
    let is_odd = quarter & 1 != 0;
    let (re, im) = (if is_odd { sin } else { cos }, if is_odd { cos } else { sin });
    let sign = |minus: u32| (minus & 2) << 30;
    Complex32::new(
        f32::from_bits(re.to_bits() ^ sign(quarter.wrapping_add(1))),
        f32::from_bits(im.to_bits() ^ sign(quarter)),
    )
}

/// Phase of a value [rad], −π to π, to 1e-6: the arc tangent of the smaller part over the larger one by a polynomial that is off
/// by no more than 3.3e-7 anywhere (fitted for the least largest error). Zero for zero; without branches, as [`phasor`].
#[inline(always)]
pub(crate) fn angle(value: Complex32) -> f32 {
    const C: [f32; 7] =
        [0.999_996_1, -0.333_173_7, 0.198_078_15, -0.132_333_39, 0.079_623_6, -0.033_604_15, 0.006_811_769];
    let (x, y) = (value.re.abs(), value.im.abs());
    let (low, high) = (x.min(y), x.max(y));
    // Zero over what is hardly more than nothing is zero.
    let t = low / high.max(f32::MIN_POSITIVE);
    let s = t * t;
    let within = t * (C[0] + s * (C[1] + s * (C[2] + s * (C[3] + s * (C[4] + s * (C[5] + s * C[6]))))));
    let steep = if y > x { FRAC_PI_2 - within } else { within };
    let turned = if value.re < 0.0 { PI - steep } else { steep };
    turned.copysign(value.im)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;

    #[test]
    fn phasors_are_those_of_their_turns() {
        let all = (0..4000).map(|i| (i as f32 - 2000.0) * 0.0625 + 1e-3 * (i % 7) as f32);
        for turns in all.chain([0.0, 0.1, -0.374, 12.26, -401.7, 0.125, -0.125, 3e4 + 0.25, -9e5]) {
            let exact = Complex64::cis(std::f64::consts::TAU * f64::from(turns));
            let found = phasor(turns);
            let error = (f64::from(found.re) - exact.re).hypot(f64::from(found.im) - exact.im);
            assert!(error < 2e-6, "{turns}: {found}");
        }
    }

    #[test]
    fn angles_are_those_of_their_values() {
        for i in 0..20_000 {
            let (turn, size) = (f64::from(i) * 1e-4 - 1.0, 10f64.powi(i % 60 - 30));
            let exact = Complex64::from_polar(size, std::f64::consts::PI * turn * 0.999_999);
            let value = Complex32::new(exact.re as f32, exact.im as f32);
            let error = f64::from(angle(value)) - f64::from(value.im).atan2(f64::from(value.re));
            assert!(error.abs() < 1e-6, "{value}: {} by {error}", angle(value));
        }
        let of = |re: f32, im: f32| angle(Complex32::new(re, im));
        assert_eq!(
            [of(0.0, 0.0), of(1.0, 0.0), of(-1.0, 0.0), of(0.0, 2.0), of(0.0, -2.0)],
            [0.0, 0.0, PI, FRAC_PI_2, -FRAC_PI_2]
        );
    }
}
