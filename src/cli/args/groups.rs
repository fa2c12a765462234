//! Which flags an input has a use for: those of the groups that its way to light goes through.

use super::encoding::EncodingArgs;
use super::field::FieldArgs;
use super::hologram::{ChannelArgs, HologramArgs};
use super::placement::{DepthMapArgs, PlacementArgs};
use super::scene::{RandomArgs, SceneArgs};
use super::sequence::SequenceArgs;
use super::steps::{PictureArgs, SimulationArgs};
use super::viewer::ViewerArgs;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command, Id};

/// Flags that are of use together: those of one struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    Scene,
    Random,
    Placement,
    DepthMap,
    Hologram,
    Encoding,
    Picture,
    Simulation,
    Sequence,
    Viewer,
    Channel,
    Field,
    /// --focus and --distance, which say where a picture is sharp.
    Focus,
}

impl Group {
    const ALL: [Self; 13] = [
        Self::Scene,
        Self::Random,
        Self::Placement,
        Self::DepthMap,
        Self::Hologram,
        Self::Encoding,
        Self::Picture,
        Self::Simulation,
        Self::Sequence,
        Self::Viewer,
        Self::Channel,
        Self::Field,
        Self::Focus,
    ];

    /// The name that clap knows its struct by, and its flags as the struct declares them.
    fn declared(self) -> (Option<Id>, Vec<Arg>) {
        match self {
            Self::Scene => of::<SceneArgs>(),
            Self::Random => of::<RandomArgs>(),
            Self::Placement => of::<PlacementArgs>(),
            Self::DepthMap => of::<DepthMapArgs>(),
            Self::Hologram => of::<HologramArgs>(),
            Self::Encoding => of::<EncodingArgs>(),
            Self::Picture => of::<PictureArgs>(),
            Self::Simulation => of::<SimulationArgs>(),
            Self::Sequence => of::<SequenceArgs>(),
            Self::Viewer => of::<ViewerArgs>(),
            Self::Channel => of::<ChannelArgs>(),
            Self::Field => of::<FieldArgs>(),
            Self::Focus => (None, ["focus", "distance"].map(|flag| Arg::new(flag).long(flag)).to_vec()),
        }
    }
}

fn of<T: Args>() -> (Option<Id>, Vec<Arg>) {
    (T::group_id(), T::augment_args(Command::new("")).get_arguments().cloned().collect())
}

/// A warning that names the flags that were typed though they stand only in groups that `input` does not use.
pub(crate) fn unused(command: &Command, typed: &ArgMatches, used: &[Group], input: &str) -> Option<String> {
    let has = |group: &Option<Id>| command.get_groups().any(|own| Some(own.get_id()) == group.as_ref());
    let useful: Vec<Arg> = used.iter().flat_map(|group| group.declared().1).collect();
    let all =
        Group::ALL.iter().map(|group| group.declared()).filter(|(group, _)| has(group)).flat_map(|(_, flags)| flags);
    let mut names: Vec<String> = Vec::new();
    for flag in all {
        let idle = typed.value_source(flag.get_id().as_str()) == Some(ValueSource::CommandLine)
            && useful.iter().all(|other| other.get_id() != flag.get_id());
        let name = format!("--{}", flag.get_long().unwrap_or_default());
        if idle && !names.contains(&name) {
            names.push(name);
        }
    }
    (!names.is_empty()).then(|| format!("{}: of no use for {input}; ignored", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_flags_outside_the_groups_in_use_are_named_and_defaults_are_not() {
        let said = |line: &str, used: &[Group], input: &str| {
            let mut all = super::super::command(&[]);
            let typed = all.try_get_matches_from_mut(line.split(' ')).expect("flags");
            let (name, typed) = typed.subcommand().expect("command");
            unused(all.find_subcommand(name).expect("command"), typed, used, input)
        };
        let cloud = [Group::Random, Group::Hologram, Group::Encoding, Group::Field];
        let line = "holodrive show p.ply --rays 9x9 --bounces 3 --error 1e-2 --seed 2 --loop --zero-order-stop 1deg";
        let told = "--rays, --bounces, --loop: of no use for a point cloud; ignored";
        assert_eq!(said(line, &cloud, "a point cloud").as_deref(), Some(told));
        assert_eq!(said(line, &Group::ALL, "a scene"), None);
        assert_eq!(said("holodrive encode f.npy --lens 1m", &cloud, "a field"), None);
        // --distance and --focus are other flags here than those of a placement and of frames in time.
        assert_eq!(said("holodrive reconstruct f.npy --distance -1m", &[], "a field"), None);
        let stop = said("holodrive reconstruct f.npy --distance -1m --subpixels 2", &[], "a field");
        assert_eq!(stop.as_deref(), Some("--subpixels: of no use for a field; ignored"));
        assert_eq!(said("holodrive points room.glb", &[], "nothing"), None);
    }
}
