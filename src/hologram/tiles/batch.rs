//! The set-up of a batch of points on a tile, in whole vectors of f64: what kernels of factors start from.

use super::factor::{Factor, Limit, Relative, Tile, factor};
use super::shape::OVERSHOOT;

/// Points of a batch: X of 32 columns and one block of Y stay in a first-level cache of 32 KB.
pub(super) const BATCH: usize = 64;

/// Points of a batch by quantity and axis, padded with dark ones.
pub(super) struct Batch {
    /// Amplitude at the tile's centre.
    pub(super) amplitude: [f64; BATCH],
    /// 1/r at the tile's centre [1/m].
    pub(super) inverse: [f64; BATCH],
    /// Phase at the tile's centre [turns].
    pub(super) turns: [f32; BATCH],
    /// Per axis and power of the index [2⁻¹⁶ turn].
    pub(super) waves: [[[f32; BATCH]; 4]; 2],
    /// Part by which the amplitude grows an index.
    pub(super) slope: [[f64; BATCH]; 2],
    /// Above zero where the taper or the cut touches the tile.
    pub(super) edge: [[f64; BATCH]; 2],
}

impl Batch {
    /// As [`factor`], in whole vectors.
    #[inline(always)]
    pub(super) fn new(tile: &Tile, points: &[Relative], half: [f64; 2]) -> Self {
        let dark = Relative { distance: 1.0, sign: 1.0, ..Relative::default() };
        let of = |value: fn(&Relative) -> f64| -> [f64; BATCH] {
            let mut values = [value(&dark); BATCH];
            values.iter_mut().zip(points).for_each(|(to, p)| *to = value(p));
            values
        };
        let (offsets, distance, sign) = ([of(|p| p.dx), of(|p| p.dy)], of(|p| p.distance), of(|p| p.sign));
        let (turns, own) = (of(|p| p.turns), of(|p| p.amplitude));
        let mut batch = Self {
            amplitude: [0.0; BATCH],
            inverse: [0.0; BATCH],
            turns: [0.0; BATCH],
            waves: [[[0.0; BATCH]; 4]; 2],
            slope: [[0.0; BATCH]; 2],
            edge: [[0.0; BATCH]; 2],
        };
        let mut base = [0.0; BATCH];
        for k in 0..BATCH {
            let [dx, dy] = [offsets[0][k], offsets[1][k]];
            let r = (dx * dx + dy * dy + distance[k] * distance[k]).sqrt();
            batch.inverse[k] = 1.0 / r;
            batch.amplitude[k] = own[k] / r;
            let phase = sign[k] * r * tile.wavenumber + turns[k];
            base[k] = phase - phase.floor();
            batch.turns[k] = base[k] as f32;
        }
        for axis in 0..2 {
            let constants = &tile.axes[axis];
            let (tapered, cut) = match tile.limit {
                Limit::None => (0.0, 0.0),
                Limit::Hard => (0.0, 1.0),
                Limit::Soft(_) => (1.0, 0.0),
            };
            for k in 0..BATCH {
                let step = constants.pitch * batch.inverse[k];
                let s = offsets[axis][k] * batch.inverse[k];
                let bend = 1.0 - s * s;
                let scale = sign[k] * constants.pitch * tile.wavenumber;
                let second = 0.5 * scale * bend * step;
                // Whole turns an index are none; they leave whole halves of a turn at the centre.
                let whole = (scale * s).round_ties_even();
                let turns = if axis == 0 { base[k] } else { 0.0 } - whole * half[axis];
                let waves = &mut batch.waves[axis];
                waves[0][k] = (65_536.0 * (turns - turns.floor())) as f32;
                waves[1][k] = (65_536.0 * (scale * s - whole)) as f32;
                waves[2][k] = (65_536.0 * second) as f32;
                waves[3][k] = (-65_536.0 * second * s * step) as f32;
                batch.slope[axis][k] = -s * step;
                let first = constants.scale * bend * step.abs() * half[axis];
                let (position, reach) = (constants.scale * s.abs() + constants.offset, step.abs() * half[axis]);
                let taper = position + first * (1.0 + 1.5 * s.abs() * reach);
                let limit = distance[k] * constants.tangent;
                let beyond = offsets[axis][k].abs() + half[axis] * constants.pitch.abs() - limit;
                batch.edge[axis][k] = if tapered > 0.0 { taper } else { cut * beyond };
            }
        }
        batch
    }
    /// Largest amplitude anywhere in the tile, `own` at its centre.
    pub(super) fn peak(&self, axis: usize, own: impl Fn(usize) -> f64, half: f64) -> f64 {
        let one = |k: usize| {
            let overshoot = if self.edge[axis][k] > 0.0 { OVERSHOOT } else { 1.0 };
            own(k).abs() * (1.0 + self.slope[axis][k].abs() * half) * overshoot
        };
        (0..BATCH).map(one).fold(0.0, f64::max)
    }
    /// The factor of a point along an axis; points beyond the last are dark.
    #[inline(always)]
    pub(super) fn factor<'a>(
        &self,
        tile: &Tile<'a>,
        points: &[Relative],
        k: usize,
        axis: usize,
        half: f64,
    ) -> Factor<'a> {
        let amplitude = if axis == 0 { self.amplitude[k] } else { 1.0 } as f32;
        match points.get(k) {
            Some(point) if self.edge[axis][k] > 0.0 => {
                let mut found = self.tapered(tile, point, k, axis, half);
                found.amplitude = amplitude;
                found
            }
            _ => {
                let phase = [0, 1, 2, 3].map(|power: usize| self.waves[axis][power][k] / 65_536.0);
                Factor::flat(phase, amplitude, self.slope[axis][k] as f32)
            }
        }
    }
    /// The factor of a point that the taper or the cut touches, term by term.
    #[inline(always)]
    pub(super) fn tapered<'a>(&self, tile: &Tile<'a>, p: &Relative, k: usize, axis: usize, half: f64) -> Factor<'a> {
        let offset = if axis == 0 { p.dx } else { p.dy };
        let mut found = factor(tile, &tile.axes[axis], p, offset, self.inverse[k], half);
        found.base = if axis == 0 { self.turns[k] } else { 0.0 };
        found
    }
}
