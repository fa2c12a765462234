//! How good what an eye sees is.

use super::{Account, Judge, Reconstruction, Seen};
use crate::reconstruction::metrics;
use crate::scene::texture::srgb_from_linear;
use rayon::prelude::*;
use serde::Serialize;
use std::borrow::Borrow;

/// Part of the picture along each side that is not judged: beyond it nobody knows what should be blurred into it.
const RIM: f64 = 0.05;
/// Radiance over white's from which a part of the picture has a contrast of speckle.
const LIT: f32 = 0.08;
/// Width of a blur, in cells of the retina, up to which something is in focus.
const BLUR: f64 = 2.0;
/// Part of the picture that must be in focus at a look for figures of it.
const SOME: f64 = 0.01;

/// Figures of a hologram as an eye sees it, over all looks; all simulated.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SeenBy {
    /// Who judges.
    pub judge: String,
    /// Number of looks.
    pub looks: usize,
    /// The picture as a whole.
    pub all: SeenFigures,
    /// Each of three lasers alone, red, green, blue; none for one laser.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lasers: Vec<SeenFigures>,
    /// Each look.
    #[serde(skip)]
    pub each: Vec<LookFigures>,
}

/// Figures over all looks of one hologram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SeenFigures {
    /// PSNR of amplitudes, √intensity with 1 for white, after one least-squares gain for all looks: mean over the looks [dB].
    pub psnr: f64,
    /// The same of the worst look [dB].
    pub psnr_worst: f64,
    /// PSNR of sRGB-coded intensities, mean over the looks [dB].
    pub psnr_coded: f64,
    /// SSIM of amplitudes, mean over the looks.
    pub ssim: f64,
    /// The same of the worst look.
    pub ssim_worst: f64,
    /// PSNR of amplitudes where the picture is in focus: of the parts whose depth blurs by no more than two cells of the retina.
    /// Mean over the looks that have some [dB]; none where no depths are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_in_focus: Option<f64>,
    /// SSIM there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ssim_in_focus: Option<f64>,
    /// Speckle contrast: σ/μ of intensity over what it should be, where that is above 8 % of white; mean over the looks.
    pub contrast: f64,
    /// How much brighter the hologram is from one look to another: σ/μ of the mean of intensity over what it should be.
    pub brightness_spread: f64,
    /// Share of the light leaving the panel that enters a pupil; mean over the looks.
    pub efficiency: f64,
    /// Share that enters some pupil of the eye box.
    pub box_efficiency: f64,
}

/// Figures of one look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LookFigures {
    /// PSNR of amplitudes [dB].
    pub psnr: f64,
    /// PSNR of sRGB-coded intensities [dB].
    pub psnr_coded: f64,
    /// SSIM of amplitudes.
    pub ssim: f64,
    /// PSNR of amplitudes \[dB\] and SSIM where it is in focus; none where next to nothing is.
    pub in_focus: Option<(f64, f64)>,
    /// Speckle contrast.
    pub contrast: f64,
    /// Mean of intensity over what it should be.
    pub brightness: f64,
}

/// The part of the retina that is judged.
#[derive(Clone, Copy)]
struct Rim {
    width: usize,
    left: usize,
    top: usize,
    size: (usize, usize),
}

impl Rim {
    fn of(judge: &Judge) -> Self {
        let grid = judge.retina();
        let cut = |side: usize| (side as f64 * RIM).round() as usize;
        let (left, top) = (cut(grid.width), cut(grid.height));
        Self { width: grid.width, left, top, size: (grid.width - 2 * left, grid.height - 2 * top) }
    }

    /// Mean over the windows of a similarity whose middle is in focus; all where a picture has but one.
    fn mean_of_windows(&self, windows: &[f64], sharp: &[bool]) -> f64 {
        let cut = |side: usize| (side, side + 1 - side.min(11));
        let ((width, across), (height, down)) = (cut(self.size.0), cut(self.size.1));
        let middle = |i: usize| (i / across + (height - down) / 2) * width + i % across + (width - across) / 2;
        let own: Vec<f64> = (0..windows.len()).filter(|i| sharp[middle(*i)]).map(|i| windows[i]).collect();
        let own = if own.is_empty() { windows } else { &own };
        own.iter().sum::<f64>() / own.len() as f64
    }

    fn inside<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let rows = values.chunks(self.width).skip(self.top).take(self.size.1);
        rows.flat_map(|row| &row[self.left..self.left + self.size.0]).copied().collect()
    }
}

/// Pictures of one look inside the rim.
struct Pair {
    /// Intensities of one laser, or of three one after another.
    seen: Vec<f32>,
    wanted: Vec<f32>,
}

fn pair(judge: &Judge, seen: &Seen, lasers: std::ops::Range<usize>, look: usize, rim: Rim) -> Pair {
    let together = |of: &dyn Fn(usize) -> Vec<f32>| lasers.clone().flat_map(|laser| rim.inside(&of(laser))).collect();
    Pair { seen: together(&|laser| seen.of(laser, look)), wanted: together(&|laser| judge.wanted[laser][look].clone()) }
}

/// The factor on amplitudes by which all looks that count are together most like what they should be.
pub(super) fn gain(judge: &Judge, seen: &Seen) -> f64 {
    let rim = Rim::of(judge);
    gain_of((0..judge.counted).map(|look| pair(judge, seen, 0..judge.wanted.len(), look, rim)))
}

fn gain_of<P: Borrow<Pair>>(pairs: impl Iterator<Item = P>) -> f64 {
    let (mut product, mut norm) = (0.0, 0.0);
    for pair in pairs {
        for (seen, wanted) in pair.borrow().seen.iter().zip(&pair.borrow().wanted) {
            let (seen, wanted) = (f64::from(*seen), f64::from(*wanted));
            product += (seen * wanted).sqrt();
            norm += seen;
        }
    }
    if norm > 0.0 { product / norm } else { 0.0 }
}

pub(super) fn of(judge: &Judge, seen: &Seen) -> SeenBy {
    let rim = Rim::of(judge);
    let one = |laser: usize| {
        let pairs: Vec<_> = (0..judge.looks.len()).map(|look| pair(judge, seen, laser..laser + 1, look, rim)).collect();
        let gain = gain_of(pairs[..judge.counted].iter());
        let each: Vec<_> = pairs
            .par_iter()
            .enumerate()
            .map(|(look, pair)| look_figures(pair, pair, gain, rim, sharp(judge, look, rim).as_deref()))
            .collect();
        (summary(&each[..judge.counted], &seen.light[laser..=laser]), each)
    };
    let three = judge.wanted.len() > 1;
    let (all, each) = if three { together(judge, seen, rim) } else { one(0) };
    let lasers = if three { (0..3).map(|laser| one(laser).0).collect() } else { Vec::new() };
    let name = format!("eye: Fresnel, f64, light field of {} views", judge.views);
    SeenBy { judge: name, looks: judge.counted, all, lasers, each }
}

/// Figures of the picture that three lasers make: PSNR over all amplitudes, SSIM and contrast of its luminance.
fn together(judge: &Judge, seen: &Seen, rim: Rim) -> (SeenFigures, Vec<LookFigures>) {
    let gain = gain(judge, seen);
    let luminance = |picture: &Reconstruction| -> Vec<f32> {
        rim.inside(&picture.clone().luminance().values).into_iter().map(|v| v.max(0.0)).collect()
    };
    let each: Vec<_> = (0..judge.looks.len())
        .into_par_iter()
        .map(|look| {
            let (shown, wanted) = (judge.seen_with(seen, look, gain), judge.wanted(look));
            // The picture has its gain already.
            let square = if gain > 0.0 { (1.0 / (gain * gain)) as f32 } else { 0.0 };
            let light = luminance(&shown).into_iter().map(|v| v * square).collect();
            let light = Pair { seen: light, wanted: luminance(&wanted) };
            let psnr_coded = psnr(&coded(&shown, rim), &coded(&wanted, rim));
            let sharp = sharp(judge, look, rim);
            let own = pair(judge, seen, 0..3, look, rim);
            LookFigures { psnr_coded, ..look_figures(&own, &light, gain, rim, sharp.as_deref()) }
        })
        .collect();
    (summary(&each[..judge.counted], &seen.light), each)
}

/// Figures of one look: PSNR of all values; SSIM, contrast and brightness of its light.
fn look_figures(pair: &Pair, light: &Pair, gain: f64, rim: Rim, sharp: Option<&[bool]>) -> LookFigures {
    let amplitudes = |pair: &Pair| -> (Vec<f64>, Vec<f64>) {
        let seen = pair.seen.iter().map(|v| gain * f64::from(*v).sqrt()).collect();
        (seen, pair.wanted.iter().map(|v| f64::from(*v).sqrt()).collect())
    };
    let (seen, wanted) = amplitudes(pair);
    let code = |v: &f64| f64::from(srgb_from_linear((v * v).min(1.0) as f32));
    let codes = |values: &[f64]| values.iter().map(code).collect::<Vec<_>>();
    let (light_seen, light_wanted) = amplitudes(light);
    let shown = |values: &[f64]| values.iter().map(|v| v.min(1.0) as f32).collect::<Vec<_>>();
    let lit = light.seen.iter().zip(&light.wanted).filter(|(_, wanted)| **wanted > LIT);
    let ratios: Vec<f32> = lit.map(|(seen, wanted)| seen / wanted).collect();
    let mean = ratios.iter().map(|v| f64::from(*v)).sum::<f64>() / ratios.len().max(1) as f64;
    let (shown_seen, shown_wanted) = (shown(&light_seen), shown(&light_wanted));
    let windows = metrics::ssim_windows(&shown_seen, &shown_wanted, rim.size.0, rim.size.1);
    let in_focus = sharp.map(|sharp| {
        let of = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(sharp.iter().cycle()).filter(|(_, sharp)| **sharp).map(|(v, _)| *v).collect()
        };
        (psnr(&of(&seen), &of(&wanted)), rim.mean_of_windows(&windows, sharp))
    });
    LookFigures {
        psnr: psnr(&seen, &wanted),
        psnr_coded: psnr(&codes(&seen), &codes(&wanted)),
        ssim: windows.iter().sum::<f64>() / windows.len() as f64,
        in_focus,
        contrast: if ratios.is_empty() { 0.0 } else { metrics::speckle_contrast(&ratios) },
        brightness: mean * gain * gain,
    }
}

/// Which cells inside the rim are in focus at a look; none where depths are not known, or next to nothing is.
fn sharp(judge: &Judge, look: usize, rim: Rim) -> Option<Vec<bool>> {
    let (depths, sight) = (judge.depths.as_ref()?, &judge.sight);
    let cell = sight.retina.pitch_x.max(sight.retina.pitch_y);
    let magnified = |z: f64| sight.distance / (sight.distance - z);
    let focus = magnified(judge.looks[look].focus);
    let blur = |z: f32| judge.width * (magnified(z.into()) - focus).abs();
    let sharp: Vec<bool> = rim.inside(depths).into_iter().map(|z| blur(z) <= BLUR * cell).collect();
    let count = sharp.iter().filter(|sharp| **sharp).count();
    (count as f64 > SOME * sharp.len() as f64).then_some(sharp)
}

/// sRGB-coded components of a picture inside the rim.
fn coded(picture: &Reconstruction, rim: Rim) -> Vec<f64> {
    let code = |v: f32| f64::from(srgb_from_linear(v.clamp(0.0, 1.0)));
    match picture {
        Reconstruction::Gray(seen) => rim.inside(&seen.values).into_iter().map(code).collect(),
        Reconstruction::Color(seen) => rim.inside(&seen.rgb).into_iter().flatten().map(code).collect(),
    }
}

/// −10·log₁₀ of the mean squared difference [dB].
fn psnr(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    -10.0 * (sum / a.len() as f64).log10()
}

fn summary(each: &[LookFigures], light: &[Account]) -> SeenFigures {
    let count = each.len() as f64;
    let mean = |of: fn(&LookFigures) -> f64| each.iter().map(of).sum::<f64>() / count;
    let least = |of: fn(&LookFigures) -> f64| each.iter().map(of).fold(f64::INFINITY, f64::min);
    let brightness = mean(|look| look.brightness);
    let sharp: Vec<(f64, f64)> = each.iter().filter_map(|look| look.in_focus).collect();
    let in_focus = |of: fn(&(f64, f64)) -> f64| {
        (!sharp.is_empty()).then(|| sharp.iter().map(of).sum::<f64>() / sharp.len() as f64)
    };
    let variance = each.iter().map(|look| (look.brightness - brightness).powi(2)).sum::<f64>() / count;
    let share = |of: fn(&Account) -> f64| {
        let (part, all) = (light.iter().map(of).sum::<f64>(), light.iter().map(|light| light.panel).sum::<f64>());
        if all > 0.0 { part / all } else { 0.0 }
    };
    SeenFigures {
        psnr: mean(|look| look.psnr),
        psnr_worst: least(|look| look.psnr),
        psnr_coded: mean(|look| look.psnr_coded),
        ssim: mean(|look| look.ssim),
        ssim_worst: least(|look| look.ssim),
        psnr_in_focus: in_focus(|figures| figures.0),
        ssim_in_focus: in_focus(|figures| figures.1),
        contrast: mean(|look| look.contrast),
        brightness_spread: if brightness > 0.0 { variance.sqrt() / brightness } else { 0.0 },
        efficiency: share(|light| light.pupil),
        box_efficiency: share(|light| light.eye_box),
    }
}
