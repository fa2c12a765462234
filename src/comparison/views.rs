//! Encodings side by side as an eye sees them: through its pupil, at places and foci that no optimisation has seen.
//!
//! The judge is [`crate::reconstruction::seen`]'s: wave optics in double precision against the light field. It shares no code with
//! the loss of the `view` encoding. Other encodings get the field of the scene's points, with random phases (another set for each
//! sub-frame) or with those of a wave that converges on the eye.

use crate::encode::view::Viewed;
use crate::encode::{DoublePhase, EncodeOptions, Encoding, ViewEncoding};
use crate::error::Result;
use crate::hologram::HologramSettings;
use crate::light_field::{EyeGrid, LightField, LightSource, Pupil, Viewer, layers};
use crate::panel::{Frame, Origin, Setup};
use crate::pipeline::{self, Bench};
use crate::points::placement::Phase;
use crate::points::{Channel, LitScene, Multiplexing, PointCloud, ScenePoints, SceneSettings, SubFrames, WhitePoint};
use crate::progress::Progress;
use crate::reconstruction::seen::SeenFigures;
use crate::reconstruction::{Colour, Seeing};
use glam::DVec2;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Who looks, and with how many frames.
#[derive(Clone, Debug)]
pub struct ViewCase {
    /// What the table calls it.
    pub name: &'static str,
    /// The eye, its pupil and its box.
    pub viewer: Viewer,
    /// Frames that follow each other faster than the eye sees.
    pub frames: usize,
    /// Steps of `view`.
    pub iterations: usize,
}

/// The cases of the table, for an eye 0.6 m before the panel with a pupil of 4 mm.
pub fn view_cases() -> Vec<ViewCase> {
    let case = |name, width: f64, height: f64, frames, iterations| {
        let viewer = Viewer { eye_box: DVec2::new(width, height) * 1e-3, ..Viewer::default() };
        ViewCase { name, viewer, frames, iterations }
    };
    let all = |name, frames, iterations| {
        let viewer = Viewer { pupil: Pupil::All, ..Viewer::default() };
        ViewCase { name, viewer, frames, iterations }
    };
    vec![
        case("known eye, 50 steps", 0.0, 0.0, 1, 50),
        case("known eye", 0.0, 0.0, 1, 200),
        case("±1 mm", 2.0, 2.0, 1, 200),
        case("10 × 2 mm", 10.0, 2.0, 3, 130),
        case("10 × 10 mm", 10.0, 10.0, 9, 130),
        case("22 × 14 mm", 22.0, 14.0, 24, 80),
        all("all of the light, one frame", 1, 450),
        all("all of the light, 3 frames", 3, 200),
        all("all of the light, 8 frames", 8, 300),
    ]
}

/// What is compared with `view`.
pub const VIEW_ENCODINGS: [&str; 5] = ["double-phase", "double-phase, converging", "kinoform", "gradient", "view"];

/// A scene to look at.
pub enum ViewScene {
    /// Flat layers that hide each other ([`layers::occlusion`]), and their points.
    Layers(PointCloud),
    /// A lit scene.
    Lit(Box<(LitScene, ScenePoints)>),
}

/// A line of the table; all figures are simulated.
#[derive(Clone, Debug, Serialize)]
pub struct ViewRow {
    /// The scene.
    pub scene: String,
    /// Who looks.
    pub case: &'static str,
    /// The encoding, and the phases of the points.
    pub encoding: &'static str,
    /// Number of frames.
    pub frames: usize,
    /// What is seen.
    pub seen: SeenFigures,
    /// Time from points or views to the frames [s].
    pub seconds: f64,
}

impl ViewScene {
    /// The layers as points, one for each cell of a lattice that is twice as fine as what the eye resolves.
    ///
    /// # Errors
    /// As [`LightField::of_layers`].
    pub fn layers(setup: &Setup) -> Result<Self> {
        let grid = setup.grid;
        let cells = crate::field::Grid::new(
            grid.width.div_ceil(3),
            grid.height.div_ceil(3),
            3.0 * grid.pitch_x,
            3.0 * grid.pitch_y,
        )?;
        let eye = Viewer::default().eye;
        let alone = EyeGrid::over(eye, DVec2::ZERO, EyeGrid::SPACING)?;
        let seen = LightField::of_layers(&layers::occlusion(grid.extent_x(), DEPTHS), alone, cells)?;
        Ok(Self::Layers(seen.middle_cloud(Phase::Zero, setup.wavelength)))
    }

    /// A scene in a file.
    ///
    /// # Errors
    /// As [`pipeline::scene`] and [`pipeline::points`].
    pub fn read(path: &Path, setup: &Setup, progress: &Progress) -> Result<Self> {
        let settings = SceneSettings { white: WhitePoint::Auto, ..SceneSettings::default() };
        let lit = pipeline::scene(path, &settings, progress)?;
        let points = pipeline::points(&lit, &settings, setup, progress)?;
        Ok(Self::Lit(Box::new((lit, points))))
    }

    /// What a viewer should see of it.
    ///
    /// # Errors
    /// As [`pipeline::light_field`].
    pub fn views(&self, viewer: &Viewer, setup: &Setup, progress: &Progress) -> Result<LightField> {
        match self {
            Self::Layers(_) => {
                let retina = crate::light_field::Retina::of(viewer, &setup.grid, setup.wavelength)?;
                let half = 0.5 * DVec2::new(setup.grid.extent_x(), setup.grid.extent_y());
                let eyes = retina.eyes(viewer)?;
                LightField::of_layers(&layers::occlusion(setup.grid.extent_x(), DEPTHS), eyes, retina.window(half)?)
            }
            Self::Lit(scene) => {
                let source = LightSource::Scene { lit: &scene.0, points: &scene.1 };
                let settings = pipeline::Settings { viewer: *viewer, ..pipeline::Settings::default() };
                pipeline::light_field(&source, setup, &settings, progress).map(|(light, _)| light)
            }
        }
    }

    fn cloud(&self) -> &PointCloud {
        match self {
            Self::Layers(cloud) => cloud,
            Self::Lit(scene) => &scene.1.placed.cloud,
        }
    }
}

/// Depths of the layers, nearest and farthest [m].
const DEPTHS: [f64; 2] = [-0.1, -0.15];

/// Encodes a scene for a viewer, and judges what is seen; `None` where an encoding has no such frames.
///
/// # Errors
/// Those of the steps; [`crate::Error::Interrupted`] when asked to stop.
pub fn compare_views(
    scene: &ViewScene,
    light: &LightField,
    case: &ViewCase,
    encoding: &'static str,
    setup: &Setup,
    progress: &Progress,
) -> Result<Option<(SeenFigures, f64)>> {
    let begin = Instant::now();
    let frames = match encoding {
        "view" => {
            let settings = pipeline::Settings { sub_frames: sub_frames(case.frames)?, ..pipeline::Settings::default() };
            let exposures = pipeline::exposures(setup, &settings, None);
            let view = ViewEncoding { iterations: Some(case.iterations), ..ViewEncoding::default() };
            let found = pipeline::views(light, &case.viewer, &exposures, setup, &view, &[], progress)?;
            found.into_iter().flat_map(Viewed::frames_or_none).flatten().map(|encoded| encoded.frame).collect()
        }
        // One wave converges on one place: further frames would be the same.
        "double-phase, converging" if case.frames > 1 => return Ok(None),
        _ => by_field(scene.cloud(), case, encoding, setup, progress)?,
    };
    let seconds = begin.elapsed().as_secs_f64();
    let frames: Vec<Option<&Frame>> = frames.iter().map(Some).collect();
    let seeing = Seeing::new(light, &case.viewer, Colour::of(None, setup.wavelength, Channel::Luminance), &[]);
    let gallery = pipeline::seen(&frames, setup, &seeing, &Bench::default(), progress)?;
    Ok(Some((gallery.figures.all, seconds)))
}

fn sub_frames(count: usize) -> Result<Option<SubFrames>> {
    if count == 1 { Ok(None) } else { SubFrames::new(count, Multiplexing::Phases, 1).map(Some) }
}

/// Frames of an encoding of fields.
fn by_field(
    cloud: &PointCloud,
    case: &ViewCase,
    encoding: &'static str,
    setup: &Setup,
    progress: &Progress,
) -> Result<Vec<Frame>> {
    let converging = encoding == "double-phase, converging";
    let phase = if converging { Phase::Path } else { Phase::Random { seed: 1 } };
    let mut cloud = cloud.clone();
    for (index, point) in cloud.points.iter_mut().enumerate() {
        point.phase = phase.of(index, (case.viewer.eye - point.position).length(), setup.wavelength);
    }
    let settings = pipeline::Settings {
        sub_frames: sub_frames(case.frames)?,
        channel: Channel::Luminance,
        ..pipeline::Settings::default()
    };
    let own = match encoding {
        "kinoform" => Encoding::Kinoform,
        "gradient" => Encoding::Gradient(crate::encode::BandGradient::default()),
        _ => Encoding::DoublePhase(DoublePhase::default()),
    };
    let options = EncodeOptions { encoding: Some(own), ..EncodeOptions::default() };
    let mut frames = Vec::new();
    for exposure in pipeline::exposures(setup, &settings, None) {
        let field = pipeline::field(&cloud, &exposure, setup, &HologramSettings::default(), progress)?;
        let Some(field) = field else { continue };
        let origin = Origin { depth: cloud.depth_range().map(|(far, near)| [near, far]), ..Origin::default() };
        frames.push(pipeline::frame(&field.field, setup, &options, origin, progress)?.frame);
    }
    Ok(frames)
}

/// The rows as tables in Markdown, one for each scene.
pub fn views_markdown(rows: &[ViewRow]) -> String {
    let mut text = String::new();
    let mut scene = "";
    for row in rows {
        if row.scene != scene {
            scene = &row.scene;
            text += &format!(
                "\n**{scene}**, through a pupil of {:.0} mm: amplitude PSNR (worst look) dB, SSIM, speckle contrast, light into the box; simulated\n\n| eye | frames | encoding | PSNR | SSIM | contrast | light | seconds |\n|---|---:|---|---:|---:|---:|---:|---:|\n",
                match Viewer::default().pupil {
                    Pupil::Diameter(pupil) => 1e3 * pupil,
                    Pupil::All => f64::INFINITY,
                }
            );
        }
        let seen = &row.seen;
        text += &format!(
            "| {} | {} | {} | {:.1} ({:.1}) | {:.2} | {:.2} | {:.0} % | {:.1} |\n",
            row.case,
            row.frames,
            row.encoding,
            seen.psnr,
            seen.psnr_worst,
            seen.ssim,
            seen.contrast,
            100.0 * seen.box_efficiency,
            row.seconds
        );
    }
    text.trim_start().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::PanelProfile;

    fn panel(width: usize, height: usize) -> Setup {
        Setup::new(PanelProfile::phase(width, height, 8e-6, 8, 632.8e-9).expect("panel"), None).expect("setup")
    }

    fn figures(scene: &ViewScene, case: &ViewCase, encoding: &'static str, setup: &Setup) -> SeenFigures {
        let progress = Progress::new();
        let light = scene.views(&case.viewer, setup, &progress).expect("views");
        let found = compare_views(scene, &light, case, encoding, setup, &progress).expect("compared");
        found.expect("frames").0
    }

    /// One frame for a known eye is clear where a frame of random phases is speckle; dead space, a range of 1.6π and crosstalk
    /// cost it less than 3 dB, since they stand in the loop.
    #[test]
    fn a_known_eye_sees_the_layers() {
        let setup = panel(1920, 1080);
        let scene = ViewScene::layers(&setup).expect("layers");
        let case = view_cases().swap_remove(0);
        let ideal = figures(&scene, &case, "view", &setup);
        assert!(ideal.psnr > 35.0 && ideal.ssim > 0.93, "{ideal:?}");
        assert!(ideal.contrast < 0.15 && ideal.box_efficiency > 0.4, "{ideal:?}");
        let speckle = figures(&scene, &case, "kinoform", &setup);
        assert!(speckle.psnr < 13.0 && speckle.contrast > 0.8, "{speckle:?}");
        let faulty = &crate::comparison::panels(1920, 1080).expect("panels")[2];
        let faulty = figures(&scene, &case, "view", &faulty.setup);
        assert!(faulty.psnr > ideal.psnr - 3.0, "{faulty:?}, not {ideal:?}");
    }

    /// Three frames share a box of 10 × 2 mm.
    #[test]
    fn sub_frames_share_an_eye_box() {
        let setup = panel(960, 540);
        let scene = ViewScene::layers(&setup).expect("layers");
        let case = view_cases().into_iter().find(|case| case.frames == 3).expect("case");
        let seen = figures(&scene, &case, "view", &setup);
        assert!(seen.psnr > 26.0 && seen.ssim > 0.8, "{seen:?}");
    }
}
