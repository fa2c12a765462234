//! The clock that programs on one machine share: an instant as seconds since a start that is the same for all of them.

use std::time::Instant;

/// The moment `at` on the system's monotonic clock [s], as Python's `time.monotonic()` and C's `clock_gettime` tell it.
///
/// None where that clock cannot be read.
pub fn monotonic_seconds(at: Instant) -> Option<f64> {
    let (before, clock) = (Instant::now(), now()?);
    // Both are the same clock, so that only the time between the two readings is an error: below a microsecond.
    Some(match at.checked_duration_since(before) {
        Some(ahead) => clock + ahead.as_secs_f64(),
        None => clock - before.duration_since(at).as_secs_f64(),
    })
}

#[cfg(unix)]
fn now() -> Option<f64> {
    // The clocks behind `Instant` and behind Python's `time.monotonic`.
    #[cfg(target_vendor = "apple")]
    const CLOCK: libc::clockid_t = libc::CLOCK_UPTIME_RAW;
    #[cfg(not(target_vendor = "apple"))]
    const CLOCK: libc::clockid_t = libc::CLOCK_MONOTONIC;
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is ours and lives through the call, which writes nothing else.
    let told = unsafe { libc::clock_gettime(CLOCK, &raw mut time) };
    (told == 0).then_some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn now() -> Option<f64> {
    None
}

/// The user that runs this process.
#[cfg(unix)]
pub(super) fn user() -> u32 {
    // SAFETY: takes nothing, writes nothing, cannot fail.
    unsafe { libc::geteuid() }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_before_and_after_now_differ_by_what_lies_between() {
        let now = Instant::now();
        let at = |when: Instant| monotonic_seconds(when).expect("clock");
        let (one, early, late) = (at(now), at(now - Duration::from_millis(250)), at(now + Duration::from_secs(3)));
        // Readings of the clock lie microseconds apart; a busy machine may stop this thread between them.
        assert!((one - early - 0.25).abs() < 0.05, "{one} {early}");
        assert!((late - one - 3.0).abs() < 0.05, "{one} {late}");
    }
}
