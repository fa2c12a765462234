//! A scan of a card, laid over the card: its marks are found, whatever scale, turn and side the scan has, and say where each
//! of the card's pixels is in it.

use super::card::Card;
use crate::error::{Error, Result};
use std::path::Path;

/// A scan's light.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Light of each pixel, row-major, 0 to 1.
    pub(super) light: Vec<f32>,
}

/// A connected area of pixels on one side of the threshold.
#[derive(Clone, Copy, Debug, Default)]
struct Area {
    pixels: f64,
    x: f64,
    y: f64,
    low: [usize; 2],
    high: [usize; 2],
}

impl Area {
    fn middle(&self) -> [f64; 2] {
        [self.x / self.pixels, self.y / self.pixels]
    }
}

/// Pixels of a mark's inner square at least.
const SMALLEST: f64 = 25.0;
/// Marks that are tried at most: their triples are.
const MOST: usize = 14;

/// Where a pixel of the card is in the scan: scan = matrix · card + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Registration {
    matrix: [[f64; 2]; 2],
    offset: [f64; 2],
    /// How far marks are from where they should be, RMS [scan px].
    pub(super) residual: f64,
}

impl Registration {
    /// The place in the scan of a place on the card.
    pub(super) fn scan_from_card(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| self.matrix[i][0] * x + self.matrix[i][1] * y + self.offset[i])
    }
    /// The place on the card of a place in the scan.
    pub(super) fn card_from_scan(&self, at: [f64; 2]) -> [f64; 2] {
        let [[a, b], [c, d]] = self.matrix;
        let [x, y] = [at[0] - self.offset[0], at[1] - self.offset[1]];
        let whole = self.determinant();
        [(d * x - b * y) / whole, (a * y - c * x) / whole]
    }
    fn determinant(&self) -> f64 {
        let [[a, b], [c, d]] = self.matrix;
        a * d - b * c
    }
    /// Whether the scan shows the card from behind.
    pub(super) fn mirrored(&self) -> bool {
        self.determinant() < 0.0
    }
    /// Pixels of the scan for one of the card.
    pub(super) fn scale(&self) -> f64 {
        self.determinant().abs().sqrt()
    }
    /// Angle by which the card's rows are turned in the scan [rad].
    pub(super) fn rotation(&self) -> f64 {
        self.matrix[1][0].atan2(self.matrix[0][0])
    }

    /// The one that takes three places to three others.
    fn of_three(from: [[f64; 2]; 3], to: [[f64; 2]; 3]) -> Option<Self> {
        let side = |places: [[f64; 2]; 3], i: usize| [places[i][0] - places[0][0], places[i][1] - places[0][1]];
        let ([u, v], [p, q]) = ([side(from, 1), side(from, 2)], [side(to, 1), side(to, 2)]);
        let whole = u[0] * v[1] - u[1] * v[0];
        if whole.abs() < 1e-9 {
            return None;
        }
        let row = |i: usize| [(p[i] * v[1] - q[i] * u[1]) / whole, (q[i] * u[0] - p[i] * v[0]) / whole];
        let matrix = [row(0), row(1)];
        let offset = [0, 1].map(|i| to[0][i] - matrix[i][0] * from[0][0] - matrix[i][1] * from[0][1]);
        Some(Self { matrix, offset, residual: 0.0 })
    }

    /// Whether it turns and scales evenly: a scanner's two directions differ by a few per cent at most.
    fn is_even(&self) -> bool {
        let [[a, b], [c, d]] = self.matrix;
        let (along, down) = (a.hypot(c), b.hypot(d));
        let skew = (a * b + c * d).abs() / (along * down).max(1e-12);
        (along / down.max(1e-12) - 1.0).abs() < 0.1 && skew < 0.05 && self.scale() > 1e-6
    }

    /// The best one in the sense of least squares.
    fn fit(from: &[[f64; 2]; 5], to: &[[f64; 2]; 5]) -> Self {
        let mean = |places: &[[f64; 2]; 5], i: usize| places.iter().map(|p| p[i]).sum::<f64>() / 5.0;
        let (f, t) = ([mean(from, 0), mean(from, 1)], [mean(to, 0), mean(to, 1)]);
        let sum = |g: &dyn Fn(usize) -> f64| (0..5).map(g).sum::<f64>();
        let xx = sum(&|k| (from[k][0] - f[0]).powi(2));
        let yy = sum(&|k| (from[k][1] - f[1]).powi(2));
        let xy = sum(&|k| (from[k][0] - f[0]) * (from[k][1] - f[1]));
        let whole = xx * yy - xy * xy;
        let row = |i: usize| {
            let x = sum(&|k| (from[k][0] - f[0]) * (to[k][i] - t[i]));
            let y = sum(&|k| (from[k][1] - f[1]) * (to[k][i] - t[i]));
            [(x * yy - y * xy) / whole, (y * xx - x * xy) / whole]
        };
        let matrix = [row(0), row(1)];
        let offset = [0, 1].map(|i| t[i] - matrix[i][0] * f[0] - matrix[i][1] * f[1]);
        let mut out = Self { matrix, offset, residual: 0.0 };
        let far = |k: usize| {
            let at = out.scan_from_card(from[k]);
            (at[0] - to[k][0]).powi(2) + (at[1] - to[k][1]).powi(2)
        };
        out.residual = (sum(&far) / 5.0).sqrt();
        out
    }
}

/// Lays a scan over its card.
///
/// # Errors
/// [`Error::Input`] where fewer than five marks are found, or where they do not lie as on the card.
pub(super) fn register(scan: &Scan, card: &Card, path: &Path) -> Result<Registration> {
    let mut found = marks(scan);
    if found.len() < 5 {
        let what = format!(
            "shows {} of the card's five marks; scan all of the card, with some room around it, in focus and not clipped",
            found.len()
        );
        return Err(Error::input(path, what));
    }
    // Marks are of one size; what else looks like one is not.
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let usual = found[found.len() / 2].1;
    found.sort_by(|a, b| (a.1 / usual).ln().abs().total_cmp(&(b.1 / usual).ln().abs()));
    let places: Vec<[f64; 2]> = found.iter().take(MOST).map(|mark| mark.0).collect();
    let wanted = card.marks();
    let mut best: Option<Registration> = None;
    for (i, &a) in places.iter().enumerate() {
        for (j, &b) in places.iter().enumerate().filter(|(j, _)| *j != i) {
            for (_, &c) in places.iter().enumerate().filter(|(k, _)| *k != i && *k != j) {
                let first = Registration::of_three([wanted[0], wanted[1], wanted[2]], [a, b, c]);
                let Some(first) = first.filter(Registration::is_even) else { continue };
                let near = first.scale() * card.side as f64;
                let nearest = |mark: [f64; 2]| {
                    let at = first.scan_from_card(mark);
                    let far = |place: &&[f64; 2]| (place[0] - at[0]).hypot(place[1] - at[1]);
                    places.iter().min_by(|p, q| far(p).total_cmp(&far(q))).filter(|p| far(p) < near)
                };
                let (Some(&d), Some(&e)) = (nearest(wanted[3]), nearest(wanted[4])) else { continue };
                let fitted = Registration::fit(&wanted, &[a, b, c, d, e]);
                if best.is_none_or(|best| fitted.residual < best.residual) {
                    best = Some(fitted);
                }
            }
        }
    }
    let most = |fitted: &Registration| 0.1 * fitted.scale() * card.side as f64;
    best.filter(|fitted| fitted.residual <= most(fitted)).ok_or_else(|| {
        Error::input(
            path,
            "its marks do not lie as on this card; was it made for another plate, or is the scan distorted?",
        )
    })
}

/// Middles of marks with the area of their inner squares.
fn marks(scan: &Scan) -> Vec<([f64; 2], f64)> {
    let (width, height) = (scan.width, scan.height);
    let bright = thresholded(scan);
    let (labels, areas) = connected(&bright, width, height);
    let label = |x: f64, y: f64| {
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < width && (y as usize) < height;
        inside.then(|| labels[y as usize * width + x as usize] as usize)
    };
    let mut out = Vec::new();
    for (own, area) in areas.iter().enumerate() {
        let [w, h] = [0, 1].map(|i| (area.high[i] - area.low[i] + 1) as f64);
        let square = (0.75..1.34).contains(&(w / h)) && area.pixels / (w * h) > 0.55;
        if area.pixels < SMALLEST || !square {
            continue;
        }
        let middle = area.middle();
        let module = area.pixels.sqrt() / 3.0;
        // Rings of 5 and 7 modules around a square of 3: 16 and 24 square modules beside its 9.
        let ring = |at: f64, modules: f64| {
            let around = label(middle[0] + at * module, middle[1]).filter(|&ring| ring != own)?;
            let ring = &areas[around];
            let [x, y] = ring.middle();
            let (same, share) = ((x - middle[0]).hypot(y - middle[1]) < module, ring.pixels / area.pixels);
            (same && (0.55..1.6).contains(&(share / modules * 9.0))).then_some(ring.middle())
        };
        if let (Some(a), Some(b)) = (ring(2.0, 16.0), ring(3.0, 24.0)) {
            let mean = |i: usize| (middle[i] + a[i] + b[i]) / 3.0;
            // Middles of pixels stand half a pixel from their edges.
            out.push(([mean(0) + 0.5, mean(1) + 0.5], area.pixels));
        }
    }
    out
}

/// Whether each pixel, smoothed over its neighbours, is on the brighter side of the scan's middle.
fn thresholded(scan: &Scan) -> Vec<bool> {
    let (width, height) = (scan.width, scan.height);
    let mut sample: Vec<f32> = scan.light.iter().copied().step_by((scan.light.len() / 100_000).max(1)).collect();
    sample.sort_by(f32::total_cmp);
    let at = |share: f64| sample[((sample.len() - 1) as f64 * share) as usize];
    let middle = 0.5 * (at(0.02) + at(0.98));
    let mut out = vec![false; width * height];
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = (0.0, 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for light in &scan.light[row * width + x.saturating_sub(1)..row * width + (x + 2).min(width)] {
                    (sum, count) = (sum + light, count + 1.0);
                }
            }
            out[y * width + x] = sum > middle * count;
        }
    }
    out
}

/// Areas of pixels that touch with an edge and are alike, and which each pixel belongs to.
fn connected(bright: &[bool], width: usize, height: usize) -> (Vec<u32>, Vec<Area>) {
    let mut labels = vec![u32::MAX; bright.len()];
    let mut areas = Vec::new();
    let mut open = Vec::new();
    for start in 0..bright.len() {
        if labels[start] != u32::MAX {
            continue;
        }
        let label = areas.len() as u32;
        let mut area = Area { low: [width, height], ..Area::default() };
        labels[start] = label;
        open.push(start);
        while let Some(at) = open.pop() {
            let (x, y) = (at % width, at / width);
            area.pixels += 1.0;
            area.x += x as f64;
            area.y += y as f64;
            area.low = [area.low[0].min(x), area.low[1].min(y)];
            area.high = [area.high[0].max(x), area.high[1].max(y)];
            let beside = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for next in beside.into_iter().flatten() {
                if labels[next] == u32::MAX && bright[next] == bright[start] {
                    labels[next] = label;
                    open.push(next);
                }
            }
        }
        areas.push(area);
    }
    (labels, areas)
}
