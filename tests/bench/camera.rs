//! `calibrate camera` on a hidden bench of 1920 × 1080 pixels: time, errors, and what an eye sees before and after.
//!
//! `cargo bench --bench camera`; the bench's photos take most of its time.

#[path = "../camera/bench.rs"]
mod bench;
#[path = "../camera/eye.rs"]
mod eye;
#[path = "../camera/figures.rs"]
mod figures;

use holodrive::calibration::{CameraBench, calibrate_camera, camera_frames};
use holodrive::panel::PanelProfile;
use holodrive::progress::Progress;
use std::time::Instant;

fn main() {
    let bench = bench::HiddenBench {
        width: 1920,
        height: 1080,
        pitch: 8e-6,
        wavelength: 632.8e-9,
        lens: 0.2,
        camera: [720, 640],
        camera_pitch: 3.45e-6,
        parts: 2,
    };
    let profile = PanelProfile::phase(bench.width, bench.height, bench.pitch, 8, bench.wavelength).expect("profile");
    let begin = Instant::now();
    let series = camera_frames(&profile, bench.wavelength).expect("frames");
    let levels = series.frames().map(|frame| frame.expect("frame").levels);
    let photos: Vec<_> = levels.enumerate().map(|(k, levels)| bench.photo(&levels, k as u64)).collect();
    println!("photos of the bench: {:.0} s", begin.elapsed().as_secs_f64());
    let begin = Instant::now();
    let camera = CameraBench { lens: bench.lens, camera_pitch: bench.camera_pitch };
    let fit = calibrate_camera(&profile, bench.wavelength, &camera, &photos, &Progress::new()).expect("fit");
    println!("calibration: {:.0} s\n{:#?}", begin.elapsed().as_secs_f64(), fit.report);
    let errors = figures::errors(&bench, &profile, &fit);
    println!(
        "off by: wavefront {:.5} waves (tilt {:.2?} rad), curve {:.4} rad, beam {:.4}, mapping {:.4} pixels, crosstalk {:+.4} \
         pixels, unmodulated {:+.5} at {:+.4} rad",
        errors.wavefront,
        errors.tilt,
        errors.curve,
        errors.beam,
        errors.mapping,
        errors.crosstalk,
        errors.unmodulated,
        errors.unmodulated_phase
    );
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("mine.toml");
    fit.write(&profile, &path).expect("written");
    let calibrated = PanelProfile::read(&path).expect("read");
    let [perfect, before, after] = eye::seen(&bench, &profile, &calibrated, errors.tilt, 50);
    println!("seen by an eye: perfect panel {perfect:.2} dB, bench before {before:.2} dB, after {after:.2} dB");
}
