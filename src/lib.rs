//! # holodrive: from a glTF room to light on a panel
//!
//! A holographic display driver for spatial light modulators. Data goes one way, and each step hands on one type:
//!
//! ```text
//! glTF ──scene──▶ Scene ──illumination──▶ light on surfaces ──points──▶ PointCloud ──hologram──▶ Field
//!   Field ──encode──▶ PhasePattern | FringePattern ──panel──▶ Frame (drive levels) ──▶ display
//!   Frame ──panel::simulated──▶ Field ──reconstruction──▶ what an eye or a sensor sees, with figures
//! ```
//!
//! Every arrow can be entered or left through a file, so each step is useful alone.
//!
//! # Conventions
//!
//! *Frame.* The hologram frame is glTF camera space: metres, right-handed, +x right, +y up, +z towards the viewer. The
//! panel is the plane z = 0, centred. Points behind it have z < 0, points in front of it z > 0.
//!
//! *Wave.* The time factor is exp(−iωt); a diverging wave is exp(+ikr)/r; a longer path is a larger phase. A point
//! behind the panel sends exp(+ikr)/r through it; at a point in front the wave converges, exp(−ikr)/r on the panel.
//! Light travels towards +z: [`propagation`] over a distance d > 0 multiplies each plane wave by exp(+i2πf_z·d).
//!
//! *Transform.* Forward exp(−i2πfx), 1/N on the inverse ([`field::fft`] only). *Rows*: row-major, row 0 on top.
//! Index ↔ metre ↔ cycles/m conversions stand in [`field::grid`] only.
//!
//! *Units.* SI f64 inside, documented in square brackets, never part of a name; at the border ([`units`]) a length or
//! angle without a unit is an error. *Transforms* are named destination first: `hologram_from_world`.
//!
//! *Precision.* Directions, radiance and the BVH in f32; positions of point sources and every optical path in f64 (or
//! exact turns modulo one). Only a phase already reduced modulo one turn, or a complex sample, is narrowed to f32.
//!
//! *Reproducible.* Randomness takes a seed ([`random`]); results do not depend on the number of threads: work is
//! parallel over what is written, never over a float sum.
//!
//! *Warnings* are returned as values; only the binary prints.
//!
//! # Rooms, from the ground up
//!
//! A room uses only rooms that stand above it in this list; `tests/layering.rs` reads the list and keeps it so.
//!
//! 1. [`error`]: one error type, variants sorted by who can act
//! 2. [`names`]: closed sets whose values have names
//! 3. [`progress`]: how long work tells that it moves on, and is told to stop
//! 4. [`units`]: lengths and angles with units
//! 5. [`config`]: TOML files whose quantities have units; errors name file and key
//! 6. [`files`]: files that appear whole or not at all
//! 7. [`random`]: random numbers by seed and index
//! 8. [`field`]: complex samples on a grid; index ↔ metre ↔ cycles/m; Fourier transforms; `.npy`
//! 9. [`scene`]: glTF, triangles, materials, textures, lights, cameras, ray casting
//! 10. [`illumination`]: light arriving on surfaces: form factors, radiosity, direct light
//! 11. [`points`]: rays to point sources; how many, how bright, for which lasers; placement before the panel; PLY
//! 12. [`propagation`]: plane to plane
//! 13. [`hologram`]: points to the field on the panel: oracle, engines, planner
//! 14. [`panel`]: profiles, frames of drive levels, packing, the simulated panel
//! 15. [`encode`]: field to phase or fringes for a panel's levels and range
//! 16. [`reconstruction`]: field to pictures, gray or in three lasers' colours, and how good they are
//! 17. [`calibration`]: what a detector or an eye saw to a panel's curve and wavefront correction
//! 18. [`segments`]: a hologram plane in segments (hogels) that each see the scene from their own place
//! 19. [`pipeline`]: the whole way, on one screen
//! 20. [`sequence`]: frames in time: prepared pictures, raw video and arrays; an animated scene, frame by frame
//! 21. [`live`]: a hologram that follows its scene's file and the operator's keys, coarse at once and refined
//! 22. [`comparison`]: all encodings side by side, with figures
//! 23. [`print`]: plates: fringes tile by tile into a file, resumed, shared, previewed
//! 24. [`serve`]: frames from other programs: slmsuite's and slmPy's protocols, a local one for Python; the panel kept for them
//! 25. [`display`]: monitors and the fullscreen window (feature `display`)

pub mod calibration;
pub mod comparison;
pub(crate) mod config;
#[cfg(feature = "display")]
pub mod display;
pub mod encode;
pub mod error;
pub mod field;
pub mod files;
pub mod hologram;
pub mod illumination;
pub mod live;
pub mod names;
pub mod panel;
pub mod pipeline;
pub mod points;
#[cfg(feature = "print")]
pub mod print;
pub mod progress;
pub mod propagation;
pub mod random;
pub mod reconstruction;
pub mod scene;
pub mod segments;
pub mod sequence;
pub mod serve;
pub mod units;

pub use error::{Error, Result};
