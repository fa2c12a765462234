//! The targets of the table, on a small panel; and the measure itself.

use super::*;

fn row(panel: usize, name: &'static str, iterations: usize) -> Row {
    let panels = panels(192, 144).expect("panels");
    let picture = ComparedPicture { name: "flat".into(), picture: flat_picture(&panels[0].setup.profile) };
    compare(
        &picture,
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
        // Five iterations may stand anywhere; what does not iterate is only spoilt by a worse panel. But for frames of one bit, whose
        // noise is where pixels differ from their neighbours: crosstalk takes of it what the short range costs, and 0.9 dB more.
        let binary = name.starts_with("binary");
        assert!(!binary || (short.psnr - ideal.psnr).abs() < 1.5, "{name}: {} {}", ideal.psnr, short.psnr);
        assert!(iterative || binary || short.psnr < ideal.psnr + 0.5, "{name}: {} {}", ideal.psnr, short.psnr);
    }
}

#[test]
fn three_planes_pass_their_targets_on_an_eight_bit_panel() {
    let panels = panels(192, 144).expect("panels");
    let flat = flat_picture(&panels[1].setup.profile);
    // Thirds of the picture from left to right, on three planes.
    let z: Vec<f64> = (0..flat.light.len()).map(|i| -((3 * (i % flat.width) / flat.width) as f64)).collect();
    let (near, far) = (-7.5e-3, -15e-3);
    let plane = z.iter().map(|z| (-z) as usize).collect();
    let picture = DepthPicture { plane, depths: vec![near, 0.5 * (near + far), far], ..flat };
    let picture = ComparedPicture { name: "thirds".into(), picture };
    for name in ["plane-gradient", "weighted"] {
        let effort = Effort { iterations: 300, start: PlaneStart::Random { seed: 1 } };
        let found = compare(&picture, &panels[1], name, effort, &Progress::new()).expect(name);
        println!("{name}: {:.1?} dB, efficiency {:.3}", found.psnr_planes, found.efficiency);
        assert!(found.psnr_planes.len() == 3 && found.psnr_planes.iter().all(|p| *p > 30.0), "{found:?}");
    }
}

#[test]
fn tables_have_a_line_for_each_encoding_and_a_column_for_each_panel() {
    let row = |panel, encoding, psnr_planes: Vec<f64>| Row {
        picture: "room".into(),
        panel,
        encoding,
        psnr: 30.04,
        psnr_planes,
        ssim: 0.876,
        efficiency: 0.1234,
        speckle: 0.055,
        seconds: 1.5,
    };
    let rows = [
        row("ideal", "lee", vec![31.0, 29.0]),
        row("8 bit", "lee", vec![31.0, 28.0]),
        row("ideal", "kinoform", vec![1.0, 2.0]),
    ];
    let table = markdown(&rows);
    let lines: Vec<&str> = table.lines().filter(|line| line.starts_with('|')).collect();
    assert_eq!(lines[0], "| encoding | ideal | 8 bit | seconds |");
    assert_eq!(lines[2], "| lee | 30.0 (29.0), 0.88, 12.3, 0.06 | 30.0 (28.0), 0.88, 12.3, 0.06 | 1.50 |");
    assert_eq!(lines[3], "| kinoform | 30.0 (1.0), 0.88, 12.3, 0.06 | | 1.50 |");
}
