//! The parsed file: container, schema, extensions, checked look-ups.

use super::Choice;
use super::converted;
use super::embedded;
use super::packed;
use super::resources::{self, MAX_FILE_BYTES, Source};
use super::rewritten::rewrite;
use crate::error::{Error, Result};
use crate::scene::Warning;
use gltf::json;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Extensions that are read; any other is refused where a file requires it and left out where it does not.
///
/// KHR_lights_punctual and KHR_materials_emissive_strength speak of candela, lux and nit; their numbers are taken as
/// W/sr, W/m² and W/(m² sr), which keeps all ratios.
pub const UNDERSTOOD_EXTENSIONS: &[&str] = &[
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    #[cfg(feature = "meshopt")]
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    #[cfg(feature = "draco")]
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    #[cfg(feature = "meshopt")]
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// A glTF file in memory with its buffers.
pub(super) struct Document {
    /// Where the file is; URIs are relative to its folder.
    pub(super) path: PathBuf,
    /// The JSON part. Its indices are unchecked: use [`Document::get`].
    pub(super) root: json::Root,
    /// Whether URIs may point outside of the file's folder.
    pub(super) allow_outside: bool,
    /// Whether it came as bytes, without a folder.
    pub(super) is_alone: bool,
    /// Whether it came with the library.
    pub(super) is_embedded: bool,
    /// Content of each buffer, at least as long as the file says.
    buffers: Vec<Vec<u8>>,
    /// URIs of further files that it was read from, images and buffers apart.
    pub(super) beside: Vec<String>,
}

impl Document {
    /// Reads the file and its buffers, and checks version and extensions.
    pub(super) fn open(path: &Path, allow_outside: bool, warnings: &mut Vec<Warning>) -> Result<Self> {
        let own = embedded::embedded(path);
        let bytes = match own {
            Some(own) => Cow::Borrowed(own),
            None => Cow::Owned(
                resources::read_file(path, MAX_FILE_BYTES)
                    .map_err(|why| Error::input(path, embedded::not_embedded(path).unwrap_or(why)))?,
            ),
        };
        let source = Source { scene: path, allow_outside, is_alone: false };
        Self::of_bytes(source, &bytes, own.is_some(), warnings)
    }

    /// Of a file's bytes, with what lies beside it as the source says.
    pub(super) fn of_bytes(
        source: Source,
        bytes: &[u8],
        is_embedded: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let Source { scene: path, allow_outside, is_alone } = source;
        let told = converted::convert(source, bytes, warnings).map_err(|why| Error::input(path, why))?;
        let mut beside = Vec::new();
        let (mut root, mut chunk) = match told {
            Some(told) => {
                beside = told.beside;
                let root = serde_json::from_value(told.file).map_err(|why| Error::input(path, why.to_string()))?;
                (root, Some(Cow::Owned(told.buffer)))
            }
            None => {
                let (text, chunk) = if bytes.starts_with(b"glTF") { split_glb(path, bytes)? } else { (bytes, None) };
                (parse(path, text, warnings)?, chunk.map(Cow::Borrowed))
            }
        };
        check_extensions(path, &root, warnings)?;
        let mut buffers = Vec::with_capacity(root.buffers.len());
        for (i, buffer) in root.buffers.iter().enumerate() {
            let fail = |why: String| Error::input(path, format!("buffer {i}: {why}"));
            let content = match &buffer.uri {
                Some(uri) => resources::read_uri(source, uri, MAX_FILE_BYTES).map_err(fail)?,
                None if packed::is_fallback(buffer) => {
                    buffers.push(Vec::new());
                    continue;
                }
                None if i == 0 => chunk.take().map(Cow::into_owned).ok_or_else(|| {
                    fail("it has no URI, and the file has no binary chunk; export it again with its data".into())
                })?,
                None => return Err(fail("it has no URI, and only buffer 0 may be the binary chunk of a .glb".into())),
            };
            if (content.len() as u64) < buffer.byte_length.0 {
                return Err(fail(format!(
                    "it promises {} bytes and has {}; the file is cut short",
                    buffer.byte_length.0,
                    content.len()
                )));
            }
            buffers.push(content);
        }
        packed::unpack(path, &mut root, &mut buffers)?;
        Ok(Self { path: path.to_path_buf(), root, allow_outside, is_alone, is_embedded, buffers, beside })
    }

    /// An [`Error::Input`] for this file.
    pub(super) fn error(&self, what: impl Into<String>) -> Error {
        Error::input(&self.path, what)
    }

    /// From where its URIs are read.
    pub(super) fn source(&self) -> Source<'_> {
        Source { scene: &self.path, allow_outside: self.allow_outside, is_alone: self.is_alone }
    }

    /// What a node is called in messages.
    pub(super) fn node_name(&self, node: usize) -> String {
        called("node", node, self.root.nodes.get(node).and_then(|n| n.name.as_deref()))
    }

    /// The object with this index; `what` names it in the error if the file has none.
    pub(super) fn get<T>(&self, index: json::Index<T>, what: &str) -> Result<&T>
    where
        json::Root: json::root::Get<T>,
    {
        self.root.get(index).ok_or_else(|| self.error(format!("{what} points to number {index}, which is not there")))
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: json::Index<json::buffer::View>, what: &str) -> Result<&[u8]> {
        let view = self.get(index, what)?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or_else(|| {
            self.error(format!("buffer view {index} points to buffer {}, which is not there", view.buffer))
        })?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let bytes = start
            .checked_add(view.byte_length.0)
            .and_then(|end| buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        bytes.ok_or_else(|| {
            self.error(format!(
                "buffer view {index} (bytes {start} and {} on) lies past the end of buffer {} ({} bytes)",
                view.byte_length.0,
                view.buffer,
                buffer.len()
            ))
        })
    }
}

/// What one of several things in a file is called in messages.
pub(super) fn called(kind: &str, number: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("{kind} {number}"), |name| format!("{kind} {number} '{name}'"))
}

/// Finds what a user chose among `names` (each thing may have several names); `kind` is for the error.
pub(super) fn choose(choice: &Choice, names: &[Vec<&str>], kind: &'static str) -> Result<usize> {
    let found = match choice {
        Choice::Name(name) => names.iter().position(|n| n.contains(&name.as_str())),
        Choice::Index(i) => Some(*i).filter(|&i| i < names.len()),
    };
    found.ok_or_else(|| {
        let asked = match choice {
            Choice::Name(name) => format!("'{name}'"),
            Choice::Index(i) => format!("number {i}"),
        };
        let there: Vec<String> = names
            .iter()
            .enumerate()
            .map(|(i, n)| n.first().map_or_else(|| i.to_string(), |n| format!("{i} '{n}'")))
            .collect();
        let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
        Error::parameter(kind, format!("the file has no {kind} {asked}; it has {there}"))
    })
}

/// Splits a .glb into its JSON text and its binary chunk; chunks of unknown kinds are passed over, as glTF says.
/// The JSON of a file of either kind, as far as it is there.
pub(super) fn json_part(bytes: &[u8]) -> &[u8] {
    if !bytes.starts_with(b"glTF") {
        return bytes;
    }
    let Some(length) = bytes.get(12..16).and_then(|four| four.try_into().ok()).map(u32::from_le_bytes) else {
        return &[];
    };
    bytes.get(20..).and_then(|rest| rest.get(..length as usize)).unwrap_or(&[])
}

fn split_glb<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let word = |at: usize| -> Option<usize> {
        let four = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
    };
    let cut_short = |promised: usize| {
        let has = bytes.len();
        Error::input(path, format!("the .glb promises {promised} bytes and has {has}; it is cut short, get it again"))
    };
    let (version, length) = (word(4).ok_or_else(|| cut_short(12))?, word(8).ok_or_else(|| cut_short(12))?);
    if version != 2 {
        return Err(Error::input(path, format!("this is .glb version {version}; only version 2 (glTF 2.0) is read")));
    }
    if length > bytes.len() {
        return Err(cut_short(length));
    }
    let (mut text, mut binary) = (None, None);
    let mut at = 12;
    while at + 8 <= length {
        let (size, kind) = (word(at).ok_or_else(|| cut_short(at + 8))?, &bytes[at + 4..at + 8]);
        let content = bytes.get(at + 8..at + 8 + size).ok_or_else(|| cut_short(at + 8 + size))?;
        match kind {
            b"JSON" if text.is_none() => text = Some(content),
            b"BIN\0" if binary.is_none() => binary = Some(content),
            _ => {}
        }
        at += 8 + size;
    }
    let text = text.ok_or_else(|| Error::input(path, "the .glb has no JSON chunk; it is not a glTF file"))?;
    Ok((text, binary))
}

fn parse(path: &Path, text: &[u8], warnings: &mut Vec<Warning>) -> Result<json::Root> {
    // Some exporters begin with a byte order mark or fill the chunk with zeros; neither is JSON.
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let end = text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    let mut read = || -> serde_json::Result<json::Root> {
        let mut file: serde_json::Value = serde_json::from_slice(&text[..end])?;
        rewrite(&mut file, warnings);
        serde_json::from_value(file)
    };
    let root: json::Root = read().map_err(|why| {
        #[derive(serde::Deserialize)]
        struct Asset {
            version: String,
        }
        #[derive(serde::Deserialize)]
        struct Old {
            asset: Asset,
        }
        match serde_json::from_slice::<Old>(&text[..end]) {
            Ok(old) if !old.asset.version.starts_with("2.") => wrong_version(path, &old.asset.version),
            _ => Error::input(path, format!("not a glTF 2.0 file, or a damaged one: {why}")),
        }
    })?;
    if !root.asset.version.starts_with("2.") {
        return Err(wrong_version(path, &root.asset.version));
    }
    if let Some(least) = root.asset.min_version.as_deref().filter(|&least| least != "2.0") {
        return Err(wrong_version(path, least));
    }
    Ok(root)
}

fn wrong_version(path: &Path, version: &str) -> Error {
    Error::input(path, format!("this is glTF {version}; only glTF 2.0 is read, export it as that"))
}

fn check_extensions(path: &Path, root: &json::Root, warnings: &mut Vec<Warning>) -> Result<()> {
    let unknown = |name: &&String| !UNDERSTOOD_EXTENSIONS.contains(&name.as_str());
    let required: Vec<&str> = root.extensions_required.iter().filter(unknown).map(String::as_str).collect();
    if !required.is_empty() {
        return Err(Error::input(
            path,
            format!(
                "it requires {}, which is not understood; export it without{}",
                required.join(", "),
                if required.iter().any(|name| name.contains("compression")) { " compression" } else { "" }
            ),
        ));
    }
    for name in root.extensions_used.iter().filter(unknown) {
        warnings.push(Warning(format!("the optional extension {name} is not understood and left out")));
    }
    Ok(())
}
