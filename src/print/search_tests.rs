//! Searched plates: a clearer eye box than by other ways, and what tiles cost along their seams.

use super::geometry::fringe_area;
use super::tests::{cloud, fringes, plate, whole};
use super::*;
use crate::encode::fringe::order_statistic;
use crate::field::Complex64;
use crate::progress::Progress;
use crate::segments::Object;
use std::f64::consts::TAU;
use std::path::Path;

/// Side of the plates, and of their tiles: half of the smallest built-in plate's [px].
const SIDE: usize = 512;
const TILE: usize = 128;

fn plate_of(binarisation: &str, tile: u64) -> Plate {
    let lines = format!("bits = 1\nbinarisation = \"{binarisation}\"\ntile = {tile}");
    plate(&format!("[{SIDE}, {SIDE}]"), &lines, "angle = [\"9deg\", \"0deg\"]")
}

/// What of an error reaches the eye box, in f64: (q − g·t)·r·conj(w), g the gain of least squares, averaged by a separable
/// triangle as wide as the box resolves. Shares no code with the search.
fn noise_in_box(plate: &Plate, bits: &[f64], wishes: &[f64]) -> (Vec<f64>, f64) {
    let grid = plate.raster.grid();
    let [fx, _] = plate.reference.frequency_at([0.0; 2], plate.wavelength);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let seen = |values: &[f64]| -> Vec<Complex64> {
        let middle = mean(values);
        let lit = |i: usize| {
            let (x, y) = (grid.x(i % SIDE), grid.y(i / SIDE));
            let turns = fx * x + (x * x + y * y + plate.view.viewer.powi(2)).sqrt() / plate.wavelength;
            (values[i] - middle) * Complex64::cis(TAU * turns.fract())
        };
        let flat: Vec<Complex64> = (0..SIDE * SIDE).map(lit).collect();
        let pass = |field: &[Complex64], step: usize| -> Vec<Complex64> {
            let at = |i: usize, k: i64| {
                let along = if step == 1 { i % SIDE } else { i / SIDE } as i64 + k;
                if (0..SIDE as i64).contains(&along) {
                    field[(i as i64 + k * step as i64) as usize]
                } else {
                    Complex64::default()
                }
            };
            (0..SIDE * SIDE).map(|i| (-12..=12i64).map(|k| at(i, k) * (13.0 - k.abs() as f64) / 169.0).sum()).collect()
        };
        pass(&pass(&flat, 1), SIDE)
    };
    let (q, t) = (seen(bits), seen(wishes));
    let gain =
        q.iter().zip(&t).map(|(q, t)| q * t.conj()).sum::<Complex64>() / t.iter().map(|t| t.norm_sqr()).sum::<f64>();
    let signal = gain.norm_sqr() * t.iter().map(|t| t.norm_sqr()).sum::<f64>() / t.len() as f64;
    (q.iter().zip(&t).map(|(q, t)| (q - gain * t).norm_sqr()).collect(), signal)
}

#[test]
fn a_searched_eye_box_has_little_noise_and_not_much_more_along_seams() {
    let of = |binarisation: &str, tile: usize, object: usize| {
        let plate = plate_of(binarisation, tile as u64);
        let fringes = fringes(&plate, Object::Points(cloud(16 * (object as u64 + 1)).split_off(16 * object)));
        let area = fringe_area(&plate);
        let pieces = fringes.wave.plane.pieces(&area, &area);
        let (field, _) = fringes.wave.field(&area, &pieces, &Progress::new()).expect("field");
        // As a plan chooses it.
        let mut moduli: Vec<f32> = field.iter().map(|u| u.norm()).collect();
        let rank = (plate.fringe.percentile * (moduli.len() - 1) as f64) as usize;
        let amplitude = order_statistic(&mut moduli, rank);
        let wishes: Vec<f64> = fringes.fringe(&field, &area, amplitude).iter().map(|&t| f64::from(t)).collect();
        let bits: Vec<f64> = whole(&fringes, amplitude).iter().map(|&q| f64::from(q)).collect();
        let (noise, signal) = noise_in_box(&plate, &bits, &wishes);
        (bits, noise, signal)
    };
    let mean = |noise: &[f64], keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<f64> = (0..noise.len()).filter(|&i| keep(i)).map(|i| noise[i]).collect();
        kept.iter().sum::<f64>() / kept.len() as f64
    };
    let near =
        |at: usize, reach: usize| (at % TILE).min(TILE - 1 - at % TILE) < reach && (reach..SIDE - reach).contains(&at);
    let inside = |i: usize| [i % SIDE, i / SIDE].iter().all(|at| (16..SIDE - 16).contains(at));
    let snr = |noise: &[f64], signal: f64| 10.0 * (signal / mean(noise, &inside)).log10();
    // One plate's strips hold some hundred grains of noise, whose mean is known to 8 %: those of several are taken together.
    let (mut seams, mut even) = ([0.0; 2], [0.0; 2]);
    let mut searched = Vec::new();
    for object in 0..3 {
        let (bits, noise, signal) = of("direct-search", TILE, object);
        let (one, alone, _) = of("direct-search", SIDE, object);
        assert!(bits != one, "tiles are searched by themselves");
        for (k, reach) in [8, 16].into_iter().enumerate() {
            let strip = |i: usize| inside(i) && (near(i % SIDE, reach) || near(i / SIDE, reach));
            seams[k] += mean(&noise, &strip);
            even[k] += mean(&alone, &strip);
        }
        searched.push(snr(&noise, signal));
    }
    let ratios = [seams[0] / even[0], seams[1] / even[1]];
    let others = ["threshold", "diffusion"].map(|way| {
        let (_, noise, signal) = of(way, TILE, 0);
        snr(&noise, signal)
    });
    println!("seams {ratios:.3?} of one tile's noise there; searched {searched:.1?} dB, others {others:.1?} dB");
    // Seams are not free: 1.20 in strips of eight pixels beside the edges of tiles and 1.10 in strips of sixteen, where a tile has fewer
    // neighbours to take its noise. A halo makes them worse (1.16 for 1.10 with 16 or 32 pixels of it, in another setting) until it is
    // some four blocks wide: then neighbours find the same, at several times the work.
    assert!(ratios[0] < 1.35 && ratios[1] < 1.2, "noise along seams is {ratios:?} of what one tile has there");
    assert!(others.iter().all(|other| searched[0] > other + 8.0), "{searched:?} against {others:?} dB");
}

#[test]
fn threads_do_not_change_a_search_and_what_it_cannot_serve_is_refused() {
    let made = fringes(&plate_of("direct-search", 128), Object::Points(cloud(16)));
    let bits = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| whole(&made, 12.0))
    });
    assert!(bits[0] == bits[1]);
    let text = "name = \"t\"\nsize = [256, 256]\npitch = \"1um\"\nwavelength = \"633nm\"\nbits = 1\n\
                binarisation = \"direct-search\"\ntile = 128\n[reference]\nangle = [\"9deg\", \"0deg\"]\n\
                [scene]\nviewer = \"60mm\"\ndistance = \"5mm\"\n";
    let read = |text: &str| Plate::parse(text, Path::new("t.toml"));
    let plain = read(text).expect("plate");
    assert!((plain.eye_box.expect("box")[0] - 12e-3).abs() < 1e-12 && plain.fringe.contrast == 3.0);
    for (from, to, expected) in [
        ("bits = 1", "bits = 1\nquantity = \"intensity\"", "bipolar"),
        ("direct-search\"", "diffusion\"\neye_box = 1", "eye_box"),
        ("distance = \"5mm\"", "distance = \"5mm\"\neye_box = [\"0mm\", \"5mm\"]", "scene.eye_box"),
        (
            "distance = \"5mm\"",
            "distance = \"5mm\"\n[slit]\nheight = \"1mm\"\nsuperimposed = true",
            "slit.superimposed",
        ),
        ("distance = \"5mm\"", "distance = \"5mm\"\n[lamp]\ndiameter = \"2m\"\ndistance = \"1m\"", "farther than wide"),
        ("distance = \"5mm\"", "distance = \"5mm\"\n[transfer]\nline_bias = \"0.1um\"", "direct search"),
    ] {
        let refused = read(&text.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(refused.contains(expected) && !refused.contains('\n'), "{to}: {refused}");
    }
    let aside = text.replacen("direct-search", "diffusion", 1) + "eye_box = [\"5mm\", \"5mm\"]\n";
    assert!(read(&aside).expect_err("box").to_string().contains("leave it out"));
}
