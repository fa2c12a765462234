//! A picture in the lens's focal plane, corrected by photos of the hidden bench.

use crate::bench::HiddenBench;
use holodrive::calibration::CameraView;
use holodrive::encode::far::{FarPicture, FarPlane, FarReport, FarSettings, Photograph, far_frame};
use holodrive::field::Complex64;
use holodrive::panel::{Frame, PanelProfile, Setup};
use holodrive::progress::Progress;
use std::f64::consts::TAU;

/// Hills and a valley, two and a half times as wide as high: smooth at the panel's own resolution of 72 × 17 spots.
pub(crate) fn picture() -> (usize, usize, Vec<f32>) {
    let (width, height) = (240, 100);
    let at = |i: usize| {
        let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let hills = 0.25 * (TAU * x / 80.0).cos() * (TAU * y / 66.0).cos();
        (0.5 + hills + 0.2 * (TAU * (x + y) / 120.0).sin()) as f32
    };
    (width, height, (0..width * height).map(at).collect())
}

/// PSNR [dB] of the amplitudes that the bench's own light has at the picture's samples, by sums of exponentials, without a camera.
/// `tilt` [rad at the borders]: what the calibrated wavefront has of it against the bench's, which is a shift of the picture.
fn judged(bench: &HiddenBench, levels: &[u16], room: [f64; 4], tilt: [f64; 2]) -> f64 {
    let shift = [tilt[0] / TAU * 2.0 / bench.width as f64, tilt[1] / TAU * 2.0 / bench.height as f64];
    let light = bench.pixels(levels);
    let (width, height, wanted) = picture();
    // Every fourth pixel of the picture, in its middle.
    let places: Vec<(usize, usize)> =
        (0..height / 4).flat_map(|j| (0..width / 4).map(move |i| (4 * i, 4 * j))).collect();
    let column = |x: usize| room[0] + (room[2] - room[0]) * (x as f64 + 0.5) / width as f64 - shift[0];
    let row = |y: usize| room[1] + (room[3] - room[1]) * (y as f64 + 0.5) / height as f64 - shift[1];
    let turns = |nu: f64, count: usize| -> Vec<Complex64> {
        (0..count).map(|n| Complex64::cis(-TAU * nu * (n as f64 - 0.5 * (count as f64 - 1.0)))).collect()
    };
    let across: Vec<Vec<Complex64>> = (0..width / 4).map(|i| turns(column(4 * i), bench.width)).collect();
    let lines: Vec<Vec<Complex64>> = (0..bench.height)
        .map(|n| {
            let line = &light[n * bench.width..][..bench.width];
            across.iter().map(|turns| line.iter().zip(turns).map(|(u, t)| u * t).sum()).collect()
        })
        .collect();
    let pairs: Vec<(f64, f64)> = places
        .iter()
        .map(|&(x, y)| {
            let down = turns(row(y), bench.height);
            let u: Complex64 = lines.iter().zip(&down).map(|(line, t)| line[x / 4] * t).sum();
            (u.norm(), f64::from(wanted[y * width + x]).sqrt())
        })
        .collect();
    let scale = pairs.iter().map(|(a, w)| a * w).sum::<f64>() / pairs.iter().map(|(a, _)| a * a).sum::<f64>();
    let error = pairs.iter().map(|(a, w)| (scale * a - w).powi(2)).sum::<f64>() / pairs.len() as f64;
    -10.0 * error.log10()
}

/// A frame by the model and by photos: what the judge says of the model's and of the best.
pub(crate) fn corrected(
    bench: &HiddenBench,
    profile: &PanelProfile,
    view: &CameraView,
    tilt: [f64; 2],
    photos: usize,
) -> ([f64; 2], FarReport) {
    let setup = Setup::new(profile.clone(), Some(bench.wavelength)).expect("setup");
    let room = view.room([-0.9, 0.15, 0.9, 0.9]).expect("room");
    let (width, height, light) = picture();
    let plane = FarPlane::new(&FarPicture { width, height, light, room }, profile).expect("plane");
    let places = view.places(&plane.frequencies()).expect("on the sensor");
    let mut first = None;
    let mut count = 0;
    let mut photograph = |frame: &Frame| {
        first.get_or_insert_with(|| judged(bench, &frame.levels, room, tilt));
        count += 1;
        // Exposed for the picture: the zero order is full.
        view.registered(&bench.exposed(&frame.levels, 100 + count, 970), &places)
    };
    let photograph: &mut Photograph<'_> = &mut photograph;
    let settings = FarSettings { photos, photo_step: 0.02, ..FarSettings::default() };
    let (frame, report) = far_frame(&plane, &setup, &settings, Some(photograph), &Progress::new()).expect("frame");
    ([first.expect("a photo"), judged(bench, &frame.levels, room, tilt)], report)
}
