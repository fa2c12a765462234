//! From the light that a sensor on a plane collects to radiance: each wavelength and each place has its own solid angle.
//!
//! A point of a hologram sends light into the panel's band of spatial frequencies only, sin θ = λ·f, and only through the
//! panel itself. Seen from the point (x, y) at depth z that is the rectangle
//!
//! ```text
//! x − z·tan(asin λf),  f = f_low … f_high,  cut by |x| ≤ D/2
//! ```
//!
//! of the panel, over z² a solid angle. It grows as λ² (in red it is (638/450)² = 2 times that in blue) and falls towards
//! the picture's border as a lens vignettes. Dividing by it is what photographers call a flat field.

use super::{Picture, ViewSettings};
use crate::field::Field;
use glam::DVec2;

/// Less than this part of the whole band's light is shown too dark rather than as amplified noise.
const LEAST: f64 = 0.1;

/// Where a panel's light goes at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Tangents of the band's ends along x and y.
    tangents: [[f64; 2]; 2],
    /// Half extent of the panel [m].
    half: [f64; 2],
}

impl Cone {
    /// Of a field that leaves a panel centred on the axis, through the aperture of `settings` if there is one.
    pub(super) fn new(field: &Field, settings: &ViewSettings) -> Self {
        let (limit, grid) = ([field.grid.limit_x(), field.grid.limit_y()], &field.grid);
        let (center, band) = settings.aperture.map_or(([0.0; 2], limit), |a| (a.center, a.half));
        let tangent = |f: f64| (field.wavelength * f).clamp(-0.99, 0.99).asin().tan();
        let ends = |i: usize| [tangent(center[i] - band[i]), tangent(center[i] + band[i])];
        Self { tangents: [ends(0), ends(1)], half: [0.5 * grid.extent_x(), 0.5 * grid.extent_y()] }
    }

    /// Solid angle [sr] (for small angles) into which the point `at` of the plane z [m] sends its light through the panel.
    pub(super) fn solid_angle(&self, at: DVec2, z: f64) -> f64 {
        let side = |i: usize, x: f64| {
            let [low, high] = self.tangents[i];
            if z == 0.0 {
                return if x.abs() <= self.half[i] { high - low } else { 0.0 };
            }
            // Tangents whose ray meets the panel: |x − z·t| ≤ D/2.
            let (a, b) = ((x - self.half[i]) / z, (x + self.half[i]) / z);
            (high.min(a.max(b)) - low.max(a.min(b))).max(0.0)
        };
        side(0, at.x) * side(1, at.y)
    }

    /// Divides a picture of the window ±half_at(z) by the solid angle of each pixel, seen at the depth z of `depth_of` it.
    pub(super) fn flatten(
        &self,
        picture: &mut Picture,
        half_at: impl Fn(f64) -> DVec2,
        depth_of: impl Fn(usize) -> f64,
    ) {
        let [[x0, x1], [y0, y1]] = self.tangents;
        let least = LEAST * (x1 - x0) * (y1 - y0);
        let size = DVec2::new(picture.width as f64, picture.height as f64);
        for (i, value) in picture.values.iter_mut().enumerate() {
            let z = depth_of(i);
            let cell = DVec2::new((i % picture.width) as f64 + 0.5, (i / picture.width) as f64 + 0.5) / size;
            let at = half_at(z) * DVec2::new(2.0 * cell.x - 1.0, 1.0 - 2.0 * cell.y);
            *value /= self.solid_angle(at, z).max(least) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Grid;
    use crate::propagation::Aperture;

    fn cone(wavelength: f64) -> Cone {
        let grid = Grid::new(1000, 500, 8e-6, 8e-6).expect("grid");
        let settings = ViewSettings { aperture: Some(Aperture::centered(31_250.0, 31_250.0)), ..Default::default() };
        Cone::new(&Field::zeros(grid, wavelength), &settings)
    }

    #[test]
    fn solid_angles_grow_with_the_square_of_the_wavelength_and_end_at_the_panel() {
        let (red, blue) = (cone(640e-9), cone(480e-9));
        let on_axis = |c: &Cone| c.solid_angle(DVec2::ZERO, -0.05);
        assert!((on_axis(&red) / on_axis(&blue) - (640.0f64 / 480.0).powi(2)).abs() < 1e-3);
        assert!((on_axis(&red) - (2.0 * 640e-9 * 31_250.0f64).powi(2)).abs() < 1e-6);
        // Straight behind the panel's right edge half of the rays pass it, from either side of the panel.
        for z in [-0.05, 0.05, 0.0] {
            let edge = red.solid_angle(DVec2::new(3.999_999e-3, 0.0), z) / on_axis(&red);
            assert!((edge - if z == 0.0 { 1.0 } else { 0.5 }).abs() < 1e-3, "{z}: {edge}");
        }
        assert_eq!(red.solid_angle(DVec2::new(0.1, 0.0), -0.05), 0.0);
        // Far away the whole panel is the aperture.
        let far = red.solid_angle(DVec2::ZERO, -10.0);
        assert!((far - 8e-3 * 4e-3 / 100.0).abs() < 1e-9, "{far}");
    }

    #[test]
    fn a_flat_field_is_flat() {
        let red = cone(640e-9);
        let half_at = |z: f64| DVec2::new(3e-3, 1.5e-3) * (1.0 - z);
        let depth = |i: usize| if i.is_multiple_of(2) { -0.05 } else { -0.1 };
        let values = (0..200)
            .map(|i| {
                let (c, r) = ((i % 20) as f64 + 0.5, (i / 20) as f64 + 0.5);
                let at = half_at(depth(i)) * DVec2::new(c / 10.0 - 1.0, 1.0 - r / 5.0);
                7.0 * red.solid_angle(at, depth(i)) as f32
            })
            .collect();
        let mut picture = Picture { width: 20, height: 10, values };
        red.flatten(&mut picture, half_at, depth);
        assert!(picture.values.iter().all(|v| (v - 7.0).abs() < 1e-4), "{:?}", picture.values);
    }
}
