//! A glTF scene on a simulated panel for an eye before it, and how like the scene what it sees is.
//!
//! `cargo run --release --example scene_to_picture -- scenes/cornell.gltf out`

use holodrive::Result;
use holodrive::encode::{Encoding, ViewEncoding};
use holodrive::panel::{PanelProfile, Setup};
use holodrive::pipeline::{self, Settings};
use holodrive::points::WhitePoint;
use holodrive::progress::Progress;
use std::path::PathBuf;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let scene = arguments.next().unwrap_or_else(|| "scenes/cornell.gltf".into());
    let folder = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("holodrive-example"));

    let setup = Setup::new(PanelProfile::phase(960, 540, 8e-6, 8, 632.8e-9)?, None)?;
    let mut settings = Settings::default();
    (settings.scene.trace.width, settings.scene.trace.height) = (120, 120);
    // The lamp burns out, as in a photograph.
    settings.scene.white = WhitePoint::Auto;
    settings.encode.encoding = Some(Encoding::View(ViewEncoding { iterations: Some(40), ..ViewEncoding::default() }));
    let out = pipeline::run(&scene, &setup, &settings, &Progress::new())?;

    holodrive::files::output_folder(&folder)?;
    out.seen.write(&folder)?;
    for (name, z) in &out.points.view.focus {
        println!("{name}: in focus at z = {:.1} mm", 1e3 * z);
    }
    let seen = &out.seen.figures.all;
    println!("PSNR {:.1} dB, SSIM {:.3}; pictures in {}", seen.psnr, seen.ssim, folder.display());
    assert!(seen.psnr > 25.0, "{seen:?}");
    Ok(())
}
