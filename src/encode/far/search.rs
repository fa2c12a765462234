//! The search for the phases: steps by the model, then by photos.

use super::FarPlane;
use crate::encode::model::PanelModel;
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::panel::{EncodingRecord, Frame, Illumination, Modulation, Pattern, PhasePattern, Setup, drive};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::f64::consts::{PI, TAU};

/// How phases are sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FarSettings {
    /// Steps by the model alone.
    pub iterations: usize,
    /// Photos that are taken, each for one step.
    pub photos: usize,
    /// Longest step of a pixel's phase by the model [rad]; it falls to a twentieth along half a cosine.
    pub step: f64,
    /// Longest step by a photo [rad], likewise.
    pub photo_step: f64,
}

impl Default for FarSettings {
    fn default() -> Self {
        Self { iterations: 150, photos: 30, step: 0.3, photo_step: 0.05 }
    }
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FarReport {
    /// Samples of the picture along columns and rows.
    pub samples: [usize; 2],
    /// Peak signal-to-noise ratio of the amplitudes by the model after its last step [dB].
    pub model_psnr: f64,
    /// Of each photo, in their order; the first is that of the frame that the model alone found.
    pub photo_psnr: Vec<f64>,
    /// The photo whose frame was taken.
    pub taken: Option<usize>,
}

/// The light that was seen at the picture's samples ([`FarPlane::frequencies`]), in any unit, without the camera's dark level; NaN
/// where nothing can be said (a pixel that is full).
pub type Photograph<'a> = dyn FnMut(&Frame) -> Result<Vec<f32>> + 'a;

/// Refuses light that was seen where it is not like the model's.
fn check_likeness(seen: &[f32], model: &[f32]) -> Result<()> {
    let pairs = || seen.iter().zip(model).filter(|(s, _)| s.is_finite()).map(|(s, m)| (f64::from(*s), f64::from(*m)));
    let count = pairs().count() as f64;
    let (s, m) = pairs().fold((0.0, 0.0), |(a, b), (s, m)| (a + s / count, b + m / count));
    let (mut cross, mut own, mut other) = (0.0, 0.0, 0.0);
    for (seen, model) in pairs() {
        cross += (seen - s) * (model - m);
        own += (model - m).powi(2);
        other += (seen - s).powi(2);
    }
    let correlation = cross / (own * other).sqrt();
    if count >= 64.0 && correlation > LEAST_LIKE {
        return Ok(());
    }
    let what = format!(
        "it is not like what the panel should show (correlation {correlation:.2}): check that it is of this frame, that the camera \
         stands where it was calibrated, that the panel's profile is that calibration's, and that the picture is not overexposed"
    );
    Err(Error::parameter("photo", what))
}

/// Correlation of a photo with the model's light below which it shows something else; of a thousand samples that have nothing to do
/// with it, three in a hundred thousand have more.
const LEAST_LIKE: f64 = 0.13;

/// Light of a picture over the camera's noise, below which steps by photos lead astray: the dark level is known to the noise only, and
/// what is wrong about it is light to be taken away. On a bench with photos at 6 they ended 0.6 dB below where they began, at 30 and
/// above 0.7 dB above it.
const LEAST_OVER_NOISE: f64 = 12.0;

/// Refuses two photos of one frame that differ by too much for the light in them.
fn check_noise(first: &[f32], second: &[f32]) -> Result<()> {
    let (mut noise, mut count, mut light, mut squares) = (0.0, 0.0, 0.0, 0.0);
    let pairs = first.iter().zip(second).map(|(a, b)| (f64::from(*a), f64::from(*b)));
    for (a, b) in pairs.filter(|(a, b)| a.is_finite() && b.is_finite()) {
        let mean = (0.5 * (a + b)).max(0.0);
        (noise, count) = (noise + 0.5 * (a - b).powi(2), count + 1.0);
        // Weighted by itself: most of a picture may be dark.
        (light, squares) = (light + mean, squares + mean * mean);
    }
    let noise = (noise / f64::max(count, 1.0)).sqrt();
    if squares >= LEAST_OVER_NOISE * noise * light {
        return Ok(());
    }
    let what = format!(
        "the picture's light is {:.1} times the camera's noise, as a second photo of the same frame shows; {LEAST_OVER_NOISE} times are \
         needed: expose for the picture (the zero order may be overexposed) or take the mean of several photos",
        squares / (light * noise)
    );
    Err(Error::parameter("photo", what))
}

/// Finds a frame that shows the picture, first by the model and then, where there is a camera, by photos of what the panel shows;
/// of the photographed frames the best is returned. The first is photographed twice, which tells the camera's noise.
///
/// # Errors
/// [`Error::Parameter`] for a panel that modulates amplitude, settings out of their domain, or photos that do not show the
/// frame or are too noisy; what `photograph` returns; [`Error::Interrupted`].
pub fn far_frame(
    plane: &FarPlane,
    setup: &Setup,
    settings: &FarSettings,
    mut photograph: Option<&mut Photograph<'_>>,
    progress: &Progress,
) -> Result<(Frame, FarReport)> {
    let positive = |v: f64| v > 0.0 && v.is_finite();
    if settings.iterations == 0 || !positive(settings.step) || !positive(settings.photo_step) {
        return Err(Error::parameter("iterations", "steps and their lengths must be positive"));
    }
    let Setup { profile, wavelength, .. } = setup;
    let correction = setup.correction(*wavelength)?.0;
    let model = PanelModel::bent(profile, *wavelength, Illumination::Normal, correction.as_ref())?;
    let named = correction.as_ref().map(|correction| correction.name.clone());
    let mut descent = Descent::new(plane, &model, plane.start());
    let mut psnr = f64::NAN;
    progress.start("frame", settings.iterations as u64);
    for iteration in 0..settings.iterations {
        progress.check()?;
        let (field, modulated) = descent.light();
        let amplitudes: Vec<f32> = field.iter().map(|u| u.norm()).collect();
        descent.step(&field, &modulated, &amplitudes, settings.step * falling(iteration, settings.iterations));
        psnr = plane.judge(&amplitudes).1;
        progress.advance(1);
    }
    let mut report = FarReport { samples: plane.count, model_psnr: psnr, photo_psnr: Vec::new(), taken: None };
    let Some(photograph) = photograph.as_mut().filter(|_| settings.photos > 0) else {
        return Ok((descent.frame(setup, &named, settings, &report)?, report));
    };
    progress.start("photos", settings.photos as u64);
    descent.forget();
    let mut best: Option<(f64, Frame)> = None;
    for photo in 0..settings.photos {
        progress.check()?;
        let frame = descent.frame(setup, &named, settings, &report)?;
        let mut take = || {
            let seen = photograph(&frame)?;
            if seen.len() == plane.wanted.len() {
                return Ok(seen);
            }
            let what = format!("{} values for the {} samples of the picture", seen.len(), plane.wanted.len());
            Err(Error::parameter("photo", what))
        };
        let seen = take()?;
        let (field, modulated) = descent.light();
        let power: Vec<f32> = field.iter().map(|u| u.norm_sqr()).collect();
        check_likeness(&seen, &power)?;
        if photo == 0 {
            check_noise(&seen, &take()?)?;
        }
        // Noise below the dark level is no light; what is not known stays so.
        let amplitude = |v: &f32| if v.is_nan() { f32::NAN } else { v.max(0.0).sqrt() };
        let amplitudes: Vec<f32> = seen.iter().map(amplitude).collect();
        let psnr = plane.judge(&amplitudes).1;
        if best.as_ref().is_none_or(|(other, _)| psnr > *other) {
            (best, report.taken) = (Some((psnr, frame)), Some(photo));
        }
        report.photo_psnr.push(psnr);
        descent.step(&field, &modulated, &amplitudes, settings.photo_step * falling(photo, settings.photos));
        progress.advance(1);
    }
    match best {
        Some((_, mut frame)) => {
            frame.metadata.encoding = Some(record(settings, &report));
            Ok((frame, report))
        }
        None => Ok((descent.frame(setup, &named, settings, &report)?, report)),
    }
}

/// The length of a step among so many: along half a cosine to a twentieth.
fn falling(step: usize, of: usize) -> f64 {
    0.05 + 0.95 * 0.5 * (1.0 + (PI * step as f64 / of as f64).cos())
}

fn record(settings: &FarSettings, report: &FarReport) -> EncodingRecord {
    let parameters = json!({
        "iterations": settings.iterations,
        "photos": settings.photos,
        "model_psnr": report.model_psnr,
        "photo_psnr": report.photo_psnr,
        "taken": report.taken,
    });
    EncodingRecord::new("far", Modulation::Phase, parameters, None, 1.0)
}

/// Phases on their way, by Adam's steps (Kingma & Ba, arXiv:1412.6980, algorithm 1).
struct Descent<'a> {
    plane: &'a FarPlane,
    model: &'a PanelModel,
    wishes: Vec<f32>,
    moments: Vec<[f32; 2]>,
    /// Steps since the moments were empty.
    count: i32,
    /// Factor on slopes.
    gain: f32,
}

impl<'a> Descent<'a> {
    const BETA: [f32; 2] = [0.9, 0.99];

    fn new(plane: &'a FarPlane, model: &'a PanelModel, mut wishes: Vec<f32>) -> Self {
        model.lit(&mut wishes);
        let moments = vec![[0.0; 2]; wishes.len()];
        Self { plane, model, wishes, moments, count: 0, gain: 1.0 }
    }

    /// The light at the picture's samples, and that of the pixels which turns with their phases.
    fn light(&self) -> (Vec<Complex32>, Vec<Complex32>) {
        let light = self.model.light(&self.wishes);
        (self.plane.forward(&light.total), light.modulated)
    }

    /// Steps down from amplitudes that were seen where the model has this field.
    fn step(&mut self, field: &[Complex32], modulated: &[Complex32], seen: &[f32], step: f64) {
        let scale = self.plane.judge(seen).0;
        let pull = |((u, &a), &wanted): ((&Complex32, &f32), &f32)| {
            let modulus = u.norm();
            let known = modulus > 0.0 && a.is_finite();
            if known { u * ((scale * a - wanted) / modulus) } else { Complex32::new(0.0, 0.0) }
        };
        let pulls: Vec<Complex32> = field.iter().zip(seen).zip(&self.plane.wanted).map(pull).collect();
        let back = self.plane.backward(&pulls);
        let slopes = self.model.slopes(&self.wishes, &back, modulated);
        if self.count == 0 {
            // Of about one, whatever the picture's unit: squares of slopes must not vanish in single precision.
            let squares = slopes.par_chunks(1 << 14).map(|part| part.iter().map(|s| f64::from(s * s)).sum::<f64>());
            let power = squares.collect::<Vec<_>>().iter().sum::<f64>() / slopes.len() as f64;
            self.gain = (1.0 / power.sqrt().max(1e-30)) as f32;
        }
        let gain = self.gain;
        self.count += 1;
        let unbiased = [0, 1].map(|k| 1.0 / (1.0 - Self::BETA[k].powi(self.count)));
        let range = self.model.range;
        self.wishes.par_iter_mut().zip(&mut self.moments).zip(&slopes).for_each(|((wish, moment), slope)| {
            let slope = slope * gain;
            moment[0] = Self::BETA[0] * moment[0] + (1.0 - Self::BETA[0]) * slope;
            moment[1] = Self::BETA[1] * moment[1] + (1.0 - Self::BETA[1]) * slope * slope;
            let moved = *wish - step as f32 * moment[0] * unbiased[0] / ((moment[1] * unbiased[1]).sqrt() + 1e-6);
            *wish = range.map_or(moved, |range| moved.clamp(range.low, range.high));
        });
    }

    /// Forgets the way so far: photos pull elsewhere.
    fn forget(&mut self) {
        self.moments.fill([0.0; 2]);
        self.count = 0;
    }

    /// The frame whose levels are nearest to the phases; `correction`: the name of the wavefront correction that these hold.
    fn frame(
        &self,
        setup: &Setup,
        correction: &Option<String>,
        settings: &FarSettings,
        report: &FarReport,
    ) -> Result<Frame> {
        let wishes = self.wishes.iter().map(|p| p.rem_euclid(TAU as f32)).collect();
        let pattern = PhasePattern::new(setup.grid, setup.wavelength, wishes)?;
        let mut frame = drive(&Pattern::Phase(pattern), None, &setup.profile)?.frame;
        frame.metadata.applied.correction = correction.clone();
        frame.metadata.encoding = Some(record(settings, report));
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::super::FarPicture;
    use super::super::tests::{picture, setup};
    use super::*;

    /// A camera that shows what the model knows nothing of: a curve that is 30 % too long.
    #[test]
    fn photos_correct_what_the_model_does_not_know() {
        let setup = setup();
        let plane = FarPlane::new(&picture(), &setup.profile).expect("plane");
        let settings = FarSettings { iterations: 80, photos: 40, ..FarSettings::default() };
        let progress = Progress::new();
        let shown = |frame: &Frame| -> Vec<f32> {
            let phase = |&level: &u16| Complex32::cis(1.3 * TAU as f32 * f32::from(level) / 256.0);
            let light: Vec<Complex32> = frame.levels.iter().map(phase).collect();
            plane.forward(&light).iter().map(|u| 3.0 * u.norm_sqr()).collect()
        };
        let mut photograph = |frame: &Frame| Ok(shown(frame));
        let (frame, report) = far_frame(&plane, &setup, &settings, Some(&mut photograph), &progress).expect("frame");
        let first = report.photo_psnr[0];
        let taken = report.photo_psnr[report.taken.expect("a photo")];
        println!("model {:.1} dB, first photo {first:.1} dB, best {taken:.1} dB", report.model_psnr);
        assert!(report.model_psnr > 25.0 && first < report.model_psnr - 5.0 && taken > first + 4.0, "{report:?}");
        assert_eq!(frame.metadata.encoding.as_ref().map(|record| record.method.as_str()), Some("far"));
        // Photos that are mostly noise are refused.
        let mut random = crate::random::Random::new(7, 1);
        let mut noisy = |frame: &Frame| {
            let mut seen = shown(frame);
            let mean = seen.iter().sum::<f32>() / seen.len() as f32;
            seen.iter_mut().for_each(|v| *v += 4.0 * mean * (random.uniform() as f32 - 0.5));
            Ok(seen)
        };
        let told = far_frame(&plane, &setup, &settings, Some(&mut noisy), &progress).expect_err("noise");
        assert!(told.to_string().contains("noise"), "{told}");
        // Photos of something else are refused, and a picture without light or room.
        let mut other = |_: &Frame| Ok((0..plane.wanted.len()).map(|i| (i * 7919 % 101) as f32).collect());
        let told = far_frame(&plane, &setup, &settings, Some(&mut other), &progress).expect_err("another's photo");
        assert!(told.to_string().contains("not like"), "{told}");
        for wrong in [
            FarPicture { light: vec![0.0; 2400], ..picture() },
            FarPicture { light: vec![f32::NAN; 2400], ..picture() },
            FarPicture { room: [0.1, 0.1, 0.1, 0.2], ..picture() },
            FarPicture { room: [0.1, 0.1, 0.9, 0.2], ..picture() },
        ] {
            assert!(FarPlane::new(&wrong, &setup.profile).is_err());
        }
    }
}
