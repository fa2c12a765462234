//! What a plate will take, and every reason why it would be wrong: found on a few small fields before the work.

use super::fringe::PlateFringes;
use super::geometry::{file_raster, fringe_area, tile_counts};
use super::plate::{Binarisation, Quantity};
use super::reference::Reference;
use super::tiff::{Layout, resolution};
use crate::encode::fringe::order_statistic;
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::files;
use crate::progress::Progress;
use crate::segments::{Object, ObjectBand, Piece, Rect, Slit, Work};
use crate::units::show_length;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Segments looked at along each side of the plate.
const LATTICE: i64 = 4;
/// Side of the field that is computed in the middle of each [px].
const PATCH: i64 = 192;

/// What is said of points.
pub(super) const NOT_A_SCENE: &str =
    "points are the same from everywhere: nothing hides anything; give a scene for true views";

/// What a few small fields of the plate show.
#[derive(Default)]
struct Sample {
    /// Amplitude of the object that swings the fringe fully, to four digits.
    amplitude: f32,
    /// Most points of one segment.
    most_points: u64,
    /// What the fields took.
    work: Work,
    /// What the whole of the segment with the most points took: small fields do not tell the speed of large ones.
    whole: Work,
    /// Segments of the plate.
    segments: u64,
}

/// What will be done.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// Pixels of the file across and down.
    pub size: [u64; 2],
    /// Width and height of the plate [m].
    pub extent: [f64; 2],
    /// Tiles across and down.
    pub tiles: [u64; 2],
    /// Segments, counted once for each tile that they lie in.
    pub segments: u64,
    /// Points of a segment: mean of the sampled ones, and most.
    pub points: [u64; 2],
    /// Rays of all segments, or 0 for a cloud.
    pub rays: u64,
    /// Point–pixel pairs of the whole plate.
    pub pairs: f64,
    /// Half angles of the object's light [rad].
    pub object_angle: [f64; 2],
    /// Largest angle that the pitch diffracts, along x and y [rad].
    pub diffraction_angle: [f64; 2],
    /// Lowest and highest spatial frequency of the reference along x and y [cycles/m].
    pub reference_frequencies: [[f64; 2]; 2],
    /// The slit, where the plate has parallax from left to right only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slit: Option<Slit>,
    /// Amplitude that swings the fringe fully.
    pub amplitude: f32,
    /// Time on this machine, measured on the samples [s].
    pub seconds: f64,
    /// The same on a hundred machines like it [s].
    pub seconds_on_100: f64,
    /// Memory [bytes].
    pub memory: u64,
    /// Length of the file [bytes].
    pub disk: u64,
    /// Free space where the folder is [bytes], if the system tells.
    pub disk_free: Option<u64>,
    /// Files that will be there.
    pub files: Vec<String>,
    /// Pixels a centimetre along x and y, as fractions.
    pub resolution: [[u32; 2]; 2],
    /// Instruction set of the kernels.
    pub instruction_set: &'static str,
    /// What a user should know.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

/// Computes small fields in segments all over the plate.
fn sample(fringes: &PlateFringes, progress: &Progress) -> Result<Sample> {
    let plate = &fringes.plate;
    let area = fringe_area(plate);
    let sides = fringes.wave.plane.size.map(|side| side as i64);
    let across = |range: [i64; 2], side: i64| [range[0].div_euclid(side), (range[1] - 1).div_euclid(side)];
    let (columns, rows) = (across(area.x, sides[0]), across(area.y, sides[1]));
    let pick = |[first, last]: [i64; 2], i: i64| first + ((2 * i + 1) * (last - first + 1)) / (2 * LATTICE);
    let mut places: Vec<[i64; 2]> =
        (0..LATTICE * LATTICE).map(|i| [pick(columns, i % LATTICE), pick(rows, i / LATTICE)]).collect();
    if let Some(points) = fringes.wave.object.clouds().first() {
        // The light of points near the plate is where they are: a lattice of places may miss it.
        let count = points.len();
        for point in (0..16).filter_map(|i| points.get((2 * i + 1) * count / 32)) {
            let grid = &fringes.wave.plane.grid;
            let pixel = [grid.column(point.position.x), grid.row(point.position.y)].map(|at| at.round() as i64);
            if area.contains(pixel) {
                places.push([pixel[0].div_euclid(sides[0]), pixel[1].div_euclid(sides[1])]);
            }
        }
    }
    places.sort_unstable();
    places.dedup();
    progress.start("samples", places.len() as u64);
    let mut sample = Sample::default();
    let mut busiest = None;
    let mut samples: Vec<f32> = Vec::new();
    for segment in places {
        progress.check()?;
        let patch = |index: i64, side: i64, bounds: [i64; 2]| {
            let from = (index * side + (side - PATCH.min(side)) / 2).max(bounds[0]);
            [from, (from + PATCH.min(side)).min(bounds[1]).max(from)]
        };
        let rect = Rect { x: patch(segment[0], sides[0], area.x), y: patch(segment[1], sides[1], area.y) };
        progress.advance(1);
        if rect.area() == 0 {
            continue;
        }
        let (field, work) = fringes.field(&rect, &[Piece { segment, rect }], progress)?;
        if work.points > sample.most_points {
            (sample.most_points, busiest) = (work.points, Some(segment));
        }
        sample.work += work;
        samples.extend(field.iter().map(|u: &Complex32| u.norm()));
    }
    if sample.work.points == 0 {
        let [x, y] = fringes.wave.plane.band.angle.map(f64::to_degrees);
        let what = format!(
            "none is seen from the plate within the {x:.2} deg × {y:.2} deg that it diffracts; move the scene or the viewer"
        );
        return Err(Error::parameter("points", what));
    }
    if let Some(segment) = busiest {
        let span = |index: i64, side: i64, bounds: [i64; 2]| {
            [(index * side).max(bounds[0]), ((index + 1) * side).min(bounds[1])]
        };
        let rect = Rect { x: span(segment[0], sides[0], area.x), y: span(segment[1], sides[1], area.y) };
        let (field, work) = fringes.field(&rect, &[Piece { segment, rect }], progress)?;
        sample.whole = work;
        let begin = Instant::now();
        fringes.levels(&field, &rect, 1.0);
        sample.whole.fringe_seconds = begin.elapsed().as_secs_f64();
    }
    let rank = (samples.len().saturating_sub(1) as f64 * plate.fringe.percentile).round() as usize;
    let amplitude = order_statistic(&mut samples, rank);
    // Four digits, so that the manifest's decimals are the very number that is used.
    let amplitude: f32 = format!("{amplitude:.3e}").parse().unwrap_or(amplitude);
    if !(amplitude > 0.0 && amplitude.is_finite()) {
        let what = "their light does not reach the plate where it was sampled; move the scene, or widen object_angle";
        return Err(Error::parameter("points", what));
    }
    sample.amplitude = amplitude;
    // Tiles need not begin where segments do; then a segment is looked from in each tile that it lies in.
    let [tiles_x, tiles_y] = tile_counts(plate);
    let per_tile = |side: u64| plate.file.tile.div_ceil(side) + u64::from(!plate.file.tile.is_multiple_of(side));
    let [wide, tall] = fringes.wave.plane.size;
    let colors = plate.slit.as_ref().filter(|slit| slit.superimposed).map_or(1, |slit| slit.wavelengths.len() as u64);
    sample.segments = tiles_x * tiles_y * per_tile(wide) * per_tile(tall) * colors;
    Ok(sample)
}

/// What a plate in a folder will take.
///
/// # Errors
/// [`Error::Parameter`] when no point is seen from anywhere on the plate; those of
/// [`crate::segments::ObjectWave::field`].
pub fn plan(fringes: &PlateFringes, folder: &Path, progress: &Progress) -> Result<Plan> {
    let sample = sample(fringes, progress)?;
    let (plate, grid) = (&fringes.plate, fringes.wave.plane.grid);
    let ObjectBand { divisor, angle, .. } = fringes.wave.plane.band;
    let pixels = plate.raster.width as f64 * plate.raster.height as f64;
    let work = &sample.work;
    // Pairs are those of all samples, their speed that of a whole segment, which is also the last one: caches are warm.
    let whole = &sample.whole;
    let share = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    let pairs = share(work.pairs, work.pixels as f64);
    let per_pixel = pairs * share(whole.field_seconds, whole.pairs);
    let points = share(work.points as f64, work.segments as f64);
    let per_segment = points * share(whole.points_seconds, whole.points as f64);
    let side = plate.file.tile as f64;
    let (halo, per_pixel_bytes) = match plate.fringe.binarisation {
        Binarisation::Diffusion if plate.fringe.bits == 1 => ((1.0 + 48.0 / side) * (1.0 + 24.0 / side), 12),
        Binarisation::DirectSearch if plate.fringe.bits == 1 => (1.0, 44),
        _ => (1.0, 12),
    };
    let fringe = share(whole.fringe_seconds, whole.pixels as f64);
    let seconds = pixels * halo * (per_pixel + fringe) + per_segment * sample.segments as f64;
    let layout = Layout::new(plate);
    let side = plate.file.tile + 48;
    let segment = (plate.segment / u64::from(divisor[0])) * (plate.segment / u64::from(divisor[1]));
    let memory = side * side * per_pixel_bytes
        + plate.file.tile * plate.file.tile * 3
        + segment * 8
        + sample.most_points * 400
        + (64 << 20);
    let rays = match fringes.wave.object {
        Object::Points(_) | Object::ColorPoints(_) | Object::Views(_) => 0,
        Object::Scene(_) => {
            (work.points as f64 / work.segments as f64 * sample.segments as f64) as u64
                * u64::from(plate.view.rays).pow(2)
        }
    };
    let file = file_raster(plate);
    let sine = |pitch: f64| (plate.wavelength / (2.0 * pitch)).min(1.0).asin();
    let mut plan = Plan {
        size: [file.width, file.height],
        extent: [grid.extent_x(), grid.extent_y()],
        tiles: tile_counts(plate),
        segments: sample.segments,
        points: [work.points / work.segments.max(1), sample.most_points],
        rays,
        pairs: pairs * pixels * halo,
        object_angle: angle,
        diffraction_angle: [sine(plate.raster.pitch_x), sine(plate.raster.pitch_y)],
        reference_frequencies: plate.reference_frequencies(),
        slit: plate.slit.clone(),
        amplitude: sample.amplitude,
        seconds,
        seconds_on_100: seconds / 100.0,
        memory,
        disk: layout.length(),
        disk_free: files::free_space(folder),
        files: vec![super::folder::PLATE.to_owned(), super::manifest::NAME.to_owned()],
        resolution: [resolution(plate.raster.pitch_x), resolution(plate.raster.pitch_y)],
        instruction_set: fringes.wave.instruction_set.name(),
        warnings: Vec::new(),
    };
    plan.warnings = warnings(fringes, &plan);
    Ok(plan)
}

fn warnings(fringes: &PlateFringes, plan: &Plan) -> Vec<String> {
    let plate = &fringes.plate;
    let object = &fringes.wave.object;
    let mut out = Vec::new();
    let mm = |metres: f64| format!("{:.3} mm", metres * 1e3);
    let degrees = |angle: f64| format!("{:.2} deg", angle.to_degrees());
    let depths = object.depths();
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        // From the viewer's place the plate's edge is seen at an angle; what is sent there must reach it.
        let edge = (0.5 * plan.extent[axis] / plate.view.viewer).atan();
        if edge > fringes.wave.plane.band.angle[axis] {
            let seen = 2.0 * plate.view.viewer * fringes.wave.plane.band.angle[axis].tan();
            out.push(format!(
                "along {name} the object's light spreads ±{}, the plate's edge is seen from {} at {}: a viewer there sees {} of the plate",
                degrees(fringes.wave.plane.band.angle[axis]),
                mm(plate.view.viewer),
                degrees(edge),
                mm(seen)
            ));
        }
    }
    let segment = plate.segment as f64 * plate.raster.pitch_x.max(plate.raster.pitch_y);
    let nearest = if depths[0] <= 0.0 && depths[1] >= 0.0 { 0.0 } else { depths[0].abs().min(depths[1].abs()) };
    if nearest < segment && matches!(object, Object::Scene(_)) {
        out.push(format!(
            "the scene comes within {} of the plate, less than a segment's {}: its occlusion is that of the segment's middle; a smaller segment is truer",
            mm(nearest),
            mm(segment)
        ));
    }
    if plate.fringe.bits == 1
        && plate.fringe.binarisation == Binarisation::Threshold
        && plate.reference == Reference::None
    {
        out.push("a thresholded fringe without a carrier keeps little but edges; look at a preview".into());
    }
    if plate.fringe.bits == 1 && plate.fringe.quantity == Quantity::Phase {
        out.push("a phase of two levels has a conjugate image as bright as the object".into());
    }
    if matches!(object, Object::Points(_) | Object::ColorPoints(_)) {
        out.push(NOT_A_SCENE.into());
    }
    if let Object::Views(views) = object {
        let (center, half, distance) = views.eye_box();
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let reach = 0.5 * plan.extent[axis] + center[axis].abs() + half[axis];
            let sent = distance * fringes.wave.plane.band.angle[axis].tan();
            if reach > sent {
                out.push(format!(
                    "along {name} the outermost view and the plate's far edge are {} apart, and light goes {} aside at that distance: \
                     those corners are dark; set views closer, or give the fringes a finer pitch",
                    mm(reach),
                    mm(sent)
                ));
            }
        }
    }
    if let Some(slit) = &plate.slit {
        let sine = plan.reference_frequencies[1][1].abs().max(plan.reference_frequencies[1][0].abs())
            * plate.wavelengths().iter().copied().fold(f64::INFINITY, f64::min);
        let (apart, lit) = (
            slit.separation(plate.view.viewer, sine),
            slit.height + plate.wavelength * plate.view.viewer / (slit.strip as f64 * plate.raster.pitch_y),
        );
        if apart < lit {
            out.push(format!(
                "a strip lit with the next colour sends its light {} beside the slit, which is lit over {}: colours mix; \
                 steepen the reference along y, or make the slit lower or the strips higher",
                mm(apart),
                mm(lit)
            ));
        }
    }
    if let Some(smallest) = plate.printer.as_ref().and_then(|printer| printer.smallest) {
        let [fx, fy] = plan.reference_frequencies.map(|[low, high]| low.abs().max(high.abs()));
        // A line and a gap of the carrier.
        let half = 0.5 / fx.hypot(fy).max(1e-9);
        if half < smallest {
            out.push(format!(
                "the reference's fringes are lines of {}, and the printer's smallest are {}; take a smaller angle or another printer",
                show_length(half),
                show_length(smallest)
            ));
        }
    }
    let finest = plate.raster.pitch_x.min(plate.raster.pitch_y);
    if let Some(smallest) = plate.printer.as_ref().and_then(|printer| printer.smallest)
        && plate.fringe.bits == 1
        && finest < 0.9 * smallest
    {
        out.push(format!(
            "one-bit fringes have lines and gaps down to a pixel, {}, and the printer's smallest are {}: what is finer comes out as it \
             likes; take pixels of that size, or another printer",
            show_length(finest),
            show_length(smallest)
        ));
    }
    if let Some(free) = plan.disk_free.filter(|free| *free < plan.disk) {
        out.push(format!("the disk has {} MB free: the work will stop when it is full", free / 1_000_000));
    }
    if plate.raster.pitch_x != plate.raster.pitch_y {
        out.push("pixels are not square; check that the printer's are the same".into());
    }
    out
}
