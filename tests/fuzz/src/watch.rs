//! What a reader takes: memory by an allocator that counts, time by a thread that waits.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Most memory that a reader may hold at once for an input of a few kilobytes [bytes].
pub const MOST_MEMORY: usize = 200 << 20;

/// Longest that a reader may take for an input [s].
pub const MOST_SECONDS: u64 = 30;

/// What is held where the process is ended before the system does it [bytes].
const TOO_MUCH: usize = 3 << 30;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, with a count of what is held.
pub struct Counting;

fn taken(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    MOST.fetch_max(held, Ordering::Relaxed);
}

// Safety: every call goes to the system's allocator with the arguments it came with; beside it only numbers change.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        taken(size);
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.realloc(old, layout, size) }
    }
    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(old, layout) }
    }
}

/// Most memory held at once while `work` ran, over what was held before [bytes].
pub fn memory_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let out = work();
    (out, MOST.load(Ordering::Relaxed).saturating_sub(before))
}

/// Ends the process where one input takes too long or all memory, after keeping it: neither can be ended otherwise.
pub struct Watchdog {
    begun: Instant,
    since: AtomicU64,
    watched: AtomicBool,
    input: Mutex<(String, Vec<u8>)>,
}

impl Watchdog {
    /// Starts the thread that waits.
    pub fn start() -> &'static Self {
        let (since, watched) = (AtomicU64::new(0), AtomicBool::new(false));
        let dog: &'static Self =
            Box::leak(Box::new(Self { begun: Instant::now(), since, watched, input: Mutex::default() }));
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_millis(50));
                let late = dog.begun.elapsed().as_millis() as u64 - dog.since.load(Ordering::Acquire);
                let greedy = HELD.load(Ordering::Relaxed) > TOO_MUCH;
                if dog.watched.load(Ordering::Acquire) && (greedy || late > 1000 * MOST_SECONDS) {
                    let Ok(input) = dog.input.lock() else { continue };
                    let kept = keep(&input.0, "hang", &input.1);
                    let what = if greedy { "no end of memory" } else { "no end of time" };
                    eprintln!("{}: {what}; the input is {}", input.0, kept.display());
                    std::process::exit(1);
                }
            }
        });
        dog
    }

    /// Watches one input.
    pub fn watch<T>(&self, parser: &str, input: &[u8], work: impl FnOnce() -> T) -> T {
        if let Ok(mut kept) = self.input.lock() {
            kept.0.clear();
            kept.0.push_str(parser);
            kept.1.clear();
            kept.1.extend_from_slice(input);
        }
        self.since.store(self.begun.elapsed().as_millis() as u64, Ordering::Release);
        self.watched.store(true, Ordering::Release);
        let out = work();
        self.watched.store(false, Ordering::Release);
        out
    }
}

/// Keeps an input that broke something, and says where.
pub fn keep(parser: &str, what: &str, input: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join("holodrive-fuzz");
    let number = input.iter().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    let path = folder.join(format!("{parser}-{what}-{number:016x}"));
    // Where it cannot be kept, the seed in the report leads to it again.
    let _ = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input));
    path
}
