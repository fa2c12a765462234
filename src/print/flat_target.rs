//! What an eye should see of pictures before a plate: each point painted as the cell that it stands for, farthest first.
//!
//! Nothing of waves is used: it is what previews of the plate are judged by.

use super::preview::Preview;
use crate::points::lattice::LatticePoints;
use crate::reconstruction::ColorPicture;
use glam::{DVec2, DVec3};

/// Samples of a cell of the picture along each side.
const FINE: usize = 3;

/// The picture that an eye at `eye` [m] should see where a preview stands; `viewer` is the eye that the points' amplitudes are
/// for [m].
pub(super) fn target(points: &LatticePoints, viewer: DVec3, eye: DVec3, seen: &Preview) -> ColorPicture {
    let (width, height) = (seen.picture.width, seen.picture.height);
    let (columns, rows) = (width * FINE, height * FINE);
    let sample = 2.0 * seen.half / DVec2::new(columns as f64, rows as f64);
    let corner = DVec2::new(seen.center[0] - seen.half.x, seen.center[1] + seen.half.y);
    let cloud = &points.cloud;
    let mut order: Vec<usize> = (0..cloud.points.len()).filter(|&i| cloud.points[i].position.z < eye.z).collect();
    order.sort_by(|&a, &b| cloud.points[a].position.z.total_cmp(&cloud.points[b].position.z));
    let mut fine = vec![[0.0f32; 3]; columns * rows];
    for index in order {
        let position = cloud.points[index].position;
        let scale = (eye.z - seen.focus) / (eye.z - position.z);
        let center = eye.truncate() + (position - eye).truncate() * scale;
        let half = DVec2::new(f64::from(points.half[index][0]), f64::from(points.half[index][1])) * scale;
        // Edges that neighbours share are rounded alike.
        let edge = |at: f64, most: usize| at.round().clamp(0.0, most as f64) as usize;
        let (left, top) = ((center.x - half.x - corner.x) / sample.x, (corner.y - center.y - half.y) / sample.y);
        let (right, bottom) = (left + 2.0 * half.x / sample.x, top + 2.0 * half.y / sample.y);
        let distance = (viewer - position).length();
        let amplitudes = cloud.rgb.as_ref().map_or([cloud.points[index].amplitude; 3], |rgb| rgb[index]);
        let radiance = amplitudes.map(|amplitude| ((f64::from(amplitude) / distance).powi(2)) as f32);
        let (from, to) = (edge(left, columns), edge(right, columns));
        for row in edge(top, rows)..edge(bottom, rows) {
            fine[row * columns + from..row * columns + to.max(from)].fill(radiance);
        }
    }
    let cell = |i: usize| {
        let (column, row) = (i % width * FINE, i / width * FINE);
        let all = (0..FINE * FINE).map(|k| fine[(row + k / FINE) * columns + column + k % FINE]);
        let sum = all.fold([0.0f32; 3], |sum, v| [sum[0] + v[0], sum[1] + v[1], sum[2] + v[2]]);
        sum.map(|v| v / (FINE * FINE) as f32)
    };
    ColorPicture { width, height, rgb: (0..width * height).map(cell).collect() }
}
