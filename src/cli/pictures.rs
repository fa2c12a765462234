//! What is said of the pictures of a hologram.

use super::report::{Report, count, seconds};
use crate::points::ScenePoints;
use crate::reconstruction::Gallery;
use crate::units::show_length;
use std::time::Instant;

pub(super) fn report_gallery(
    gallery: &Gallery,
    scene: Option<&ScenePoints>,
    frames: usize,
    begin: Instant,
    report: &mut Report,
) {
    for (name, z) in scene.iter().flat_map(|scene| &scene.view.focus) {
        let line = format!("focus on {name}: {} behind the panel", show_length(-z));
        report.add(&format!("focus_{name}"), *z, line);
    }
    if let Some(likeness) = &gallery.likeness {
        let line = format!(
            "simulated reconstruction{}, all in focus from {} planes, against the traced picture: PSNR {:.1} dB, SSIM {:.3}; \
             on 5 × 5 blocks {:.1} dB",
            if gallery.lasers.is_some() { " in colour" } else { "" },
            count(gallery.planes),
            likeness.psnr,
            likeness.ssim,
            likeness.psnr_blocks
        );
        report.add("likeness", likeness, line);
    }
    if gallery.lasers.is_none() && frames > 1 {
        report.add("subframes", frames, format!("simulated pictures: the mean of {frames} sub-frames"));
    }
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("reconstruction_seconds", elapsed, format!("pictures     {:>8}", seconds(elapsed)));
}
