//! The thread that computes what was last wished for.

use super::background::{Background, Desk};
use crate::encode::{EncodeSettings, Encoding};
use crate::error::{Error, Result};
use crate::hologram::{HologramReport, HologramSettings};
use crate::illumination::Illumination;
use crate::panel::{Frame, PanelProfile};
use crate::pipeline::{self, Lit, SceneSettings};
use crate::points::Channel;
use crate::points::trace::TraceSettings;
use crate::progress::Progress;
use crate::scene::{Camera, SceneBvh, gltf};
use glam::{DMat4, DVec3};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Instant;

/// Rays across or down of the coarse level, on the longer side.
const COARSE_RAYS: f64 = 56.0;
/// What double phase clips at the levels before the last.
const USUAL_PERCENTILE: f64 = 0.9;
/// Rays of the middle level, as a share of those that were asked for.
const MIDDLE_SHARE: f64 = 0.5;

/// How the scene should stand before the panel, and in which light and encoding.
#[derive(Clone, Debug)]
pub struct Wish {
    /// The scene turned about its middle: to the right about the camera's up, and up about its right [rad].
    pub turn: [f64; 2],
    /// The hologram shifted along x, y and z [m].
    pub shift: DVec3,
    /// Wavelength [m].
    pub wavelength: f64,
    /// How the field is encoded.
    pub encode: EncodeSettings,
}

/// How fine a hologram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Few rays, rough light, a field to 3 %: something to see at once.
    Coarse,
    /// Half the rays.
    Middle,
    /// As asked.
    Full,
}

impl Detail {
    /// The levels in their order.
    pub const ALL: [Self; 3] = [Self::Coarse, Self::Middle, Self::Full];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coarse => "coarse",
            Self::Middle => "middle",
            Self::Full => "full",
        }
    }
}

/// One level of one wish.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Number of the wish.
    pub version: u64,
    /// How fine it is.
    pub detail: Detail,
    /// Levels for the panel.
    pub frame: Frame,
    /// Points and picture, where they stand for this wish.
    pub lit: Arc<Lit>,
    /// What the field took.
    pub field: HologramReport,
    /// Time that light and rays took [s].
    pub light_seconds: f64,
    /// Time that the encoding took [s].
    pub encode_seconds: f64,
    /// Since the wish [s].
    pub seconds: f64,
}

/// What a worker tells.
#[derive(Debug)]
pub enum Happened {
    /// A hologram is ready.
    Refined(Box<Refined>),
    /// The scene was read again: the files that it is made of now.
    Loaded(Vec<PathBuf>),
    /// The scene or the wish is at fault: one line. What was there stays.
    Failed(String),
    /// A computation was stopped, so long after the new wish [s].
    Cancelled(f64),
}

/// What the worker is to do.
struct Order {
    wish: Wish,
    version: u64,
    since: Instant,
    /// Whether the file is to be read again.
    reload: bool,
}

/// Computes on a thread of its own; ends when it is dropped.
pub struct Worker(Background<Order, Happened>);

/// What does not change while it runs.
struct Job {
    path: PathBuf,
    scene: SceneSettings,
    profile: PanelProfile,
    channel: Channel,
    hologram: HologramSettings,
}

impl Worker {
    /// Reads the scene, and begins to compute the first wish. Also gives the files that the scene is made of.
    ///
    /// # Errors
    /// As [`gltf::load`]: a scene that cannot be read at the beginning is not waited for.
    pub fn start(
        path: &Path,
        scene: SceneSettings,
        (profile, channel): (PanelProfile, Channel),
        hologram: HologramSettings,
        wish: Wish,
    ) -> Result<(Self, Vec<PathBuf>)> {
        profile.grid()?;
        let mut file = gltf::File::open(path)?;
        let files = file.files();
        let first = file.pose(&scene.load)?;
        let order = Order { wish, version: 1, since: Instant::now(), reload: false };
        let job = Job { path: path.into(), scene, profile, channel, hologram };
        Ok((Self(Background::start(order, move |desk, tell| job.work(first, desk, tell))), files))
    }

    /// Wishes for something else; `reload` reads the file again. What is running is stopped. The number of the wish.
    pub fn wish(&self, wish: Wish, reload: bool) -> u64 {
        self.0.ask(|order| {
            order.wish = wish;
            order.version += 1;
            order.since = Instant::now();
            order.reload |= reload;
            order.version
        })
    }

    /// What has happened since the last call, one thing at a time.
    ///
    /// # Errors
    /// [`Error::Unsupported`] when the worker's thread has come to an unforeseen end.
    pub fn poll(&self) -> Result<Option<Happened>> {
        self.0.poll("the computation")
    }
}

impl Job {
    fn work(&self, first: gltf::Loaded, desk: &Desk<Order>, told: &Sender<Happened>) {
        // Where whoever asked has gone, the next look at the order ends the thread.
        let tell = |happened| drop(told.send(happened));
        let mut loaded = first;
        let mut done = 0;
        // The light belongs to one scene: another scene begins the loop again.
        'scenes: loop {
            let bvh = Arc::new(SceneBvh::new(loaded.scene.clone()));
            let mut lights: [Option<Illumination>; 2] = [None, None];
            loop {
                let next = desk.next(|order| {
                    let new = order.version != done;
                    new.then(|| (order.wish.clone(), order.version, order.since, std::mem::take(&mut order.reload)))
                });
                let Some(((wish, version, since, reload), running)) = next else { return };
                if reload {
                    match self.load() {
                        Ok((files, next)) => {
                            tell(Happened::Loaded(files));
                            drop(lights);
                            loaded = next;
                            continue 'scenes;
                        }
                        Err(error) => tell(Happened::Failed(error.to_string())),
                    }
                }
                done = version;
                for detail in self.levels() {
                    match self.compute(detail, (&wish, version, since), (&loaded, &bvh), &mut lights, &running) {
                        Ok(refined) => tell(Happened::Refined(Box::new(refined))),
                        Err(Error::Interrupted) => {
                            let since = desk.look(|order| order.since);
                            tell(Happened::Cancelled(since.elapsed().as_secs_f64()));
                            break;
                        }
                        Err(error) => {
                            tell(Happened::Failed(error.to_string()));
                            break;
                        }
                    }
                }
            }
        }
    }

    fn load(&self) -> Result<(Vec<PathBuf>, gltf::Loaded)> {
        let mut file = gltf::File::open(&self.path)?;
        let loaded = file.pose(&self.scene.load)?;
        Ok((file.files(), loaded))
    }

    fn compute(
        &self,
        detail: Detail,
        (wish, version, since): (&Wish, u64, Instant),
        (loaded, bvh): (&gltf::Loaded, &Arc<SceneBvh>),
        lights: &mut [Option<Illumination>; 2],
        progress: &Progress,
    ) -> Result<Refined> {
        let begin = Instant::now();
        let settings = self.scene_at(detail);
        let light = &mut lights[usize::from(detail != Detail::Coarse)];
        let light = match light {
            Some(light) => light,
            None => light.insert(Illumination::new(bvh.clone(), settings.illumination, progress)?),
        };
        let camera = loaded.scene.cameras.first().ok_or_else(|| Error::input(&self.path, "has no camera"))?;
        let camera = turned(camera, loaded, wish.turn);
        let grid = self.profile.grid()?;
        let at = (&grid, wish.wavelength);
        let mut lit = pipeline::seen(&self.path, (loaded, &camera), light, &settings, at, progress)?;
        shift(&mut lit, wish.shift);
        let light_seconds = begin.elapsed().as_secs_f64();
        let wanted = match detail {
            Detail::Coarse => self.hologram.error.max(3e-2),
            Detail::Middle => self.hologram.error.max(1e-2),
            Detail::Full => self.hologram.error,
        };
        let hologram = HologramSettings { error: wanted, ..self.hologram };
        let cloud = &lit.placed.cloud;
        let computed = pipeline::field(cloud, self.channel, &grid, wish.wavelength, &hologram, progress)?;
        let begin = Instant::now();
        let mut encode = wish.encode.clone();
        if let (Encoding::DoublePhase(settings), true) = (&mut encode.encoding, detail != Detail::Full) {
            // The best percentile of a field of random phases is near it, and is not looked for.
            settings.percentile = settings.percentile.or(Some(USUAL_PERCENTILE));
        }
        let mut encoded = pipeline::frame(&computed.field, &self.profile, &encode, progress)?;
        progress.check()?;
        let origin = &mut encoded.frame.metadata.origin;
        origin.source = Some(self.path.display().to_string());
        origin.points = Some(cloud.points.len());
        origin.depth = cloud.depth_range().map(|(far, near)| [near, far]);
        Ok(Refined {
            version,
            detail,
            frame: encoded.frame,
            lit: Arc::new(lit),
            field: computed.report,
            light_seconds,
            encode_seconds: begin.elapsed().as_secs_f64(),
            seconds: since.elapsed().as_secs_f64(),
        })
    }

    /// The levels that are worth their time: each has clearly more rays than the one before.
    fn levels(&self) -> Vec<Detail> {
        let rays = f64::from(self.scene.trace.width.max(self.scene.trace.height));
        let worth = |detail: &Detail| match detail {
            Detail::Coarse => rays > COARSE_RAYS,
            Detail::Middle => MIDDLE_SHARE * rays > 1.5 * COARSE_RAYS,
            Detail::Full => true,
        };
        Detail::ALL.into_iter().filter(worth).collect()
    }

    /// The settings of a level.
    fn scene_at(&self, detail: Detail) -> SceneSettings {
        let mut settings = self.scene.clone();
        let trace = &settings.trace;
        let (width, height) = (f64::from(trace.width), f64::from(trace.height));
        let scale = match detail {
            Detail::Coarse => (COARSE_RAYS / width.max(height)).min(1.0),
            Detail::Middle => MIDDLE_SHARE,
            Detail::Full => return settings,
        };
        let [w, h] = [width, height].map(|side| (side * scale).round().max(1.0) as u32);
        settings.points = None;
        settings.trace = TraceSettings { width: w, height: h, edge_rays: 1, ..*trace };
        if detail == Detail::Coarse {
            settings.illumination = settings.illumination.coarse();
        }
        settings
    }
}

/// The camera from which the scene looks turned about its middle.
fn turned(camera: &Camera, loaded: &gltf::Loaded, [right, up]: [f64; 2]) -> Camera {
    let (low, high) = loaded.scene.bounds().unwrap_or_default();
    let middle = 0.5 * (low + high);
    let pose = camera.world_from_camera;
    let [x, y] = [pose.x_axis, pose.y_axis].map(|axis| axis.truncate().normalize_or_zero());
    // What stands before the eye turns to the right when the eye goes round it to the left.
    let round = DMat4::from_axis_angle(y, -right) * DMat4::from_axis_angle(x, -up);
    let about = DMat4::from_translation(middle) * round * DMat4::from_translation(-middle);
    Camera { world_from_camera: about * pose, ..camera.clone() }
}

/// Moves the points before the panel, and where they are looked for.
fn shift(lit: &mut Lit, by: DVec3) {
    if by == DVec3::ZERO {
        return;
    }
    lit.placed.cloud.points.iter_mut().for_each(|point| point.position += by);
    lit.view.depths.iter_mut().flatten().for_each(|z| *z += by.z);
    lit.view.focus.iter_mut().for_each(|(_, z)| *z += by.z);
}

#[cfg(test)]
mod tests;
