//! OpenEXR by the crate `exr`: one channel of it as an array, such as the depths that a renderer writes.

use super::{Array, Values, choose, sides};
use crate::error::{Error, Result};
use crate::files::pictures::exr_fits;
use exr::meta::MetaData;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Channels that are depths where a file has others, too; without a layer's name and in small letters.
const DEPTHS: [&str; 3] = ["z", "depth", "distance"];

/// Reads the channel of that name, the only one, or the only one that is named as a depth.
///
/// # Errors
/// [`Error::Input`] for what is no EXR of flat pixels, or promises more than it can hold.
pub(super) fn read(path: &Path, name: Option<&str>) -> Result<Array> {
    let refused = |why: exr::error::Error| Error::input(path, format!("not an EXR that can be read: {why}"));
    let open = || File::open(path).map_err(Error::io(path)).map(BufReader::new);
    let length = std::fs::metadata(path).map_err(Error::io(path))?.len();
    let head = MetaData::read_from_buffered(open()?, false).map_err(refused)?;
    exr_fits(&head, length).map_err(|why| Error::input(path, why))?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(open()?)
        .map_err(refused)?;
    let there: Vec<_> = image.layer_data.iter().flat_map(channels).collect();
    let depths: Vec<_> = there.iter().filter(|(name, ..)| is_depth(name)).cloned().collect();
    let among = if name.is_none() && depths.len() == 1 { &depths } else { &there };
    let (own, _, (shape, samples)) = choose(path, name, among)?;
    let values = match samples {
        FlatSamples::F16(v) => Values::Real(v.iter().map(|v| v.to_f64()).collect()),
        FlatSamples::F32(v) => Values::Real(v.iter().copied().map(f64::from).collect()),
        FlatSamples::U32(v) => Values::Whole(v.iter().copied().map(i64::from).collect()),
    };
    if values.count() != shape.iter().product::<usize>() {
        return Err(Error::input(path, format!("channel {own} has fewer samples than pixels; write it in full")));
    }
    Ok(Array { shape: shape.to_vec(), origin: format!("EXR, channel {own}"), values })
}

type Found<'a> = (String, String, ([usize; 2], &'a FlatSamples));

/// A layer's channels by name, with their sides.
fn channels(layer: &exr::image::Layer<exr::image::AnyChannels<FlatSamples>>) -> impl Iterator<Item = Found<'_>> {
    let shape = [layer.size.y(), layer.size.x()];
    let own = layer.attributes.layer_name.as_ref().map_or(String::new(), |name| format!("{name}."));
    layer.channel_data.list.iter().map(move |channel| {
        let what = format!(
            "{} {}",
            sides(&shape),
            match channel.sample_data {
                FlatSamples::F16(_) => "f16",
                FlatSamples::F32(_) => "f32",
                FlatSamples::U32(_) => "u32",
            }
        );
        (format!("{own}{}", channel.name), what, (shape, &channel.sample_data))
    })
}

/// `ViewLayer.Depth.Z`, `Z`, `depth`: by the last part.
fn is_depth(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name).to_ascii_lowercase();
    DEPTHS.contains(&last.as_str())
}
