//! The targets of the table, on a small panel; and the measure itself.

use super::*;

fn row(panel: usize, name: &'static str, iterations: usize) -> Row {
    let panels = panels(192, 144).expect("panels");
    let picture = flat_picture(&panels[0].profile);
    compare(
        ("flat", &picture),
        &panels[panel],
        name,
        Effort { iterations, start: PlaneStart::Random { seed: 1 } },
        &Progress::new(),
    )
    .expect(name)
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
        let iterative = matches!(Encoding::named(name).expect("name"), Encoding::Planes(_) | Encoding::Gradient(_));
        let (ideal, short) = (row(0, name, 5), row(2, name, 5));
        assert!(ideal.psnr > 5.0 && ideal.psnr.is_finite() && ideal.efficiency <= 1.0, "{ideal:?}");
        assert!(short.psnr.is_finite() && short.speckle > 0.0, "{short:?}");
        // Five iterations may stand anywhere; what does not iterate is only spoilt by a worse panel.
        assert!(iterative || short.psnr < ideal.psnr + 0.5, "{name}: {} {}", ideal.psnr, short.psnr);
    }
}

#[test]
fn three_planes_pass_their_targets_on_an_eight_bit_panel() {
    let panels = panels(192, 144).expect("panels");
    let flat = flat_picture(&panels[1].profile);
    // Thirds of the picture from left to right, on three planes.
    let z: Vec<f64> = (0..flat.light.len()).map(|i| -((3 * (i % flat.width) / flat.width) as f64)).collect();
    let (near, far) = (-7.5e-3, -15e-3);
    let plane = z.iter().map(|z| (-z) as usize).collect();
    let picture = DepthPicture { plane, depths: vec![near, 0.5 * (near + far), far], ..flat };
    for name in ["plane-gradient", "weighted"] {
        let effort = Effort { iterations: 300, start: PlaneStart::Random { seed: 1 } };
        let found = compare(("thirds", &picture), &panels[1], name, effort, &Progress::new()).expect(name);
        println!("{name}: {:.1?} dB, efficiency {:.3}", found.psnr_planes, found.efficiency);
        assert!(found.psnr_planes.len() == 3 && found.psnr_planes.iter().all(|p| *p > 30.0), "{found:?}");
    }
}
