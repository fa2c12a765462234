//! Far points at single places: the definition's far form with its cross term, many points at a time.
//!
//! Plain loops, compiled to vectors of the instruction sets there are. Paths are in double precision. Taper and wave are too
//! in [`Waves::add`], which gives the oracle's values to 1e-10, and in single precision in [`Waves::add_quickly`], which gives
//! them to [`QUICK`] of the points' power and is what a measurement needs.

use super::real::{Real, exp_minus, fused, least, most, product, round, turned};
use crate::field::Complex64;
use crate::hologram::Cull;
use crate::hologram::definition::{Optics, Weideman};
use crate::hologram::sources::PointWave;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Points of a batch: as columns they stay in the nearest cache.
pub(super) const BATCH: usize = 512;

/// Points of a block, which is left out where it is dark, and whose edge is where it is flat: a whole number of vectors.
const BLOCK: usize = 16;

/// Error of the quick sum over the points' power.
pub(super) const QUICK: f64 = 5e-6;

/// What is the same for all points.
pub(super) struct Waves {
    cull: Cull,
    wavelength: f64,
    inverse: f64,
    /// b·λ and 1/(s·λ): the taper by the sine of the angle.
    middle: [f64; 2],
    steepness: [f64; 2],
    /// q·r on the axis.
    blur: [f64; 2],
    /// Slope of the cone, for the hard cut.
    cone: [f64; 2],
    /// s·λ.
    width: [f64; 2],
}

/// Points by columns, filled up with dark ones.
struct Batch {
    count: usize,
    x: [f64; BATCH],
    y: [f64; BATCH],
    distance: [f64; BATCH],
    sign: [f64; BATCH],
    amplitude: [f64; BATCH],
    turns: [f64; BATCH],
}

impl Batch {
    fn new(points: &[PointWave]) -> Self {
        let none = [0.0; BATCH];
        let mut batch = Self {
            count: points.len(),
            x: [points.first().map_or(0.0, |p| p.x); BATCH],
            y: [points.first().map_or(0.0, |p| p.y); BATCH],
            distance: [1.0; BATCH],
            sign: [1.0; BATCH],
            amplitude: none,
            turns: none,
        };
        for (i, p) in points.iter().enumerate() {
            (batch.x[i], batch.y[i], batch.distance[i]) = (p.x, p.y, p.distance);
            (batch.sign[i], batch.amplitude[i], batch.turns[i]) = (p.sign, p.amplitude, p.turns);
        }
        batch
    }
}

impl Waves {
    pub(super) fn new(optics: &Optics, cull: Cull) -> Self {
        let taper = optics.taper;
        let width = taper.map(|taper| taper.width * optics.wavelength);
        Self {
            cull,
            wavelength: optics.wavelength,
            inverse: 1.0 / optics.wavelength,
            middle: taper.map(|taper| taper.middle * optics.wavelength),
            steepness: width.map(|width| 1.0 / width),
            blur: taper.map(|taper| 1.0 / (PI * optics.wavelength * taper.width * taper.width)),
            cone: [0, 1].map(|axis| optics.cone(axis, 1.0)),
            width,
        }
    }

    /// Adds the field of at most [`BATCH`] points at places [m] to their sums, in double precision.
    pub(super) fn add(&self, points: &[PointWave], places: &[[f64; 2]], sums: &mut [Complex64]) {
        // To 8e-11 where |arg z| ≤ π/4.
        static SERIES: LazyLock<Weideman<24>> = LazyLock::new(Weideman::new);
        let series = Series { scale: SERIES.scale, terms: SERIES.terms };
        Job { waves: self, batch: &Batch::new(points), series, places }.run(sums);
    }

    /// As [`Waves::add`], taper and wave in single precision.
    pub(super) fn add_quickly(&self, points: &[PointWave], places: &[[f64; 2]], sums: &mut [Complex64]) {
        // To 4.4e-6.
        static SERIES: LazyLock<Weideman<12>> = LazyLock::new(Weideman::new);
        let series = Series { scale: SERIES.scale as f32, terms: SERIES.terms.map(|term| term as f32) };
        Job { waves: self, batch: &Batch::new(points), series, places }.run(sums);
    }
}

/// The error function's rational series.
struct Series<T, const N: usize> {
    scale: T,
    terms: [T; N],
}

/// A batch of points whose field is wanted at places.
struct Job<'a, T, const N: usize> {
    waves: &'a Waves,
    batch: &'a Batch,
    series: Series<T, N>,
    places: &'a [[f64; 2]],
}

impl<T: Real, const N: usize> Job<'_, T, N> {
    /// Adds the field to the places' sums, by the widest instruction set.
    fn run(&self, sums: &mut [Complex64]) {
        #[cfg(target_arch = "x86_64")]
        {
            let fma = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            let wide = is_x86_feature_detected!("avx512dq") && is_x86_feature_detected!("avx512vl");
            if is_x86_feature_detected!("avx512f") && wide && fma {
                // SAFETY: the features were detected.
                return unsafe { avx512(self, sums) };
            }
            if fma {
                // SAFETY: the features were detected.
                return unsafe { avx2(self, sums) };
            }
        }
        add::<T, N, false>(self, sums);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
unsafe fn avx512<T: Real, const N: usize>(job: &Job<T, N>, sums: &mut [Complex64]) {
    add::<T, N, true>(job, sums);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2<T: Real, const N: usize>(job: &Job<T, N>, sums: &mut [Complex64]) {
    add::<T, N, true>(job, sums);
}

/// A value for each point of a block.
type Lanes<T> = [T; BLOCK];

/// Complex values of a block.
struct Pair<T> {
    re: Lanes<T>,
    im: Lanes<T>,
}

impl<T: Real> Pair<T> {
    const ZERO: Self = Self { re: [T::ZERO; BLOCK], im: [T::ZERO; BLOCK] };
}

#[inline(always)]
fn add<T: Real, const N: usize, const FMA: bool>(job: &Job<T, N>, sums: &mut [Complex64]) {
    let Job { waves, batch, series, places } = job;
    for (at, sum) in places.iter().zip(sums) {
        let mut total = Pair::<T>::ZERO;
        for start in (0..batch.count).step_by(BLOCK) {
            let (x, y) = (&batch.x[start..start + BLOCK], &batch.y[start..start + BLOCK]);
            let (z, turns) = (&batch.distance[start..start + BLOCK], &batch.turns[start..start + BLOCK]);
            let (sign, amplitude) = (&batch.sign[start..start + BLOCK], &batch.amplitude[start..start + BLOCK]);
            let (mut over, mut dx, mut dy) = ([T::ZERO; BLOCK], [T::ZERO; BLOCK], [T::ZERO; BLOCK]);
            // Turns of the wave: a converging one is the conjugate of a diverging one, the phase φ is not conjugated.
            let mut phase = [T::ZERO; BLOCK];
            for i in 0..BLOCK {
                let (x, y) = (at[0] - x[i], at[1] - y[i]);
                let r = fused::<f64, FMA>(x, x, fused::<f64, FMA>(y, y, z[i] * z[i])).sqrt();
                let path = r * waves.inverse;
                let all = fused::<f64, FMA>(sign[i], path - round(path), turns[i]);
                (over[i], phase[i]) = (T::ONE / T::of(r), T::of(all - round(all)));
                (dx[i], dy[i]) = (T::of(x.abs()), T::of(y.abs()));
            }
            let mut limited = Pair::<T>::ZERO;
            match waves.cull {
                Cull::Soft => {
                    if !tapered::<T, N, FMA>(waves, [&dx, &dy], &over, series, &mut limited) {
                        continue;
                    }
                }
                Cull::Hard => {
                    let inverse = T::of(waves.inverse);
                    for i in 0..BLOCK {
                        let (x, y) = ((at[0] - x[i]).abs(), (at[1] - y[i]).abs());
                        let inside = (x <= waves.cone[0] * z[i]) & (y <= waves.cone[1] * z[i]);
                        limited.re[i] = if inside { least(over[i], inverse) } else { T::ZERO };
                    }
                }
                Cull::None => {
                    let inverse = T::of(waves.inverse);
                    limited.re.iter_mut().zip(&over).for_each(|(limited, over)| *limited = least(*over, inverse));
                }
            }
            for i in 0..BLOCK {
                let wave = turned::<T, FMA>(phase[i]);
                let factor = [T::of(amplitude[i]) * limited.re[i], T::of(amplitude[i] * sign[i]) * limited.im[i]];
                let [re, im] = product::<T, FMA>(factor, wave);
                (total.re[i], total.im[i]) = (total.re[i] + re, total.im[i] + im);
            }
        }
        let over_lanes = |lanes: &Lanes<T>| lanes.iter().map(|value| value.double()).sum();
        *sum += Complex64::new(over_lanes(&total.re), over_lanes(&total.im));
    }
}

/// One axis of a block's tapers: the sine's modulus, the argument v of the edge and its blur q, how far inside the edge a point
/// lies, negative where the taper is flat; then the taper and its slope by the sine's modulus.
struct Axis<T> {
    sine: Lanes<T>,
    v: Lanes<T>,
    q: Lanes<T>,
    inside: Lanes<T>,
    taper: Pair<T>,
    slope: Pair<T>,
}

impl<T: Real> Axis<T> {
    #[inline(always)]
    fn new<const FMA: bool>(waves: &Waves, axis: usize, d: &Lanes<T>, over: &Lanes<T>) -> Self {
        let [middle, steepness, blur] =
            [waves.middle[axis], waves.steepness[axis], waves.blur[axis]].map(|value| T::of(value));
        let none = [T::ZERO; BLOCK];
        let mut new =
            Self { sine: none, v: none, q: none, inside: none, taper: Pair::<T>::ZERO, slope: Pair::<T>::ZERO };
        for i in 0..BLOCK {
            let sine = d[i] * over[i];
            let v = (sine - middle) * steepness;
            let q = (T::ONE - sine * sine) * blur * over[i];
            (new.sine[i], new.v[i], new.q[i]) = (sine, v, q);
            new.inside[i] = fused::<T, FMA>(T::FLAT, fused::<T, FMA>(q, q, T::ONE), -(v * v));
            new.taper.re[i] = if v < T::ZERO { T::ONE } else { T::ZERO };
        }
        new
    }

    /// Adds the edge, where points are in it.
    #[inline(always)]
    fn soften<const N: usize, const FMA: bool>(&mut self, width: f64, series: &Series<T, N>) {
        let by = T::of(-1.0 / (PI.sqrt() * width));
        for i in 0..BLOCK {
            let (taper, slope) = edge::<T, N, FMA>(self.v[i], self.q[i], series);
            let is_edge = self.inside[i] >= T::ZERO;
            self.taper.re[i] = if is_edge { taper[0] } else { self.taper.re[i] };
            self.taper.im[i] = if is_edge { taper[1] } else { T::ZERO };
            self.slope.re[i] = if is_edge { by * slope[0] } else { T::ZERO };
            self.slope.im[i] = if is_edge { by * slope[1] } else { T::ZERO };
        }
    }
}

/// [T·T + i λ f_x f_y/(2πr)·T′·T′]/r; false where all of it is dark.
#[inline(always)]
fn tapered<T: Real, const N: usize, const FMA: bool>(
    waves: &Waves,
    d: [&Lanes<T>; 2],
    over: &Lanes<T>,
    series: &Series<T, N>,
    limited: &mut Pair<T>,
) -> bool {
    let mut x = Axis::new::<FMA>(waves, 0, d[0], over);
    let mut y = Axis::new::<FMA>(waves, 1, d[1], over);
    let (mut any, mut in_x, mut in_y) = (0u32, 0u32, 0u32);
    for i in 0..BLOCK {
        // Not negative where light passes: in the edge of an axis, or on its inner side.
        let lit = least(most(x.inside[i], -x.v[i]), most(y.inside[i], -y.v[i]));
        any |= u32::from(lit >= T::ZERO);
        in_x |= u32::from(least(lit, x.inside[i]) >= T::ZERO);
        in_y |= u32::from(least(lit, y.inside[i]) >= T::ZERO);
    }
    if any == 0 {
        return false;
    }
    if in_x != 0 {
        x.soften::<N, FMA>(waves.width[0], series);
    }
    if in_y != 0 {
        y.soften::<N, FMA>(waves.width[1], series);
    }
    // With T′ by the sine instead of the frequency, λ f_x f_y/2πr is λ s_x s_y/2πr.
    let by = T::of(waves.wavelength / TAU);
    for (i, over) in over.iter().enumerate() {
        let cross = by * x.sine[i] * y.sine[i] * *over;
        let [re, im] = product::<T, FMA>([x.taper.re[i], x.taper.im[i]], [y.taper.re[i], y.taper.im[i]]);
        let [slope_re, slope_im] = product::<T, FMA>([x.slope.re[i], x.slope.im[i]], [y.slope.re[i], y.slope.im[i]]);
        limited.re[i] = (re - cross * slope_im) * *over;
        limited.im[i] = (im + cross * slope_re) * *over;
    }
    true
}

/// T of a diverging wave, and e^{−v²/(1 − iq)}/√(1 − iq), of which its slope is a multiple.
#[inline(always)]
fn edge<T: Real, const N: usize, const FMA: bool>(v: T, q: T, series: &Series<T, N>) -> ([T; 2], [T; 2]) {
    let (half, scale) = (T::of(0.5), series.scale);
    // 1/√(1 − iq) = (root + iq/(2 root))/√(1 + q²).
    let modulus = fused::<T, FMA>(q, q, T::ONE).sqrt();
    let square = half * (modulus + T::ONE);
    let over = T::ONE / (square.sqrt() * modulus);
    let inverse = [square * over, half * q * over];
    let z = [v.abs() * inverse[0], v.abs() * inverse[1]];
    let fall = exp_minus::<T, FMA>(z[0] * z[0] - z[1] * z[1]);
    let turns = T::of(-2.0 / TAU) * z[0] * z[1];
    let [re, im] = turned::<T, FMA>(turns - turns.round());
    let gauss = [fall * re, fall * im];
    // Weideman's series in Z = (L − z)/(L + z).
    let sum = scale + z[0];
    let norm = T::ONE / fused::<T, FMA>(sum, sum, z[1] * z[1]);
    let outer = [sum * norm, -z[1] * norm];
    let ratio = product::<T, FMA>([scale - z[0], -z[1]], outer);
    let mut all = [T::ZERO; 2];
    for n in (0..N).rev() {
        let [re, im] = all;
        all = [
            fused::<T, FMA>(re, ratio[0], fused::<T, FMA>(-im, ratio[1], series.terms[n])),
            fused::<T, FMA>(re, ratio[1], im * ratio[0]),
        ];
    }
    // erfc(z) = e^{−z²}·outer·(2·outer·sum + 1/√π), and 2 − erfc(−z) on the other side.
    let two = T::of(2.0);
    let [re, im] = product::<T, FMA>(outer, all);
    let inner = [fused::<T, FMA>(two, re, T::of(1.0 / PI.sqrt())), two * im];
    let [re, im] = product::<T, FMA>(gauss, product::<T, FMA>(outer, inner));
    let (re, im) = (half * re, half * im);
    let taper = [if v < T::ZERO { T::ONE - re } else { re }, if v < T::ZERO { -im } else { im }];
    (taper, product::<T, FMA>(gauss, inverse))
}
