//! What a strip of a plate with horizontal parallax shows of a scene or a cloud: the points in its plane.
//!
//! Rays go as those of a square segment do ([`super::views`]), through an apex beyond the strip, but in the strip's plane,
//! and fan out only as far up and down as the strip is high. What of them the slit would see through the strip is kept.
//! Points that neighbouring segments of a strip share stand in cells of the plane, in the same place and phase.

use super::geometry::segment_center;
use super::plate::Plate;
use super::reference::Band;
use super::slit::{LinePoint, Strip};
use super::views::{Source, Views};
use crate::error::Result;
use crate::points::PointSource;
use crate::points::WhitePoint;
use crate::points::trace;
use crate::progress::Progress;
use crate::random::Random;
use glam::DVec3;

impl Views<'_> {
    /// Points that a segment of a strip sees.
    fn line(
        &self,
        plate: &Plate,
        band: &Band,
        segment: [i64; 2],
        strip: &Strip,
        progress: &Progress,
    ) -> Result<Vec<LinePoint>> {
        let mut points = Vec::new();
        let [nearest, farthest] = [self.depths()[1], self.depths()[0]];
        if farthest < 0.0 {
            self.fan(plate, band, segment, strip, false, &mut points, progress)?;
        }
        if nearest > 0.0 {
            self.fan(plate, band, segment, strip, true, &mut points, progress)?;
        }
        Ok(points)
    }

    /// Those behind the plate, or those in front of it.
    #[allow(clippy::too_many_arguments)] // What a strip's rays depend on; a struct of them would be used once.
    fn fan(
        &self,
        plate: &Plate,
        band: &Band,
        segment: [i64; 2],
        strip: &Strip,
        front: bool,
        points: &mut Vec<LinePoint>,
        progress: &Progress,
    ) -> Result<()> {
        let widest = strip.widest(band);
        let wide = widest / (1.0 - widest * widest).sqrt();
        let half = 0.5 * plate.segment as f64 * plate.pitch_x;
        let beyond = half / wide;
        let [sine, cosine] = strip.inclination();
        let [x, _] = segment_center(plate, segment);
        let apex = if front { -beyond } else { beyond };
        let eye = DVec3::new(x, strip.y + apex * sine, apex * cosine);
        // The slit sees so much through the strip at a depth; from the apex that is at most so steep.
        let high = |z: f64| 0.5 * strip.height * (1.0 - z / strip.distance);
        let [nearest, farthest] =
            if front { [0.0, self.depths()[1]] } else { [self.depths()[1].min(0.0), self.depths()[0]] };
        let steep = |z: f64| high(z) / (beyond + z.abs());
        // Some more, for rays aside, whose depth along the plane is the same but whose distance is not.
        let tall = 1.1 * steep(nearest).max(steep(farthest)) * cosine;
        let before =
            if self.depths()[1] > 0.0 { (self.depths()[1] - apex).max(0.0) / cosine + self.spot() } else { 0.0 };
        let deepest = (beyond + nearest.abs().max(farthest.abs())) / cosine;
        let traced = trace::trace(
            self.light(),
            &self.inclined(eye, [sine, cosine], tall, before * (1.0 + wide * wide + tall * tall).sqrt()),
            &self.rays(plate, [wide, tall], deepest, [segment[0], segment[1], i64::from(front)])?,
            progress,
        )?;
        let pixel = 2.0 * tall / f64::from(traced.height);
        let mut seen = traced.world_points();
        WhitePoint::At(self.white()).apply(&mut seen, &[])?;
        let axis = DVec3::new(0.0, sine, cosine);
        let spot = self.spot();
        let mut cells: Vec<(u64, f64)> = Vec::with_capacity(seen.len());
        for point in &seen {
            let position = self.hologram_from_world().transform_point3(point.position);
            if (position.z > 0.0) != front || strip.meets(position.y, position.z).abs() > 0.5 * strip.height {
                continue;
            }
            let cell = |value: f64| {
                let index = (value / spot).floor() + f64::from(1 << 20);
                (0.0..f64::from(1 << 21)).contains(&index).then_some(index as u64)
            };
            let (Some(column), Some(depth)) = (cell(position.x), cell(position.z)) else { continue };
            let direction = position - eye;
            let on_axis = direction.dot(axis).abs() / direction.length();
            // Power through all of the strip's height, over that height: what one row has.
            let solid = pixel * pixel * on_axis.powi(3) * direction.length_squared() / (2.0 * high(position.z));
            cells.push((column << 21 | depth, f64::from(strip.channel(point.radiance).max(0.0)) * solid));
        }
        cells.sort_by_key(|(key, _)| *key);
        for same in cells.chunk_by(|a, b| a.0 == b.0) {
            let (key, power) = (same[0].0, same.iter().map(|(_, p)| p).sum::<f64>());
            let mut random = Random::new(plate.seed ^ 0x51_17, key ^ (strip.index as u64) << 42);
            let mut place =
                |shift: u32| ((key >> shift & ((1 << 21) - 1)) as f64 - f64::from(1 << 20) + random.uniform()) * spot;
            let (x, z) = (place(21), place(0));
            let z = if front { z.max(f64::MIN_POSITIVE) } else { z.min(-f64::MIN_POSITIVE) };
            points.push(LinePoint { x, zeta: z / cosine, amplitude: power.sqrt() as f32, phase: random.phase() });
        }
        Ok(())
    }
}

impl Source<'_> {
    /// Points that a segment of a strip shows.
    ///
    /// # Errors
    /// As [`Source::points`].
    pub(super) fn line(
        &self,
        plate: &Plate,
        band: &Band,
        segment: [i64; 2],
        strip: &Strip,
        progress: &Progress,
    ) -> Result<Vec<LinePoint>> {
        let cloud = match self {
            Self::Scene(views) => return views.line(plate, band, segment, strip, progress),
            Self::Cloud(points) => points,
            Self::ColorCloud(points) => &points[strip.laser().unwrap_or(0)],
        };
        let [x, _] = segment_center(plate, segment);
        let widest = strip.widest(band);
        let tangent = widest / (1.0 - widest * widest).sqrt();
        let [_, cosine] = strip.inclination();
        let reach = (0.5 * plate.segment as f64 + 64.0) * plate.pitch_x;
        let shown = |p: &&PointSource| {
            p.position.z < strip.distance
                && (-0.5 * strip.height..0.5 * strip.height).contains(&strip.meets(p.position.y, p.position.z))
                && (p.position.x - x).abs() <= reach + p.position.z.abs() / cosine * tangent
        };
        // On the axis a point's wave has amplitude a/r; that of a line point has a'/√r.
        let line = |p: &PointSource| {
            let zeta = p.position.z / cosine;
            let zeta = if zeta == 0.0 { -f64::MIN_POSITIVE } else { zeta };
            let amplitude = p.amplitude / zeta.abs().max(plate.pitch_x).sqrt() as f32;
            LinePoint { x: p.position.x, zeta, amplitude, phase: p.phase }
        };
        Ok(cloud.iter().filter(shown).map(line).collect())
    }
}
