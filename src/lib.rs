//! # holodrive: from a glTF room to light on a panel
//!
//! A holographic display driver for spatial light modulators: a scene becomes views for an eye or points, a hologram, a frame
//! for a panel, and, on the simulated panel, the pictures that an eye sees.
//!
//! ```
//! use holodrive::encode::{Encoding, ViewEncoding};
//! use holodrive::panel::{PanelProfile, Setup};
//! use holodrive::pipeline::{self, Settings};
//! use holodrive::points::WhitePoint;
//! use holodrive::progress::Progress;
//!
//! // 480 × 270 pixels of 8 µm with 256 levels over one turn, in the light of a helium-neon laser.
//! let setup = Setup::new(PanelProfile::phase(480, 270, 8e-6, 8, 632.8e-9)?, None)?;
//! let mut settings = Settings::default();
//! (settings.scene.trace.width, settings.scene.trace.height) = (60, 60);
//! // The lamp burns out, as in a photograph: else it takes most of the panel's light.
//! settings.scene.white = WhitePoint::Auto;
//! // Made for an eye 0.6 m before the panel, with a pupil of 4 mm.
//! settings.encode.encoding = Some(Encoding::View(ViewEncoding { iterations: Some(40), ..ViewEncoding::default() }));
//!
//! let out = pipeline::run("scenes/cornell.gltf".as_ref(), &setup, &settings, &Progress::new())?;
//!
//! let hologram = out.holograms[0].as_ref().expect("one laser has light");
//! assert_eq!(hologram.encoded.frame.levels.len(), 480 * 270);
//! let (name, depth) = &out.points.view.focus[0];
//! assert!(name == "near" && *depth < 0.0, "the nearest object stands behind the panel");
//! let seen = &out.seen.figures.all;
//! println!("through the pupil: PSNR {:.1} dB, SSIM {:.2}", seen.psnr, seen.ssim);
//! # assert!(seen.psnr > 25.0 && seen.ssim > 0.7, "{seen:?}");
//! # Ok::<(), holodrive::Error>(())
//! ```
//!
//! More stand in [`guide::rust`], with the features and what is good to know. Data goes one way, and each step hands on one type:
//!
//! ```text
//! glTF ──scene──▶ Scene ──illumination──▶ light on surfaces ──points──▶ PointCloud ──hologram──▶ Field
//!   Field ──encode──▶ PhasePattern | FringePattern ──panel──▶ Frame (drive levels) ──▶ display
//!   Frame ──panel::simulated──▶ Field ──reconstruction──▶ what an eye or a sensor sees, with figures
//!
//! Scene in its light ──light_field──▶ LightField ──encode::view──▶ Frames for an eye, judged against the same light field
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
//! # Glossary
//!
//! One term for one thing, from flag to file to field.
//!
//! | term | what it is |
//! |---|---|
//! | amplitude, phase | modulus and argument of a wave's complex field; *intensity* is the modulus squared |
//! | beam | the laser's light on the panel's pixels, brighter in the middle ([`panel::PanelProfile::beam_amplitude`]) |
//! | bench | the simulated panel with its faults, and the stop behind it ([`pipeline::Bench`]) |
//! | blaze | a linear phase that sends the object aside, off the zero order |
//! | carrier | spatial frequency of the reference wave on the panel |
//! | channel | which of a cloud's colours one laser shows |
//! | conjugate | the second image of an amplitude hologram, on the other side of the panel |
//! | coverage | which points a panel can diffract light to, and what is lost |
//! | depth | z in the hologram frame: negative behind the panel, positive in front, everywhere |
//! | drive level | the integer that a pixel's driver gets; a *curve* says which phase or amplitude it makes |
//! | encoding | how a complex field becomes phases or amplitudes that a panel can show |
//! | engine | how waves of points are summed |
//! | environment | radiance from all around a scene ([`scene::Environment`]); a *panorama* is its file |
//! | exposure | one pattern on the panel under one laser ([`points::Exposure`]) |
//! | eye box | the places over which a pupil's middle may move ([`light_field::Viewer`]) |
//! | fill factor, dead space | the share of a pixel that modulates, and the rest |
//! | frame | drive levels for every pixel ([`panel::Frame`]) |
//! | fringe | interference of object and reference wave, as an amplitude |
//! | hogel, segment | a part of the panel or plate that shows the scene as seen from its own place ([`segments`]) |
//! | irradiance, radiance, radiosity | flux per area received; per area and solid angle; per area leaving |
//! | kinoform | the phase of a field, its amplitude dropped |
//! | light field | pinhole views of a lit scene over an eye box ([`light_field`]): what an eye should see |
//! | look | a pupil somewhere, focused on a depth ([`light_field::Look`]) |
//! | normal incidence | a reading wave along the panel's normal |
//! | packing | how levels travel in a video signal |
//! | patch, form factor | an element of the radiosity mesh; the share of one's light that reaches another |
//! | pixel pitch | distance of neighbouring pixels |
//! | plate | a printed hologram (`print`) |
//! | reference wave | the wave that an amplitude hologram interferes with, and is read by |
//! | retina | the lattice of the picture that a pupil sees, on the panel's plane ([`light_field::Retina`]) |
//! | setup | a panel in the light it is used in ([`panel::Setup`]) |
//! | splat | the patch of wave that one point paints on a plane near it |
//! | speckle | granular intensity of light with random phases; its *contrast* is σ/μ |
//! | sub-frames | frames that follow each other faster than an eye sees |
//! | wavefront error, correction | the phase that a panel's bend adds, and its opposite |
//! | white | the radiance that a picture shows as white |
//! | zero order | the light that leaves the panel unmodulated |
//!
//! # Rooms, from the ground up
//!
//! A room uses only rooms that stand above it in this list; `tests/layering.rs` reads the list and keeps it so.
//!
//! 1. [`error`]: one error type, variants sorted by who can act
//! 2. [`names`]: closed sets whose values have names
//! 3. [`progress`]: how long work tells that it moves on, and is told to stop
//! 4. [`units`]: lengths and angles with units
//! 5. `config`: TOML files whose quantities have units; errors name file and key
//! 6. [`files`]: files that appear whole or not at all
//! 7. [`random`]: random numbers by seed and index
//! 8. [`field`]: complex samples on a grid; index ↔ metre ↔ cycles/m; Fourier transforms; files of arrays
//! 9. [`scene`]: glTF, triangles, materials, textures, lights, cameras, ray casting
//! 10. [`illumination`]: light arriving on surfaces: form factors, radiosity, direct light
//! 11. [`points`]: rays to point sources; how many, how bright, for which lasers; placement before the panel; clouds and depth maps of files
//! 12. [`light_field`]: pinhole views of a lit scene over an eye box: what an eye should see
//! 13. [`propagation`]: plane to plane
//! 14. [`hologram`]: points to the field on the panel: oracle, engines, planner
//! 15. [`panel`]: profiles, frames of drive levels, packing, the simulated panel
//! 16. [`encode`]: field to phase or fringes for a panel's levels and range
//! 17. [`reconstruction`]: field to pictures, gray or in three lasers' colours, and how good they are
//! 18. [`calibration`]: what a detector or an eye saw to a panel's curve and wavefront correction
//! 19. [`segments`]: a hologram plane in segments (hogels) that each see the scene from their own place
//! 20. [`pipeline`]: the whole way, on one screen
//! 21. [`sequence`]: frames in time: prepared pictures, raw video and arrays; an animated scene, frame by frame
//! 22. [`live`]: a hologram that follows its scene's file and the operator's keys, coarse at once and refined
//! 23. [`comparison`]: all encodings side by side, with figures
//! 24. [`print`]: plates: fringes tile by tile into a file, resumed, shared, previewed
//! 25. [`serve`]: frames from other programs: slmsuite's and slmPy's protocols, a local one for Python; the panel kept for them
//! 26. [`display`]: monitors and the fullscreen window (feature `display`)
//! 27. [`guide`]: what to do with the program, page by page
//!
//! On top of them stand two entrances that hold no physics: `cli`, the program, and the package for Python in `src/python`, a crate
//! of its own, which starts the same program.

// Rooms below the plates hold some things that plates alone use.
#![cfg_attr(not(feature = "print"), allow(dead_code, unused_imports))]

pub mod calibration;
// The program: on top of all rooms, no part of the public interface.
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod comparison;
pub(crate) mod config;
#[cfg(feature = "display")]
pub mod display;
pub mod encode;
pub mod error;
pub mod field;
pub mod files;
pub mod guide;
pub mod hologram;
pub mod illumination;
pub mod light_field;
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
/// Vectors and matrices of the public interface.
pub use glam;
