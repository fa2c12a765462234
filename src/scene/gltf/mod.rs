//! glTF 2.0 files to [`Scene`]: the only place that names the crate `gltf`.
//!
//! Of that crate only the schema (`gltf::json`) is used. Its own validation and its accessor iterators panic on some
//! malformed files, so every index is looked up here with a check, and every byte range is checked before it is read:
//! a malformed file is an [`Error::Input`] in one line that says what is wrong and where.
//!
//! ```
//! use holodrive::scene::gltf::{LoadOptions, load};
//!
//! let loaded = load("scenes/cornell.gltf".as_ref(), &LoadOptions::default())?;
//! assert!(loaded.warnings.is_empty() && loaded.scene.cameras.len() == 1);
//! let nobody = LoadOptions { camera: Some("nobody".into()), ..LoadOptions::default() };
//! assert!(load("scenes/cornell.gltf".as_ref(), &nobody).is_err());
//! # Ok::<(), holodrive::Error>(())
//! ```
//!
//! # What is read
//!
//! `.gltf` and `.glb`; buffers and images in the file, in data URIs or in files beside it; node trees with matrices,
//! mirrored and shared meshes; triangles, strips and fans, with or without indices; sparse accessors; normals, two sets
//! of texture coordinates, vertex colours; skins and morph targets, posed by an animation clip at a time; cameras;
//! PNG, JPEG, WebP and KTX2 textures (plain ones, and with the feature `basisu` Basis Universal) with sampler and transform; metallic-roughness materials; the extensions
//! [`UNDERSTOOD_EXTENSIONS`]; geometry packed by Draco and meshopt. OBJ with its MTL, and STL, are told as glTF first. Points and lines have no surface: they are left out with a
//! warning; a file of points alone is a cloud ([`read_vertices`]).
//!
//! # Assumptions, each with a warning
//!
//! A file without a camera gets one that frames the scene; a file without light gets the one that [`load`] states.
//! An image that cannot be decoded leaves its factor in use; an optional extension that is not understood is left out.
//!
//! # Limits
//!
//! [`MAX_TRIANGLES`], [`MAX_COORDINATE`], [`MAX_TEXTURE_SIDE`], [`MAX_TEXELS`], [`MAX_FILE_BYTES`].

mod accessor;
mod animation;
mod cameras;
mod converted;
mod document;
mod embedded;
mod image_light;
mod images;
mod instances;
mod ktx2;
mod lights;
mod materials;
mod measured_lights;
mod meshes;
mod nodes;
mod own_light;
mod packed;
mod primitives;
mod resources;
mod rewritten;
mod vertices;

pub use converted::is_scene;
pub use document::UNDERSTOOD_EXTENSIONS;
pub use embedded::{embedded, embedded_names, not_embedded};
pub use images::{MAX_TEXELS, MAX_TEXTURE_SIDE};
pub use meshes::{MAX_COORDINATE, MAX_TRIANGLES};
pub use resources::MAX_FILE_BYTES;
pub use vertices::{Vertices, has_only_points, read_vertices};

use super::environment::{Panorama, Sky};
use super::{Environment, Material, Photometry, Scene, Texture, Warning};
use crate::error::{Error, Result};
use document::Document;
use glam::DVec3;
use meshes::UsedMaterials;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One of several things in a file, by its name or its number from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The one with this name.
    Name(String),
    /// The one with this number, counted from 0.
    Index(usize),
}

impl From<&str> for Choice {
    /// Digits alone are a number, everything else is a name.
    fn from(text: &str) -> Self {
        text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index)
    }
}

/// Which animation clip poses the scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Clip {
    /// The first one in the file, if there is one.
    #[default]
    First,
    /// None: nodes stand as they are written.
    Rest,
    /// A certain one.
    Of(Choice),
}

/// What to load of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// The camera that comes first in [`Scene::cameras`]; by the name of the camera or its node, or by number in the
    /// order of the node tree. `None`: the first one.
    pub camera: Option<Choice>,
    /// The scene of the file. `None`: the file's default scene, or its first.
    pub scene: Option<Choice>,
    /// The animation clip that poses nodes, skins and morph targets.
    pub clip: Clip,
    /// Time in the clip [s]; before its first or after its last key the pose of that key is held.
    pub time: f64,
    /// Whether light from the viewer is added to the lights of the file: a directional one of irradiance 2.2 W/m² from the
    /// upper left, and a point light at the first camera that gives 0.8 W/m² at the middle of the scene and reaches all that
    /// the camera sees, through the backs of one-sided walls too.
    pub viewer_light: bool,
    /// A file without a camera or a light is given one that suits this box (low, high) [m]. `None`: the box of the scene
    /// as it is posed. An animation that one camera is to see gives the box of all its poses.
    pub framed: Option<(DVec3, DVec3)>,
    /// Whether the file's URIs may point to files outside of its folder.
    pub allow_outside: bool,
    /// What lights the scene from all around, in place of the light that a file without any gets.
    pub environment: Option<Panorama>,
    /// Sun and sky instead of that.
    pub sky: Option<Sky>,
}

/// A scene and what had to be assumed to make it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene; it has at least one triangle, one camera and some light.
    pub scene: Arc<Scene>,
    /// Assumptions and omissions, in the order in which they were made.
    pub warnings: Vec<Warning>,
}

/// Loads the glTF file at `path`, or the scene that comes with the library by that name ([`embedded`]), flattened into
/// world-space triangles.
///
/// A file that lights nothing (no emission, no punctual light, no environment, not everything unlit) stands in a soft studio
/// ([`Environment::studio`]), which its chrome and glass show; where walls keep that light from most of what the camera sees,
/// it gets the light of [`LoadOptions::viewer_light`] instead. So does one whose own light is emission alone and lights less
/// than a quarter of what the camera sees (a glowing label on a dark model).
///
/// # Errors
///
/// [`Error::Input`] for a file that is missing, malformed, needs an extension that is not understood, has no triangle,
/// passes a limit, or has lights that all have no intensity; [`Error::Parameter`] for a camera, scene, clip or time
/// that the file does not have.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    File::open_with(path, options)?.pose(options)
}

/// A file that was read once and is posed at several times: its buffers are kept, and its textures once decoded.
pub struct File {
    document: Document,
    warnings: Vec<Warning>,
    decoded: Option<Decoded>,
    /// What was found out of its light, once it was looked at.
    light: lights::Known,
    /// Photometric files that were read.
    lamps: Vec<Option<Arc<Photometry>>>,
    /// The panorama that was read last.
    around: Option<(Panorama, Arc<Environment>)>,
    /// The file's own environment, once it was looked for, and the scene that names it.
    own_around: Option<(Option<Choice>, Option<Arc<Environment>>)>,
}

/// Materials for the triangles of one pose, and what there was to say about them.
struct Decoded {
    used: UsedMaterials,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    warnings: Vec<Warning>,
}

impl File {
    /// Reads the file and its buffers, none outside of its folder.
    ///
    /// # Errors
    ///
    /// As [`load`], as far as no pose is needed to see it.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_with(path, &LoadOptions::default())
    }

    /// As [`File::open`], with buffers outside of its folder where `options` allow them.
    ///
    /// # Errors
    ///
    /// As [`File::open`].
    pub fn open_with(path: &Path, options: &LoadOptions) -> Result<Self> {
        let mut warnings = Vec::new();
        let document = Document::open(path, options.allow_outside, &mut warnings)?;
        Ok(Self::of(document, warnings))
    }

    /// A glTF or GLB file from its bytes, which hold all that it needs: buffers and images in the binary chunk or in data URIs.
    /// `name` stands in errors.
    ///
    /// # Errors
    ///
    /// As [`File::open`]; [`Error::Input`] for a URI that names a file.
    pub fn of_bytes(name: &Path, bytes: &[u8]) -> Result<Self> {
        let mut warnings = Vec::new();
        let source = resources::Source { scene: name, allow_outside: false, is_alone: true };
        let document = Document::of_bytes(source, bytes, true, &mut warnings)?;
        Ok(Self::of(document, warnings))
    }

    /// A file of which nothing was looked at.
    fn of(document: Document, warnings: Vec<Warning>) -> Self {
        Self {
            document,
            warnings,
            decoded: None,
            light: lights::Known::default(),
            lamps: Vec::new(),
            around: None,
            own_around: None,
        }
    }

    /// The scene in the pose that `options` name.
    ///
    /// # Errors
    ///
    /// As [`load`].
    pub fn pose(&mut self, options: &LoadOptions) -> Result<Loaded> {
        if !options.time.is_finite() {
            return Err(Error::out_of_range("time", options.time, "is not a time"));
        }
        let document = &self.document;
        let mut warnings = self.warnings.clone();
        let pose = animation::Pose::new(document, &options.clip, options.time)?;
        let nodes = nodes::Nodes::new(document, &pose, options.scene.as_ref())?;

        let (triangles, used) = meshes::triangles(document, &nodes, &pose, &mut warnings)?;
        let decoded = match self.decoded.take().filter(|decoded| decoded.used == used) {
            Some(decoded) => decoded,
            None => {
                let mut warnings = Vec::new();
                let (materials, textures) = materials::read(document, &used, &mut warnings)?;
                Decoded { used, materials, textures, warnings }
            }
        };
        warnings.extend(decoded.warnings.iter().cloned());
        let (materials, textures) = (decoded.materials.clone(), decoded.textures.clone());
        let framed = options.framed.map(|(low, high)| corners_of_box(low, high));
        let cameras = cameras::read(document, &nodes, options.camera.as_ref(), &triangles, framed, &mut warnings)?;
        let mut lights = lights::read(document, &nodes)?;
        lights.extend(measured_lights::read(document, &nodes, &mut self.lamps)?);

        let environment = match around(&mut self.around, options, &mut warnings)? {
            Some(around) => Some(around),
            None => {
                let known = self.own_around.take().filter(|(scene, _)| *scene == options.scene);
                let own = || {
                    let scene = nodes::chosen_scene(document, options.scene.as_ref())?;
                    let own = scene.map(|scene| image_light::read(document, scene)).transpose()?.flatten();
                    Ok((options.scene.clone(), own.map(Arc::new)))
                };
                self.own_around.insert(known.map_or_else(own, Ok)?).1.clone()
            }
        };
        let mut scene = Scene { triangles, materials, textures, lights, environment, cameras };
        lights::ensure_light(document, &mut scene, &decoded.used, options, &mut self.light, &mut warnings)?;
        self.decoded = Some(decoded);
        Ok(Loaded { scene: Arc::new(scene), warnings })
    }

    /// First and last key time of a clip [s]; `None` where the file has no animation, or the rest pose is asked for.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a clip that the file does not have; [`Error::Input`] for key times that do not increase.
    pub fn clip_times(&self, clip: &Clip) -> Result<Option<[f64; 2]>> {
        animation::times(&self.document, clip)
    }

    /// Whether it has a camera of its own in any scene.
    pub fn has_camera(&self) -> bool {
        self.document.root.nodes.iter().any(|node| node.camera.is_some())
    }

    /// The files that it is read from: itself, and buffers, images and materials beside it; none of an embedded scene.
    pub fn files(&self) -> Vec<PathBuf> {
        if self.document.is_embedded {
            return Vec::new();
        }
        let root = &self.document.root;
        let buffers = root.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
        let images = root.images.iter().filter_map(|image| image.uri.as_deref());
        let further = self.document.beside.iter().map(String::as_str);
        let beside =
            buffers.chain(images).chain(further).filter_map(|uri| resources::path_of(&self.document.path, uri).ok());
        std::iter::once(self.document.path.clone()).chain(beside).collect()
    }
}

/// The environment that was asked for; what there is to say of it.
fn around(
    kept: &mut Option<(Panorama, Arc<Environment>)>,
    options: &LoadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Arc<Environment>>> {
    let Some(panorama) = &options.environment else {
        return options.sky.as_ref().map(|sky| Environment::sky(sky).map(Arc::new)).transpose();
    };
    let around = match kept.take().filter(|(last, _)| last == panorama) {
        Some((_, around)) => around,
        None => Arc::new(Environment::read(panorama)?),
    };
    if around.mean().max_element() <= 0.0 {
        warnings.push(Warning(format!("{}: is black, and lights nothing", panorama.path.display())));
    }
    *kept = Some((panorama.clone(), Arc::clone(&around)));
    Ok(Some(around))
}

/// The eight corners of a box.
fn corners_of_box(low: DVec3, high: DVec3) -> [DVec3; 8] {
    let side = |bit: usize, low: f64, high: f64| if bit == 0 { low } else { high };
    std::array::from_fn(|i| {
        DVec3::new(side(i & 1, low.x, high.x), side(i & 2, low.y, high.y), side(i & 4, low.z, high.z))
    })
}
