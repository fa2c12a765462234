//! Points as the shader paints them, and the lists of those that touch each tile.

use crate::hologram::planes::{PlaneGrid, Splat, Table};

/// Side of a tile [px]; as in the shader.
const TILE: usize = 64;

/// Most strokes of a chunk.
pub(super) const STROKES: usize = 1 << 18;

/// Most entries of a chunk's lists: a stroke has one in every tile that it touches.
pub(super) const ENTRIES: usize = 1 << 22;

/// Most strokes that a tile gets from one dispatch: no workgroup should run for long.
const LONGEST: usize = 1024;

/// A point, as the shader takes it.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Stroke {
    pixel: [i32; 2],
    line: [u32; 2],
    depth: [f32; 2],
    part: [f32; 2],
    factor: [f32; 2],
    sign: f32,
    ratio: f32,
}

impl Stroke {
    /// `half` is the slabs' half depth [m].
    pub(super) fn new(splat: &Splat, tables: [&Table; 2], half: f64) -> Self {
        let [x, y] = [0, 1].map(|axis| tables[axis].place(splat.d, splat.at[axis]));
        Self {
            pixel: [x.pixel as i32, y.pixel as i32],
            line: [x.line as u32, y.line as u32],
            depth: [x.u, y.u],
            part: [x.t, y.t],
            factor: splat.factor,
            sign: if splat.d < 0.0 { -1.0 } else { 1.0 },
            ratio: (splat.d / half) as f32,
        }
    }
}

/// Tiles of a plane, along x and y.
pub(super) fn tiles(layout: &PlaneGrid) -> [usize; 2] {
    [layout.size[0].div_ceil(TILE), layout.painted.div_ceil(TILE)]
}

/// Columns and rows of tiles that a splat's kernel touches.
pub(super) fn span(splat: &Splat, slope: [f64; 2], tail: f64, tiles: [usize; 2]) -> [[u32; 2]; 2] {
    [0, 1].map(|axis| {
        let reach = splat.d.abs() * slope[axis] + tail;
        // Saturating: what lies before the first tile belongs to it.
        let last = tiles[axis] - 1;
        let tile = |pixel: f64| ((pixel as usize) / TILE).min(last) as u32;
        [tile(splat.at[axis] - reach), tile(splat.at[axis] + reach + 1.0)]
    })
}

fn entries([columns, rows]: &[[u32; 2]; 2]) -> usize {
    ((columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1)) as usize
}

/// The parts, as ranges, in which strokes with these spans fit the buffers.
pub(super) fn chunks(spans: &[[[u32; 2]; 2]]) -> Vec<std::ops::Range<usize>> {
    let (mut chunks, mut first, mut sum) = (Vec::new(), 0, 0);
    for (i, span) in spans.iter().enumerate() {
        let own = entries(span);
        if i > first && (sum + own > ENTRIES || i - first == STROKES) {
            chunks.push(first..i);
            (first, sum) = (i, 0);
        }
        sum += own;
    }
    if first < spans.len() {
        chunks.push(first..spans.len());
    }
    chunks
}

/// Indexes of the strokes that touch each tile, in their order, and what the dispatches take of them.
pub(super) struct Lists {
    pub(super) entries: Vec<u32>,
    /// Column, row, first entry and number of entries of the tiles of each dispatch; no tile is twice in one.
    pub(super) dispatches: Vec<Vec<[u32; 4]>>,
}

impl Lists {
    /// Sorts by counting; a dispatch gets some `most` entries.
    pub(super) fn new(spans: &[[[u32; 2]; 2]], tiles: [usize; 2], most: usize) -> Self {
        let touched = |[columns, rows]: &[[u32; 2]; 2]| {
            let [columns, rows] = [columns, rows].map(|[first, last]| *first as usize..=*last as usize);
            rows.flat_map(move |row| columns.clone().map(move |column| row * tiles[0] + column))
        };
        let mut ends = vec![0usize; tiles[0] * tiles[1]];
        for tile in spans.iter().flat_map(touched) {
            ends[tile] += 1;
        }
        let mut sum = 0;
        let starts: Vec<usize> = ends
            .iter()
            .map(|count| {
                sum += count;
                sum - count
            })
            .collect();
        ends.copy_from_slice(&starts);
        let mut entries = vec![0u32; sum];
        for (i, span) in spans.iter().enumerate() {
            for tile in touched(span) {
                entries[ends[tile]] = i as u32;
                ends[tile] += 1;
            }
        }
        let mut dispatches = Vec::new();
        for round in 0.. {
            let (mut now, mut work, before) = (Vec::new(), 0, dispatches.len());
            for (tile, (&start, &end)) in starts.iter().zip(&ends).enumerate() {
                let first = start + round * LONGEST;
                if first >= end {
                    continue;
                }
                let count = (end - first).min(LONGEST);
                now.push([(tile % tiles[0]) as u32, (tile / tiles[0]) as u32, first as u32, count as u32]);
                work += count;
                if work >= most {
                    dispatches.push(std::mem::take(&mut now));
                    work = 0;
                }
            }
            if !now.is_empty() {
                dispatches.push(now);
            }
            if dispatches.len() == before {
                break;
            }
        }
        Self { entries, dispatches }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_touched_tile_lists_its_strokes_once_and_in_order() {
        let tiles = [7, 5];
        let spans: Vec<[[u32; 2]; 2]> = (0..3000u32)
            .map(|i| {
                let [x, y] = [i * 7 % 7, i * 11 % 5].map(|first| first.min(6));
                [[x, (x + i % 3).min(6)], [y, (y + i % 2).min(4)]]
            })
            .collect();
        for most in [1, 500, 1 << 20] {
            let lists = Lists::new(&spans, tiles, most);
            let mut found: Vec<Vec<u32>> = vec![Vec::new(); 35];
            for dispatch in &lists.dispatches {
                let distinct: HashSet<[u32; 2]> = dispatch.iter().map(|tile| [tile[0], tile[1]]).collect();
                assert_eq!(distinct.len(), dispatch.len());
                for [column, row, first, count] in dispatch {
                    assert!(*count as usize <= LONGEST);
                    let part = &lists.entries[*first as usize..(*first + *count) as usize];
                    found[(*row * 7 + *column) as usize].extend(part);
                }
            }
            for (tile, found) in found.iter().enumerate() {
                let (column, row) = (tile as u32 % 7, tile as u32 / 7);
                let touches =
                    |s: &[[u32; 2]; 2]| (s[0][0]..=s[0][1]).contains(&column) && (s[1][0]..=s[1][1]).contains(&row);
                let wanted: Vec<u32> = (0..3000).filter(|&i| touches(&spans[i as usize])).collect();
                assert_eq!(found, &wanted);
            }
        }
    }

    #[test]
    fn chunks_hold_no_more_than_the_buffers() {
        assert!(chunks(&[]).is_empty());
        let wide = vec![[[0, 99], [0, 99]]; 1000];
        let parts = chunks(&wide);
        assert!(parts.len() == 3 && parts.iter().all(|part| part.len() * 10_000 <= ENTRIES), "{parts:?}");
        assert_eq!(parts.iter().map(std::iter::ExactSizeIterator::len).sum::<usize>(), 1000);
        assert_eq!(chunks(&vec![[[0, 0], [0, 0]]; STROKES + 1]).len(), 2);
    }
}
