//! When the frames of a sequence were due and came, counted as they are played.

use serde::Serialize;
use std::collections::VecDeque;

/// Frames of which waits are kept: the last ones of a long play.
const MOST_TIMES: usize = 65_536;

/// When one frame was due and came. Times are from the first frame [s], on a monotonic clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameTime {
    /// Running number, from 0.
    pub number: u64,
    /// When it should have been handed over: up to half a refresh before or after, at the nearest vertical blank.
    pub due: f64,
    /// When it had been made; before the first was shown this is below zero.
    pub ready: f64,
    /// When the window system had taken it.
    pub presented: f64,
    /// When the modulator had settled on it; none where another frame came before.
    pub settled: Option<f64>,
    /// Refreshes of the monitor by which it was handed over late.
    pub missed: u64,
    /// Whether it was late because it had not been made in time.
    pub starved: bool,
    /// False when the window system would not take it: it was not on the panel.
    pub taken: bool,
    /// The monitor's count of vertical blanks just before it was handed over, where the X server tells.
    pub vertical_blank: Option<u64>,
}

/// How well a sequence was played.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameStatistics {
    /// Refreshes of the monitor that showed an old frame because the next one was late.
    pub missed: u64,
    /// Frames that had not been made when they were due.
    pub starved: u64,
    /// Frames that the window system would not take.
    pub refused: u64,
    /// Frames that were replaced before the modulator had settled on them.
    pub unsettled: u64,
    /// From a frame's being handed over until the window system had taken it, of the last 65,536: the median, and the
    /// longest [s].
    pub presenting: [f64; 2],
    /// From a frame's being made until the window system had taken it, likewise.
    #[serde(skip)]
    pub waiting: [f64; 2],
    /// Mean time between frames [s].
    pub mean_interval: f64,
    /// Longest time between frames [s].
    pub longest_interval: f64,
}

/// The frames of a play, told one by one as the modulator settles on them.
pub(super) struct FrameTimes<'a> {
    told: &'a mut dyn FnMut(&FrameTime),
    /// From a frame's being presented until the modulator has settled on it [s].
    settle: f64,
    /// Frames that are on the panel, or were, and have not been told of.
    untold: VecDeque<FrameTime>,
    presenting: Waits,
    waiting: Waits,
    frames: u64,
    /// When the last frame was presented [s].
    pub(super) last: f64,
    statistics: FrameStatistics,
}

impl<'a> FrameTimes<'a> {
    /// Begins with the first frame, made at `ready` [s].
    pub(super) fn begin(ready: f64, settle: f64, told: &'a mut dyn FnMut(&FrameTime)) -> Self {
        let first = FrameTime { ready, taken: true, ..FrameTime::default() };
        Self {
            told,
            settle,
            untold: VecDeque::from([first]),
            presenting: Waits::default(),
            waiting: Waits(VecDeque::from([-ready])),
            frames: 1,
            last: 0.0,
            statistics: FrameStatistics::default(),
        }
    }

    /// Counts a frame that was handed over at `handed_over` [s].
    pub(super) fn add(&mut self, time: FrameTime, handed_over: f64) {
        self.presenting.add(time.presented - handed_over);
        self.waiting.add(time.presented - time.ready);
        self.untold.push_back(time);
        self.frames += 1;
        let counts = &mut self.statistics;
        counts.missed += time.missed;
        counts.starved += u64::from(time.starved);
        counts.refused += u64::from(!time.taken);
        counts.longest_interval = counts.longest_interval.max(time.presented - self.last);
        self.last = time.presented;
    }

    /// Tells of the frames that have settled by `now`; of all where what has not is about to be `replaced`.
    pub(super) fn tell(&mut self, now: f64, replaced: bool) {
        while let Some(mut time) = self.untold.pop_front() {
            let settles = time.presented + self.settle;
            if settles <= now && time.taken {
                time.settled = Some(settles);
            } else if replaced || !time.taken {
                self.statistics.unsettled += u64::from(time.taken);
            } else {
                self.untold.push_front(time);
                return;
            }
            (self.told)(&time);
        }
    }

    /// The figures of all that was played.
    pub(super) fn statistics(self) -> FrameStatistics {
        let mean_interval = if self.frames > 1 { self.last / (self.frames - 1) as f64 } else { 0.0 };
        FrameStatistics {
            presenting: self.presenting.median_and_longest(),
            waiting: self.waiting.median_and_longest(),
            mean_interval,
            ..self.statistics
        }
    }
}

/// The last waits [s].
#[derive(Default)]
struct Waits(VecDeque<f64>);

impl Waits {
    fn add(&mut self, seconds: f64) {
        if self.0.len() == MOST_TIMES {
            self.0.pop_front();
        }
        self.0.push_back(seconds);
    }

    fn median_and_longest(mut self) -> [f64; 2] {
        let sorted = self.0.make_contiguous();
        sorted.sort_by(f64::total_cmp);
        [sorted.get(sorted.len() / 2).copied().unwrap_or(0.0), sorted.last().copied().unwrap_or(0.0)]
    }
}
