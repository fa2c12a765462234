//! Sub-frames: patterns that are shown faster than an eye sees, so that it sees the mean of their light.

use super::{Channel, PointCloud, PointSource};
use crate::error::{Error, Result};
use crate::random::Random;

/// How sub-frames share a cloud's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multiplexing {
    /// All points in each, with phases of their own: speckle patterns that are averaged, contrast as 1/√N.
    Phases,
    /// Every N-th point in each: neighbours do not interfere where their spots overlap.
    Sparse,
}

/// N sub-frames of one picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SubFrames {
    /// How many.
    pub count: usize,
    /// What each shows of the points.
    pub multiplexing: Multiplexing,
    /// Seed of the phases, which differ from sub-frame to sub-frame.
    pub seed: u64,
}

impl SubFrames {
    /// Most sub-frames: a DMD shows thousands a second, an eye ten pictures.
    pub const MOST: usize = 256;

    /// So many sub-frames.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for none of them or more than [`SubFrames::MOST`].
    pub fn new(count: usize, multiplexing: Multiplexing, seed: u64) -> Result<Self> {
        if !(1..=Self::MOST).contains(&count) {
            return Err(Error::out_of_range("subframes", count, format!("must be 1 … {}", Self::MOST)));
        }
        Ok(Self { count, multiplexing, seed })
    }

    /// The points of one sub-frame, `index` from 0, with random phases.
    pub fn points(&self, cloud: &PointCloud, channel: Channel, index: usize) -> Vec<PointSource> {
        let mut points = cloud.channel(channel);
        let stream = self.seed.wrapping_add(1 + index as u64);
        points.iter_mut().enumerate().for_each(|(i, p)| p.phase = Random::new(stream, i as u64).phase());
        match self.multiplexing {
            Multiplexing::Phases => points,
            Multiplexing::Sparse => points.into_iter().skip(index).step_by(self.count.max(1)).collect(),
        }
    }
}
