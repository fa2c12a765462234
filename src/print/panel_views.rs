//! True views on a panel: its field computed as a plate's is, in segments that each see the scene from their own place.
//!
//! From the few degrees that a panel sends light into, a viewer sees mirrors, gloss and edges move a little as the head
//! does; and a large panel seen from near sees round corners. There is no reference wave, and the whole band is the
//! object's.

use super::fringe::{Maker, Work};
use super::geometry::{fringe_area, pieces};
use super::plate::{Binarisation, Plate, Polarity, Quantity};
use super::reference::Reference;
use super::scene::Task;
use super::views::Source;
use crate::error::{Error, Result};
use crate::field::{Field, Grid};
use crate::hologram::InstructionSet;
use crate::points::budget::EYE_ANGLE;
use crate::progress::Progress;

/// A panel that shows true views of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct PanelViews {
    /// The panel's pixels, centred.
    pub grid: Grid,
    /// Wavelength [m].
    pub wavelength: f64,
    /// Distance of the viewer's eye [m].
    pub viewer: f64,
    /// z of the scene's middle [m].
    pub place: f64,
    /// Metres at the panel for one of the scene; fitted into the view where `None`.
    pub scale: Option<f64>,
    /// Side of a segment [px].
    pub segment: u64,
    /// Largest relative error of the field.
    pub error: f64,
    /// Seed of phases and rays.
    pub seed: u64,
}

/// The field and what it took.
#[derive(Clone, Debug)]
pub struct SeenField {
    /// The field on the panel.
    pub field: Field,
    /// Lowest and highest z of the scene [m].
    pub depths: [f64; 2],
    /// Segments, points, pairs and times.
    pub work: Work,
}

impl PanelViews {
    fn plate(&self) -> Result<Plate> {
        let Self { grid, segment, .. } = self;
        let least = grid.width.min(grid.height) as u64;
        if !(16..=least).contains(segment) {
            return Err(Error::parameter("views", format!("segments of {segment} pixels; give 16 to {least}")));
        }
        Ok(Plate {
            name: "panel".into(),
            width: grid.width as u64,
            height: grid.height as u64,
            pitch_x: grid.pitch_x,
            pitch_y: grid.pitch_y,
            wavelength: self.wavelength,
            reference: Reference::None,
            // A field has neither bias nor conjugate.
            quantity: Quantity::Phase,
            bits: 8,
            binarisation: Binarisation::default(),
            bias: 0.5,
            contrast: 1.0,
            percentile: 0.999,
            reference_ratio: 1.0,
            polarity: Polarity::default(),
            mirror: false,
            rotation: 0,
            guard: 0,
            marks: 0,
            tile: least,
            segment: *segment,
            slit: None,
            viewer: self.viewer,
            resolution: EYE_ANGLE,
            rays: 2,
            place: self.place,
            scale: self.scale,
            object_angle: None,
            error: self.error,
            seed: self.seed,
        })
    }

    /// Lights the task's scene and computes the field.
    ///
    /// # Errors
    /// As [`Task::with`]; [`Error::Parameter`] for segments that do not fit the panel, a cloud, which hides nothing, and a
    /// scene of which the panel shows nothing.
    pub fn field(&self, task: &Task, instruction_set: InstructionSet, progress: &Progress) -> Result<SeenField> {
        let plate = self.plate()?;
        task.with(&plate, None, instruction_set, progress, |maker: &Maker| {
            let Source::Scene(views) = maker.source else {
                return Err(Error::parameter("views", "points are the same from everywhere; give a scene"));
            };
            let depths = views.depths();
            let whole = fringe_area(&plate);
            let mut field = Field::zeros(self.grid, self.wavelength);
            let mut work = Work::default();
            let pieces = pieces(&plate, &whole, &whole);
            progress.start("views", pieces.len() as u64);
            for piece in pieces {
                let rect = piece.rect;
                let (samples, took) = maker.field(&rect, &[piece], progress)?;
                work += took;
                for (row, line) in (rect.y[0]..rect.y[1]).zip(samples.chunks_exact(rect.width())) {
                    let at = row as usize * self.grid.width + rect.x[0] as usize;
                    field.samples[at..at + line.len()].copy_from_slice(line);
                }
                progress.advance(1);
            }
            if work.points == 0 {
                return Err(Error::parameter("views", "nothing of the scene is in the panel's view"));
            }
            Ok(SeenField { field, depths, work })
        })
    }
}
