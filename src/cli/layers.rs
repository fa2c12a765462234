//! `compute` of pictures that stay pictures: planes by fast transforms, in one colour or three.

use super::args::ComputeArgs;
use super::holograms::named;
use super::light::report_map;
use super::load::Input;
use super::report::{Report, step};
use super::resolve;
use crate::field::npy::Content;
use crate::field::stored;
use crate::hologram::layers::{self, SliceSettings};
use crate::panel::Setup;
use crate::points::colour::NAMES;
use crate::points::images::{PictureWindow, RgbDepth};
use crate::points::placement::Phase;
use crate::points::slices::{LightColor, Slices};
use crate::progress::Progress;
use crate::units::show_length;
use crate::{Error, Result};
use serde_json::json;
use std::time::Instant;

/// Computes the layers of a picture with depth, or of a focal stack, and writes a field for each colour of light.
pub(super) fn compute(
    args: &ComputeArgs,
    input: &Input,
    setup: &Setup,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let placement = resolve::placement(&args.placement);
    let slices = match (input, args.layers) {
        (Input::Images(rgb, depth), Some(count)) => {
            let picture = RgbDepth::read(rgb, depth, &args.map.reading(), &placement)?;
            report_map(&picture.map, report);
            let window = PictureWindow::new(&placement, picture.size(), &setup.grid)?;
            Slices::of_depth(picture, window, &setup.grid, count)?
        }
        (Input::Stack(_), Some(_)) => {
            return Err(Error::parameter("layers", "a focal stack has the planes that it has; leave --layers out"));
        }
        (Input::Stack(files), None) => Slices::of_stack(files, &placement, &setup.grid)?,
        _ => return Err(Error::parameter("layers", "layers are for a picture with depth (rgb.png+depth.png)")),
    };
    let seed = match args.placement.phase(args.light.random.seed) {
        Phase::Zero => None,
        Phase::Random { seed } => Some(seed),
        Phase::Path => {
            return Err(Error::parameter("phase", "path is for scenes; use zero or random with a picture"));
        }
    };
    let settings = SliceSettings { occlude: !args.see_through, random_phase: seed, memory: args.hologram.memory };
    let lights: Vec<(f64, LightColor)> = match &setup.lasers {
        None => vec![(setup.wavelength, LightColor::Channel(args.channel.channel))],
        Some(lasers) => (0..3).map(|i| (lasers.wavelengths()[i], LightColor::Laser(lasers, i))).collect(),
    };
    let colored = lights.len() > 1;
    for (i, (wavelength, light)) in lights.into_iter().enumerate() {
        let begin = Instant::now();
        let (field, lit) = layers::of_slices(&slices, light, &setup.grid, wavelength, &settings, progress)?;
        let mut own = Report::new("compute");
        let part = if colored { &mut own } else { &mut *report };
        let depths = slices.depths();
        let spent = begin.elapsed().as_secs_f64();
        part.section(json!({
            "method": "layers", "layers": depths.len(), "samples": lit, "wavelength": wavelength, "field_seconds": spent,
        }));
        let (first, last) = (depths[0], depths[depths.len() - 1]);
        let planes = if depths.len() == 1 { "1 plane".into() } else { format!("{} planes", depths.len()) };
        let (near, far) = (show_length(first), show_length(last));
        let grid = (slices.lattice.width, slices.lattice.height);
        let what = format!("layers: {planes}, z {near} … {far}, {lit} lit samples of {}×{}", grid.0, grid.1);
        part.line(step("field", spent, what));
        let path = if colored { named(&args.output, &format!("-{}", NAMES[i])) } else { args.output.clone() };
        let content = Content { z: 0.0, depth: Some([first, last]), eye: None, window: None };
        let origin = format!("{} layers of {}", depths.len(), args.input.display());
        stored::write_field(&path, &field, &content, &origin)?;
        part.output("field", &path);
        if colored {
            report.add_part(NAMES[i], format!("{:<12} {}", NAMES[i], show_length(wavelength)), own);
        }
    }
    Ok(())
}
