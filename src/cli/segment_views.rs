//! `compute --views`: the field of a scene that each segment of the panel sees from its own place.

use super::args::{ComputeArgs, PlacementArg, PlacementArgs};
use super::load::Input;
use super::print::{Lighting, scene_options};
use super::report::{Report, count, seconds};
use crate::field::{npy, stored};
use crate::panel::Setup;
use crate::progress::Progress;
use crate::segments::{Object, ObjectWave, Segments, Viewing};
use crate::{Error, Result};

pub(super) fn compute(
    args: &ComputeArgs,
    source: &Input,
    segment: u64,
    panel: &Setup,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let refused = |what: &str| Err(Error::parameter("views", what));
    let Input::Scene(path) = source else { return refused("are of a scene (.gltf, .glb)") };
    if args.placement.kind() != PlacementArg::Model {
        return refused("are of a model that stands before or behind the panel: add --placement model");
    }
    if panel.lasers.is_some() {
        return refused("are computed in one wavelength at a time; leave --wavelengths out");
    }
    let PlacementArgs { viewer, scale, .. } = args.placement;
    let distance = args.placement.distance();
    let plane = Segments {
        view: Viewing { viewer, place: distance, scale, ..Viewing::default() },
        error: args.hologram.error,
        seed: args.light.random.seed,
        ..Segments::of_panel(panel.grid, panel.wavelength, segment)?
    };
    let light = &args.light;
    let typed = Lighting { bounces: light.bounces, photons: light.photons, quality: &light.quality };
    let options = scene_options(&light.file, typed, args.light.white)?;
    let object = Object::read(path, &options, &plane, progress)?;
    let depths = object.depths();
    let seen = ObjectWave::new(plane, object).whole(progress)?;
    let work = &seen.work;
    report.warn(work.warning());
    report.add_serialised(
        "views",
        work,
        format!(
            "views        {} segments of {segment} px, {} points each, {:.2e} points times pixels; rays {}, field {}",
            count(work.segments as usize),
            count((work.points / work.segments.max(1)) as usize),
            work.pairs,
            seconds(work.points_seconds),
            seconds(work.field_seconds)
        ),
    );
    let content = npy::Content { depth: Some(depths), eye: Some([0.0, 0.0, viewer]), ..npy::Content::default() };
    let origin = format!("true views of {}", args.input.display());
    stored::write_field(&args.output, &seen.field, &content, &origin)?;
    report.output("field", &args.output);
    Ok(())
}
