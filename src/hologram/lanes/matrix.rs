//! Products of blocks of bfloat16 pairs, and the matrix unit (AMX) that some processors have for them.
//!
//! A block of rows holds 16 rows × 16 points, one of columns 16 points × 16 columns; each entry is a pair of bfloat16
//! numbers in 32 bits. The product's entry (m, n) is Σ_k a[m][k]·b[k][n], the pairs multiplied as vectors: two real
//! products, as `tdpbf16ps` sums them.
//!
//! The compiler's intrinsics for the unit are not stable yet, so its instructions are written out. [`Amx::is_present`]
//! trusts them only after the unit has multiplied numbers whose product [`Plain`] knows.

#[cfg(target_os = "linux")]
use std::arch::asm;
use std::sync::OnceLock;

/// Rows, points and columns of a block.
pub(crate) const SIDE: usize = 16;

/// Pairs of a block.
pub(crate) const BLOCK: usize = SIDE * SIDE;

/// What multiplies blocks.
///
/// # Safety
/// As its functions say; a unit's instructions must be present.
pub(crate) unsafe trait Unit {
    /// Makes the calling thread's unit ready.
    ///
    /// # Safety
    /// The unit is present.
    unsafe fn begin();
    /// Frees it.
    ///
    /// # Safety
    /// As [`Unit::begin`], which was called before.
    unsafe fn end();
    /// Adds to 16 rows × 32 columns of `re` and `im`, whose rows are `stride` values apart, the products over `count`
    /// blocks of points: of the first and the second block of rows in turn (real, imaginary) with two blocks of columns
    /// side by side.
    ///
    /// # Safety
    /// Between [`Unit::begin`] and [`Unit::end`]. `rows` and `columns` are valid for 2·count blocks, at 64 bytes;
    /// `re` and `im` for the sixteen rows.
    unsafe fn product(count: usize, rows: *const u32, columns: *const u32, re: *mut f32, im: *mut f32, stride: usize);
}

/// The pair's numbers, the lower half first.
fn numbers(pair: u32) -> [f32; 2] {
    [f32::from_bits(pair << 16), f32::from_bits(pair & 0xffff_0000)]
}

/// Plain Rust: what the unit is compared with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain;

// SAFETY: plain loops inside what the caller promises.
unsafe impl Unit for Plain {
    unsafe fn begin() {}
    unsafe fn end() {}
    unsafe fn product(count: usize, rows: *const u32, columns: *const u32, re: *mut f32, im: *mut f32, stride: usize) {
        // SAFETY: the caller's promise.
        let (rows, columns) = unsafe {
            let length = 2 * count * BLOCK;
            (std::slice::from_raw_parts(rows, length), std::slice::from_raw_parts(columns, length))
        };
        for (form, to) in [re, im].into_iter().enumerate() {
            for m in 0..SIDE {
                for n in 0..2 * SIDE {
                    let mut sum = 0.0;
                    for k in 0..count * SIDE {
                        let (block, at) = (2 * (k / SIDE), k % SIDE);
                        let a = numbers(rows[(block + form) * BLOCK + m * SIDE + at]);
                        let b = numbers(columns[(block + n / SIDE) * BLOCK + at * SIDE + n % SIDE]);
                        sum += a[0] * b[0] + a[1] * b[1];
                    }
                    // SAFETY: one of the sixteen rows.
                    unsafe { *to.add(m * stride + n) += sum };
                }
            }
        }
    }
}

/// The matrix unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amx;

impl Amx {
    /// Whether processor and system have it, the system lets this process use it, and it multiplies rightly; asked once.
    pub(crate) fn is_present() -> bool {
        static PRESENT: OnceLock<bool> = OnceLock::new();
        *PRESENT.get_or_init(|| is_offered() && is_right::<Self>())
    }
}

/// The tile configuration of `ldtilecfg`: eight tiles of sixteen rows of 64 bytes.
#[cfg(target_os = "linux")]
#[repr(C, align(64))]
struct Configuration {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    bytes: [u16; 16],
    rows: [u8; 16],
}

#[cfg(target_os = "linux")]
static CONFIGURATION: Configuration = {
    let (mut bytes, mut rows) = ([0; 16], [0; 16]);
    let mut tile = 0;
    while tile < 8 {
        (bytes[tile], rows[tile]) = (4 * SIDE as u16, SIDE as u8);
        tile += 1;
    }
    Configuration { palette: 1, start_row: 0, reserved: [0; 14], bytes, rows }
};

/// Whether the processor says that it has the unit (leaf 7: AMX-BF16, AMX-TILE), the system keeps its state (XCR0, bits
/// 17 and 18), and gives this process leave to use it.
#[cfg(target_os = "linux")]
fn is_offered() -> bool {
    use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};
    /// `ARCH_REQ_XCOMP_PERM` of arch_prctl(2), and the number of the unit's state.
    const ASK: libc::c_long = 0x1023;
    const TILE_DATA: libc::c_long = 18;
    if !is_x86_feature_detected!("xsave") || __cpuid(0).eax < 7 {
        return false;
    }
    let features = __cpuid_count(7, 0).edx;
    // SAFETY: XSAVE was detected, which the standard library says only where the system has enabled it.
    let kept = unsafe { _xgetbv(0) };
    let whole = |bits: u64, wanted: u64| bits & wanted == wanted;
    whole(u64::from(features), 1 << 22 | 1 << 24)
        && whole(kept, 3 << 17)
        // SAFETY: a system call without pointers.
        && unsafe { libc::syscall(libc::SYS_arch_prctl, ASK, TILE_DATA) } == 0
}

#[cfg(not(target_os = "linux"))]
fn is_offered() -> bool {
    false
}

// SAFETY: the instructions read and write what the caller promises: 1 KiB a block, sixteen rows of 64 bytes of the sums.
#[cfg(target_os = "linux")]
unsafe impl Unit for Amx {
    unsafe fn begin() {
        // SAFETY: 64 bytes at 64.
        unsafe {
            asm!("ldtilecfg [{}]", in(reg) &raw const CONFIGURATION, options(nostack, readonly, preserves_flags))
        };
    }
    unsafe fn end() {
        // SAFETY: forgets the tiles, which no code uses between calls.
        unsafe { asm!("tilerelease", options(nostack, nomem, preserves_flags)) };
    }
    unsafe fn product(count: usize, rows: *const u32, columns: *const u32, re: *mut f32, im: *mut f32, stride: usize) {
        if count == 0 {
            return;
        }
        // SAFETY: the caller's promise.
        unsafe {
            asm!(
                "tileloadd tmm0, [{re} + {stride}*1]",
                "tileloadd tmm1, [{re} + {stride}*1 + 64]",
                "tileloadd tmm2, [{im} + {stride}*1]",
                "tileloadd tmm3, [{im} + {stride}*1 + 64]",
                "2:",
                "tileloadd tmm4, [{rows} + {line}*1]",
                "tileloadd tmm6, [{columns} + {line}*1]",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tileloadd tmm7, [{columns} + {line}*1 + 1024]",
                "tdpbf16ps tmm1, tmm4, tmm7",
                "tileloadd tmm5, [{rows} + {line}*1 + 1024]",
                "tdpbf16ps tmm2, tmm5, tmm6",
                "tdpbf16ps tmm3, tmm5, tmm7",
                "add {rows}, 2048",
                "add {columns}, 2048",
                "dec {count}",
                "jnz 2b",
                "tilestored [{re} + {stride}*1], tmm0",
                "tilestored [{re} + {stride}*1 + 64], tmm1",
                "tilestored [{im} + {stride}*1], tmm2",
                "tilestored [{im} + {stride}*1 + 64], tmm3",
                rows = inout(reg) rows => _,
                columns = inout(reg) columns => _,
                count = inout(reg) count => _,
                re = in(reg) re,
                im = in(reg) im,
                stride = in(reg) 4 * stride,
                line = in(reg) 64usize,
                out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
    }
}

#[cfg(not(target_os = "linux"))]
// SAFETY: never present, so never called.
unsafe impl Unit for Amx {
    unsafe fn begin() {}
    unsafe fn end() {}
    unsafe fn product(_: usize, _: *const u32, _: *const u32, _: *mut f32, _: *mut f32, _: usize) {}
}

/// Memory at 64 bytes for what [`is_right`] multiplies.
#[repr(C, align(64))]
struct Blocks<const N: usize>([u32; N]);

/// Whether a unit's product is the plain one's but for rounding.
fn is_right<U: Unit>() -> bool {
    const COUNT: usize = 3;
    const STRIDE: usize = 2 * SIDE + 16;
    // Pairs of numbers between ±2 that no symmetry hides: halves of a linear congruence.
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from((state >> 16) as i16) / 16_384.0
    };
    let mut pairs = || Blocks(std::array::from_fn::<u32, { 2 * COUNT * BLOCK }, _>(|_| pair(next(), next())));
    let (rows, columns) = (pairs(), pairs());
    let mut sums = [[[0.25f32; STRIDE * SIDE]; 2]; 2];
    let [[re, im], [plain_re, plain_im]] = &mut sums;
    // SAFETY: the caller has asked for the unit; 2·COUNT blocks each, sixteen rows of STRIDE.
    unsafe {
        U::begin();
        U::product(COUNT, rows.0.as_ptr(), columns.0.as_ptr(), re.as_mut_ptr(), im.as_mut_ptr(), STRIDE);
        U::end();
        let (re, im) = (plain_re.as_mut_ptr(), plain_im.as_mut_ptr());
        Plain::product(COUNT, rows.0.as_ptr(), columns.0.as_ptr(), re, im, STRIDE);
    }
    // 96 products of up to 4, whose roundings depend on their order.
    let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-3;
    (0..2).all(|form| sums[0][form].iter().zip(&sums[1][form]).all(near))
}

/// Two numbers rounded to bfloat16, the first in the lower half.
pub(crate) fn pair(low: f32, high: f32) -> u32 {
    let rounded = |x: f32| x.to_bits().wrapping_add(0x8000);
    rounded(low) >> 16 | rounded(high) & 0xffff_0000
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit with an error that a processor, or a wrong block, could have.
    struct Wrong<const KIND: usize>;

    // SAFETY: as `Plain`.
    unsafe impl<const KIND: usize> Unit for Wrong<KIND> {
        unsafe fn begin() {}
        unsafe fn end() {}
        unsafe fn product(
            count: usize,
            rows: *const u32,
            columns: *const u32,
            re: *mut f32,
            im: *mut f32,
            stride: usize,
        ) {
            // SAFETY: as `Plain`; one point less, forms exchanged, or one value beyond the block.
            unsafe {
                match KIND {
                    0 => Plain::product(count - 1, rows, columns, re, im, stride),
                    1 => Plain::product(count, rows, columns, im, re, stride),
                    2 => Plain::product(count, columns, rows, re, im, stride),
                    _ => {
                        Plain::product(count, rows, columns, re, im, stride);
                        *re.add(2 * SIDE) += 1.0;
                    }
                }
            }
        }
    }

    #[test]
    fn a_unit_that_errs_is_not_trusted() {
        assert!(is_right::<Plain>());
        assert!(!is_right::<Wrong<0>>() && !is_right::<Wrong<1>>() && !is_right::<Wrong<2>>());
        assert!(!is_right::<Wrong<3>>(), "writes beside its block");
    }

    #[test]
    fn the_machines_unit_is_right_where_it_is_offered() {
        if !is_offered() {
            return println!("not run: this machine has no AMX");
        }
        assert!(Amx::is_present());
    }

    #[test]
    fn plain_products_are_complex_products() {
        // (2 + 3i)·(5 − 7i) = 31 + i, at row 4, column 18, of point 21.
        let mut rows = vec![0; 4 * BLOCK];
        let mut columns = vec![0; 4 * BLOCK];
        let (m, n, k) = (4, 18, 21);
        let block = 2 * (k / SIDE);
        rows[block * BLOCK + m * SIDE + k % SIDE] = pair(2.0, -3.0);
        rows[(block + 1) * BLOCK + m * SIDE + k % SIDE] = pair(3.0, 2.0);
        columns[(block + n / SIDE) * BLOCK + k % SIDE * SIDE + n % SIDE] = pair(5.0, -7.0);
        let mut sums = [vec![0.0f32; 40 * SIDE], vec![0.0f32; 40 * SIDE]];
        let [re, im] = &mut sums;
        // SAFETY: two blocks of points, sixteen rows of forty.
        unsafe { Plain::product(2, rows.as_ptr(), columns.as_ptr(), re.as_mut_ptr(), im.as_mut_ptr(), 40) };
        let at = m * 40 + n;
        assert_eq!([sums[0][at], sums[1][at]], [31.0, 1.0]);
        for sum in &sums {
            assert_eq!(sum.iter().filter(|x| **x != 0.0).count(), 1);
        }
    }

    #[test]
    fn pairs_are_rounded_to_the_nearest() {
        assert_eq!(numbers(pair(1.0, -2.0)), [1.0, -2.0]);
        let rounded = numbers(pair(1.0 + 0.6 / 128.0, -1.0 - 0.4 / 128.0));
        assert_eq!(rounded, [1.0 + 1.0 / 128.0, -1.0]);
    }
}
