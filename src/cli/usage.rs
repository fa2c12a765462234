//! Which flags an input has a use for; what else was typed is told.

use super::args::{self, Command, Group, ShowArgs, unused};
use super::load::{Input, input};
use super::sequence::{self, Sequence};
use clap::ArgMatches;
use std::path::Path;

/// What an input is, and the groups of flags that its way to light goes through.
type Use = (&'static str, Vec<Group>);

fn of(path: &Path) -> Option<Use> {
    use Group::{DepthMap, Encoding, Hologram, Picture, Placement, Random, Scene, Simulation};
    // What cannot be read is refused by its command.
    Some(match input(path).ok()? {
        Input::Scene(_) => ("a scene", vec![Scene, Placement, Hologram, Encoding]),
        Input::Points(_) => ("a point cloud", vec![Random, Hologram, Encoding]),
        Input::Images(..) => ("a picture with depth", vec![Random, Placement, DepthMap, Hologram, Encoding, Picture]),
        Input::Stack(_) => ("a focal stack", vec![Random, Placement, Hologram, Encoding]),
        Input::Field(_) => ("a field", vec![Encoding]),
        Input::Frame(_) => ("a picture", vec![Picture, Simulation]),
    })
}

fn of_show(args: &ShowArgs) -> Option<Use> {
    let asked = if args.live { None } else { sequence::asked(args).ok()? };
    if let Some(Sequence::Prepared(_)) = asked {
        return Some(("frames in time", vec![Group::Sequence]));
    }
    let (what, mut groups) = of(&args.input)?;
    if args.live || asked.is_some() {
        groups.push(Group::Sequence);
    }
    Some((what, groups))
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
        *idle = args::command().find_subcommand(name).and_then(|own| unused(own, typed, &groups, input));
    }
}
