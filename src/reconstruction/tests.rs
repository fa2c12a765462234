use super::*;
use crate::field::Complex32;
use glam::DVec3;

const WAVELENGTH: f64 = 633e-9;

/// Field of one point by the definition's formula without taper: exact where the cone is not reached.
fn of_point(grid: Grid, point: DVec3) -> Field {
    let mut field = Field::<f32>::zeros(grid, WAVELENGTH);
    for (index, u) in field.samples.iter_mut().enumerate() {
        let d = DVec3::new(grid.x(index % grid.width), grid.y(index / grid.width), 0.0) - point;
        let r = d.length();
        // Behind the panel the wave diverges, in front it converges.
        let turns = if point.z < 0.0 { r / WAVELENGTH } else { -r / WAVELENGTH };
        let phase = std::f64::consts::TAU * (turns - turns.round());
        if d.x.abs().max(d.y.abs()) < 0.03 * r {
            *u = Complex32::new((phase.cos() / r) as f32, (phase.sin() / r) as f32);
        }
    }
    field
}

fn brightest(picture: &Picture) -> (usize, usize) {
    let at =
        (0..picture.values.len()).max_by(|&a, &b| picture.values[a].total_cmp(&picture.values[b])).expect("pixels");
    (at % picture.width, at / picture.width)
}

#[test]
fn a_point_is_seen_where_it_stands_upright_and_unmirrored_on_both_sides() {
    let grid = Grid::new(480, 400, 8e-6, 8e-6).expect("grid");
    let progress = Progress::new();
    for z in [-0.05, 0.04] {
        // Up and to the left.
        let point = DVec3::new(-0.6e-3, 0.4e-3, z);
        let field = of_point(grid, point);
        let half = DVec2::new(1.5e-3, 1.0e-3);
        let sharp =
            picture(&field, &View::Plane { z }, half, (75, 50), &ViewSettings::default(), &progress).expect("picture");
        // Cells are 40 µm: the point is in column (−0.6 + 1.5)/0.04 = 22.5, row (1.0 − 0.4)/0.04 = 15.
        let (column, row) = brightest(&sharp);
        assert!((22..=23).contains(&column) && (14..=15).contains(&row), "z {z}: {column}, {row}");
        // On the wrong side of the panel the light is spread out.
        let wrong = picture(&field, &View::Plane { z: -z }, half, (75, 50), &ViewSettings::default(), &progress)
            .expect("picture");
        let peak = |p: &Picture| p.values.iter().copied().fold(0f32, f32::max) / p.values.iter().sum::<f32>();
        assert!(peak(&sharp) > 0.2, "{}", peak(&sharp));
        assert!(peak(&wrong) < 0.1 * peak(&sharp), "{} {}", peak(&wrong), peak(&sharp));
    }
}

#[test]
fn an_eye_sees_parallax_and_focus() {
    let grid = Grid::new(900, 500, 8e-6, 8e-6).expect("grid");
    let progress = Progress::new();
    let field = of_point(grid, DVec3::new(0.2e-3, -0.1e-3, -0.06));
    let half = DVec2::new(2e-3, 1e-3);
    let look = |x: f64, focus: f64| {
        let view = View::Eye { position: [x, 0.0, 0.1], pupil: 1.2e-3, focus };
        picture(&field, &view, half, (200, 100), &ViewSettings::default(), &progress).expect("picture")
    };
    // Focused at its depth the point stands still when the eye moves; cells are 20 µm, so it is at (110, 55).
    for x in [-0.8e-3, 0.0, 0.8e-3] {
        let (column, row) = brightest(&look(x, -0.06));
        assert!(column.abs_diff(110) <= 1 && row.abs_diff(55) <= 1, "eye at {x}: {column}, {row}");
    }
    // On the panel plane z = 0 the line from the eye to the point passes at x = (0.2·0.1 + x·0.06)/0.16 mm.
    let centroid = |p: &Picture| {
        let sum: f32 = p.values.iter().sum();
        let moment: f32 = p.values.iter().enumerate().map(|(i, v)| (i % p.width) as f32 * v).sum();
        moment / sum
    };
    let moved = centroid(&look(0.8e-3, 0.0)) - centroid(&look(-0.8e-3, 0.0));
    let expected = 1.6e-3 * 0.06 / 0.16 / 20e-6;
    assert!((f64::from(moved) / expected - 1.0).abs() < 0.05, "{moved} cells, {expected} expected");
    let peak = |p: &Picture| p.values.iter().copied().fold(0f32, f32::max) / p.values.iter().sum::<f32>();
    assert!(peak(&look(0.0, -0.06)) > 3.0 * peak(&look(0.0, 0.0)));
}

#[test]
fn all_in_focus_takes_each_pixel_from_its_depth() {
    let grid = Grid::new(300, 300, 8e-6, 8e-6).expect("grid");
    let mut field = of_point(grid, DVec3::new(-0.4e-3, 0.0, -0.03));
    let second = of_point(grid, DVec3::new(0.4e-3, 0.0, -0.06));
    for (u, v) in field.samples.iter_mut().zip(&second.samples) {
        *u += *v;
    }
    let depths: Vec<Option<f64>> = (0..1600).map(|i| Some(if i % 40 < 20 { -0.03 } else { -0.06 })).collect();
    let half_at = |_: f64| DVec2::splat(0.8e-3);
    let (picture, planes) =
        all_in_focus(&field, &depths, (40, 40), half_at, 0.002, &ViewSettings::default(), &Progress::new())
            .expect("stack");
    assert_eq!(planes, 15);
    let row = &picture.values[20 * 40..21 * 40];
    let mean: f32 = picture.values.iter().sum::<f32>() / 1600.0;
    assert!(row[9..=10].iter().any(|v| *v > 20.0 * mean) && row[29..=30].iter().any(|v| *v > 20.0 * mean), "{row:?}");
}

#[test]
fn impossible_views_are_refused() {
    let grid = Grid::new(20, 20, 8e-6, 8e-6).expect("grid");
    let field = Field::<f32>::zeros(grid, WAVELENGTH);
    let look = |view: View, half: DVec2| {
        picture(&field, &view, half, (4, 4), &ViewSettings::default(), &Progress::new()).is_err()
    };
    let half = DVec2::splat(1e-4);
    assert!(look(View::Eye { position: [0.0, 0.0, -0.1], pupil: 1e-3, focus: 0.0 }, half));
    assert!(look(View::Eye { position: [0.0, 0.0, 0.1], pupil: 0.0, focus: 0.0 }, half));
    assert!(look(View::Plane { z: f64::NAN }, half));
    assert!(look(View::Plane { z: 0.1 }, DVec2::splat(f64::INFINITY)));
    assert!(look(View::Plane { z: 0.1 }, DVec2::splat(1e3)));
}
