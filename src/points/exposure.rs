//! Which patterns together make one picture, and which points each of them shows.
//!
//! One laser shows one pattern, three lasers show three, and sub-frames show N whose light an eye averages: lists of 1, 3
//! and N [`Exposure`]s that every step after the points walks in one loop.

use super::colour::{Gamut, Lasers, NAMES};
use super::placement::path_phase;
use super::{Channel, PointCloud, PointSource, SubFrames};
use glam::DVec3;

/// One pattern on the panel under one laser.
#[derive(Clone, Copy, Debug)]
pub struct Exposure {
    /// Vacuum wavelength of its laser [m].
    pub wavelength: f64,
    /// Which light of the cloud it shows.
    pub share: Share,
}

/// The share of a cloud's light that one exposure shows.
#[derive(Clone, Copy, Debug)]
pub enum Share {
    /// All points, as one channel of their colours.
    Whole(Channel),
    /// All points, as one of three lasers shows them.
    Laser {
        /// The three.
        lasers: Lasers,
        /// Which of them, 0 red to 2 blue.
        index: usize,
        /// Eye to which the phases are those of paths, if they are: they differ from laser to laser.
        path_eye: Option<DVec3>,
    },
    /// One of several sub-frames.
    SubFrame {
        /// Channel of the colours.
        channel: Channel,
        /// All of them.
        frames: SubFrames,
        /// Which, from 0.
        index: usize,
    },
}

impl Exposure {
    /// The one exposure of one laser.
    pub fn whole(channel: Channel, wavelength: f64) -> Vec<Self> {
        vec![Self { wavelength, share: Share::Whole(channel) }]
    }

    /// The exposures of three lasers, red, green, blue.
    pub fn of_lasers(lasers: &Lasers, path_eye: Option<DVec3>) -> Vec<Self> {
        let share = |index| Share::Laser { lasers: *lasers, index, path_eye };
        let wavelengths = lasers.wavelengths().into_iter().enumerate();
        wavelengths.map(|(index, wavelength)| Self { wavelength, share: share(index) }).collect()
    }

    /// Sub-frames of one laser.
    pub fn of_sub_frames(frames: SubFrames, channel: Channel, wavelength: f64) -> Vec<Self> {
        let share = |index| Share::SubFrame { channel, frames, index };
        (0..frames.count).map(|index| Self { wavelength, share: share(index) }).collect()
    }

    /// The points that it shows, with their amplitudes and phases.
    pub fn points(&self, cloud: &PointCloud) -> Vec<PointSource> {
        match self.share {
            Share::Whole(channel) => cloud.channel(channel),
            Share::Laser { lasers, index, path_eye } => {
                let mut points = lasers.points(cloud, index);
                if let Some(eye) = path_eye {
                    let phase = |p: &PointSource| path_phase((eye - p.position).length(), self.wavelength);
                    points.iter_mut().for_each(|p| p.phase = phase(p));
                }
                points
            }
            Share::SubFrame { channel, frames, index } => frames.points(cloud, channel, index),
        }
    }

    /// Whether both are sub-frames of one picture.
    pub fn is_shown_with(&self, other: &Self) -> bool {
        matches!([self.share, other.share], [Share::SubFrame { .. }, Share::SubFrame { .. }])
    }

    /// What the lasers' gamut does to a cloud; `None` for one laser.
    pub fn gamut(exposures: &[Self], cloud: &PointCloud) -> Option<Gamut> {
        exposures.iter().find_map(|exposure| match exposure.share {
            Share::Laser { lasers, .. } => Some(lasers.gamut(cloud)),
            _ => None,
        })
    }

    /// What it is called among the others, in words; empty where it is the only one.
    pub fn label(&self) -> String {
        match self.share {
            Share::Whole(_) => String::new(),
            Share::Laser { index, .. } => format!("{} of three lasers", NAMES[index]),
            Share::SubFrame { index, frames, .. } => format!("sub-frame {} of {}", index + 1, frames.count),
        }
    }

    /// What tells its files from the others': `frame-red.png`, `frame-000.png`; empty where it is the only one.
    pub fn suffix(&self) -> String {
        match self.share {
            Share::Whole(_) => String::new(),
            Share::Laser { index, .. } => format!("-{}", NAMES[index]),
            Share::SubFrame { index, .. } => format!("-{index:03}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Multiplexing;
    use super::*;

    fn cloud(count: usize) -> PointCloud {
        let at = |i| PointSource { position: DVec3::new(1e-4 * i as f64, 0.0, -0.1), amplitude: 1.0, phase: 0.0 };
        PointCloud { points: (0..count).map(at).collect(), rgb: None }
    }

    #[test]
    fn sparse_sub_frames_show_each_point_once_and_others_all_of_them() {
        let cloud = cloud(10);
        for (multiplexing, each) in [(Multiplexing::Sparse, vec![4, 3, 3]), (Multiplexing::Phases, vec![10; 3])] {
            let frames = SubFrames::new(3, multiplexing, 7).expect("three");
            let all = Exposure::of_sub_frames(frames, Channel::Luminance, 532e-9);
            let points: Vec<_> = all.iter().map(|exposure| exposure.points(&cloud)).collect();
            assert_eq!(points.iter().map(Vec::len).collect::<Vec<_>>(), each);
            let mut places: Vec<f64> = points.iter().flatten().map(|p| p.position.x).collect();
            places.sort_by(f64::total_cmp);
            places.dedup();
            assert_eq!(places.len(), 10, "every point is in some sub-frame");
            assert!(points[0][0].phase != points[1][0].phase, "phases of their own");
        }
        for count in [0, SubFrames::MOST + 1] {
            assert!(SubFrames::new(count, Multiplexing::Phases, 7).is_err());
        }
    }

    #[test]
    fn phases_of_paths_are_those_of_each_laser() {
        let lasers = Lasers::new([638e-9, 520e-9, 450e-9]).expect("lasers");
        let eye = DVec3::new(0.0, 0.0, 0.6);
        let cloud = cloud(3);
        for exposure in Exposure::of_lasers(&lasers, Some(eye)) {
            for point in exposure.points(&cloud) {
                let path = (eye - point.position).length();
                assert_eq!(point.phase, path_phase(path, exposure.wavelength));
            }
        }
    }
}
