//! What an eye should see of a scene: the traced picture with the depth of each pixel.

use super::placed::Placed;
use super::placement::Placing;
use super::trace::{Traced, neighbours};
use std::collections::{BTreeMap, VecDeque};

/// The traced picture and where each of its pixels stands before the panel: the target of every reconstruction.
#[derive(Clone, Debug)]
pub struct SceneView {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear RGB radiance, row 0 on top.
    pub picture: Vec<[f32; 3]>,
    /// Depth z of each pixel's point in the hologram frame [m]; a pixel without a point has that of the nearest one.
    pub depths: Vec<Option<f64>>,
    /// Depths worth focusing on, z [m]: nearest and farthest object, mirror image.
    pub focus: Vec<(String, f64)>,
    /// Eye, window and camera.
    pub placing: Placing,
}

impl SceneView {
    /// Of points that were traced and then placed.
    pub fn new(traced: &Traced, placed: &Placed, placing: Placing) -> Self {
        let mut depths = vec![None; traced.picture.len()];
        for (point, at) in traced.points.iter().zip(&placed.cloud.points) {
            depths[point.pixel as usize] = Some(at.position.z);
        }
        spread(&mut depths, traced.width as usize);
        Self {
            width: traced.width as usize,
            height: traced.height as usize,
            picture: traced.picture.clone(),
            depths,
            focus: focus_depths(traced, placed),
            placing,
        }
    }
}

/// Gives pixels without a depth that of the nearest pixel that has one (counted in steps across and down).
fn spread(depths: &mut [Option<f64>], width: usize) {
    let mut front: VecDeque<usize> = (0..depths.len()).filter(|&i| depths[i].is_some()).collect();
    while let Some(at) = front.pop_front() {
        for next in neighbours(at, width, depths.len()) {
            if depths[next].is_none() {
                depths[next] = depths[at];
                front.push_back(next);
            }
        }
    }
}

/// Depths of the nearest and the farthest object that fills at least 1 % of the picture, and of mirror images.
fn focus_depths(traced: &Traced, placed: &Placed) -> Vec<(String, f64)> {
    let mut by_object = BTreeMap::<u32, Vec<f64>>::new();
    let mut mirrored = Vec::new();
    for (point, at) in traced.points.iter().zip(&placed.cloud.points) {
        if point.bounces > 0 {
            mirrored.push(at.position.z);
        } else {
            by_object.entry(point.instance).or_default().push(at.position.z);
        }
    }
    let enough = traced.points.len() / 100;
    let median = |depths: &mut Vec<f64>| {
        depths.sort_by(f64::total_cmp);
        depths[depths.len() / 2]
    };
    let mut objects: Vec<f64> = by_object.values_mut().filter(|d| d.len() > enough).map(median).collect();
    objects.sort_by(f64::total_cmp);
    let mut focus = Vec::new();
    if let (Some(&far), Some(&near)) = (objects.first(), objects.last()) {
        focus.push(("near".to_string(), near));
        if far < near {
            focus.push(("far".to_string(), far));
        }
    }
    if mirrored.len() > enough {
        focus.push(("mirror".to_string(), median(&mut mirrored)));
    }
    focus
}
