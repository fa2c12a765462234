//! Two-dimensional transforms beside those of Python's libraries, in turns within one run.
//!
//! `cargo bench --bench transforms`. Pairs of one forward and one inverse transform of complex f32, in place, two threads each;
//! best of nine turns. `PYTHON` names the interpreter (`python3`); of SciPy's pocketfft, mkl_fft and pyFFTW those are
//! measured that it has.

use holodrive::field::{Complex32, Fft2};
use holodrive::progress::Progress;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

const TURNS: usize = 9;
const THREADS: usize = 2;
const SIZES: [[usize; 2]; 3] = [[3840, 2160], [2160, 1200], [1920, 1080]];

/// Answers `library width height` by the milliseconds of a pair; a library that is not there by `-`.
const PYTHON: &str = r#"
import sys, time, importlib, numpy as np
plans = {}
def plan(name, w, h):
    a = (np.random.default_rng(1).random((h, w), dtype='f4') - 0.5).astype('c8')
    if name == 'pocketfft':
        f = importlib.import_module('scipy.fft')
        return lambda: f.ifft2(f.fft2(a, workers=THREADS, overwrite_x=True), workers=THREADS, overwrite_x=True)
    if name == 'mkl':
        f = importlib.import_module('mkl_fft')
        return lambda: f.ifft2(f.fft2(a))
    f = importlib.import_module('pyfftw')
    b = f.empty_aligned((h, w), 'complex64')
    there, back = (f.FFTW(b, b, axes=(0, 1), direction=d, threads=THREADS, flags=('FFTW_MEASURE',))
                   for d in ('FFTW_FORWARD', 'FFTW_BACKWARD'))
    b[:] = a
    return lambda: (there.execute(), back.execute())
for line in sys.stdin:
    name, w, h = line.split()
    try:
        key = name, int(w), int(h)
        if key not in plans:
            plans[key] = plan(*key)
            plans[key]()
        begin = time.perf_counter()
        plans[key]()
        print(1e3 * (time.perf_counter() - begin), flush=True)
    except ImportError:
        print('-', flush=True)
"#;

/// A Python process that measures.
struct Python {
    child: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Python {
    fn new() -> std::io::Result<Self> {
        let name = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        let program = PYTHON.replace("THREADS", &THREADS.to_string());
        let mut child = Command::new(name)
            .args(["-c", &program])
            .env("MKL_NUM_THREADS", THREADS.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let missing = || std::io::Error::other("no pipe to Python");
        let ask = child.stdin.take().ok_or_else(missing)?;
        let answers = BufReader::new(child.stdout.take().ok_or_else(missing)?);
        Ok(Self { child, ask, answers })
    }

    /// Milliseconds of one pair; `None` where the library is not installed.
    fn measure(&mut self, library: &str, [width, height]: [usize; 2]) -> Option<f64> {
        writeln!(self.ask, "{library} {width} {height}").ok()?;
        let mut line = String::new();
        self.answers.read_line(&mut line).ok()?;
        line.trim().parse().ok()
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // It ends with its input; a process that is gone already is no loss.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn main() {
    // `cargo test --benches` only wants to see it start.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().expect("threads");
    let mut python = Python::new().map_err(|why| eprintln!("no Python beside it: {why}")).ok();
    let progress = Progress::new();
    println!("{:>12} {:>10} {:>10} {:>10} {:>10}  [ms a pair] (over own)", "size", "own", "pocketfft", "mkl", "fftw");
    for size in SIZES {
        let [width, height] = size;
        let plan = Fft2::new(width, height);
        let wave = |i: usize| Complex32::new((i % 17) as f32 - 8.0, (i % 13) as f32 - 6.0);
        let mut samples: Vec<Complex32> = (0..width * height).map(wave).collect();
        let mut pair = || {
            let begin = Instant::now();
            pool.install(|| {
                plan.forward(&mut samples, &progress);
                plan.inverse(&mut samples, &progress);
            });
            begin.elapsed().as_secs_f64() * 1e3
        };
        pair();
        let (mut own, mut others) = (f64::INFINITY, [f64::INFINITY; 3]);
        for _ in 0..TURNS {
            own = own.min(pair());
            for (best, library) in others.iter_mut().zip(["pocketfft", "mkl", "fftw"]) {
                let found = python.as_mut().and_then(|python| python.measure(library, size));
                *best = best.min(found.unwrap_or(f64::INFINITY));
            }
        }
        let shown = others.map(|ms| if ms.is_finite() { format!("{ms:.1} ({:.2})", ms / own) } else { "-".into() });
        println!("{:>12} {own:>10.1} {:>10} {:>10} {:>10}", format!("{width}×{height}"), shown[0], shown[1], shown[2]);
    }
}
