//! The job sheet of a finished plate: one HTML page, whole in itself, for whoever prints it and whoever lights it.

use super::command::command;
use super::diagram::{diagram, direction};
use super::labelled::place;
use super::manifest::{Manifest, file_sha256};
use super::plate::{Plate, Polarity, Quantity};
use super::reference::{Reference, Side};
use super::view::PlateView;
use super::{folder, geometry};
use crate::error::{Error, Result};
use crate::files;
use crate::names::Named;
use crate::progress::Progress;
use crate::units::{show_length, show_pitch};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use std::path::Path;

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}\
    h1{font-size:1.5em}h2{font-size:1.1em;margin:1.6em 0 .4em}table{border-collapse:collapse}\
    td,th{text-align:left;vertical-align:top;padding:.15em 1.2em .15em 0}th{font-weight:600;white-space:nowrap}\
    code{font-size:.92em;overflow-wrap:anywhere}img{image-rendering:auto;max-width:100%}svg text{font:12px sans-serif}\
    .n{font-weight:600}.o{fill:#cfe3f5;stroke:#48a}.s{fill:#ddd;stroke:#666}.p{stroke:#222;stroke-width:4}.e{fill:none;stroke:#222}\
    .r{stroke:#c60;stroke-width:2;fill:none}.z{stroke:#c60;stroke-dasharray:4 4;fill:none}@media print{body{margin:0}}";

/// Text within HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn table(rows: &[(&str, String)]) -> String {
    let row = |(name, value): &(&str, String)| format!("<tr><th>{name}</th><td>{}</td></tr>", escaped(value));
    format!("<table>{}</table>", rows.iter().map(row).collect::<String>())
}

fn degrees(angle: f64) -> String {
    // No minus before a zero.
    format!("{:.2}\u{b0}", angle.to_degrees() + 0.0)
}

fn millimetres(metres: f64) -> String {
    format!("{:.3} mm", metres * 1e3)
}

/// The pixels and the machine.
fn of_plate(plate: &Plate) -> Vec<(&'static str, String)> {
    let (raster, grid) = (plate.raster, plate.raster.grid());
    let file = geometry::file_raster(plate);
    let levels = match (plate.fringe.bits, plate.fringe.polarity) {
        (1, Polarity::Positive) => "1 bit; 1 is clear",
        (1, Polarity::Negative) => "1 bit; 0 is clear",
        (_, Polarity::Positive) => "8 bit; 255 is clear",
        (_, Polarity::Negative) => "8 bit; 0 is clear",
    };
    let quantity = match plate.fringe.quantity {
        Quantity::Bipolar => "amplitude (interference term)",
        Quantity::Intensity => "amplitude (intensity)",
        Quantity::Phase => "phase",
    };
    let mut rows = vec![
        ("size", format!("{} \u{d7} {}", millimetres(grid.extent_x()), millimetres(grid.extent_y()))),
        ("pixels", format!("{} \u{d7} {}", raster.width, raster.height)),
        (
            "pixel pitch",
            format!(
                "{} ({:.0} \u{d7} {:.0} dpi)",
                show_pitch([raster.pitch_x, raster.pitch_y]),
                25.4e-3 / raster.pitch_x,
                25.4e-3 / raster.pitch_y
            ),
        ),
        ("levels", levels.to_owned()),
        ("they are", quantity.to_owned()),
    ];
    if plate.fringe.bits == 1 {
        rows.push(("one bit by", plate.fringe.binarisation.name().to_owned()));
    }
    let turned = if plate.file.rotation == 0 {
        String::new()
    } else {
        format!(", turned clockwise by {}\u{b0}", plate.file.rotation)
    };
    let mirrored = if plate.file.mirror { "left\u{2013}right reversed" } else { "as the viewer sees it" };
    rows.push(("the file shows it", format!("{mirrored}{turned}, {} \u{d7} {} pixels", file.width, file.height)));
    if plate.file.guard > 0 {
        let [x, y] = [raster.pitch_x, raster.pitch_y].map(|pitch| plate.file.guard as f64 * pitch);
        rows.push(("border", format!("{} \u{d7} {} without fringes", millimetres(x), millimetres(y))));
    }
    if let Some(printer) = &plate.printer {
        rows.push(("printer", printer.machine.clone()));
        rows.extend(printer.field.map(|[w, h]| ("its field", format!("{w} \u{d7} {h} pixels"))));
        rows.extend(printer.smallest.map(|smallest| ("its smallest feature", show_length(smallest))));
    }
    let curve = if plate.transfer.is_some() { "measured from a card, and undone in the file" } else { "not measured" };
    rows.push(("printer's curve", curve.to_owned()));
    rows
}

/// The lamp and the viewer.
fn of_light(plate: &Plate, view: &PlateView, angle: [f64; 2]) -> Vec<(&'static str, String)> {
    let waves: Vec<String> = plate.wavelengths().iter().map(|w| show_length(*w)).collect();
    let mut rows = vec![("wavelength", waves.join(", "))];
    rows.push((
        "lamp",
        match plate.lamp.as_ref().or(view.report.lamp.as_ref()) {
            Some(lamp) => lamp.to_string(),
            None => "laser, or a small and distant lamp of one colour".into(),
        },
    ));
    rows.push((
        "its light",
        match plate.reference {
            Reference::None => "along the plate's normal".into(),
            Reference::Plane { angle: [x, y], side } => {
                let side = if side == Side::Front { "from the viewer's side" } else { "from behind" };
                format!("{side}, {} towards the viewer's right, {} upwards", degrees(x), degrees(y))
            }
            Reference::Point { position } => {
                format!("from a point at {} (right, up, towards the viewer)", place(position))
            }
        },
    ));
    rows.push(("object light", format!("\u{b1}{} across, \u{b1}{} up and down", degrees(angle[0]), degrees(angle[1]))));
    rows.push(("viewer", format!("{} before the plate", show_length(plate.view.viewer))));
    let side = if plate.view.place < 0.0 { "behind" } else { "before" };
    rows.push(("scene's middle", format!("{} {side} the plate", show_length(plate.view.place.abs()))));
    if let Some(slit) = &plate.slit {
        rows.push(("slit", format!("{} high at the viewer: depth from left to right only", show_length(slit.height))));
    }
    if let Some([wide, tall]) = plate.eye_box {
        rows.push(("eye box", format!("{} \u{d7} {}", show_length(wide), show_length(tall))));
    }
    rows
}

/// What whoever prints and lights it should look at, in the order of the work.
fn checks(plate: &Plate, folder: &Path) -> Vec<String> {
    let grid = plate.raster.grid();
    let mut list = vec![
        format!(
            "The files are whole: <code>holodrive print verify {}</code>, or by the SHA-256 below.",
            escaped(&folder.display().to_string())
        ),
        format!(
            "One pixel of the file is one pixel of the printer: no scaling, no interpolation, no dithering. The plate measures {} \u{d7} {}.",
            millimetres(grid.extent_x()),
            millimetres(grid.extent_y())
        ),
    ];
    if plate.transfer.is_none() {
        list.push(
            "The printer's dose, dot gain and line widths were not measured: print and scan a card first \
                   (<code>holodrive calibrate plate</code>), or expose a series."
                .into(),
        );
    }
    if let Some(printer) = plate.printer.as_ref().filter(|printer| !printer.unverified.is_empty()) {
        let keys: Vec<String> = printer.unverified.iter().map(|key| escaped(key)).collect();
        list.push(format!("Nobody has checked these figures of the printer: {}.", keys.join(", ")));
    }
    if plate.file.marks > 0 {
        list.push("The crosses in all four corners are sharp.".into());
    }
    list.push(if plate.file.mirror {
        "The file is reversed: the written side turns away from the viewer.".into()
    } else {
        "The written side is turned towards the viewer; if it must be the other one, print a plate with <code>mirror = true</code>.".into()
    });
    let aside = |axis: usize, names: [&str; 2]| {
        direction(plate, axis).map(|[along, _]| along.asin()).filter(|angle| angle.abs() > 1e-6).map(|angle| {
            // Light that runs upwards comes from below.
            format!("{} {}", degrees(angle.abs()), names[usize::from(angle > 0.0)])
        })
    };
    let from: Vec<String> = [aside(0, ["from the right", "from the left"]), aside(1, ["from above", "from below"])]
        .into_iter()
        .flatten()
        .collect();
    let from = if from.is_empty() { "straight on".to_owned() } else { from.join(" and ") };
    list.push(format!(
        "The lamp shines {from}, as the viewer sees it. From {} the picture above is seen upright; if it stands on its head or far away \
         from where it should be, turn the plate round.",
        show_length(plate.view.viewer)
    ));
    list.push("The lamp itself is seen beside the picture, not in it.".into());
    list
}

/// Writes the job sheet of a plate's folder, with a view of it.
///
/// # Errors
/// Those of a plate that is missing, incomplete or not as it was computed; [`Error::Io`].
pub fn write_sheet(folder: &Path, view: &PlateView, white: f32, path: &Path, progress: &Progress) -> Result<()> {
    // The hashes on the page are said to be those of whole files.
    folder::verify(folder, progress)?;
    let manifest = Manifest::of(folder)?;
    let settings = &manifest.settings;
    let plate = &settings.plate;
    let angle = plate.segments()?.band.angle;
    let mut hashes = Vec::new();
    for name in [folder::PLATE, super::manifest::NAME] {
        let file = folder.join(name);
        let length = std::fs::metadata(&file).map_err(Error::io(&file))?.len();
        hashes.push((name.to_owned(), length, file_sha256(&file)?));
    }
    let picture = BASE64_STANDARD.encode(view.labelled(white).png(&view.texts("simulated view of a plate's fringes"))?);
    let name = escaped(&plate.name);
    let list: String = checks(plate, folder).iter().map(|check| format!("<li>{check}</li>")).collect();
    let files: String = hashes
        .iter()
        .map(|(name, length, hash)| {
            format!("<tr><th>{name}</th><td>{length} bytes</td><td><code>{hash}</code></td></tr>")
        })
        .collect();
    let made_of: String = settings
        .inputs
        .iter()
        .map(|input| {
            format!("<tr><th>{}</th><td>went in</td><td><code>{}</code></td></tr>", escaped(&input.name), input.sha256)
        })
        .collect();
    let page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Plate {name}</title><style>{STYLE}</style></head><body>\n\
         <h1>Plate {name}</h1>\n<p>{}</p>\n\
         <h2>Printing</h2>\n{}\n<h2>Light and viewer</h2>\n{}\n{}\n\
         <p>Orange: the lamp's light, and where it goes on. Blue: the light of the picture. Angles are true, lengths are not.</p>\n\
         <h2>What is seen (simulated from the file)</h2>\n\
         <img alt=\"simulated view of the plate\" src=\"data:image/png;base64,{picture}\">\n\
         <h2>To check</h2>\n<ol>{list}</ol>\n\
         <h2>Files</h2>\n<table>{files}{made_of}</table>\n\
         <h2>Command</h2>\n<p><code>{}</code></p>\n<p>Made by {}.</p>\n</body></html>\n",
        escaped(&view.words()[1]),
        table(&of_plate(plate)),
        table(&of_light(plate, view, angle)),
        diagram(plate, angle),
        escaped(&command(settings, folder)),
        escaped(&settings.program),
    );
    files::write_bytes(path, page.as_bytes())
}
