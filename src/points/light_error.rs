//! The error of a picture's light, estimated from the picture itself.
//!
//! At some places that cover no edge the picture is looked at a second time, and the light that its vertices keep is sampled a
//! second time (`illumination::spread`). What noise of its own each pixel has is a 25th of that over blocks of 5 × 5 pixels,
//! what vertices have in common all of these share.

use super::eye::{Eye, Found, RaySample};
use super::settings::TraceSettings;
use super::trace::{differ, neighbours};
use crate::error::Result;
use crate::illumination::{DiffuseLight, Illumination, Noted};
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::Camera;
use rayon::prelude::*;

/// Places across and down that are looked at.
const SIDE: u32 = 24;
/// Pixels of a block.
const BLOCK: f64 = 25.0;
/// Brighter than the median by this factor is a lamp itself.
const LAMP: f64 = 6.0;
/// Fewer places do not tell.
const FEWEST: usize = 16;

/// Root mean square error of the light over blocks of 5 × 5 pixels, over the mean light, as far as it is noise; `None` where
/// too little is seen to tell.
///
/// # Errors
/// [`crate::Error::Interrupted`] when asked to stop.
pub fn light_error(
    light: &Illumination,
    camera: &Camera,
    settings: &TraceSettings,
    progress: &Progress,
) -> Result<Option<f64>> {
    let eye = Eye::new(light, camera, settings);
    let (width, height) = (settings.width, settings.height);
    let count = (width * height) as usize;
    let place = |pixel: usize| [pixel as u32 % width, pixel as u32 / width].map(|k| f64::from(k) + 0.5);
    let look = |pixel: usize, seed: u64| {
        let [column, row] = place(pixel);
        eye.look(column, row, 1, &mut Random::new(settings.seed ^ seed, pixel as u64))
    };
    let side = [width.min(SIDE), height.min(SIDE)];
    let chosen: Vec<(usize, RaySample)> = (0..side[0] * side[1])
        .into_par_iter()
        .filter_map(|i| {
            let mut random = Random::new(settings.seed ^ 0x1e44, u64::from(i));
            let [column, row] = [(i % side[0], side[0], width), (i / side[0], side[1], height)]
                .map(|(k, n, all)| ((f64::from(k) + random.uniform()) / f64::from(n) * f64::from(all)) as usize);
            let pixel = row * width as usize + column;
            let first = look(pixel, 0);
            let plain = first.radiance.element_sum() > 0.0
                && !neighbours(pixel, width as usize, count).any(|other| differ(&first, &look(other, 0)));
            plain.then_some((pixel, first))
        })
        .collect();
    progress.check()?;
    let mut lights: Vec<f64> = chosen.iter().map(|(_, seen)| f64::from(seen.radiance.element_sum())).collect();
    if lights.len() < FEWEST {
        return Ok(None);
    }
    lights.sort_by(f64::total_cmp);
    let lamp = LAMP * lights[lights.len() / 2];
    let chosen: Vec<&(usize, RaySample)> =
        chosen.iter().filter(|(_, seen)| f64::from(seen.radiance.element_sum()) <= lamp).collect();
    let noted = Noted::new(light);
    chosen.par_iter().for_each(|(pixel, _)| {
        seen_by(&eye, &noted, place(*pixel), settings.seed, *pixel);
    });
    let spread = noted.spread(progress)?;
    let squares = chosen.par_iter().map(|(pixel, first)| {
        let shared = seen_by(&eye, &spread, place(*pixel), settings.seed, *pixel);
        let again = look(*pixel, 0x5ec0).radiance - first.radiance;
        let own = f64::from(again.element_sum()).powi(2);
        0.5 * (shared * shared + own / BLOCK)
    });
    let squares: Vec<f64> = squares.collect();
    progress.check()?;
    let mean: f64 = chosen.iter().map(|(_, seen)| f64::from(seen.radiance.element_sum())).sum();
    let n = chosen.len() as f64;
    Ok((mean > 0.0).then(|| (squares.iter().sum::<f64>() / n).sqrt() / (mean / n)))
}

/// What a pixel's ray sees of another light, in the sum of the colours.
fn seen_by<L: DiffuseLight>(eye: &Eye, light: &L, [column, row]: [f64; 2], seed: u64, pixel: usize) -> f64 {
    let mut found = Found::default();
    let looks = eye.looks_at(light);
    looks.follow(eye.ray(column, row), 1, &mut found, &mut Random::new(seed, pixel as u64));
    f64::from(found.seen.radiance.element_sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::IlluminationSettings;
    use crate::points::trace::trace;
    use crate::scene::{SceneBvh, gltf};
    use std::sync::Arc;

    /// Means over blocks of 5 × 5 pixels that cover no edge and no lamp, in the sum of the colours.
    fn blocks(picture: &[[f32; 3]], width: usize) -> Vec<f64> {
        let block = |i: usize| {
            let (column, row) = (i % (width / 5) * 5, i / (width / 5) * 5);
            let light = |k: usize| f64::from(picture[(row + k / 5) * width + column + k % 5].iter().sum::<f32>());
            let (low, high) = (0..25).map(light).fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
            if low > 0.75 * high && high < 6.0 { (0..25).map(light).sum::<f64>() / 25.0 } else { 0.0 }
        };
        (0..(width / 5).pow(2)).map(block).collect()
    }

    #[test]
    fn the_estimate_is_the_error_against_a_better_picture() {
        for scene in ["scenes/cornell.gltf", "scenes/mirror-ball.gltf"] {
            let loaded = gltf::load(scene.as_ref(), &gltf::LoadOptions::default()).expect("scene").scene;
            let bvh = Arc::new(SceneBvh::new(loaded.clone()));
            let rays = TraceSettings { width: 150, height: 150, edge_rays: 1, ..TraceSettings::default() };
            let lit = |error: f64, seed: u64| {
                let settings = IlluminationSettings { seed, ..IlluminationSettings::default() };
                let settings = settings.for_error(error).expect("error");
                Illumination::new(Arc::clone(&bvh), settings, &Progress::new()).expect("light")
            };
            let picture = |light: &Illumination, rays: &TraceSettings| {
                blocks(&trace(light, &loaded.cameras[0], rays, &Progress::new()).expect("picture").picture, 150)
            };
            let exact = picture(&lit(0.006, 99), &TraceSettings { seed: 99, ..rays.for_error(0.006) });
            let (mut squares, mut estimates) = (0.0, 0.0);
            for seed in [1, 2] {
                let (light, rays) = (lit(0.03, seed), TraceSettings { seed, ..rays.for_error(0.03) });
                let own = picture(&light, &rays);
                let both: Vec<(f64, f64)> =
                    own.into_iter().zip(exact.iter().copied()).filter(|(a, b)| *a > 0.0 && *b > 0.0).collect();
                let mean = both.iter().map(|(_, b)| b).sum::<f64>() / both.len() as f64;
                let square = both.iter().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / both.len() as f64;
                squares += 0.5 * square / (mean * mean);
                let found = light_error(&light, &loaded.cameras[0], &rays, &Progress::new()).expect("estimate");
                estimates += 0.5 * found.expect("enough is seen").powi(2);
            }
            let (error, estimate) = (squares.sqrt(), estimates.sqrt());
            eprintln!("{scene}: {:.2} % off, {:.2} % estimated", 100.0 * error, 100.0 * estimate);
            assert!((1.0 / 1.5..1.5).contains(&(estimate / error)), "{scene}: {error} is estimated as {estimate}");
        }
    }
}
