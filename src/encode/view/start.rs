//! Where the descent starts: the picture itself, on waves that converge on places of the eye box.

use super::ViewTarget;
use super::spots::Spots;
use crate::encode::model::PanelModel;
use crate::error::Result;
use crate::field::{Complex32, Complex64, Grid};
use crate::light_field::retina::Targets;
use crate::light_field::{Look, Pupil};
use crate::panel::Setup;
use crate::progress::Progress;
use crate::random::Random;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Phases of a frame for an eye at `from` as they are to start from for an eye at `to` [m]: the wave converges there,
/// φ − π/λZ·|x − e|² with the other e and Z.
pub fn carried_over(wishes: &[f32], setup: &Setup, wavelength: f64, from: DVec3, to: DVec3) -> Vec<f32> {
    let grid = setup.grid;
    let lens = |eye: DVec3, x: DVec2| -PI / (wavelength * eye.z) * (x - eye.truncate()).length_squared();
    let phase = |i: usize| {
        let x = DVec2::new(grid.x(i % grid.width), grid.y(i / grid.width));
        (f64::from(wishes[i]) + lens(to, x) - lens(from, x)).rem_euclid(TAU) as f32
    };
    (0..grid.len().min(wishes.len())).into_par_iter().map(phase).collect()
}

/// Phases of waves that converge on spots of the eye box ([`Spots`]), together as bright on each pixel as
/// the pictures are there to eyes in those places [rad]: two phases φ ± arccos(a) for one amplitude a, as in double phase, whose
/// unwanted light goes far beside the eye ([`Stripes`]). From waves of one brightness dark places would take most steps to become dark. What is
/// brighter than the brightest part of one picture times the root of the number of waves is cut.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) when asked to stop.
pub(super) fn converging(
    target: &ViewTarget,
    targets: &Targets,
    model: &PanelModel,
    spots: &[DVec2],
    random: &mut Random,
    progress: &Progress,
) -> Result<Vec<f32>> {
    let (grid, lattice) = (model.grid, &target.retina.lattice);
    let wave = |spot: &DVec2| {
        progress.check()?;
        Ok(Wave::new(target, targets, &grid, *spot, random))
    };
    let waves = spots.iter().map(wave).collect::<Result<Vec<Wave>>>()?;
    let brightest = waves.iter().flat_map(|wave| &wave.seen).fold(f32::MIN_POSITIVE, |most, &a| most.max(a));
    let full = brightest * (spots.len() as f32).sqrt();
    let stripes = Stripes::new(target, model);
    let columns: Vec<Between> =
        (0..grid.width).map(|i| Between::new(lattice.column(grid.x(i)), lattice.width)).collect();
    let mut phases = vec![0.0f32; grid.len()];
    let line = |(row, line): (usize, &mut [f32])| {
        if progress.stopped() {
            return;
        }
        let down = Between::new(lattice.row(grid.y(row)), lattice.height);
        let mut sum = vec![Complex32::default(); grid.width];
        let mut picture = vec![0.0f32; lattice.width];
        for wave in &waves {
            let of = |row: usize| &wave.seen[row * lattice.width..][..lattice.width];
            let lines = of(down.first).iter().zip(of(down.second));
            picture.iter_mut().zip(lines).for_each(|(out, (a, b))| *out = a + down.share * (b - a));
            let turn = wave.down[row];
            for ((sum, across), place) in sum.iter_mut().zip(&wave.across).zip(&columns) {
                let (a, b) = (picture[place.first], picture[place.second]);
                *sum += across * turn * (a + place.share * (b - a));
            }
        }
        for (column, (phase, u)) in line.iter_mut().zip(&sum).enumerate() {
            let aside = (u.norm() / full).min(1.0).acos();
            *phase = (u.arg() + if stripes.is_above(column, row) { aside } else { -aside }).rem_euclid(TAU as f32);
        }
    };
    phases.par_chunks_mut(grid.width).enumerate().for_each(line);
    progress.check()?;
    Ok(phases)
}

/// Which pixels have the greater one of the two phases that make an amplitude.
struct Stripes {
    /// Rows of a stripe; `None` for a checkerboard of pixels, which sends unwanted light the farthest.
    rows: Option<usize>,
}

impl Stripes {
    /// Where neighbours blend, stripes as wide as the unwanted light still goes by the eye: it stands at ±λZ/(2·rows·pitch) above
    /// and below, as wide as a pupil and the picture's own band. Beside each step of more than half a turn light is lost, and a
    /// checkerboard of ±90° on a wave that wraps has one at every second pixel: on 1.6π with 0.3 pixels Cornell's room comes to
    /// 32.3 dB from it and to 47.3 from stripes of five rows, where it is 48.9 without crosstalk (50 steps).
    fn new(target: &ViewTarget, model: &PanelModel) -> Self {
        let Pupil::Diameter(pupil) = target.viewer.pupil else { return Self { rows: None } };
        let aside = 0.5 * target.wavelength * target.viewer.eye.z / model.grid.pitch_y;
        let rows = (aside / (0.5 * target.viewer.eye_box.y + 1.15 * pupil)) as usize;
        Self { rows: (model.blends() && rows > 1).then_some(rows) }
    }

    fn is_above(&self, column: usize, row: usize) -> bool {
        self.rows.map_or(column + row, |rows| row / rows).is_multiple_of(2)
    }
}

/// A picture on a wave that converges on a spot: its phase is that of a column and a row, −π/λZ·((x − e_x)² + (y − e_y)²).
struct Wave {
    /// Amplitudes on the retina's lattice.
    seen: Vec<f32>,
    across: Vec<Complex32>,
    down: Vec<Complex32>,
}

impl Wave {
    fn new(target: &ViewTarget, targets: &Targets, grid: &Grid, spot: DVec2, random: &mut Random) -> Self {
        let viewer = target.viewer;
        let is_scattered = Spots::are_scattered(viewer);
        let at = viewer.eye.truncate() + spot;
        let seen = match viewer.pupil {
            // All pupils see it, and nothing else of this frame: what such a pupil sees.
            Pupil::Diameter(_) if !is_scattered => {
                let [near, far] = target.light.depth.map(|z| 1.0 / (viewer.eye.z - z));
                let half = 0.5 * viewer.eye_box;
                let pupil = viewer.eye.truncate() + spot.clamp(-half, half);
                targets.amplitude(&Look { pupil, focus: viewer.eye.z - 2.0 / (near + far) })
            }
            // A wave from one place has the picture of a pinhole there; pupils see several.
            _ => targets.pinhole(at),
        };
        // Waves of one frame that are alike would be bright together.
        let turn = if is_scattered { TAU * random.uniform() } else { 0.0 };
        let wave = |off: f64, turn: f64| {
            let u = Complex64::cis((turn - PI / (target.wavelength * viewer.eye.z) * off * off) % TAU);
            Complex32::new(u.re as f32, u.im as f32)
        };
        Self {
            seen,
            across: (0..grid.width).map(|i| wave(grid.x(i) - at.x, turn)).collect(),
            down: (0..grid.height).map(|j| wave(grid.y(j) - at.y, 0.0)).collect(),
        }
    }
}

/// A place between two samples of a line, at its ends the last one.
struct Between {
    first: usize,
    second: usize,
    share: f32,
}

impl Between {
    fn new(place: f64, count: usize) -> Self {
        let place = place.clamp(0.0, count as f64 - 1.0);
        let first = place as usize;
        Self { first, second: (first + 1).min(count - 1), share: (place - first as f64) as f32 }
    }
}
