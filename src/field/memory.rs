//! Large blocks of memory, in large pages where the system has them.

use bytemuck::Zeroable;

/// Bytes from which large pages are asked for: some of the system's 2 MiB pages.
#[cfg(any(target_os = "linux", test))]
const LARGE: usize = 8 << 20;

/// `count` zeros; a large block is taken page by page when it is first *written*.
///
/// A page that is read before it is written costs two faults, one of them with an interrupt of all cores: store to
/// fresh memory, do not add to it.
pub(crate) fn zeroed<T: Zeroable>(count: usize) -> Vec<T> {
    let memory = bytemuck::zeroed_vec(count);
    prefer_large_pages(&memory);
    memory
}

/// Asks for 2 MiB pages behind memory that was not touched yet; nothing changes where the system has none.
#[cfg(target_os = "linux")]
fn prefer_large_pages<T>(memory: &[T]) {
    const PAGE: usize = 4096;
    let bytes = size_of_val(memory);
    let start = (memory.as_ptr() as usize).next_multiple_of(PAGE);
    let end = (memory.as_ptr() as usize + bytes) / PAGE * PAGE;
    if bytes < LARGE || end <= start {
        return;
    }
    // SAFETY: the range lies in one allocation of ours, begins and ends on pages, and the advice changes no contents.
    // A refusal (a kernel without large pages) is no loss.
    unsafe {
        libc::madvise(start as *mut libc::c_void, end - start, libc::MADV_HUGEPAGE);
    }
}

#[cfg(not(target_os = "linux"))]
fn prefer_large_pages<T>(_: &[T]) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_any_size_are_dark_and_writable() {
        for count in [0usize, 1, 1000, LARGE / 4, LARGE / 4 + 13] {
            let mut block: Vec<u32> = zeroed(count);
            assert!(block.len() == count && block.iter().all(|&v| v == 0));
            block.iter_mut().for_each(|v| *v = 7);
            assert!(block.iter().all(|&v| v == 7));
        }
    }
}
