//! The command that makes a plate, from what its manifest says.

use super::manifest::{Settings, same_plate};
use super::plate::{Binarisation, Plate};
use super::plate_size::{Asked, PlateSize};
use super::source::PictureDepths;
use super::view_files::ViewReading;
use crate::names::Named;
use crate::scene::environment::Sky;
use crate::segments::{PointPhase, SceneOptions};
use crate::units::show_length;
use std::path::Path;

/// A word for a shell.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "._-/+:,@%=".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// The input as it is typed, and where it stands.
fn input(settings: &Settings) -> Vec<String> {
    if let Some(ViewReading { spacing, rows, height, name }) = settings.views() {
        let mut words = vec![quoted(&name)];
        let lengths = [("--view-spacing", spacing), ("--view-height", height)];
        words.extend(lengths.into_iter().flat_map(|(flag, length)| {
            length.into_iter().flat_map(move |length| [flag.to_owned(), show_length(length)])
        }));
        words.extend(rows.into_iter().flat_map(|rows| ["--view-rows".to_owned(), rows.to_string()]));
        return words;
    }
    let names: Vec<&str> = settings.inputs.iter().map(|input| input.name.as_str()).collect();
    match settings.pictures() {
        None => names.first().map(|name| quoted(name)).into_iter().collect(),
        Some(PictureDepths::Flat(depths)) => {
            let each = names.iter().zip(depths).map(|(name, z)| format!("{name}@{}", show_length(z)));
            vec![quoted(&each.collect::<Vec<_>>().join("+"))]
        }
        Some(PictureDepths::Relief { near, far, reading }) => {
            let mut words = vec![quoted(&names.join("+"))];
            words.extend(["--near".into(), show_length(near), "--far".into(), show_length(far)]);
            words.extend(reading.scale.into_iter().flat_map(|scale| ["--depth-scale".into(), scale.name().into()]));
            words.extend(reading.unit.into_iter().flat_map(|unit| ["--depth-unit".into(), show_length(unit)]));
            let range = reading.range.map(|range| range.map(show_length).join(","));
            words.extend(range.into_iter().flat_map(|range| ["--depth-range".into(), range]));
            words
        }
    }
}

/// The command that makes the same plate. What it cannot say is in the manifest.
pub(super) fn command(settings: &Settings, folder: &Path) -> String {
    let plate = &settings.plate;
    let mut words = vec!["holodrive".to_owned(), "print".to_owned()];
    words.extend(input(settings));
    words.push("--plate".into());
    let built_in = Plate::embedded_names().find(|name| *name == plate.name);
    let found = built_in.and_then(|name| asked(name, plate));
    match found {
        Some(flags) => {
            words.push(plate.name.clone());
            words.extend(flags);
        }
        None => words.push(quoted(&format!("{}.toml", plate.name))),
    }
    let options = settings.options();
    let SceneOptions { camera, animation, time, viewer_light, allow_outside, environment, sky, .. } = options;
    let SceneOptions { bounces, photons, light_error, white, .. } = options;
    let usual = SceneOptions::default();
    // Its value must stand in the same word.
    words.extend(sky.map(|Sky { elevation, azimuth, turbidity, .. }| {
        format!("--sky={}deg,{}deg,{turbidity}", elevation.to_degrees(), azimuth.to_degrees())
    }));
    let mut flag = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            words.push(format!("--{name}"));
            words.extend((!value.is_empty()).then(|| quoted(&value)));
        }
    };
    flag("camera", camera);
    flag("animation", animation);
    flag("time", (time != usual.time).then(|| time.to_string()));
    flag("viewer-light", viewer_light.then(String::new));
    flag("allow-outside", allow_outside.then(String::new));
    let around = environment.as_ref();
    flag("environment", around.map(|panorama| panorama.path.display().to_string()));
    flag("environment-turn", around.filter(|p| p.turn != 0.0).map(|p| format!("{}deg", p.turn.to_degrees())));
    let strength = around.map(|panorama| panorama.strength).or(sky.map(|sky| sky.strength));
    flag("environment-strength", strength.filter(|strength| *strength != 1.0).map(|strength| strength.to_string()));
    flag("light-error", (light_error != usual.light_error).then(|| format!("{}%", 100.0 * light_error)));
    flag("bounces", (bounces != usual.bounces).then(|| bounces.to_string()));
    flag("photons", (photons != usual.photons).then(|| photons.to_string()));
    flag("white", white.map(|white| if white == f32::MAX { "none".into() } else { white.to_string() }));
    words.push("-o".into());
    words.push(quoted(&folder.display().to_string()));
    words.join(" ")
}

/// The flags that make the built-in plate of a name this one; none where flags do not.
fn asked(name: &str, plate: &Plate) -> Option<Vec<String>> {
    let usual = Plate::find(name, &Asked::default()).ok()?;
    let mut asked = Asked::default();
    let mut flags = Vec::new();
    let (raster, fringe) = (plate.raster, plate.fringe);
    if raster.pitch_x != usual.raster.pitch_x && raster.pitch_x == raster.pitch_y {
        asked.pitch = Some(raster.pitch_x);
        flags.extend(["--pitch".to_owned(), show_length(raster.pitch_x)]);
    }
    if (raster.width, raster.height) != (usual.raster.width, usual.raster.height) {
        asked.size = Some(PlateSize::Pixels([raster.width, raster.height]));
        flags.extend(["--size".to_owned(), format!("{}x{}", raster.width, raster.height)]);
    }
    if fringe.binarisation != usual.fringe.binarisation {
        asked.binarisation = Some(fringe.binarisation);
        flags.extend(["--binarisation".to_owned(), Binarisation::name(&fringe.binarisation).to_owned()]);
    }
    if plate.view.phase != usual.view.phase {
        asked.phase = Some(plate.view.phase);
        flags.extend(["--phase".to_owned(), PointPhase::name(&plate.view.phase).to_owned()]);
    }
    if !same_plate(&Plate::find(name, &asked).ok()?, plate) {
        asked.segment = Some(plate.segment);
        flags.extend(["--segment".to_owned(), plate.segment.to_string()]);
    }
    same_plate(&Plate::find(name, &asked).ok()?, plate).then_some(flags)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::print::Source;

    #[test]
    fn a_built_in_plate_is_named_with_what_was_asked_of_it_and_another_by_its_file() {
        let plate = |asked: &Asked| Plate::find("chrome-1um", asked).expect("plate");
        let of = |plate: Plate, options: SceneOptions| {
            let settings =
                Settings::new(&plate, &Source::File("scenes/cornell.gltf".into()), &options).expect("settings");
            command(&settings, "my plate".as_ref())
        };
        let usual = of(plate(&Asked::default()), SceneOptions::default());
        assert_eq!(usual, "holodrive print cornell.gltf --plate chrome-1um -o 'my plate'");
        let asked = Asked {
            size: Some(PlateSize::Lengths([2e-3, 3e-3])),
            pitch: Some(0.5e-6),
            binarisation: Some(Binarisation::DirectSearch),
            phase: Some(PointPhase::Path),
            segment: Some(512),
        };
        let options = SceneOptions { bounces: 4, white: Some(f32::MAX), ..SceneOptions::default() };
        let other = of(plate(&asked), options);
        let flags = "--pitch 500nm --size 4000x6000 --binarisation direct-search --phase path --segment 512 --bounces 4 --white none";
        assert_eq!(other, format!("holodrive print cornell.gltf --plate chrome-1um {flags} -o 'my plate'"));
        let mut own = plate(&Asked::default());
        own.seed = 7;
        let own = of(own, SceneOptions::default());
        assert_eq!(own, "holodrive print cornell.gltf --plate chrome-1um.toml -o 'my plate'");
    }
}
