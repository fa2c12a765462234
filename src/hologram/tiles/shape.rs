//! How large a tile may be: the bounds on what the separable expansion leaves out.

use crate::hologram::definition::Optics;
use crate::hologram::lanes::InstructionSet;
use std::f64::consts::TAU;

/// What sums a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// Every pixel from its own exact path.
    Paths,
    /// Products of rows' and columns' factors in f32.
    Float,
    /// The same in 16-bit integers.
    Integer,
    /// The same in bfloat16 on a matrix unit.
    Bfloat,
}

/// What an engine can sum with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Products {
    /// Products in f32 on tiles of any shape.
    Float,
    /// Also products in integers, where their rounding is allowed.
    Integer,
    /// Also products in bfloat16, where their rounding is.
    Bfloat,
    /// The tiles of the shaders: [`SHADER`].
    Shader,
}

impl Products {
    /// Those of the kernels for an instruction set.
    pub(crate) fn of(set: InstructionSet) -> Self {
        match set {
            InstructionSet::Amx => Self::Bfloat,
            InstructionSet::Avx512Vnni => Self::Integer,
            InstructionSet::Avx512 | InstructionSet::Avx2 | InstructionSet::Portable => Self::Float,
        }
    }
}

impl Products {
    /// Least work of a point and a pixel with any of the kernels [core-seconds]; see [`Shape::seconds`].
    pub(crate) fn least_pair(self) -> f64 {
        match self {
            Self::Float | Self::Shader => FLOAT_PAIR,
            Self::Integer => INTEGER_PAIR,
            Self::Bfloat => BFLOAT_PAIR,
        }
    }
    /// Kernels that keep an error for such points, and the rounding of each.
    fn kernels(self, lighting: &Lighting, error: f64) -> Vec<(Kernel, f64)> {
        let mut kernels = vec![(Kernel::Float, 0.0)];
        let noise = integer_noise(lighting);
        // Where integers are allowed they are quicker than f32 on any tile.
        if matches!(self, Self::Integer | Self::Bfloat) && noise <= INTEGER_PART * error {
            kernels = vec![(Kernel::Integer, noise)];
        }
        if self == Self::Bfloat && BFLOAT_NOISE <= BFLOAT_PART * error {
            kernels.push((Kernel::Bfloat, BFLOAT_NOISE));
        }
        kernels
    }
}

/// Columns that a tile's width is a multiple of.
pub(super) const COLUMNS: usize = 32;

/// Columns and rows of the shaders' tiles.
pub(crate) const SHADER: usize = 32;

/// Tile of one class of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    /// Columns, a multiple of 32.
    pub(crate) width: usize,
    /// Rows, a multiple of 4.
    pub(crate) height: usize,
    /// What sums it.
    pub(crate) kernel: Kernel,
    /// Bound on the relative root-mean-square error: of phase [rad], and of integers' rounding.
    pub(crate) error: f64,
}

/// What the choice of a shape needs to know of a class.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lighting {
    /// Columns and rows of the panel.
    pub(super) panel: [usize; 2],
    /// Smallest distance [m].
    pub(super) distance: f64,
    /// Largest sine along x and y.
    pub(super) sine: [f64; 2],
    /// Root mean square of the sines' product over the lit pixels.
    pub(super) tilt: f64,
    /// Largest wave against the root mean square of all, where they shine.
    pub(super) contrast: f64,
}

/// Largest columns and rows of a tile: factors and sums stay in a second-level cache of 1 MB.
const LARGEST: usize = 192;

/// Root mean square of an integer factor's rounding, in units of the largest amplitude of its batch, which is 5,780 in
/// units of the last place: 0.41 of one are the rounding of its parts, 0.41 of its multiplier and of that one's slope,
/// 0.16 of the phase, 0.25 inside the sine; 0.65 together.
pub(super) const INTEGER_NOISE: f64 = 1.125e-4;

/// Bound on |T| of the taper: the edge's overshoot at any distance.
pub(super) const OVERSHOOT: f64 = 1.18;

/// Part of the wanted error that integers may take; the tile's size has the rest.
const INTEGER_PART: f64 = 0.4;

/// Rounding of a product of two factors in bfloat16 (relative L2).
pub(super) const BFLOAT_NOISE: f64 = 2.4e-3;

/// Part of the wanted error that bfloat16 may take.
const BFLOAT_PART: f64 = 0.7;

/// Work of a point and a pixel in the products of each kernel [core-seconds]: measured on a Zen 4 at 3.7 GHz, for
/// bfloat16 with a prototype on a Sapphire Rapids at 3.3 GHz.
const FLOAT_PAIR: f64 = 8e-11;
const INTEGER_PAIR: f64 = 3e-11;
const BFLOAT_PAIR: f64 = 4.3e-12;

impl Shape {
    /// The tile of least work whose error stays below `error`.
    pub(super) fn choose(optics: &Optics, lighting: &Lighting, products: Products, error: f64) -> Self {
        let heights = match products {
            Products::Shader => SHADER..=SHADER,
            Products::Float | Products::Integer | Products::Bfloat => 4..=LARGEST,
        };
        let widths = if products == Products::Shader { SHADER..=SHADER } else { COLUMNS..=LARGEST };
        let mut best = Self { width: 32, height: 16, kernel: Kernel::Paths, error: EXACT_ROUNDING };
        let mut least = f64::INFINITY;
        for (kernel, noise) in products.kernels(lighting, error) {
            let rows = if kernel == Kernel::Bfloat { 16 } else { 4 };
            let shapes = widths.clone().step_by(COLUMNS).flat_map(|width| {
                let heights = heights.clone().filter(|height| height.is_multiple_of(rows));
                heights.map(move |height| [width, height])
            });
            for [width, height] in shapes {
                let bound = separable_error(optics, lighting.distance, lighting.tilt, width, height) + noise;
                let shape = Self { width, height, kernel, error: bound };
                // A span that is not on tile borders touches one tile more; one that fills the panel does not.
                let tiles = [0, 1].map(|axis| {
                    let (panel, size) = (lighting.panel[axis], [width, height][axis]);
                    let cone = 2.0 * lighting.distance * lighting.sine[axis] / optics.pitch[axis];
                    (panel.div_ceil(size) as f64).min(cone / size as f64 + 1.0)
                });
                let work = tiles[0] * tiles[1] * shape.seconds();
                if bound <= error && work < least {
                    (best, least) = (shape, work);
                }
            }
        }
        best
    }
    /// Work of a point on the tile [core-seconds]: its set-up, factors of width + height, products of the area; measured
    /// on a Zen 4 at 3.7 GHz.
    pub(super) fn seconds(&self) -> f64 {
        let (width, height) = (self.width as f64, self.height as f64);
        match self.kernel {
            Kernel::Paths => height * (4e-8 + width * 1.4e-9),
            Kernel::Float => 3.5e-8 + 6.5e-10 * (width + height) + width * height * FLOAT_PAIR,
            Kernel::Integer => 2e-8 + 4e-10 * (width + height) + width * height * INTEGER_PAIR,
            Kernel::Bfloat => 2e-8 + 4e-10 * (width + height) + width * height * BFLOAT_PAIR,
        }
    }
}

/// Rounding of integer products (relative L2): that of the columns' factors goes with the batch's largest wave, of the
/// rows' with the wave itself, and neighbouring roundings are independent.
fn integer_noise(lighting: &Lighting) -> f64 {
    // The contrast is that on the axis; aslant a wave is weaker by the cosine.
    let cosine = (1.0 - lighting.sine.map(|sine| sine * sine).iter().sum::<f64>()).max(0.01).sqrt();
    INTEGER_NOISE * OVERSHOOT * (lighting.contrast / cosine).hypot(1.0)
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

    const HD: Lighting =
        Lighting { panel: [1920, 1080], distance: 0.2, sine: [0.04; 2], tilt: 0.04 * 0.04 / 3.0, contrast: 1.5 };

    fn hd() -> Optics {
        Optics::new(&Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid"), 632.8e-9).expect("optics")
    }

    #[test]
    fn tiles_grow_with_the_allowed_error_and_shrink_with_angle_and_nearness() {
        let optics = hd();
        let area = |distance: f64, error: f64| {
            let shape = Shape::choose(&optics, &Lighting { distance, ..HD }, Products::Float, error);
            assert!(shape.error <= error || shape.kernel == Kernel::Paths);
            if shape.kernel == Kernel::Paths { 1 } else { shape.width * shape.height }
        };
        assert!(area(0.2, 1e-4) > 32 * 4 && area(0.2, 2e-3) > area(0.2, 1e-4));
        assert!(area(0.02, 1e-4) < area(0.2, 1e-4));
        // Largest phase error of 64 × 60 px at 8 µm and 0.2 m, by the expansion itself: 0.005 rad at the corner.
        let bound = separable_error(&optics, 0.2, HD.tilt, 64, 60);
        assert!((bound * 9.0 / 0.005 - 1.0).abs() < 0.1, "{bound}");
        let fine = Grid::new(64, 64, 1e-6, 1e-6).expect("grid");
        let wide = Optics::new(&fine, 632.8e-9).expect("optics");
        let lighting = Lighting { panel: [64, 64], distance: 5e-3, sine: [0.32; 2], tilt: 0.03, contrast: 1.0 };
        assert_eq!(Shape::choose(&wide, &lighting, Products::Float, 1e-4).kernel, Kernel::Paths);
    }

    #[test]
    fn integers_are_taken_where_their_rounding_is_a_small_part_of_the_error() {
        let of = |products: Products, contrast: f64, error: f64| {
            Shape::choose(&hd(), &Lighting { contrast, ..HD }, products, error)
        };
        assert_eq!(of(Products::Integer, 1.5, 2e-3).kernel, Kernel::Integer);
        assert_eq!(of(Products::Float, 1.5, 2e-3).kernel, Kernel::Float);
        // At 1e-4 they would be all of it; nor where one wave outshines the others, or nothing shines on the panel.
        assert_eq!(of(Products::Integer, 1.5, 1e-4).kernel, Kernel::Float);
        for contrast in [20.0, f64::INFINITY, f64::NAN] {
            assert_eq!(of(Products::Integer, contrast, 2e-3).kernel, Kernel::Float);
        }
        // Their rounding is stated: a tile of the same size promises less.
        let [integer, float] = [Products::Integer, Products::Float].map(|products| of(products, 3.0, 2e-3));
        assert!(integer.error > integer_noise(&Lighting { contrast: 3.0, ..HD }) && integer.error <= 2e-3);
        assert!(integer.width * integer.height < float.width * float.height);
        // bfloat16 where its rounding leaves room, whatever the contrast, in whole blocks of rows.
        for contrast in [1.5, 20.0] {
            let bfloat = of(Products::Bfloat, contrast, 5e-3);
            assert!(bfloat.kernel == Kernel::Bfloat && bfloat.height.is_multiple_of(16), "{bfloat:?}");
            assert!(bfloat.error > BFLOAT_NOISE && bfloat.error <= 5e-3);
        }
        assert_eq!(of(Products::Bfloat, 1.5, 2e-3).kernel, Kernel::Integer);
        assert_eq!(of(Products::Bfloat, 20.0, 2e-3).kernel, Kernel::Float);
        assert_eq!([of(Products::Shader, 1.5, 2e-3).width, of(Products::Shader, 1.5, 2e-3).height], [SHADER; 2]);
    }
}
