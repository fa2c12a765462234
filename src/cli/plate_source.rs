//! What a plate shows, as it was typed.

use super::args::PrintArgs;
use super::load::{Input, input};
use crate::points::depth_map::DepthReading;
use crate::print::{PictureDepths, PictureFiles, Plate, Source, ViewFiles, ViewReading};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// The source that was typed for a plate.
pub(super) fn source(args: &PrintArgs, path: &Path, plate: &Plate) -> Result<Source> {
    let reading = args.map.reading();
    let place = plate.view.place;
    // What is nearer to the viewer is the near end, whether the plate's distance lies before or behind it.
    let [near, far] = [args.near.is_some(), args.far.is_some()];
    let ends = [place * 0.75, place * 1.25];
    let depths = PictureDepths::Relief {
        near: args.near.unwrap_or(ends[0].max(ends[1])),
        far: args.far.unwrap_or(ends[0].min(ends[1])),
        reading,
    };
    let from = ViewReading {
        spacing: args.view_spacing,
        rows: args.view_rows,
        height: args.view_height,
        ..ViewReading::default()
    };
    let found = of(path, place, depths, from.clone())?;
    if !matches!(found, Source::Views(_)) && from != ViewReading::default() {
        let named = [("view-spacing", args.view_spacing.is_some()), ("view-rows", args.view_rows.is_some())];
        let name = named.iter().find(|(_, given)| *given).map_or("view-height", |(name, _)| name);
        return Err(Error::parameter(name, "is for views: a folder of pictures, or a light field"));
    }
    let is_relief = matches!(&found, Source::Pictures(PictureFiles { depths: PictureDepths::Relief { .. }, .. }));
    if !is_relief && (near || far || reading != DepthReading::default()) {
        let what = "is for a picture with its depth map (rgb.png+depth.png); a picture alone stands where it says, logo.png@-6mm";
        return Err(Error::parameter(if near || !far { "near" } else { "far" }, what));
    }
    Ok(found)
}

/// What was typed to be compared with a plate, which knows itself where its pictures stand.
pub(super) fn same(path: &Path) -> Result<Source> {
    of(path, 0.0, PictureDepths::Flat(Vec::new()), ViewReading::default())
}

fn of(path: &Path, place: f64, relief: PictureDepths, views: ViewReading) -> Result<Source> {
    if path.is_dir() {
        return Ok(Source::Views(ViewFiles::new(path, views)));
    }
    let pictures = |files: Vec<PathBuf>, depths| Source::Pictures(PictureFiles { files, depths });
    Ok(match input(path)? {
        Input::Frame(path) => pictures(vec![path], PictureDepths::Flat(vec![place])),
        Input::Images(rgb, depth) => pictures(vec![rgb, depth], relief),
        Input::Stack(stack) => {
            let (files, depths) = stack.into_iter().unzip();
            pictures(files, PictureDepths::Flat(depths))
        }
        Input::Views(path) => Source::Views(ViewFiles::new(&path, views)),
        Input::Scene(path) | Input::Points(path) | Input::Field(path) => Source::File(path),
    })
}
