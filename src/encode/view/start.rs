//! Where the descent starts: the picture itself, on waves that converge on places of the eye box.

use super::ViewTarget;
use super::aside::{Aside, is_smooth};
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
/// the pictures are there to eyes in those places [rad]: the phases of their amplitudes ([`Aside`]). From waves of one brightness dark places would take most steps to become dark. What is
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
    let able = Able::new(target, model);
    let full = able.full(&waves, lattice);
    let aside = Aside::new(target, model);
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
            let amplitude = (u.norm() / (full * able.amplitude(column, row))).min(1.0);
            *phase = (u.arg() + aside.phase(amplitude, column, row)).rem_euclid(TAU as f32);
        }
    };
    phases.par_chunks_mut(grid.width).enumerate().for_each(line);
    progress.check()?;
    Ok(phases)
}

/// How much of a picture's amplitude each pixel can show.
struct Able<'a> {
    model: &'a PanelModel,
    /// What a wrap costs per radian that the eye's wave turns from pixel to pixel.
    wraps: f32,
    /// Places of the columns and rows from where the wave would stand still [rad/pixel].
    turns: [Vec<f32>; 2],
}

impl<'a> Able<'a> {
    fn new(target: &ViewTarget, model: &'a PanelModel) -> Self {
        let (grid, eye) = (&model.grid, target.viewer.eye);
        let slope = |pitch: f64, off: f64| (TAU * pitch * off / (target.wavelength * eye.z)).abs() as f32;
        let across = (0..grid.width).map(|i| slope(grid.pitch_x, grid.x(i) - eye.x)).collect();
        let down = (0..grid.height).map(|j| slope(grid.pitch_y, grid.y(j) - eye.y)).collect();
        let wraps = if is_smooth(target, model) { WRAP * model.crosstalk() / TAU } else { 0.0 };
        Self { model, wraps: wraps as f32, turns: [across, down] }
    }

    /// The amplitude there, 1 for a pixel in full light without a wrap near.
    fn amplitude(&self, column: usize, row: usize) -> f32 {
        let beam = self.model.incident.as_ref().map_or(1.0, |wave| wave[row * self.model.grid.width + column].norm());
        let kept = 1.0 - self.wraps * (self.turns[0][column] + self.turns[1][row]);
        (beam * kept.max(0.5)).max(DARKEST)
    }

    /// The amplitude of the picture that takes all of a pixel's light: that of the brightest waves together. Where places can show
    /// less, it is so much greater that hardly anything of the picture is cut. A picture of bars to the border, in a Gaussian
    /// beam that has a quarter of its amplitude there, comes to 32.6 dB in 50 steps, and to 27.2 with the brightest waves'
    /// amplitude.
    fn full(&self, waves: &[Wave], lattice: &Grid) -> f32 {
        let brightest = waves.iter().flat_map(|wave| &wave.seen).fold(f32::MIN_POSITIVE, |most, &a| most.max(a));
        let full = brightest * (waves.len() as f32).sqrt();
        let grid = &self.model.grid;
        let near = |place: f64, count: usize| place.round().clamp(0.0, count as f64 - 1.0) as usize;
        let places = (0..grid.height).step_by(SAMPLED);
        let places = places.flat_map(|row| (0..grid.width).step_by(SAMPLED).map(move |column| (column, row)));
        let lit = places.map(|(column, row)| {
            let at = near(lattice.row(grid.y(row)), lattice.height) * lattice.width
                + near(lattice.column(grid.x(column)), lattice.width);
            (waves.iter().map(|wave| wave.seen[at].powi(2)).sum::<f32>().sqrt(), self.amplitude(column, row))
        });
        let lit: Vec<(f32, f32)> = lit.collect();
        let all: f32 = lit.iter().map(|(wanted, _)| wanted * wanted).sum();
        let cut = |full: f32| lit.iter().map(|(wanted, able)| (wanted - full * able).max(0.0).powi(2)).sum::<f32>();
        if cut(full) <= CUT * all {
            return full;
        }
        let (mut low, mut high) = (full, BRIGHTER * full);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            *if cut(middle) > CUT * all { &mut low } else { &mut high } = middle;
        }
        high
    }
}

/// Width of panel beside a wrap that shows nothing, per standard deviation of what neighbours blend by: ∫1 − cos(2πΦ(t))dt.
const WRAP: f64 = 2.914;
/// Amplitude below which a pixel shows nothing.
const DARKEST: f32 = 1e-3;
/// Share of a picture's light that may be cut, and the most that a picture is made darker to keep it.
const CUT: f32 = 3e-3;
const BRIGHTER: f32 = 8.0;
/// Every so many rows and columns are looked at.
const SAMPLED: usize = 8;

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
