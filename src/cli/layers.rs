//! `compute` of pictures that stay pictures: planes by fast transforms, in one colour or three.

use super::args::{ComputeArgs, PhaseArg};
use super::colour::named;
use super::load::{Input, Panel, channel, depth_scale, placed_by};
use super::report::{Report, seconds};
use holodrive::field::npy::{self, Content};
use holodrive::field::{Complex32, Field};
use holodrive::hologram::layers::{self, Layer};
use holodrive::points::colour::NAMES;
use holodrive::points::images::{RgbDepth, Window};
use holodrive::points::slices::{Light, Slices};
use holodrive::progress::Progress;
use holodrive::random::Random;
use holodrive::units::show_length;
use holodrive::{Error, Result};
use std::time::Instant;

/// Computes the layers of a picture with depth, or of a focal stack, and writes a field for each colour of light.
pub(super) fn compute(
    args: &ComputeArgs,
    input: &Input,
    panel: &Panel,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let placement = placed_by(&args.placement);
    let slices = match (input, args.layers) {
        (Input::Images(rgb, depth), Some(count)) => {
            let picture = RgbDepth::read(rgb, depth, depth_scale(args.placement.depth_scale), &placement)?;
            let window = Window::new(&placement, picture.size(), &panel.grid)?;
            Slices::of_depth(picture, window, &panel.grid, count)?
        }
        (Input::Stack(_), Some(_)) => {
            return Err(Error::parameter("layers", "a focal stack has the planes that it has; leave --layers out"));
        }
        (Input::Stack(files), None) => Slices::of_stack(files, &placement, &panel.grid)?,
        _ => return Err(Error::parameter("layers", "layers are for a picture with depth (rgb.png+depth.png)")),
    };
    let seed = match args.placement.phase {
        PhaseArg::Zero => None,
        PhaseArg::Random => Some(args.light.seed),
        PhaseArg::Path => {
            return Err(Error::parameter("phase", "path is for scenes; use zero or random with a picture"));
        }
    };
    let lights: Vec<(f64, Light)> = match &panel.lasers {
        None => vec![(panel.wavelength, Light::Channel(channel(&args.hologram)))],
        Some(lasers) => (0..3).map(|i| (lasers.wavelengths()[i], Light::Laser(lasers, i))).collect(),
    };
    let colored = lights.len() > 1;
    for (i, (wavelength, light)) in lights.into_iter().enumerate() {
        let begin = Instant::now();
        let (field, lit) =
            field(&slices, light, wavelength, (args.hologram.memory, seed, !args.see_through), panel, progress)?;
        let mut own = Report::new("compute");
        let part = if colored { &mut own } else { &mut *report };
        part.add("wavelength", wavelength, "");
        part.add("method", "layers", "");
        part.add("layers", slices.depths().len(), "");
        part.add("samples", lit, "");
        let (first, last) = (slices.depths()[0], slices.depths()[slices.depths().len() - 1]);
        let spent = begin.elapsed().as_secs_f64();
        let planes =
            if slices.depths().len() == 1 { "1 plane".into() } else { format!("{} planes", slices.depths().len()) };
        let line = format!(
            "field        {:>8}  layers: {planes}, z {} … {}, {lit} lit samples of {}×{}",
            seconds(spent),
            show_length(first),
            show_length(last),
            slices.lattice.width,
            slices.lattice.height
        );
        part.add("field_seconds", spent, line);
        let path = if colored { named(&args.output, NAMES[i]) } else { args.output.clone() };
        let content = Content { z: 0.0, depth: Some([first, last]), eye: None, window: None };
        let origin = format!("{} layers of {}", slices.depths().len(), args.input.display());
        npy::write_field(&path, &field, &content, &origin)?;
        part.add("output", path.display().to_string(), format!("field        {}", path.display()));
        if colored {
            report.add_part(NAMES[i], format!("{:<12} {}", NAMES[i], show_length(wavelength)), own);
        }
    }
    Ok(())
}

/// The field in one colour of light, and the number of lit samples.
fn field(
    slices: &Slices,
    light: Light,
    wavelength: f64,
    (memory, seed, occlude): (u64, Option<u64>, bool),
    panel: &Panel,
    progress: &Progress,
) -> Result<(Field, usize)> {
    let needed =
        slices.bytes() + layers::bytes(&slices.lattice, &panel.grid, wavelength, slices.depths().iter().copied())?;
    if needed > memory {
        let hint = "give more memory or fewer layers".to_owned();
        return Err(Error::Memory { what: "layers", needed: needed.div_ceil(1 << 20), budget: memory >> 20, hint });
    }
    let mut lit = 0;
    let mut all = Vec::new();
    for index in 0..slices.depths().len() {
        progress.check()?;
        let slice = slices.slice(index, light);
        let phase = |i: usize| match seed {
            Some(seed) => Random::new(seed, ((index as u64) << 40) + i as u64).phase(),
            None => 0.0,
        };
        let wave = |(i, &a): (usize, &f32)| {
            if a == 0.0 {
                return Complex32::default();
            }
            let (sin, cos) = phase(i).sin_cos();
            Complex32::new(a * cos as f32, a * sin as f32)
        };
        lit += slice.amplitudes.iter().filter(|a| **a > 0.0).count();
        let samples = slice.amplitudes.iter().enumerate().map(wave).collect();
        let opaque = if occlude && slice.covered.contains(&true) { slice.covered } else { Vec::new() };
        all.push(Layer { z: slice.z, light: samples, opaque });
    }
    if lit == 0 {
        return Err(Error::parameter("input", "is black everywhere in this light, so it makes no field"));
    }
    let field = layers::compute(&all, &slices.lattice, &panel.grid, wavelength, memory, progress)?;
    Ok((field, lit))
}
