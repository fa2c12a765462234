//! The thread that computes what was last requested.

use super::background::{Background, Desk};
use super::request::{Detail, Request};
use super::tracked::{Subject, Tracked};
use crate::encode::Encoding;
use crate::error::{Error, Result};
use crate::hologram::{HologramReport, HologramSettings};
use crate::panel::{Frame, Modulation, Origin, Setup};
use crate::pipeline::{self, Settings};
use crate::points::trace::TraceSettings;
use crate::points::{LitScene, ScenePoints, SceneSettings};
use crate::progress::Progress;
use crate::scene::{Camera, Scene, SceneBvh, gltf};
use glam::{DMat4, DVec3};
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

/// A hologram of one level of detail for one request.
#[derive(Clone, Debug)]
pub struct LiveHologram {
    /// Number of the request.
    pub version: u64,
    /// How fine it is.
    pub detail: Detail,
    /// Levels for the panel.
    pub frame: Frame,
    /// Points and picture, where they stand for this request.
    pub points: Arc<ScenePoints>,
    /// What the field took; none for a frame that was made for an eye.
    pub field: Option<HologramReport>,
    /// Time that light, rays and views took [s].
    pub light_seconds: f64,
    /// Time that the encoding took [s].
    pub encode_seconds: f64,
    /// Since the request [s].
    pub seconds: f64,
}

/// What a worker tells.
#[derive(Debug)]
pub enum WorkerEvent {
    /// A hologram is ready.
    Ready(Box<LiveHologram>),
    /// The scene was read again: the files that it is made of now.
    Loaded(Vec<PathBuf>),
    /// The scene or the request is at fault: one line. What was there stays.
    Failed(String),
    /// A computation was stopped, so long after the new request [s].
    Cancelled(f64),
}

/// What the worker is to do.
#[derive(Clone)]
struct Order {
    request: Request,
    version: u64,
    since: Instant,
    /// Whether the file is to be read again.
    reload: bool,
}

/// Computes on a thread of its own; ends when it is dropped.
pub struct Worker(Background<Order, WorkerEvent>);

/// What does not change while it runs.
struct Studio {
    path: PathBuf,
    setup: Setup,
    settings: Settings,
}

impl Worker {
    /// Reads the scene, and begins to compute the first request; encoding and wavelength are the request's, all else is the
    /// settings'. Also gives the files that the scene is made of.
    ///
    /// # Errors
    /// As [`gltf::load`]: a scene that cannot be read at the beginning is not waited for.
    pub fn start(path: &Path, setup: Setup, settings: Settings, request: Request) -> Result<(Self, Vec<PathBuf>)> {
        let mut file = gltf::File::open_with(path, &settings.scene.load)?;
        let files = file.files();
        let first = file.pose(&settings.scene.load)?;
        let order = Order { request, version: 1, since: Instant::now(), reload: false };
        let studio = Studio { path: path.into(), setup, settings };
        Ok((Self(Background::start(order, move |desk, tell| studio.work(first, desk, tell))), files))
    }

    /// Requests something else; `reload` reads the file again. What is running is stopped. The number of the request.
    pub fn request(&self, request: Request, reload: bool) -> u64 {
        self.0.ask(|order| {
            order.request = request;
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
    pub fn poll(&self) -> Result<Option<WorkerEvent>> {
        self.0.poll("the computation")
    }
}

/// A scene with the light of its two levels, coarse and full, as far as they were needed.
struct Lights {
    loaded: gltf::Loaded,
    bvh: Arc<SceneBvh>,
    lit: [Option<LitScene>; 2],
}

impl Lights {
    fn new(loaded: gltf::Loaded) -> Self {
        Self { bvh: Arc::new(SceneBvh::new(loaded.scene.clone())), loaded, lit: [None, None] }
    }

    fn at(&mut self, detail: Detail, path: &Path, settings: &SceneSettings, progress: &Progress) -> Result<&LitScene> {
        let slot = &mut self.lit[usize::from(detail != Detail::Coarse)];
        Ok(match slot {
            Some(lit) => lit,
            None => {
                let (loaded, bvh) = (self.loaded.clone(), self.bvh.clone());
                slot.insert(LitScene::with_bvh(path, loaded, bvh, settings.illumination, progress)?)
            }
        })
    }
}

impl Studio {
    fn work(&self, first: gltf::Loaded, desk: &Desk<Order>, told: &Sender<WorkerEvent>) {
        // Where whoever asked has gone, the next look at the order ends the thread.
        let tell = |event| drop(told.send(event));
        let mut lights = Lights::new(first);
        let mut tracked = Tracked::default();
        let mut done = 0;
        loop {
            let next = desk.next(|order| {
                let new = order.version != done;
                new.then(|| Order { reload: std::mem::take(&mut order.reload), ..order.clone() })
            });
            let Some((order, running)) = next else { return };
            if order.reload {
                match self.load() {
                    Ok((files, next)) => {
                        tell(WorkerEvent::Loaded(files));
                        lights = Lights::new(next);
                        tracked = Tracked::default();
                    }
                    Err(error) => tell(WorkerEvent::Failed(error.to_string())),
                }
            }
            done = order.version;
            let is_view = matches!(order.request.encode.encoding, Some(Encoding::View(_)));
            let levels = if is_view { vec![Detail::Coarse, Detail::Full] } else { self.levels() };
            for detail in levels {
                let found = if is_view {
                    self.track(detail, &order, &mut lights, &mut tracked, &running)
                } else {
                    self.compute(detail, &order, &mut lights, &running)
                };
                match found {
                    Ok(hologram) => tell(WorkerEvent::Ready(Box::new(hologram))),
                    Err(Error::Interrupted) => {
                        let since = desk.look(|order| order.since);
                        tell(WorkerEvent::Cancelled(since.elapsed().as_secs_f64()));
                        break;
                    }
                    Err(error) => {
                        tell(WorkerEvent::Failed(error.to_string()));
                        break;
                    }
                }
            }
        }
    }

    fn load(&self) -> Result<(Vec<PathBuf>, gltf::Loaded)> {
        let mut file = gltf::File::open_with(&self.path, &self.settings.scene.load)?;
        let loaded = file.pose(&self.settings.scene.load)?;
        Ok((file.files(), loaded))
    }

    fn compute(&self, detail: Detail, order: &Order, lights: &mut Lights, progress: &Progress) -> Result<LiveHologram> {
        let begin = Instant::now();
        let request = &order.request;
        let settings = self.scene_at(detail);
        let setup = Setup { wavelength: request.wavelength, ..self.setup.clone() };
        let lit = lights.at(detail, &self.path, &settings, progress)?;
        let camera = turned(lit.camera(), lit.scene(), request.turn);
        let mut points = lit.points(&camera, &settings, &setup.grid, setup.wavelength, progress)?;
        shift(&mut points, request.shift);
        let light_seconds = begin.elapsed().as_secs_f64();
        let error = self.settings.hologram.error;
        let error = match detail {
            Detail::Coarse => error.max(3e-2),
            Detail::Middle => error.max(1e-2),
            Detail::Full => error,
        };
        let hologram = HologramSettings { error, ..self.settings.hologram };
        let cloud = &points.placed.cloud;
        let [exposure, ..] = pipeline::exposures(&setup, &self.settings, None)[..] else {
            return Err(Error::parameter("exposures", "there is none"));
        };
        let computed = pipeline::field(cloud, &exposure, &setup, &hologram, progress)?;
        let computed = computed.ok_or_else(|| Error::input(&self.path, "has no light for this laser"))?;
        let begin = Instant::now();
        let mut encode = request.encode.clone();
        if setup.profile.modulation() == Modulation::Phase && detail != Detail::Full {
            let usual = || Encoding::usual(Modulation::Phase);
            if let Encoding::DoublePhase(settings) = encode.encoding.get_or_insert_with(usual) {
                // The best percentile of a field of random phases is near it, and is not looked for.
                settings.percentile = settings.percentile.or(Some(USUAL_PERCENTILE));
            }
        }
        let origin = Origin {
            source: Some(self.path.display().to_string()),
            points: Some(cloud.points.len()),
            depth: points.content().depth,
            ..Origin::default()
        };
        let encoded = pipeline::frame(&computed.field, &setup, &encode, origin, progress)?;
        progress.check()?;
        Ok(LiveHologram {
            version: order.version,
            detail,
            frame: encoded.frame,
            points: Arc::new(points),
            field: Some(computed.report),
            light_seconds,
            encode_seconds: begin.elapsed().as_secs_f64(),
            seconds: order.since.elapsed().as_secs_f64(),
        })
    }

    /// A frame that is made for the eye where it is.
    fn track(
        &self,
        detail: Detail,
        order: &Order,
        lights: &mut Lights,
        tracked: &mut Tracked,
        progress: &Progress,
    ) -> Result<LiveHologram> {
        let begin = Instant::now();
        let request = &order.request;
        let setup = Setup { wavelength: request.wavelength, ..self.setup.clone() };
        if !tracked.serves(request, detail) {
            let mut settings = self.scene_at(Detail::Coarse);
            settings.illumination = self.scene_at(detail).illumination;
            if request.shift.truncate() != glam::DVec2::ZERO {
                let why = "a scene that is made for an eye stands in its window; turn it, or move it nearer or farther";
                return Err(Error::parameter("shift", why));
            }
            settings.placement = settings.placement.nearer(request.shift.z);
            let lit = lights.at(detail, &self.path, &settings, progress)?;
            let camera = turned(lit.camera(), lit.scene(), request.turn);
            let points = lit.points(&camera, &settings, &setup.grid, setup.wavelength, progress)?;
            tracked.look_at(Subject { lit, points }, request, detail, &setup, &self.settings, progress)?;
        }
        let light_seconds = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let (frame, points) = tracked.frame(request, detail, &setup, &self.settings, &self.path, progress)?;
        Ok(LiveHologram {
            version: order.version,
            detail,
            frame,
            points,
            field: None,
            light_seconds,
            encode_seconds: begin.elapsed().as_secs_f64(),
            seconds: order.since.elapsed().as_secs_f64(),
        })
    }

    /// The levels that are worth their time: each has clearly more rays than the one before.
    fn levels(&self) -> Vec<Detail> {
        let rays = f64::from(self.settings.scene.trace.width.max(self.settings.scene.trace.height));
        let worth = |detail: &Detail| match detail {
            Detail::Coarse => rays > COARSE_RAYS,
            Detail::Middle => MIDDLE_SHARE * rays > 1.5 * COARSE_RAYS,
            Detail::Full => true,
        };
        Detail::ALL.into_iter().filter(worth).collect()
    }

    /// The settings of a level.
    fn scene_at(&self, detail: Detail) -> SceneSettings {
        let mut settings = SceneSettings { estimate: false, ..self.settings.scene.clone() };
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
fn turned(camera: &Camera, scene: &Scene, [right, up]: [f64; 2]) -> Camera {
    let (low, high) = scene.bounds().unwrap_or_default();
    let middle = 0.5 * (low + high);
    let pose = camera.world_from_camera;
    let [x, y] = [pose.x_axis, pose.y_axis].map(|axis| axis.truncate().normalize_or_zero());
    // What stands before the eye turns to the right when the eye goes round it to the left.
    let round = DMat4::from_axis_angle(y, -right) * DMat4::from_axis_angle(x, -up);
    let about = DMat4::from_translation(middle) * round * DMat4::from_translation(-middle);
    Camera { world_from_camera: about * pose, ..camera.clone() }
}

/// Moves the points before the panel, and where they are looked for.
fn shift(points: &mut ScenePoints, by: DVec3) {
    if by == DVec3::ZERO {
        return;
    }
    points.placed.cloud.points.iter_mut().for_each(|point| point.position += by);
    points.view.depths.iter_mut().flatten().for_each(|z| *z += by.z);
    points.view.focus.iter_mut().for_each(|(_, z)| *z += by.z);
}

#[cfg(test)]
mod tests;
