//! Where the planes stand: slabs of least depth that hold every point, and the series over a slab.
//!
//! Clouds are seldom even in depth: a page of text has one depth, a room has walls and air between. Slabs that cover
//! only what is occupied are thinner than equal parts of the whole, and both the residual that the spectrum corrects
//! and the area of the kernels go with the thickest slab.

use crate::hologram::lanes::Lanes;
use rayon::prelude::*;

/// Cells that the depths are sorted into.
const CELLS: usize = 2048;

/// Points that one task sorts: fixed, so that sums do not depend on the number of threads.
const PART: usize = 1 << 16;

/// Halvings of the interval in which the least slab depth is sought: to 1e-9 of the cloud's depth.
const HALVINGS: usize = 30;

/// Points of similar depth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    /// Smallest and largest depth in it [m].
    depth: [f64; 2],
    /// Σ amplitude².
    light: f64,
}

/// The cloud's light by depth: occupied cells only, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Depths {
    cells: Vec<Cell>,
}

/// Slabs in order of depth, and what they do to the error.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::hologram) struct Slabs {
    /// Smallest and largest depth of each [m].
    pub(in crate::hologram) depths: Vec<[f64; 2]>,
    /// Half depth of the thickest, h [m].
    pub(in crate::hologram) half: f64,
}

impl Depths {
    /// Sorts points of a (depth, amplitude) each; the same points give the same bits for any number of threads.
    pub(super) fn new<P: Sync>(points: &[P], of: impl Fn(&P) -> (f64, f64) + Sync) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let wider = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let ends = points.par_iter().map(|p| [of(p).0; 2]).reduce(|| none, wider);
        let scale = CELLS as f64 / (ends[1] - ends[0]).max(f64::MIN_POSITIVE);
        let empty = Cell { depth: none, light: 0.0 };
        let sort = |points: &[P]| {
            let mut cells = vec![empty; CELLS];
            for (depth, amplitude) in points.iter().map(&of) {
                let cell = &mut cells[(((depth - ends[0]) * scale) as usize).min(CELLS - 1)];
                cell.depth = wider(cell.depth, [depth; 2]);
                cell.light += amplitude * amplitude;
            }
            cells
        };
        let parts: Vec<Vec<Cell>> = points.par_chunks(PART).map(sort).collect();
        let mut cells = vec![empty; CELLS];
        for part in parts {
            for (cell, part) in cells.iter_mut().zip(part) {
                cell.depth = wider(cell.depth, part.depth);
                cell.light += part.light;
            }
        }
        cells.retain(|cell| cell.depth[0] <= cell.depth[1]);
        Self { cells }
    }

    /// Smallest and largest depth [m].
    #[cfg(test)]
    fn ends(&self) -> [f64; 2] {
        [self.cells[0].depth[0], self.cells[self.cells.len() - 1].depth[1]]
    }

    /// At most `count` slabs that hold all points, the thickest as thin as it can be, but no thinner than 2·`least` [m].
    pub(super) fn slabs(&self, count: usize, least: f64) -> Slabs {
        let (Some(first), Some(last)) = (self.cells.first(), self.cells.last()) else {
            return Slabs { depths: Vec::new(), half: least };
        };
        let thickest_cell = self.cells.iter().map(|cell| cell.depth[1] - cell.depth[0]).fold(0.0, f64::max);
        let (mut low, mut high) = (thickest_cell.max(2.0 * least), last.depth[1] - first.depth[0]);
        // The greedy cover with slabs of a given depth takes the fewest.
        if high > low && self.cover(low).len() > count {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if self.cover(middle).len() <= count { high = middle } else { low = middle }
            }
        } else {
            high = low;
        }
        let depths = self.cover(high);
        let half = depths.iter().map(|[from, to]| 0.5 * (to - from)).fold(least, f64::max);
        Slabs { depths, half }
    }

    /// Slabs no thicker than `thickness`, each begun at the first depth that those before leave out.
    fn cover(&self, thickness: f64) -> Vec<[f64; 2]> {
        let mut slabs: Vec<[f64; 2]> = Vec::new();
        for cell in &self.cells {
            match slabs.last_mut() {
                // A unit in the last place decides nothing.
                Some(slab) if cell.depth[1] - slab[0] <= thickness * (1.0 + 1e-12) => slab[1] = cell.depth[1],
                _ => slabs.push(cell.depth),
            }
        }
        slabs
    }

    /// √⟨(2R + 1)·P_R(u)²⟩ over the light, u = d/h: what a series of `rank` R errs more than where depths are even over
    /// their slabs (1); at most √(2R + 1), where all stand on the slabs' faces.
    pub(super) fn unevenness(&self, slabs: &Slabs, rank: usize) -> f64 {
        let polynomial = |u: f64| match rank {
            1 => u,
            2 => 1.5 * u * u - 0.5,
            3 => (2.5 * u * u - 1.5) * u,
            _ => (4.375 * u * u - 3.75) * u * u + 0.375,
        };
        let (mut sum, mut light) = (0.0, 0.0);
        for cell in &self.cells {
            let depth = 0.5 * (cell.depth[0] + cell.depth[1]);
            let [from, to] = slabs.depths[slabs.index(depth)];
            let u = (depth - 0.5 * (from + to)) / slabs.half;
            sum += cell.light * polynomial(u).powi(2);
            light += cell.light;
        }
        // A cloud without light has no error.
        if light > 0.0 { ((2 * rank + 1) as f64 * sum / light).sqrt() } else { 0.0 }
    }
}

impl Slabs {
    /// The slab of a depth.
    pub(in crate::hologram) fn index(&self, depth: f64) -> usize {
        self.depths.partition_point(|slab| slab[1] < depth).min(self.depths.len().saturating_sub(1))
    }
    /// Indexes of the points of each slab, in order.
    pub(super) fn members<P: Sync>(&self, points: &[P], depth: impl Fn(&P) -> f64 + Sync) -> Vec<Vec<u32>> {
        let sort = |(part, points): (usize, &[P])| {
            let mut members = vec![Vec::new(); self.depths.len()];
            for (i, point) in points.iter().enumerate() {
                members[self.index(depth(point))].push((part * PART + i) as u32);
            }
            members
        };
        let parts: Vec<Vec<Vec<u32>>> = points.par_chunks(PART).enumerate().map(sort).collect();
        (0..self.depths.len()).map(|k| parts.iter().flat_map(|part| &part[k]).copied().collect()).collect()
    }
    /// Depth of a slab's plane [m].
    pub(in crate::hologram) fn plane(&self, index: usize) -> f64 {
        0.5 * (self.depths[index][0] + self.depths[index][1])
    }
}

/// p_r(x) of the Legendre series up to P₃, r < `rank`, by the power series of the spherical Bessel functions j_l to 1e-6
/// for |x| ≤ 1 (x stays below the fourth root of the rank's error).
///
/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
pub(super) unsafe fn legendre<L: Lanes>(x: L, rank: usize) -> [L; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let w = x.mul(x);
        let series =
            |terms: [f32; 4]| terms[..3].iter().rev().fold(L::splat(terms[3]), |sum, &term| sum.fma(w, L::splat(term)));
        let zero = L::splat(0.0);
        // Under the name of j_l: (2l + 1)·j_l(x).
        let j0 = series([1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0]);
        if rank == 1 {
            return [j0, zero, zero, zero];
        }
        let j1 = series([1.0, -1.0 / 10.0, 1.0 / 280.0, -1.0 / 15_120.0]).mul(x);
        if rank == 2 {
            return [j0, j1, zero, zero];
        }
        let j2 = series([1.0 / 3.0, -1.0 / 42.0, 1.0 / 1512.0, -1.0 / 99_792.0]).mul(w);
        // −P₂ = ½ − (3/2)u².
        let (p0, p2) = (j2.fma(L::splat(0.5), j0), j2.mul(L::splat(1.5)));
        if rank == 3 {
            return [p0, j1, p2, zero];
        }
        let j3 = series([1.0 / 15.0, -1.0 / 270.0, 1.0 / 11_880.0, -1.0 / 926_640.0]).mul(w).mul(x);
        // −P₃ = (3/2)u − (5/2)u³.
        [p0, j3.fma(L::splat(1.5), j1), p2, j3.mul(L::splat(2.5))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;

    fn even(n: usize) -> Vec<(f64, f64)> {
        (0..n).map(|i| (-0.3 + 0.1 * i as f64 / (n - 1) as f64, 1.0)).collect()
    }

    #[test]
    fn even_depths_are_cut_into_equal_parts() {
        let depths = Depths::new(&even(100_001), |p| *p);
        assert_eq!(depths.ends(), [-0.3, -0.3 + 0.1]);
        for count in [1, 2, 3, 8, 32] {
            let slabs = depths.slabs(count, 1e-9);
            assert_eq!(slabs.depths.len(), count);
            assert!((slabs.half * count as f64 / 0.05 - 1.0).abs() < 0.02, "{count}: {}", slabs.half);
            for rank in 1..=4 {
                let unevenness = depths.unevenness(&slabs, rank);
                assert!((unevenness - 1.0).abs() < 0.05, "{count}, rank {rank}: {unevenness}");
            }
        }
    }

    #[test]
    fn every_point_lies_in_its_slab_and_layers_have_slabs_of_their_own() {
        let layers: Vec<(f64, f64)> = even(900).into_iter().map(|(d, a)| ((d * 30.0).round() / 30.0, a)).collect();
        let depths = Depths::new(&layers, |p| *p);
        let slabs = depths.slabs(8, 1e-7);
        // Four layers, whatever number of planes is allowed.
        assert!(slabs.depths.len() == 4 && slabs.half == 1e-7, "{slabs:?}");
        let few = depths.slabs(2, 1e-7);
        assert!(few.depths.len() == 2 && (few.half - 1.0 / 60.0).abs() < 1e-12, "{few:?}");
        // All on the faces: the worst that can be.
        assert!((depths.unevenness(&few, 2) - 5f64.sqrt()).abs() < 1e-9);
        for slabs in [slabs, few] {
            for (depth, _) in &layers {
                let index = slabs.index(*depth);
                let [from, to] = slabs.depths[index];
                assert!(from <= *depth && *depth <= to && (depth - slabs.plane(index)).abs() <= slabs.half);
            }
        }
    }

    #[test]
    fn one_depth_no_depth_and_depths_on_both_sides() {
        let one = Depths::new(&[(0.1, 1.0), (0.1, 2.0)], |p| *p);
        let slabs = one.slabs(5, 1e-6);
        assert_eq!((slabs.depths, slabs.half), (vec![[0.1, 0.1]], 1e-6));
        assert!(Depths::new(&[(0.0, 0.0); 0], |p| *p).slabs(3, 1e-6).depths.is_empty());
        let both = Depths::new(&[(-0.1, 1.0), (0.1, 1.0)], |p| *p);
        assert_eq!(both.slabs(1, 1e-6).half, 0.1);
        assert_eq!(both.slabs(2, 1e-6).half, 1e-6);
    }

    #[test]
    fn the_series_is_the_best_polynomial_over_a_slab() {
        for rank in 1..=4 {
            for x in [0.05f32, 0.3, 0.9] {
                // SAFETY: the portable set is on every machine.
                let weights = unsafe { legendre(crate::hologram::lanes::Portable::splat(x), rank) };
                let mut values = [[0.0f32; 8]; 4];
                for (value, weight) in values.iter_mut().zip(weights) {
                    // SAFETY: eight lanes.
                    unsafe { weight.store(value.as_mut_ptr()) };
                }
                // The error of Σ iʳ p_r uʳ against e^{ixu}, its mean square over u, and its part along 1 and u.
                let (mut square, mut along) = (0.0, [0.0; 2]);
                let steps = 2000;
                for step in 0..steps {
                    let u = (step as f64 + 0.5) * 2.0 / steps as f64 - 1.0;
                    let mut sum = Complex64::cis(f64::from(x) * u);
                    for (r, value) in values.iter().enumerate().take(rank) {
                        sum -= Complex64::i().powu(r as u32) * f64::from(value[0]) * u.powi(r as i32);
                    }
                    square += sum.norm_sqr() / f64::from(steps);
                    along = [along[0] + sum.re / f64::from(steps), along[1] + sum.im * u / f64::from(steps)];
                }
                let x = f64::from(x);
                // The first term that is left out: (2R + 1)·j_R(x)·P_R(u), P_R with the mean square 1/(2R + 1).
                let expected = [
                    x / 3f64.sqrt(),
                    x * x * 5f64.sqrt() / 15.0,
                    x.powi(3) * 7f64.sqrt() / 105.0,
                    x.powi(4) * 3.0 / 945.0,
                ];
                let found = square.sqrt();
                let wanted = expected[rank - 1];
                assert!(
                    (found / wanted - 1.0).abs() < 0.1 || found < 3e-7,
                    "rank {rank}, {x}: {found:.2e} {wanted:.2e}"
                );
                assert!(along[0].abs() < 3e-6 && (rank == 1 || along[1].abs() < 3e-6), "rank {rank}, {x}: {along:?}");
            }
        }
    }
}
