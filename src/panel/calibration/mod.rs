//! Finding a panel's curve and bend from what a detector saw: the panel shows known frames, the powers come back as numbers.

pub mod curve;
pub mod flatness;
pub mod zernike;

pub use curve::{CurveFit, fit_curve, read_powers, sweep_frame};
pub use flatness::{bend_from_steps, step_frames};

#[cfg(test)]
mod tests;
