//! One loop for one laser, three lasers and sub-frames: their lists of exposures are all that differs.

use holodrive::Result;
use holodrive::glam::DVec3;
use holodrive::panel::{Origin, PanelProfile, Setup};
use holodrive::pipeline::{self, Settings};
use holodrive::points::{Multiplexing, PointCloud, PointSource, SubFrames};
use holodrive::progress::Progress;

fn main() -> Result<()> {
    let at = |i: i32| DVec3::new(1e-4 * f64::from(i % 20 - 10), 1e-4 * f64::from(i / 20 - 10), -0.06);
    let points = (0..400).map(|i| PointSource { position: at(i), amplitude: 1.0, phase: f64::from(i * i) });
    let rgb = (0..400).map(|i| [1.0, 0.2 + 0.002 * i as f32, 0.5]).collect();
    let cloud = PointCloud { points: points.collect(), rgb: Some(rgb) };

    let one = Setup::new(PanelProfile::phase(400, 300, 8e-6, 8, 532e-9)?, None)?;
    let three = one.clone().in_color(Some([638e-9, 520e-9, 450e-9]))?;
    let many = Some(SubFrames::new(4, Multiplexing::Phases, 1)?);
    for (setup, sub_frames) in [(&one, None), (&three, None), (&one, many)] {
        let settings = Settings { sub_frames, ..Settings::default() };
        for exposure in pipeline::exposures(setup, &settings, None) {
            let progress = Progress::new();
            let computed = pipeline::field(&cloud, &exposure, setup, &settings.hologram, &progress)?;
            let Some(computed) = computed else { continue };
            let encoded = pipeline::frame(&computed.field, setup, &settings.encode, Origin::default(), &progress)?;
            println!("{:<22} {:.1} nm: {}", exposure.label(), 1e9 * exposure.wavelength, encoded.report.method);
        }
    }
    Ok(())
}
