//! `compute --views`: the field of a scene that each segment of the panel sees from its own place.

use super::args::{ComputeArgs, PlacementArg};
use super::load::Input;
use super::print::task;
use super::report::{Report, count, seconds};
use holodrive::field::npy;
use holodrive::hologram::InstructionSet;
use holodrive::panel::Setup;
use holodrive::print::PanelViews;
use holodrive::progress::Progress;
use holodrive::{Error, Result};

pub(super) fn compute(
    args: &ComputeArgs,
    (source, segment): (&Input, u64),
    panel: &Setup,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let refused = |what: &str| Err(Error::parameter("views", what));
    let Input::Scene(path) = source else { return refused("are of a scene (.gltf, .glb)") };
    if args.placement.placement != PlacementArg::Model {
        return refused("are of a model that stands before or behind the panel: add --placement model");
    }
    if panel.lasers.is_some() {
        return refused("are computed in one wavelength at a time; leave --wavelengths out");
    }
    let views = PanelViews {
        grid: panel.grid,
        wavelength: panel.wavelength,
        viewer: args.placement.viewer,
        place: args.placement.distance,
        scale: args.placement.scale,
        segment,
        error: args.hologram.error,
        seed: args.light.random.seed,
    };
    let light = (&args.light.file, args.light.bounces, args.light.photons);
    let task = task(path, light, args.light.white)?;
    let seen = views.field(&task, InstructionSet::detect(), progress)?;
    let work = &seen.work;
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
    let content =
        npy::Content { depth: Some(seen.depths), eye: Some([0.0, 0.0, views.viewer]), ..npy::Content::default() };
    let origin = format!("true views of {}", args.input.display());
    npy::write_field(&args.output, &seen.field, &content, &origin)?;
    report.output("field", &args.output);
    Ok(())
}
