//! Vectors of f32 for the inner loops: one source, three widths.
//!
//! A kernel is written once, generic over [`Lanes`] and inlined into a function that enables the instruction set;
//! [`InstructionSet::detect`] chooses it at run time. All paths do the same operations in the same order per lane, but
//! the portable one rounds between multiplication and addition, so results differ between instruction sets by
//! rounding; on one of them they are the same bits for any number of threads.

#[cfg(target_arch = "x86_64")]
pub(crate) mod matrix;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use portable::Portable;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

/// An instruction set that the kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// AVX-512 as below and a matrix unit for bfloat16 (AMX).
    Amx,
    /// AVX-512 F, DQ, BW, VL and VNNI: 16 lanes, and products of 16-bit integers.
    Avx512Vnni,
    /// AVX-512 F, DQ and VL: 16 lanes.
    Avx512,
    /// AVX2 and FMA: 8 lanes.
    Avx2,
    /// Plain Rust, 8 lanes, on any machine.
    Portable,
}

impl InstructionSet {
    /// The widest that this machine has.
    pub fn detect() -> Self {
        Self::available()[0]
    }
    /// All that this machine has, widest first.
    pub fn available() -> Vec<Self> {
        let mut sets = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            let fma = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            let wide = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl");
            if fma && wide {
                if is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vnni") {
                    if matrix::Amx::is_present() {
                        sets.push(Self::Amx);
                    }
                    sets.push(Self::Avx512Vnni);
                }
                sets.push(Self::Avx512);
            }
            if fma {
                sets.push(Self::Avx2);
            }
        }
        sets.push(Self::Portable);
        sets
    }
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Amx => "AVX-512 AMX",
            Self::Avx512Vnni => "AVX-512 VNNI",
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Portable => "portable",
        }
    }
}

/// A vector of f32.
///
/// # Safety
/// Every function may be called only where the implementor's instruction set is present, and inside a function that
/// enables it (or the calls are not inlined and slow). Pointers must be valid for [`Lanes::COUNT`] values.
pub(crate) unsafe trait Lanes: Copy {
    /// Number of lanes.
    const COUNT: usize;
    /// Indexes for [`Lanes::lookup`].
    type Index: Copy;
    unsafe fn splat(x: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn store(self, to: *mut f32);
    unsafe fn add(self, b: Self) -> Self;
    unsafe fn sub(self, b: Self) -> Self;
    unsafe fn mul(self, b: Self) -> Self;
    unsafe fn div(self, b: Self) -> Self;
    unsafe fn sqrt(self) -> Self;
    unsafe fn min(self, b: Self) -> Self;
    unsafe fn max(self, b: Self) -> Self;
    /// self·b + c.
    unsafe fn fma(self, b: Self, c: Self) -> Self;
    /// c − self·b.
    unsafe fn fnma(self, b: Self, c: Self) -> Self;
    /// self − nearest integer: a phase in turns reduced to ±½.
    unsafe fn turn(self) -> Self;
    /// Truncated to integers, which must be in 0..16.
    unsafe fn index(self) -> Self::Index;
    /// The index as a number.
    unsafe fn number(index: Self::Index) -> Self;
    /// `table[index]` of sixteen values.
    unsafe fn lookup(table: *const f32, index: Self::Index) -> Self;
    /// Real and imaginary parts of `COUNT` interleaved complex values.
    unsafe fn load_complex(from: *const f32) -> (Self, Self);
    /// The reverse of [`Lanes::load_complex`].
    unsafe fn store_complex(re: Self, im: Self, to: *mut f32);
    /// Where a ≤ b: `self`, elsewhere 0.
    unsafe fn where_le(self, a: Self, b: Self) -> Self;
}

/// cos(2πf) = Σ C·f²ⁿ and sin(2πf) = f·Σ S·f²ⁿ on |f| ≤ ½: minimax fits, largest error 1e-6 and 2e-7.
const COS: [f32; 6] = [0.999_999_2, -19.738_98, 64.928_66, -85.271_62, 58.790_49, -21.071_106];
const SIN: [f32; 6] = [std::f32::consts::TAU, -41.341_59, 81.599_945, -76.614_47, 41.342_88, -12.471_244];

/// (cos 2πx, sin 2πx), x in turns of any size that f32 resolves.
///
/// # Safety
/// As [`Lanes`].
#[inline(always)]
pub(crate) unsafe fn cos_sin<L: Lanes>(turns: L) -> (L, L) {
    // SAFETY: the caller's promise.
    unsafe {
        let f = turns.turn();
        let w = f.mul(f);
        let (mut c, mut s) = (L::splat(COS[5]), L::splat(SIN[5]));
        for n in (0..5).rev() {
            c = c.fma(w, L::splat(COS[n]));
            s = s.fma(w, L::splat(SIN[n]));
        }
        (c, s.mul(f))
    }
}

/// Memory for kernels: f32 on cache-line bounds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aligned {
    lines: Vec<Line>,
}

#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line([f32; 16]);

impl Aligned {
    /// Grows to at least `count` values, whose contents are unspecified.
    pub(crate) fn reserve(&mut self, count: usize) {
        let lines = count.div_ceil(16);
        if self.lines.len() < lines {
            self.lines.resize(lines, Line([0.0; 16]));
        }
    }
    /// The values.
    pub(crate) fn values(&self) -> &[f32] {
        bytemuck::cast_slice(&self.lines)
    }
    /// The values.
    pub(crate) fn values_mut(&mut self) -> &mut [f32] {
        bytemuck::cast_slice_mut(&mut self.lines)
    }
}

/// Runs a kernel generic over [`Lanes`] on an instruction set: `dispatch!(set, kernel(arguments))` calls
/// `kernel::<Avx512>(arguments)` and so on inside a function that enables the set.
macro_rules! dispatch {
    ($set:expr, $kernel:ident($($name:ident: $type:ty),* $(,)?) $(-> $result:ty)?) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        unsafe fn avx512($($name: $type),*) $(-> $result)? {
            // SAFETY: this function enables the instruction set; the rest is its caller's promise.
            unsafe { $kernel::<$crate::hologram::lanes::Avx512>($($name),*) }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        unsafe fn avx2($($name: $type),*) $(-> $result)? {
            // SAFETY: as above.
            unsafe { $kernel::<$crate::hologram::lanes::Avx2>($($name),*) }
        }
        match $set {
            #[cfg(target_arch = "x86_64")]
            $crate::hologram::lanes::InstructionSet::Amx
            | $crate::hologram::lanes::InstructionSet::Avx512Vnni
            | $crate::hologram::lanes::InstructionSet::Avx512 => avx512($($name),*),
            #[cfg(target_arch = "x86_64")]
            $crate::hologram::lanes::InstructionSet::Avx2 => avx2($($name),*),
            _ => $kernel::<$crate::hologram::lanes::Portable>($($name),*),
        }
    }};
}
pub(crate) use dispatch;

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine results a lane of every operation.
    #[inline(always)]
    unsafe fn operations<L: Lanes>(x: &[f32; 16], table: &[f32; 16], out: &mut [[f32; 16]; 9]) {
        let mut i = 0;
        while i < 16 {
            // SAFETY: sixteen values are a multiple of every lane count.
            unsafe {
                let v = L::load(x.as_ptr().add(i));
                let (c, s) = cos_sin(v);
                let index = v.max(L::splat(0.0)).min(L::splat(15.0)).index();
                // Interleaved and back, parts exchanged on the way.
                let mut pairs = [0.0f32; 32];
                L::store_complex(v.sub(L::splat(1.0)), v, pairs.as_mut_ptr());
                let (lower, upper) = L::load_complex(pairs.as_ptr());
                let exact = pairs[0] == x[i] - 1.0 && pairs[3] == x[i + 1];
                let back = if exact { upper.sub(lower) } else { L::splat(0.0) };
                let all = [
                    c,
                    s,
                    L::lookup(table.as_ptr(), index),
                    L::number(index),
                    v.fma(v, L::splat(2.0)).sqrt(),
                    v.fnma(L::splat(0.5), v).div(L::splat(3.0)),
                    v.add(v).sub(L::splat(1.0)).mul(v),
                    v.where_le(v, L::splat(1.0)),
                    back,
                ];
                for (row, value) in out.iter_mut().zip(all) {
                    value.store(row.as_mut_ptr().add(i));
                }
            }
            i += L::COUNT;
        }
    }

    #[test]
    fn every_instruction_set_computes_the_same_functions() {
        let x: [f32; 16] = std::array::from_fn(|i| -3.3 + 1.37 * i as f32);
        let table: [f32; 16] = std::array::from_fn(|i| (i * i) as f32);
        for set in InstructionSet::available() {
            let mut out = [[0.0; 16]; 9];
            // SAFETY: the set was detected.
            unsafe {
                let (x, table, out) = (&x, &table, &mut out);
                dispatch!(set, operations(x: &[f32; 16], table: &[f32; 16], out: &mut [[f32; 16]; 9]));
            }
            for i in 0..16 {
                let v = f64::from(x[i]);
                let turn = v * std::f64::consts::TAU;
                let index = v.clamp(0.0, 15.0).trunc();
                let masked = if v <= 1.0 { v } else { 0.0 };
                let expected = [
                    turn.cos(),
                    turn.sin(),
                    index * index,
                    index,
                    (v * v + 2.0).sqrt(),
                    (v - 0.5 * v) / 3.0,
                    (2.0 * v - 1.0) * v,
                    masked,
                    1.0,
                ];
                for (row, expected) in out.iter().zip(expected) {
                    let error = (f64::from(row[i]) - expected).abs();
                    // 2π·17 turns in f32 round by 1e-6 turns; the rest is a few units in the last place of 600.
                    assert!(error < 1.2e-5 * expected.abs().max(1.0), "{set:?} {v}: {} {expected}", row[i]);
                }
            }
        }
    }
}
