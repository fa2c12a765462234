//! From plane to plane: the angular spectrum on the exact frequency grid, and Fresnel's approximation of it.
//!
//! A field on the plane z is a sum of plane waves; over a distance d each is multiplied by exp(+i2πf_z·d),
//! f_z = √(1/λ² − f_x² − f_y²) (angular spectrum; Goodman, *Introduction to Fourier Optics*, §3.10). Sampling that
//! factor on a padded grid of length L is right only where its own phase turns by less than half a turn per
//! sample: |f_x| ≤ 1/(λ√((2d/L)² + 1)), and the same in y with its own L (Matsushima & Shimobaba, *Optics Express*
//! 17, 19662 (2009), eqs. 13 and 21). Frequencies outside carry waves that miss the output window and are dropped.
//!
//! The padding is input + output size, so that nothing wraps round. The phase 2πf_z·d is reduced to one turn in f64.
//!
//! [`Propagator`] goes between windows of one pitch, anywhere beside each other; [`ScaledPropagator`] onto any pitch.
//!
//! ```
//! use holodrive::field::{Complex32, Field, Grid, relative_error};
//! use holodrive::progress::Progress;
//! use holodrive::propagation::propagate;
//!
//! // A beam of 0.3 mm waist spreads over 0.1 m, keeps its energy, and comes back as it was.
//! let grid = Grid::new(256, 256, 8e-6, 8e-6)?;
//! let beam = |i: usize| (-(grid.x(i % 256).powi(2) + grid.y(i / 256).powi(2)) / 0.3e-3f64.powi(2)).exp();
//! let samples = (0..grid.len()).map(|i| Complex32::new(beam(i) as f32, 0.0)).collect();
//! let waist = Field::new(grid, 532e-9, samples)?;
//! let far = propagate(&waist, 0.1, &Progress::new())?;
//! assert!((far.energy() / waist.energy() - 1.0).abs() < 1e-4);
//! let back = propagate(&far, -0.1, &Progress::new())?;
//! assert!(relative_error(&back.samples, &waist.samples) < 1e-3);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod band;
mod resample;
mod scaled;

pub use band::limit;
pub use resample::{Resampled, is_same_pitch, resample};
pub use scaled::{ScaledPropagator, propagate_scaled};

use crate::error::{Error, Result};
use crate::field::{Complex, Fft2, FftNum, Field, Grid, grid};
use crate::names::{Name, Named};
use crate::progress::Progress;
use serde::{Deserialize, Serialize};

/// Which wave equation carries the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// Helmholtz, exact: f_z = √(1/λ² − f²). Evanescent waves decay with d > 0 and are dropped for d < 0.
    #[default]
    AngularSpectrum,
    /// Paraxial: f_z = 1/λ − λf²/2 (Fresnel). The error grows as πλ³f⁴d/4 [rad].
    Fresnel,
}

impl Named for Kernel {
    const KIND: &'static str = "kernel";
    const NAMES: &'static [Name<Self>] = &[
        ("angular-spectrum", || Self::AngularSpectrum, "Helmholtz, exact"),
        ("fresnel", || Self::Fresnel, "paraxial"),
    ];
}

/// How a field is carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Which wave equation.
    pub kernel: Kernel,
    /// Drop the frequencies at which the sampled kernel aliases (Matsushima & Shimobaba). Off only for comparison.
    pub band_limit: bool,
    /// Memory that one propagation may take [bytes]; more is refused with the numbers.
    pub memory: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { kernel: Kernel::AngularSpectrum, band_limit: true, memory: 8 << 30 }
    }
}

impl Settings {
    /// Refuses what takes more memory [bytes] than it may.
    fn allow(&self, needed: u64) -> Result<()> {
        if needed <= self.memory {
            return Ok(());
        }
        let hint = "propagate to a smaller window".to_owned();
        let (needed, budget) = (needed.div_ceil(1 << 20), self.memory >> 20);
        Err(Error::Memory { what: "propagation", needed, budget, hint })
    }
}

/// What a stop in the Fourier plane of a 4f relay lets through: a rectangle of spatial frequencies, less a disc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aperture {
    /// Middle of the rectangle, (f_x, f_y) [cycles/m].
    pub center: [f64; 2],
    /// Half width and half height of the rectangle [cycles/m].
    pub half: [f64; 2],
    /// Radius of the disc about zero frequency that is blocked [cycles/m]; 0 blocks nothing.
    pub stop: f64,
}

impl Aperture {
    /// A centred rectangle.
    pub fn centered(half_x: f64, half_y: f64) -> Self {
        Self { center: [0.0; 2], half: [half_x, half_y], stop: 0.0 }
    }
    /// Whether a plane wave passes.
    pub fn passes(&self, fx: f64, fy: f64) -> bool {
        (fx - self.center[0]).abs() <= self.half[0]
            && (fy - self.center[1]).abs() <= self.half[1]
            && (self.stop == 0.0 || fx.hypot(fy) >= self.stop)
    }
}

/// A planned propagation between two grids of one pitch: reusable for any number of fields and distances.
#[derive(Clone, Debug)]
pub struct Propagator<T: FftNum> {
    input: Grid,
    output: Grid,
    padded: Grid,
    settings: Settings,
    transform: Fft2<T>,
}

impl<T: FftNum> Propagator<T> {
    /// Plans from `input` to `output`: any sizes and middles, pitches must be equal.
    ///
    /// # Errors
    /// [`Error::Parameter`] when pitches differ, [`Error::Memory`] when the padded field passes the budget.
    pub fn new(input: Grid, output: Grid, settings: Settings) -> Result<Self> {
        if input.pitch_x != output.pitch_x || input.pitch_y != output.pitch_y {
            let what = format!(
                "the output pitch {}×{} m must be the input's, {}×{} m",
                output.pitch_x, output.pitch_y, input.pitch_x, input.pitch_y
            );
            return Err(Error::parameter("pitch", what));
        }
        let (width, height) = (input.width + output.width, input.height + output.height);
        let padded = Grid::new(width, height, input.pitch_x, input.pitch_y)?;
        let planned = Self { input, output, padded, settings, transform: Fft2::new(width, height) };
        settings.allow(planned.memory())?;
        Ok(planned)
    }

    /// Memory that [`Propagator::propagate`] takes besides input and output [bytes]: the padded field and the transform's
    /// turned copy of it.
    pub fn memory(&self) -> u64 {
        2 * self.padded.len() as u64 * size_of::<Complex<T>>() as u64
    }

    /// The field at `distance` d [m] in front of (d > 0, with the light) or behind (d < 0) the input plane.
    pub fn propagate(&self, field: &Field<T>, distance: f64, progress: &Progress) -> Result<Field<T>> {
        self.propagate_through(field, distance, None, progress)
    }

    /// The same through a stop in the Fourier plane of a 1:1 relay before the distance.
    pub fn propagate_through(
        &self,
        field: &Field<T>,
        distance: f64,
        aperture: Option<&Aperture>,
        progress: &Progress,
    ) -> Result<Field<T>> {
        assert_eq!(field.grid, self.input, "the field stands on the planned grid");
        grid::finite("distance", distance)?;
        field.check_samples()?;
        progress.check()?;
        let wavelength = field.wavelength;
        let zero = Complex::new(T::zero(), T::zero());
        let mut samples = vec![zero; self.padded.len()];
        for (padded, row) in
            samples.chunks_exact_mut(self.padded.width).zip(field.samples.chunks_exact(self.input.width))
        {
            padded[..row.len()].copy_from_slice(row);
        }
        let shift = self.shift();
        let [x_band, y_band] = self.bands(wavelength, distance);
        let (grid, kernel, band_limit) = (&self.padded, self.settings.kernel, self.settings.band_limit);
        let rows: Vec<f64> = (0..grid.height).map(|k| grid.frequency_y(k)).collect();
        let transfer = |kx: usize, column: &mut [Complex<T>]| {
            let fx = grid.frequency_x(kx);
            if progress.stopped() || band_limit && !(x_band[0]..=x_band[1]).contains(&fx) {
                column.fill(zero);
                return;
            }
            for (u, &fy) in column.iter_mut().zip(&rows) {
                let aliased = band_limit && !(y_band[0]..=y_band[1]).contains(&fy);
                if aliased || aperture.is_some_and(|stop| !stop.passes(fx, fy)) {
                    *u = zero;
                    continue;
                }
                let (turns, decay) = turns_and_decay(kernel, wavelength, fx * fx + fy * fy, distance);
                *u = *u * turned(turns + fx * shift[0] + fy * shift[1], decay);
            }
        };
        self.transform.filter(&mut samples, self.input.height, self.output.height, transfer, progress);
        progress.check()?;
        let mut out = Vec::with_capacity(self.output.len());
        for row in samples.chunks_exact(self.padded.width).take(self.output.height) {
            out.extend_from_slice(&row[..self.output.width]);
        }
        Ok(Field { grid: self.output, wavelength, samples: out })
    }

    /// From the position of the input's first sample to that of the output's [m]: the shift that lays the output
    /// window on the first rows and columns of the padded array.
    fn shift(&self) -> [f64; 2] {
        [self.output.x(0) - self.input.x(0), self.output.y(0) - self.input.y(0)]
    }

    /// Lowest and highest f_x and f_y [cycles/m] at which the kernel is sampled without aliasing.
    ///
    /// The kernel is needed for offsets X between output and input points; its local frequency at X is
    /// X/(λ√(X² + d²)). Centred windows give Matsushima & Shimobaba's symmetric limits, shifted ones their 2010 ones.
    fn bands(&self, wavelength: f64, distance: f64) -> [[f64; 2]; 2] {
        [
            band(wavelength, distance, self.output.center[0] - self.input.center[0], self.padded.extent_x()),
            band(wavelength, distance, self.output.center[1] - self.input.center[1], self.padded.extent_y()),
        ]
    }
}

/// Lowest and highest frequency along one axis [cycles/m] for windows whose middles are `middle` apart, sampled over a
/// period of `length` [m].
pub(crate) fn band(wavelength: f64, distance: f64, middle: f64, length: f64) -> [f64; 2] {
    if distance == 0.0 {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let at = |x: f64| x / (wavelength * x.hypot(distance)) * if distance < 0.0 { -1.0 } else { 1.0 };
    let ends = [at(middle - 0.5 * length), at(middle + 0.5 * length)];
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// Turns of exp(+i2πf_z·d) and the factor by which an evanescent wave decays.
fn turns_and_decay(kernel: Kernel, wavelength: f64, f2: f64, distance: f64) -> (f64, f64) {
    match kernel {
        Kernel::Fresnel => (distance * (1.0 / wavelength - 0.5 * wavelength * f2), 1.0),
        Kernel::AngularSpectrum => {
            let fz2 = 1.0 / (wavelength * wavelength) - f2;
            if fz2 >= 0.0 {
                (distance * fz2.sqrt(), 1.0)
            } else if distance >= 0.0 {
                (0.0, (-std::f64::consts::TAU * distance * (-fz2).sqrt()).exp())
            } else {
                (0.0, 0.0)
            }
        }
    }
}

/// decay·exp(i2π·turns), reduced to one turn before the sine and narrowed after it.
fn turned<T: FftNum>(turns: f64, decay: f64) -> Complex<T> {
    let (sin, cos) = (std::f64::consts::TAU * (turns - turns.round())).sin_cos();
    let narrow = |v: f64| T::from_f64(v).unwrap_or_else(T::zero);
    Complex::new(narrow(decay * cos), narrow(decay * sin))
}

/// Carries `field` over `distance` [m] onto the same window, by the exact angular spectrum with defaults.
pub fn propagate<T: FftNum>(field: &Field<T>, distance: f64, progress: &Progress) -> Result<Field<T>> {
    Propagator::new(field.grid, field.grid, Settings::default())?.propagate(field, distance, progress)
}

/// Carries `field` over `distance` [m] onto `output` (equal pitch, any window), by the exact angular spectrum.
pub fn propagate_to<T: FftNum>(field: &Field<T>, distance: f64, output: Grid, progress: &Progress) -> Result<Field<T>> {
    Propagator::new(field.grid, output, Settings::default())?.propagate(field, distance, progress)
}

#[cfg(test)]
mod tests;
