//! What planes take: work in core-seconds and memory in bytes.
//!
//! Each step of the engine has its own terms, fitted to its own times: 110 runs of 300 to 1e6 points on 0.5 to 33 Mpx on a
//! 3.7 GHz Zen 4, medians of three.

use super::paint::{self, GROUP};
use super::spectrum::Spectrum;
use super::table::Table;
use super::{Cloud, LENGTH_FACTORS, Parameters, Slabs, Splat, layout};
use crate::hologram::sources::PointWave;

/// A pixel's part in a column: its factors once a plane, its transform and the sum once a moment [core-seconds].
const FACTORS: f64 = 7.5e-10;
const COLUMN: f64 = 2.2e-9;

/// A pixel of a painted row: its transform, and its way into the columns.
const ROW: f64 = 3.5e-9;

/// A pixel of a painted row: cleared.
const CLEARED: f64 = 7e-10;

/// On the way back: a pixel of a column, of a row that crosses the panel, and of the panel.
const BACK_COLUMN: f64 = 2.2e-9;
const BACK_ROW: f64 = 4.7e-9;
const WINDOW: f64 = 5.5e-9;

/// A point: checked and gathered, sorted into planes and made relative to its own.
const GATHERED: f64 = 2.7e-7;

/// A group of points, and a pixel that it is painted on.
const GROUPED: f64 = 9.4e-7;
const PAINTED: f64 = 2.9e-10;

/// A pixel of a patch: cleared, and added to the plane; touched for the first time.
const PATCHED: f64 = 1.3e-9;
const TOUCHED: f64 = 1.5e-9;

/// A byte of the kernels' tables.
const TABLE_BYTE: f64 = 2e-9;

impl Parameters {
    /// Predicted work on the widest instruction set [core-seconds].
    pub(super) fn core_seconds(&self, cloud: &Cloud, slabs: &Slabs) -> f64 {
        if cloud.sources.is_empty() {
            return 0.0;
        }
        let (layout, grid) = (layout(cloud, self, slabs, &LENGTH_FACTORS), cloud.grid);
        let (planes, rank) = (slabs.depths.len() as f64, self.rank as f64);
        let [width, height] = layout.size.map(|size| size as f64);
        let painted = width * layout.painted as f64;
        let count = cloud.sources.len() as f64;
        let spectra = planes * width * height * (FACTORS + rank * COLUMN)
            + planes * rank * painted * (ROW + CLEARED)
            + width * (height * BACK_COLUMN + grid.height as f64 * BACK_ROW)
            + grid.len() as f64 * WINDOW;
        let tables: u64 = self.table_bytes(cloud.optics, slabs.half).iter().sum();
        let points = count * GATHERED;
        spectra + points + self.painting(cloud, slabs) + tables as f64 * TABLE_BYTE
    }

    /// The part of painting.
    ///
    /// Depths are even over a slab, so half sizes of kernels are even from the tail to tail + cone. A group is painted on
    /// the union of its kernels: in a crowded bin it lies within a cell and its sizes are alike, in an empty one it is
    /// scattered over the bin. Of m even places or sizes in [0, 1] the largest is m/(m + 1) in the mean, the largest and
    /// the smallest are (m − 1)/(m + 1) apart.
    fn painting(&self, cloud: &Cloud, slabs: &Slabs) -> f64 {
        let optics = cloud.optics;
        let (planes, rank) = (slabs.depths.len() as f64, self.rank as f64);
        let count = cloud.sources.len() as f64;
        let cone = [0, 1].map(|axis| optics.cone(axis, slabs.half) / optics.pitch[axis]);
        let kernel = 2.0 * self.tail + 2.0;
        let half = [0, 1].map(|axis| Table::half_width(optics, axis, slabs.half, self.tail));
        let bin = paint::bin(half, self.rank) as f64;
        // Bins that have points, and points of each.
        let bins: f64 = planes * cloud.places.iter().map(|[low, high]| ((high - low) / bin).max(1.0)).product::<f64>();
        let patches = bins * (1.0 - (-count / bins).exp());
        let inside = (count / patches).max(1.0);
        let apart = |m: f64| (m - 1.0) / (m + 1.0);
        // The last group of a bin is not full.
        let groups = count / GROUP as f64 + patches * (1.0 + 1.0 / inside) / 3.0;
        let members = (count / groups).min(GROUP as f64);
        let cell = paint::CELL as f64;
        let crowd = inside * (cell / bin).powi(2);
        // Mean and mean square of the largest size of a group, in cones.
        let largest = 0.5 + (0.5 * apart(members)).min(1.0 / (crowd + 1.0));
        let square = 1.0 / 3.0 + 1.07 * (largest - 0.5);
        // Along a row of cells the next point is a cell over the crowd away, down the bin a row of cells.
        let scattered = |step: f64| (cell * apart(members) + (members - 1.0) * step).min(bin * apart(members));
        // Whole vectors are fifteen columns more.
        let columns = kernel + scattered(0.5 * cell / crowd) + 15.0;
        let rows = kernel + scattered(bin / inside);
        let area =
            columns * rows + 2.0 * largest * (columns * cone[1] + rows * cone[0]) + 4.0 * square * cone[0] * cone[1];
        let side = |axis: usize| kernel + 2.0 * cone[axis] * inside / (inside + 1.0) + bin * apart(inside);
        let patch = rank * (side(0) + 8.0) * side(1);
        let fresh = patches.min(paint::wave() as f64);
        groups * (GROUPED + rank * area * PAINTED) + patch * (patches * PATCHED + fresh * TOUCHED)
    }

    /// Memory beside points and field [bytes].
    pub(super) fn bytes(&self, cloud: &Cloud, slabs: &Slabs) -> u64 {
        if cloud.sources.is_empty() {
            return 0;
        }
        let layout = layout(cloud, self, slabs, &LENGTH_FACTORS);
        let plane = (self.rank * layout.size[0] * layout.painted * 8) as u64;
        let half = [0, 1].map(|axis| Table::half_width(cloud.optics, axis, slabs.half, self.tail));
        let tables: u64 = self.table_bytes(cloud.optics, slabs.half).iter().sum();
        let points =
            cloud.sources.len() as u64 * (size_of::<PointWave>() + size_of::<Splat>() + paint::ORDER_BYTES + 8) as u64;
        plane + Spectrum::bytes(&layout, self.rank) + paint::bytes(half, self.rank) + tables + points
    }
}
