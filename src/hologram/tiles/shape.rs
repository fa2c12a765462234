//! How large a tile may be: the bounds on what the separable expansion leaves out.

use crate::hologram::definition::Optics;
use std::f64::consts::TAU;

/// Tile of one class of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    /// Columns, a multiple of 32.
    pub(crate) width: usize,
    /// Rows, a multiple of 4.
    pub(crate) height: usize,
    /// Every pixel from its own exact path instead of a product of a row's and a column's factor.
    pub(crate) exact: bool,
    /// Bound on the root-mean-square phase error [rad].
    pub(crate) error: f64,
}

/// Shapes from the slowest to the fastest a pixel.
const SHAPES: [(usize, usize); 15] = [
    (32, 4),
    (32, 8),
    (32, 16),
    (32, 24),
    (32, 32),
    (64, 24),
    (64, 32),
    (64, 48),
    (64, 64),
    (96, 64),
    (96, 80),
    (96, 96),
    (128, 96),
    (128, 112),
    (128, 128),
];

impl Shape {
    /// The largest tile whose error stays below `error`, for points no nearer than `distance`, seen by the panel under
    /// sines of at most `sine` along x and y, whose product has the root mean square `tilt` over the lit pixels.
    pub(crate) fn choose(optics: &Optics, distance: f64, sine: [f64; 2], tilt: f64, error: f64) -> Self {
        // A tile much wider than a point's cone works on dark pixels.
        let cone = [0, 1].map(|axis| distance * sine[axis] / optics.pitch[axis]);
        let mut best = Self { width: 32, height: 16, exact: true, error: EXACT_ROUNDING };
        for (width, height) in SHAPES {
            let bound = separable_error(optics, distance, tilt, width, height);
            let wasteful = width > 32 && (width as f64 > cone[0].max(32.0) || height as f64 > cone[1].max(16.0));
            if bound <= error && !wasteful {
                best = Self { width, height, exact: false, error: bound };
            }
        }
        best
    }
}

/// Rounding of the f32 path of the exact kernel: half a unit in the last place of up to 16 turns [rad].
const EXACT_ROUNDING: f64 = 6e-6;

/// Root-mean-square phase error of the expansion [rad], about the tile's centre, with u, v the tile's half sizes:
///
/// - the cross term k·|xy|·uv/r³ = k·|s_x s_y|·uv/r; the mean square of uv over the tile is a ninth of the largest;
/// - fourth order of the sphere along an axis, k·u⁴/8r³, and third order of the taper's coordinate, (b/s)·u³/2r³, at
///   the corner (their mean is a third).
fn separable_error(optics: &Optics, distance: f64, tilt: f64, width: usize, height: usize) -> f64 {
    let k = TAU / optics.wavelength;
    let half = [0.5 * width as f64 * optics.pitch[0], 0.5 * height as f64 * optics.pitch[1]];
    let relative = half.map(|h| h / distance);
    let cross = k * tilt * half[0] * relative[1] / 3.0;
    let along = (0..2).map(|axis| {
        let taper = optics.taper[axis];
        let fourth = k * half[axis] * relative[axis].powi(3) / 8.0;
        fourth.max(0.5 * taper.middle / taper.width * relative[axis].powi(3)).max(0.5 * relative[axis].powi(2)) / 3.0
    });
    along.fold(cross, |sum, term| sum + term)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Grid;

    #[test]
    fn tiles_grow_with_the_allowed_error_and_shrink_with_angle_and_nearness() {
        let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
        let optics = Optics::new(&grid, 632.8e-9).expect("optics");
        let sine = [0.04; 2];
        let area = |distance: f64, error: f64| {
            let shape = Shape::choose(&optics, distance, sine, 0.04 * 0.04 / 3.0, error);
            if shape.exact { 1 } else { shape.width * shape.height }
        };
        assert!(area(0.2, 1e-4) > 32 * 4 && area(0.2, 2e-3) > area(0.2, 1e-4));
        assert!(area(0.02, 1e-4) < area(0.2, 1e-4));
        // Largest phase error of 64 × 60 px at 8 µm and 0.2 m, by the expansion itself: 0.005 rad at the corner.
        let bound = separable_error(&optics, 0.2, 0.04 * 0.04 / 3.0, 64, 60);
        assert!((bound * 9.0 / 0.005 - 1.0).abs() < 0.1, "{bound}");
        let fine = Grid::new(64, 64, 1e-6, 1e-6).expect("grid");
        let wide = Optics::new(&fine, 632.8e-9).expect("optics");
        assert!(Shape::choose(&wide, 5e-3, [0.32; 2], 0.03, 1e-4).exact);
    }
}
