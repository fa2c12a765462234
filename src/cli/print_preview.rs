//! What an eye sees of a finished plate, and what it should see.

use super::args::PreviewArgs;
use super::bar::Bar;
use super::report::{Report, seconds};
use holodrive::points::colour::Lasers;
use holodrive::print::preview::{Preview, PreviewSettings, preview};
use holodrive::print::{Manifest, Task};
use holodrive::progress::Progress;
use holodrive::reconstruction::metrics::{blocks, likeness};
use holodrive::reconstruction::{ColorPicture, Picture, Scale, write_rgb_png};
use holodrive::units::show_length;
use holodrive::{Error, Result};
use std::path::{Path, PathBuf};

/// `name.png` → `name-traced.png`.
fn beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-traced.png"))
}

/// What is seen: in the light of one lamp, or of a colour plate's three.
enum Seen {
    Gray(Preview),
    Color(Preview, ColorPicture),
}

impl Seen {
    fn of(folder: &Path, settings: &PreviewSettings, lamps: &[f64], progress: &Progress) -> Result<Self> {
        let lit = |wavelength| {
            let settings = PreviewSettings { wavelength: Some(wavelength), ..settings.clone() };
            preview(folder, &settings, progress)
        };
        match *lamps {
            [a, b, c] => {
                let lasers = Lasers::new([a, b, c])?;
                let [red, green, blue] = lasers.wavelengths();
                let [red, green, blue] = [lit(red)?, lit(green)?, lit(blue)?];
                let channels = [red.picture.clone(), green.picture, blue.picture];
                Ok(Self::Color(red, ColorPicture::combine(&lasers, &channels)))
            }
            [one] => lit(one).map(Self::Gray),
            _ => Err(Error::parameter("wavelength", "the plate names none")),
        }
    }

    /// How it lies; the same in all colours but for what depends on the wavelength.
    fn view(&self) -> &Preview {
        match self {
            Self::Gray(seen) | Self::Color(seen, _) => seen,
        }
    }

    fn luminance(&self) -> Picture {
        match self {
            Self::Gray(seen) => seen.picture.clone(),
            Self::Color(_, picture) => picture.luminance(),
        }
    }

    fn write(&self, path: &Path, part: f64, texts: &[(&str, String)]) -> Result<()> {
        match self {
            Self::Gray(seen) => seen.picture.write_png(path, Scale::Percentile(part), texts),
            Self::Color(_, color) => {
                write_rgb_png(path, color.width, color.height, &color.rgb, color.percentile(part), texts)
            }
        }
    }
}

pub(super) fn look(args: &PreviewArgs) -> Result<Report> {
    let mut report = Report::new("print preview");
    let manifest = Manifest::of(&args.folder)?;
    let plate = &manifest.settings.plate;
    let focus = args.focus;
    report.check_side("focus", focus, Some([plate.place; 2]));
    let [_, _, columns, rows] = args.part.unwrap_or([0, 0, plate.width, plate.height]);
    let (wide, tall) = (columns as f64 * plate.pitch_x, rows as f64 * plate.pitch_y);
    let side = |length: f64| ((400.0 * length / wide.max(tall)).round() as usize).max(1);
    let settings = PreviewSettings {
        eye: args.eye,
        pupil: args.pupil,
        focus,
        size: args.size.unwrap_or((side(wide), side(tall))),
        part: args.part,
        wavelength: None,
        memory: args.memory,
    };
    let lamps = args.wavelength.map_or_else(|| plate.wavelengths().to_vec(), |wavelength| vec![wavelength]);
    let bar = Bar::new();
    let begin = std::time::Instant::now();
    let found = Seen::of(&args.folder, &settings, &lamps, &bar.progress)?;
    let taken = begin.elapsed().as_secs_f64();
    let seen = found.view();
    let described = serde_json::json!({
        "simulated": true,
        "eye": args.eye,
        "focus": focus,
        "pupil": args.pupil,
        "wavelengths": lamps,
        "center": seen.center,
        "half": seen.half.to_array(),
    });
    let texts = |what: &str| [("Description", what.to_owned()), ("holodrive", described.to_string())];
    found.write(&args.output, args.white, &texts("simulated view of a plate's fringes"))?;
    let brightness = {
        let picture = found.luminance();
        picture.values.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.values.len().max(1) as f64
    };
    report.add("eye", args.eye.to_vec(), "");
    report.add("focus", focus, "");
    report.add("wavelengths", lamps.clone(), "");
    report.add("center", seen.center.to_vec(), "");
    report.add("half", seen.half.to_array().to_vec(), "");
    report.add("passed", seen.passed, "");
    report.add("brightness", brightness, "");
    if seen.dazzled {
        report.warn(["the lamp's own light goes through the plate into this pupil; move the eye out of it"]);
    }
    report.add("dazzled", seen.dazzled, "");
    report.add("thinned", seen.thinned.to_vec(), "");
    report.add(
        "seconds",
        taken,
        format!(
            "simulated view in focus at z = {}, {:.2} × {:.2} mm, in the light of {}, one column of {} and one row of {} \
             of light kept, in {}",
            show_length(focus),
            seen.half.x * 2e3,
            seen.half.y * 2e3,
            lamps.iter().map(|w| show_length(*w)).collect::<Vec<_>>().join(", "),
            seen.thinned[0],
            seen.thinned[1],
            seconds(taken)
        ),
    );
    if let Some(scene) = &args.traced {
        let task = Task::of(scene.clone(), &manifest.settings)?;
        let (traced, white) = task.traced(plate, args.eye, focus, seen, &bar.progress)?;
        let path = beside(&args.output);
        let texts = texts("traced view from the same eye");
        match &found {
            Seen::Gray(_) => traced.luminance().write_png(&path, Scale::White(white), &texts)?,
            Seen::Color(..) => write_rgb_png(&path, traced.width, traced.height, &traced.rgb, white, &texts)?,
        }
        let (seen, traced) = (found.luminance(), traced.luminance());
        let alike = likeness(&seen, &traced, white);
        // Speckle is averaged out over blocks of four cells.
        let averaged = |picture: &Picture| blocks(picture, 4);
        let smooth = likeness(&averaged(&seen), &averaged(&traced), white);
        report.add_serialised("likeness", &alike, "");
        report.add_serialised("likeness_of_blocks", &smooth, "");
        let line =
            format!("traced       {}: SSIM {:.3}, over 4 × 4 cells {:.3}", path.display(), alike.ssim, smooth.ssim);
        report.add("traced", path.display().to_string(), line);
    }
    report.add("output", args.output.display().to_string(), format!("picture      {}", args.output.display()));
    Ok(report)
}
