//! What a segment of a strip sees of a lit scene, for a plane with horizontal parallax: the points in the strip's plane.
//!
//! Rays go as those of a square segment do ([`super::scene`]), through an apex beyond the strip, but in the strip's plane,
//! and fan out only as far up and down as the strip is high. What of them the slit would see through the strip is kept.
//! Points that neighbouring segments of a strip share stand in cells of the plane, in the same place and phase.

use super::plane::{PointPhase, Segments};
use super::scene::{PlacedScene, Sight, in_step, summed};
use super::slit::{LinePoint, Strip};
use crate::error::Result;
use crate::points::placement::{Phase, WorldPoint};
use crate::progress::Progress;
use crate::random::Random;
use glam::DVec3;

impl PlacedScene {
    /// Points that a segment of a strip sees.
    pub(super) fn line_points(
        &self,
        plane: &Segments,
        segment: [i64; 2],
        strip: &Strip,
        progress: &Progress,
    ) -> Result<Vec<LinePoint>> {
        let mut points = Vec::new();
        for front in self.sides() {
            points.extend(self.fan(front, plane, segment, strip, progress)?);
        }
        Ok(points)
    }

    /// Those behind the plane, or those in front of it.
    fn fan(
        &self,
        front: bool,
        plane: &Segments,
        segment: [i64; 2],
        strip: &Strip,
        progress: &Progress,
    ) -> Result<Vec<LinePoint>> {
        let widest = strip.widest(&plane.band);
        let wide = widest / (1.0 - widest * widest).sqrt();
        let half = 0.5 * plane.size[0] as f64 * plane.grid.pitch_x;
        let beyond = half / wide;
        let [sine, cosine] = strip.inclination();
        let [x, _] = plane.center(segment);
        let apex = if front { -beyond } else { beyond };
        let eye = DVec3::new(x, strip.y + apex * sine, apex * cosine);
        // The slit sees so much through the strip at a depth; from the apex that is at most so steep.
        let high = |z: f64| 0.5 * strip.height * (1.0 - z / strip.distance);
        let [nearest, farthest] = if front { [0.0, self.depths[1]] } else { [self.depths[1].min(0.0), self.depths[0]] };
        let steep = |z: f64| high(z) / (beyond + z.abs());
        // Some more, for rays aside, whose depth along the plane is the same but whose distance is not.
        let tall = 1.1 * steep(nearest).max(steep(farthest)) * cosine;
        let before = if self.depths[1] > 0.0 { (self.depths[1] - apex).max(0.0) / cosine + self.cell } else { 0.0 };
        let sight = Sight {
            segment,
            front,
            apex: eye,
            inclination: [sine, cosine],
            tangent: [wide, tall],
            before: before * (1.0 + wide * wide + tall * tall).sqrt(),
            deepest: (beyond + nearest.abs().max(farthest.abs())) / cosine,
        };
        let (seen, rays) = self.look(plane, &sight, progress)?;
        let pixel = 2.0 * tall / rays;
        let axis = DVec3::new(0.0, sine, cosine);
        // Points in step stand on a lattice of directions from the slit's middle.
        let path = plane.view.phase == PointPhase::Path;
        let slit = DVec3::new(0.0, strip.y + strip.rise, plane.view.viewer);
        let light = |point: &WorldPoint| {
            let position = point.position;
            if strip.meets(position.y, position.z).abs() > 0.5 * strip.height {
                return None;
            }
            let place = if path { self.lattice_from_hologram(plane, slit, position) } else { position };
            let (column, depth) = (self.index(place.x)?, self.index(place.z)?);
            let direction = position - eye;
            let on_axis = direction.dot(axis).abs() / direction.length();
            // Power through all of the strip's height, over that height: what one row has.
            let solid = pixel * pixel * on_axis.powi(3) * direction.length_squared() / (2.0 * high(position.z));
            Some((column << 21 | depth, f64::from(strip.channel(point.radiance).max(0.0)) * solid))
        };
        let cells = summed(seen.iter().filter_map(light).collect());
        if path {
            let mut points = Vec::new();
            for (key, amplitude) in in_step(cells) {
                let place = DVec3::new(self.middle(key, 21), 0.0, self.middle(key, 0));
                let DVec3 { x, z, .. } = self.hologram_from_lattice(plane, slit, place);
                if (z > 0.0) == front {
                    let zeta = z / cosine;
                    let phase = Phase::Path.of(0, x.hypot(strip.length() - zeta), strip.wavelength);
                    points.push(LinePoint { x, zeta, amplitude, phase });
                }
            }
            return Ok(points);
        }
        let point = |(key, power): (u64, f64)| {
            let mut random = Random::new(plane.seed ^ 0x51_17, key ^ (strip.index as u64) << 42);
            let (x, z) = (self.place(key, 21, &mut random), self.place(key, 0, &mut random));
            let z = if front { z.max(f64::MIN_POSITIVE) } else { z.min(-f64::MIN_POSITIVE) };
            LinePoint { x, zeta: z / cosine, amplitude: power.sqrt() as f32, phase: random.phase() }
        };
        Ok(cells.map(point).collect())
    }
}
