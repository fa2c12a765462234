//! What the panel shows to a camera: the dot card, and random levels in squares of several sizes.

use super::dot_card;
use super::zoom::window;
use crate::calibration::series::{Entry, FrameSeries};
use crate::error::{Error, Result};
use crate::panel::{Frame, PanelKind, PanelProfile};
use crate::random::Random;
use std::path::{Path, PathBuf};

/// Number of random patterns.
pub const RANDOM: usize = 10;

/// Sides of the patterns' squares in lattice steps: large ones put light near the zero order, where it tells the unmodulated
/// light, small ones into all the window, where it tells curve and crosstalk.
const SIDES: [f64; RANDOM] = [8.0, 4.0, 2.0, 2.0, 2.0, 1.0, 1.0, 0.5, 0.5, 0.25];

/// Pixels of a lattice step: about 480 lattice samples over the panel's width.
pub(super) fn step(profile: &PanelProfile) -> usize {
    ((profile.width as f64 / 480.0).round() as usize).max(2)
}

/// Levels of random pattern `p`.
pub(super) fn levels(profile: &PanelProfile, p: usize) -> Vec<u16> {
    let side = ((SIDES[p] * step(profile) as f64) as usize).max(1);
    let last = (profile.levels() - 1) as u64;
    let mut out = Vec::with_capacity(profile.width * profile.height);
    for row in 0..profile.height {
        for column in 0..profile.width {
            let square = (row / side) as u64 * profile.width as u64 + (column / side) as u64;
            // Of a power of two of levels the lowest bits are any one.
            out.push((Random::new(0xca3 + p as u64, square).bits() & last) as u16);
        }
    }
    out
}

/// The frames to show to a camera, each with the name that its photo takes: `dots`, `random-0` … `random-9`.
///
/// # Errors
/// [`Error::Parameter`] for a panel that is no phase panel of liquid crystal; otherwise as [`crate::panel::drive`].
pub fn camera_frames(profile: &PanelProfile, wavelength: f64) -> Result<FrameSeries<'_>> {
    if profile.kind != PanelKind::PhaseLcos {
        let what = format!("{} is no phase panel of liquid crystal, whose curve is smooth in its levels", profile.name);
        return Err(Error::parameter("panel", what));
    }
    let make = move |k: usize| {
        let (cells, frame) = match k.checked_sub(1) {
            None => ("dot card".to_string(), dot_card::frame(profile, wavelength, window(step(profile)))?),
            Some(p) => {
                let side = ((SIDES[p] * step(profile) as f64) as usize).max(1);
                (
                    format!("random levels in squares of {side} pixels"),
                    Frame::new(profile, wavelength, levels(profile, p))?,
                )
            }
        };
        Ok(Entry { name: format!("{}.png", photo_name(k)), cells, frame })
    };
    Ok(FrameSeries::new("pattern", RANDOM + 1, make))
}

/// Name of frame `k` and its photo, without the ending.
pub fn photo_name(k: usize) -> String {
    k.checked_sub(1).map_or_else(|| "dots".into(), |p| format!("random-{p}"))
}

/// The file of photo `k` in a folder: its name with an ending that [`super::CameraPhoto::read`] knows.
///
/// # Errors
/// [`Error::Input`] where there is none, or more than one.
pub fn camera_photo_file(folder: &Path, k: usize) -> Result<PathBuf> {
    photo_file(folder, &photo_name(k))
}

/// Endings of the files that [`super::CameraPhoto::read`] knows.
pub const PHOTO_ENDINGS: [&str; 5] = ["npy", "png", "tif", "tiff", "bmp"];

/// The file of the photo of that name in a folder: with one of [`PHOTO_ENDINGS`].
///
/// # Errors
/// [`Error::Input`] where there is none, or more than one.
pub fn photo_file(folder: &Path, name: &str) -> Result<PathBuf> {
    let all = PHOTO_ENDINGS.map(|ending| folder.join(format!("{name}.{ending}")));
    let mut there = all.iter().filter(|path| path.exists());
    match (there.next(), there.next()) {
        (Some(path), None) => Ok(path.clone()),
        (None, _) if !folder.is_dir() => Err(Error::input(folder, "there is no such folder of photos")),
        (None, _) => Err(Error::input(folder, format!("no photo {name}.npy, .png, .tif or .bmp"))),
        (Some(one), Some(_)) => Err(Error::input(one, format!("one of several files named {name}; keep one"))),
    }
}
