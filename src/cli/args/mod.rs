//! Flags as they are typed. These files import only one another: what a command does with its flags is not known here.

mod bench;
mod calibrate;
mod encoding;
mod field;
mod groups;
mod hologram;
mod manual;
mod monitors;
mod panel;
mod panels;
mod parse;
mod placement;
mod print;
mod scene;
mod sequence;
mod serve;
mod show;
mod steps;
mod viewer;
mod views;

pub(crate) use bench::{BenchCommand, BenchViewsArgs, EncodingsArgs, IterationsArgs};
pub(crate) use calibrate::{
    CalibrateCommand, CalibratePlateArgs, CameraArgs, CheckArgs, CurveArgs, FlatnessArgs, ShownArgs,
};
pub(crate) use encoding::EncodingArgs;
pub(crate) use field::FieldArgs;
pub(crate) use groups::{Group, unused};
pub(crate) use hologram::HologramArgs;
pub(crate) use manual::ManualArgs;
pub(crate) use monitors::{DoctorArgs, MonitorsArgs};
pub(crate) use panel::{ColorArgs, PanelArgs};
pub(crate) use panels::{PanelsArgs, PlatesArgs};
#[cfg(feature = "display")]
pub(crate) use parse::Ahead;
#[cfg(feature = "display")]
pub(crate) use parse::position;
pub(crate) use parse::{LampAsked, Wavelengths, White};
pub(crate) use placement::{DepthMapArgs, PlacementArg, PlacementArgs};
pub(crate) use print::{ExportArgs, LookArgs, PreviewArgs, PrintArgs, PrintCommand, SheetArgs, VerifyArgs};
pub(crate) use scene::{FileArgs, QualityArgs, SceneArgs};
pub(crate) use serve::{ServeArgs, ServedLevelsArg};
pub(crate) use show::{DEFAULT_OUTPUT, ShowArgs};
pub(crate) use steps::{ComputeArgs, EncodeArgs, PointsArgs, PropagateArgs, ReconstructArgs};
pub(crate) use viewer::ViewerArgs;
pub(crate) use views::ViewsArgs;

use crate::scene::gltf::embedded_names;
use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;

const EXIT_CODES: &str = "\
Exit codes: 0 done; 2 wrong flags, bad input, or a file or display that refused (one line says what, where and what to do; \
nothing is written under a final name); 130 interrupted.";

/// From a glTF room to light on a panel: holograms for spatial light modulators.
#[derive(Debug, Parser)]
#[command(name = "holodrive", version, after_help = EXIT_CODES, max_term_width = 120)]
pub(crate) struct Cli {
    /// Print the report as JSON on standard output, for machines.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Which way depths count; beneath the long help of each command that takes one.
const DEPTHS: &str = "\
Depths are z from the panel, negative behind it and positive in front of it:
  eye 600mm  <--- +z ---  panel 0mm  --- -z --->  scene -100mm to -150mm";

/// The whole grammar. For one release the old `--method` is a hidden name of `compute`'s `--engine`, as it is of
/// `--encoding` elsewhere.
pub(crate) fn command(arguments: &[OsString]) -> clap::Command {
    // clap lists the names of closed sets in both helps, or in none.
    let short = arguments.iter().any(|typed| typed == "-h");
    Cli::command().mut_subcommands(|command| match command.get_name() {
        "compute" => dressed(command, short).mut_arg("engine", |engine| engine.alias("method")),
        // What it makes for an eye needs no field.
        "show" => ["engine", "error", "hold"]
            .into_iter()
            .fold(dressed(command, short), |command, flag| command.mut_arg(flag, |flag| flag.hide_short_help(true))),
        _ => dressed(command, short),
    })
}

/// The scenes that need no file; beneath the long help of each command that lights one.
fn scenes() -> String {
    let names: Vec<_> = embedded_names().collect();
    format!("Built-in scenes, by name where no file is called so: {}.", names.join(", "))
}

fn dressed(command: clap::Command, short: bool) -> clap::Command {
    let depths = ["near", "distance", "depths", "focus"];
    let deep = command.get_arguments().any(|flag| depths.contains(&flag.get_id().as_str()));
    let command = command.mut_args(|flag| match flag.get_action().takes_values() {
        true => flag.hide_possible_values(short),
        false => flag,
    });
    let lit = command.get_arguments().any(|flag| flag.get_id() == "environment");
    let command = match command.get_after_long_help().map(ToString::to_string) {
        Some(examples) => {
            let depths = if deep { format!("{DEPTHS}\n\n") } else { String::new() };
            let scenes = if lit { format!("{}\n\n", scenes()) } else { String::new() };
            command.after_long_help(format!("{depths}{scenes}{examples}"))
        }
        None => command,
    };
    command.mut_subcommands(|command| dressed(command, short))
}

/// The steps, one by one, and `show`, which does them all.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Light a scene and trace it into point sources.
    #[command(
        after_long_help = "Examples:\n  holodrive points cornell -o points.ply\n  holodrive points room.glb -o world.ply --frame world --picture traced.npy --rays 800x600\n  holodrive points room.glb --points 100000 -o points.ply"
    )]
    Points(PointsArgs),
    /// Make a light field: what an eye anywhere in an eye box sees of a scene, point cloud, or picture with depth.
    ///
    /// Pinhole views at most 0.5 mm apart over the box and the pupil. `show` and `encode --encoding view` take it.
    #[command(
        after_long_help = "Examples:\n  holodrive views cornell -o cornell.npz\n  holodrive views room.glb --eye-box 10mm -o room.npz\n  holodrive views room.glb --sequence 1280 --eye-box 300mm -o sequence\n  holodrive views points.ply -o views/"
    )]
    Views(ViewsArgs),
    /// Compute the field of a scene, point cloud, or picture with depth on the panel.
    #[command(
        after_long_help = "Examples:\n  holodrive compute points.ply -o field.npy\n  holodrive compute rgb.png+depth.png --panel holoeye-pluto-2.1 --wavelength 532nm -o field.npy\n  holodrive compute rgb.png+depth.png --layers 16 -o field.npy\n  holodrive compute near.png@-100mm+far.png@-150mm -o field.npy\n  holodrive compute points.ply --wavelengths 638nm,520nm,450nm -o field.npy"
    )]
    Compute(ComputeArgs),
    /// Carry a field from its plane to another.
    #[command(
        after_long_help = "Example:\n  holodrive propagate field.npy --pitch 8um --wavelength 532nm --distance 0.5m -o out.npy"
    )]
    Propagate(PropagateArgs),
    /// Encode a field, or a picture at depths, as a frame of drive levels for a panel.
    #[command(
        after_long_help = "Examples:\n  holodrive encode field.npy --encoding double-phase -o frame.png\n  holodrive encode field.npy --encoding double-phase --blaze 0.6deg --lens 300mm -o frame.png\n  holodrive encode picture.png --encoding weighted --depths -100mm -o frame.png\n  holodrive encode rgb.png+depth.png --encoding plane-gradient --depths -100mm,-120mm,-150mm -o frame.png\n  holodrive encode cornell.npz --encoding view -o frame.png\n  holodrive encode picture.png --panel lab.toml --in-the-loop lab-camera.json --camera-command './take {frame} {photo}' -o corrected.png"
    )]
    Encode(EncodeArgs),
    /// Reconstruct what is seen of a frame or a field: on a plane, or through an eye.
    #[command(
        after_long_help = "Examples:\n  holodrive reconstruct frame.png --distance -120mm -o near.png\n  holodrive reconstruct field.npy --eye 0mm,0mm,600mm --focus -150mm --pupil 4mm -o eye.png\n  holodrive reconstruct field.npy --eye 0mm,0mm,600mm --focus -150mm --views 5x1 --eye-box 20mm -o eye.png"
    )]
    Reconstruct(ReconstructArgs),
    /// The whole way, to pictures on the simulated panel or light on a real one.
    ///
    /// It begins with what the input is: scene, points, field or frame.
    #[command(
        after_long_help = "Examples:\n  holodrive show cornell\n  holodrive show cornell --eye-box 10mm,2mm --subframes 3\n  holodrive show cornell --wavelengths 638nm,520nm,450nm\n  holodrive show frame.png --monitor HDMI-1\n  holodrive show points.ply --panel holoeye-pluto-2.1 --monitor edid:HE-PLUTO\n  holodrive show frames/ --monitor HDMI-1 --fps 30 --loop\n  holodrive show walk.glb --fps 12\n  holodrive show room.glb --monitor HDMI-1 --live\n  ffmpeg -i levels.mkv -f rawvideo -pix_fmt gray - | holodrive show - --raw 1920x1080 --monitor HDMI-1 --fps 24"
    )]
    Show(Box<ShowArgs>),
    /// Find a panel's curve and wavefront error, or a printer's tone and lines: what to show or print, and what was measured.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate curve -o sweep\n  holodrive calibrate curve --powers sweep/manifest.csv -o mine.toml\n  holodrive calibrate flatness --zernike 0,0,0,0.8 --radius 6mm -o flat.npy --into mine.toml\n  holodrive calibrate check --panel mine.toml -o cards\n  holodrive calibrate plate --plate film-5080dpi -o card"
    )]
    Calibrate {
        /// What to find.
        #[command(subcommand)]
        what: CalibrateCommand,
    },
    /// Compare what this program offers, on the simulated panel.
    #[command(
        after_long_help = "Examples:\n  holodrive bench views --scene cornell\n  holodrive bench encodings\n  holodrive bench encodings --size 96x72 --iterations 20 --json"
    )]
    Bench {
        /// What to compare.
        #[command(subcommand)]
        what: BenchCommand,
    },
    /// Print a hologram: fringes of a plate of any size, tile by tile into a file.
    #[command(
        after_long_help = "Examples:\n  holodrive print cornell --plate chrome-1um --dry-run\n  holodrive print cornell --plate small -o plate\n  holodrive print cornell --plate chrome-0.5um --size 60mm,40mm --dry-run\n  holodrive print cornell --plate mine.toml -o plate --shard auto"
    )]
    Print(PrintArgs),
    /// Keep a panel, and show on it what other programs send.
    ///
    /// Runs until Ctrl-C, or Esc on the panel. The first line says where clients come in (with --json: one line of JSON with
    /// the ports that it got); the report comes at the end.
    #[command(
        after_long_help = "Examples:\n  holodrive serve --panel holoeye-pluto-2.1 --monitor edid:HE-PLUTO\n  holodrive serve --panel generic --monitor none --slmsuite 0 --json --log clients.log\n  holodrive serve --panel mine.toml --monitor HDMI-1 --local --on-client-gone idle --idle flat.png\n  holodrive serve --panel generic --monitor none --local --trigger 5026\n  holodrive serve --write-python holodrive.py"
    )]
    Serve(ServeArgs),
    /// List the built-in panel profiles, and which of their figures nobody has checked.
    #[command(after_long_help = "Examples:\n  holodrive panels\n  holodrive panels --json")]
    Panels(PanelsArgs),
    /// List the built-in plates and their printers, and which of their figures nobody has checked.
    #[command(after_long_help = "Examples:\n  holodrive plates\n  holodrive plates --json")]
    Plates(PlatesArgs),
    /// Write man pages of all commands, and completions for bash, zsh, fish and PowerShell.
    ///
    /// Everything stands below the folder as it does below /usr/share: where that is ~/.local/share, man, bash and fish find it.
    #[command(
        after_long_help = "Examples:\n  holodrive manual ~/.local/share\n  holodrive manual debian/holodrive/usr/share"
    )]
    Manual(ManualArgs),
    /// List the monitors, and which panel profile fits each.
    #[command(after_long_help = "Example:\n  holodrive monitors --panel holoeye-pluto-2.1")]
    Monitors(MonitorsArgs),
    /// Look at everything on this desktop that alters levels on their way to a panel.
    #[command(after_long_help = "Examples:\n  holodrive doctor\n  holodrive doctor --monitor HDMI-1 --card card.png")]
    Doctor(DoctorArgs),
}
