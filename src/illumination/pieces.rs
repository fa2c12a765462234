//! Parts of a leaf that send light of their own strength.

/// Into how many parts a side of an element is cut where light is uneven.
pub(super) const MANY: u8 = 6;
/// Which part of a leaf a sender is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Whole,
    /// A corner's share of a leaf that is cut through.
    Corner(u8),
    /// One of [`PIECES`] equal triangles of a leaf that is lit unevenly.
    Piece(u8),
}

/// Pieces along an edge of a leaf that is lit unevenly: those that stand upright, row by row, then those on their heads.
const ALONG: u8 = 3;
/// Pieces of a leaf that is lit unevenly.
pub(crate) const PIECES: usize = (ALONG * ALONG) as usize;

/// The piece that a place of a leaf lies in, by the weights of its second and third corner.
pub(super) fn piece(u: f64, v: f64) -> u8 {
    let last = f64::from(ALONG - 1);
    let (x, y) = (u * f64::from(ALONG), v * f64::from(ALONG));
    let j = y.floor().clamp(0.0, last);
    let i = x.floor().clamp(0.0, last - j);
    let (x, y, i, j) = (x - i, y - j, i as u8, j as u8);
    if x + y > 1.0 && i + j < ALONG - 1 { upright(ALONG) + row(ALONG - 1, j) + i } else { row(ALONG, j) + i }
}

/// Middles of `n`² equal triangles of a leaf in the order of [`piece`]: weights of its second and third corner.
pub(super) fn middles(n: u8) -> impl Iterator<Item = (f64, f64)> {
    let part = 1.0 / f64::from(3 * u32::from(n));
    // Those that stand upright, and those between them that stand on their heads.
    let middles = move |third: u8, rows: u8| {
        let at = move |k: u8| f64::from(3 * u32::from(k) + u32::from(third)) * part;
        (0..rows).flat_map(move |j| (0..rows - j).map(move |i| (at(i), at(j))))
    };
    middles(1, n).chain(middles(2, n - 1))
}

/// Weights of a leaf's second and third corner at a place of a piece, which is given by those of the piece's own.
pub(super) fn in_piece(k: u8, u: f64, v: f64) -> (f64, f64) {
    let n = f64::from(ALONG);
    let (i, j) = middles(ALONG).nth(usize::from(k)).map_or((0.0, 0.0), |(i, j)| ((i * n).floor(), (j * n).floor()));
    if k < upright(ALONG) { ((i + u) / n, (j + v) / n) } else { ((i + 1.0 - u) / n, (j + 1.0 - v) / n) }
}

impl Part {
    /// How much each of the leaf's corners counts in its mean.
    pub(crate) fn weights(self) -> [f32; 3] {
        match self {
            Self::Whole => [1.0 / 3.0; 3],
            Self::Corner(k) => std::array::from_fn(|c| if c == usize::from(k) { 1.0 } else { 0.0 }),
            Self::Piece(k) => {
                let (u, v) = middles(ALONG).nth(usize::from(k)).unwrap_or((1.0 / 3.0, 1.0 / 3.0));
                [1.0 - u - v, u, v].map(|w| w as f32)
            }
        }
    }

    /// Its share of the leaf's area.
    pub(crate) fn share(self) -> f64 {
        match self {
            Self::Whole => 1.0,
            Self::Corner(_) => 1.0 / 3.0,
            Self::Piece(_) => 1.0 / PIECES as f64,
        }
    }
}

/// Upright pieces in `n` rows, and those before row `j` of them.
const fn upright(n: u8) -> u8 {
    n * (n + 1) / 2
}

const fn row(n: u8, j: u8) -> u8 {
    j * n - j * j.saturating_sub(1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_equal_and_found_by_their_middles() {
        for (number, (u, v)) in middles(ALONG).enumerate() {
            assert_eq!(usize::from(piece(u, v)), number);
            let [a, b, c] = Part::Piece(number as u8).weights();
            assert!(
                (a + b + c - 1.0).abs() < 1e-6 && (f64::from(b) - u).abs() < 1e-6 && (f64::from(c) - v).abs() < 1e-6
            );
        }
        // Places in a piece lie in it.
        for k in 0..PIECES as u8 {
            assert!(
                middles(4).all(|(u, v)| {
                    let (u, v) = in_piece(k, u, v);
                    piece(u, v) == k
                }),
                "{k}"
            );
        }
        // Each holds as many of the finer places; corners and edges belong to some piece.
        let mut counts = [0; PIECES];
        middles(MANY).for_each(|(u, v)| counts[usize::from(piece(u, v))] += 1);
        assert_eq!(counts, [4; PIECES]);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1.0 / 3.0, 2.0 / 3.0), (-1e-9, 1.0 + 1e-9)] {
            assert!(usize::from(piece(u, v)) < PIECES);
        }
    }
}
