//! How radiance is put into a light field's 16 bits, piece by piece, before its peak is known.

use super::{LightField, LightFieldSettings};
use crate::points::Channel;
use glam::Vec3;
use rayon::prelude::*;

impl LightFieldSettings {
    /// Radiance over white's as it is shown: what is brighter than white burns out, its hue kept, where the white clips.
    pub(super) fn shown(&self, radiance: Vec3, white: f32) -> Vec3 {
        let over = radiance.max(Vec3::ZERO) / white;
        let brightness = over.max_element();
        if self.clips && brightness > 1.0 { over / brightness } else { over }
    }
}

impl LightField {
    /// The same stretch of samples of every channel, one after another: rows for `len` of a row, views for that of a view.
    pub(super) fn pieces(&mut self, len: usize) -> Vec<Vec<&mut [u16]>> {
        let mut channels: Vec<_> = self.channels.iter_mut().map(|channel| channel.chunks_mut(len)).collect();
        let count = channels.iter().map(ExactSizeIterator::len).min().unwrap_or(0);
        (0..count).map(|_| channels.iter_mut().filter_map(Iterator::next).collect()).collect()
    }

    /// Brings pieces of `len` samples that were coded each with a peak of its own to that of all.
    pub(super) fn level(&mut self, peaks: &[f32], len: usize) {
        let peak = peaks.iter().fold(1.0f32, |most, peak| most.max(*peak));
        self.peak = peak;
        for channel in &mut self.channels {
            channel.par_chunks_mut(len).zip(peaks).filter(|(_, own)| **own != peak).for_each(|(codes, own)| {
                let scale = (own / peak).sqrt();
                codes.iter_mut().for_each(|code| *code = (f32::from(*code) * scale + 0.5) as u16);
            });
        }
    }
}

/// Codes radiance over white's into one piece of each channel; returns the piece's own peak, at least 1.
pub(super) fn put(light: &[Vec3], channel: Option<Channel>, codes: &mut [&mut [u16]]) -> f32 {
    let one = |k: usize, light: &Vec3| channel.map_or(light[k], |channel| channel.of(light.to_array()));
    let each = || codes.iter().enumerate().flat_map(|(k, _)| light.iter().map(move |light| one(k, light)));
    let peak = each().fold(1.0, f32::max);
    for (k, codes) in codes.iter_mut().enumerate() {
        codes.iter_mut().zip(light).for_each(|(code, light)| *code = LightField::code(one(k, light), peak));
    }
    peak
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Grid;
    use crate::light_field::{EyeGrid, Viewer};
    use glam::{DVec2, DVec3};

    #[test]
    fn pieces_with_peaks_of_their_own_become_one_field() {
        let eyes = EyeGrid::over(Viewer::at(DVec3::Z).eye, DVec2::new(1e-3, 0.0), 0.5e-3).expect("eyes");
        let window = Grid::new(5, 3, 1e-3, 1e-3).expect("window");
        let mut field = LightField::black(eyes, window, 3).expect("field");
        let light = |piece: usize, i: usize| Vec3::new(0.01, 0.3, 1.0) * (1 + piece * 5 + i) as f32 / 4.0;
        let mut pieces = field.pieces(5);
        assert_eq!((pieces.len(), pieces[0].len()), (9, 3));
        let put = |(piece, codes): (usize, &mut Vec<&mut [u16]>)| {
            let line: Vec<Vec3> = (0..5).map(|i| light(piece, i)).collect();
            put(&line, None, codes)
        };
        let peaks: Vec<f32> = pieces.iter_mut().enumerate().map(put).collect();
        drop(pieces);
        field.level(&peaks, 5);
        assert_eq!(field.peak, 45.0 / 4.0);
        for channel in 0..3 {
            for i in 0..45 {
                let (found, expected) = (field.radiance(field.channels[channel][i]), light(i / 5, i % 5)[channel]);
                // A code is off by up to one of 65535 steps of amplitude.
                let step = 2.0 * (expected * field.peak).sqrt() / LightField::FULL;
                assert!((found - expected).abs() <= 1.1 * step + 1e-6, "{channel} {i}: {found} is not {expected}");
            }
        }
    }

    #[test]
    fn light_above_white_burns_out_with_its_hue_or_is_kept() {
        let settings = LightFieldSettings::default();
        assert_eq!(settings.shown(Vec3::new(8.0, 4.0, -1.0), 2.0), Vec3::new(1.0, 0.5, 0.0));
        let kept = LightFieldSettings { clips: false, ..settings };
        assert_eq!(kept.shown(Vec3::new(8.0, 4.0, 2.0), 2.0), Vec3::new(4.0, 2.0, 1.0));
    }
}
