//! Computing as planned, measuring the error, and doing it again where it is not the one that was asked.

use super::check::{Measured, Wanted, measure, whole};
use super::definition::Optics;
use super::exact::{DIRECT_ERROR, Division, GPU_ROUNDING};
use super::planner::{Engine, ORACLE_ERROR};
use super::sources::{Coverage, PointSum, sources};
use super::tiles::Products;
use super::{Computed, HologramReport, HologramSettings, Method, Plan, oracle, plan, planes};
use crate::error::{Error, Result};
use crate::field::{Field, Grid};
use crate::names::Named;
use crate::points::PointSource;
use crate::progress::Progress;
use std::borrow::Cow;
use std::time::Instant;

/// ‖u − v‖ over that of the points' bare spheres below which a field that no engine makes better is dark and no failure, per
/// wanted error: f32 holds no more of waves that cancel.
const WEAK: f64 = 1e-5;

/// Predicted time that a safer engine may take [s]; more where the first one took long, by this factor.
const PATIENCE: f64 = 60.0;
const PATIENCE_FACTOR: f64 = 20.0;

/// What a known error is stated above: another order of the sums rounds otherwise.
const KNOWN: f64 = 1.001;

/// Error from which on a field is no field.
const USELESS: f64 = 0.5;

/// Computes the field as planned; the plan may come from another cloud of the same kind (its choices are kept).
///
/// The error is measured afterwards ([`Measured`] says how, and relative to what). Where it passes what was asked, the field
/// is computed again: by the same engine for a smaller error, then by `direct`, then exactly in double precision, as far as their predicted
/// times are borne. The bound that the report states is never below the measured limit, and is that where all pixels were
/// measured; where it stays above what was asked, a warning says the numbers.
///
/// # Errors
/// Those of [`plan`]; [`Error::Parameter`] with the numbers where no engine gets below an error of a half;
/// [`Error::Interrupted`].
pub fn compute(
    points: &[PointSource],
    grid: &Grid,
    wavelength: f64,
    plan: &Plan,
    progress: &Progress,
) -> Result<Computed> {
    let start = Instant::now();
    let optics = Optics::new(grid, wavelength)?;
    let sources = sources(points)?;
    let sum = PointSum { optics: &optics, grid, sources: &sources, cull: plan.settings.cull, progress };
    let coverage = Coverage::of(points.len(), &sum);
    progress.check()?;
    let asked = plan.settings.error;
    let threads = rayon::current_num_threads() as f64;
    let first = plan;
    let mut now = Cow::Borrowed(plan);
    let mut tries: Vec<(Method, f64)> = Vec::new();
    let mut best: Option<(Field, Cow<Plan>, f64, Measured)> = None;
    let kept = loop {
        let (field, bound) = run(points, &sum, &now)?;
        let core_seconds = now.seconds * threads;
        // What is known to be out of an engine's reach is no reason to try another, unless it is far out.
        let target = if bound <= asked { asked } else { asked.max(bound.min(2.0 * DIRECT_ERROR)) };
        let wanted = Wanted { core_seconds, error: asked, thorough: false };
        let mut measured = measure(&sum, &field.samples, wanted)?;
        if !measured.whole && measured.limit > target && measured.error <= 1.5 * target {
            measured = measure(&sum, &field.samples, Wanted { thorough: true, ..wanted })?;
        }
        tries.push((now.method, measured.limit));
        // An error that is known is not held against the model's.
        let bound = if measured.whole { KNOWN * measured.limit } else { bound };
        let kept = measured.limit <= target;
        if best.as_ref().is_none_or(|(.., before)| measured.limit < before.limit) {
            best = Some((field, now.clone(), bound, measured));
        }
        if kept || matches!(now.method, Method::Oracle | Method::Recurrence) {
            break kept;
        }
        match safer(points, &sum, first, &tries, start.elapsed().as_secs_f64()) {
            Some(next) => now = Cow::Owned(next),
            None => break false,
        }
    };
    let Some((field, done, bound, measured)) = best else { return Err(Error::Interrupted) };
    let error_bound = bound.max(measured.limit);
    let mut warnings = Vec::new();
    let is_dark = !kept && measured.limit >= USELESS && measured.of_power <= asked * WEAK;
    if !measured.limit.is_finite()
        || (!kept && !is_dark && done.method != Method::Recurrence && measured.error >= USELESS)
    {
        return Err(Error::parameter("error", refusal(asked, &tries, &measured)));
    }
    if is_dark {
        warnings.push(format!(
            "the points' light cancels on the panel or passes beside it: the field is {:.0e} of what they would send there, \
             and dark to the precision of its samples",
            measured.of_power
        ));
    } else if error_bound > asked {
        warnings.push(format!(
            "the field's error may be {error_bound:.1e}, more than the {asked:.1e} asked: {} measured at {} pixels, {:.1e} of \
             what the points alone would send there",
            show(measured.error),
            measured.pixels,
            measured.of_power
        ));
    }
    // What was tried afterwards nobody has asked for.
    let mut reason = done.reason.clone();
    if tries.len() > 1 && first.settings.method.is_none() {
        reason = reason.replace(" as asked for", "");
    }
    for (method, limit) in &tries[..tries.len() - 1] {
        reason += &format!("; {} measured {} for {asked:.0e} asked, so it was done again", method.name(), show(*limit));
    }
    let report = HologramReport {
        method: done.method,
        reason,
        instruction_set: done.instruction_set,
        seconds: start.elapsed().as_secs_f64(),
        predicted_seconds: first.seconds,
        error_bound,
        measured,
        memory: done.memory.max(first.memory),
        coverage,
        warnings,
    };
    Ok(Computed { field, report })
}

fn show(error: f64) -> String {
    if error.is_finite() { format!("{error:.1e}") } else { "no number".to_owned() }
}

/// What no engine could do.
fn refusal(asked: f64, tries: &[(Method, f64)], measured: &Measured) -> String {
    let tries: Vec<String> =
        tries.iter().map(|(method, limit)| format!("{} {}", method.name(), show(*limit))).collect();
    format!(
        "{asked:.1e} asked, measured at {} pixels: {}; the points' waves cancel on the panel or pass beside it, so that little \
         is left to be relative to; move the points into view, take fewer, or the engine oracle",
        measured.pixels,
        tries.join(", ")
    )
}

/// The next plan after what was tried, if there is one whose time can be borne.
fn safer(points: &[PointSource], sum: &PointSum, first: &Plan, tries: &[(Method, f64)], spent: f64) -> Option<Plan> {
    let PointSum { optics, grid, .. } = *sum;
    let asked = first.settings.error;
    let tried = |method: Method| tries.iter().filter(|(tried, _)| *tried == method).count();
    let with = |method: Method, error: f64| {
        let settings = HologramSettings { method: Some(method), error, ..first.settings };
        let mut plan = plan(points, grid, optics.wavelength, &settings).ok()?;
        plan.settings = first.settings;
        (plan.seconds <= PATIENCE.max(PATIENCE_FACTOR * spent)).then_some(plan)
    };
    let (method, limit) = *tries.last()?;
    if matches!(method, Method::Tiles | Method::Planes | Method::GpuPlanes) && tried(method) < 2 && limit < 30.0 * asked
    {
        let error = (asked * (0.6 * asked / limit)).max(1.1e-5);
        if let Some(plan) = with(method, error) {
            return Some(plan);
        }
    }
    let direct = (tried(Method::Direct) == 0).then(|| with(Method::Direct, asked.max(DIRECT_ERROR))).flatten();
    direct.or_else(|| {
        let seconds = whole::core_seconds(sum) / rayon::current_num_threads() as f64;
        let memory = whole::memory(sum);
        let fits = seconds <= PATIENCE.max(PATIENCE_FACTOR * spent) && memory <= first.settings.memory;
        fits.then(|| Plan {
            method: Method::Oracle,
            reason: "exact sums in double precision".to_owned(),
            seconds,
            error: whole::ERROR,
            memory,
            engine: Engine::Whole,
            ..first.clone()
        })
    })
}

/// Runs an engine: its field, and the bound of its model.
fn run(points: &[PointSource], sum: &PointSum, plan: &Plan) -> Result<(Field, f64)> {
    let PointSum { optics, grid, sources, cull, progress } = *sum;
    let set = plan.instruction_set;
    let division = |products: Products, error: f64| {
        let division = Division::new(sum, products, error);
        progress.check().map(|()| division)
    };
    let cloud = || {
        let cloud = planes::Cloud::new(optics, grid, sources);
        progress.check().map(|()| cloud)
    };
    Ok(match plan.engine {
        Engine::Oracle => (oracle::watched(points, grid, optics.wavelength, cull, progress)?.to_f32(), ORACLE_ERROR),
        Engine::Exact { error } => {
            let division = division(Products::of(set), error)?;
            (division.sum(sum, set)?, division.error)
        }
        Engine::Whole => (whole::field(sum)?, whole::ERROR),
        Engine::Recurrence { error } => {
            let division = division(Products::Float, error)?;
            (division.sum_by_recurrence(sum, error, set)?, division.blocks(optics, error).1)
        }
        Engine::Gpu { error } => {
            let division = division(Products::Shader, error)?;
            (division.sum_on_gpu(sum)?, division.gpu_error())
        }
        Engine::GpuPlanes(parameters) => {
            let cloud = cloud()?;
            (gpu_planes(&cloud, &parameters, progress)?, parameters.error(&cloud) + GPU_ROUNDING)
        }
        Engine::Planes(parameters) => {
            let cloud = cloud()?;
            (planes::field(&cloud, &parameters, set, progress)?, parameters.error(&cloud))
        }
    })
}

#[cfg(feature = "gpu")]
pub(super) use super::gpu::planes::field as gpu_planes;

/// A build without the engine.
#[cfg(not(feature = "gpu"))]
pub(super) fn gpu_planes(_: &planes::Cloud, _: &planes::Parameters, _: &Progress) -> Result<Field> {
    Err(super::exact::no_gpu())
}
