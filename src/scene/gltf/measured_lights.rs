//! Lamps by their makers' photometric files (EXT_lights_ies).

use super::cameras::rigid;
use super::document::Document;
use super::nodes::Nodes;
use super::resources::read_uri;
use crate::error::Result;
use crate::scene::photometry::{Measured, Photometry};
use crate::scene::{LightKind, PunctualLight};
use glam::Vec3;
use serde::Deserialize;
use std::sync::Arc;

/// The extension's name.
const NAME: &str = "EXT_lights_ies";

/// Largest photometric file [bytes].
const LARGEST: u64 = 64 << 20;

#[derive(Deserialize)]
struct Lights {
    lights: Vec<Profile>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Profile {
    uri: Option<String>,
    buffer_view: Option<u32>,
}

#[derive(Deserialize)]
struct Instance {
    light: usize,
    #[serde(default = "one")]
    multiplier: f32,
    #[serde(default = "white")]
    color: [f32; 3],
}

fn one() -> f32 {
    1.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// The measured lamps of the shown nodes. Their files are read once into `known`.
pub(super) fn read(
    document: &Document,
    nodes: &Nodes,
    known: &mut Vec<Option<Arc<Photometry>>>,
) -> Result<Vec<PunctualLight>> {
    let mut lights = Vec::new();
    for &node in &nodes.shown {
        let extension = document.root.nodes[node].extensions.as_ref().and_then(|e| e.others.get(NAME));
        let Some(extension) = extension else { continue };
        let fail = |why: &str| document.error(format!("{NAME}: the light of {}: {why}", document.node_name(node)));
        let instance: Instance = serde_json::from_value(extension.clone()).map_err(|why| fail(&why.to_string()))?;
        let intensity = Vec3::from(instance.color) * instance.multiplier;
        if !intensity.is_finite() || intensity.min_element() < 0.0 {
            return Err(fail("its multiplier and color must be finite and not below zero"));
        }
        let (pose, _) =
            rigid(nodes.world_from_node[node]).ok_or_else(|| fail("it has no direction; its node's scale is zero"))?;
        let axes = [pose.x_axis, pose.y_axis, pose.z_axis].map(|axis| axis.truncate().as_vec3());
        let photometry = photometry(document, instance.light, known)?;
        lights.push(PunctualLight {
            kind: LightKind::Point,
            position: pose.w_axis.truncate().as_vec3(),
            direction: -axes[2],
            // A lamp that is dark all round is as one that is turned down.
            intensity: if photometry.brightest() > 0.0 { intensity } else { Vec3::ZERO },
            range: f32::INFINITY,
            measured: Some(Measured { photometry, axes }),
        });
    }
    Ok(lights)
}

fn photometry(document: &Document, number: usize, known: &mut Vec<Option<Arc<Photometry>>>) -> Result<Arc<Photometry>> {
    if let Some(Some(known)) = known.get(number) {
        return Ok(Arc::clone(known));
    }
    let fail = |why: &str| document.error(format!("{NAME}: light {number}: {why}"));
    let told = document.root.extensions.as_ref().and_then(|e| e.others.get(NAME));
    let told = told.ok_or_else(|| fail("a node names it, and the file has none"))?;
    let mut told: Lights = serde_json::from_value(told.clone()).map_err(|why| fail(&why.to_string()))?;
    let count = told.lights.len();
    if number >= count {
        return Err(fail(&format!("there are {count}")));
    }
    let profile = told.lights.swap_remove(number);
    let bytes = match (profile.buffer_view, profile.uri) {
        (Some(view), _) => document.view(gltf::json::Index::new(view), "a light profile")?.to_vec(),
        (None, Some(uri)) => read_uri(document.source(), &uri, LARGEST).map_err(|why| fail(&why))?,
        (None, None) => return Err(fail("it has neither a URI nor a buffer view")),
    };
    let read = Arc::new(Photometry::read(&bytes).map_err(|why| fail(&why))?);
    known.resize(known.len().max(count), None);
    known[number] = Some(Arc::clone(&read));
    Ok(read)
}
