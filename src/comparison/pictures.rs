//! The pictures of the table: a flat one with all that is hard to show, and scenes.

use crate::encode::pictures::DepthPicture;
use crate::error::Result;
use crate::panel::{PanelProfile, Setup};
use crate::pipeline;
use crate::points::trace::TraceSettings;
use crate::points::{Channel, SceneSettings};
use crate::progress::Progress;
use std::path::Path;

/// Depths of the comparison's pictures behind the panel, nearest and farthest, in widths of the panel: 20 and 40 mm for
/// a panel of 512 columns of 8 µm, so that a plane's light spreads over about half of the panel at any size.
const DEPTHS: [f64; 2] = [4.9, 9.8];

/// Depth of plane `k` of `count`, from the nearest to the farthest [m].
fn depth(profile: &PanelProfile, k: usize, count: usize) -> f64 {
    let share = if count > 1 { k as f64 / (count - 1) as f64 } else { 0.5 };
    // The spread at a depth grows with it, the panel with its width: at another size the same share is lit.
    let width = profile.width as f64 * profile.pitch_x;
    -(DEPTHS[0] + (DEPTHS[1] - DEPTHS[0]) * share) * width
}

/// A picture on one plane: a wedge of grays, discs, bars from wide to fine, a slanted edge and a smooth hill, on a gray that
/// is bright enough for speckle to show. Half of the panel's resolution: what half of its band can carry.
pub fn flat_picture(profile: &PanelProfile) -> DepthPicture {
    let (width, height) = (profile.width / 2, profile.height / 2);
    let smooth = |edge: f64, x: f64, softness: f64| (0.5 + (edge - x) / softness).clamp(0.0, 1.0);
    let one = |i: usize| -> f32 {
        // −1 … 1 upwards and to the right.
        let x = 2.0 * ((i % width) as f64 + 0.5) / width as f64 - 1.0;
        let y = 1.0 - 2.0 * ((i / width) as f64 + 0.5) / height as f64;
        let soft = 6.0 / width as f64;
        let mut light = 0.35;
        if y > 0.6 {
            // The wedge: nine steps.
            light = (((x + 1.0) * 4.5).floor() + 1.0) / 9.0;
        } else if y < -0.6 {
            // Bars of 3, 6, 9 … periods a sixth of the width.
            let part = ((x + 1.0) * 3.0).floor();
            let periods = 2.0 + 1.5 * part;
            light = 0.5 + 0.4 * (std::f64::consts::TAU * periods * ((x + 1.0) * 3.0).fract()).cos();
        } else if x < -0.2 {
            for (cx, cy, radius, value) in [(-0.75, 0.2, 0.2, 1.0), (-0.45, -0.25, 0.16, 0.05), (-0.8, -0.35, 0.1, 0.7)]
            {
                let inside = smooth(radius, (x - cx).hypot(0.75 * (y - cy)), soft);
                light = light * (1.0 - inside) + value * inside;
            }
        } else if x < 0.4 {
            let inside = smooth(0.1 + 0.25 * y, x, soft);
            light = light * (1.0 - inside) + 0.9 * inside;
        } else {
            light = 0.1 + 0.9 * (-((x - 0.7) / 0.18).powi(2) - (y / 0.35).powi(2)).exp();
        }
        light as f32
    };
    DepthPicture::flat(width, height, (0..width * height).map(one).collect(), depth(profile, 0, 1))
}

/// A scene's traced picture, sorted by depth into `planes` slices of equal thickness.
///
/// # Errors
/// As [`pipeline::points`].
pub fn scene_picture(scene: &Path, setup: &Setup, planes: usize, progress: &Progress) -> Result<DepthPicture> {
    let profile = &setup.profile;
    let side = (0.75 * profile.height as f64 / 2.0).round().max(16.0) as u32;
    let settings = SceneSettings {
        trace: TraceSettings { width: side, height: side, ..TraceSettings::default() },
        ..SceneSettings::default()
    };
    let lit = pipeline::scene(scene, &settings, progress)?;
    let points = pipeline::points(&lit, &settings, setup, progress)?;
    let (view, white) = (&points.view, points.white.white);
    let values: Vec<f32> =
        view.picture.iter().map(|rgb| Channel::Luminance.of(*rgb).clamp(0.0, white) / white).collect();
    let farthest = view.depths.iter().flatten().fold(0.0f64, |a, &z| a.min(z));
    let z: Vec<f64> = view.depths.iter().map(|z| z.unwrap_or(farthest)).collect();
    // Slices of equal thickness: objects at a few depths come apart.
    let nearest = z.iter().fold(f64::NEG_INFINITY, |a, &z| a.max(z));
    let thickness = ((nearest - farthest) / planes.max(1) as f64).max(f64::MIN_POSITIVE);
    let plane = z.iter().map(|z| (((nearest - z) / thickness) as usize).min(planes.saturating_sub(1))).collect();
    let depths = (0..planes).map(|k| depth(profile, k, planes)).collect();
    Ok(DepthPicture { width: view.width, height: view.height, light: values, plane, depths })
}
