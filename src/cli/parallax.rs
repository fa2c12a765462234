//! Pictures as the eye moves through its box.

use super::args::ReconstructArgs;
use super::commands::write_view;
use super::report::{Report, seconds};
use glam::DVec2;
use holodrive::field::Field;
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Picture, Scale, View, ViewSettings};
use holodrive::{Error, Result};
use std::time::Instant;

/// Writes a picture from each place of the eye, all with the white of the brightest.
pub(super) fn views(
    args: &ReconstructArgs,
    (field, settings): (&Field, &ViewSettings),
    view: &View,
    half: DVec2,
    ((columns, rows), eye_box): ((usize, usize), [f64; 2]),
    progress: &Progress,
    mut report: Report,
) -> Result<Report> {
    let View::Eye { position, pupil, focus } = *view else {
        return Err(Error::parameter("views", "are those of an eye: give --eye and --focus"));
    };
    if columns * rows > 1024 {
        return Err(Error::parameter("views", format!("{columns}×{rows} are too many: 1024 at most")));
    }
    let begin = Instant::now();
    let size = args.size.unwrap_or((field.grid.width, field.grid.height));
    let place = |at: usize, count: usize, side: f64| match count {
        1 => 0.0,
        _ => (at as f64 / (count - 1) as f64 - 0.5) * side,
    };
    progress.start("views", (columns * rows) as u64);
    let mut seen: Vec<(usize, usize, View, Picture)> = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            progress.check()?;
            // Row 0 is the highest place, as in a picture.
            let (dx, dy) = (place(column, columns, eye_box[0]), -place(row, rows, eye_box[1]));
            let moved = View::Eye { position: [position[0] + dx, position[1] + dy, position[2]], pupil, focus };
            let picture = reconstruction::picture(field, &moved, half, size, settings, progress)?;
            seen.push((column, row, moved, picture));
            progress.advance(1);
        }
    }
    let white = seen.iter().map(|(_, _, _, p)| p.white(Scale::Percentile(args.white))).fold(0.0, f32::max);
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = args.output.extension().unwrap_or_default().to_string_lossy().into_owned();
    let mut written = Vec::new();
    for (column, row, moved, picture) in &seen {
        let path = args.output.with_file_name(format!("{stem}-{column}-{row}.{extension}"));
        write_view(&path, picture, Scale::White(white), moved, half)?;
        let View::Eye { position, .. } = moved else { continue };
        written.push(serde_json::json!({ "file": path.display().to_string(), "eye": position }));
    }
    report.add("focus", focus, "");
    report.add("simulated", true, "");
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("seconds", elapsed, format!("{columns} × {rows} simulated views in {}", seconds(elapsed)));
    report.add("views", written, format!("pictures     {stem}-0-0.{extension} …"));
    Ok(report)
}
