//! The readers, each with what it starts from.

use crate::archive;
use crate::conversation::Served;
use crate::seeds::{self, Fault, Seeds};
use holodrive::calibration::read_powers;
use holodrive::display::Edid;
use holodrive::field::npy_stack::LevelStack;
use holodrive::field::{arrays, npy, stored};
use holodrive::light_field::LightField;
use holodrive::panel::{Frame, FrameMetadata, PanelProfile, Wavefront, vendor};
use holodrive::points::clouds;
use holodrive::points::depth_map::{DepthMap, DepthReading};
use holodrive::print::{Manifest, Plate, Reader};
use holodrive::reconstruction::read_gray;
use holodrive::scene::gltf::{LoadOptions, load};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// What a reader says of an input that it refuses.
pub type Said = Result<(), String>;

type Read = Box<dyn Fn(&Path, &[(String, &[u8])]) -> Said>;

/// One reader.
pub struct Parser {
    /// Its name.
    pub name: &'static str,
    /// Inputs that it starts from, packed by [`archive::pack`].
    pub seeds: Vec<Vec<u8>>,
    names: BTreeSet<String>,
    folder: tempfile::TempDir,
    read: Read,
}

impl Parser {
    fn new(name: &'static str, seeds: Seeds, read: Read) -> Result<Self, Fault> {
        let seeds = seeds.map_err(|why| format!("{name}: {why}"))?;
        let names = seeds.iter().flat_map(|seed| archive::unpack(seed)).map(|(name, _)| name).collect();
        // In memory where there is such a place: a million files are read.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory)? } else { tempfile::tempdir()? };
        let parser = Self { name, seeds, names, folder, read };
        for (i, seed) in parser.seeds.iter().enumerate() {
            // An input that is refused as it is leads nowhere.
            parser.run(seed).map_err(|why| format!("{name}: its good input {i} is refused: {why}"))?;
        }
        Ok(parser)
    }

    /// Gives an input to the reader.
    pub fn run(&self, input: &[u8]) -> Said {
        let parts: Vec<_> = archive::unpack(input).into_iter().filter(|(name, _)| self.names.contains(name)).collect();
        (self.read)(self.folder.path(), &parts)
    }
}

fn said<T>(result: Result<T, holodrive::Error>) -> Said {
    result.map(drop).map_err(|why| why.to_string())
}

/// A reader of files: the parts are written beside one another, the first is read.
fn of_file(read: impl Fn(&Path) -> Said + 'static) -> Read {
    of_named(move |folder, first| read(&folder.join(first)))
}

fn of_named(read: impl Fn(&Path, &str) -> Said + 'static) -> Read {
    Box::new(move |folder, parts| {
        let Some((first, _)) = parts.first() else { return Ok(()) };
        let paths: Vec<PathBuf> = parts.iter().map(|(name, _)| folder.join(name)).collect();
        for (path, (_, bytes)) in paths.iter().zip(parts) {
            fs::write(path, bytes).map_err(|why| format!("{}: {why}", path.display()))?;
        }
        let out = read(folder, first);
        paths.iter().for_each(|path| drop(fs::remove_file(path)));
        out
    })
}

fn array(path: &Path) -> Said {
    let read = said(arrays::read(path).and_then(|array| array.picture(path)));
    let field = said(stored::read(path).and_then(|stored| stored.field(path, Some([8e-6; 2]), Some(532e-9))));
    // Levels are an array and no field.
    if field.as_ref().is_err_and(|why| !why.contains("drive levels")) { field } else { read }
}

fn stack(path: &Path) -> Said {
    array(path)?;
    let Some(mut stack) = LevelStack::open(path).map_err(|why| why.to_string())? else { return Ok(()) };
    while stack.next_frame().map_err(|why| why.to_string())?.is_some() {}
    Ok(())
}

fn table(folder: &Path, name: &str) -> Said {
    let path = folder.join(name);
    match name {
        "hamamatsu.lut" => said(vendor::hamamatsu_lut(&path, 256)),
        "meadowlark.lut" => said(vendor::meadowlark_lut(&path)),
        "powers.csv" => said(read_powers(&path, 256, 532e-9)),
        _ => said(Wavefront::read(&path, Some(532e-9))),
    }
}

/// A picture as whatever takes pictures.
fn picture(path: &Path, panel: &PanelProfile) -> Said {
    let gray = said(read_gray(path));
    let frame = said(Frame::read(path, Some(panel), None));
    let wavefront = said(vendor::wavefront_picture(path, Some(532e-9)));
    // Not every kind of picture is a frame or a wavefront.
    let longest = [&frame, &wavefront].into_iter().filter_map(|said| said.as_ref().err()).max_by_key(|why| why.len());
    match (gray, longest) {
        (Ok(()), Some(why)) if !plain(why) => Err(why.clone()),
        (gray, _) => gray,
    }
}

/// Whether a refusal says something, and names no source file of a dependency. What it quotes of the input is cut and made
/// printable by whoever shows it.
pub fn plain(why: &str) -> bool {
    !why.is_empty() && !why.contains(".rs:")
}

fn parsed(parse: impl Fn(&str) -> Said + 'static) -> Read {
    Box::new(move |_, parts| {
        let Some((_, bytes)) = parts.first() else { return Ok(()) };
        parse(&String::from_utf8_lossy(bytes))
    })
}

/// All readers.
///
/// # Errors
/// A seed that cannot be made, or that its reader refuses.
pub fn all() -> Result<Vec<Parser>, Fault> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = |path: &Path| said(load(path, &LoadOptions::default()));
    let panel = seeds::panel()?;
    let in_mm = DepthReading { unit: Some(1e-3), ..DepthReading::default() };
    let own = Path::new("a.toml");
    let mut all = vec![
        Parser::new("gltf", seeds::gltf(), of_file(scene))?,
        Parser::new("glb", seeds::glb(), of_file(scene))?,
        Parser::new("textures", seeds::textures(), of_named(move |folder, _| scene(&folder.join("a.gltf"))))?,
        Parser::new("meshes", seeds::meshes(), of_file(scene))?,
        Parser::new("ply", seeds::ply(), of_file(|path| said(clouds::read(path))))?,
        Parser::new("clouds", seeds::clouds(), of_file(|path| said(clouds::read(path))))?,
        Parser::new("npy", seeds::arrays("npy"), of_file(stack))?,
        Parser::new("mat", seeds::arrays("mat"), of_file(array))?,
        Parser::new("hdf5", seeds::arrays("h5"), of_file(array))?,
        Parser::new("tiff", seeds::arrays("tif"), of_file(array))?,
        Parser::new("exr", seeds::exr(), of_file(array))?,
        Parser::new("sidecars", seeds::sidecars(), {
            of_named(|folder, _| {
                let path = folder.join("a.npy");
                let (field, wavefront) = (said(npy::read_metadata(&path)), said(Wavefront::read(&path, None)));
                // One of the two seeds is a field's, the other a wavefront's.
                if field.is_ok() || wavefront.is_ok() { Ok(()) } else { field.and(wavefront) }
            })
        })?,
        Parser::new("light-fields", seeds::light_fields(), {
            of_named(|folder, first| {
                let npz = first.ends_with("npz");
                said(if npz { LightField::read(&folder.join(first)) } else { LightField::read(folder) })
            })
        })?,
        Parser::new("pictures", seeds::pictures(), {
            let panel = panel.clone();
            of_file(move |path| picture(path, &panel))
        })?,
        Parser::new("frames", seeds::frames(), of_file(|path| said(Frame::read(path, None, None))))?,
        Parser::new("frame-texts", seeds::frame_texts(), {
            Box::new(move |folder, parts| {
                let Some((_, bytes)) = parts.first() else { return Ok(()) };
                let metadata: FrameMetadata = serde_json::from_slice(bytes).map_err(|why| why.to_string())?;
                let levels = vec![0; 96];
                let mut frame = Frame::new(&panel, 532e-9, levels).map_err(|why| why.to_string())?;
                frame.metadata = metadata;
                let path = folder.join("a.png");
                // What cannot be written was refused; what can be is read as a stranger's file.
                if frame.write(&path).is_err() {
                    return Ok(());
                }
                said(Frame::read(&path, None, None))
            })
        })?,
        Parser::new("depths", seeds::depths(), of_file(move |path| said(DepthMap::read(path, &in_mm))))?,
        Parser::new("profiles", seeds::texts(&root.join("calib"), "", false), {
            parsed(move |text| {
                let profile = PanelProfile::parse(text, own).map_err(|why| why.to_string())?;
                said(profile.pixel_curve(profile.default_wavelength()).and_then(|_| profile.grid()))
            })
        })?,
        Parser::new("plates", seeds::texts(&root.join("calib"), "", true), {
            parsed(move |text| said(Plate::parse(text, own)))
        })?,
        Parser::new("manifests", seeds::manifests(&root), {
            of_named(|folder, _| {
                said(Manifest::read(folder))?;
                // There is no plate beside it; that this is said is no fault.
                Reader::open(folder)
                    .map(drop)
                    .or_else(|why| if plain(&why.to_string()) { Ok(()) } else { Err(why.to_string()) })
            })
        })?,
        Parser::new("tables", seeds::tables(), of_named(table))?,
        Parser::new("edid", seeds::edids(), {
            Box::new(|_, parts| said(Edid::parse(parts.first().map_or(&[], |(_, bytes)| *bytes))))
        })?,
    ];
    let served = std::rc::Rc::new(Served::start()?);
    for protocol in ["slmsuite", "slmpy", "local"] {
        let served = std::rc::Rc::clone(&served);
        let read: Read =
            Box::new(move |_, parts| parts.first().map_or(Ok(()), |(_, bytes)| served.hear(protocol, bytes)));
        all.push(Parser::new(protocol, seeds::conversations(protocol), read)?);
    }
    Ok(all)
}
