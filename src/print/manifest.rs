//! What a folder holds: the settings of its plate, the hashes of its inputs, and in the end those of its tiles.

use super::plate::Plate;
use super::source::{PictureDepths, PictureFiles, Source};
use super::view_files::{ViewFiles, ViewReading};
use crate::error::{Error, Result};
use crate::files;
use crate::scene::gltf;
use crate::segments::{SceneOptions, is_cloud};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Name of the manifest in its folder.
pub(super) const NAME: &str = "manifest.json";

/// What is said of another input than the plate's own.
pub(super) const NOT_THE_INPUT: &str = "is not the file that the plate was made of, or has changed since";

/// Key of the options that says where pictures stand.
const PICTURES: &str = "pictures";

/// Key of the options that says how views are read.
const VIEWS: &str = "views";

/// A manifest is not larger than this [bytes]: the hashes of a million tiles.
const LARGEST: u64 = 96 << 20;

/// A file that went into the plate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// Everything that decides the plate's bytes, but for the kernels' instruction set and the gain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The program that computes it.
    pub program: String,
    /// The plate.
    pub plate: Plate,
    /// Scene or points and what they are made of.
    pub inputs: Vec<Input>,
    /// How the scene is lit.
    pub options: BTreeMap<String, Value>,
}

/// The manifest of a folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The settings.
    pub settings: Settings,
    /// Instruction set of the kernels, chosen by whoever began.
    pub instruction_set: String,
    /// Amplitude of the object that swings the fringe fully.
    pub amplitude: f32,
    /// Radiance that is shown as white [W/(m² sr)]; 0 for points.
    pub white: f32,
    /// SHA-256 of each tile's stored bytes; absent until all are there.
    pub tiles: Option<Vec<String>>,
}

impl Settings {
    /// What decides a plate of a scene, of points, of pictures or of views.
    ///
    /// # Errors
    /// [`Error::Io`] for files that cannot be read.
    pub fn new(plate: &Plate, source: &Source, options: &SceneOptions) -> Result<Self> {
        let program = concat!("holodrive ", env!("CARGO_PKG_VERSION")).to_owned();
        let input = match source {
            Source::File(input) => input,
            Source::Views(views) => {
                let reading = serde_json::to_value(&views.reading).unwrap_or_default();
                let options = BTreeMap::from([(VIEWS.to_owned(), reading)]);
                return Ok(Self { program, plate: plate.clone(), inputs: named(&views.files()?)?, options });
            }
            Source::Pictures(pictures) => {
                let depths = serde_json::to_value(&pictures.depths).unwrap_or_default();
                let options = BTreeMap::from([(PICTURES.to_owned(), depths)]);
                let inputs = named(&pictures.files)?;
                return Ok(Self { program, plate: plate.clone(), inputs, options });
            }
        };
        // Points are neither seen by a camera nor lit.
        let around = options.environment.as_ref().map(|panorama| panorama.path.clone()).filter(|_| !is_cloud(input));
        let options = if is_cloud(input) { Value::Null } else { serde_json::to_value(options).unwrap_or_default() };
        let options = options.as_object().into_iter().flatten().map(|(key, value)| (key.clone(), value.clone()));
        Ok(Self {
            program,
            plate: plate.clone(),
            inputs: inputs(input, around.as_deref())?,
            options: options.collect(),
        })
    }

    /// Where the pictures stand that a plate was made of; none of a scene or of points.
    pub(super) fn pictures(&self) -> Option<PictureDepths> {
        self.options.get(PICTURES).and_then(|depths| serde_json::from_value(depths.clone()).ok())
    }

    /// How the views were read that a plate was made of; none of anything else.
    pub(super) fn views(&self) -> Option<ViewReading> {
        self.options.get(VIEWS).and_then(|reading| serde_json::from_value(reading.clone()).ok())
    }

    /// How the scene of a plate was lit; the usual way where nothing was.
    pub(super) fn options(&self) -> SceneOptions {
        serde_json::from_value(Value::Object(self.options.clone().into_iter().collect())).unwrap_or_default()
    }

    /// How the scene of a plate was lit, by its file.
    ///
    /// # Errors
    /// [`Error::Input`] when the file is not the one that the plate was made of.
    pub fn options_for(&self, input: &Path) -> Result<SceneOptions> {
        let options = Value::Object(self.options.clone().into_iter().collect());
        let options: SceneOptions = serde_json::from_value(options)
            .map_err(|e| Error::input(input, format!("was lit in an unknown way: {e}")))?;
        let around = options.environment.as_ref().map(|panorama| panorama.path.as_path());
        if inputs(input, around)? != self.inputs {
            return Err(Error::input(input, NOT_THE_INPUT));
        }
        Ok(options)
    }

    /// Refuses other pictures than those that the plate was made of.
    ///
    /// # Errors
    /// [`Error::Input`]; [`Error::Io`].
    pub(super) fn check_pictures(&self, pictures: &PictureFiles) -> Result<()> {
        if pictures.files.len() != self.inputs.len() {
            let what = format!("{} pictures, and the plate was made of {}", pictures.files.len(), self.inputs.len());
            return Err(Error::parameter("traced", what));
        }
        for (path, input) in pictures.files.iter().zip(&self.inputs) {
            if file_sha256(path)? != input.sha256 {
                return Err(Error::input(path, NOT_THE_INPUT));
            }
        }
        Ok(())
    }

    /// Refuses other views than those that the plate was made of.
    ///
    /// # Errors
    /// [`Error::Input`]; [`Error::Io`].
    pub(super) fn check_views(&self, views: &ViewFiles) -> Result<()> {
        if named(&views.files()?)? == self.inputs { Ok(()) } else { Err(Error::input(&views.path, NOT_THE_INPUT)) }
    }

    /// The first setting in which two differ, with both values; numbers are compared as they are written.
    fn difference(&self, other: &Self) -> Option<String> {
        let value = |settings: &Self| serde_json::to_value(settings).unwrap_or(Value::Null).to_string();
        // Through text, so that both have gone through the same reader.
        let tree = |settings: &Self| serde_json::from_str::<Value>(&value(settings)).unwrap_or(Value::Null);
        differing("", &tree(self), &tree(other))
    }
}

fn differing(path: &str, ours: &Value, theirs: &Value) -> Option<String> {
    match (ours, theirs) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().find_map(|key| {
                let inner = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                differing(&inner, a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null))
            })
        }
        (Value::Number(a), Value::Number(b)) if close(a.as_f64(), b.as_f64()) => None,
        _ if ours == theirs => None,
        _ => Some(format!("{path} is {theirs} there, {ours} here")),
    }
}

/// Equal but for the last bits that a reader of decimals may lose.
fn close(a: Option<f64>, b: Option<f64>) -> bool {
    matches!((a, b), (Some(a), Some(b)) if (a - b).abs() <= 4.0 * f64::EPSILON * a.abs().max(b.abs()))
}

impl Manifest {
    /// Reads the manifest of a folder, if it has one.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for one that is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(NAME);
        let file = match File::open(&path) {
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            other => other.map_err(Error::io(&path))?,
        };
        let mut text = String::new();
        file.take(LARGEST + 1).read_to_string(&mut text).map_err(Error::io(&path))?;
        if text.len() as u64 > LARGEST {
            return Err(Error::input(&path, "is too long for a manifest"));
        }
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|e| Error::input(&path, format!("is no manifest of a plate, or damaged: {e}")))?;
        let damaged = |what: String| Error::input(&path, format!("is no manifest of a plate, or damaged: {what}"));
        manifest.settings.plate.check().map_err(damaged)?;
        if !(manifest.amplitude > 0.0 && manifest.amplitude.is_finite() && manifest.white.is_finite()) {
            return Err(damaged("its amplitude or its white is no number".to_owned()));
        }
        Ok(Some(manifest))
    }

    /// The manifest of a folder that must have one.
    ///
    /// # Errors
    /// As [`Manifest::read`]; [`Error::Input`] where there is none.
    pub fn of(folder: &Path) -> Result<Self> {
        Self::read(folder)?.ok_or_else(|| Error::input(folder, format!("holds no plate: there is no {NAME}")))
    }

    /// Writes it into a folder that has none; where another process was quicker, its manifest is left and returned.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(&self, folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        // Processes of several machines may share a number.
        let stamp = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let mine = folder.join(format!(".{NAME}.{}-{stamp}", std::process::id()));
        files::write_bytes(&mine, self.text().as_bytes())?;
        // A link is made only where nothing stands: the first wins, and all others take what it wrote.
        let linked = fs::hard_link(&mine, &path);
        let removed = fs::remove_file(&mine).map_err(Error::io(&mine));
        match linked {
            Err(e) if e.kind() != ErrorKind::AlreadyExists => return Err(Error::Io { path, source: e }),
            _ => removed?,
        }
        Self::of(folder)
    }

    /// Writes it over the one that is there.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn replace(&self, folder: &Path) -> Result<()> {
        files::write_bytes(&folder.join(NAME), self.text().as_bytes())
    }

    fn text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Refuses other settings than those that the folder was begun with.
    ///
    /// # Errors
    /// [`Error::Input`] with the first difference.
    pub fn check(&self, folder: &Path, settings: &Settings) -> Result<()> {
        match settings.difference(&self.settings) {
            None => Ok(()),
            Some(what) => {
                let what = format!("holds a plate of other settings ({what}); take another folder");
                Err(Error::input(folder, what))
            }
        }
    }
}

/// SHA-256 of bytes, hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().to_string()
}

/// Files by their names and hashes.
fn named(files: &[PathBuf]) -> Result<Vec<Input>> {
    files.iter().map(|path| Ok(Input { name: name(path), sha256: file_sha256(path)? })).collect()
}

/// SHA-256 of a file, hexadecimal.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn file_sha256(path: &Path) -> Result<String> {
    let mut file = File::open(path).map_err(Error::io(path))?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0u8; 1 << 20];
    loop {
        match file.read(&mut buffer).map_err(Error::io(path))? {
            0 => return Ok(hex(&digest.finalize())),
            n => digest.update(&buffer[..n]),
        }
    }
}

/// Whether two plates are the same but for the last bits that a reader of decimals may lose.
pub(super) fn same_plate(a: &Plate, b: &Plate) -> bool {
    let tree = |plate: &Plate| serde_json::to_value(plate).unwrap_or(Value::Null);
    differing("", &tree(a), &tree(b)).is_none()
}

/// Hashes of a scene or cloud and, for a glTF, of the files that it names; and of the panorama around it.
///
/// # Errors
/// [`Error::Io`] for files that cannot be read.
fn inputs(path: &Path, around: Option<&Path>) -> Result<Vec<Input>> {
    // What is beside an embedded scene changes with the program only, as the scene does.
    let own = gltf::embedded(path).map(sha256);
    let mut found = vec![Input { name: name(path), sha256: own.map_or_else(|| file_sha256(path), Ok)? }];
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf")) {
        let text = fs::read(path).map_err(Error::io(path))?;
        // What is no JSON is refused, with better words, by whoever reads the scene.
        let json: Value = serde_json::from_slice(&text).unwrap_or(Value::Null);
        let lists =
            ["buffers", "images"].map(|key| json.get(key).and_then(Value::as_array).cloned().unwrap_or_default());
        for uri in lists.iter().flatten().filter_map(|entry| entry.get("uri")?.as_str()) {
            let beside: PathBuf = path.parent().unwrap_or(Path::new("")).join(uri);
            if !uri.starts_with("data:") && beside.is_file() {
                found.push(Input { name: uri.to_owned(), sha256: file_sha256(&beside)? });
            }
        }
    }
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) && !is_cloud(path) {
        for beside in gltf::File::open(path)?.files().iter().skip(1).filter(|beside| beside.is_file()) {
            found.push(Input { name: name(beside), sha256: file_sha256(beside)? });
        }
    }
    if let Some(around) = around {
        found.push(Input { name: name(around), sha256: file_sha256(around)? });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_sha_256() {
        // FIPS 180-4, examples.
        assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(sha256(b""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/mirror-ball.gltf");
        let found = inputs(Path::new(scene), None).expect("inputs");
        assert_eq!(found.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["mirror-ball.gltf", "mirror-ball.bin"]);
    }
}
