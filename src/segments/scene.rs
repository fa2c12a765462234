//! What a segment sees of a lit scene: points of light, traced for the segment itself.
//!
//! A scene stands before or behind the plane by a similarity transform, so every view of it is true. Each segment casts
//! its own rays: occlusion, mirrors and gloss change as the viewer moves. A segment of half side δ sends light within
//! ±θ of the normal, so at a distance |z| its pixels need what lies within δ + |z|·tan θ of its middle: just the pyramid of
//! half angle θ whose apex stands δ/tan θ beyond the plane. Rays go through that apex; the view along each is the true one
//! through the place where it meets the segment.
//!
//! # Points that neighbours share
//!
//! What comes to lie in one cell of a lattice, as large as what the viewer's eye separates at the scene's nearest point,
//! becomes one point: a place in the cell and a phase that depend on the cell and the seed only. Segments that see the same
//! surface thus send waves from the same points in the same phases, and their fields go over into each other. Its amplitude
//! is √(Σ radiance × solid angle × distance²) over the segment's own rays: |u|² is then the irradiance.

use super::plane::{PointPhase, Segments, Viewing};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::illumination::Illumination;
use crate::points::placement::{Phase, WorldPoint};
use crate::points::trace::{self, TraceSettings};
use crate::points::white::white_level;
use crate::points::{Channel, Placement, PointSource, WhitePoint};
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::{Camera, Projection};
use glam::{DMat3, DMat4, DVec3};

/// A lit scene that stands before a plane.
pub struct PlacedScene {
    light: Illumination,
    world_from_hologram: DMat4,
    hologram_from_world: DMat4,
    /// Lowest and highest z of the scene's box [m].
    pub(super) depths: [f64; 2],
    /// Side of the cells whose light becomes one point [m].
    pub(super) cell: f64,
    white: f32,
    bounces: u32,
}

/// Depth of a cell of [`PointPhase::Path`] over its width: from a tenth of the viewer's distance aside, half of it
/// moves a point by less than a half of what the eye separates.
const LAYER: f64 = 8.0;

/// Most rays of one segment.
const MOST_RAYS: f64 = 16e6;

/// Rays across and down of the picture that says what is white.
const PILOT: u32 = 128;

/// How a segment looks at what lies on one side of the plane.
pub(super) struct Sight {
    /// Column and row of the segment.
    pub(super) segment: [i64; 2],
    /// Whether it looks at what stands in front of the plane.
    pub(super) front: bool,
    /// Where its rays meet, in the hologram frame [m].
    pub(super) apex: DVec3,
    /// sin β and cos β: it looks along −(0, sin β, cos β).
    pub(super) inclination: [f64; 2],
    /// Tangents of the half angles across and down.
    pub(super) tangent: [f64; 2],
    /// How far before the apex sight begins [m].
    pub(super) before: f64,
    /// Longest ray [m].
    pub(super) deepest: f64,
}

impl PlacedScene {
    /// Places a scene and finds its white, where none is given, as a viewer before the plane's middle sees it.
    ///
    /// # Errors
    /// As [`Placement::prepare`]; [`Error::Parameter`] for a scene that is nowhere behind the viewer's eye.
    pub fn new(
        light: Illumination,
        camera: &Camera,
        plane: &Segments,
        white: Option<f32>,
        bounces: u32,
        progress: &Progress,
    ) -> Result<Self> {
        let Viewing { viewer, place, scale, resolution, .. } = plane.view;
        let scene = light.bvh().scene();
        let [width, height] = [plane.grid.extent_x(), plane.grid.extent_y()];
        // One pixel as large as the plane: only the extent matters here.
        let window = Grid::new(1, 1, width, height)?;
        let placement = Placement::Model { eye: viewer, z: place, scale };
        let placing = placement.prepare(scene, camera, width / height, &window)?;
        let hologram_from_world =
            placing.hologram_from_world().ok_or_else(|| Error::parameter("placement", "segments need a model"))?;
        let depths = scene
            .triangles
            .iter()
            .flat_map(|t| t.corners())
            .map(|p| hologram_from_world.transform_point3(p).z)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |d, z| [d[0].min(z), d[1].max(z)]);
        if depths[1] >= viewer {
            let what = format!("the scene reaches {} m before the plate, to the viewer at {viewer} m", depths[1]);
            return Err(Error::parameter("scene.viewer", what));
        }
        let cell = (viewer - depths[1]) * resolution.tan();
        let white = match white {
            Some(white) => white,
            None => {
                let settings = TraceSettings {
                    width: PILOT,
                    height: PILOT,
                    edge_rays: 1,
                    bounces,
                    seed: plane.seed,
                    ..TraceSettings::default()
                };
                white_level(&trace::trace(&light, &placing.camera, &settings, progress)?.picture)
            }
        };
        let world_from_hologram = hologram_from_world.inverse();
        Ok(Self { light, world_from_hologram, hologram_from_world, depths, cell, white, bounces })
    }

    /// Radiance beyond which light is clipped [W/(m² sr)].
    pub fn white(&self) -> f32 {
        self.white
    }

    /// The picture that an eye sees which looks straight at the plane, along −z; as many rays as `size` says.
    ///
    /// # Errors
    /// As [`trace::trace`].
    pub(crate) fn picture(
        &self,
        eye: [f64; 3],
        half_tangent: f64,
        size: [u32; 2],
        seed: u64,
        progress: &Progress,
    ) -> Result<Vec<[f32; 3]>> {
        let camera = self.camera(DVec3::from_array(eye), [0.0, 1.0], half_tangent, 0.0);
        let settings = TraceSettings {
            width: size[0],
            height: size[1],
            bounces: self.bounces,
            seed,
            edge_rays: 1,
            ..TraceSettings::default()
        };
        Ok(trace::trace(&self.light, &camera, &settings, progress)?.picture)
    }

    /// A camera at a place of the hologram frame that looks along −(0, sin β, cos β), and begins to see so far before its
    /// place [m of the hologram frame].
    fn camera(&self, eye: DVec3, [sine, cosine]: [f64; 2], half_tangent: f64, before: f64) -> Camera {
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

    /// What a segment sees: places in the hologram frame with their radiance, and the number of rays down. Rays are as
    /// close as the eye separates where they are longest.
    pub(super) fn look(&self, plane: &Segments, sight: &Sight, progress: &Progress) -> Result<(Vec<WorldPoint>, f64)> {
        let rays = f64::from(plane.view.rays);
        let [width, height] = sight.tangent.map(|t| (2.0 * t * sight.deepest / self.cell * rays).ceil().max(1.0));
        if width * height > MOST_RAYS {
            let what = format!(
                "{width}×{height} rays of one segment: the scene lies {:.3} m away and the eye separates {:.2e} m there; \
                 lower scene.rays or raise scene.resolution",
                sight.deepest, self.cell
            );
            return Err(Error::parameter("scene.rays", what));
        }
        let [column, row] = sight.segment.map(|index| index as u64);
        let stream = column << 32 ^ row << 1 ^ u64::from(sight.front);
        let settings = TraceSettings {
            width: width as u32,
            height: height as u32,
            bounces: self.bounces,
            edge_rays: 1,
            jitter: true,
            seed: Random::new(plane.seed ^ 0x7e57, stream).bits(),
            ..TraceSettings::default()
        };
        let camera = self.camera(sight.apex, sight.inclination, sight.tangent[1], sight.before);
        let traced = trace::trace(&self.light, &camera, &settings, progress)?;
        let mut seen = traced.world_points();
        WhitePoint::At(self.white).apply(&mut seen, &[])?;
        for point in &mut seen {
            point.position = self.hologram_from_world.transform_point3(point.position);
        }
        seen.retain(|point| (point.position.z > 0.0) == sight.front);
        Ok((seen, height))
    }

    /// Sides of the plane on which something stands, as [`Sight::front`] says them.
    pub(super) fn sides(&self) -> impl Iterator<Item = bool> {
        let behind = (self.depths[0] < 0.0).then_some(false);
        behind.into_iter().chain((self.depths[1] > 0.0).then_some(true))
    }

    /// Points that a segment sees.
    pub(super) fn points(&self, plane: &Segments, segment: [i64; 2], progress: &Progress) -> Result<Vec<PointSource>> {
        let mut points = Vec::new();
        for front in self.sides() {
            self.points_on(front, plane, segment, &mut points, progress)?;
        }
        Ok(points)
    }

    /// Points behind the plane, or those in front of it.
    fn points_on(
        &self,
        front: bool,
        plane: &Segments,
        segment: [i64; 2],
        points: &mut Vec<PointSource>,
        progress: &Progress,
    ) -> Result<()> {
        let tangent = plane.band.angle.map(f64::tan);
        let half = [plane.grid.pitch_x, plane.grid.pitch_y].map(|pitch| 0.5 * plane.size[0] as f64 * pitch);
        // The nearer of both axes' apices; along the other axis the pyramid is made as wide as the segment there.
        let beyond = (half[0] / tangent[0]).min(half[1] / tangent[1]);
        let apex = if front { -beyond } else { beyond };
        let [x, y] = plane.center(segment);
        let wide = tangent[0].max(half[0] / beyond);
        let tall = tangent[1].max(half[1] / beyond);
        let before = if self.depths[1] > 0.0 {
            // Lines of sight begin before whatever stands in front of the plane.
            let slant = (1.0 + wide * wide + tall * tall).sqrt();
            ((self.depths[1] - apex).max(0.0) + self.cell) * slant
        } else {
            0.0
        };
        let deepest = (apex - self.depths[0]).abs().max((self.depths[1] - apex).abs());
        let apex = DVec3::new(x, y, apex);
        let sight = Sight { segment, front, apex, inclination: [0.0, 1.0], tangent: [wide, tall], before, deepest };
        let (seen, rays) = self.look(plane, &sight, progress)?;
        // Solid angle of a pixel on the axis; off it by the cube of the cosine.
        let pixel = (2.0 * tall / rays).powi(2);
        let eye = DVec3::new(0.0, 0.0, plane.view.viewer);
        let path = plane.view.phase == PointPhase::Path;
        let light = |point: &WorldPoint| {
            let place = if path { self.lattice_from_hologram(plane, eye, point.position) } else { point.position };
            let [column, row, depth] = place.to_array().map(|value| self.index(value));
            let direction = point.position - apex;
            let cosine = direction.z.abs() / direction.length();
            let solid = pixel * cosine.powi(3) * direction.length_squared();
            let power = f64::from(Channel::Luminance.of(point.radiance).max(0.0)) * solid;
            Some((column? << 42 | row? << 21 | depth?, power))
        };
        let cells = summed(seen.iter().filter_map(light).collect());
        if path {
            for (key, amplitude) in in_step(cells) {
                let [x, y, z] = [42, 21, 0].map(|shift| self.middle(key, shift));
                let position = self.hologram_from_lattice(plane, eye, DVec3::new(x, y, z));
                if (position.z > 0.0) == front {
                    let phase = Phase::Path.of(0, (eye - position).length(), plane.wavelength);
                    points.push(PointSource { position, amplitude, phase });
                }
            }
            return Ok(());
        }
        for (key, power) in cells {
            let mut random = Random::new(plane.seed, key);
            let mut at = |shift: u32| self.place(key, shift, &mut random);
            let (x, y, z) = (at(42), at(21), at(0));
            // The cell's own place may lie on the plane's other side; it stays on this one.
            let z = if front { z.max(f64::MIN_POSITIVE) } else { z.min(0.0) };
            let position = DVec3::new(x, y, z);
            points.push(PointSource { position, amplitude: power.sqrt() as f32, phase: random.phase() });
        }
        Ok(())
    }

    /// Where a place of the hologram frame lies on the lattice of [`PointPhase::Path`] [m]: its direction from the eye, as a
    /// length at the scene's nearest depth, and its depth, `LAYER` times as coarse.
    pub(super) fn lattice_from_hologram(&self, plane: &Segments, eye: DVec3, place: DVec3) -> DVec3 {
        let scale = self.cell / plane.view.resolution.tan() / (eye.z - place.z);
        DVec3::new(scale * place.x, scale * place.y, place.z / LAYER)
    }

    /// The inverse of [`Self::lattice_from_hologram`].
    pub(super) fn hologram_from_lattice(&self, plane: &Segments, eye: DVec3, place: DVec3) -> DVec3 {
        let z = place.z * LAYER;
        let scale = self.cell / plane.view.resolution.tan() / (eye.z - z);
        DVec3::new(place.x / scale, place.y / scale, z)
    }

    /// The middle of the cell whose index begins at a bit of a key [m].
    pub(super) fn middle(&self, key: u64, shift: u32) -> f64 {
        let index = (key >> shift & ((1 << 21) - 1)) as f64 - f64::from(1 << 20);
        (index + 0.5) * self.cell
    }

    /// Index of the cell in which a coordinate lies, 21 bits; none beyond a million cells.
    pub(super) fn index(&self, value: f64) -> Option<u64> {
        let index = (value / self.cell).floor() + f64::from(1 << 20);
        (0.0..f64::from(1 << 21)).contains(&index).then_some(index as u64)
    }

    /// The coordinate that stands for the cell whose index begins at a bit of a key [m].
    pub(super) fn place(&self, key: u64, shift: u32, random: &mut Random) -> f64 {
        let index = (key >> shift & ((1 << 21) - 1)) as f64 - f64::from(1 << 20);
        (index + random.uniform()) * self.cell
    }
}

/// Amplitudes of cells whose lowest bits number depths: those one behind the other are one surface, and from the eye their
/// waves add up in step.
pub(super) fn in_step(cells: impl Iterator<Item = (u64, f64)>) -> Vec<(u64, f32)> {
    let cells: Vec<(u64, f64)> = cells.collect();
    let mut lit = Vec::with_capacity(cells.len());
    for run in cells.chunk_by(|a, b| a.0 + 1 == b.0) {
        let whole: f64 = run.iter().map(|(_, power)| power).sum();
        let bright = run.iter().filter(|(_, power)| *power > 0.0);
        lit.extend(bright.map(|&(key, power)| (key, (power / whole.sqrt()) as f32)));
    }
    lit
}

/// Cells with the sums of what lies in each.
pub(super) fn summed(mut cells: Vec<(u64, f64)>) -> impl Iterator<Item = (u64, f64)> {
    // A stable order, so that sums do not depend on anything but the rays.
    cells.sort_by_key(|(key, _)| *key);
    let sums: Vec<(u64, f64)> =
        cells.chunk_by(|a, b| a.0 == b.0).map(|same| (same[0].0, same.iter().map(|(_, power)| power).sum())).collect();
    sums.into_iter()
}
