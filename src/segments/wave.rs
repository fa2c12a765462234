//! The object's wave on a hologram plane, from segments that each see the object from their own place.
//!
//! The object's band is the plane's, divided by whole numbers k_x and k_y ([`ObjectBand`](super::ObjectBand)). The definition
//! of a point's field ([`crate::hologram::definition`]) limits it to what a grid's pitch carries; so the field is computed on
//! k_x·k_y grids of k times the pitch that interleave. Each pixel has the exact value of the limited field, and a point's
//! wave is summed where it reaches and nowhere else.
//!
//! Neighbouring segments send waves from the same points in the same phases ([`super::scene`]): there are no seams.

use super::object::Object;
use super::plane::{Piece, Rect, Segments};
use super::slit::Strip;
use crate::error::{Error, Result};
use crate::field::{Complex32, Field, Grid};
use crate::hologram::{self, Cull, HologramSettings, InstructionSet, Method};
use crate::progress::Progress;
use serde::Serialize;
use std::ops::AddAssign;
use std::time::Instant;

/// Memory that one field may take beside its points [bytes].
const FIELD_MEMORY: u64 = 512 << 20;

/// What computing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Work {
    /// Pixels computed, halos too.
    pub pixels: u64,
    /// Segments looked from.
    pub segments: u64,
    /// Points, counted anew for each segment.
    pub points: u64,
    /// Point–pixel pairs.
    pub pairs: f64,
    /// Largest bound on the relative error of a segment's field, none below what was measured of it; not of a slit's.
    pub error_bound: f64,
    /// Segments' fields whose bound passes what was asked.
    pub inexact: u64,
    /// Time for rays and points [s].
    pub points_seconds: f64,
    /// Time for the field [s].
    pub field_seconds: f64,
    /// Time for the fringe [s].
    pub fringe_seconds: f64,
}

impl Work {
    /// What a user should know of the segments' fields, if it is not all as exact as was asked.
    pub fn warning(&self) -> Option<String> {
        let Self { inexact, error_bound, .. } = self;
        (*inexact > 0).then(|| {
            format!(
                "{inexact} fields of segments may err by more than was asked, by up to {error_bound:.1e} of the segment's own light; \
                 a dark one errs by little all the same: look at a preview"
            )
        })
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.pixels += other.pixels;
        self.segments += other.segments;
        self.points += other.points;
        self.pairs += other.pairs;
        self.error_bound = self.error_bound.max(other.error_bound);
        self.inexact += other.inexact;
        self.points_seconds += other.points_seconds;
        self.field_seconds += other.field_seconds;
        self.fringe_seconds += other.fringe_seconds;
    }
}

/// What reaches a plane from an object.
pub struct ObjectWave {
    /// The plane.
    pub plane: Segments,
    /// What its segments see.
    pub object: Object,
    /// The kernels' instruction set: with another one fields differ by their rounding.
    pub instruction_set: InstructionSet,
}

/// The field of a whole plane and what it took.
#[derive(Clone, Debug)]
pub struct SegmentedField {
    /// The field.
    pub field: Field,
    /// Segments, points, pairs and times.
    pub work: Work,
}

impl ObjectWave {
    /// An object before a plane, by this machine's kernels.
    pub fn new(plane: Segments, object: Object) -> Self {
        Self { plane, object, instruction_set: InstructionSet::detect() }
    }

    /// The field on the whole plane.
    ///
    /// # Errors
    /// As [`hologram::plan`] and [`hologram::compute`]; [`Error::Parameter`] for an object of which the plane shows nothing;
    /// [`Error::Interrupted`].
    pub fn whole(&self, progress: &Progress) -> Result<SegmentedField> {
        let Grid { width, height, .. } = self.plane.grid;
        let rect = Rect { x: [0, width as i64], y: [0, height as i64] };
        let mut field = Field::zeros(self.plane.grid, self.plane.wavelength);
        let mut work = Work { pixels: rect.area() as u64, ..Work::default() };
        let pieces = self.plane.pieces(&rect, &rect);
        progress.start("views", pieces.len() as u64);
        for piece in pieces {
            self.add(&self.plane, &piece, &rect, &mut field.samples, &mut work, progress)?;
            progress.advance(1);
        }
        if work.points == 0 {
            return Err(Error::parameter("views", "nothing of the scene is in the panel's view"));
        }
        Ok(SegmentedField { field, work })
    }

    /// The field on a rectangle of the plane, from the segments of its pieces.
    ///
    /// # Errors
    /// As [`hologram::plan`] and [`hologram::compute`]; [`Error::Interrupted`].
    pub fn field(&self, rect: &Rect, pieces: &[Piece], progress: &Progress) -> Result<(Vec<Complex32>, Work)> {
        self.field_on(&self.plane, rect, pieces, progress)
    }

    /// The same of one of a slit's superimposed wavelengths.
    ///
    /// # Errors
    /// As [`Self::field`].
    pub(crate) fn field_of(
        &self,
        wavelength: usize,
        rect: &Rect,
        pieces: &[Piece],
        progress: &Progress,
    ) -> Result<(Vec<Complex32>, Work)> {
        let mut plane = self.plane.clone();
        if let Some(slit) = &mut plane.slit {
            slit.only = Some(wavelength);
        }
        self.field_on(&plane, rect, pieces, progress)
    }

    fn field_on(
        &self,
        plane: &Segments,
        rect: &Rect,
        pieces: &[Piece],
        progress: &Progress,
    ) -> Result<(Vec<Complex32>, Work)> {
        let mut field = vec![Complex32::default(); rect.area()];
        let mut work = Work { pixels: rect.area() as u64, ..Work::default() };
        for piece in pieces {
            self.add(plane, piece, rect, &mut field, &mut work, progress)?;
        }
        Ok((field, work))
    }

    /// Puts the field of a piece into that of a rectangle.
    fn add(
        &self,
        plane: &Segments,
        piece: &Piece,
        rect: &Rect,
        field: &mut [Complex32],
        work: &mut Work,
        progress: &Progress,
    ) -> Result<()> {
        let quiet = progress.part();
        let begin = Instant::now();
        let mut seen = |count: usize| {
            work.points_seconds += begin.elapsed().as_secs_f64();
            work.segments += 1;
            work.points += count as u64;
            Instant::now()
        };
        if let Some(slit) = &plane.slit {
            let strip = Strip::new(plane, slit, piece.segment[1]);
            let points = self.object.line_points(plane, piece.segment, &strip, &quiet)?;
            let begin = seen(points.len());
            work.pairs += strip.field(plane, &points, &piece.rect, rect, field);
            work.field_seconds += begin.elapsed().as_secs_f64();
            return quiet.check();
        }
        let points = self.object.points(plane, piece.segment, &quiet)?;
        let begin = seen(points.len());
        if points.is_empty() {
            return Ok(());
        }
        let settings = HologramSettings {
            error: plane.error,
            method: Some(Method::Tiles),
            cull: Cull::Soft,
            memory: FIELD_MEMORY,
            instruction_set: Some(self.instruction_set),
        };
        let [across, down] = plane.band.divisor.map(i64::from);
        for (right, below) in (0..down).flat_map(|below| (0..across).map(move |right| (right, below))) {
            let first = [piece.rect.x[0] + right, piece.rect.y[0] + below];
            let Some(grid) = self.interleaved(&piece.rect, first)? else { continue };
            let plan = hologram::plan(&points, &grid, plane.wavelength, &settings)?;
            let computed = hologram::compute(&points, &grid, plane.wavelength, &plan, &quiet)?;
            work.pairs += computed.report.coverage.pairs;
            work.error_bound = work.error_bound.max(computed.report.error_bound);
            work.inexact += u64::from(computed.report.error_bound > plane.error);
            for (i, samples) in computed.field.samples.chunks_exact(grid.width).enumerate() {
                let row = (first[1] + i as i64 * down - rect.y[0]) as usize;
                let start = row * rect.width() + (first[0] - rect.x[0]) as usize;
                for (u, value) in field[start..].iter_mut().step_by(across as usize).zip(samples) {
                    *u = *value;
                }
            }
        }
        work.field_seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Every k-th column and row of a rectangle from a first one on.
    fn interleaved(&self, rect: &Rect, first: [i64; 2]) -> Result<Option<Grid>> {
        let step = self.plane.band.divisor.map(i64::from);
        let count = |end: i64, first: i64, step: i64| ((end - first + step - 1).max(0) / step) as usize;
        let (width, height) = (count(rect.x[1], first[0], step[0]), count(rect.y[1], first[1], step[1]));
        if width == 0 || height == 0 {
            return Ok(None);
        }
        let plane = &self.plane.grid;
        let [pitch_x, pitch_y] = [plane.pitch_x * step[0] as f64, plane.pitch_y * step[1] as f64];
        let center = [
            plane.x(first[0] as usize) + 0.5 * (width as f64 - 1.0) * pitch_x,
            plane.y(first[1] as usize) - 0.5 * (height as f64 - 1.0) * pitch_y,
        ];
        Ok(Some(Grid::new(width, height, pitch_x, pitch_y)?.centered_at(center)))
    }
}
