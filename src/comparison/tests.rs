//! The targets of the table, on a small panel; and the measure itself.

use super::*;

fn row(panel: usize, name: &'static str, iterations: usize) -> Row {
    let panels = panels(192, 144).expect("panels");
    let picture = flat_picture(&panels[0].profile);
    compare(("flat", &picture), &panels[panel], name, Effort { iterations }, &Progress::new()).expect(name)
}

#[test]
fn a_flat_picture_passes_its_targets_on_an_eight_bit_panel() {
    for (name, least) in [("plane-gradient", 35.0), ("weighted", 35.0), ("double-phase", 25.0)] {
        let found = row(1, name, 300);
        println!("{name}: {:.1} dB, SSIM {:.3}, efficiency {:.3}", found.psnr, found.ssim, found.efficiency);
        assert!(found.psnr > least, "{found:?}");
        assert!(found.ssim > 0.8 && found.efficiency > 1e-3 && found.efficiency < 1.0, "{found:?}");
    }
}

#[test]
fn every_encoding_makes_a_line_and_worse_panels_are_worse() {
    for name in encodings() {
        let (ideal, short) = (row(0, name, 5), row(2, name, 5));
        assert!(ideal.psnr > 5.0 && ideal.psnr.is_finite() && ideal.efficiency <= 1.0, "{ideal:?}");
        assert!(short.psnr < ideal.psnr + 1.0, "{name}: {} {}", ideal.psnr, short.psnr);
    }
}
