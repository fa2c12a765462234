//! Bytes from where URIs point: files beside the scene, and data URIs.

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

/// The whole file at `path`, at most `limit` bytes; the error is one line without the path of the scene.
pub(super) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let file = File::open(path).map_err(|why| why.to_string())?;
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|why| why.to_string())?;
    if bytes.len() as u64 > limit {
        return Err(format!("the file is larger than {limit} bytes, the largest that is read"));
    }
    Ok(bytes)
}

/// What `uri`, written in the scene file at `scene`, points to.
pub(super) fn read_uri(scene: &Path, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data);
    }
    let path = path_of(scene, uri)?;
    read_file(&path, limit).map_err(|why| format!("{}: {why}", path.display()))
}

/// The file that `uri`, which is no data URI, points to.
pub(super) fn path_of(scene: &Path, uri: &str) -> Result<PathBuf, String> {
    let scheme = uri.split(['/', '?', '#']).next().is_some_and(|first| first.contains(':'));
    if scheme || uri.starts_with(['/', '\\']) {
        return Err(format!("'{uri}' is not a path relative to the scene; put the file beside it and name that"));
    }
    let relative = String::from_utf8(percent_decode_str(uri).collect())
        .map_err(|_| format!("'{uri}' is not UTF-8 after its %-signs are decoded"))?;
    Ok(scene.parent().unwrap_or(Path::new("")).join(&relative))
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
        for uri in ["http://example.org/a.bin", "file:///etc/hostname", "/etc/hostname", "C:\\a.bin"] {
            assert!(read_uri(Path::new("scene.gltf"), uri, 10).is_err_and(|why| why.contains("relative")), "{uri}");
        }
    }

    #[test]
    fn a_file_over_the_limit_is_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a b.bin");
        std::fs::write(&path, [7; 11]).expect("write");
        let scene = folder.path().join("scene.gltf");
        assert!(read_uri(&scene, "a%20b.bin", 10).is_err());
        assert_eq!(read_uri(&scene, "a%20b.bin", 11), Ok(vec![7; 11]));
    }
}
