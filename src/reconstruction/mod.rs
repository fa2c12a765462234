//! What an eye or a sensor sees of a field: numerically, and every figure of it is simulated.
//!
//! The field leaves the panel at z = 0. Its image at depth z is the field carried to that plane by the exact angular
//! spectrum, forwards for z > 0, backwards for the virtual image behind the panel. An eye is a pupil: the field is
//! carried to the pupil's plane, cut by it, and carried back to the plane that the eye focuses on, which is the image
//! on the retina up to its scale, upright.
//!
//! ```
//! use holodrive::glam::{DVec2, DVec3};
//! use holodrive::field::Grid;
//! use holodrive::hologram::{HologramSettings, compute, plan};
//! use holodrive::points::PointSource;
//! use holodrive::progress::Progress;
//! use holodrive::reconstruction::{View, ViewSettings, picture};
//!
//! // A point 5 cm behind the panel is seen at its place: cells are 20 µm, row 0 is on top.
//! let panel = Grid::new(200, 200, 8e-6, 8e-6)?;
//! let point = [PointSource { position: DVec3::new(2.1e-4, -1.1e-4, -0.05), amplitude: 1.0, phase: 0.0 }];
//! let plan = plan(&point, &panel, 532e-9, &HologramSettings::default())?;
//! let field = compute(&point, &panel, 532e-9, &plan, &Progress::new())?.field;
//! let (view, half) = (View::Plane { z: -0.05 }, DVec2::splat(5e-4));
//! let seen = picture(&field, &view, half, (50, 50), &ViewSettings::default(), &Progress::new())?;
//! let brightest = (0..2500).max_by(|&a, &b| seen.values[a].total_cmp(&seen.values[b]));
//! assert_eq!(brightest, Some(30 * 50 + 35));
//! # Ok::<(), holodrive::Error>(())
//! ```

pub mod canvas;
pub mod colour;
mod flat_field;
mod gallery;
mod light;
pub mod metrics;
pub mod orders;
mod picture;
pub mod seen;
mod sharpest;

pub use canvas::Canvas;
pub use colour::ColorPicture;
use flat_field::Cone;
pub use gallery::{Gallery, Shot, Target};
pub use light::{ExposureLight, Light, Reconstruction};
pub use orders::{Orders, orders};
pub use picture::{Picture, Scale, read_gray, write_coded_png, write_rgb_png};
pub use seen::{Colour, Seeing, SeenGallery};
pub use sharpest::{Sharpest, sharpest};

use crate::error::{Error, Result};
use crate::field::{Field, Grid, grid};
use crate::progress::Progress;
use crate::propagation::{Aperture, Propagator, Settings};
use glam::DVec2;

/// Pixels of a picture, and samples of the plane in focus, at most: some gigabytes of memory.
const MOST_PIXELS: usize = 1 << 28;
const MOST_SAMPLES: f64 = (1u64 << 30) as f64;

/// From where and at what depth the field is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// A sensor on the plane z [m] (or behind the panel the virtual image there), with the whole panel as aperture.
    Plane {
        /// Depth of the plane [m]; negative behind the panel.
        z: f64,
    },
    /// An eye or camera.
    Eye {
        /// Middle of the pupil in the hologram frame [m]; z > 0.
        position: [f64; 3],
        /// Diameter of the pupil [m].
        pupil: f64,
        /// Depth that it focuses on, z [m].
        focus: f64,
    },
}

impl View {
    /// Depth that is in focus, z [m].
    pub fn focus(&self) -> f64 {
        match *self {
            Self::Plane { z } => z,
            Self::Eye { focus, .. } => focus,
        }
    }

    /// Half size [m] of what is seen through a panel in the plane of focus: the panel's own, widened behind it (and
    /// narrowed in front of it) along the rays of an eye. A view on a plane has the eye that it is given, if any.
    pub fn seen_half(&self, panel: &Grid, eye: Option<[f64; 3]>) -> DVec2 {
        let half = 0.5 * DVec2::new(panel.extent_x(), panel.extent_y());
        let distance = match *self {
            Self::Eye { position, .. } => Some(position[2]),
            Self::Plane { .. } => eye.map(|eye| eye[2]),
        };
        match distance {
            Some(eye) if eye > 0.0 && self.focus() < eye => half * ((eye - self.focus()) / eye),
            _ => half,
        }
    }
}

/// The greatest rectangle inside of ±`half` [m], about its middle, that a picture of `width × height` pixels fills with square ones.
pub fn square_half(half: DVec2, (width, height): (usize, usize)) -> DVec2 {
    let pixels = DVec2::new(width.max(1) as f64, height.max(1) as f64);
    pixels * (half / pixels).min_element()
}

/// Planes to look at, with their names, where no more is known than the range of depths z [m].
pub fn planes_of(depth: Option<[f64; 2]>) -> Vec<(&'static str, f64)> {
    match depth {
        Some([near, far]) if (near - far).abs() > 1e-6 => {
            vec![("near", near), ("middle", 0.5 * (near + far)), ("far", far)]
        }
        Some([near, _]) => vec![("near", near)],
        None => vec![("panel", 0.0)],
    }
}

/// How a field is looked at, beside the view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewSettings {
    /// Stop in the Fourier plane of a relay after the panel: keeps the conjugate orders of an encoding out.
    pub aperture: Option<Aperture>,
    /// Propagation settings (memory budget).
    pub propagation: Settings,
}

impl ViewSettings {
    /// Puts an opaque disc into the Fourier plane that takes out what leaves the panel within `angle` [rad] of its
    /// normal: the light that dead space and curve errors leave unmodulated. Without an aperture there is no such plane,
    /// and nothing happens.
    pub fn block_zero_order(&mut self, angle: f64, wavelength: f64) {
        if let Some(aperture) = &mut self.aperture {
            aperture.stop = angle.sin().abs() / wavelength;
        }
    }
}

/// Intensity |u|² of the view on the rectangle of half size `half` [m] about the middle of its focal plane, on samples
/// of the field's pitch.
///
/// # Errors
/// [`Error::Parameter`] for an eye that is not in front of the panel, a pupil that is not positive, a window without
/// extent; [`Error::Memory`] past the budget.
pub fn intensity(
    field: &Field,
    view: &View,
    half: DVec2,
    settings: &ViewSettings,
    progress: &Progress,
) -> Result<(Grid, Vec<f32>)> {
    field.check_samples()?;
    let window = window(&field.grid, half)?;
    let seen = match *view {
        View::Plane { z } => Propagator::new(field.grid, window, settings.propagation)?.propagate_through(
            field,
            z,
            settings.aperture.as_ref(),
            progress,
        )?,
        View::Eye { position, pupil, focus } => {
            let at_pupil = at_pupil(field, position, pupil, settings, progress)?;
            Propagator::new(at_pupil.grid, window, settings.propagation)?.propagate(
                &at_pupil,
                focus - position[2],
                progress,
            )?
        }
    };
    Ok((window, seen.intensity()))
}

/// The field on the pupil's plane, dark outside the pupil.
fn at_pupil(
    field: &Field,
    position: [f64; 3],
    pupil: f64,
    settings: &ViewSettings,
    progress: &Progress,
) -> Result<Field> {
    if !(position.iter().all(|c| c.is_finite()) && position[2] > 0.0) {
        let place = format_args!("z = {} m", position[2]);
        return Err(Error::out_of_range("eye", place, "must stand in front of the panel"));
    }
    grid::positive("pupil", pupil)?;
    let grid = window(&field.grid, DVec2::splat(0.5 * pupil))?.centered_at([position[0], position[1]]);
    let mut cut = Propagator::new(field.grid, grid, settings.propagation)?.propagate_through(
        field,
        position[2],
        settings.aperture.as_ref(),
        progress,
    )?;
    for (index, u) in cut.samples.iter_mut().enumerate() {
        let (x, y) = (grid.x(index % grid.width) - position[0], grid.y(index / grid.width) - position[1]);
        if x.hypot(y) > 0.5 * pupil {
            *u = Default::default();
        }
    }
    Ok(cut)
}

/// Samples of a pitch that cover ±half; a length that is whole but for rounding takes none more.
fn cells(half: f64, pitch: f64) -> f64 {
    (2.0 * half / pitch - 1e-6).ceil()
}

/// A centred grid of the field's pitch that covers ±half.
fn window(field: &Grid, half: DVec2) -> Result<Grid> {
    let (width, height) = (cells(half.x, field.pitch_x), cells(half.y, field.pitch_y));
    // 2²⁰ samples a side are metres of plane: a window beyond is a slip in a unit.
    let most = (1 << 20) as f64;
    if !(width >= 1.0 && height >= 1.0 && width.max(height) <= most && width * height <= MOST_SAMPLES) {
        let size = format_args!("half size {} × {} m", half.x, half.y);
        return Err(Error::out_of_range("window", size, "cannot be sampled"));
    }
    Grid::new(width as usize, height as usize, field.pitch_x, field.pitch_y)
}

/// The picture of one view: intensity summed over `width × height` equal cells of the rectangle ±`half` [m].
pub fn picture(
    field: &Field,
    view: &View,
    half: DVec2,
    (width, height): (usize, usize),
    settings: &ViewSettings,
    progress: &Progress,
) -> Result<Picture> {
    if width.saturating_mul(height) > MOST_PIXELS {
        let what = format!("{width}×{height}");
        return Err(Error::out_of_range("size", what, format!("has too many pixels: {MOST_PIXELS} at most")));
    }
    let (grid, values) = intensity(field, view, half, settings, progress)?;
    Ok(Picture::from_samples(&grid, &values, half, width, height))
}

/// Distance of planes [m] between which defocus blurs by at most one cell of a picture of `width × height` cells over
/// ±`half` [m]: cell / tan θ, with θ the half angle of the light's cone, sin θ = λ·f_max.
pub fn focus_step(field: &Field, settings: &ViewSettings, half: DVec2, (width, height): (usize, usize)) -> f64 {
    let cell = (2.0 * half.x / width as f64).min(2.0 * half.y / height as f64);
    let frequency = settings.aperture.map_or(field.grid.limit_x(), |a| a.half[0].max(a.half[1]));
    let sine = (field.wavelength * frequency).clamp(1e-6, 0.9);
    cell / (sine / (1.0 - sine * sine).sqrt())
}

/// A picture in which every pixel is in focus: each is taken from the reconstruction at its own depth.
///
/// `depths` holds z [m] for each pixel of a `width × height` picture seen through a window that spans `half_at(z)` at
/// depth z; pixels without light have `None` and are taken from the farthest plane. The depths are sorted into planes
/// no farther than `step` [m] apart. Returns the picture and the number of planes.
pub fn all_in_focus(
    field: &Field,
    depths: &[Option<f64>],
    (width, height): (usize, usize),
    half_at: impl Fn(f64) -> DVec2,
    step: f64,
    settings: &ViewSettings,
    progress: &Progress,
) -> Result<(Picture, usize)> {
    if depths.len() != width * height {
        let what = format!("{} for the {width}×{height} pixels of the picture", depths.len());
        return Err(Error::parameter("depths", what));
    }
    let known = depths.iter().flatten();
    let near = known.clone().fold(f64::NEG_INFINITY, |a, &z| a.max(z));
    let far = known.fold(f64::INFINITY, |a, &z| a.min(z));
    if !(near.is_finite() && far.is_finite()) {
        return Err(Error::parameter("depths", "no pixel has a depth"));
    }
    grid::positive("step", step)?;
    let planes = ((near - far) / step).ceil().max(1.0) as usize;
    let thickness = (near - far) / planes as f64;
    let plane_of = |depth: Option<f64>| {
        let offset = (depth.unwrap_or(far) - far) / thickness.max(f64::MIN_POSITIVE);
        (offset as usize).min(planes - 1)
    };
    let mut out = Picture { width, height, values: vec![0.0; width * height] };
    progress.start("focus stack", planes as u64);
    for plane in 0..planes {
        if !depths.iter().any(|&d| plane_of(d) == plane) {
            progress.advance(1);
            continue;
        }
        let z = far + (plane as f64 + 0.5) * thickness;
        let seen = picture(field, &View::Plane { z }, half_at(z), (width, height), settings, progress)?;
        for ((value, &depth), seen) in out.values.iter_mut().zip(depths).zip(seen.values) {
            if plane_of(depth) == plane {
                *value = seen;
            }
        }
        progress.advance(1);
    }
    Ok((out, planes))
}

#[cfg(test)]
mod tests;
