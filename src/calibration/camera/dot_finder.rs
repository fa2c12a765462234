//! The dots of a card in a photo of it, and which of them is which.

use super::dot_card::{dots, spacing};
use super::mapping::Mapping;
use super::photo::CameraPhoto;
use crate::error::{Error, Result};
use crate::panel::crosstalk::blurred;
use crate::random::Random;

/// Most spots of a photo that are looked at.
const SPOTS: usize = 70;
/// Pairs of spots and dots that are tried.
const DRAWS: usize = 100_000;

/// Middles of the bright spots of a photo, brightest first, at least `apart` pixels from one another.
fn spots(photo: &CameraPhoto, apart: f64) -> Vec<[f64; 2]> {
    let (width, height) = (photo.width, photo.height);
    let smooth = blurred(&photo.values, width, (apart / 14.0).clamp(0.7, 40.0));
    let mut sorted = smooth.clone();
    sorted.sort_by(f32::total_cmp);
    let background = sorted[sorted.len() / 2];
    let radius = (apart * 0.3).max(2.0);
    let reach = radius as isize;
    let mut peaks: Vec<(f32, usize, usize)> = Vec::new();
    for row in 1..height - 1 {
        for column in 1..width - 1 {
            let value = smooth[row * width + column];
            let near =
                |d: isize| smooth[(row as isize + d / 3 - 1) as usize * width + (column as isize + d % 3 - 1) as usize];
            if value > background && (0..9).all(|d| near(d) <= value) {
                peaks.push((value - background, column, row));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f32, usize, usize)> = Vec::new();
    for peak in peaks {
        let away = |other: &(f32, usize, usize)| {
            (other.1 as f64 - peak.1 as f64).hypot(other.2 as f64 - peak.2 as f64) >= 1.5 * radius
        };
        if kept.iter().all(away) {
            kept.push(peak);
        }
        if kept.len() == SPOTS {
            break;
        }
    }
    kept.iter()
        .map(|&(_, column, row)| {
            let mut middle = [column as f64, row as f64];
            for _ in 0..3 {
                let (mut sum, mut weight) = ([0.0; 2], 0.0);
                for dy in -reach..=reach {
                    for dx in -reach..=reach {
                        let (x, y) = (middle[0].round() as isize + dx, middle[1].round() as isize + dy);
                        if (dx as f64).hypot(dy as f64) > radius
                            || x < 0
                            || y < 0
                            || x >= width as isize
                            || y >= height as isize
                        {
                            continue;
                        }
                        let value = f64::from((smooth[y as usize * width + x as usize] - background).max(0.0));
                        // Squared, so that what lies beside a dot has little weight.
                        let value = value * value;
                        sum = [sum[0] + value * x as f64, sum[1] + value * y as f64];
                        weight += value;
                    }
                }
                if weight > 0.0 {
                    middle = sum.map(|s| s / weight);
                }
            }
            middle
        })
        .collect()
}

/// The mapping that a photo of the dot card tells, and how many of its dots were found with their RMS distance [camera pixels].
///
/// `half` is half the window's width and `scale` the nominal step of a camera pixel, in cycles a pixel of the panel; turn,
/// mirror and place of the camera are free, the scale may be a quarter off.
///
/// # Errors
/// [`Error::Parameter`] when the card is not found.
pub(super) fn find(photo: &CameraPhoto, half: f64, scale: f64) -> Result<(Mapping, usize, f64)> {
    let card = dots(half);
    let apart = spacing(half) / scale;
    if apart < 8.0 {
        let what = format!("the card's dots are {apart:.1} camera pixels apart; take a longer lens or a finer camera");
        return Err(Error::parameter("dot card", what));
    }
    let spots = spots(photo, apart);
    let lost = |count: usize| {
        let what = format!(
            "{count} of {} dots were found in its photo: check lens and camera pitch, and that the camera sees the zero order \
             and the square about it",
            card.len()
        );
        Error::parameter("dot card", what)
    };
    if spots.len() < 8 {
        return Err(lost(spots.len()));
    }
    let mut random = Random::new(0xd07, 3);
    let mut draw = |count: usize| (random.bits() % count as u64) as usize;
    let near = 0.3 * spacing(half);
    let mut best: (usize, [f64; 6]) = (0, [0.0; 6]);
    for _ in 0..DRAWS {
        let (i, j, a, b) = (draw(spots.len()), draw(spots.len()), draw(card.len()), draw(card.len()));
        let seen = [spots[j][0] - spots[i][0], spots[j][1] - spots[i][1]];
        let told = [card[b][0] - card[a][0], card[b][1] - card[a][1]];
        let ratio = told[0].hypot(told[1]) / (seen[0].hypot(seen[1]) * scale);
        if !(0.75..1.34).contains(&ratio) || seen[0].hypot(seen[1]) < 2.0 * apart {
            continue;
        }
        for mirror in [1.0, -1.0] {
            // As complex numbers: told = c·seen or c·seen*.
            let s = [seen[0], mirror * seen[1]];
            let square = s[0] * s[0] + s[1] * s[1];
            let c = [(told[0] * s[0] + told[1] * s[1]) / square, (told[1] * s[0] - told[0] * s[1]) / square];
            let linear = [c[0], -c[1] * mirror, c[1], c[0] * mirror];
            let shift = [0, 1].map(|r| card[a][r] - linear[2 * r] * spots[i][0] - linear[2 * r + 1] * spots[i][1]);
            let affine = [linear[0], linear[1], shift[0], linear[2], linear[3], shift[1]];
            let count = spots.iter().filter(|spot| closest(&card, place(&affine, **spot)).1 < near).count();
            if count > best.0 {
                best = (count, affine);
            }
        }
    }
    let mut mapping = Mapping::square([photo.width, photo.height], scale);
    let (width, height) = (photo.width as f64, photo.height as f64);
    // The affine map of pixels, on places from the sensor's middle in halves of its width.
    let a = best.1;
    for row in 0..2 {
        let [x, y, shift] = [a[3 * row], a[3 * row + 1], a[3 * row + 2]];
        mapping.values[3 * row] = 0.5 * width * x;
        mapping.values[3 * row + 1] = 0.5 * width * y;
        mapping.values[3 * row + 2] = shift + x * (0.5 * width - 0.5) + y * (0.5 * height - 0.5);
    }
    let mut pairs = Vec::new();
    let mut limit = near;
    for _ in 0..6 {
        pairs.clear();
        for (k, dot) in card.iter().enumerate() {
            let distance = |spot: &[f64; 2]| {
                let nu = mapping.frequency(*spot);
                (nu[0] - dot[0]).hypot(nu[1] - dot[1])
            };
            let spot = spots.iter().min_by(|p, q| distance(p).total_cmp(&distance(q)));
            if let Some(spot) =
                spot.filter(|spot| distance(spot) < limit && closest(&card, mapping.frequency(**spot)).0 == k)
            {
                pairs.push((*spot, *dot));
            }
        }
        if pairs.len() < 8 {
            break;
        }
        mapping = mapping.fitted(&pairs)?;
        limit = (0.6 * limit).max(0.06 * near + 1.5 * scale);
    }
    if pairs.len() < 20.max(card.len() / 2) {
        return Err(lost(pairs.len()));
    }
    let miss = |(spot, dot): &([f64; 2], [f64; 2])| {
        let nu = mapping.frequency(*spot);
        ((nu[0] - dot[0]).powi(2) + (nu[1] - dot[1]).powi(2)) / (scale * scale)
    };
    let rms = (pairs.iter().map(miss).sum::<f64>() / pairs.len() as f64).sqrt();
    Ok((mapping, pairs.len(), rms))
}

fn place(affine: &[f64; 6], [x, y]: [f64; 2]) -> [f64; 2] {
    [affine[0] * x + affine[1] * y + affine[2], affine[3] * x + affine[4] * y + affine[5]]
}

/// The nearest dot and its distance.
fn closest(card: &[[f64; 2]], at: [f64; 2]) -> (usize, f64) {
    let square = |dot: &[f64; 2]| (dot[0] - at[0]).powi(2) + (dot[1] - at[1]).powi(2);
    let mut best = (0, f64::INFINITY);
    for (k, dot) in card.iter().enumerate() {
        let square = square(dot);
        if square < best.1 {
            best = (k, square);
        }
    }
    (best.0, best.1.sqrt())
}
