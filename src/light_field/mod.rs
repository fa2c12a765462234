//! What an eye anywhere in an eye box sees of a lit scene: pinhole views of it, and the pictures through a pupil that they make.
//!
//! A light field is radiance L(e, q) over eye points e on a plane z = Z before the panel and points q of the panel's plane z = 0
//! (the two-plane parametrisation of Levoy & Hanrahan, 1996). Each *view* is what a pinhole at one eye point sees through the
//! panel: pixel q shows the light that goes from q to e. Whether it comes straight from a surface, by way of a mirror or through
//! glass makes no difference to it; occlusion, mirrors and gloss change rightly from view to view.
//!
//! An eye with a pupil about p that focuses on the plane z sees the mean of the views in its pupil, each sheared so that what
//! stands at z coincides:
//!
//! ```text
//! T(q; p, z) = ∫ L(p + d, q + d·(1 − Z/(Z − z))) dd / ∫ dd,   then blurred by the pupil's own diffraction
//! ```
//!
//! in the coordinate q of the panel's plane as the pupil's middle sees it. It is incoherent: no laser, no speckle. Encodings are
//! made after it, and every picture of a hologram is judged against it.
//!
//! It is made of a lit scene ([`LightField::of_scene`]), of a point cloud ([`LightField::of_cloud`]) or of layers ([`layers`]),
//! and written to files that other programs read, and read from them ([`mod@file`], [`folder`]).
//!
//! ```
//! use holodrive::glam::{DVec2, DVec3};
//! use holodrive::field::Grid;
//! use holodrive::light_field::{EyeGrid, LightField, LightFieldSettings, Viewer};
//! use holodrive::points::{LitScene, SceneSettings};
//! use holodrive::progress::Progress;
//!
//! let (panel, progress) = (Grid::new(1920, 1080, 8e-6, 8e-6)?, Progress::new());
//! let mut settings = SceneSettings::default();
//! settings.illumination = settings.illumination.coarse();
//! (settings.trace.width, settings.trace.height) = (40, 40);
//! let lit = LitScene::load("scenes/cornell.gltf".as_ref(), &settings, &progress)?;
//! // The points fix where the room stands before the panel.
//! let placing = lit.points(lit.camera(), &settings, &panel, 532e-9, &progress)?.view.placing;
//! // An eye 0.6 m before the panel, and one 6 mm to its right; 60 × 60 pixels on the panel's height.
//! let eyes = EyeGrid::over(DVec3::new(3e-3, 0.0, 0.6), DVec2::new(6e-3, 0.0), 6e-3)?;
//! let window = Grid::new(60, 60, 144e-6, 144e-6)?;
//! let (seen, report) =
//!     LightField::of_scene(&lit, &placing, &LightFieldSettings::default(), eyes, window, &progress)?;
//! assert_eq!((report.views, seen.channels.len()), (2, 1));
//! // The lamp stands in the upper half of each view.
//! let brightest = (0..3600).max_by_key(|&pixel| seen.view(0, 0)[pixel]);
//! assert!(brightest.is_some_and(|pixel| pixel / 60 < 30));
//! // All of the room stands behind the panel: an eye that moves to the right sees it move to the right on the panel, what
//! // stands farther more.
//! assert!(seen.depth[0] < -0.09 && seen.depth[1] > -0.151);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod cloud;
mod codes;
mod exposure;
pub mod file;
pub mod folder;
pub mod layers;
mod points;
mod resample;
pub(crate) mod retina;
mod scene;
mod settings;
mod source;
mod view_sequence;

pub use layers::Layer;
pub use retina::{Look, Retina};
pub use settings::{LightFieldReport, LightFieldSettings};
pub use source::LightSource;
pub use view_sequence::{ViewSequence, ViewSequenceReport};

use crate::error::{Error, Result};
use crate::field::{Grid, grid};
use glam::{DVec2, DVec3};

/// What an eye's pupil takes in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pupil {
    /// A pupil of this diameter [m].
    Diameter(f64),
    /// All that the panel sends: an eyepiece, a camera, a 4-f bench.
    All,
}

/// Who looks, and from where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewer {
    /// Middle of the eye box in the hologram frame [m]; z > 0.
    pub eye: DVec3,
    /// The pupil.
    pub pupil: Pupil,
    /// Width and height of the box that the pupil's middle moves in [m]; zero for an eye whose place is known.
    pub eye_box: DVec2,
}

impl Default for Viewer {
    /// An eye at a known place, 0.6 m before the panel's middle.
    fn default() -> Self {
        Self::at(DVec3::new(0.0, 0.0, 0.6))
    }
}

impl Viewer {
    /// Diameter of an eye's pupil in a room [m].
    pub const PUPIL: f64 = 4e-3;

    /// An eye at a known place with a pupil of [`Viewer::PUPIL`].
    pub fn at(eye: DVec3) -> Self {
        Self { eye, pupil: Pupil::Diameter(Self::PUPIL), eye_box: DVec2::ZERO }
    }

    /// Checks that there is an eye that can look.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an eye that is not in front of the panel, a pupil that is not positive, a negative box;
    /// [`Error::Parameter`] for a box where all of the light is taken in.
    pub fn check(&self) -> Result<()> {
        if !(self.eye.is_finite() && self.eye.z > 0.0) {
            return Err(Error::out_of_range("eye", self.eye, "must stand in front of the panel, z > 0"));
        }
        if let Pupil::Diameter(pupil) = self.pupil {
            crate::field::grid::positive("pupil", pupil)?;
        }
        if !(self.eye_box.is_finite() && self.eye_box.min_element() >= 0.0) {
            return Err(Error::out_of_range("eye box", self.eye_box, "must not be negative"));
        }
        if self.pupil == Pupil::All && self.eye_box != DVec2::ZERO {
            return Err(Error::parameter("eye box", "means nothing where all of the panel's light is taken in"));
        }
        Ok(())
    }
}

/// Where the views of a light field stand: a lattice on the plane z = `distance`, row 0 on top, column 0 at the smallest x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeGrid {
    /// Distance Z of the plane before the panel [m].
    pub distance: f64,
    /// Middle of the lattice [m].
    pub center: DVec2,
    /// Distance of neighbouring eye points [m].
    pub spacing: f64,
    /// Columns of eye points.
    pub columns: usize,
    /// Rows of eye points.
    pub rows: usize,
}

impl EyeGrid {
    /// Widest distance of neighbouring views with which pictures through a pupil are smooth [m].
    pub const SPACING: f64 = 0.5e-3;
    /// Most views of one light field.
    pub const MOST: usize = 1 << 20;

    /// The lattice that covers every pupil of a viewer, with views at most `spacing` [m] apart.
    ///
    /// # Errors
    /// As [`Viewer::check`]; [`Error::Parameter`] for [`Pupil::All`], whose extent only a panel knows.
    pub fn covering(viewer: &Viewer, spacing: f64) -> Result<Self> {
        viewer.check()?;
        let Pupil::Diameter(pupil) = viewer.pupil else {
            return Err(Error::parameter("pupil", "has no diameter; say how wide the views spread"));
        };
        Self::over(viewer.eye, viewer.eye_box + DVec2::splat(pupil), spacing)
    }

    /// The lattice about an eye that covers `extent` (width, height) [m].
    ///
    /// # Errors
    /// [`Error::Parameter`] for a spacing that is not positive or more than 2²⁰ views.
    pub fn over(eye: DVec3, extent: DVec2, spacing: f64) -> Result<Self> {
        crate::field::grid::positive("view spacing", spacing)?;
        let count = |side: f64| (side / spacing).ceil() + 1.0;
        let (columns, rows) = (count(extent.x), count(extent.y));
        if (columns * rows).is_nan() || columns * rows > Self::MOST as f64 {
            return Err(Error::out_of_range("eye box", format_args!("{columns} × {rows} views"), "are too many"));
        }
        Ok(Self { distance: eye.z, center: eye.truncate(), spacing, columns: columns as usize, rows: rows as usize })
    }

    /// Checks that there are eye points, before the panel.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a lattice without points or behind the panel.
    pub fn check(&self) -> Result<()> {
        grid::positive("distance of the views", self.distance)?;
        grid::positive("view spacing", self.spacing)?;
        if !self.center.is_finite() {
            return Err(Error::out_of_range("middle of the views", self.center, "must be finite"));
        }
        if self.columns.checked_mul(self.rows).is_none_or(|n| n == 0 || n > Self::MOST) {
            let what = format_args!("{} × {}", self.columns, self.rows);
            return Err(Error::out_of_range("views", what, format!("must be 1 to {}", Self::MOST)));
        }
        Ok(())
    }

    /// Number of views.
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Where view `index` (row × columns + column) stands in the hologram frame [m].
    pub fn position(&self, index: usize) -> DVec3 {
        let (column, row) = (index % self.columns, index / self.columns);
        let at = |i: usize, count: usize| (i as f64 - 0.5 * (count as f64 - 1.0)) * self.spacing;
        let (x, y) = (at(column, self.columns), -at(row, self.rows));
        DVec3::new(self.center.x + x, self.center.y + y, self.distance)
    }
}

/// Pinhole views of a lit scene over an eye box.
///
/// Radiance is in units of the picture's white: 1 is shown as white. It is kept as amplitude, √(L/peak) in 16 bits.
#[derive(Clone, Debug, PartialEq)]
pub struct LightField {
    /// Where the views stand.
    pub eyes: EyeGrid,
    /// Pixels of each view, on the panel's plane.
    pub window: Grid,
    /// One channel, or linear red, green and blue: each all views, one after another, row-major.
    pub channels: Vec<Vec<u16>>,
    /// Radiance of the largest code over white's.
    pub peak: f32,
    /// Depths z between which the light comes from, nearest and farthest [m].
    pub depth: [f64; 2],
    /// Depth z of each pixel of the middle view, where it is known [m].
    pub middle_depths: Option<Vec<f32>>,
}

impl LightField {
    /// The code of the largest radiance.
    pub const FULL: f32 = 65535.0;
    /// Most samples of all views and channels: 4 GB.
    pub const MOST_SAMPLES: usize = 1 << 31;

    /// One that shows nothing yet.
    ///
    /// # Errors
    /// As [`EyeGrid::check`]; [`Error::Memory`] where its samples are more than any machine here holds.
    pub fn black(eyes: EyeGrid, window: Grid, channels: usize) -> Result<Self> {
        eyes.check()?;
        let samples = eyes.count().saturating_mul(window.len());
        if samples.saturating_mul(channels) > Self::MOST_SAMPLES {
            return Err(Error::Memory {
                what: "the light field",
                needed: (samples.saturating_mul(2 * channels) >> 20) as u64,
                budget: ((2 * Self::MOST_SAMPLES) >> 20) as u64,
                hint: "fewer or smaller views take less".into(),
            });
        }
        let channels = (0..channels).map(|_| vec![0; samples]).collect();
        Ok(Self { eyes, window, channels, peak: 1.0, depth: [0.0; 2], middle_depths: None })
    }

    /// Pixels of one view.
    pub fn pixels(&self) -> usize {
        self.window.len()
    }

    /// Code of a radiance over white's.
    pub fn code(radiance: f32, peak: f32) -> u16 {
        ((radiance.max(0.0) / peak).min(1.0).sqrt() * Self::FULL + 0.5) as u16
    }

    /// Radiance over white's of a code.
    pub fn radiance(&self, code: u16) -> f32 {
        let amplitude = f32::from(code) / Self::FULL;
        amplitude * amplitude * self.peak
    }

    /// One channel of one view.
    pub fn view(&self, channel: usize, index: usize) -> &[u16] {
        &self.channels[channel][index * self.pixels()..][..self.pixels()]
    }

    /// The view that stands in the middle.
    pub fn middle(&self) -> usize {
        (self.eyes.rows / 2) * self.eyes.columns + self.eyes.columns / 2
    }

    /// Bytes that it takes.
    pub fn memory(&self) -> usize {
        self.channels.iter().map(|channel| 2 * channel.len()).sum()
    }
}
