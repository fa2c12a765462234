//! Which flags an input has a use for: those of the groups that its way to light goes through.

use super::encoding::EncodingArgs;
use super::hologram::HologramArgs;
use super::panel::ColorArgs;
use super::placement::PlacementArgs;
use super::scene::SceneArgs;
use super::sequence::SequenceArgs;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command};

/// Flags that are of use together: those of one struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    Color,
    Scene,
    Placement,
    Hologram,
    Encoding,
    Sequence,
}

impl Group {
    const ALL: [Self; 6] = [Self::Color, Self::Scene, Self::Placement, Self::Hologram, Self::Encoding, Self::Sequence];

    /// Its flags, as its struct declares them.
    fn flags(self) -> Vec<Arg> {
        let none = Command::new("");
        let all = match self {
            Self::Color => ColorArgs::augment_args(none),
            Self::Scene => SceneArgs::augment_args(none),
            Self::Placement => PlacementArgs::augment_args(none),
            Self::Hologram => HologramArgs::augment_args(none),
            Self::Encoding => EncodingArgs::augment_args(none),
            Self::Sequence => SequenceArgs::augment_args(none),
        };
        all.get_arguments().cloned().collect()
    }
}

/// A warning that names the flags that were typed though they stand in none of the groups that `input` uses.
pub(crate) fn unused(typed: &ArgMatches, used: &[Group], input: &str) -> Option<String> {
    let flags = |groups: &[Group]| groups.iter().flat_map(|group| group.flags()).collect::<Vec<Arg>>();
    let useful = flags(used);
    let idle = |flag: &Arg| {
        let id = flag.get_id();
        // What a command does not have cannot have been typed.
        typed.ids().any(|known| known == id)
            && typed.value_source(id.as_str()) == Some(ValueSource::CommandLine)
            && useful.iter().all(|other| other.get_id() != id)
    };
    let all = flags(&Group::ALL);
    let names: Vec<String> =
        all.iter().filter(|flag| idle(flag)).filter_map(|flag| Some(format!("--{}", flag.get_long()?))).collect();
    (!names.is_empty()).then(|| format!("{}: of no use for {input}; ignored", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_flags_outside_the_groups_in_use_are_named_and_defaults_are_not() {
        let typed = |line: &str| {
            let matches = super::super::command().try_get_matches_from(line.split(' ')).expect("flags");
            matches.subcommand().map(|(_, own)| own.clone()).expect("command")
        };
        let cloud = [Group::Color, Group::Hologram, Group::Encoding];
        let show = typed("holodrive show p.ply --rays 9x9 --bounces 3 --error 1e-2 --loop");
        assert_eq!(
            unused(&show, &cloud, "a point cloud").as_deref(),
            Some("--rays, --bounces, --loop: of no use for a point cloud; ignored")
        );
        assert_eq!(unused(&show, &Group::ALL, "a scene"), None);
        assert_eq!(unused(&typed("holodrive encode f.npy --lens 1m"), &cloud, "a field"), None);
        assert_eq!(unused(&typed("holodrive points room.glb"), &[], "nothing"), None);
    }
}
