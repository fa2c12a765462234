//! Cameras of the file, or one that frames the scene.

use super::Choice;
use super::document::{Document, choose};
use super::nodes::Nodes;
use crate::error::Result;
use crate::scene::{Camera, Projection, Triangle, Warning};
use glam::{DMat3, DMat4, DVec3};
use gltf::json;
use json::validation::Checked;

/// Angle of view of the camera that is put in where a file has none [rad].
const FRAMING_YFOV: f64 = 0.6;

/// Where that camera stands, seen from the scene: in front (glTF models face +z), a little to the right and above, so
/// that depth shows.
const FRAMING_DIRECTION: DVec3 = DVec3::new(0.25, 0.25, 1.0);

/// Part of the picture's half width that the scene may fill.
const FRAMING_MARGIN: f64 = 0.95;

/// The cameras in the order of the node tree, the chosen one first.
pub(super) fn read(
    document: &Document,
    nodes: &Nodes,
    choice: Option<&Choice>,
    triangles: &[Triangle],
    framed: Option<[DVec3; 8]>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Camera>> {
    let (mut cameras, mut names) = (Vec::new(), Vec::new());
    for &node in &nodes.shown {
        let Some(index) = document.root.nodes[node].camera else { continue };
        let json = document.get(index, "a node's camera")?;
        let what = format!("the camera of {}", document.node_name(node));
        let (pose, mirrored) = rigid(nodes.world_from_node[node])
            .ok_or_else(|| document.error(format!("{what} has no direction; its node's scale is zero")))?;
        if mirrored {
            warnings.push(Warning(format!("{what} stands under a mirroring transform, which is left out")));
        }
        let node_name = document.root.nodes[node].name.as_deref();
        let its_names: Vec<&str> = json.name.as_deref().into_iter().chain(node_name).collect();
        cameras.push(Camera {
            name: its_names.first().map_or_else(|| format!("camera {}", cameras.len()), |&n| n.to_owned()),
            world_from_camera: pose,
            projection: projection(document, json, &what)?,
            before: 0.0,
        });
        names.push(its_names);
    }
    if let Some(choice) = choice {
        let chosen = choose(choice, &names, "camera")?;
        cameras[..=chosen].rotate_right(1);
    }
    if cameras.is_empty() {
        warnings.push(Warning("the file has no camera; one that frames the scene is used".to_owned()));
        cameras.push(match framed {
            Some(corners) => framing(|| corners.into_iter()),
            None => framing(|| triangles.iter().flat_map(Triangle::corners)),
        });
    }
    Ok(cameras)
}

fn projection(document: &Document, camera: &json::Camera, what: &str) -> Result<Projection> {
    let positive = |value: f32, name: &str| {
        if value.is_finite() && value > 0.0 {
            return Ok(f64::from(value));
        }
        Err(document.error(format!("{what} has {name} {value}; it must be positive")))
    };
    match (camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(json::camera::Type::Perspective), Some(camera), _) => {
            let yfov = positive(camera.yfov, "yfov")?;
            if yfov >= std::f64::consts::PI {
                return Err(document.error(format!("{what} has yfov {yfov}; it must be below π")));
            }
            let aspect = camera.aspect_ratio.map(|aspect| positive(aspect, "aspectRatio")).transpose()?;
            Ok(Projection::Perspective { yfov, aspect })
        }
        // Signs of the magnifications only say where a rasteriser's axes point.
        (Checked::Valid(json::camera::Type::Orthographic), _, Some(camera)) => Ok(Projection::Orthographic {
            xmag: positive(camera.xmag.abs(), "xmag")?,
            ymag: positive(camera.ymag.abs(), "ymag")?,
        }),
        _ => Err(document.error(format!("{what} is neither perspective nor orthographic, or lacks its values"))),
    }
}

/// The transform without scale, shear and mirroring: viewing direction and position are kept, and up as far as it is
/// square to them. `None` where an axis has no length. Also tells whether it mirrored.
pub(super) fn rigid(transform: DMat4) -> Option<(DMat4, bool)> {
    let m = DMat3::from_mat4(transform);
    let back = m.z_axis.try_normalize()?;
    let up = (m.y_axis - back * back.dot(m.y_axis)).try_normalize()?;
    let axes = DMat3::from_cols(up.cross(back), up, back);
    Some((DMat4::from_mat3_translation(axes, transform.w_axis.truncate()), m.determinant() < 0.0))
}

/// A camera from which a square picture just holds all corners.
fn framing<C: Iterator<Item = DVec3>>(corners: impl Fn() -> C) -> Camera {
    let first = corners().next().unwrap_or_default();
    let (low, high) = corners().fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    let centre = 0.5 * (low + high);
    let direction = FRAMING_DIRECTION.normalize();
    let mut camera = Camera::looking_at(centre + direction, centre, FRAMING_YFOV);
    let axes = DMat3::from_mat4(camera.world_from_camera);
    let slope = FRAMING_MARGIN * (0.5 * FRAMING_YFOV).tan();
    // A corner at camera coordinates (x, y, z) about the centre is in the picture if |x|, |y| ≤ slope·(distance − z).
    let distance = corners().fold(0.0f64, |distance, p| {
        let p = axes.transpose() * (p - centre);
        distance.max(p.z + p.x.abs().max(p.y.abs()) / slope)
    });
    camera.world_from_camera = DMat4::from_mat3_translation(axes, centre + distance * direction);
    camera.name = "framing".to_owned();
    camera
}
