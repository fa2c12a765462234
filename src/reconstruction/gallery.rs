//! The pictures that a person looks at to judge a hologram: all of it in focus, each depth in focus, through an eye.

use super::metrics::Likeness;
use super::{ColorPicture, Light, Picture, Reconstruction, Scale, View, planes_of};
use crate::error::{Error, Result};
use crate::field::npy::Content;
use crate::points::colour::Lasers;
use crate::points::{ScenePoints, SceneView};
use crate::progress::Progress;
use glam::DVec2;
use std::path::Path;

/// Diameter of the pupil of the eye that looks [m]: an eye's in a room.
const PUPIL: f64 = 4e-3;
/// Part of the pixels that is not shown brighter than white where no traced picture says what is.
const BELOW_WHITE: f64 = 0.995;

/// What is known of what should be seen.
#[derive(Clone, Copy, Debug)]
pub struct Target<'s> {
    /// Where the content stands.
    pub content: Content,
    /// The traced picture with depths, and its white, where there is one.
    pub scene: Option<(&'s SceneView, f32)>,
}

impl<'s> Target<'s> {
    /// Content at these depths; of a scene, where one was traced.
    pub fn new(content: Content, scene: Option<&'s ScenePoints>) -> Self {
        Self { content, scene: scene.map(|scene| (&scene.view, scene.white.white)) }
    }
}

/// One picture and how it is shown.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Its name: `sharp`, `near`, `eye` …
    pub name: String,
    /// From where it is seen, and what is in focus.
    pub view: View,
    /// Half width and half height of what it shows in its focal plane [m].
    pub half: DVec2,
    /// The picture, in linear light.
    pub seen: Reconstruction,
    /// The value that is shown as white.
    pub white: f32,
}

/// Pictures of one hologram, and how like its target it is.
#[derive(Clone, Debug)]
pub struct Gallery {
    /// The pictures.
    pub shots: Vec<Shot>,
    /// The lasers of pictures in colour.
    pub lasers: Option<Lasers>,
    /// How like the traced picture the one that is all in focus is.
    pub likeness: Option<Likeness>,
    /// Number of planes of which that one was put together.
    pub planes: usize,
}

impl Gallery {
    /// Pictures of a scene (all in focus, focused on its objects and mirror images, and through an eye at the viewer's
    /// place), or where no scene was traced of planes over the content's depths.
    ///
    /// # Errors
    /// As [`Light::picture`] and [`Light::all_in_focus`].
    pub fn of(light: &Light, target: &Target, progress: &Progress) -> Result<Self> {
        match target.scene {
            Some((view, white)) => Self::of_scene(light, view, white, &target.content, progress),
            None => Self::of_planes(light, &target.content, progress),
        }
    }

    fn of_planes(light: &Light, content: &Content, progress: &Progress) -> Result<Self> {
        let grid = light.exposures.first().ok_or_else(|| Error::parameter("exposures", "have no light"))?.field.grid;
        let shot = |(name, z): (&str, f64)| {
            let view = View::Plane { z };
            let half = view.seen_half(&grid, content.eye);
            let seen = light.picture(&view, half, None, progress)?;
            let white = seen.white(Scale::Percentile(BELOW_WHITE));
            Ok(Shot { name: name.into(), view, half, seen, white })
        };
        let shots = planes_of(content.depth).into_iter().map(shot).collect::<Result<_>>()?;
        Ok(Self { shots, lasers: light.lasers, likeness: None, planes: 0 })
    }

    fn of_scene(light: &Light, scene: &SceneView, white: f32, content: &Content, progress: &Progress) -> Result<Self> {
        let size = (scene.width, scene.height);
        let half_at = |z: f64| scene.placing.view_at(z);
        let target = ColorPicture { width: size.0, height: size.1, rgb: scene.picture.clone() };
        let nearest = content.depth.map_or(0.0, |[near, _]| near);

        let step = light.focus_step(half_at(nearest), size);
        let (sharp, planes) = light.all_in_focus(&scene.depths, size, half_at, step, progress)?;
        let likeness = sharp.likeness(&target, white);
        // One white for all pictures on planes: what is bright in one is as bright in the others.
        let shown = sharp.white_like(&target, white);
        let mut shots = Vec::new();
        let mut add = |name: &str, view: View, seen: Reconstruction, white: f32| {
            let half = half_at(view.focus());
            shots.push(Shot { name: name.into(), view, half, seen, white });
        };
        add("sharp", View::Plane { z: nearest }, sharp, shown);
        for (name, z) in &scene.focus {
            progress.start(&format!("focus {name}"), 0);
            let view = View::Plane { z: *z };
            add(name, view, light.picture(&view, half_at(*z), Some(size), progress)?, shown);
        }
        if let Some((_, focus)) = scene.focus.first() {
            let view = View::Eye { position: scene.placing.eye.to_array(), pupil: PUPIL, focus: *focus };
            let seen = light.picture(&view, half_at(*focus), Some(size), progress)?;
            let white = seen.white_like(&target, white);
            add("eye", view, seen, white);
        }
        Ok(Self { shots, lasers: light.lasers, likeness: Some(likeness), planes })
    }

    /// The mean of so many galleries of the same views, as a slow eye sees sub-frames; one is handed on as it is.
    ///
    /// # Errors
    /// Those of the galleries; [`Error::Parameter`] where there are none.
    pub fn mean(galleries: impl Iterator<Item = Result<Self>>, count: usize) -> Result<Self> {
        let share = |picture: &Picture| -> Vec<f32> { picture.values.iter().map(|v| v / count as f32).collect() };
        let mut whole: Option<Self> = None;
        for gallery in galleries {
            let mut gallery = gallery?;
            if count == 1 {
                return Ok(gallery);
            }
            for (i, shot) in gallery.shots.iter_mut().enumerate() {
                let Reconstruction::Gray(seen) = &mut shot.seen else { continue };
                seen.values = share(seen);
                if let Some(Reconstruction::Gray(sum)) = whole.as_mut().map(|whole| &mut whole.shots[i].seen) {
                    sum.values.iter_mut().zip(&seen.values).for_each(|(sum, v)| *sum += v);
                }
            }
            whole.get_or_insert(gallery);
        }
        let mut whole = whole.ok_or_else(|| Error::parameter("frames", "there is none"))?;
        whole.shots.iter_mut().for_each(|shot| shot.white = shot.seen.white(Scale::Percentile(BELOW_WHITE)));
        Ok(whole)
    }

    /// Writes each picture as `reconstruction-NAME.png` into a folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        self.shots.iter().try_for_each(|shot| {
            let path = folder.join(format!("reconstruction-{}.png", shot.name));
            shot.seen.write(&path, self.lasers.as_ref(), shot.white, &shot.view, shot.half)
        })
    }
}
