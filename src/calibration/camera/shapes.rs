//! Smooth functions over a panel: products of Legendre polynomials, and curves of a level.

/// Products P_k(x)·P_l(y) of Legendre polynomials on −1 … 1 along both axes, of total degree at most `degree`; those of
/// total degree below `from` are left out.
#[derive(Clone, Debug)]
pub(super) struct Products {
    /// Degrees k, l.
    pub(super) terms: Vec<[usize; 2]>,
    degree: usize,
}

impl Products {
    pub(super) fn new(from: usize, degree: usize) -> Self {
        let terms = (from..=degree).flat_map(|d| (0..=d).map(move |l| [d - l, l])).collect();
        Self { terms, degree }
    }

    pub(super) fn len(&self) -> usize {
        self.terms.len()
    }

    /// Values of all at a place.
    pub(super) fn values(&self, x: f64, y: f64) -> Vec<f64> {
        let (px, py) = (legendre(self.degree, x), legendre(self.degree, y));
        self.terms.iter().map(|[k, l]| px[*k] * py[*l]).collect()
    }

    /// Σ c·P at a place.
    pub(super) fn sum(&self, coefficients: &[f64], x: f64, y: f64) -> f64 {
        self.values(x, y).iter().zip(coefficients).map(|(p, c)| p * c).sum()
    }

    /// On a row y: factors of P_k(x), k = 0 … degree.
    pub(super) fn row(&self, coefficients: &[f64], y: f64) -> Vec<f32> {
        let py = legendre(self.degree, y);
        let mut out = vec![0.0; self.degree + 1];
        for ([k, l], c) in self.terms.iter().zip(coefficients) {
            out[*k] += c * py[*l];
        }
        out.iter().map(|v| *v as f32).collect()
    }
}

/// P_0 … P_degree at x.
pub(super) fn legendre(degree: usize, x: f64) -> Vec<f64> {
    let mut out = vec![1.0, x];
    for n in 1..degree.max(1) {
        let n_ = n as f64;
        out.push(((2.0 * n_ + 1.0) * x * out[n] - n_ * out[n - 1]) / (n_ + 1.0));
    }
    out.truncate(degree + 1);
    out
}

/// P_0 … P_degree at each of `count` pixels of an axis, from −1 at the first border to 1 at the last.
pub(super) fn legendre_lines(degree: usize, count: usize) -> Vec<Vec<f32>> {
    let all: Vec<Vec<f64>> = (0..count).map(|i| legendre(degree, place(i as f64, count))).collect();
    (0..=degree).map(|k| all.iter().map(|p| p[k] as f32).collect()).collect()
}

/// A pixel's place between the panel's borders, −1 … 1.
pub(super) fn place(index: f64, count: usize) -> f64 {
    (2.0 * index + 1.0) / count as f64 - 1.0
}

/// Functions of a level, 0 at level 0: shifted Legendre polynomials P_m(2l − 1) − P_m(−1), m = 1 … `degree`, of l from 0 at
/// the lowest level to 1 at the highest.
pub(super) fn level_shapes(degree: usize, levels: usize) -> Vec<Vec<f64>> {
    (0..levels)
        .map(|level| {
            let p = legendre(degree, 2.0 * level as f64 / (levels.max(2) - 1) as f64 - 1.0);
            (1..=degree).map(|m| p[m] - if m.is_multiple_of(2) { 1.0 } else { -1.0 }).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_legendres() {
        let x: f64 = 0.37;
        let p = legendre(4, x);
        assert!((p[2] - (1.5 * x * x - 0.5)).abs() < 1e-14);
        assert!((p[4] - (35.0 * x.powi(4) - 30.0 * x * x + 3.0) / 8.0).abs() < 1e-14);
        let products = Products::new(2, 3);
        assert_eq!(products.len(), 7);
        let c = [0.3, -1.0, 0.2, 2.0, 0.1, 0.7, -0.4];
        let row = products.row(&c, -0.2);
        let along: f64 = row.iter().zip(legendre(3, x)).map(|(a, p)| f64::from(*a) * p).sum();
        assert!((along - products.sum(&c, x, -0.2)).abs() < 1e-6);
        assert!(level_shapes(5, 256)[0].iter().all(|v| v.abs() < 1e-14));
    }
}
