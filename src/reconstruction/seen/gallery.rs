//! Pictures that an eye sees of a hologram beside those that it should see, with figures.

use super::{Colour, Judge, Look, LookFigures, Seen, SeenBy, looks};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::light_field::{LightField, Pupil, Viewer};
use crate::points::{ScenePoints, SceneView};
use crate::progress::Progress;
use crate::reconstruction::{ColorPicture, ExposureLight, Picture, Reconstruction};
use glam::DVec2;

/// From where and for what the pictures are made.
#[derive(Clone, Copy, Debug)]
pub struct Seeing<'a> {
    /// What should be seen.
    pub light_field: &'a LightField,
    /// Who looks.
    pub viewer: &'a Viewer,
    /// In what light.
    pub colour: Colour,
    /// Depths z \[m\] to focus on, with their names; of none, the light field's nearest and farthest.
    pub focus: &'a [(String, f64)],
    /// Looks that make the figures.
    pub held_out: usize,
    /// Seed of these looks.
    pub seed: u64,
    /// The traced picture with its white, where there is one; else the middle view stands for it.
    pub scene: Option<(&'a SceneView, f32)>,
    /// Whether there are moving pictures, too: the focus goes through the depths, the eye round its box.
    pub sweeps: bool,
}

impl<'a> Seeing<'a> {
    /// Looks that make the figures, where nothing else is said.
    pub const HELD_OUT: usize = 24;

    /// What is seen in one light of a light field, by [`Seeing::HELD_OUT`] looks and without moving pictures.
    pub fn new(light_field: &'a LightField, viewer: &'a Viewer, colour: Colour, focus: &'a [(String, f64)]) -> Self {
        Self { light_field, viewer, colour, focus, held_out: Self::HELD_OUT, seed: 1, scene: None, sweeps: false }
    }

    /// The same of a scene, beside its traced picture, focused on its objects.
    pub fn of_scene(light_field: &'a LightField, viewer: &'a Viewer, colour: Colour, points: &'a ScenePoints) -> Self {
        let scene = Some((&points.view, points.white.white));
        Self { scene, ..Self::new(light_field, viewer, colour, &points.view.focus) }
    }
}

/// One look, as it should be and as it is.
#[derive(Clone, Debug)]
pub struct SeenShot {
    /// Its name: `near`, `far`, `eye-left` …
    pub name: String,
    /// From where, and what is in focus.
    pub look: Look,
    /// What should be seen, in linear light with 1 for white.
    pub wanted: Reconstruction,
    /// What the hologram shows, as bright as it should be.
    pub seen: Reconstruction,
    /// How like each other they are.
    pub figures: LookFigures,
}

/// Pictures of one hologram as an eye sees it.
#[derive(Clone, Debug)]
pub struct SeenGallery {
    /// Figures over looks that no optimisation has seen.
    pub figures: SeenBy,
    /// The traced picture, or the scene through a pinhole at the middle of the views: all of it sharp.
    pub traced: Reconstruction,
    /// Whether it is the pinhole's.
    pub(super) pinhole: bool,
    /// From the middle of the eye box, focused on each depth.
    pub focus: Vec<SeenShot>,
    /// From both ends and the middle of an eye box; empty for an eye whose place is known.
    pub eyes: Vec<SeenShot>,
    /// The focus from the nearest to the farthest depth and back, if it was asked for.
    pub focus_sweep: Vec<SeenShot>,
    /// The eye round its box, if it was asked for and there is a box.
    pub eye_sweep: Vec<SeenShot>,
    /// Words about the viewer, and whether the pupil takes all.
    pub(super) viewer: String,
    pub(super) whole: bool,
}

/// Pictures of a sweep.
const STEPS: usize = 24;

/// Looks with their names, in the order of the gallery's parts.
#[derive(Default)]
struct Plan {
    looks: Vec<Look>,
    names: Vec<String>,
}

impl Plan {
    fn add(&mut self, name: String, look: Look) {
        self.names.push(name);
        self.looks.push(look);
    }
}

impl SeenGallery {
    /// Looks at exposures one after another: each is let go before the next is asked for.
    ///
    /// # Errors
    /// Those of the exposures; as [`Judge::new`], [`looks`] and [`Seen::add`]; [`Error::Parameter`] where there are none.
    pub fn of(
        exposures: impl IntoIterator<Item = Result<ExposureLight>>,
        seeing: &Seeing,
        progress: &Progress,
    ) -> Result<Self> {
        let Seeing { light_field, viewer, .. } = *seeing;
        let mut plan = Plan::default();
        for (index, look) in
            looks(viewer, light_field.depth, seeing.held_out.max(1), seeing.seed)?.into_iter().enumerate()
        {
            plan.add(index.to_string(), look);
        }
        let counted = plan.looks.len();
        let parts = [focus_looks, eye_looks, focus_sweep, eye_sweep].map(|part| {
            let first = plan.looks.len();
            part(seeing, &mut plan);
            first..plan.looks.len()
        });
        let judge = Judge::new(light_field, viewer, seeing.colour, plan.looks, progress)?.counting(counted);
        let mut seen = judge.begin();
        let mut any = false;
        for light in exposures {
            let light = light?;
            seen.add(&judge, &light.field, light.settings.aperture.as_ref(), light.laser, progress)?;
            any = true;
        }
        if !any {
            return Err(Error::parameter("exposures", "have no light"));
        }
        Self::from_judge(&judge, &seen, seeing, &plan.names, parts)
    }

    fn from_judge(
        judge: &Judge,
        seen: &Seen,
        seeing: &Seeing,
        names: &[String],
        parts: [std::ops::Range<usize>; 4],
    ) -> Result<Self> {
        let figures = judge.figures(seen);
        let gain = super::figures::gain(judge, seen);
        let [focus, eyes, focus_sweep, eye_sweep] = parts.map(|part| {
            let shot = |index: usize| SeenShot {
                name: names[index].clone(),
                look: judge.looks()[index],
                wanted: judge.wanted(index),
                seen: judge.seen_with(seen, index, gain),
                figures: figures.each[index],
            };
            part.map(shot).collect::<Vec<_>>()
        });
        let Seeing { light_field, viewer, scene, .. } = *seeing;
        let traced = match scene {
            Some((view, white)) => traced_on(judge.retina(), view, white, &seeing.colour)?,
            None => judge.pinhole(light_field)?,
        };
        Ok(Self {
            figures,
            traced,
            pinhole: scene.is_none(),
            focus,
            eyes,
            focus_sweep,
            eye_sweep,
            viewer: words(viewer),
            whole: viewer.pupil == Pupil::All,
        })
    }
}

/// A traced picture on the cells of a retina, white 1: each cell shows the mean over its area.
fn traced_on(retina: &Grid, view: &SceneView, white: f32, colour: &Colour) -> Result<Reconstruction> {
    let pitch = 2.0 * view.placing.window / DVec2::new(view.width as f64, view.height as f64);
    let cells = Grid::new(view.width, view.height, pitch.x, pitch.y)?;
    let half = 0.5 * DVec2::new(retina.extent_x(), retina.extent_y());
    let share = (pitch.x * pitch.y / (retina.pitch_x * retina.pitch_y)) as f32 / white;
    let mean = |of: &dyn Fn([f32; 3]) -> f32| {
        let values: Vec<f32> = view.picture.iter().map(|rgb| of(*rgb) * share).collect();
        Picture::from_samples(&cells, &values, half, retina.width, retina.height)
    };
    Ok(match colour {
        Colour::One { channel, .. } => Reconstruction::Gray(mean(&|rgb| channel.of(rgb))),
        Colour::Three(_) => {
            let [red, green, blue] = [0, 1, 2].map(|c| mean(&|rgb| rgb[c]).values);
            let rgb = red.into_iter().zip(green).zip(blue).map(|((r, g), b)| [r, g, b]).collect();
            Reconstruction::Color(ColorPicture { width: retina.width, height: retina.height, rgb })
        }
    })
}

/// The viewer in words.
fn words(viewer: &Viewer) -> String {
    let mm = |v: f64| format!("{}", (1e4 * v).round() / 10.0);
    let pupil = match viewer.pupil {
        Pupil::Diameter(pupil) => format!("pupil {} mm", mm(pupil)),
        Pupil::All => "all of the light".into(),
    };
    let eye_box = if viewer.eye_box == DVec2::ZERO {
        "eye at a known place".to_owned()
    } else {
        format!("eye box {} × {} mm", mm(viewer.eye_box.x), mm(viewer.eye_box.y))
    };
    format!("{eye_box}, {} mm before the panel, {pupil}", mm(viewer.eye.z))
}

/// A depth between the light field's nearest (0) and farthest (1), evenly in dioptres.
fn between(seeing: &Seeing, part: f64) -> f64 {
    let eye = seeing.viewer.eye.z;
    let [near, far] = seeing.light_field.depth.map(|z| 1.0 / (eye - z));
    eye - 1.0 / (near + part * (far - near))
}

fn focus_looks(seeing: &Seeing, plan: &mut Plan) {
    let pupil = seeing.viewer.eye.truncate();
    if seeing.focus.is_empty() {
        for (name, part) in [("near", 0.0), ("far", 1.0)] {
            plan.add(name.into(), Look { pupil, focus: between(seeing, part) });
        }
    }
    for (name, focus) in seeing.focus {
        plan.add(name.clone(), Look { pupil, focus: *focus });
    }
}

fn eye_looks(seeing: &Seeing, plan: &mut Plan) {
    let viewer = seeing.viewer;
    let across = viewer.eye_box.x >= viewer.eye_box.y;
    let (names, way) =
        if across { (["left", "middle", "right"], DVec2::X) } else { (["low", "middle", "high"], DVec2::Y) };
    if viewer.eye_box.max_element() > 0.0 {
        for (name, part) in names.into_iter().zip([-0.5, 0.0, 0.5]) {
            let pupil = viewer.eye.truncate() + part * way * viewer.eye_box;
            plan.add(format!("eye-{name}"), Look { pupil, focus: between(seeing, 0.5) });
        }
    }
}

/// Angles of a sweep that begins again where it ends.
fn turn() -> impl Iterator<Item = f64> {
    (0..STEPS).map(|k| std::f64::consts::TAU * k as f64 / STEPS as f64)
}

fn focus_sweep(seeing: &Seeing, plan: &mut Plan) {
    let pupil = seeing.viewer.eye.truncate();
    // On the way back all is as it was on the way there.
    for angle in turn().take(if seeing.sweeps { STEPS / 2 + 1 } else { 0 }) {
        let focus = between(seeing, 0.5 - 0.5 * angle.cos());
        plan.add(format!("focus {:.0} mm", 1e3 * focus), Look { pupil, focus });
    }
}

fn eye_sweep(seeing: &Seeing, plan: &mut Plan) {
    let viewer = seeing.viewer;
    if seeing.sweeps && viewer.eye_box != DVec2::ZERO {
        for angle in turn() {
            let aside = 0.5 * viewer.eye_box * DVec2::from_angle(angle);
            let name = format!("eye {:+.1}, {:+.1} mm", 1e3 * aside.x, 1e3 * aside.y);
            plan.add(name, Look { pupil: viewer.eye.truncate() + aside, focus: between(seeing, 0.5) });
        }
    }
}
