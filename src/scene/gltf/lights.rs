//! Punctual lights of the file, and the light of a file that has none.

use super::cameras::rigid;
use super::document::Document;
use super::meshes::UsedMaterials;
use super::nodes::Nodes;
use super::own_light::{is_open, lit_share};
use super::{Choice, LoadOptions};
use crate::error::Result;
use crate::scene::{Environment, LightKind, Material, PunctualLight, Scene, TextureRef, Warning};
use glam::{DVec3, Vec3};
use gltf::json;
use json::extensions::scene::khr_lights_punctual::{Light, Type};
use json::validation::Checked;
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// Irradiance of the directional light that stands in [W/m²].
const KEY_IRRADIANCE: f32 = 2.2;

/// Irradiance that the point light at the camera gives at the middle of the scene [W/m²].
const FILL_IRRADIANCE: f32 = 0.8;

/// What is said where the default light is added: that of a studio, or from the viewer where walls keep a studio's light out.
const STUDIO: &str = "it is lit by a soft studio (dome and soft boxes, from the viewer's upper left)";
const VIEWER: &str = "its walls keep a studio's light out, so it is lit by a directional light of 2.2 W/m² from the viewer's \
    upper left and a point light at the camera that gives 0.8 W/m² at the middle of the scene";

/// Share of what the camera sees that a file's own emission must light.
const LEAST_LIT: f64 = 0.25;

/// From where the directional light comes, in camera axes: the viewer's upper left, in front of the scene.
const KEY_FROM: DVec3 = DVec3::new(-0.5, 0.8, 0.6);

/// The punctual lights of the shown nodes.
pub(super) fn read(document: &Document, nodes: &Nodes) -> Result<Vec<PunctualLight>> {
    let mut lights = Vec::new();
    for &node in &nodes.shown {
        let extension = document.root.nodes[node].extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let Some(extension) = extension else { continue };
        let what = format!("the light of {}", document.node_name(node));
        let light = document.get(extension.light, &what)?;
        let world_from_node = nodes.world_from_node[node];
        let (pose, _) = rigid(world_from_node)
            .ok_or_else(|| document.error(format!("{what} has no direction; its node's scale is zero")))?;
        let intensity = Vec3::from(light.color) * light.intensity;
        if !intensity.is_finite() || intensity.min_element() < 0.0 {
            return Err(document.error(format!("{what} has intensity {intensity}; it must be positive and finite")));
        }
        let range = light.range.unwrap_or(f32::INFINITY);
        if range.is_nan() || range <= 0.0 {
            return Err(document.error(format!("{what} has range {range}; it must be positive")));
        }
        lights.push(PunctualLight {
            kind: kind(document, light, &what)?,
            position: pose.w_axis.truncate().as_vec3(),
            direction: (-pose.z_axis.truncate()).as_vec3(),
            intensity,
            range,
            measured: None,
        });
    }
    Ok(lights)
}

fn kind(document: &Document, light: &Light, what: &str) -> Result<LightKind> {
    match (light.type_, &light.spot) {
        (Checked::Valid(Type::Directional), _) => Ok(LightKind::Directional),
        (Checked::Valid(Type::Point), _) => Ok(LightKind::Point),
        (Checked::Valid(Type::Spot), spot) => {
            let (inner, outer) =
                spot.as_ref().map_or((0.0, std::f32::consts::FRAC_PI_4), |s| (s.inner_cone_angle, s.outer_cone_angle));
            if !(0.0 <= inner && inner < outer && outer <= FRAC_PI_2) {
                return Err(document.error(format!(
                    "{what} has cone angles {inner} and {outer}; they must rise from 0 to at most π/2"
                )));
            }
            Ok(LightKind::Spot { inner, outer })
        }
        (Checked::Invalid, _) => Err(document.error(format!("{what} is of an unknown type"))),
    }
}

/// What was found out in an earlier pose, so that a film does not change its light.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// Share of what the camera sees that the file's own emission lights.
    lit: Option<Option<f64>>,
    /// The studio before a camera; `None` in it where walls keep it out.
    studio: Option<(Option<Choice>, Option<Arc<Environment>>)>,
}

/// Makes sure that the scene is lit. A file without any light gets that of [`super::load`], and so does, where no environment
/// lights it, one whose emission lights less than a quarter of what its camera sees ([`lit_share`]); light from the viewer is
/// added to any file on request. A file whose lights are all turned down to zero is refused: that is hardly what was meant.
pub(super) fn ensure_light(
    document: &Document,
    scene: &mut Scene,
    used: &UsedMaterials,
    options: &LoadOptions,
    known: &mut Known,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    if let Some(around) = &scene.environment {
        scene.lights.extend(around.suns().iter().cloned());
        if !options.viewer_light {
            return Ok(());
        }
    }
    if options.viewer_light {
        viewer_light(scene, options.framed);
        return Ok(());
    }
    // The coarsest level is the mean of the picture: some exporters write full emission times a black picture.
    let mean = |t: &TextureRef| {
        let texture = scene.textures.get(t.texture as usize)?;
        texture.levels.last()?.texels.first().map(|texel| texel.truncate())
    };
    let emits = |m: &Material| {
        let picture = m.emissive_texture.as_ref().and_then(mean).unwrap_or(Vec3::ONE);
        (m.emissive * picture).max_element() > 0.0
    };
    let lit = scene.lights.iter().any(|light| light.intensity.max_element() > 0.0) || scene.materials.iter().any(emits);
    if scene.materials.iter().all(|m| m.unlit) {
        return Ok(());
    }
    if lit {
        let punctual = scene.lights.iter().any(|light| light.intensity.max_element() > 0.0);
        let share = match (punctual, known.lit) {
            (true, _) => None,
            (false, Some(share)) => share,
            (false, None) => *known.lit.insert(lit_share(scene)),
        };
        if let Some(share) = share.filter(|share| *share < LEAST_LIT) {
            let added = default_light(scene, options, known)?;
            warnings.push(Warning(format!(
                "what the file lets shine lights {:.0} % of what its camera sees, less than {:.0} %; {added}",
                100.0 * share,
                100.0 * LEAST_LIT
            )));
        }
        return Ok(());
    }
    let strength_written = |number: &usize| {
        let material = document.root.materials.get(*number);
        material.and_then(|m| m.extensions.as_ref()).is_some_and(|e| e.emissive_strength.is_some())
    };
    if !scene.lights.is_empty() || used.iter().flatten().any(strength_written) {
        return Err(document.error(
            "its lights have no intensity, so that everything is black; give one an intensity or emissive strength above \
             zero, or remove them all for a default light",
        ));
    }
    let added = default_light(scene, options, known)?;
    warnings.push(Warning(format!("the file has no light; {added}")));
    Ok(())
}

/// Adds the light of a file without any; tells which it is.
fn default_light(scene: &mut Scene, options: &LoadOptions, known: &mut Known) -> Result<&'static str> {
    let studio = match known.studio.take().filter(|(camera, _)| *camera == options.camera) {
        Some((_, studio)) => studio,
        None if is_open(scene) => Some(Arc::new(Environment::studio(&scene.cameras[0])?)),
        None => None,
    };
    known.studio = Some((options.camera.clone(), studio.clone()));
    let Some(studio) = studio else {
        viewer_light(scene, options.framed);
        return Ok(VIEWER);
    };
    scene.lights.extend(studio.suns().iter().cloned());
    scene.environment = Some(studio);
    Ok(STUDIO)
}

/// Adds light from the viewer.
fn viewer_light(scene: &mut Scene, framed: Option<(DVec3, DVec3)>) {
    let camera = &scene.cameras[0];
    let eye = camera.eye();
    let from = camera.world_from_camera.transform_vector3(KEY_FROM.normalize());
    let (low, high) = framed.or(scene.bounds()).unwrap_or_default();
    // A camera inside the scene is nearer to its middle than to what it sees; half the diagonal is a fair distance.
    let distance = eye.distance(0.5 * (low + high)).max(0.5 * high.distance(low)) as f32;
    scene.lights.push(PunctualLight {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: (-from).as_vec3(),
        intensity: Vec3::splat(KEY_IRRADIANCE),
        range: f32::INFINITY,
        measured: None,
    });
    scene.lights.push(PunctualLight {
        kind: LightKind::Eye,
        position: eye.as_vec3(),
        direction: camera.world_from_camera.transform_vector3(DVec3::NEG_Z).as_vec3(),
        intensity: Vec3::splat(FILL_IRRADIANCE * distance * distance),
        range: f32::INFINITY,
        measured: None,
    });
}
