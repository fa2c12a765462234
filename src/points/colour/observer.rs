//! The CIE 1931 standard observer (2°): how much of three imaginary primaries an eye sees in light of one wavelength.

/// Shortest wavelength of the table [m].
pub const SHORTEST: f64 = 380e-9;

/// Longest wavelength of the table [m].
pub const LONGEST: f64 = 780e-9;

/// Step of the table [m].
const STEP: f64 = 5e-9;

/// x̄, ȳ and z̄ at a wavelength [m], by Lagrange polynomials through the four nearest entries; `None` outside
/// [`SHORTEST`] … [`LONGEST`].
///
/// The table is CIE 015 (ISO/CIE 11664-1) in steps of 5 nm; the CIE allows this interpolation. Against the 1 nm table it
/// errs by at most 2.4e-3 in z̄ (whose peak is 1.78), and by 3e-4 in chromaticity between 400 and 680 nm.
pub fn tristimulus(wavelength: f64) -> Option<[f64; 3]> {
    // A wavelength typed as 780nm may round to either side of the limit.
    let position = (wavelength - SHORTEST) / STEP;
    if !(-1e-6..=(TABLE.len() - 1) as f64 + 1e-6).contains(&position) {
        return None;
    }
    let first = (position.floor() as usize).saturating_sub(1).min(TABLE.len() - 4);
    let at = position - first as f64;
    let weight =
        |j: usize| (0..4).filter(|&k| k != j).map(|k| (at - k as f64) / (j as f64 - k as f64)).product::<f64>();
    let weights = [0, 1, 2, 3].map(weight);
    // Polynomials may dip below zero where a function ends.
    Some([0, 1, 2].map(|c| weights.iter().zip(&TABLE[first..]).map(|(w, row)| w * row[c]).sum::<f64>().max(0.0)))
}

/// x̄, ȳ, z̄ from 380 nm to 780 nm; the comment is the wavelength [nm].
#[rustfmt::skip]
const TABLE: [[f64; 3]; 81] = [
    [0.001368, 0.000039, 0.00645], // 380
    [0.002236, 0.000064, 0.01055], // 385
    [0.004243, 0.00012, 0.02005], // 390
    [0.00765, 0.000217, 0.03621], // 395
    [0.01431, 0.000396, 0.06785], // 400
    [0.02319, 0.00064, 0.1102], // 405
    [0.04351, 0.00121, 0.2074], // 410
    [0.07763, 0.00218, 0.3713], // 415
    [0.13438, 0.004, 0.6456], // 420
    [0.21477, 0.0073, 1.03905], // 425
    [0.2839, 0.0116, 1.3856], // 430
    [0.3285, 0.01684, 1.62296], // 435
    [0.34828, 0.023, 1.74706], // 440
    [0.34806, 0.0298, 1.7826], // 445
    [0.3362, 0.038, 1.77211], // 450
    [0.3187, 0.048, 1.7441], // 455
    [0.2908, 0.06, 1.6692], // 460
    [0.2511, 0.0739, 1.5281], // 465
    [0.19536, 0.09098, 1.28764], // 470
    [0.1421, 0.1126, 1.0419], // 475
    [0.09564, 0.13902, 0.81295], // 480
    [0.05795, 0.1693, 0.6162], // 485
    [0.03201, 0.20802, 0.46518], // 490
    [0.0147, 0.2586, 0.3533], // 495
    [0.0049, 0.323, 0.272], // 500
    [0.0024, 0.4073, 0.2123], // 505
    [0.0093, 0.503, 0.1582], // 510
    [0.0291, 0.6082, 0.1117], // 515
    [0.06327, 0.71, 0.07825], // 520
    [0.1096, 0.7932, 0.05725], // 525
    [0.1655, 0.862, 0.04216], // 530
    [0.22575, 0.91485, 0.02984], // 535
    [0.2904, 0.954, 0.0203], // 540
    [0.3597, 0.9803, 0.0134], // 545
    [0.43345, 0.99495, 0.00875], // 550
    [0.51205, 1.0, 0.00575], // 555
    [0.5945, 0.995, 0.0039], // 560
    [0.6784, 0.9786, 0.00275], // 565
    [0.7621, 0.952, 0.0021], // 570
    [0.8425, 0.9154, 0.0018], // 575
    [0.9163, 0.87, 0.00165], // 580
    [0.9786, 0.8163, 0.0014], // 585
    [1.0263, 0.757, 0.0011], // 590
    [1.0567, 0.6949, 0.001], // 595
    [1.0622, 0.631, 0.0008], // 600
    [1.0456, 0.5668, 0.0006], // 605
    [1.0026, 0.503, 0.00034], // 610
    [0.9384, 0.4412, 0.00024], // 615
    [0.85445, 0.381, 0.00019], // 620
    [0.7514, 0.321, 0.0001], // 625
    [0.6424, 0.265, 0.000050], // 630
    [0.5419, 0.217, 0.000030], // 635
    [0.4479, 0.175, 0.000020], // 640
    [0.3608, 0.1382, 0.000010], // 645
    [0.2835, 0.107, 0.0], // 650
    [0.2187, 0.0816, 0.0], // 655
    [0.1649, 0.061, 0.0], // 660
    [0.1212, 0.04458, 0.0], // 665
    [0.0874, 0.032, 0.0], // 670
    [0.0636, 0.0232, 0.0], // 675
    [0.04677, 0.017, 0.0], // 680
    [0.0329, 0.01192, 0.0], // 685
    [0.0227, 0.00821, 0.0], // 690
    [0.01584, 0.005723, 0.0], // 695
    [0.011359, 0.004102, 0.0], // 700
    [0.008111, 0.002929, 0.0], // 705
    [0.00579, 0.002091, 0.0], // 710
    [0.004109, 0.001484, 0.0], // 715
    [0.002899, 0.001047, 0.0], // 720
    [0.002049, 0.00074, 0.0], // 725
    [0.00144, 0.00052, 0.0], // 730
    [0.001, 0.000361, 0.0], // 735
    [0.00069, 0.000249, 0.0], // 740
    [0.000476, 0.000172, 0.0], // 745
    [0.000332, 0.00012, 0.0], // 750
    [0.000235, 0.000085, 0.0], // 755
    [0.000166, 0.000060, 0.0], // 760
    [0.000117, 0.000042, 0.0], // 765
    [0.000083, 0.000030, 0.0], // 770
    [0.000059, 0.000021, 0.0], // 775
    [0.000042, 0.000015, 0.0], // 780
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Chromaticity x, y.
    fn chromaticity(wavelength: f64) -> [f64; 2] {
        let [x, y, z] = tristimulus(wavelength).expect("visible");
        [x / (x + y + z), y / (x + y + z)]
    }

    #[test]
    fn sums_and_peaks_are_the_published_ones() {
        // CIE 015, table of the 1931 observer: sums over 380 … 780 nm in 5 nm.
        let sums = [0, 1, 2].map(|c| TABLE.iter().map(|row| row[c]).sum::<f64>());
        for (sum, published) in sums.iter().zip([21.371524, 21.371327, 21.371540]) {
            assert!((sum - published).abs() < 5e-7, "{sums:?}");
        }
        assert_eq!(tristimulus(555e-9).expect("green")[1], 1.0);
        let greatest = |c: usize| TABLE.iter().map(|row| row[c]).fold(0.0, f64::max);
        assert_eq!([0, 1, 2].map(greatest), [1.0622, 1.0, 1.7826]);
    }

    #[test]
    fn the_primaries_of_1931_have_their_chromaticities() {
        // Wright and Guild's 700, 546.1 and 435.8 nm as the CIE published them, to four digits.
        for (wavelength, published) in
            [(700e-9, [0.7347, 0.2653]), (546.1e-9, [0.2738, 0.7174]), (435.8e-9, [0.1666, 0.0089])]
        {
            let found = chromaticity(wavelength);
            let off = (found[0] - published[0]).abs().max((found[1] - published[1]).abs());
            assert!(off < 1.5e-4, "{wavelength}: {found:?}");
        }
    }

    #[test]
    fn the_table_ends_where_it_says() {
        assert!(tristimulus(380e-9).is_some() && tristimulus(780e-9).is_some());
        assert!(tristimulus(379e-9).is_none() && tristimulus(781e-9).is_none() && tristimulus(f64::NAN).is_none());
        // Entries come back exactly; in between nothing is negative.
        for (i, row) in TABLE.iter().enumerate() {
            let found = tristimulus(SHORTEST + i as f64 * STEP).expect("visible");
            assert!(found.iter().zip(row).all(|(a, b)| (a - b).abs() < 1e-9), "{i}: {found:?}");
        }
        assert!(
            (0..4000)
                .all(|i| tristimulus(SHORTEST + f64::from(i) * 1e-10).is_some_and(|t| t.iter().all(|v| *v >= 0.0)))
        );
    }
}
