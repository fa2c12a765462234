//! Pictures at depths as targets: what is asked of each plane, and where light is free.
//!
//! A picture stands in a window in the middle of the panel's own rectangle, carried straight to its depth. Samples inside
//! the window count where the picture stands at that depth; outside, and where it stands at another depth, light is free:
//! there the noise goes that a panel of phases, of few levels or of less than a turn cannot avoid.

use super::iterated::{PlaneEncoding, of_planes};
use super::iterative::{Solution, TargetPlane};
use super::{EncodeReport, Encoded};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::panel::{Illumination, PanelProfile, Pattern, Wavefront, drive};
use crate::progress::Progress;

/// A picture with the depth of each of its pixels.
#[derive(Clone, Debug)]
pub struct DepthPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear light of each pixel, row-major, row 0 on top; any scale.
    pub light: Vec<f32>,
    /// Index of each pixel's plane.
    pub plane: Vec<usize>,
    /// Depths z of the planes [m].
    pub depths: Vec<f64>,
}

impl DepthPicture {
    /// A picture at one depth [m].
    pub fn flat(width: usize, height: usize, light: Vec<f32>, z: f64) -> Self {
        let plane = vec![0; light.len()];
        Self { width, height, light, plane, depths: vec![z] }
    }

    /// A picture whose pixels go to the nearest of some depths z [m].
    pub fn sorted(width: usize, height: usize, light: Vec<f32>, z: &[f64], depths: &[f64]) -> Self {
        let nearest = |z: &f64| {
            let by = |k: &usize| (depths[*k] - z).abs();
            (0..depths.len()).min_by(|a, b| by(a).total_cmp(&by(b))).unwrap_or(0)
        };
        Self { width, height, light, plane: z.iter().map(nearest).collect(), depths: depths.to_vec() }
    }

    /// The window of a panel's grid that the picture takes, as large as its shape allows within `share` of each side:
    /// columns and rows.
    pub fn window(&self, grid: &Grid, share: f64) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let (w, h) = (share * grid.extent_x(), share * grid.extent_y());
        let aspect = self.width as f64 / self.height as f64;
        let (w, h) = if w / h > aspect { (h * aspect, h) } else { (w, w / aspect) };
        let side = |extent: f64, pitch: f64, count: usize| {
            let size = ((extent / pitch).round() as usize).clamp(1, count);
            (count - size) / 2..(count - size) / 2 + size
        };
        (side(w, grid.pitch_x, grid.width), side(h, grid.pitch_y, grid.height))
    }

    /// What is asked of the light on each plane: amplitudes √light on the panel's samples within the window.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a picture that is dark, not finite or negative, or that does not fit together.
    pub fn planes(&self, grid: &Grid, share: f64) -> Result<Vec<TargetPlane>> {
        let count = self.width * self.height;
        if count == 0 || self.light.len() != count || self.plane.len() != count {
            return Err(Error::parameter(
                "picture",
                format!("{} pixels for {}×{}", self.light.len(), self.width, self.height),
            ));
        }
        if self.depths.is_empty() || self.depths.len() > 64 || self.plane.iter().any(|&k| k >= self.depths.len()) {
            return Err(Error::parameter("depths", format!("{} planes; give 1 to 64", self.depths.len())));
        }
        if self.light.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(Error::parameter("picture", "it holds light that is negative or not finite"));
        }
        if !(share > 0.0 && share <= 1.0) {
            return Err(Error::parameter("window", format!("{share} must be above 0 and at most 1")));
        }
        let (columns, rows) = self.window(grid, share);
        let dark =
            TargetPlane { z: 0.0, amplitude: vec![0.0; grid.len()], weight: Some(vec![0.0; grid.len()]), phase: None };
        let mut planes: Vec<TargetPlane> = self.depths.iter().map(|&z| TargetPlane { z, ..dark.clone() }).collect();
        let scaled = |at: usize, from: &std::ops::Range<usize>, size: usize| {
            ((at - from.start) as f64 + 0.5) / from.len() as f64 * size as f64
        };
        for row in rows.clone() {
            let v = scaled(row, &rows, self.height);
            for column in columns.clone() {
                let u = scaled(column, &columns, self.width);
                let nearest = (v as usize).min(self.height - 1) * self.width + (u as usize).min(self.width - 1);
                let i = row * grid.width + column;
                let plane = &mut planes[self.plane[nearest]];
                plane.amplitude[i] = self.sample(u, v).max(0.0).sqrt();
                if let Some(weight) = &mut plane.weight {
                    weight[i] = 1.0;
                }
            }
        }
        // A plane without pixels asks for nothing.
        planes.retain(|plane| plane.amplitude.iter().any(|a| *a > 0.0));
        if planes.is_empty() {
            return Err(Error::parameter("picture", "it is dark everywhere"));
        }
        Ok(planes)
    }

    /// Light between the pixels' middles, bilinear.
    fn sample(&self, u: f64, v: f64) -> f32 {
        let place = |x: f64, size: usize| {
            let x = (x - 0.5).clamp(0.0, size as f64 - 1.0);
            let low = x as usize;
            (low, (low + 1).min(size - 1), (x - low as f64) as f32)
        };
        let (left, right, s) = place(u, self.width);
        let (upper, lower, t) = place(v, self.height);
        let at = |column: usize, row: usize| self.light[row * self.width + column];
        (at(left, upper) * (1.0 - s) + at(right, upper) * s) * (1.0 - t)
            + (at(left, lower) * (1.0 - s) + at(right, lower) * s) * t
    }
}

/// Encodes wanted amplitudes on planes for a panel. The report's `efficiency` is the share of the panel's light where the
/// pictures count, `field_error` the relative error of the amplitudes there, both with the panel's levels and dead space.
///
/// # Errors
/// As [`super::encode`].
pub fn encode_planes(
    planes: Vec<TargetPlane>,
    wavelength: f64,
    profile: &PanelProfile,
    settings: &PlaneEncoding,
    correction: Option<&Wavefront>,
    illumination: Illumination,
    progress: &Progress,
) -> Result<(Encoded, Solution)> {
    let count = planes.len() as f64;
    let (found, record) = of_planes(planes, wavelength, settings, profile, illumination, progress)?;
    let mut driven = drive(&Pattern::Phase(found.pattern.clone()), correction, profile)?;
    driven.frame.metadata.encoding = Some(record);
    let report = EncodeReport {
        method: settings.method.name(),
        efficiency: found.efficiency * count,
        field_error: found.history.last().copied().unwrap_or(1.0).sqrt(),
        clipped: 0.0,
        dropped: 0.0,
        quantisation_error: driven.rms_error,
        unreachable: driven.unreachable,
        warnings: driven.warnings,
    };
    Ok((Encoded { frame: driven.frame, report }, found))
}
