//! Eight lanes in plain Rust, which any compiler target vectorises as far as it can.

use super::Lanes;

/// Eight f32; multiplication and addition round separately, since a fused one is a library call where there is none.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f32; 8]);

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> Portable {
    Portable(std::array::from_fn(f))
}

/// Functions of vectors, given as functions of one lane.
macro_rules! lane_by_lane {
    ($($name:ident($x:ident $(, $operand:ident)*) = $value:expr;)*) => {$(
        #[inline(always)]
        unsafe fn $name(self $(, $operand: Self)*) -> Self {
            each(|i| {
                let $x = self.0[i];
                $(let $operand = $operand.0[i];)*
                $value
            })
        }
    )*};
}

// SAFETY: needs no instruction set; pointers are the caller's promise.
unsafe impl Lanes for Portable {
    const COUNT: usize = 8;
    type Index = [u8; 8];
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: eight readable values, as promised.
        Self(unsafe { from.cast::<[f32; 8]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: eight writable values, as promised.
        unsafe { to.cast::<[f32; 8]>().write_unaligned(self.0) }
    }
    lane_by_lane! {
        add(x, b) = x + b;
        sub(x, b) = x - b;
        mul(x, b) = x * b;
        div(x, b) = x / b;
        sqrt(x) = x.sqrt();
        min(x, b) = if x < b { x } else { b };
        max(x, b) = if x > b { x } else { b };
        fma(x, b, c) = x * b + c;
        fnma(x, b, c) = c - x * b;
    }
    #[inline(always)]
    unsafe fn turn(self) -> Self {
        // 1.5·2²³: adding it leaves no bits for a fraction, so the sum is rounded to an integer; valid below 2²².
        const ROUND: f32 = 12_582_912.0;
        each(|i| self.0[i] - ((self.0[i] + ROUND) - ROUND))
    }
    #[inline(always)]
    unsafe fn index(self) -> [u8; 8] {
        std::array::from_fn(|i| self.0[i] as u8 & 15)
    }
    #[inline(always)]
    unsafe fn number(index: [u8; 8]) -> Self {
        each(|i| f32::from(index[i]))
    }
    #[inline(always)]
    unsafe fn lookup(table: *const f32, index: [u8; 8]) -> Self {
        // SAFETY: sixteen readable values, as promised; indexes are below sixteen by construction.
        each(|i| unsafe { *table.add(index[i] as usize) })
    }
    #[inline(always)]
    unsafe fn load_complex(from: *const f32) -> (Self, Self) {
        // SAFETY: sixteen readable values, as promised.
        let pairs = unsafe { from.cast::<[f32; 16]>().read_unaligned() };
        (each(|i| pairs[2 * i]), each(|i| pairs[2 * i + 1]))
    }
    #[inline(always)]
    unsafe fn store_complex(re: Self, im: Self, to: *mut f32) {
        let pairs: [f32; 16] = std::array::from_fn(|i| if i % 2 == 0 { re.0[i / 2] } else { im.0[i / 2] });
        // SAFETY: sixteen writable values, as promised.
        unsafe { to.cast::<[f32; 16]>().write_unaligned(pairs) }
    }
    #[inline(always)]
    unsafe fn where_le(self, a: Self, b: Self) -> Self {
        each(|i| if a.0[i] <= b.0[i] { self.0[i] } else { 0.0 })
    }
}
