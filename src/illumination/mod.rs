//! Light on surfaces: what leaves each point of a scene towards an eye.
//!
//! Four parts, by the way that light came:
//! - *straight from a lamp*, also through thin walls: at each point that is asked for, by exact polygonal form factors
//!   and shadow rays (the private module `emitters`): shadows have no patch edges;
//! - *from a lamp by way of optics*: flat mirrors show images of the lamp (`images`), all else is done by photons
//!   (`photons`, spread by `caustics`);
//! - *from the environment*: what is small and bright in it is a lamp like others, the rest is sampled at the vertices of the
//!   mesh (`sky`), and seen by rays that leave the scene by way of mirrors and glass;
//! - *from other surfaces*: radiosity on an adaptive mesh (`elements`, `radiosity`), linear over each element; where
//!   something cuts through an element the point gathers for itself, so that nothing leaks through a wall;
//!   Rays that gather follow mirrors and glass (`paths`).
//!
//! Radiance of a Lambertian surface is ρE/π; "irradiance" in this module's tables is E/π, so that a white surface shows
//! it unchanged.
//!
//! ```
//! use holodrive::illumination::{Illumination, IlluminationSettings};
//! use holodrive::progress::Progress;
//! use holodrive::scene::{SceneBvh, gltf};
//!
//! let room = gltf::load("scenes/cornell.gltf".as_ref(), &gltf::LoadOptions::default())?.scene;
//! let settings = IlluminationSettings::default().coarse();
//! let light = Illumination::new(SceneBvh::new(room), settings, &Progress::new())?;
//! // All that the lamp emits is absorbed by the walls, or leaves through the open side.
//! assert!(light.report().energy.imbalance().abs() < 0.02);
//! # Ok::<(), holodrive::Error>(())
//! ```

#[cfg(test)]
mod caustic_tests;
mod caustics;
mod elements;
mod emitter;
mod emitters;
mod flat_mirrors;
mod form_factor;
mod gathered;
mod glints;
mod images;
#[cfg(test)]
mod images_tests;
mod irradiance_cache;
mod lamp_image;
mod meshing;
mod patches;
pub(crate) mod paths;
mod photons;
mod pieces;
mod probes;
mod punctual;
mod radiosity;
pub(crate) mod reflection;
mod sampling;
mod settings;
mod shading;
mod shaft;
mod sky;
mod spread;
mod surface;
#[cfg(test)]
pub(crate) mod test_oracle;
#[cfg(test)]
pub(crate) mod test_rooms;
#[cfg(test)]
mod tests;
mod transport;

pub use form_factor::FormFactor;
pub(crate) use glints::LobeRay;
pub(crate) use irradiance_cache::IrradianceCache;
pub use radiosity::Convergence;
pub use settings::{IlluminationSettings, Quality};
pub(crate) use shading::DiffuseLight;
pub(crate) use spread::Noted;
pub(crate) use surface::Surface;

use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::SceneBvh;
use caustics::Caustics;
use elements::{Elements, Senders};
use emitters::{Emitters, VisibleEmitters};
use glam::Vec3;
use images::Images;
use lamp_image::Lamps;
use meshing::Fineness;
use patches::{Found, Patches};
use paths::Optics;
use probes::Probes;
use radiosity::Surroundings;
use rayon::prelude::*;
use spread::Sampled;
use std::sync::Arc;
use std::time::Instant;
use transport::{GatheringRays, Transport};

/// Where the light went [W], linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Energy {
    /// Emitted by surfaces, and what arrives from punctual lights.
    pub emitted: Vec3,
    /// Absorbed by surfaces.
    pub absorbed: Vec3,
    /// Left the scene.
    pub escaped: Vec3,
}

impl Energy {
    /// (absorbed + escaped)/emitted − 1 for the sum of the colours: zero but for the sampling of transport.
    pub fn imbalance(&self) -> f64 {
        let emitted = f64::from(self.emitted.element_sum());
        let found = f64::from(self.absorbed.element_sum() + self.escaped.element_sum());
        if emitted > 0.0 { found / emitted - 1.0 } else { 0.0 }
    }
}

/// What computing the light took and gave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct IlluminationReport {
    /// Emitting polygons that are sampled directly.
    pub emitters: usize,
    /// Patches of the mesh.
    pub patches: usize,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Rays that gathered indirect light.
    pub gathering_rays: u64,
    /// Images of lamps in flat mirrors.
    pub lamp_images: usize,
    /// Photons that arrived on diffuse surfaces by way of other optics.
    pub photons: usize,
    /// How the solver ended.
    pub convergence: Convergence,
    /// Where the light went.
    pub energy: Energy,
    /// Time for it all [s].
    pub seconds: f64,
}

/// Residual at which it is known well enough which patches are bright.
const ROUGH_RESIDUAL: f64 = 1e-2;
/// Distance within which vertices share gathering rays, over the shortest edge that is split.
const PROBES_APART: f64 = 0.5;
/// Vertices at which images of lamps are compared.
const MOST_PLACES: usize = 400;

/// A lit scene.
pub struct Illumination {
    settings: IlluminationSettings,
    emitters: Emitters,
    mesh: Elements,
    optics: Optics,
    images: Images,
    caustics: Caustics,
    /// Emitters that each leaf of the mesh sees whole.
    clear: Vec<VisibleEmitters>,
    senders: Senders,
    /// Radiance that leaves each sender, without sampled emission.
    leaving: Vec<Vec3>,
    /// Indirect irradiance over π at the vertices, with that of weak images of lamps.
    irradiance: Vec<Vec3>,
    /// How the mesh's light was sampled.
    sampled: Sampled,
    report: IlluminationReport,
}

impl Illumination {
    /// Lights a scene.
    ///
    /// # Errors
    /// [`crate::Error::OutOfRange`] for a setting outside its domain, [`crate::Error::Interrupted`] when asked to stop.
    pub fn new(bvh: impl Into<Arc<SceneBvh>>, settings: IlluminationSettings, progress: &Progress) -> Result<Self> {
        settings.check()?;
        let bvh = bvh.into();
        let begin = Instant::now();
        let scene = bvh.scene();
        let emitters = Emitters::new(scene, settings.form_factor);
        let count = emitters.polygons.len() + scene.lights.len();
        let optics = Optics::new(bvh.clone(), settings.bounces, Images::most_mirrors(count));
        let diagonal = scene.bounds().map_or(0.0, |(low, high)| (high - low).length());
        let fineness = Fineness {
            longest: settings.longest_element * diagonal,
            shortest: settings.shortest_element * diagonal,
            nearness: settings.nearness,
            most_vertices: settings.most_vertices,
        };
        progress.start("meshing surfaces", 0);
        let lit = |triangle: u32, front: bool| {
            let material = scene.material(triangle);
            let weak = material.emissive.max_element() > 0.0 && emitters.polygon(triangle).is_none();
            (front || material.double_sided) && !material.unlit && (may_scatter(material) || weak)
        };
        let mesh = Elements::new(&bvh, fineness, settings.seed ^ 0xe1e, lit, progress)?;
        progress.check()?;
        let lamps = Lamps { optics: &optics, emitters: &emitters };
        let images = Images::new(lamps, &mesh.some_places(MOST_PLACES, bvh.offset()));
        let weak = weak_light(lamps, &images, &mesh, settings.seed ^ 0x3ea7, progress)?;
        let clear = clear_views(lamps, &mesh);
        let (mut patches, senders) = Patches::new(lamps, &images, &mesh, &clear, &settings, progress)?;
        patches.add(&mesh, &senders, &weak);
        // Where nothing scatters no photon can end.
        let count = if mesh.vertices.is_empty() { 0 } else { settings.photons };
        let photons = photons::shoot(lamps, count, settings.seed ^ 0xf070, progress)?;
        patches.receive(&bvh, &mesh, &senders, &photons);
        let mut sky = sky::at_vertices(&optics, &mesh, settings.seed ^ 0x5c1, progress)?;
        let caustics = Caustics::new(&bvh, &photons);
        progress.check()?;
        let probes = Probes::new(&bvh, &mesh, PROBES_APART * fineness.shortest, progress)?;
        let surroundings = Surroundings { mesh: &mesh, senders: &senders, optics: &optics };
        let rays = GatheringRays { each: settings.indirect_rays as usize, together: settings.gathering_rays };
        let shines = |s: u32| {
            let own = patches.direct[s as usize] + patches.emission[s as usize];
            (own + mesh.mean_over(senders.all[s as usize], &sky)).max_element() > 0.0
        };
        let mut transport = Transport::cast(surroundings, &probes, rays, shines, settings.seed ^ 0x6a7, progress)?;
        let scale = settings.form_factor.scale() as f32;
        let straight = sky.clone();
        sky.iter_mut().zip(transport.beyond()).for_each(|(sky, beyond)| *sky = (*sky + beyond) * scale);
        for (direct, &sender) in patches.direct.iter_mut().zip(&senders.all) {
            *direct += mesh.mean_over(sender, &sky);
        }
        let source: Vec<Vec3> =
            (0..senders.all.len()).map(|s| patches.albedo[s] * patches.direct[s] + patches.emission[s]).collect();
        let bounce = |x: &[Vec3]| -> Vec<Vec3> {
            let each = senders.all.par_iter().zip(&patches.albedo);
            each.map(|(&sender, &albedo)| albedo * mesh.mean_over(sender, x)).collect()
        };
        let solve = |transport: &Transport, residual: f64| {
            radiosity::solve(&source, bounce, |b| transport.gather(b, scale), residual, 200, progress)
        };
        let (first, _) = solve(&transport, settings.residual.max(ROUGH_RESIDUAL))?;
        let leave = |irradiance: &[Vec3]| -> Vec<Vec3> {
            bounce(irradiance).iter().zip(&source).map(|(reflected, s)| *s + *reflected).collect()
        };
        let left = leave(&first);
        let further = (settings.gathering_rays / 2 * 3).saturating_sub(transport.rays() as usize);
        transport.refine(&left, further, progress)?;
        let (irradiance, convergence) = solve(&transport, settings.residual)?;
        let leaving = leave(&irradiance);
        let found = Found { leaving: &leaving, irradiance: &irradiance, sky: &sky };
        let gathering_rays = transport.rays();
        let energy = patches.energy(&surroundings, &emitters, &transport, found, settings.seed);
        let (found, side, jump) = transport.into_found(&leaving, scale);
        let sky_side = sky::side(mesh.vertices.len());
        let sampled = Sampled { probes, side, jump, found, sky: straight, sky_side };
        let irradiance = irradiance.iter().zip(&weak).zip(&sky).map(|((i, w), s)| *i + w.0 + w.1 + *s).collect();
        let mut light = Self {
            settings,
            emitters,
            mesh,
            optics,
            images,
            caustics,
            clear,
            senders,
            leaving,
            irradiance,
            sampled,
            report: IlluminationReport::default(),
        };
        light.report = IlluminationReport {
            emitters: light.emitters.polygons.len(),
            patches: light.mesh.leaves().count(),
            vertices: light.mesh.vertices.len(),
            gathering_rays,
            convergence,
            lamp_images: light.images.len(),
            photons: photons.len(),
            energy,
            seconds: begin.elapsed().as_secs_f64(),
        };
        Ok(light)
    }

    /// What it took.
    pub fn report(&self) -> &IlluminationReport {
        &self.report
    }

    /// The ray caster that the light was computed with.
    pub fn bvh(&self) -> &Arc<SceneBvh> {
        &self.optics.bvh
    }

    /// Whether nothing shines at all: neither a sampled emitter, nor a weak one, nor a punctual light, nor an environment.
    pub fn is_dark(&self) -> bool {
        self.bvh().scene().environment.is_none()
            && self.emitters.is_dark()
            && self.leaving.iter().all(|b| b.max_element() <= 0.0)
    }

    fn surroundings(&self) -> Surroundings<'_> {
        Surroundings { mesh: &self.mesh, senders: &self.senders, optics: &self.optics }
    }

    fn lamps(&self) -> Lamps<'_> {
        Lamps { optics: &self.optics, emitters: &self.emitters }
    }
}

/// Which emitters each leaf of the mesh sees whole.
fn clear_views(lamps: Lamps, mesh: &Elements) -> Vec<VisibleEmitters> {
    let each = mesh.elements.par_iter().enumerate().map(|(index, element)| {
        let facing = mesh.facing(element.triangle, element.front);
        let leaf = mesh.is_leaf(index as u32);
        if leaf { lamps.emitters.clear(&lamps.optics.bvh, &mesh.corners(index), facing) } else { 0 }
    });
    each.collect()
}

/// Light of weak images at the vertices: irradiance over π of emitting surfaces, and of punctual lights.
fn weak_light(
    lamps: Lamps,
    images: &Images,
    mesh: &Elements,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<(Vec3, Vec3)>> {
    let offset = lamps.optics.bvh.offset();
    let found = mesh.vertices.par_iter().enumerate().map(|(index, vertex)| {
        if vertex.buried || progress.stopped() {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        images.weak(lamps, vertex.shading_point(offset), &mut Random::new(seed, index as u64))
    });
    let found = found.collect();
    progress.check()?;
    Ok(found)
}

fn may_scatter(material: &crate::scene::Material) -> bool {
    let metal = material.metallic >= 1.0 && material.metallic_roughness_texture.is_none();
    material.base_color.max_element() > 0.0 && !metal && material.transmission < 1.0
}
