//! What clients ask of the panel, and what they are told.

use super::Flip;
use std::time::Duration;

/// Most frames of one play: their times are one line of an answer.
pub const MOST_PLAYED: usize = 32_768;
/// Longest name of a frame [bytes].
const LONGEST_NAME: usize = 64;
/// Rates that make sense [Hz].
const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e4;
/// Longest wait for a frame of a play without a rate: that of a slow monitor's refresh, many times over.
const SLOWEST: Duration = Duration::from_millis(100);

/// What is asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Task {
    /// The frame that was sent is shown.
    #[default]
    Show,
    /// The frame that was sent is made ready and kept under this name, in place of one that has it.
    Preload(String),
    /// The frame that is kept under this name is shown.
    Recall(String),
    /// The frames of these names are shown in turn.
    Play {
        /// Names, each as often as it is shown.
        names: Vec<String>,
        /// Frames a second [Hz]; none: one at each refresh of the monitor.
        rate: Option<f64>,
    },
    /// The list that triggers go through, from its beginning; after its last frame it begins anew. Empty: none.
    Arm(Vec<String>),
    /// The next frame of the armed list is shown.
    Next,
    /// The frames of these names are kept no longer; all, where none is named.
    Forget(Vec<String>),
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Done {
    /// The frame is on the panel.
    Shown(Flip),
    /// The frames were, one after another.
    Played(Vec<Flip>),
    /// So many frames are kept ready.
    Kept(usize),
}

impl Task {
    /// Refuses names and rates that cannot be.
    pub(super) fn check(&self) -> Result<(), String> {
        let names = match self {
            Self::Preload(name) | Self::Recall(name) => std::slice::from_ref(name),
            Self::Play { names, .. } | Self::Arm(names) | Self::Forget(names) => names,
            Self::Show | Self::Next => &[],
        };
        let wrong = |name: &&String| name.is_empty() || name.len() > LONGEST_NAME || name.chars().any(char::is_control);
        if let Some(name) = names.iter().find(wrong) {
            return Err(format!(
                "{name:?} is no name of a frame: up to {LONGEST_NAME} bytes without control characters."
            ));
        }
        match self {
            Self::Play { names, .. } if names.is_empty() || names.len() > MOST_PLAYED => {
                Err(format!("A play of {} frames; 1 to {MOST_PLAYED} are taken.", names.len()))
            }
            Self::Play { rate: Some(rate), .. } if !RATES.contains(rate) => {
                Err(format!("{rate} frames per second; {} to {} are taken.", RATES.start(), RATES.end()))
            }
            _ => Ok(()),
        }
    }

    /// How long it takes where nothing goes wrong, beside what every request takes.
    pub(super) fn lasts(&self) -> Duration {
        match self {
            Self::Play { names, rate: Some(rate) } => Duration::from_secs_f64(names.len() as f64 / rate),
            Self::Play { names, rate: None } => SLOWEST * names.len() as u32,
            _ => Duration::ZERO,
        }
    }
}

impl Done {
    /// The last frame that came on the panel, if one did.
    pub(super) fn last(&self) -> Option<&Flip> {
        match self {
            Self::Shown(flip) => Some(flip),
            Self::Played(flips) => flips.last(),
            Self::Kept(_) => None,
        }
    }
}
