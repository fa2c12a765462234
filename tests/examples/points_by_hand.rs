//! Points of one's own, the field that they make on a panel, and its error against the exact sum.

use holodrive::Result;
use holodrive::field::Grid;
use holodrive::glam::DVec3;
use holodrive::hologram::{self, HologramSettings, Method};
use holodrive::points::PointSource;
use holodrive::progress::Progress;

fn main() -> Result<()> {
    let (panel, wavelength) = (Grid::new(320, 200, 8e-6, 8e-6)?, 532e-9);
    // A helix of light around the axis, 40 to 60 mm behind the panel.
    let points: Vec<PointSource> = (0..500)
        .map(|i| {
            let (turn, along) = (f64::from(i) * 0.1, f64::from(i) / 500.0);
            let position = DVec3::new(5e-4 * turn.cos(), 5e-4 * turn.sin(), -0.04 - 0.02 * along);
            PointSource { position, amplitude: 1.0, phase: turn }
        })
        .collect();
    let field = |settings: &HologramSettings| -> Result<_> {
        let plan = hologram::plan(&points, &panel, wavelength, settings)?;
        hologram::compute(&points, &panel, wavelength, &plan, &Progress::new())
    };
    let fast = field(&HologramSettings::default())?;
    let exact = field(&HologramSettings { method: Some(Method::Oracle), ..HologramSettings::default() })?;
    let pairs = fast.field.samples.iter().zip(&exact.field.samples);
    let off: f64 = pairs.map(|(a, b)| f64::from((a - b).norm_sqr())).sum();
    let error = (off / exact.field.energy()).sqrt();
    println!("{}: error {error:.1e}, stated below {:.1e}", fast.report.reason, fast.report.error_bound);
    assert!(error <= fast.report.error_bound);
    Ok(())
}
