//! What is small and bright in a panorama.

use super::dome::Map;
use glam::{DVec3, Vec3};

/// Brighter than the mean of all that is not very bright by this factor: a lamp.
const BRIGHT: f32 = 25.0;

/// Widest extent of a sun [sr]: a disc of 1.6° across, three times as wide as the real one. The shadows of wider lamps are seen
/// to be soft.
const WIDEST: f64 = 6e-4;

/// Most suns; further ones stay where they are.
const MOST: usize = 8;

/// Takes suns out of a map: from each texel what it has over the limit of brightness. They are given by direction and
/// irradiance [W/m²], the strongest first.
pub(super) fn taken_out(map: &mut Map) -> Vec<(DVec3, Vec3)> {
    let solid: Vec<f64> = (0..map.height).map(|row| map.solid_angle(row)).collect();
    let limit = BRIGHT * plain_mean(map, &solid);
    if limit <= 0.0 {
        return Vec::new();
    }
    let mut open: Vec<bool> = map.texels.iter().map(|t| t.max_element() > limit).collect();
    let mut found = Vec::new();
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        let mut region = vec![start];
        let mut next = 0;
        while let Some(&at) = region.get(next) {
            next += 1;
            let (column, row) = (at % map.width, at / map.width);
            let columns = [column, (column + 1) % map.width, (column + map.width - 1) % map.width];
            for y in row.saturating_sub(1)..=(row + 1).min(map.height - 1) {
                let beside = columns.map(|x| y * map.width + x);
                region.extend(beside.into_iter().filter(|&other| std::mem::take(&mut open[other])));
            }
        }
        let extent: f64 = region.iter().map(|at| solid[at / map.width]).sum();
        // One texel is no disc of its own size: it may be less wide than it is.
        if extent <= WIDEST.max(solid[start / map.width]) {
            found.push(region);
        }
    }
    let over = |texel: Vec3| texel * (1.0 - limit / texel.max_element());
    let mut suns: Vec<(DVec3, Vec3, Vec<usize>)> = found
        .into_iter()
        .map(|region| {
            let (mut towards, mut light) = (DVec3::ZERO, DVec3::ZERO);
            for &at in &region {
                let (column, row) = (at % map.width, at / map.width);
                let part = over(map.texels[at]).as_dvec3() * solid[row];
                towards += map.direction(column, row) * part.element_sum();
                light += part;
            }
            (towards.normalize_or(DVec3::Y), light.as_vec3(), region)
        })
        .collect();
    suns.sort_by(|a, b| b.1.element_sum().total_cmp(&a.1.element_sum()));
    suns.truncate(MOST);
    for at in suns.iter().flat_map(|sun| &sun.2) {
        let bright = map.texels[*at];
        map.texels[*at] = bright - over(bright);
    }
    suns.into_iter().map(|(towards, light, _)| (towards, light)).collect()
}

/// Mean brightness of a map whose brightest texels count as no more than ten times the median.
fn plain_mean(map: &Map, solid: &[f64]) -> f32 {
    let mut each: Vec<f32> = map.texels.iter().map(|t| t.max_element()).collect();
    let middle = each.len() / 2;
    let median = *each.select_nth_unstable_by(middle, f32::total_cmp).1;
    let (mut sum, mut all) = (0.0, 0.0);
    for (i, texel) in map.texels.iter().enumerate() {
        let weight = solid[i / map.width];
        sum +=
            f64::from(if median > 0.0 { texel.max_element().min(10.0 * median) } else { texel.max_element() }) * weight;
        all += weight;
    }
    (sum / all) as f32
}
