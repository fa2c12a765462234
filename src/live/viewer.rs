//! What an eye sees of the newest hologram, reconstructed on a thread of its own.

use super::background::{Background, Desk};
use super::request::Detail;
use super::worker::LiveHologram;
use crate::error::{Error, Result};
use crate::panel::Frame;
use crate::pipeline::{self, Bench};
use crate::points::placement::Placing;
use crate::progress::Progress;
use crate::reconstruction::{self, ExposureLight, Picture, View};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Instant;

/// From where and at what depth the operator looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Depth in focus, z [m].
    pub focus: f64,
    /// The eye beside the viewer's place, x and y [m]; `None`: the whole panel's light on the plane in focus.
    pub eye: Option<[f64; 2]>,
    /// Diameter of the eye's pupil [m].
    pub pupil: f64,
}

impl Look {
    /// The view that it is of a hologram placed so.
    pub fn view(&self, placing: &Placing) -> View {
        match self.eye {
            None => View::Plane { z: self.focus },
            Some([x, y]) => {
                let [own_x, own_y, z] = placing.eye.to_array();
                View::Eye { position: [own_x + x, own_y + y, z], pupil: self.pupil, focus: self.focus }
            }
        }
    }
}

/// What the operator sees of a hologram.
#[derive(Clone, Debug)]
pub struct OperatorPicture {
    /// Number of the request.
    pub version: u64,
    /// How fine the hologram is.
    pub detail: Detail,
    /// From where it is seen.
    pub look: Look,
    /// Linear light.
    pub picture: Picture,
    /// Time that it took [s].
    pub seconds: f64,
}

/// The picture of a frame on the simulated bench.
///
/// # Errors
/// As [`pipeline::light`] and [`reconstruction::picture`].
pub fn reconstruct(
    frame: &Frame,
    placing: &Placing,
    look: &Look,
    size: (usize, usize),
    bench: &Bench,
    progress: &Progress,
) -> Result<Picture> {
    of_light(&pipeline::light(frame, bench, progress)?, placing, look, size, progress)
}

fn of_light(
    light: &ExposureLight,
    placing: &Placing,
    look: &Look,
    size: (usize, usize),
    progress: &Progress,
) -> Result<Picture> {
    let half = placing.view_at(look.focus);
    reconstruction::picture(&light.field, &look.view(placing), half, size, &light.settings, progress)
}

/// What is to be looked at next.
type Order = Option<(Arc<LiveHologram>, Look)>;

/// Reconstructs what was last asked for; ends when it is dropped.
pub struct Viewer(Background<Order, Result<OperatorPicture>>);

impl Viewer {
    /// A viewer whose pictures have this size (columns, rows) [px], of light on this bench.
    pub fn start(size: (usize, usize), bench: Bench) -> Self {
        Self(Background::start(None, move |desk, tell| work(desk, size, &bench, tell)))
    }

    /// Asks for a picture of this hologram; one that is being made is given up.
    pub fn ask(&self, hologram: &Arc<LiveHologram>, look: Look) {
        self.0.ask(|order| *order = Some((Arc::clone(hologram), look)));
    }

    /// A picture, or what was wrong, since the last call.
    ///
    /// # Errors
    /// Those of [`reconstruct`].
    pub fn poll(&self) -> Result<Option<OperatorPicture>> {
        self.0.poll("the reconstruction")?.transpose()
    }
}

fn work(desk: &Desk<Order>, size: (usize, usize), bench: &Bench, tell: &Sender<Result<OperatorPicture>>) {
    // The light of one hologram serves all looks at it.
    let mut light: Option<((u64, Detail), ExposureLight)> = None;
    while let Some(((hologram, look), running)) = desk.next(Option::take) {
        let begin = Instant::now();
        let known = (hologram.version, hologram.detail);
        let made = (|| {
            if light.as_ref().is_none_or(|(of, _)| *of != known) {
                light = Some((known, pipeline::light(&hologram.frame, bench, &running)?));
            }
            let Some((_, light)) = &light else { return Err(Error::Interrupted) };
            let picture = of_light(light, &hologram.points.view.placing, &look, size, &running)?;
            running.check()?;
            let seconds = begin.elapsed().as_secs_f64();
            Ok(OperatorPicture { version: hologram.version, detail: hologram.detail, look, picture, seconds })
        })();
        if !matches!(made, Err(Error::Interrupted)) && tell.send(made).is_err() {
            return;
        }
    }
}
