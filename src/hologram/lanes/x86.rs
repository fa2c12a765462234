//! Lanes of the x86-64 vector units.

use super::Lanes;
use std::arch::x86_64::*;

/// Sixteen f32 (AVX-512 F and DQ).
#[derive(Clone, Copy)]
pub(crate) struct Avx512(pub(crate) __m512);

/// Eight f32 (AVX2 and FMA).
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

/// Functions of vectors that are one intrinsic each.
macro_rules! single_instructions {
    ($($name:ident($($operand:ident),*) = $intrinsic:ident;)*) => {$(
        #[inline(always)]
        unsafe fn $name(self $(, $operand: Self)*) -> Self {
            // SAFETY: the caller is where the set is present.
            unsafe { Self($intrinsic(self.0 $(, $operand.0)*)) }
        }
    )*};
}

// SAFETY: each function needs the set named in the type; pointers are the caller's promise.
unsafe impl Lanes for Avx512 {
    const COUNT: usize = 16;
    type Index = __m512i;
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm512_set1_ps(x)) }
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: readable as promised.
        unsafe { Self(_mm512_loadu_ps(from)) }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: writable as promised.
        unsafe { _mm512_storeu_ps(to, self.0) }
    }
    single_instructions! {
        add(b) = _mm512_add_ps;
        sub(b) = _mm512_sub_ps;
        mul(b) = _mm512_mul_ps;
        div(b) = _mm512_div_ps;
        min(b) = _mm512_min_ps;
        max(b) = _mm512_max_ps;
        sqrt() = _mm512_sqrt_ps;
        fma(b, c) = _mm512_fmadd_ps;
        fnma(b, c) = _mm512_fnmadd_ps;
    }
    #[inline(always)]
    unsafe fn turn(self) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm512_reduce_ps::<8>(self.0)) }
    }
    #[inline(always)]
    unsafe fn index(self) -> __m512i {
        // SAFETY: the caller is where the set is present.
        unsafe { _mm512_cvttps_epi32(self.0) }
    }
    #[inline(always)]
    unsafe fn number(index: __m512i) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm512_cvtepi32_ps(index)) }
    }
    #[inline(always)]
    unsafe fn lookup(table: *const f32, index: __m512i) -> Self {
        // SAFETY: sixteen readable values as promised.
        unsafe { Self(_mm512_permutexvar_ps(index, _mm512_loadu_ps(table))) }
    }
    #[inline(always)]
    unsafe fn load_complex(from: *const f32) -> (Self, Self) {
        // SAFETY: readable as promised.
        unsafe {
            let (a, b) = (_mm512_loadu_ps(from), _mm512_loadu_ps(from.add(16)));
            let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
            (Self(_mm512_permutex2var_ps(a, even, b)), Self(_mm512_permutex2var_ps(a, odd, b)))
        }
    }
    #[inline(always)]
    unsafe fn store_complex(re: Self, im: Self, to: *mut f32) {
        // SAFETY: writable as promised.
        unsafe {
            let low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
            let high = _mm512_add_epi32(low, _mm512_set1_epi32(8));
            _mm512_storeu_ps(to, _mm512_permutex2var_ps(re.0, low, im.0));
            _mm512_storeu_ps(to.add(16), _mm512_permutex2var_ps(re.0, high, im.0));
        }
    }
    #[inline(always)]
    unsafe fn where_le(self, a: Self, b: Self) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm512_maskz_mov_ps(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a.0, b.0), self.0)) }
    }
}

// SAFETY: each function needs the set named in the type; pointers are the caller's promise.
unsafe impl Lanes for Avx2 {
    const COUNT: usize = 8;
    type Index = __m256i;
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm256_set1_ps(x)) }
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: readable as promised.
        unsafe { Self(_mm256_loadu_ps(from)) }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: writable as promised.
        unsafe { _mm256_storeu_ps(to, self.0) }
    }
    single_instructions! {
        add(b) = _mm256_add_ps;
        sub(b) = _mm256_sub_ps;
        mul(b) = _mm256_mul_ps;
        div(b) = _mm256_div_ps;
        min(b) = _mm256_min_ps;
        max(b) = _mm256_max_ps;
        sqrt() = _mm256_sqrt_ps;
        fma(b, c) = _mm256_fmadd_ps;
        fnma(b, c) = _mm256_fnmadd_ps;
    }
    #[inline(always)]
    unsafe fn turn(self) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm256_sub_ps(self.0, _mm256_round_ps::<8>(self.0))) }
    }
    #[inline(always)]
    unsafe fn index(self) -> __m256i {
        // SAFETY: the caller is where the set is present.
        unsafe { _mm256_cvttps_epi32(self.0) }
    }
    #[inline(always)]
    unsafe fn number(index: __m256i) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm256_cvtepi32_ps(index)) }
    }
    #[inline(always)]
    unsafe fn lookup(table: *const f32, index: __m256i) -> Self {
        // SAFETY: sixteen readable values as promised.
        unsafe {
            let low = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table), index);
            let high = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.add(8)), index);
            // Bit 3 of the index, moved to the sign, chooses the upper half.
            Self(_mm256_blendv_ps(low, high, _mm256_castsi256_ps(_mm256_slli_epi32::<28>(index))))
        }
    }
    #[inline(always)]
    unsafe fn load_complex(from: *const f32) -> (Self, Self) {
        // SAFETY: readable as promised.
        unsafe {
            let (a, b) = (_mm256_loadu_ps(from), _mm256_loadu_ps(from.add(8)));
            let low = _mm256_permute2f128_ps::<0x20>(a, b);
            let high = _mm256_permute2f128_ps::<0x31>(a, b);
            // Each half now holds pairs 0 1 | 4 5 and 2 3 | 6 7: one shuffle sorts the parts within the halves.
            (Self(_mm256_shuffle_ps::<0x88>(low, high)), Self(_mm256_shuffle_ps::<0xdd>(low, high)))
        }
    }
    #[inline(always)]
    unsafe fn store_complex(re: Self, im: Self, to: *mut f32) {
        // SAFETY: writable as promised.
        unsafe {
            let (low, high) = (_mm256_unpacklo_ps(re.0, im.0), _mm256_unpackhi_ps(re.0, im.0));
            _mm256_storeu_ps(to, _mm256_permute2f128_ps::<0x20>(low, high));
            _mm256_storeu_ps(to.add(8), _mm256_permute2f128_ps::<0x31>(low, high));
        }
    }
    #[inline(always)]
    unsafe fn where_le(self, a: Self, b: Self) -> Self {
        // SAFETY: the caller is where the set is present.
        unsafe { Self(_mm256_and_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a.0, b.0), self.0)) }
    }
}
