//! Rectangles of the desktop.

use std::fmt;

/// A rectangle of the desktop [px].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) x: i32,
    pub(super) y: i32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl fmt::Display for Rectangle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{} at {},{}", self.width, self.height, self.x, self.y)
    }
}

impl Rectangle {
    pub(super) fn meets(&self, other: &Self) -> bool {
        let apart = |a: i32, a_size: u32, b: i32, b_size: u32| {
            i64::from(a) + i64::from(a_size) <= i64::from(b) || i64::from(b) + i64::from(b_size) <= i64::from(a)
        };
        !apart(self.x, self.width, other.x, other.width) && !apart(self.y, self.height, other.y, other.height)
    }
}
