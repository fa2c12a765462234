//! exp(i2πt) of many phases at once.

use super::Complex32;
use std::f32::consts::TAU;

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
}
