//! A plate from what is asked to its file: what was begun already, what it will take, what was done.

use super::folder::{self, TileReport};
use super::fringe::PlateFringes;
use super::manifest::{Manifest, Settings};
use super::plan::{NOT_A_SCENE, Plan, plan};
use super::plate::Plate;
use super::shard::Shard;
use super::source::Source;
use crate::error::{Error, Result};
use crate::hologram::InstructionSet;
use crate::progress::Progress;
use crate::scene::gltf::{is_scene, not_embedded};
use crate::segments::{Object, ObjectWave, SceneOptions, is_cloud};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What is printed, and where.
#[derive(Clone, Debug)]
pub struct PrintSettings {
    /// The plate.
    pub plate: Plate,
    /// What it shows.
    pub input: Source,
    /// How a scene is lit.
    pub options: SceneOptions,
    /// The plate's folder.
    pub folder: PathBuf,
    /// The part that is computed.
    pub shard: Shard,
    /// Whether it is only planned; then nothing is written, and what is in the folder does not matter.
    pub dry_run: bool,
}

/// A plate that is ready to be planned and computed: its folder was looked into, its scene is lit.
pub struct PlateJob {
    fringes: PlateFringes,
    settings: Settings,
    folder: PathBuf,
    shard: Shard,
    manifest: Option<Manifest>,
    amplitude: Option<f32>,
}

/// What a run did.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PrintReport {
    /// What became of the tiles.
    pub done: TileReport,
    /// Pixels in a second of wall time.
    pub pixels_per_second: f64,
    /// Point–pixel pairs in a second of the field's time.
    pub pairs_per_second: f64,
    /// Whether the plate is complete.
    pub complete: bool,
}

impl PlateJob {
    /// Looks into the folder, lights the scene or reads the points.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is neither scene nor points, a folder that holds another plate, or one that was begun
    /// with kernels that this machine does not have; as [`Plate::segments`] and [`Object::read`].
    pub fn new(asked: PrintSettings, progress: &Progress) -> Result<Self> {
        let PrintSettings { plate, input, mut options, folder, shard, dry_run } = asked;
        if let Source::File(input) = &input
            && !is_cloud(input)
            && !is_scene(input)
        {
            let what = "is no scene (.gltf, .glb, .obj, .stl) or point cloud (.ply, .xyz, .pcd, .las)";
            let what = not_embedded(input).unwrap_or_else(|| what.into());
            return Err(Error::input(input, what));
        }
        let settings = Settings::new(&plate, &input, &options)?;
        let manifest = if dry_run { None } else { folder::look(&folder, &settings)? };
        let mut instruction_set = InstructionSet::detect();
        if let Some(manifest) = &manifest {
            instruction_set = kernels(&folder, manifest)?;
            // All parts of a plate have the same.
            options.white = Some(manifest.white).filter(|white| *white > 0.0).or(options.white);
        }
        // Before the light, which may take long.
        let plane = plate.segments()?;
        let object = match &input {
            Source::File(input) => Object::read(input, &options, &plane, progress)?,
            Source::Pictures(pictures) => pictures.object(&plate, &plane)?,
            Source::Views(views) => views.object(&plate, &plane)?,
        };
        let fringes = PlateFringes { plate, wave: ObjectWave { plane, object, instruction_set } };
        Ok(Self { fringes, settings, folder, shard, manifest, amplitude: None })
    }

    /// What the plate will take; none where it was begun already.
    ///
    /// # Errors
    /// As [`plan`].
    pub fn plan(&mut self, progress: &Progress) -> Result<Option<Plan>> {
        if self.manifest.is_some() {
            return Ok(None);
        }
        let mut plan = plan(&self.fringes, &self.folder, progress)?;
        self.amplitude = Some(plan.amplitude);
        if self.settings.pictures().is_some() {
            // Flat pictures are meant to be the same from everywhere.
            plan.warnings.retain(|warning| warning != NOT_A_SCENE);
        }
        Ok(Some(plan))
    }

    /// Computes what is missing of the part, and finishes the plate when nothing is missing any more.
    ///
    /// # Errors
    /// As `folder::compute` and, where it was not planned yet, [`plan`].
    pub fn run(mut self, progress: &Progress) -> Result<PrintReport> {
        let manifest = match self.manifest.take() {
            Some(manifest) => manifest,
            None => {
                let amplitude = match self.amplitude {
                    Some(amplitude) => amplitude,
                    None => plan(&self.fringes, &self.folder, progress)?.amplitude,
                };
                self.begin(amplitude)?
            }
        };
        let done = folder::compute(&self.folder, &self.fringes, &manifest, self.shard, progress)?;
        Ok(PrintReport {
            pixels_per_second: done.work.pixels as f64 / done.seconds.max(1e-9),
            pairs_per_second: done.work.pairs / done.work.field_seconds.max(1e-9),
            complete: done.complete,
            done,
        })
    }

    /// Makes the folder and its manifest.
    fn begin(&self, amplitude: f32) -> Result<Manifest> {
        let ObjectWave { object, instruction_set, .. } = &self.fringes.wave;
        let mine = Manifest {
            settings: self.settings.clone(),
            instruction_set: instruction_set.name().to_owned(),
            amplitude,
            white: if let Object::Scene(scene) = object { scene.white() } else { 0.0 },
            tiles: None,
        };
        let first = folder::begin(&self.folder, &mine)?;
        if first.instruction_set != mine.instruction_set || first.amplitude != mine.amplitude {
            let what = "another machine with other kernels began this plate just now; give the command again";
            return Err(Error::input(&self.folder, what));
        }
        Ok(first)
    }
}

/// The instruction set that a plate was begun with.
fn kernels(folder: &Path, manifest: &Manifest) -> Result<InstructionSet> {
    let name = &manifest.instruction_set;
    InstructionSet::available().into_iter().find(|set| set.name() == name).ok_or_else(|| {
        let what = format!("was begun with {name} kernels, which this machine does not have; go on elsewhere");
        Error::input(folder, what)
    })
}
