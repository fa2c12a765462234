//! What goes into the whole way, and what comes out of it.

use crate::encode::{EncodeOptions, Encoded};
use crate::hologram::{Computed, HologramSettings};
use crate::light_field::{LightFieldSettings, Viewer};
use crate::panel::simulated::Simulation;
use crate::points::{Channel, Exposure, ScenePoints, SceneSettings, SubFrames};
use crate::reconstruction::{Gallery, SeenGallery};

/// How each step is done.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Scene → points.
    pub scene: SceneSettings,
    /// Which light of a coloured cloud one laser shows.
    pub channel: Channel,
    /// Several frames for one picture, in one laser.
    pub sub_frames: Option<SubFrames>,
    /// Points → fields.
    pub hologram: HologramSettings,
    /// Fields → frames.
    pub encode: EncodeOptions,
    /// Who looks, where frames are made for an eye or judged by what it sees.
    pub viewer: Viewer,
    /// Frames → light.
    pub bench: Bench,
}

impl Settings {
    /// How the views of a light field are made with these settings: in one channel for one laser, in colour for three.
    pub(crate) fn light_field(&self, lasers: bool) -> LightFieldSettings {
        LightFieldSettings {
            channel: (!lasers).then_some(self.channel),
            bounces: self.scene.trace.bounces,
            seed: self.scene.trace.seed,
            viewer: Some(self.viewer),
            ..LightFieldSettings::default()
        }
    }
}

/// The simulated bench: the panel's faults, and the stop behind it.
#[derive(Clone, Debug, Default)]
pub struct Bench {
    /// What the panel does beside what it should.
    pub simulation: Simulation,
    /// Angle about the axis that a stop in the Fourier plane of the encoding's relay blocks [rad].
    pub zero_order_stop: f64,
}

/// One exposure's frame, and the field that it was made from.
#[derive(Clone, Debug)]
pub struct Hologram {
    /// Its laser and its share of the points.
    pub exposure: Exposure,
    /// The field on the panel; none for a frame that was made for an eye.
    pub computed: Option<Computed>,
    /// The frame for the panel.
    pub encoded: Encoded,
}

/// What came out of the whole way.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The scene as points, and the traced picture.
    pub points: ScenePoints,
    /// Field and frame of each exposure; `None` for one of three lasers that has no light.
    pub holograms: Vec<Option<Hologram>>,
    /// What is seen of them on the simulated bench with the whole panel as aperture, with figures: of a field's encodings. A frame for
    /// an eye ([`Encoding::View`]) shows nothing there that it was made for: of it look at `seen`.
    pub pictures: Gallery,
    /// What the viewer sees of them through the pupil, with figures.
    pub seen: SeenGallery,
}
