//! Bytes from where URIs point: files beside the scene, and data URIs.

use super::embedded;
use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Largest file that is read, scene, buffer or image [bytes].
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// Opens a regular file without waiting for a writer, as the opening of a pipe would.
fn open_regular(path: &Path) -> std::io::Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    options.open(path)
}

/// The whole file at `path`, a regular one of at most `limit` bytes; the error is one line without the path of the scene.
pub(super) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let file = open_regular(path).map_err(|why| why.to_string())?;
    let there = file.metadata().map_err(|why| why.to_string())?;
    if !there.is_file() {
        return Err("it is no regular file but a folder, a device or a pipe".to_owned());
    }
    let too_large = || format!("the file is larger than {limit} bytes, the largest that is read");
    if there.len() > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::with_capacity(there.len() as usize);
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|why| why.to_string())?;
    if bytes.len() as u64 > limit { Err(too_large()) } else { Ok(bytes) }
}

/// Where a scene's URIs may point to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source<'a> {
    /// The scene's file.
    pub(super) scene: &'a Path,
    /// Whether files beside and above its folder are read, too.
    pub(super) allow_outside: bool,
    /// Whether it came as bytes, which lie beside nothing.
    pub(super) is_alone: bool,
}

/// What `uri` of a scene points to.
pub(super) fn read_uri(source: Source, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data);
    }
    if source.is_alone {
        return Err(format!(
            "'{uri}' is a file beside it, and these are bytes without a folder; pack all into one .glb"
        ));
    }
    if let Some(own) = embedded::beside(source.scene, uri) {
        return Ok(own.to_vec());
    }
    let path = path_of(source.scene, uri)?;
    if !source.allow_outside {
        is_below(source.scene, &path, uri)?;
    }
    read_file(&path, limit).map_err(|why| format!("{}: {why}", path.display()))
}

/// Refuses a file that does not lie in the scene's folder or below, links followed: a scene of somebody else's could
/// otherwise show what is none of its business.
fn is_below(scene: &Path, path: &Path, uri: &str) -> Result<(), String> {
    let outside =
        || format!("'{uri}' lies outside of the scene's folder; put the file below it, or allow files outside");
    let climbs = path
        .strip_prefix(folder_of(scene))
        .unwrap_or(path)
        .components()
        .any(|part| !matches!(part, std::path::Component::Normal(_) | std::path::Component::CurDir));
    if climbs {
        return Err(outside());
    }
    let folder = match folder_of(scene) {
        empty if empty.as_os_str().is_empty() => Path::new("."),
        folder => folder,
    };
    // What is not there is told by whoever opens it.
    match (folder.canonicalize(), path.canonicalize()) {
        (Ok(folder), Ok(path)) if !path.starts_with(&folder) => Err(outside()),
        _ => Ok(()),
    }
}

fn folder_of(scene: &Path) -> &Path {
    scene.parent().unwrap_or(Path::new(""))
}

/// The file that `uri`, which is no data URI, points to.
pub(super) fn path_of(scene: &Path, uri: &str) -> Result<PathBuf, String> {
    let scheme = uri.split(['/', '?', '#']).next().is_some_and(|first| first.contains(':'));
    if scheme || uri.starts_with(['/', '\\']) {
        return Err(format!("'{uri}' is not a path relative to the scene; put the file beside it and name that"));
    }
    let relative = String::from_utf8(percent_decode_str(uri).collect())
        .map_err(|_| format!("'{uri}' is not UTF-8 after its %-signs are decoded"))?;
    if Path::new(&relative).has_root() || relative.contains(['\0', '\n', '\r']) {
        return Err(format!("'{uri}' is not a path relative to the scene; put the file beside it and name that"));
    }
    Ok(folder_of(scene).join(&relative))
}

/// Content of a data URI (RFC 2397) after its `data:`.
fn decode_data_uri(data: &str) -> Result<Vec<u8>, String> {
    let (kind, content) = data.split_once(',').ok_or("the data URI has no comma; it is cut short")?;
    if kind.split(';').any(|part| part.eq_ignore_ascii_case("base64")) {
        decode_base64(&Cow::from(percent_decode_str(content)))
    } else {
        Ok(percent_decode_str(content).collect())
    }
}

/// Either alphabet is written as the standard one before it is decoded; padding may be missing.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Base64 (RFC 4648), with the standard or the URL alphabet, padded or not; white space is passed over.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let standard = |&symbol: &u8| match symbol {
        b' ' | b'\t' | b'\r' | b'\n' => None,
        b'-' => Some(b'+'),
        b'_' => Some(b'/'),
        other => Some(other),
    };
    let text: Vec<u8> = text.iter().filter_map(standard).collect();
    BASE64.decode(text).map_err(|why| format!("the base64 of the data URI is damaged: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_signs() {
        // The test vectors of RFC 4648, section 10.
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("fooba", "Zm9vYmE=")]
        {
            assert_eq!(decode_base64(coded.as_bytes()).as_deref(), Ok(plain.as_bytes()));
        }
        assert_eq!(decode_base64(b"Zm9v\nYmFy").as_deref(), Ok(&b"foobar"[..]));
        assert_eq!(decode_base64(b"+/-_").as_deref(), Ok(&[0xfb, 0xff, 0xbf][..]));
        assert!(decode_base64(b"Zm*v").is_err());
        assert_eq!(decode_data_uri(",a%20b%2Fc%zz%4").as_deref(), Ok(&b"a b/c%zz%4"[..]));
        assert_eq!(decode_data_uri("text/plain,a%20b").as_deref(), Ok(&b"a b"[..]));
        assert_eq!(decode_data_uri("application/octet-stream;base64,Zm9v").as_deref(), Ok(&b"foo"[..]));
        assert!(decode_data_uri("application/octet-stream;base64").is_err());
    }

    #[test]
    fn only_files_beside_the_scene_are_read() {
        let source = Source { scene: Path::new("scene.gltf"), allow_outside: true, is_alone: false };
        for uri in [
            "http://example.org/a.bin",
            "file:///etc/hostname",
            "/etc/hostname",
            "C:\\a.bin",
            "%2Fetc%2Fhostname",
            "a%00b",
        ] {
            assert!(read_uri(source, uri, 10).is_err_and(|why| why.contains("relative")), "{uri}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn files_outside_pipes_and_devices_are_refused_at_once() {
        let folder = tempfile::tempdir().expect("folder");
        let inner = folder.path().join("model");
        std::fs::create_dir_all(inner.join("maps")).expect("folders");
        std::fs::write(folder.path().join("secret.bin"), "secret").expect("write");
        std::fs::write(inner.join("maps/own.bin"), "own").expect("write");
        std::os::unix::fs::symlink("../secret.bin", inner.join("link.bin")).expect("link");
        let pipe = std::process::Command::new("mkfifo").arg(inner.join("pipe.bin")).status();
        let scene = inner.join("scene.gltf");
        let read = |uri: &str, allow_outside: bool| {
            read_uri(Source { scene: &scene, allow_outside, is_alone: false }, uri, 100)
        };
        assert_eq!(read("maps/own.bin", false).as_deref(), Ok(&b"own"[..]));
        assert_eq!(read("./maps/own.bin", false).as_deref(), Ok(&b"own"[..]));
        for uri in ["../secret.bin", "maps/../../secret.bin", "%2e%2e/secret.bin", "link.bin"] {
            assert!(read(uri, false).is_err_and(|why| why.contains("outside")), "{uri}");
            assert_eq!(read(uri, true).as_deref(), Ok(&b"secret"[..]), "{uri}");
        }
        assert!(read("maps", false).is_err_and(|why| why.contains("regular")));
        if pipe.is_ok_and(|made| made.success()) {
            let start = std::time::Instant::now();
            assert!(read("pipe.bin", false).is_err_and(|why| why.contains("regular")));
            assert!(start.elapsed().as_secs_f64() < 1.0);
        }
        assert!(read_file(Path::new("/dev/zero"), 100).is_err_and(|why| why.contains("regular")));
    }

    #[test]
    fn a_file_over_the_limit_is_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a b.bin");
        std::fs::write(&path, [7; 11]).expect("write");
        let scene = folder.path().join("scene.gltf");
        let source = Source { scene: &scene, allow_outside: false, is_alone: false };
        assert!(read_uri(source, "a%20b.bin", 10).is_err());
        assert_eq!(read_uri(source, "a%20b.bin", 11), Ok(vec![7; 11]));
    }
}
