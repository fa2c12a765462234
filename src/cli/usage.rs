//! Which flags an input has a use for; what else was typed is told.

use super::args::{self, Command, Group, ShowArgs, unused};
use super::load::{Input, input};
use super::sequence::{self, Sequence};
use super::shown::usual;
use crate::encode::Encoding;
use crate::panel::{PanelProfile, Setup};
use clap::ArgMatches;
use std::path::Path;

/// What an input is, and the groups of flags that its way to light goes through.
type Use = (&'static str, Vec<Group>);

fn of(path: &Path) -> Option<Use> {
    use Group::{Channel, DepthMap, Encoding, Field, Hologram, Picture, Placement, Random, Scene, Simulation, Viewer};
    // What cannot be read is refused by its command.
    Some(match input(path).ok()? {
        Input::Scene(_) => ("a scene", vec![Scene, Placement, Hologram, Channel, Encoding, Viewer]),
        Input::Points(_) => ("a point cloud", vec![Random, Placement, Hologram, Channel, Encoding, Viewer]),
        Input::Images(..) => {
            ("a picture with depth", vec![Random, Placement, DepthMap, Hologram, Channel, Encoding, Picture, Viewer])
        }
        Input::Views(_) => ("a light field", vec![Random, Channel, Encoding, Viewer]),
        Input::Stack(_) => ("a focal stack", vec![Random, Placement, Hologram, Channel, Encoding]),
        Input::Field(_) => ("a field", vec![Encoding, Field]),
        Input::Frame(_) => ("a picture", vec![Picture, Simulation, Field]),
    })
}

fn of_show(args: &ShowArgs) -> Option<Use> {
    let asked = if args.live { None } else { sequence::asked(args).ok()? };
    if let Some(Sequence::Prepared(_)) = asked {
        return Some(("frames in time", vec![Group::Sequence]));
    }
    let (what, mut groups) = of(&args.input)?;
    if matches!(input(&args.input), Ok(Input::Field(_) | Input::Frame(_))) {
        groups.push(Group::Focus);
    }
    if args.live || asked.is_some() {
        groups.push(Group::Sequence);
        // Frames in time are made for an eye where that was typed only.
        let eyeless =
            if matches!(args.encoding.encoding, Some(Encoding::View(_))) { Group::Hologram } else { Group::Viewer };
        groups.retain(|group| *group != eyeless);
    } else if is_for_an_eye(args) == Some(true) {
        groups.retain(|group| *group != Group::Hologram);
        return Some(("frames that are made for an eye (view)", groups));
    }
    Some((what, groups))
}

/// Whether the frames are made for an eye, of views instead of a field; none for a panel that its command will refuse.
fn is_for_an_eye(args: &ShowArgs) -> Option<bool> {
    let usual = || {
        let setup = Setup::new(PanelProfile::find(&args.panel.panel).ok()?, args.panel.wavelength).ok()?;
        Some(usual(args, &input(&args.input).ok()?, &setup))
    };
    Some(matches!(args.encoding.encoding.clone().or_else(usual)?, Encoding::View(_)))
}

/// Where a command with an input keeps what is told of it, and what the input uses.
fn used(command: &mut Command) -> Option<(&mut Option<String>, Use)> {
    Some(match command {
        Command::Points(args) => {
            let (what, mut groups) = of(&args.scene)?;
            groups.extend(args.depth_map.as_ref().map(|_| Group::DepthMap));
            (&mut args.idle, (what, groups))
        }
        Command::Compute(args) => (&mut args.idle, of(&args.input)?),
        Command::Views(args) => (&mut args.idle, of(&args.input)?),
        Command::Encode(args) => {
            let (what, mut groups) = of(&args.input)?;
            groups.push(Group::Encoding);
            (&mut args.idle, (what, groups))
        }
        Command::Reconstruct(args) => (&mut args.idle, of(&args.input)?),
        Command::Show(args) => {
            let found = of_show(args)?;
            (&mut args.idle, found)
        }
        _ => return None,
    })
}

/// Tells a command with an input which typed flags are of no use for it.
pub(super) fn tell(command: &mut Command, typed: &ArgMatches) {
    if let (Some((name, typed)), Some((idle, (input, groups)))) = (typed.subcommand(), used(command)) {
        *idle = args::command(&[]).find_subcommand(name).and_then(|own| unused(own, typed, &groups, input));
    }
}
