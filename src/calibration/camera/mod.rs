//! A panel seen by a camera: everything that its profile may hold, from photos of a dot card and ten random patterns.
//!
//! The bench: a laser's beam falls on the panel, a lens of focal length f stands behind it, a camera near the lens's focal
//! plane. The camera sees the panel's Fourier transform: of light u(n) on pixel n, at ν cycles a pixel,
//!
//! ```text
//! u = exp(s + i·w) · (exp(iφ) + κ)        φ = Gaussian(σ) ∗ Σ c_m(x, y)·T_m(level)
//! I = a·∫|Σ u·exp(−i2πν·n)|² over the camera's pixel + b,        ν = mapping(pixel)
//! ```
//!
//! s and w (logarithm of the beam's amplitude, and wavefront error) are polynomials over the panel of degree 4 and 6, the
//! curve one of degree 5 in the level, whose coefficients are polynomials of degree 2 over the panel; σ is the crosstalk, κ
//! the unmodulated light, a and b each photo's exposure. Schroff et al. (arXiv 2408.07672, 2024) fit such a model by gradient
//! descent on the photos; here all numbers are smooth and few (107 and two a photo), so that least squares by Levenberg and
//! Marquardt come to rest in few steps, with the covariance of every number.
//!
//! Tilts are the mapping's own shift; the sign of all phases is the profile's, since phases of the other sign, seen by a camera
//! turned by half a turn, make the same photos.

mod descent;
mod dot_card;
mod dot_finder;
mod fit;
mod mapping;
mod measured;
mod model;
mod panel_light;
mod patterns;
mod photo;
mod registered;
mod shapes;
mod slopes;
mod solve;
mod zoom;

pub use fit::CameraBench;
pub use mapping::{MAPPING, Mapping};
pub use measured::{CameraFit, CameraReport};
pub use patterns::{PHOTO_ENDINGS, RANDOM, camera_frames, camera_photo_file, photo_file, photo_name};
pub use photo::CameraPhoto;
pub use registered::CameraView;

use crate::error::Result;
use crate::panel::PanelProfile;
use crate::progress::Progress;

/// Fits the panel and the bench to photos of [`camera_frames`], in their order, at a wavelength [m].
///
/// The camera must see the zero order and the square about it of half a cycle in `(width / 480)` pixels: an eighth of the
/// distance of the panel's orders for 1920 columns, 2 mm for 8 µm, 632.8 nm and 200 mm. Photos are linear in the light; pixels
/// at their photo's top count as saturated and are left out.
///
/// # Errors
/// [`crate::Error::Parameter`] for a panel that is no phase panel of liquid crystal, photos that are not eleven of one size,
/// a dot card that is not found, or photos that do not answer to the patterns; [`crate::Error::Interrupted`].
pub fn calibrate_camera(
    profile: &PanelProfile,
    wavelength: f64,
    bench: &CameraBench,
    photos: &[CameraPhoto],
    progress: &Progress,
) -> Result<CameraFit> {
    let found = fit::fit(profile, wavelength, bench, photos, progress)?;
    CameraFit::new(&found, profile, wavelength)
}
