//! `show` in sub-frames: several frames for one picture, faster than the eye.

use super::args::ShowArgs;
use super::commands::{content, origin, report_field, write_view};
use super::encoding::encode_field;
use super::load::{Panel, Points, hologram_settings};
use super::report::Report;
use holodrive::field::npy;
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Frame, Origin};
use holodrive::pipeline;
use holodrive::points::{Multiplexing, SubFrames};
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Picture, Scale, View};
use holodrive::{Error, Result};

/// Most sub-frames: a DMD shows thousands a second, an eye ten pictures.
const MOST: usize = 256;

/// Refuses a number of sub-frames that cannot be, or that the panel's signal cannot carry to a monitor.
pub(super) fn check(args: &ShowArgs, panel: &Panel) -> Result<()> {
    if !(1..=MOST).contains(&args.subframes) {
        return Err(Error::parameter("subframes", format!("{} must be 1 … {MOST}", args.subframes)));
    }
    let packing = panel.profile.signal.packing;
    if args.monitor.is_some() && packing.frames() < args.subframes {
        let what = format!(
            "{}: panel {} shows {} in a video frame ({}); make the frames without --monitor",
            args.subframes,
            panel.profile.name,
            packing.frames(),
            packing.name()
        );
        return Err(Error::parameter("subframes", what));
    }
    Ok(())
}

/// Fields and frames, each written as it is made.
pub(super) fn frames(
    args: &ShowArgs,
    panel: &Panel,
    points: &Points,
    progress: &Progress,
    report: &mut Report,
) -> Result<Vec<Frame>> {
    let settings = hologram_settings(&args.hologram);
    let multiplexing = if args.sparse { Multiplexing::Sparse } else { Multiplexing::Phases };
    let subframes = SubFrames { count: args.subframes, multiplexing, seed: args.light.seed };
    if multiplexing == Multiplexing::Sparse && points.cloud.points.len() < args.subframes {
        let what = format!("{} for {} points; one a frame at least", args.subframes, points.cloud.points.len());
        return Err(Error::parameter("subframes", what));
    }
    let content = content(&points.cloud, &points.metadata);
    let mut frames = Vec::new();
    for index in 0..args.subframes {
        let share = subframes.points(&points.cloud, args.hologram.channel, index);
        let computed = pipeline::field_of(&share, &panel.grid, panel.wavelength, &settings, progress)?;
        let mut part = Report::new("show");
        report_field(&computed, &mut part);
        let origin = Origin {
            source: Some(origin(&args.input, &points.cloud)),
            depth: content.depth,
            notes: vec![format!("sub-frame {} of {}", index + 1, args.subframes)],
            ..Origin::default()
        };
        let frame = encode_field(&computed.field, &args.encoding, panel, &origin, progress, &mut part)?;
        frame.write(&args.output.join(format!("frame-{index:03}.png")))?;
        let heading = format!("sub-frame {} of {}", index + 1, args.subframes);
        report.add_part(&format!("subframe_{index}"), heading, part);
        frames.push(frame);
    }
    Ok(frames)
}

/// The mean of the sub-frames' light on the planes of the content, and its speckle where only one is shown.
pub(super) fn look(
    frames: &[Frame],
    args: &ShowArgs,
    content: &npy::Content,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let planes = reconstruction::planes_of(content.depth);
    let mut seen: Vec<Vec<Picture>> = planes.iter().map(|_| Vec::new()).collect();
    let mut view = None;
    for frame in frames {
        let (field, mut settings) = pipeline::simulated_light(frame, &Simulation::default(), progress)?;
        settings.block_zero_order(args.zero_order_stop, field.wavelength);
        for ((_, z), seen) in planes.iter().zip(&mut seen) {
            let at = View::Plane { z: *z };
            let half = at.seen_half(&field.grid, content.eye);
            let (grid, values) = reconstruction::intensity(&field, &at, half, &settings, progress)?;
            seen.push(Picture { width: grid.width, height: grid.height, values });
            view = Some((at, half));
        }
    }
    let Some((_, half)) = view else { return Ok(()) };
    for ((name, z), seen) in planes.iter().zip(&seen) {
        if let Some(mean) = Picture::mean(seen) {
            let path = args.output.join(format!("reconstruction-{name}.png"));
            write_view(&path, &mean, Scale::Percentile(0.995), &View::Plane { z: *z }, half)?;
        }
    }
    let line = format!("simulated pictures: the mean of {} sub-frames", frames.len());
    report.add("subframes", frames.len(), line);
    Ok(())
}
