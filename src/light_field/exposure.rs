//! The views in the light of one exposure: one channel of a light field.

use super::LightField;
use crate::points::{Channel, Exposure, Share};
use rayon::prelude::*;
use std::borrow::Cow;

impl LightField {
    /// The views as an exposure's laser shows them, in one channel: red, green and blue become what one laser shows of them, as of
    /// the points of a cloud ([`Exposure::points`]). Views of one channel are shown alike by every laser.
    pub fn of_exposure(&self, exposure: &Exposure) -> Cow<'_, Self> {
        let [red, green, blue] = self.channels.as_slice() else { return Cow::Borrowed(self) };
        let radiance = |of: &(dyn Fn([f32; 3]) -> f32 + Sync)| -> Vec<f32> {
            let each = red.par_iter().zip(green).zip(blue);
            each.map(|((&r, &g), &b)| of([r, g, b].map(|code| self.radiance(code)))).collect()
        };
        let values = match exposure.share {
            Share::Whole(channel) | Share::SubFrame { channel, .. } => radiance(&|rgb| Channel::of(channel, rgb)),
            Share::Laser { lasers, index, .. } => radiance(&|rgb| lasers.drive(rgb).values[index]),
        };
        let peak = values.par_iter().copied().reduce(|| 0.0, f32::max).max(f32::MIN_POSITIVE);
        let codes = values.par_iter().map(|&value| Self::code(value, peak)).collect();
        Cow::Owned(Self { channels: vec![codes], peak, middle_depths: self.middle_depths.clone(), ..*self })
    }

    /// Whether all of it is dark.
    pub fn is_dark(&self) -> bool {
        self.channels.iter().all(|channel| channel.par_iter().all(|&code| code == 0))
    }
}
