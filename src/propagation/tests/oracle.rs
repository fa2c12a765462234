//! The slow obvious propagation: the angular spectrum summed term by term in f64, without a fast transform.

use crate::error::{Error, Result};
use crate::field::{Complex64, Field, Grid, grid};

/// The band-limited angular spectrum of Matsushima & Shimobaba (2009) by its definition.
///
/// Input padded to input + output samples, f_x and f_y each limited to 1/(λ√((2d/L)² + 1)), on a centred output
/// window of equal pitch. Cost: O(N³) for N×N samples; for tests.
///
/// # Errors
/// [`Error::Parameter`] when the windows are not centred on one axis or the pitches differ.
pub(super) fn propagate(field: &Field<f64>, distance: f64, output: Grid) -> Result<Field<f64>> {
    let input = field.grid;
    if input.center != output.center || input.pitch_x != output.pitch_x || input.pitch_y != output.pitch_y {
        return Err(Error::parameter("output", "the oracle takes windows of one middle and one pitch"));
    }
    let wavelength = field.wavelength;
    let padded = Grid::new(input.width + output.width, input.height + output.height, input.pitch_x, input.pitch_y)?;
    // The wave of frequency f reaches the offset X = d·λf/√(1 − λ²f²).
    let inside = |axis: usize, f: f64| {
        let length = [padded.extent_x(), padded.extent_y()];
        f64::from(u8::from(f.abs() <= 1.0 / (wavelength * (2.0 * distance / length[axis]).hypot(1.0))))
    };
    Ok(onto(field, distance, output, [padded.width, padded.height], inside))
}

/// The same onto a window of any pitch and middle, with the given numbers of frequencies, spaced by 1/(number × input
/// pitch), of which each has a weight along x (axis 0) and y (axis 1).
pub(super) fn onto(
    field: &Field<f64>,
    distance: f64,
    output: Grid,
    [width, height]: [usize; 2],
    weight: impl Fn(usize, f64) -> f64,
) -> Field<f64> {
    let input = field.grid;
    let wavelength = field.wavelength;
    let tau = std::f64::consts::TAU;
    let frequencies = |axis: usize, count: usize, pitch: f64| -> Vec<f64> {
        let all = (0..count as i64).map(|k| grid::frequency(k - (count / 2) as i64, count, pitch));
        all.filter(|&f| weight(axis, f) > 0.0).collect()
    };
    let fxs = frequencies(0, width, input.pitch_x);
    let fys = frequencies(1, height, input.pitch_y);
    // Rows first: spectrum over x of every input row, then over y, times the transfer, and back the same way.
    let mut spectrum = vec![Complex64::default(); fxs.len() * fys.len()];
    for (kx, &fx) in fxs.iter().enumerate() {
        let rows: Vec<Complex64> = (0..input.height)
            .map(|row| {
                (0..input.width)
                    .map(|c| field.samples[row * input.width + c] * Complex64::cis(-tau * fx * input.x(c)))
                    .sum()
            })
            .collect();
        for (ky, &fy) in fys.iter().enumerate() {
            let sum: Complex64 =
                rows.iter().enumerate().map(|(row, u)| u * Complex64::cis(-tau * fy * input.y(row))).sum();
            let fz2 = 1.0 / (wavelength * wavelength) - fx * fx - fy * fy;
            let transfer = if fz2 >= 0.0 { Complex64::cis(tau * distance * fz2.sqrt()) } else { Complex64::default() };
            let part = weight(0, fx) * weight(1, fy) / (width * height) as f64;
            spectrum[ky * fxs.len() + kx] = sum * transfer * part;
        }
    }
    let mut out = Field::<f64>::zeros(output, wavelength);
    for row in 0..output.height {
        let columns: Vec<Complex64> = (0..fxs.len())
            .map(|kx| {
                fys.iter()
                    .enumerate()
                    .map(|(ky, &fy)| spectrum[ky * fxs.len() + kx] * Complex64::cis(tau * fy * output.y(row)))
                    .sum()
            })
            .collect();
        for column in 0..output.width {
            out.samples[row * output.width + column] =
                fxs.iter().zip(&columns).map(|(&fx, u)| u * Complex64::cis(tau * fx * output.x(column))).sum();
        }
    }
    out
}
