//! The choice of an engine: error and memory are conditions, predicted time decides.
//!
//! Predictions come from cost models of the engines ([`Division`], [`Parameters`]) in core-seconds of a 3.7 GHz Zen 4
//! with AVX-512, times a factor for the instruction set, over the threads. They rank the engines; on another machine
//! all of them are off by about the same factor.

use super::definition::Optics;
#[cfg(feature = "gpu")]
use super::exact::GPU_ROUNDING;
use super::exact::{DIRECT_ERROR, Division};
use super::planes::{Cloud, Parameters};
use super::sources::{Coverage, PointSum, PointWave, sources};
use super::tiles::{Kernel, Products, Shape};
use super::{Cull, HologramSettings, InstructionSet, Method, Plan};
#[cfg(feature = "gpu")]
use super::{gpu, tiles::Class};
use super::{near, oracle, recurrence};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names::Named;
use crate::points::PointSource;
use crate::progress::Progress;

/// Error of the oracle: the far form where it stands for the integral.
pub(super) const ORACLE_ERROR: f64 = 1e-5;

/// Time of the oracle for a point and a pixel [core-seconds]; points that are integrated take thousands of times that.
const ORACLE_PAIR: f64 = 1e-7;

/// Least predicted time on the CPU for which a graphics processor is looked for [s].
const GPU_WORTH: f64 = 1.0;

fn has_hardware_gpu() -> bool {
    #[cfg(feature = "gpu")]
    return gpu::seconds(0.0).is_some();
    #[cfg(not(feature = "gpu"))]
    false
}

/// An engine with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Engine {
    Oracle,
    /// The exact sum of the check, where faster engines have failed.
    Whole,
    /// `direct` and `tiles`, with the error that tiles are chosen for.
    Exact {
        error: f64,
    },
    Planes(Parameters),
    /// Planes on the graphics processor.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))] // refused there before it is made
    GpuPlanes(Parameters),
    /// The exact sum on the graphics processor, with the error that tiles are chosen for.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))] // refused there before it is made
    Gpu {
        error: f64,
    },
    /// The difference method, with the error that blocks are chosen for.
    Recurrence {
        error: f64,
    },
}

/// One way to do the request.
struct Candidate {
    method: Method,
    engine: Engine,
    core_seconds: f64,
    error: f64,
    memory: u64,
    words: String,
}

/// What is asked for, as the candidates see it.
struct Request<'a> {
    sum: PointSum<'a>,
    settings: &'a HologramSettings,
    /// What is left of the budget beside the sources [bytes].
    memory: u64,
}

impl Request<'_> {
    /// The sources as planes take them.
    fn cloud(&self) -> Cloud<'_> {
        Cloud::new(self.sum.optics, self.sum.grid, self.sum.sources)
    }

    fn exact(&self, method: Method, error: f64) -> Candidate {
        let set = self.settings.instruction_set.unwrap_or_else(InstructionSet::detect);
        let division = Division::new(&self.sum, Products::of(set), error);
        let shape = division.far.iter().max_by_key(|class| class.len()).map(|class| class.shape);
        let words = match shape {
            Some(Shape { kernel: Kernel::Paths, .. }) => "every pixel from its own path".to_owned(),
            Some(Shape { kernel: Kernel::Float, width, height, .. }) => format!("tiles of {width}×{height} px"),
            Some(Shape { kernel: Kernel::Integer, width, height, .. }) => {
                format!("tiles of {width}×{height} px in 16-bit integers")
            }
            Some(Shape { kernel: Kernel::Bfloat, width, height, .. }) => {
                format!("tiles of {width}×{height} px in bfloat16")
            }
            None => "points near the panel as products of kernels".to_owned(),
        };
        let factor = set_factor(self.settings, method);
        let core_seconds = division.core_seconds(&self.sum);
        Candidate {
            method,
            engine: Engine::Exact { error },
            core_seconds: core_seconds * factor + FIELD_PIXEL * self.sum.grid.len() as f64,
            error: division.error,
            memory: division.bytes,
            words,
        }
    }

    fn recurrence(&self, error: f64, pairs: f64) -> Candidate {
        let settings = self.settings;
        let division = Division::new(&self.sum, Products::Float, error);
        let (blocks, bound) = division.blocks(self.sum.optics, error);
        let (shortest, longest) = blocks.iter().fold((256, 32), |(s, l), &b| (s.min(b), l.max(b)));
        let near = near::core_seconds(self.sum.optics, self.sum.sources, &division.near);
        let work = recurrence::core_seconds(pairs, shortest) * set_factor(settings, Method::Recurrence);
        Candidate {
            method: Method::Recurrence,
            engine: Engine::Recurrence { error },
            core_seconds: near + work,
            error: bound,
            memory: division.bytes + recurrence::bytes(longest),
            words: format!("differences along {shortest} px"),
        }
    }

    /// The exact sum on the graphics processor; its time is guessed where it has not been measured.
    #[cfg(feature = "gpu")]
    fn gpu(&self, error: f64, pairs: f64, threads: f64) -> Result<Candidate> {
        let adapter = gpu::adapter()?;
        let division = Division::new(&self.sum, Products::Shader, error);
        let near = near::core_seconds(self.sum.optics, self.sum.sources, &division.near);
        let far: usize = division.far.iter().map(Class::len).sum();
        let seconds = gpu::seconds(pairs).unwrap_or(pairs / gpu::SOFTWARE_RATE);
        Ok(Candidate {
            method: Method::Gpu,
            engine: Engine::Gpu { error },
            core_seconds: near + seconds * threads,
            error: division.gpu_error(),
            memory: division.bytes + gpu::bytes(self.sum.grid, far),
            words: format!("tiles on {adapter}"),
        })
    }
    /// A build without the engine.
    #[cfg(not(feature = "gpu"))]
    fn gpu(&self, _: f64, _: f64, _: f64) -> Result<Candidate> {
        Err(super::exact::no_gpu())
    }

    /// Planes on the graphics processor; their time is a guess.
    #[cfg(feature = "gpu")]
    fn gpu_planes(&self, threads: f64) -> Result<Candidate> {
        let adapter = gpu::adapter()?;
        if self.settings.cull != Cull::Soft {
            return Err(refuse_planes(self.settings));
        }
        let cloud = self.cloud();
        // The CPU's model chooses planes and rank; the device's own memory is asked below.
        let error = (self.settings.error - GPU_ROUNDING).max(0.0);
        let chosen = Parameters::choose(&cloud, error, u64::MAX).ok_or_else(|| refuse_planes(self.settings))?;
        let cost = gpu::planes::cost(&cloud, &chosen.parameters)?;
        let Parameters { planes, rank, .. } = chosen.parameters;
        Ok(Candidate {
            method: Method::GpuPlanes,
            engine: Engine::GpuPlanes(chosen.parameters),
            core_seconds: cost.seconds * threads,
            error: chosen.error + GPU_ROUNDING,
            memory: cost.bytes,
            words: format!("{planes} planes, rank {rank} on {adapter} (its time is a guess)"),
        })
    }
    /// A build without the engine.
    #[cfg(not(feature = "gpu"))]
    fn gpu_planes(&self, _: f64) -> Result<Candidate> {
        Err(super::exact::no_gpu())
    }

    fn planes(&self) -> Option<Candidate> {
        if self.settings.cull != Cull::Soft {
            return None;
        }
        let chosen = Parameters::choose(&self.cloud(), self.settings.error, self.memory)?;
        let Parameters { planes, rank, .. } = chosen.parameters;
        Some(Candidate {
            method: Method::Planes,
            engine: Engine::Planes(chosen.parameters),
            core_seconds: chosen.core_seconds * set_factor(self.settings, Method::Planes),
            error: chosen.error,
            memory: chosen.bytes,
            words: format!("{planes} planes, rank {rank}"),
        })
    }

    fn oracle(&self, pairs: f64) -> Candidate {
        let PointSum { optics, grid, sources, cull, .. } = self.sum;
        Candidate {
            method: Method::Oracle,
            engine: Engine::Oracle,
            core_seconds: pairs * ORACLE_PAIR,
            error: ORACLE_ERROR,
            memory: oracle::bytes(grid, optics, cull, sources.iter().map(|s| s.distance)),
            words: "double precision, term by term".to_owned(),
        }
    }
}

/// Taking and first touching the memory of a field's pixel, where the engine's model has not counted it [core-seconds].
const FIELD_PIXEL: f64 = 4e-9;

/// Slowness against AVX-512, measured.
fn set_factor(settings: &HologramSettings, method: Method) -> f64 {
    match (settings.instruction_set.unwrap_or_else(InstructionSet::detect), method) {
        (InstructionSet::Amx | InstructionSet::Avx512Vnni | InstructionSet::Avx512, _)
        | (_, Method::Oracle | Method::Gpu | Method::GpuPlanes) => 1.0,
        (InstructionSet::Avx2, _) => 1.3,
        (InstructionSet::Portable, Method::Direct | Method::Recurrence) => 5.5,
        (InstructionSet::Portable, Method::Tiles) => 9.5,
        (InstructionSet::Portable, Method::Planes) => 4.0,
    }
}

/// Chooses engine and parameters for these points on this grid.
///
/// Refused: points that are not finite, settings out of their domain, a method that does not serve them, a job that
/// does not fit its memory.
pub fn plan(points: &[PointSource], grid: &Grid, wavelength: f64, settings: &HologramSettings) -> Result<Plan> {
    let optics = Optics::new(grid, wavelength)?;
    let error = settings.error;
    if !(1e-5..1.0).contains(&error) {
        return Err(Error::out_of_range("error", format_args!("{error:e}"), "must lie between 1e-5 and 1"));
    }
    let set = settings.instruction_set.unwrap_or_else(InstructionSet::detect);
    if !InstructionSet::available().contains(&set) {
        return Err(Error::unsupported(format!("this machine has no {}", set.name())));
    }
    let sources = sources(points)?;
    let (optics, progress) = (&optics, &Progress::new());
    let sum = PointSum { optics, grid, sources: &sources, cull: settings.cull, progress };
    let pairs = Coverage::of(points.len(), &sum).pairs;
    let own = (size_of::<PointWave>() * sources.len()) as u64;
    let request = Request { sum, settings, memory: settings.memory.saturating_sub(own) };
    let threads = rayon::current_num_threads() as f64;
    let (mut best, reason) = match settings.method {
        Some(method) => {
            let candidate = match method {
                Method::Oracle => request.oracle(pairs),
                Method::Direct => request.exact(method, DIRECT_ERROR),
                Method::Tiles => request.exact(method, error),
                Method::Planes => request.planes().ok_or_else(|| refuse_planes(settings))?,
                Method::Gpu => request.gpu(error, pairs, threads)?,
                Method::GpuPlanes => request.gpu_planes(threads)?,
                Method::Recurrence => request.recurrence(error, pairs),
            };
            let reason = format!("{} as asked for", candidate.words);
            (candidate, reason)
        }
        None => choose(&request, error, pairs, threads)?,
    };
    // The points as the engines take them.
    best.memory += own;
    if best.memory > settings.memory {
        let hint = "give more memory, a smaller panel or fewer points".to_owned();
        let (needed, budget) = (best.memory.div_ceil(1 << 20), settings.memory >> 20);
        return Err(Error::Memory { what: best.method.name(), needed, budget, hint });
    }
    Ok(Plan {
        method: best.method,
        reason,
        seconds: best.core_seconds / threads,
        error: best.error,
        memory: best.memory,
        instruction_set: set,
        settings: *settings,
        engine: best.engine,
    })
}

fn refuse_planes(settings: &HologramSettings) -> Error {
    let what = match settings.cull {
        Cull::Soft => format!("planes reach no error of {:.0e} for this cloud; take direct or tiles", settings.error),
        Cull::Hard | Cull::None => "planes know the soft taper only; take direct or tiles".to_owned(),
    };
    Error::parameter("method", what)
}

/// The fastest that keeps error and memory, and why.
fn choose(request: &Request, error: f64, pairs: f64, threads: f64) -> Result<(Candidate, String)> {
    let mut candidates: Vec<Candidate> = request.planes().into_iter().collect();
    // Dividing the points among tiles takes as long as many a field: not where the sum cannot be quicker.
    let set = request.settings.instruction_set.unwrap_or_else(InstructionSet::detect);
    let sum = pairs * Products::of(set).least_pair();
    let beaten = candidates.iter().any(|c| c.core_seconds < sum && c.memory <= request.memory && c.error <= error);
    if !beaten {
        candidates.push(request.exact(Method::Direct, DIRECT_ERROR));
        if error > DIRECT_ERROR {
            candidates.push(request.exact(Method::Tiles, error));
        }
    }
    // Opening a graphics processor takes a quarter of a second: only for jobs that are worth it.
    let quickest = candidates.iter().map(|c| c.core_seconds / threads).fold(f64::INFINITY, f64::min);
    if quickest > GPU_WORTH && has_hardware_gpu() {
        candidates.extend(request.gpu(error, pairs, threads).ok());
        candidates.extend(request.gpu_planes(threads).ok());
    }
    candidates.sort_by(|a, b| a.core_seconds.total_cmp(&b.core_seconds));
    let mut others: Vec<String> =
        candidates.iter().map(|c| format!("{} {:.2e} core-seconds", c.method.name(), c.core_seconds)).collect();
    if beaten {
        others.push(format!("sums over {sum:.2e} core-seconds"));
    }
    let fits = |c: &Candidate| c.memory <= request.memory && (c.error <= error || c.method == Method::Direct);
    let Some(best) = candidates.iter().position(fits) else {
        let least = candidates.iter().min_by_key(|c| c.memory);
        let beside = request.settings.memory - request.memory;
        let needed = least.map_or(0, |c| (c.memory + beside).div_ceil(1 << 20));
        let hint = "give more memory, a smaller panel or fewer points".to_owned();
        return Err(Error::Memory { what: "hologram", needed, budget: request.settings.memory >> 20, hint });
    };
    let best = candidates.swap_remove(best);
    let reason = format!("{}; least of {} within an error of {error:.0e}", best.words, others.join(", "));
    Ok((best, reason))
}
