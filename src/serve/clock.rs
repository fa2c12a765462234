//! The clock that programs on one machine share: an instant as seconds since a start that is the same for all of them.

use std::time::Instant;

/// The moment `at` on the system's monotonic clock [s], as Python's `time.monotonic()` and C's `clock_gettime` tell it.
///
/// None where that clock cannot be read, or is not the one of [`Instant`] (macOS, Windows).
#[cfg(all(unix, not(target_vendor = "apple")))]
pub fn monotonic_seconds(at: Instant) -> Option<f64> {
    use rustix::time::{ClockId, clock_gettime};
    let (before, clock) = (Instant::now(), clock_gettime(ClockId::Monotonic));
    let clock = clock.tv_sec as f64 + clock.tv_nsec as f64 * 1e-9;
    // Both are the same clock, so that only the time between the two readings is an error: below a microsecond.
    Some(match at.checked_duration_since(before) {
        Some(ahead) => clock + ahead.as_secs_f64(),
        None => clock - before.duration_since(at).as_secs_f64(),
    })
}

/// The moment `at` on the system's monotonic clock [s]: here it is not that of [`Instant`].
#[cfg(not(all(unix, not(target_vendor = "apple"))))]
pub fn monotonic_seconds(_: Instant) -> Option<f64> {
    None
}

#[cfg(all(test, unix, not(target_vendor = "apple")))]
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
