//! Frames that are kept ready, shown one after another at a rate.

use super::output::{Output, Readiness};
use super::{Flip, FrameRequest};
use crate::progress::Progress;
use std::time::{Duration, Instant};

/// Longest time between two looks at the output.
const LONGEST_TURN: Duration = Duration::from_millis(5);

/// Shows the frames of these numbers in turn, the first at once; `rate` [Hz], none: one at each refresh.
///
/// Frame k is due k/rate after the first; on a monitor it goes to the vertical blank nearest to that. A late frame is shown
/// all the same, so that none is left out, and those after it are late by what it took: each has its whole time. The error is an answer
/// to the client.
pub(super) fn play(
    numbers: &[u64],
    rate: Option<f64>,
    request: &FrameRequest,
    output: &mut dyn Output,
    progress: &Progress,
) -> Result<Vec<Flip>, String> {
    let refresh = output.refresh();
    let period = Duration::from_secs_f64(rate.map_or(refresh.unwrap_or(0.0), |rate| 1.0 / rate));
    let early = Duration::from_secs_f64(0.5 * refresh.unwrap_or(0.0));
    let mut flips: Vec<Flip> = Vec::with_capacity(numbers.len());
    let mut due = Instant::now();
    for &number in numbers {
        if !flips.is_empty() && rate.is_some() {
            wait(due - early.min(period / 2), output)?;
        }
        if progress.stopped() || request.is_abandoned() {
            return Err(format!("The play was ended after {} of {} frames.", flips.len(), numbers.len()));
        }
        if let Readiness::Absent { why } = output.attend().map_err(told)? {
            return Err(format!("{why} (after {} of {} frames)", flips.len(), numbers.len()));
        }
        let shown = output.recall(number).map_err(told)?;
        let late = shown.at.saturating_duration_since(due).as_secs_f64();
        let missed = match (refresh, flips.is_empty()) {
            (Some(refresh), false) => (late / refresh).round() as u64,
            _ => 0,
        };
        flips.push(Flip { at: shown.at, number: shown.number, missed });
        // The first sets the time; without a rate each does.
        due = if flips.len() == 1 || rate.is_none() || missed > 0 { shown.at } else { due } + period;
    }
    Ok(flips)
}

/// Waits until `due`, looking after the output.
fn wait(due: Instant, output: &mut dyn Output) -> Result<(), String> {
    loop {
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(());
        }
        if left > LONGEST_TURN {
            output.attend().map_err(told)?;
        }
        std::thread::sleep(left.min(LONGEST_TURN));
    }
}

fn told(error: crate::Error) -> String {
    error.to_string()
}
