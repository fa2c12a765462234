//! The glTF loader: our own scenes, what the format can say, malformed files, and third-party files.
//!
//! `make_scenes.py` in this folder wrote the scenes in `scenes/`.

mod animation;
mod builder;
mod extensions;
mod features;
mod fuzz;
mod malformed;
mod materials;
mod own_scenes;
mod played;
mod third_party;
