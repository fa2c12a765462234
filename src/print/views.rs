//! What a segment of the plate sees: points of light, traced for the segment itself, or those of a cloud.
//!
//! # True views
//!
//! A scene stands before or behind the plate by a similarity transform, so every view of it is true. Each segment casts
//! its own rays: occlusion, mirrors and gloss change as the viewer moves. A segment of half side δ sends light within
//! ±θ of the normal, so at a distance |z| its pixels need what lies within δ + |z|·tan θ of its middle: just the pyramid of
//! half angle θ whose apex stands δ/tan θ beyond the plate. Rays go through that apex; the view along each is the true one
//! through the place where it meets the segment.
//!
//! # Points that neighbours share
//!
//! What comes to lie in one cell of a lattice, as large as what the viewer's eye separates at the scene's nearest point,
//! becomes one point: a place in the cell and a phase that depend on the cell and the seed only. Segments that see the same
//! surface thus send waves from the same points in the same phases, and their fields go over into each other. Its amplitude
//! is √(Σ radiance × solid angle × distance²) over the segment's own rays: |u|² is then the irradiance.

use super::geometry::segment_center;
use super::plate::Plate;
use super::reference::Band;
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::illumination::Illumination;
use crate::points::Placement;
use crate::points::trace::{self, TraceSettings};
use crate::points::white::{WhitePoint, white_level};
use crate::points::{Channel, PointSource};
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::{Camera, Projection, Scene};
use glam::{DMat3, DMat4, DVec3};

/// Where the light comes from.
pub enum Source<'a> {
    /// Points that stand in the hologram frame, the same for all segments.
    Cloud(Vec<PointSource>),
    /// The same for three lasers, red, green, blue.
    ColorCloud([Vec<PointSource>; 3]),
    /// A lit scene.
    Scene(Box<Views<'a>>),
}

/// A lit scene that stands before the plate.
pub struct Views<'a> {
    light: &'a Illumination,
    world_from_hologram: DMat4,
    hologram_from_world: DMat4,
    /// Lowest and highest z of the scene's box [m].
    depths: [f64; 2],
    /// Side of a cell [m].
    spot: f64,
    white: f32,
    bounces: u32,
}

/// Most rays of one segment.
const MOST_RAYS: f64 = 16e6;

/// Rays across and down of the picture that says what is white.
const PILOT: u32 = 128;

impl<'a> Views<'a> {
    /// Places a scene and finds its white, as a viewer before the plate's middle sees it.
    ///
    /// # Errors
    /// As [`Placement::prepare`]; [`Error::Parameter`] for a scene that is nowhere behind the viewer's eye.
    pub fn new(
        light: &'a Illumination,
        scene: &Scene,
        camera: &Camera,
        plate: &Plate,
        exposure: Option<f32>,
        bounces: u32,
        progress: &Progress,
    ) -> Result<Self> {
        let [width, height] = plate.extent();
        // One pixel as large as the plate: only the extent matters here.
        let window = Grid::new(1, 1, width, height)?;
        let placement = Placement::Model { eye: plate.viewer, z: plate.place, scale: plate.scale };
        let placing = placement.prepare(scene, camera, width / height, &window)?;
        let hologram_from_world =
            placing.hologram_from_world().ok_or_else(|| Error::parameter("placement", "a plate needs a model"))?;
        let depths = scene
            .triangles
            .iter()
            .flat_map(|t| t.corners())
            .map(|p| hologram_from_world.transform_point3(p).z)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |d, z| [d[0].min(z), d[1].max(z)]);
        if depths[1] >= plate.viewer {
            let what =
                format!("the scene reaches {} m before the plate, to the viewer at {} m", depths[1], plate.viewer);
            return Err(Error::parameter("scene.viewer", what));
        }
        let spot = (plate.viewer - depths[1]) * plate.resolution.tan();
        let white = match exposure {
            Some(white) => white,
            None => {
                let settings = TraceSettings {
                    width: PILOT,
                    height: PILOT,
                    edge_rays: 1,
                    bounces,
                    seed: plate.seed,
                    ..TraceSettings::default()
                };
                white_level(&trace::trace(light, &placing.camera, &settings, progress)?.picture)
            }
        };
        let world_from_hologram = hologram_from_world.inverse();
        Ok(Self { light, world_from_hologram, hologram_from_world, depths, spot, white, bounces })
    }

    /// Lowest and highest z of the scene's box [m].
    pub fn depths(&self) -> [f64; 2] {
        self.depths
    }
    /// Radiance beyond which light is clipped [W/(m² sr)].
    pub fn white(&self) -> f32 {
        self.white
    }
    /// Side of the cells whose light becomes one point [m].
    pub fn spot(&self) -> f64 {
        self.spot
    }
    /// World frame from hologram frame.
    pub fn world_from_hologram(&self) -> DMat4 {
        self.world_from_hologram
    }
    /// Hologram frame from world frame.
    pub fn hologram_from_world(&self) -> DMat4 {
        self.hologram_from_world
    }
    /// The lit scene.
    pub fn light(&self) -> &'a Illumination {
        self.light
    }

    /// A camera at a place of the hologram frame that looks straight at the plate, along −z.
    pub fn camera(&self, eye: DVec3, half_tangent: f64) -> Camera {
        self.inclined(eye, [0.0, 1.0], half_tangent, 0.0)
    }

    /// One that looks along −(0, sin β, cos β), and begins to see so far before its place [m of the hologram frame].
    pub(super) fn inclined(&self, eye: DVec3, [sine, cosine]: [f64; 2], half_tangent: f64, before: f64) -> Camera {
        let linear = DMat3::from_mat4(self.world_from_hologram);
        let axes = DMat3::from_cols(linear.x_axis.normalize(), linear.y_axis.normalize(), linear.z_axis.normalize());
        let tilt = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cosine, -sine), DVec3::new(0.0, sine, cosine));
        let position = self.world_from_hologram.transform_point3(eye);
        Camera {
            name: "segment".into(),
            world_from_camera: DMat4::from_mat3_translation(axes * tilt, position),
            projection: Projection::Perspective { yfov: 2.0 * half_tangent.atan(), aspect: None },
            before: before * linear.z_axis.length(),
        }
    }

    /// Rays within ±tangent across and down, as close as the eye separates where they are `deepest` long [m]; `stream`
    /// names them.
    ///
    /// # Errors
    /// [`Error::Parameter`] for more than can be cast.
    pub(super) fn rays(
        &self,
        plate: &Plate,
        tangent: [f64; 2],
        deepest: f64,
        [column, row, front]: [i64; 3],
    ) -> Result<TraceSettings> {
        let count = |tangent: f64| (2.0 * tangent * deepest / self.spot * f64::from(plate.rays)).ceil().max(1.0);
        let [width, height] = tangent.map(count);
        if width * height > MOST_RAYS {
            let what = format!(
                "{width}×{height} rays of one segment: the scene lies {deepest:.3} m away and the eye separates {:.2e} m there; \
                 lower scene.rays or raise scene.resolution",
                self.spot
            );
            return Err(Error::parameter("scene.rays", what));
        }
        let stream = (column as u64) << 32 ^ (row as u64) << 1 ^ front as u64;
        Ok(TraceSettings {
            width: width as u32,
            height: height as u32,
            bounces: self.bounces,
            edge_rays: 1,
            jitter: true,
            seed: Random::new(plate.seed ^ 0x7e57, stream).bits(),
            ..TraceSettings::default()
        })
    }

    /// Points that a segment sees.
    fn points(&self, plate: &Plate, band: &Band, segment: [i64; 2], progress: &Progress) -> Result<Vec<PointSource>> {
        let mut points = Vec::new();
        if self.depths[0] < 0.0 {
            self.look(plate, band, segment, false, &mut points, progress)?;
        }
        if self.depths[1] > 0.0 {
            self.look(plate, band, segment, true, &mut points, progress)?;
        }
        Ok(points)
    }

    /// Points behind the plate, or those in front of it.
    fn look(
        &self,
        plate: &Plate,
        band: &Band,
        segment: [i64; 2],
        front: bool,
        points: &mut Vec<PointSource>,
        progress: &Progress,
    ) -> Result<()> {
        let tangent = band.angle.map(f64::tan);
        let half = [plate.pitch_x, plate.pitch_y].map(|pitch| 0.5 * plate.segment as f64 * pitch);
        // The nearer of both axes' apices; along the other axis the pyramid is made as wide as the segment there.
        let beyond = (half[0] / tangent[0]).min(half[1] / tangent[1]);
        let apex = if front { -beyond } else { beyond };
        let [x, y] = segment_center(plate, segment);
        let wide = tangent[0].max(half[0] / beyond);
        let tall = tangent[1].max(half[1] / beyond);
        let before = if self.depths[1] > 0.0 {
            // Lines of sight begin before whatever stands in front of the plate.
            let slant = (1.0 + wide * wide + tall * tall).sqrt();
            ((self.depths[1] - apex).max(0.0) + self.spot) * slant
        } else {
            0.0
        };
        let camera = self.inclined(DVec3::new(x, y, apex), [0.0, 1.0], tall, before);
        let deepest = (apex - self.depths[0]).abs().max((self.depths[1] - apex).abs());
        let settings = self.rays(plate, [wide, tall], deepest, [segment[0], segment[1], i64::from(front)])?;
        let height = f64::from(settings.height);
        let traced = trace::trace(self.light, &camera, &settings, progress)?;
        let mut seen = traced.world_points();
        WhitePoint::At(self.white).apply(&mut seen, &[])?;
        // Solid angle of a pixel on the axis; off it by the cube of the cosine.
        let pixel = (2.0 * tall / height).powi(2);
        let at = DVec3::new(x, y, apex);
        let mut cells: Vec<(u64, f64)> = Vec::with_capacity(seen.len());
        for point in &seen {
            let position = self.hologram_from_world.transform_point3(point.position);
            if (position.z > 0.0) != front {
                continue;
            }
            let Some(key) = self.cell(position) else { continue };
            let direction = position - at;
            let cosine = direction.z.abs() / direction.length();
            let solid = pixel * cosine.powi(3) * direction.length_squared();
            cells.push((key, f64::from(Channel::Luminance.of(point.radiance).max(0.0)) * solid));
        }
        // A stable order, so that sums do not depend on anything but the rays.
        cells.sort_by_key(|(key, _)| *key);
        for same in cells.chunk_by(|a, b| a.0 == b.0) {
            let (key, power) = (same[0].0, same.iter().map(|(_, p)| p).sum::<f64>());
            let mut random = Random::new(plate.seed, key);
            let position = self.place(key, &mut random);
            // The cell's own place may lie on the plate's other side; it stays on this one.
            let z = if front { position.z.max(f64::MIN_POSITIVE) } else { position.z.min(0.0) };
            let position = DVec3::new(position.x, position.y, z);
            points.push(PointSource { position, amplitude: power.sqrt() as f32, phase: random.phase() });
        }
        Ok(())
    }

    /// The cell in which a place lies, 21 bits an axis; none beyond a million cells.
    fn cell(&self, position: DVec3) -> Option<u64> {
        let mut key = 0u64;
        for value in position.to_array() {
            let index = (value / self.spot).floor() + f64::from(1 << 20);
            if !(0.0..f64::from(1 << 21)).contains(&index) {
                return None;
            }
            key = key << 21 | index as u64;
        }
        Some(key)
    }

    /// The place in a cell that stands for it.
    fn place(&self, key: u64, random: &mut Random) -> DVec3 {
        let index = |shift: u32| (key >> shift & ((1 << 21) - 1)) as f64 - f64::from(1 << 20);
        let mut at = |shift: u32| (index(shift) + random.uniform()) * self.spot;
        DVec3::new(at(42), at(21), at(0))
    }
}

impl Source<'_> {
    /// Lowest and highest z of what shines [m]; of a scene, of all that is in it.
    pub fn depths(&self) -> [f64; 2] {
        let of = |points: &mut dyn Iterator<Item = &PointSource>| {
            points.fold([f64::INFINITY, f64::NEG_INFINITY], |d, p| [d[0].min(p.position.z), d[1].max(p.position.z)])
        };
        match self {
            Self::Scene(views) => views.depths(),
            Self::Cloud(points) => of(&mut points.iter()),
            Self::ColorCloud(points) => of(&mut points.iter().flatten()),
        }
    }

    /// Points whose light a segment needs.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::Parameter`] for more rays than can be cast.
    pub fn points(
        &self,
        plate: &Plate,
        band: &Band,
        segment: [i64; 2],
        progress: &Progress,
    ) -> Result<Vec<PointSource>> {
        match self {
            Self::Scene(views) => views.points(plate, band, segment, progress),
            Self::Cloud(points) | Self::ColorCloud([points, ..]) => {
                let center = segment_center(plate, segment);
                let half = [plate.pitch_x, plate.pitch_y].map(|pitch| (0.5 * plate.segment as f64 + 64.0) * pitch);
                // The taper's tail reaches a little beyond the band; the engines know how far exactly.
                let tangent = band.half.map(|f| (f * plate.wavelength * 1.1).min(0.95).asin().tan());
                let edge = 8.0 * plate.pitch_x.max(plate.pitch_y) * f64::from(band.divisor[0].max(band.divisor[1]));
                let near = |p: &&PointSource| {
                    let offset = [p.position.x - center[0], p.position.y - center[1]];
                    (0..2).all(|axis| offset[axis].abs() <= half[axis] + edge + p.position.z.abs() * tangent[axis])
                };
                Ok(points.iter().filter(near).copied().collect())
            }
        }
    }
}
