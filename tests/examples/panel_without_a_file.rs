//! A panel that no profile describes, a field encoded for it, and the frame written for its monitor.

use holodrive::Result;
use holodrive::encode::{EncodeOptions, Encoding};
use holodrive::field::{Complex32, Field};
use holodrive::panel::{Origin, PanelProfile, Setup};
use holodrive::pipeline;
use holodrive::progress::Progress;

fn main() -> Result<()> {
    let setup = Setup::new(PanelProfile::phase(640, 400, 6.4e-6, 8, 520e-9)?, None)?;
    // A Gaussian beam that converges 0.2 m in front of the panel.
    let (grid, focal_length) = (setup.grid, 0.2);
    let samples = (0..grid.len())
        .map(|i| {
            let (x, y) = (grid.x(i % grid.width), grid.y(i / grid.width));
            let square = x * x + y * y;
            let phase = -std::f64::consts::PI * square / (setup.wavelength * focal_length);
            Complex32::from_polar((-square / 1e-6f64).exp() as f32, phase.rem_euclid(std::f64::consts::TAU) as f32)
        })
        .collect();
    let field = Field::new(grid, setup.wavelength, samples)?;
    let options = EncodeOptions { encoding: Some(Encoding::Kinoform), ..EncodeOptions::default() };
    let encoded = pipeline::frame(&field, &setup, &options, Origin::default(), &Progress::new())?;
    let path = std::env::temp_dir().join("holodrive-example-frame.png");
    encoded.frame.write(&path)?;
    println!("efficiency {:.1} %, frame in {}", 100.0 * encoded.report.efficiency, path.display());
    Ok(())
}
