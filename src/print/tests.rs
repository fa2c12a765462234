//! Tiles against an oracle, seams, previews.
