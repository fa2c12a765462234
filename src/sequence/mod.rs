//! Frames in time.
//!
//! A sequence is either *prepared* ([`prepared`]): pictures, raw video, arrays of drive levels, one-bit planes; or an
//! *animated scene* ([`animated`]), each of whose frames is a hologram. A [`contact`] sheet shows one at a glance.

pub mod animated;
pub mod contact;
pub mod prepared;

pub use crate::reconstruction::Canvas;
pub use animated::{Animation, AnimationFrame, AnimationFrameReport};
pub use contact::ContactSheet;
pub use prepared::{Prepared, RawFormat, Shown, Source};
