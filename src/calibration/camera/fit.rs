//! From photos to the numbers of panel and bench: mapping, first wavefront, and least squares over everything.

use super::descent::{Fitted, descend, expose};
use super::dot_finder;
use super::mapping::Mapping;
use super::model::{Model, Seen};
use super::panel_light::{CURVE, PanelLight};
use super::patterns::{RANDOM, levels, step};
use super::photo::CameraPhoto;
use super::shapes::level_shapes;
use super::slopes::{self, Start};
use super::solve::solve;
use super::zoom::Zoom;
use crate::error::{Error, Result};
use crate::panel::{PanelKind, PanelProfile};
use crate::progress::Progress;
use crate::random::Random;

/// Pixels of each photo that are compared.
const PIXELS: usize = 12_000;
/// Share of the window that they are taken from.
const INNER: f64 = 0.93;
/// Noise of a photo against its brightest pixel, and of a pixel against itself: how much each counts.
const NOISE: [f64; 2] = [0.01, 0.02];
/// Share of the photos' variance that a fit of their own patterns explains at least.
const EXPLAINED: f64 = 0.5;
/// Factors on the nominal curve that are tried where the photos do not answer to it.
const GAINS: [f64; 6] = [0.7, 1.4, 0.5, 2.0, 3.0, 0.35];

/// The camera behind the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraBench {
    /// Focal length of the lens, panel in one focal plane or near it, camera in the other [m].
    pub lens: f64,
    /// Distance of neighbouring pixels of the camera [m].
    pub camera_pitch: f64,
}

/// What was found, before it is put into words and files.
pub(super) struct Found {
    pub(super) model: Model,
    pub(super) fitted: Fitted,
    /// Share of the photos' variance that the fit explains.
    pub(super) explained: f64,
    pub(super) dots: usize,
    pub(super) dots_rms: f64,
    /// Cycles a pixel of the panel for each camera pixel.
    pub(super) scale: f64,
}

/// Numbers of the curve whose phases come nearest to these, from level 0 on.
fn shaped(phases: &[f64]) -> Vec<f64> {
    let shapes = level_shapes(CURVE, phases.len());
    let (mut normal, mut right) = (vec![0.0; CURVE * CURVE], vec![0.0; CURVE]);
    for (shape, phase) in shapes.iter().zip(phases) {
        for a in 0..CURVE {
            right[a] += shape[a] * (phase - phases[0]);
            (0..CURVE).for_each(|b| normal[a * CURVE + b] += shape[a] * shape[b]);
        }
    }
    // A panel of fewer levels than functions leaves some without a say.
    (0..CURVE).for_each(|a| normal[a * CURVE + a] *= 1.0 + 1e-9);
    solve(&normal, &right).unwrap_or_else(|| vec![0.0; CURVE])
}

/// Pixels of the sensor that see the window, `PIXELS` of them at random, in the order of reading.
fn pixels(mapping: &Mapping, half: f64) -> Vec<[u16; 2]> {
    let [width, height] = mapping.size;
    let mut keyed: Vec<(u64, [u16; 2])> = Vec::new();
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let nu = mapping.frequency([column as f64, row as f64]);
            if nu.iter().all(|f| f.abs() < INNER * half) {
                keyed.push((Random::new(0xca3, (row * width + column) as u64).bits(), [column as u16, row as u16]));
            }
        }
    }
    keyed.sort_unstable();
    keyed.truncate(PIXELS);
    let mut out: Vec<[u16; 2]> = keyed.into_iter().map(|(_, pixel)| pixel).collect();
    out.sort_unstable_by_key(|pixel| (pixel[1], pixel[0]));
    out
}

/// A photo at the pixels, brought to a mean of one.
fn seen(photo: &CameraPhoto, levels: Vec<u16>, pixels: &[[u16; 2]]) -> Seen {
    let values: Vec<f64> = pixels
        .iter()
        .map(|[column, row]| f64::from(photo.values[usize::from(*row) * photo.width + usize::from(*column)]))
        .collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = (values.iter().sum::<f64>() / values.len() as f64 - low).max(f64::MIN_POSITIVE);
    let full = f64::from(photo.full());
    let noise = |v: f64| (NOISE[0] * (full - low)).hypot(NOISE[1] * (v - low));
    let weights = values.iter().map(|&v| if v >= full { 0.0 } else { (mean / noise(v)) as f32 }).collect();
    Seen { levels, values: values.iter().map(|v| ((v - low) / mean) as f32).collect(), weights }
}

/// Fits everything to photos of the dot card and of the random patterns, in the order of [`super::camera_frames`].
pub(super) fn fit(
    profile: &PanelProfile,
    wavelength: f64,
    bench: &CameraBench,
    photos: &[CameraPhoto],
    progress: &Progress,
) -> Result<Found> {
    check(profile, bench, photos)?;
    let (width, height) = (profile.width, profile.height);
    let step = step(profile);
    let zoom = Zoom::new(width, height, step, [0.0; 2]);
    let scale = bench.camera_pitch * profile.pitch_x.max(profile.pitch_y) / (wavelength * bench.lens);
    progress.start("photos", 0);
    let (mut mapping, dots, dots_rms) = dot_finder::find(&photos[0], zoom.half(), scale)?;
    let frames: Vec<Vec<u16>> = (0..RANDOM).map(|p| levels(profile, p)).collect();
    let light = PanelLight::new(width, height, profile.levels());
    let pixels = pixels(&mapping, zoom.half());
    if pixels.len() < PIXELS / 2 {
        let what = format!("{} of its pixels see the square about the zero order; {PIXELS} are wanted", pixels.len());
        return Err(Error::parameter("camera", what));
    }
    let model = Model::new(light, zoom, mapping.size, pixels, RANDOM);
    let nominal = profile.drive_curve(wavelength)?.0;
    let (start, curve) = first(&model, &mapping, nominal.values(), profile.crosstalk, &frames, &photos[1..], progress)?;
    mapping.values[2] -= start.tilt[0];
    mapping.values[5] -= start.tilt[1];
    let mut values = begin(&model, &curve, profile.crosstalk);
    let l = model.layout.clone();
    values[l.wave.clone()].copy_from_slice(&start.wave);
    values[l.source.clone()].copy_from_slice(&start.source);
    values[l.mapping.clone()].copy_from_slice(&mapping.values);
    let data: Vec<Seen> =
        frames.into_iter().zip(&photos[1..]).map(|(levels, photo)| seen(photo, levels, &model.pixels)).collect();
    let lit = model.lit(&values);
    expose(&model, &mut values, &lit, &data);
    progress.start("coarse fit", 0);
    let coarse = descend(&model, &data, &values, &few(&model), 8, 0.02, progress)?;
    progress.start("fit", 0);
    let all: Vec<usize> = (0..l.count()).collect();
    let fitted = descend(&model, &data, &coarse.values, &all, 12, 1e-4, progress)?;
    let explained = 1.0 - fitted.misfit / variance(&data);
    if explained < EXPLAINED {
        return Err(unanswered());
    }
    Ok(Found { model, fitted, explained, dots, dots_rms, scale })
}

/// Mean square of what each photo's pixels differ from their mean, in units of their expected deviation.
fn variance(data: &[Seen]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for seen in data {
        let pixels = || seen.values.iter().zip(&seen.weights).map(|(v, w)| (f64::from(*v), f64::from(*w).powi(2)));
        let (weight, total) = pixels().fold((0.0, 0.0), |(a, b), (v, w)| (a + w, b + w * v));
        sum += pixels().map(|(v, w)| w * (v - total / weight).powi(2)).sum::<f64>();
        count += seen.weights.iter().filter(|w| **w > 0.0).count() as f64;
    }
    sum / count
}

fn unanswered() -> Error {
    Error::parameter(
        "photos",
        "they do not show what the random patterns make: check that each is of its own pattern, in focus, and that the profile's \
         size, pitch, levels and phase sign are the panel's",
    )
}

fn check(profile: &PanelProfile, bench: &CameraBench, photos: &[CameraPhoto]) -> Result<()> {
    if profile.kind != PanelKind::PhaseLcos {
        let what = format!("{} is no phase panel of liquid crystal, whose curve is smooth in its levels", profile.name);
        return Err(Error::parameter("panel", what));
    }
    for (name, length) in [("lens", bench.lens), ("camera pitch", bench.camera_pitch)] {
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::out_of_range(name, format!("{length} m"), "must be greater than zero"));
        }
    }
    if photos.len() != RANDOM + 1 {
        let what =
            format!("{}; {} are wanted: the dot card's and {RANDOM} of random patterns", photos.len(), RANDOM + 1);
        return Err(Error::parameter("photos", what));
    }
    let size = (photos[0].width, photos[0].height);
    if let Some(k) = photos.iter().position(|photo| (photo.width, photo.height) != size) {
        let what =
            format!("photo {k} has {}×{} pixels, the first {}×{}", photos[k].width, photos[k].height, size.0, size.1);
        return Err(Error::parameter("photos", what));
    }
    Ok(())
}

/// Numbers before anything but the curve is known.
fn begin(model: &Model, curve: &[f64], crosstalk: f64) -> Vec<f64> {
    let l = &model.layout;
    let mut values = vec![0.0; l.count()];
    for (m, c) in curve.iter().enumerate() {
        values[l.curve.start + m * model.light.over.len()] = *c;
    }
    values[l.crosstalk] = if crosstalk > 0.0 { crosstalk } else { 0.2 };
    values[l.unmodulated.start] = 0.15;
    values
}

/// The first wavefront, with the factor on the nominal curve to which the photos answer best.
fn first(
    model: &Model,
    mapping: &Mapping,
    nominal: &[f64],
    crosstalk: f64,
    frames: &[Vec<u16>],
    photos: &[CameraPhoto],
    progress: &Progress,
) -> Result<(Start, Vec<f64>)> {
    let enough = slopes::PARTS[0] * slopes::PARTS[1] / 2;
    let pairs: Vec<(&[u16], &CameraPhoto)> = frames.iter().map(Vec::as_slice).zip(photos).collect();
    let curve = shaped(nominal);
    let mut best: Option<(Start, Vec<f64>)> = None;
    for gain in std::iter::once(1.0).chain(GAINS) {
        progress.check()?;
        let curve: Vec<f64> = curve.iter().map(|c| c * gain).collect();
        let start = slopes::start(model, mapping, &begin(model, &curve, crosstalk), &pairs, progress);
        let good = |s: &Start| s.height * s.found as f64;
        if best.as_ref().is_none_or(|(other, _)| good(&start) > good(other)) {
            best = Some((start, curve));
        }
        if best.as_ref().is_some_and(|(start, _)| start.found >= enough) {
            break;
        }
    }
    match best {
        Some(best) if best.0.found >= enough / 2 => Ok(best),
        _ => Err(unanswered()),
    }
}

/// The numbers of the first steps: low degrees, one curve for the whole panel.
fn few(model: &Model) -> Vec<usize> {
    let (l, light) = (&model.layout, &model.light);
    let degree = |term: &[usize; 2]| term[0] + term[1];
    (0..l.count())
        .filter(|&i| {
            if l.wave.contains(&i) {
                degree(&light.wave.terms[i - l.wave.start]) <= 4
            } else if l.source.contains(&i) {
                degree(&light.source.terms[i - l.source.start]) <= 2
            } else if l.curve.contains(&i) {
                let (m, t) = ((i - l.curve.start) / light.over.len(), (i - l.curve.start) % light.over.len());
                t == 0 && m < 3
            } else if l.mapping.contains(&i) {
                [2, 5].contains(&(i - l.mapping.start))
            } else {
                true
            }
        })
        .collect()
}
