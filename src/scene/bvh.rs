//! Ray casting: the only file that names `obvhs`.

use glam::DVec3;

/// A ray in world space, double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start [m].
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}
