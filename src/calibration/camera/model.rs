//! What a camera behind a lens sees of a panel, and how it changes with each number of the panel and the bench.

use super::mapping::{MAPPING, Mapping};
use super::panel_light::{CURVE, PanelLight};
use super::shapes::Products;
use super::zoom::{Place, Zoom};
use crate::field::{Complex32, Complex64};
use crate::panel::simulated::sinc;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::ops::Range;

/// Places on a camera's pixel whose mean is its integral: Gauss's, right for cubics.
const ON_PIXEL: [[f64; 2]; 4] = [[-A, -A], [A, -A], [-A, A], [A, A]];
const A: f64 = 0.288_675_134_594_812_9;

/// Where each group of numbers stands.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) source: Range<usize>,
    pub(super) wave: Range<usize>,
    pub(super) curve: Range<usize>,
    pub(super) crosstalk: usize,
    /// Real and imaginary part of the unmodulated light's amplitude against the modulated.
    pub(super) unmodulated: Range<usize>,
    pub(super) mapping: Range<usize>,
    /// Logarithm of the scale, and background, of each photo.
    pub(super) exposure: Range<usize>,
}

impl Layout {
    fn new(light: &PanelLight, photos: usize) -> Self {
        let mut at = 0;
        let mut take = |count: usize| {
            at += count;
            at - count..at
        };
        let source = take(light.source.len());
        let wave = take(light.wave.len());
        let curve = take(CURVE * light.over.len());
        let crosstalk = take(1).start;
        Self {
            source,
            wave,
            curve,
            crosstalk,
            unmodulated: take(2),
            mapping: take(MAPPING),
            exposure: take(2 * photos),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.exposure.end
    }
}

/// A photo at the pixels that are looked at.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    /// Levels that the panel showed.
    pub(super) levels: Vec<u16>,
    /// Brightness of the pixels, 1 about the mean.
    pub(super) values: Vec<f32>,
    /// One over the standard deviation of each; 0 for a pixel that does not count.
    pub(super) weights: Vec<f32>,
}

/// The model of one bench.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) light: PanelLight,
    pub(super) zoom: Zoom,
    pub(super) layout: Layout,
    size: [usize; 2],
    /// Pixels that are looked at: column, row.
    pub(super) pixels: Vec<[u16; 2]>,
    carriers: [Vec<Complex32>; 2],
    /// Products up to the wavefront's degree at the lattice's samples.
    lattice: Vec<Vec<f32>>,
    all: Products,
}

/// What does not depend on the photo.
pub(super) struct Lit {
    incident: Vec<Complex32>,
    places: Vec<Option<(Place, f32)>>,
    /// Sums of the incident wave at the places.
    still: Vec<Complex32>,
}

impl Model {
    pub(super) fn new(light: PanelLight, zoom: Zoom, size: [usize; 2], pixels: Vec<[u16; 2]>, photos: usize) -> Self {
        let layout = Layout::new(&light, photos);
        let all = Products::new(0, super::panel_light::WAVE_DEGREE);
        let [nx, ny] = zoom.counts();
        let at = |axis: usize, j: usize, size: usize| 2.0 * zoom.position(axis, j) / size as f64;
        let mut lattice = vec![Vec::with_capacity(nx * ny); all.len()];
        for j in 0..ny {
            for i in 0..nx {
                let values = all.values(at(0, i, light.width), at(1, j, light.height));
                lattice.iter_mut().zip(values).for_each(|(out, v)| out.push(v as f32));
            }
        }
        let carriers = [zoom.carrier(0), zoom.carrier(1)];
        Self { light, zoom, layout, size, pixels, carriers, lattice, all }
    }

    pub(super) fn mapping(&self, values: &[f64]) -> Mapping {
        let mut mapping = Mapping::square(self.size, 1.0);
        mapping.values.copy_from_slice(&values[self.layout.mapping.clone()]);
        mapping
    }

    /// The incident wave with its carrier.
    pub(super) fn incident(&self, values: &[f64]) -> Vec<Complex32> {
        let l = &self.layout;
        let (source, wave) = (&values[l.source.clone()], &values[l.wave.clone()]);
        self.light.incident(source, wave, [&self.carriers[0], &self.carriers[1]])
    }

    pub(super) fn lit(&self, values: &[f64]) -> Lit {
        let incident = self.incident(values);
        let mapping = self.mapping(values);
        let places: Vec<_> = self
            .pixels
            .par_iter()
            .flat_map_iter(|&[column, row]| {
                let at = [f64::from(column), f64::from(row)];
                let mapping = &mapping;
                ON_PIXEL.iter().map(move |offset| {
                    let nu = mapping.frequency([at[0] + offset[0], at[1] + offset[1]]);
                    let (place, gain) = self.zoom.place(nu)?;
                    Some((place, (gain * sinc(nu[0]) * sinc(nu[1])) as f32))
                })
            })
            .collect();
        let still = self.sampled(&self.zoom.gather(&incident), |_, _| Complex32::new(1.0, 0.0), &places);
        Lit { incident, places, still }
    }

    /// Sums of a lattice times a factor at the places.
    fn sampled(
        &self,
        lattice: &[Complex32],
        factor: impl Fn(usize, usize) -> Complex32 + Sync,
        places: &[Option<(Place, f32)>],
    ) -> Vec<Complex32> {
        let plane = self.zoom.transform(lattice, factor);
        places
            .par_iter()
            .with_min_len(4096)
            .map(|place| match place {
                Some((place, gain)) => self.zoom.sample(&plane, place) * *gain,
                None => Complex32::new(0.0, 0.0),
            })
            .collect()
    }

    fn unmodulated(&self, values: &[f64]) -> Complex32 {
        let at = self.layout.unmodulated.start;
        Complex32::new(values[at] as f32, values[at + 1] as f32)
    }

    /// The panel's modulated light with the carrier: before the incident wave, and with it.
    pub(super) fn modulated(
        &self,
        values: &[f64],
        incident: &[Complex32],
        levels: &[u16],
        crosstalk: f64,
    ) -> Vec<Complex32> {
        let phases = self.light.phases(&values[self.layout.curve.clone()], levels);
        let mut out = self.light.blended(&phases, crosstalk);
        out.par_iter_mut().zip(incident).for_each(|(u, a)| *u *= a);
        out
    }

    /// Brightness that the camera's pixels should have in photo `p`.
    pub(super) fn predicted(&self, values: &[f64], lit: &Lit, p: usize, photo: &Seen) -> Vec<f32> {
        let modulated = self.modulated(values, &lit.incident, &photo.levels, values[self.layout.crosstalk]);
        let lattice = self.zoom.gather(&modulated);
        let sums = self.sampled(&lattice, |_, _| Complex32::new(1.0, 0.0), &lit.places);
        let still = self.unmodulated(values);
        let fields: Vec<Complex32> = sums.iter().zip(&lit.still).map(|(u, a)| u + a * still).collect();
        self.brightness(values, p, &fields)
    }

    fn brightness(&self, values: &[f64], p: usize, fields: &[Complex32]) -> Vec<f32> {
        let [scale, background] = self.exposure(values, p);
        fields
            .chunks_exact(4)
            .map(|four| scale * 0.25 * four.iter().map(|u| u.norm_sqr()).sum::<f32>() + background)
            .collect()
    }

    fn exposure(&self, values: &[f64], p: usize) -> [f32; 2] {
        let at = self.layout.exposure.start + 2 * p;
        [values[at].exp() as f32, values[at + 1] as f32]
    }

    /// Brightness in photo `p`, and its derivative after each number that is `free`, in their order.
    pub(super) fn slopes(
        &self,
        values: &[f64],
        lit: &Lit,
        p: usize,
        photo: &Seen,
        free: &[usize],
    ) -> (Vec<f32>, Vec<Vec<f32>>) {
        let (l, one) = (&self.layout, Complex32::new(1.0, 0.0));
        let crosstalk = values[l.crosstalk];
        let modulated = self.modulated(values, &lit.incident, &photo.levels, crosstalk);
        let lattice = self.zoom.gather(&modulated);
        let sums = self.sampled(&lattice, |_, _| one, &lit.places);
        let still = self.unmodulated(values);
        let fields: Vec<Complex32> = sums.iter().zip(&lit.still).map(|(u, a)| u + a * still).collect();
        let scale = self.exposure(values, p)[0];
        // 2·Re(U*·V) over the pixel.
        let turn = |derivative: &[Complex32], by: Complex32| -> Vec<f32> {
            let pairs = fields.chunks_exact(4).zip(derivative.chunks_exact(4));
            pairs
                .map(|(u, v)| 0.5 * scale * u.iter().zip(v).map(|(u, v)| (u.conj() * v * by).re).sum::<f32>())
                .collect()
        };
        let mut columns: Vec<Option<Vec<f32>>> = vec![None; l.count()];
        let wants = |i: usize| free.contains(&i);
        // All light, for what acts on source and wavefront.
        let incident = self.zoom.gather(&lit.incident);
        let total: Vec<Complex32> = lattice.iter().zip(&incident).map(|(u, a)| u + a * still).collect();
        let [nx, _] = self.zoom.counts();
        let term =
            |products: &Products, t: usize| self.all.terms.iter().position(|x| *x == products.terms[t]).unwrap_or(0);
        let mut after: Vec<(usize, Option<usize>, Option<usize>)> =
            (0..self.all.len()).map(|t| (t, None, None)).collect();
        for t in 0..l.source.len() {
            after[term(&self.light.source, t)].1 = Some(l.source.start + t).filter(|&i| wants(i));
        }
        for t in 0..l.wave.len() {
            after[term(&self.light.wave, t)].2 = Some(l.wave.start + t).filter(|&i| wants(i));
        }
        let imaginary = Complex32::new(0.0, 1.0);
        let tilts = [1usize, 2];
        let maps = l.mapping.clone().any(wants);
        let made: Vec<(usize, Vec<Complex32>)> = after
            .par_iter()
            .filter(|(t, s, w)| s.is_some() || w.is_some() || (maps && tilts.contains(t)))
            .map(|(t, ..)| {
                let weight = &self.lattice[*t];
                (*t, self.sampled(&total, |i, j| Complex32::new(weight[j * nx + i], 0.0), &lit.places))
            })
            .collect();
        for (t, sums) in &made {
            if let Some(i) = after[*t].1 {
                columns[i] = Some(turn(sums, one));
            }
            if let Some(i) = after[*t].2 {
                columns[i] = Some(turn(sums, imaginary));
            }
        }
        if maps {
            // ∂U/∂ν = −i2π·Σ n·u·exp(…), n = x·width/2.
            let sides = [self.light.width, self.light.height];
            let along: Vec<Vec<Complex32>> = (0..2)
                .map(|axis| {
                    let factor = (-TAU * 0.5 * sides[axis] as f64) as f32 * imaginary;
                    let sums = made.iter().find(|(t, _)| *t == tilts[axis]).map(|(_, sums)| sums);
                    sums.into_iter().flatten().map(|u| u * factor).collect()
                })
                .collect();
            self.mapping_slopes(values, &fields, &along, scale, &mut columns);
        }
        let terms = self.light.over.len();
        for m in (0..CURVE).filter(|m| (0..terms).any(|t| wants(l.curve.start + m * terms + t))) {
            let shape = self.light.shape(m, &photo.levels, crosstalk);
            let turned: Vec<Complex32> = modulated.par_iter().zip(&shape).map(|(u, s)| u * imaginary * s).collect();
            let lattice = self.zoom.gather(&turned);
            let found: Vec<(usize, Vec<f32>)> = (0..terms)
                .into_par_iter()
                .filter(|t| wants(l.curve.start + m * terms + t))
                .map(|t| {
                    let weight = &self.lattice[term(&self.light.over, t)];
                    let sums = self.sampled(&lattice, |i, j| Complex32::new(weight[j * nx + i], 0.0), &lit.places);
                    (l.curve.start + m * terms + t, turn(&sums, one))
                })
                .collect();
            found.into_iter().for_each(|(i, column)| columns[i] = Some(column));
        }
        if wants(l.crosstalk) {
            let step = 0.02;
            let moved = self.modulated(values, &lit.incident, &photo.levels, crosstalk + step);
            let sums_moved = self.sampled(&self.zoom.gather(&moved), |_, _| one, &lit.places);
            let slope: Vec<Complex32> = sums_moved.iter().zip(&sums).map(|(a, b)| (a - b) / step as f32).collect();
            columns[l.crosstalk] = Some(turn(&slope, one));
        }
        columns[l.unmodulated.start] = Some(turn(&lit.still, one));
        columns[l.unmodulated.start + 1] = Some(turn(&lit.still, imaginary));
        let brightness = self.brightness(values, p, &fields);
        let background = self.exposure(values, p)[1];
        let at = l.exposure.start + 2 * p;
        columns[at] = Some(brightness.iter().map(|b| b - background).collect());
        columns[at + 1] = Some(vec![1.0; brightness.len()]);
        let columns = free.iter().map(|&i| columns[i].take().unwrap_or_default()).collect();
        (brightness, columns)
    }

    fn mapping_slopes(
        &self,
        values: &[f64],
        fields: &[Complex32],
        along: &[Vec<Complex32>],
        scale: f32,
        columns: &mut [Option<Vec<f32>>],
    ) {
        let mapping = self.mapping(values);
        let start = self.layout.mapping.start;
        let mut out = vec![vec![0.0f32; self.pixels.len()]; MAPPING];
        for (k, pixel) in self.pixels.iter().enumerate() {
            for (s, offset) in ON_PIXEL.iter().enumerate() {
                let at = [f64::from(pixel[0]) + offset[0], f64::from(pixel[1]) + offset[1]];
                let (_, slopes) = mapping.with_slopes(at);
                let i = 4 * k + s;
                let after = [0, 1].map(|axis| 0.5 * scale * (fields[i].conj() * along[axis][i]).re);
                for (n, out) in out.iter_mut().enumerate() {
                    out[k] += after[0] * slopes[0][n] as f32 + after[1] * slopes[1][n] as f32;
                }
            }
        }
        out.into_iter().enumerate().for_each(|(n, column)| columns[start + n] = Some(column));
    }

    /// The unmodulated light's amplitude against the modulated.
    pub(super) fn share(&self, values: &[f64]) -> Complex64 {
        let at = self.layout.unmodulated.start;
        Complex64::new(values[at], values[at + 1])
    }
}
