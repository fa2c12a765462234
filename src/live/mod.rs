//! A hologram that follows its scene: computed again when the scene's file changes or somebody moves it, coarse at once and
//! finer while nothing moves.
//!
//! A [`Worker`] computes on a thread of its own. A new [`Request`] stops what is running and begins with the coarse level; the
//! light on surfaces is kept as long as the file is the same, since turning the scene only moves the eye. Frames that are made for
//! an eye follow it: each goes on from the one before. A file that
//! cannot be read is told, and the last good scene stays. [`Watch`] sees files change. A [`Viewer`] reconstructs what an eye
//! sees of the newest hologram, and [`draw`] puts the operator's view together.

mod background;
mod request;
mod tracked;
mod view;
mod viewer;
mod watch;
mod worker;

pub use request::{Detail, Request};
pub use view::{Board, Histogram, PICTURE, SIZE, draw};
pub use viewer::{Look, OperatorPicture, Viewer, reconstruct};
pub use watch::Watch;
pub use worker::{LiveHologram, Worker, WorkerEvent};
