//! All encodings side by side: the same pictures, on the same panels, seen by the same simulated eye.
//!
//! # What is asked
//!
//! A picture stands in a window in the middle of the panel's rectangle, its pixels on one or more planes behind the panel
//! ([`DepthPicture`]). Encodings of a *field* get the field of all planes' amplitudes with one phase everywhere (no speckle
//! of its own); encodings by *amplitudes on planes* get the amplitudes, and choose the phases. Light beside the window, and
//! in it at the depths of other pixels, counts for neither.
//!
//! # What is measured
//!
//! The frame lights the simulated panel; the field behind it passes the encoding's own stop and is carried to each plane.
//! Amplitudes are scaled by one factor for all planes, the least-squares one (Σwa|U|/Σw|U|²), and compared where the
//! picture stands at that depth:
//!
//! - *PSNR* of the amplitudes against the greatest wanted one, over all planes and for the worst plane;
//! - *SSIM* of the picture put together from its planes;
//! - *efficiency*: share of the light on the panel that arrives where the picture stands, summed over the planes (light that
//!   crosses the parts of two planes counts at both: a pattern that aims badly may pass 100 %);
//! - *speckle contrast*: σ/μ of seen over wanted intensity where the wanted amplitude is above a third of the greatest;
//! - *time* of the encoding.
//!
//! Every figure is simulated.

mod pictures;
#[cfg(test)]
mod view_tests;
mod views;

pub use pictures::{flat_picture, scene_picture};
pub use views::{VIEW_ENCODINGS, ViewCase, ViewRow, ViewScene, compare_views, view_cases, views_markdown};

use crate::encode::iterative::TargetPlane;
use crate::encode::pictures::{DepthPicture, encode_planes};
use crate::encode::{DoublePhase, EncodeOptions, Encoding, ErrorDiffusion, PlaneEncoding, PlaneMethod, PlaneStart};
use crate::error::Result;
use crate::field::{Complex32, Field, Grid};
use crate::names::Named;
use crate::panel::simulated::illuminate;
use crate::panel::{Curve, Faults, Frame, Illumination, Modulation, Origin, PanelProfile, Response, Setup, Simulation};
use crate::pipeline::{self, Bench};
use crate::progress::Progress;
use crate::propagation::{Propagator, Settings};
use crate::reconstruction::metrics;
use serde::Serialize;
use std::time::Instant;

/// Share of the panel's sides that pictures may take.
pub const WINDOW: f64 = 0.75;

/// How much work is put into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Iterations of the methods that iterate.
    pub iterations: usize,
    /// First phases of the encodings by amplitudes on planes.
    pub start: PlaneStart,
}

/// A panel to compare on.
#[derive(Clone, Debug)]
pub struct ComparedPanel {
    /// What the table calls it.
    pub name: &'static str,
    /// The panel in its light.
    pub setup: Setup,
    /// What it does beside its profile.
    pub faults: Faults,
}

/// A picture to encode.
#[derive(Clone, Debug)]
pub struct ComparedPicture {
    /// What the table calls it.
    pub name: String,
    /// The picture and where its pixels stand.
    pub picture: DepthPicture,
}

/// A line of the table; all figures are simulated.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The picture.
    pub picture: String,
    /// The panel.
    pub panel: &'static str,
    /// The encoding.
    pub encoding: &'static str,
    /// PSNR of the amplitude over all planes [dB].
    pub psnr: f64,
    /// PSNR on each plane [dB].
    pub psnr_planes: Vec<f64>,
    /// Structural similarity of the picture put together from its planes.
    pub ssim: f64,
    /// Share of the panel's light where the picture stands.
    pub efficiency: f64,
    /// Contrast of seen over wanted intensity.
    pub speckle: f64,
    /// Time that the encoding took [s].
    pub seconds: f64,
}

/// The three panels of the table, `width × height` pixels of 8 µm at 632.8 nm.
///
/// *Ideal*: 16 bits over a turn, all of each pixel active. *8 bit*: 256 levels over a turn, 93 % active, dead space that
/// reflects fully. *1.6π*: the same with 256 levels over 1.6π, and phases of neighbouring pixels blended by a Gaussian of
/// 0.3 pixels; the profile says so, and the methods that iterate allow for it.
///
/// # Errors
/// [`crate::Error::Parameter`] for a size that no panel has.
pub fn panels(width: usize, height: usize) -> Result<Vec<ComparedPanel>> {
    let panel = |name, bits: u8, fill_factor, levels_for_2pi: f64, crosstalk| -> Result<ComparedPanel> {
        let mut profile = PanelProfile::generic()?;
        profile.name = format!("{name} panel of the comparison");
        (profile.width, profile.height, profile.bits, profile.fill_factor) = (width, height, bits, fill_factor);
        profile.crosstalk = crosstalk;
        profile.signal.width = width;
        profile.signal.height = height;
        profile.responses = vec![Response { wavelength: None, curve: Curve::Linear { levels_for_2pi } }];
        Ok(ComparedPanel { name, setup: Setup::new(profile, None)?, faults: Faults::default() })
    };
    Ok(vec![
        panel("ideal", 16, 1.0, 65536.0, 0.0)?,
        panel("8 bit", 8, 0.93, 256.0, 0.0)?,
        panel("1.6π, crosstalk", 8, 0.93, 255.0 / 0.8, 0.3)?,
    ])
}

/// Share of the panel's band that encodings of a field get here: with a blaze of half the limit along both axes the zero
/// order lies beyond its corner.
const BAND: f64 = 0.45;

/// All encodings of the table, by name: those of pictures and of fields on the panel.
pub fn encodings() -> Vec<&'static str> {
    let of_views = |name: &&str| matches!(Encoding::named(name), Ok(Encoding::View(_)));
    Encoding::NAMES.iter().map(|(name, ..)| *name).filter(|name| !of_views(name)).collect()
}

/// Encodes a picture and measures what comes of it.
///
/// # Errors
/// Those of the encoding and of the simulation; [`crate::Error::Interrupted`] when asked to stop.
pub fn compare(
    compared: &ComparedPicture,
    panel: &ComparedPanel,
    name: &'static str,
    effort: Effort,
    progress: &Progress,
) -> Result<Row> {
    let (picture, setup) = (&compared.picture, &panel.setup);
    let grid = setup.grid;
    let planes = picture.planes(&grid, WINDOW)?;
    let mut begin = Instant::now();
    let frame = match Encoding::named(name)? {
        Encoding::Planes(settings) => by_planes(planes.clone(), setup, settings, effort, progress)?,
        encoding => {
            let field = field_of(&planes, grid, setup.wavelength, progress)?;
            begin = Instant::now();
            by_field(&field, setup, encoding, effort, progress)?
        }
    };
    let seconds = begin.elapsed().as_secs_f64();
    let seen = measure(&frame, &planes, &panel.faults, progress)?;
    let ssim = {
        let (columns, rows) = picture.window(&grid, WINDOW);
        let cut = |of: &dyn Fn(&TargetPlane, usize, usize) -> f32| -> Vec<f32> {
            let inside = rows.clone().flat_map(|row| columns.clone().map(move |column| row * grid.width + column));
            let at = |i: usize| {
                let counted = planes.iter().enumerate().find(|(_, p)| p.weight.as_ref().is_none_or(|w| w[i] > 0.0));
                counted.map_or(0.0, |(k, plane)| (of(plane, k, i) / seen.peak).clamp(0.0, 1.0))
            };
            inside.map(at).collect()
        };
        let wanted = cut(&|plane, _, i| plane.amplitude[i]);
        let shown = cut(&|_, k, i| seen.amplitudes[k][i]);
        metrics::ssim(&shown, &wanted, columns.len(), rows.len())
    };
    Ok(Row {
        picture: compared.name.clone(),
        panel: panel.name,
        encoding: name,
        psnr: seen.psnr,
        psnr_planes: seen.psnr_planes,
        ssim,
        efficiency: seen.efficiency,
        speckle: seen.speckle,
        seconds,
    })
}

/// The field on the panel of amplitudes on planes, one phase everywhere on each.
fn field_of(planes: &[TargetPlane], grid: Grid, wavelength: f64, progress: &Progress) -> Result<Field> {
    let propagator = Propagator::new(grid, grid, Settings::default())?;
    let mut sum = Field::zeros(grid, wavelength);
    for plane in planes {
        let samples = plane.amplitude.iter().map(|&a| Complex32::new(a, 0.0)).collect();
        let light = propagator.propagate(&Field::new(grid, wavelength, samples)?, -plane.z, progress)?;
        sum.samples.iter_mut().zip(&light.samples).for_each(|(sum, u)| *sum += u);
    }
    Ok(sum)
}

fn by_planes(
    planes: Vec<TargetPlane>,
    setup: &Setup,
    settings: PlaneEncoding,
    effort: Effort,
    progress: &Progress,
) -> Result<Frame> {
    let start = match settings.method {
        // Whose phases are asked for as well: it starts from those.
        PlaneMethod::DoubleConstraint => PlaneStart::Field,
        _ => effort.start,
    };
    let settings = PlaneEncoding { iterations: effort.iterations, start, ..settings };
    let (profile, light) = (&setup.profile, Illumination::Normal);
    Ok(encode_planes(planes, setup.wavelength, profile, &settings, None, light, progress)?.0.frame)
}

fn by_field(
    field: &Field,
    setup: &Setup,
    mut encoding: Encoding,
    effort: Effort,
    progress: &Progress,
) -> Result<Frame> {
    let band = [BAND; 2];
    match &mut encoding {
        Encoding::DoublePhase(settings) => *settings = DoublePhase { band, ..settings.clone() },
        Encoding::ErrorDiffusion(settings) => *settings = ErrorDiffusion { band, ..settings.clone() },
        Encoding::Gradient(settings) => (settings.band, settings.iterations) = (band, effort.iterations),
        _ => {}
    }
    let angle = |limit: f64| (0.5 * limit * field.wavelength).asin();
    let blaze = match encoding.modulation() {
        Modulation::Phase => [angle(field.grid.limit_x()), angle(field.grid.limit_y())],
        Modulation::Amplitude => [0.0; 2],
    };
    let one_side = matches!(encoding, Encoding::SingleSideBand(_));
    let options = EncodeOptions { encoding: Some(encoding), blaze, ..EncodeOptions::default() };
    let encode = |field: &Field| pipeline::frame(field, setup, &options, Origin::default(), progress);
    if !one_side {
        return Ok(encode(field)?.frame);
    }
    // The upper half of the band has its middle at half the limit: there the object goes, and light from the other side
    // brings it back.
    let middle = [0.0, 0.5 * field.grid.limit_y()];
    let mut moved = field.clone();
    illuminate(&mut moved.samples, field.grid, field.wavelength, Illumination::Plane { frequency: middle })?;
    let mut frame = encode(&moved)?.frame;
    if let Some(record) = &mut frame.metadata.encoding {
        record.illumination = Illumination::Plane { frequency: middle.map(|f| -f) };
        if let Some(aperture) = &mut record.aperture {
            aperture.center = [0, 1].map(|axis| aperture.center[axis] - middle[axis]);
        }
    }
    Ok(frame)
}

/// What is seen of a frame on the planes of its picture.
struct Measured {
    /// Scaled amplitudes on each plane.
    amplitudes: Vec<Vec<f32>>,
    /// Greatest wanted amplitude.
    peak: f32,
    psnr: f64,
    psnr_planes: Vec<f64>,
    efficiency: f64,
    speckle: f64,
}

fn measure(frame: &Frame, planes: &[TargetPlane], faults: &Faults, progress: &Progress) -> Result<Measured> {
    let bench =
        Bench { simulation: Simulation { faults: faults.clone(), ..Simulation::default() }, ..Bench::default() };
    let light = pipeline::light(frame, &bench, progress)?;
    let behind = &light.field;
    let propagator = Propagator::new(behind.grid, behind.grid, Settings::default())?;
    let mut amplitudes = Vec::new();
    for plane in planes {
        let light = propagator.propagate_through(behind, plane.z, light.settings.aperture.as_ref(), progress)?;
        amplitudes.push(light.samples.iter().map(|u| u.norm()).collect::<Vec<f32>>());
    }
    let counted = |k: usize, i: usize| planes[k].weight.as_ref().map_or(1.0, |w| f64::from(w[i]));
    let pairs = || {
        (0..planes.len())
            .flat_map(|k| (0..behind.samples.len()).map(move |i| (k, i)))
            .filter(|&(k, i)| counted(k, i) > 0.0)
    };
    let (mut cross, mut own) = (0.0, 0.0);
    for (k, i) in pairs() {
        let seen = f64::from(amplitudes[k][i]);
        cross += seen * f64::from(planes[k].amplitude[i]);
        own += seen * seen;
    }
    let scale = if own > 0.0 { cross / own } else { 0.0 };
    for seen in &mut amplitudes {
        seen.iter_mut().for_each(|a| *a *= scale as f32);
    }
    let peak = planes.iter().flat_map(|p| &p.amplitude).fold(0.0f32, |a, &b| a.max(b));
    let mut squares = vec![(0.0, 0usize); planes.len()];
    let mut ratios = Vec::new();
    for (k, i) in pairs() {
        let (seen, wanted) = (amplitudes[k][i], planes[k].amplitude[i]);
        squares[k].0 += f64::from(seen - wanted).powi(2);
        squares[k].1 += 1;
        if wanted > peak / 3.0 {
            ratios.push((seen / wanted).powi(2));
        }
    }
    // The light is that of the field that was encoded: what the panel really sends is its scale squared.
    let power = frame.metadata.encoding.as_ref().map_or(1.0, |encoding| encoding.scale.powi(2));
    let decibel = |(sum, count): (f64, usize)| -10.0 * (sum / count.max(1) as f64 / f64::from(peak).powi(2)).log10();
    let all = squares.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Ok(Measured {
        psnr: decibel(all),
        psnr_planes: squares.into_iter().map(decibel).collect(),
        efficiency: own * power / behind.samples.len() as f64,
        speckle: metrics::speckle_contrast(&ratios),
        amplitudes,
        peak,
    })
}

/// Rows as tables in Markdown, one for each picture: a line for each encoding, a column for each panel.
///
/// A cell holds PSNR (of the worst plane, where there are several) [dB], SSIM, efficiency [%] and speckle contrast; the
/// last column holds the time of the encoding on the first panel [s].
pub fn markdown(rows: &[Row]) -> String {
    let unique = |of: &dyn Fn(&Row) -> String| {
        let mut names: Vec<String> = Vec::new();
        for name in rows.iter().map(of) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    };
    let panels = unique(&|row| row.panel.into());
    let encodings = unique(&|row| row.encoding.into());
    let mut out = String::new();
    for picture in unique(&|row| row.picture.clone()) {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.picture == picture).collect();
        let planes = rows.first().map_or(0, |row| row.psnr_planes.len());
        let figures = if planes > 1 { "PSNR (worst plane)" } else { "PSNR" };
        out += &format!("\n**{picture}**, {planes} plane{}: ", if planes == 1 { "" } else { "s" });
        out += &format!("{figures} dB, SSIM, efficiency %, speckle contrast; simulated\n\n| encoding |");
        out += &panels.iter().map(|panel| format!(" {panel} |")).collect::<String>();
        out += " seconds |\n|---|";
        out += &"---:|".repeat(panels.len() + 1);
        out.push('\n');
        for encoding in &encodings {
            let of = |panel: &String| rows.iter().find(|row| row.panel == panel && row.encoding == encoding);
            let cell = |row: &&Row| {
                let worst = row.psnr_planes.iter().copied().fold(f64::INFINITY, f64::min);
                let worst = if planes > 1 { format!(" ({worst:.1})") } else { String::new() };
                let (share, speckle) = (100.0 * row.efficiency, row.speckle);
                format!(" {:.1}{worst}, {:.2}, {share:.1}, {speckle:.2} |", row.psnr, row.ssim)
            };
            out += &format!("| {encoding} |");
            out += &panels.iter().map(|panel| of(panel).map_or_else(|| " |".into(), cell)).collect::<String>();
            let seconds = panels.first().and_then(of).map_or_else(String::new, |row| format!("{:.2}", row.seconds));
            out += &format!(" {seconds} |\n");
        }
    }
    out
}

#[cfg(test)]
mod tests;
