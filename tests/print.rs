//! Plates as a user meets them.
