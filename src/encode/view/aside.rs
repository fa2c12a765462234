//! Amplitudes made of phases alone: light that the eye should not get goes beside it.
//!
//! Phases φ + d·c whose c changes from pixel to pixel have the mean A(d)·exp(iφ). With c = ±1 on a checkerboard that is cos d, as
//! in double phase (Hsueh & Sawchuk 1978), and the rest goes as far aside as a panel can send it. Beside each step of phase a panel whose
//! pixels run into each other shows all phases between: there c is a cosine along the rows, as slow as its orders still go by
//! the eye; A is the mean over a period of what the blended phases make, J₀(d) for long ones.

use super::ViewTarget;
use crate::encode::model::PanelModel;
use crate::field::phasor;
use crate::light_field::Pupil;
use crate::panel::crosstalk::mixed;
use std::f32::consts::TAU;
use std::f64::consts::PI;

/// Rows of half a period from which on a cosine is one, and steps of the descent are smooth as well.
const SMOOTH: usize = 3;

/// Entries of a table, and the steps of d that it is found by [rad].
const ENTRIES: usize = 512;
const STEP: f32 = 0.02;

/// What is added to which pixel's phase for an amplitude.
pub(super) struct Aside {
    /// c of the rows of a period; empty: a checkerboard of ±1.
    shape: Vec<f32>,
    /// d for amplitudes 1 − t², t from 0 to 1: there it has no steep end.
    depths: Vec<f32>,
}

impl Aside {
    pub(super) fn new(target: &ViewTarget, model: &PanelModel) -> Self {
        Self::of(rows(target, model), model.crosstalk())
    }

    /// Of cosines of so many rows half a period, for neighbours blended by a Gaussian of that standard deviation [pixels].
    fn of(rows: Option<usize>, blend: f64) -> Self {
        let Some(rows) = rows else { return Self { shape: Vec::new(), depths: Vec::new() } };
        let angle = |row: usize| PI * (row as f64 + 0.5) / rows as f64;
        let top = (0..2 * rows).map(|row| angle(row).cos()).fold(0.0, f64::max);
        let shape: Vec<f32> = (0..2 * rows).map(|row| (angle(row).cos() / top) as f32).collect();
        let amplitude = |d: f32| -> f32 {
            // The middle one of three periods.
            let phases: Vec<f32> = (0..6 * rows).map(|row| d * shape[row % (2 * rows)]).collect();
            let light = mixed(&phases, 1, blend, |phase| phasor(phase / TAU));
            light[2 * rows..4 * rows].iter().map(|u| u.re).sum::<f32>() / (2 * rows) as f32
        };
        // As far as it falls: with steps of a few rows it may not come to nothing.
        let mut fallen: Vec<[f32; 2]> = vec![[0.0, 1.0]];
        while let Some([d, before]) = fallen.last().copied().filter(|[_, a]| *a > 0.0) {
            let next = [d + STEP, amplitude(d + STEP)];
            if next[1] >= before {
                break;
            }
            fallen.push(next);
        }
        let depth = |entry: usize| {
            let wanted = 1.0 - (entry as f32 / ENTRIES as f32).powi(2);
            let after = fallen.partition_point(|[_, a]| *a > wanted).clamp(1, fallen.len() - 1);
            let ([d, a], [e, b]) = (fallen[after - 1], fallen[after]);
            d + (e - d) * ((a - wanted) / (a - b)).clamp(0.0, 1.0)
        };
        let depths = (0..=ENTRIES).map(depth).collect();
        Self { shape, depths }
    }

    /// What a pixel's phase has more for an amplitude from 0 to 1 [rad].
    pub(super) fn phase(&self, amplitude: f32, column: usize, row: usize) -> f32 {
        if self.shape.is_empty() {
            return if (column + row).is_multiple_of(2) { amplitude.acos() } else { -amplitude.acos() };
        }
        let at = (1.0 - amplitude).max(0.0).sqrt() * ENTRIES as f32;
        let entry = (at as usize).min(ENTRIES - 1);
        let [a, b] = [self.depths[entry], self.depths[entry + 1]];
        (a + (at - entry as f32) * (b - a)) * self.shape[row % self.shape.len()]
    }
}

/// Rows of half a period; `None` for a checkerboard, where pixels keep to themselves or the pupils leave no room aside: the orders
/// stand at ±λZ/(2·rows·pitch) above and below, as wide as a pupil and the picture's own band.
fn rows(target: &ViewTarget, model: &PanelModel) -> Option<usize> {
    let Pupil::Diameter(pupil) = target.viewer.pupil else { return None };
    let aside = 0.5 * target.wavelength * target.viewer.eye.z / model.grid.pitch_y;
    let rows = (aside / (0.5 * target.viewer.eye_box.y + 1.15 * pupil)) as usize;
    (model.blends() && rows > 1).then_some(rows)
}

/// Whether all that leads to the eye is smooth over neighbours, which blend.
pub(super) fn is_smooth(target: &ViewTarget, model: &PanelModel) -> bool {
    rows(target, model).is_some_and(|rows| rows >= SMOOTH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex32;

    /// The mean light of a patch is the amplitude that was asked for, without and with neighbours that blend.
    #[test]
    fn phases_aside_make_the_amplitude() {
        for (rows, blend) in
            [(None, 0.0), (Some(2), 0.0), (Some(5), 0.0), (Some(3), 0.4), (Some(5), 0.4), (Some(9), 0.3)]
        {
            let aside = Aside::of(rows, blend);
            let (width, height) = (8, 6 * rows.unwrap_or(1));
            for wanted in [0.0f32, 0.013, 0.1, 0.35, 0.5, 0.8, 0.97, 1.0] {
                let phases: Vec<f32> = (0..width * height).map(|i| aside.phase(wanted, i % width, i / width)).collect();
                let turned = |phase: f32| phasor(phase / TAU);
                let light = mixed(&phases, width, blend, turned);
                // Whole periods, away from the border.
                let inner = &light[width * height / 3..][..width * height / 3];
                let mean = inner.iter().sum::<Complex32>() / inner.len() as f32;
                assert!((mean - wanted).norm() < 0.012, "{rows:?} {blend}: {wanted} becomes {mean}");
            }
        }
    }
}
