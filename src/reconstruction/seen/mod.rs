//! What an eye sees of a panel, judged against the light field that it should see.
//!
//! An eye looks from held-out places of its box, with held-out foci ([`looks`]). The light behind the panel is carried to its pupil
//! and onto its retina in double precision; what should be there is the mean of the light field's views in the pupil, sheared for
//! the focus and blurred by the pupil's diffraction. Encodings that are optimised for an eye share no code with this.
//!
//! ```
//! use holodrive::glam::{DVec2, DVec3};
//! use holodrive::field::{Complex32, Field, Grid};
//! use holodrive::light_field::{EyeGrid, Layer, LightField, Viewer};
//! use holodrive::progress::Progress;
//! use holodrive::reconstruction::seen::{Colour, Judge, looks};
//!
//! // An even wall, and a panel that sends an even wave converging on the eye: right but for the ringing of its edges.
//! let (eye, wavelength) = (DVec3::new(0.0, 0.0, 0.3), 532e-9);
//! let viewer = Viewer { pupil: holodrive::light_field::Pupil::Diameter(2e-3), ..Viewer::at(eye) };
//! let panel = Grid::new(320, 200, 8e-6, 8e-6)?;
//! let wall = LightField::of_layers(
//!     &[Layer::new(-0.1, |_| 0.7, |_| 1.0)],
//!     EyeGrid::covering(&viewer, 0.5e-3)?,
//!     Grid::new(32, 20, 80e-6, 80e-6)?,
//! )?;
//! let turns = |i: usize| (panel.x(i % 320).powi(2) + panel.y(i / 320).powi(2)) / (2.0 * wavelength * eye.z);
//! let wave = |i| Complex32::cis(-(std::f64::consts::TAU * turns(i)) as f32);
//! let field = Field::new(panel, wavelength, (0..panel.len()).map(wave).collect())?;
//!
//! let colour = Colour::One { wavelength, channel: Default::default() };
//! let judge = Judge::new(&wall, &viewer, colour, looks(&viewer, wall.depth, 3, 1)?, &Progress::new())?;
//! let mut seen = judge.begin();
//! seen.add(&judge, &field, None, 0, &Progress::new())?;
//! let figures = judge.figures(&seen);
//! assert!(figures.all.psnr > 20.0 && figures.all.efficiency > 0.9, "{figures:?}");
//! # Ok::<(), holodrive::Error>(())
//! ```

mod eye_plane;
mod figures;
mod gallery;
mod matrix;
mod sheet;
mod wanted;
mod whole;

pub use figures::{LookFigures, SeenBy, SeenFigures};
pub use gallery::{Seeing, SeenGallery, SeenShot};

use super::{ColorPicture, Picture, Reconstruction};
use crate::error::{Error, Result};
use crate::field::{Complex64, Fft2, Field, Grid, fast_length};
pub use crate::light_field::Look;
use crate::light_field::{LightField, Pupil, Viewer};
use crate::points::Channel;
use crate::points::colour::Lasers;
use crate::progress::Progress;
use crate::propagation::Aperture;
use crate::random::Random;
use eye_plane::{EyePlane, Sight};
use glam::DVec2;

/// Looks that no optimisation has seen: pupils anywhere in the eye box, foci anywhere in a range of depths (nearest and farthest z
/// \[m\]) as an eye accommodates, evenly in dioptres; every fourth focus is the nearest, the middle or the farthest in turn.
///
/// # Errors
/// As [`Viewer::check`]; [`Error::OutOfRange`] for depths that are not before the eye.
pub fn looks(viewer: &Viewer, depth: [f64; 2], count: usize, seed: u64) -> Result<Vec<Look>> {
    viewer.check()?;
    let [near, far] = depth.map(|z| 1.0 / (viewer.eye.z - z));
    if !(near > 0.0 && far > 0.0 && near.is_finite() && far.is_finite()) {
        let range = format_args!("{} to {} m", depth[0], depth[1]);
        return Err(Error::out_of_range("depths", range, format!("must be below the eye's, {} m", viewer.eye.z)));
    }
    let one = |index: usize| {
        let mut random = Random::new(seed, index as u64);
        let place = DVec2::new(random.uniform() - 0.5, random.uniform() - 0.5);
        let part = if index.is_multiple_of(4) { [0.0, 0.5, 1.0][index / 4 % 3] } else { random.uniform() };
        let focus = viewer.eye.z - 1.0 / (near + part * (far - near));
        Look { pupil: viewer.eye.truncate() + place * viewer.eye_box, focus }
    };
    Ok((0..count).map(one).collect())
}

/// In what light the panel is seen.
#[derive(Clone, Copy, Debug)]
pub enum Colour {
    /// One laser.
    One {
        /// Its vacuum wavelength [m].
        wavelength: f64,
        /// Which light of a coloured light field it shows.
        channel: Channel,
    },
    /// Three lasers, each with its drive of the light field's colour.
    Three(Lasers),
}

impl Colour {
    /// Three lasers where there are some, else one, in which a coloured light field shows one channel.
    pub fn of(lasers: Option<Lasers>, wavelength: f64, channel: Channel) -> Self {
        lasers.map_or(Self::One { wavelength, channel }, Self::Three)
    }

    fn wavelengths(&self) -> Vec<f64> {
        match self {
            Self::One { wavelength, .. } => vec![*wavelength],
            Self::Three(lasers) => lasers.wavelengths().to_vec(),
        }
    }

    /// Radiance for laser `index` of what the channels of a light field hold.
    fn radiance(&self, channels: &[Vec<f64>], index: usize) -> Vec<f32> {
        let narrow = |v: f64| v.max(0.0) as f32;
        let [red, green, blue] = channels else {
            return channels.iter().take(1).flatten().copied().map(narrow).collect();
        };
        let rgb = (0..red.len()).map(|i| [red[i], green[i], blue[i]].map(narrow));
        match self {
            Self::One { channel, .. } => rgb.map(|rgb| channel.of(rgb)).collect(),
            Self::Three(lasers) => rgb.map(|rgb| lasers.drive(rgb).values[index]).collect(),
        }
    }
}

/// A panel of looks: from where a hologram is seen, and what should be seen from there.
#[derive(Clone, Debug)]
pub struct Judge {
    sight: Sight,
    colour: Colour,
    looks: Vec<Look>,
    /// The first so many decide about the gain and make the figures.
    counted: usize,
    /// Radiance over white's: of each laser, of each look, on the retina.
    wanted: Vec<Vec<Vec<f32>>>,
    /// Depth of what the middle view shows, on the retina [m].
    depths: Option<Vec<f32>>,
    /// Diameter of the pupil, or least width of the views that it takes in [m].
    width: f64,
    views: usize,
}

/// What is seen of the exposures so far.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Intensities summed over exposures: of each laser, of each look, on the retina.
    intensity: Vec<Vec<Vec<f32>>>,
    /// Light of each laser.
    light: Vec<Account>,
}

/// Where the light of one laser's exposures goes; energies are sums over exposures.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    exposures: usize,
    /// What leaves the panel.
    panel: f64,
    /// Mean of what enters the pupil of a look.
    pupil: f64,
    /// What enters some pupil of the eye box.
    eye_box: f64,
}

/// Most samples of all pictures together: 3 lasers × 100 looks × half a million.
const MOST: usize = 1 << 28;

impl Judge {
    /// Gets ready what should be seen. The retina samples the light field's window at half of what the pupil resolves, λZ/(2D), of
    /// three lasers in the light of the shortest wavelength. A pupil that takes all sees the mean of all views, in the cells of the
    /// light field's window; then looks differ by their foci only.
    ///
    /// # Errors
    /// As [`Viewer::check`]; [`Error::OutOfRange`] without looks, for views at another distance than the eye, for a look outside of
    /// them and for a focus at or before the eye; [`Error::Interrupted`].
    pub fn new(
        light_field: &LightField,
        viewer: &Viewer,
        colour: Colour,
        looks: Vec<Look>,
        progress: &Progress,
    ) -> Result<Self> {
        viewer.check()?;
        let pupil = match viewer.pupil {
            Pupil::Diameter(pupil) => pupil,
            Pupil::All => f64::INFINITY,
        };
        let distance = light_field.eyes.distance;
        if (distance - viewer.eye.z).abs() > 1e-6 * distance {
            let limit = format!("is not the light field's, {distance} m");
            return Err(Error::out_of_range("eye", format_args!("z = {} m", viewer.eye.z), limit));
        }
        if let Some(look) = looks.iter().find(|look| !(look.focus < distance && look.pupil.is_finite())) {
            let limit = format!("must be below the eye's, {distance} m");
            return Err(Error::out_of_range("focus", format_args!("{} m", look.focus), limit));
        }
        let wavelengths = colour.wavelengths();
        let shortest = wavelengths.iter().copied().fold(f64::INFINITY, f64::min);
        let retina = match viewer.pupil {
            Pupil::Diameter(pupil) => retina(&light_field.window, shortest * distance / (2.0 * pupil))?,
            Pupil::All => light_field.window,
        };
        if looks.is_empty() || retina.len() * looks.len() * wavelengths.len() > MOST {
            return Err(Error::out_of_range("looks", looks.len(), "must be some, and fit the memory"));
        }
        let (middle, half_box) = (viewer.eye.truncate(), 0.5 * viewer.eye_box);
        let sight = Sight { distance, pupil, retina, middle, half_box };
        let (lattice, times) = wanted::lattice(light_field, &retina)?;
        progress.start("what should be seen", looks.len() as u64);
        let mut wanted = vec![Vec::with_capacity(looks.len()); wavelengths.len()];
        for look in &looks {
            progress.check()?;
            let channels = wanted::through_pupil(light_field, &sight, look, &lattice)?;
            for (index, (wanted, wavelength)) in wanted.iter_mut().zip(&wavelengths).enumerate() {
                let radiance = colour.radiance(&channels, index);
                wanted.push(wanted::diffracted(&radiance, &lattice, times, &sight, *wavelength, progress));
            }
            progress.advance(1);
        }
        progress.check()?;
        let depths = light_field.middle_depths.as_ref().map(|depths| {
            let (from, count) = (&light_field.window, retina.len());
            let near = |place: f64, side: usize| place.round().clamp(0.0, side as f64 - 1.0) as usize;
            let row = |i: usize| near(from.row(retina.y(i / retina.width)), from.height);
            let column = |i: usize| near(from.column(retina.x(i % retina.width)), from.width);
            (0..count).map(|i| depths[row(i) * from.width + column(i)]).collect()
        });
        let eyes = &light_field.eyes;
        let width = pupil.min(eyes.spacing * eyes.columns.min(eyes.rows) as f64);
        Ok(Self { sight, colour, counted: looks.len(), looks, wanted, depths, width, views: eyes.count() })
    }

    /// Lets only the first `count` looks (at least one) decide about the gain and make the figures: the others are looked at.
    pub fn counting(mut self, count: usize) -> Self {
        self.counted = count.clamp(1, self.looks.len());
        self
    }

    /// The looks.
    pub fn looks(&self) -> &[Look] {
        &self.looks
    }

    /// Where the pictures sample the panel's plane, as the pupil's middle sees it.
    pub fn retina(&self) -> &Grid {
        &self.sight.retina
    }

    /// Before anything is seen.
    pub fn begin(&self) -> Seen {
        let dark = || vec![vec![0.0; self.sight.retina.len()]; self.looks.len()];
        let lasers = self.wanted.len();
        Seen { intensity: (0..lasers).map(|_| dark()).collect(), light: vec![Account::default(); lasers] }
    }

    /// How good what is seen is.
    pub fn figures(&self, seen: &Seen) -> SeenBy {
        figures::of(self, seen)
    }

    /// Linear picture of what a pinhole sees from the light field's middle, all of it sharp; white is 1.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn pinhole(&self, light_field: &LightField) -> Result<Reconstruction> {
        let channels = wanted::pinhole(light_field, &self.sight.retina)?;
        Ok(self.picture(|laser| self.colour.radiance(&channels, laser)))
    }

    /// Linear picture of what should be seen at a look; white is 1.
    pub fn wanted(&self, look: usize) -> Reconstruction {
        self.picture(|laser| self.wanted[laser][look].clone())
    }

    /// Linear picture of what is seen at a look; white is 1 after the gain that makes all looks most like what they should be.
    pub fn seen(&self, seen: &Seen, look: usize) -> Reconstruction {
        self.seen_with(seen, look, figures::gain(self, seen))
    }

    /// The same with this factor on amplitudes.
    fn seen_with(&self, seen: &Seen, look: usize, gain: f64) -> Reconstruction {
        self.picture(|laser| seen.of(laser, look).iter().map(|v| v * (gain * gain) as f32).collect())
    }

    fn picture(&self, values: impl Fn(usize) -> Vec<f32>) -> Reconstruction {
        let (width, height) = (self.sight.retina.width, self.sight.retina.height);
        let one = |laser| Picture { width, height, values: values(laser) };
        match &self.colour {
            Colour::One { .. } => Reconstruction::Gray(one(0)),
            Colour::Three(lasers) => Reconstruction::Color(ColorPicture::combine(lasers, &[one(0), one(1), one(2)])),
        }
    }
}

impl Seen {
    /// Adds an exposure: the field just behind the panel in the light of a laser (0 to 2, falling wavelengths; 0 without lasers),
    /// seen through the stop in the Fourier plane of a relay, if there is one. Exposures of one laser are averaged.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a laser that there is not, or a field in another's light; [`Error::OutOfRange`] for an eye box
    /// with too many samples; [`Error::Interrupted`].
    pub fn add(
        &mut self,
        judge: &Judge,
        field: &Field,
        stop: Option<&Aperture>,
        laser: usize,
        progress: &Progress,
    ) -> Result<()> {
        let wavelengths = judge.colour.wavelengths();
        if wavelengths.get(laser).is_none_or(|w| (w - field.wavelength).abs() > 1e-6 * w) {
            let what = format!("laser {laser} at {} m is none of those that the picture has", field.wavelength);
            return Err(Error::parameter("exposure", what));
        }
        let stopped;
        let passed = match stop {
            Some(stop) => {
                stopped = through_stop(field, stop, progress)?;
                &stopped
            }
            None => field,
        };
        progress.start("what is seen", judge.looks.len() as u64 + 1);
        let area = field.grid.pitch_x * field.grid.pitch_y;
        if judge.sight.pupil.is_infinite() {
            let account = &mut self.light[laser];
            account.exposures += 1;
            account.panel += field.energy() * area;
            account.pupil += passed.energy() * area;
            account.eye_box += passed.energy() * area;
            for (look, sum) in judge.looks.iter().zip(&mut self.intensity[laser]) {
                let seen = whole::on_retina(passed, &judge.sight, look, progress)?;
                sum.iter_mut().zip(seen).for_each(|(sum, v)| *sum += v as f32);
                progress.advance(1);
            }
            return Ok(());
        }
        let plane = EyePlane::of(passed, &judge.sight, &judge.looks, progress)?;
        progress.advance(1);
        let account = &mut self.light[laser];
        account.exposures += 1;
        account.panel += field.energy() * area;
        let radius = 0.5 * judge.sight.pupil;
        account.eye_box += plane.energy(|e| {
            let outside = ((e - judge.sight.middle).abs() - judge.sight.half_box).max(DVec2::ZERO);
            f64::from(u8::from(outside.length() <= radius))
        });
        for look in &judge.looks[..judge.counted] {
            account.pupil += plane.entering(&judge.sight, look) / judge.counted as f64;
        }
        for (look, sum) in judge.looks.iter().zip(&mut self.intensity[laser]) {
            let seen = plane.on_retina(&judge.sight, look, progress)?;
            sum.iter_mut().zip(seen).for_each(|(sum, v)| *sum += v as f32);
            progress.advance(1);
        }
        Ok(())
    }

    /// Mean intensity over a laser's exposures at a look.
    fn of(&self, laser: usize, look: usize) -> Vec<f32> {
        let share = 1.0 / self.light[laser].exposures.max(1) as f32;
        self.intensity[laser][look].iter().map(|v| v * share).collect()
    }
}

/// A lattice over a window with cells of at most `pitch` [m].
fn retina(window: &Grid, pitch: f64) -> Result<Grid> {
    let count = |extent: f64| (extent / pitch - 1e-6).ceil().max(1.0);
    let (width, height) = (count(window.extent_x()), count(window.extent_y()));
    if !(1.0..=f64::from(1u32 << 24)).contains(&(width * height)) {
        let what = format_args!("{width} × {height} cells that the pupil resolves");
        return Err(Error::out_of_range("window", what, "are too many"));
    }
    let grid = Grid::new(width as usize, height as usize, window.extent_x() / width, window.extent_y() / height)?;
    Ok(grid.centered_at(window.center))
}

/// Samples of darkness round a panel whose field goes through a relay's stop: the stop's blur does not come in again on the other
/// side.
const DARK: usize = 64;

/// The field behind a relay with a stop in its Fourier plane.
fn through_stop(field: &Field, stop: &Aperture, progress: &Progress) -> Result<Field> {
    let grid = field.grid;
    let padded = |side: usize| fast_length(side + DARK, 1, &[1]);
    let space = Grid::new(padded(grid.width), padded(grid.height), grid.pitch_x, grid.pitch_y)?;
    let mut samples = vec![Complex64::new(0.0, 0.0); space.len()];
    for (line, own) in samples.chunks_mut(space.width).zip(field.samples.chunks(grid.width)) {
        line.iter_mut().zip(own).for_each(|(to, u)| *to = Complex64::new(u.re.into(), u.im.into()));
    }
    let transfer = |column: usize, samples: &mut [Complex64]| {
        let fx = space.frequency_x(column);
        for (row, u) in samples.iter_mut().enumerate() {
            if !stop.passes(fx, space.frequency_y(row)) {
                *u = Complex64::new(0.0, 0.0);
            }
        }
    };
    Fft2::new(space.width, space.height).filter(&mut samples, grid.height, grid.height, transfer, progress);
    progress.check()?;
    let own = samples.chunks(space.width).take(grid.height).flat_map(|line| &line[..grid.width]).copied().collect();
    Ok(Field { grid, wavelength: field.wavelength, samples: own }.to_f32())
}

#[cfg(test)]
mod tests;
