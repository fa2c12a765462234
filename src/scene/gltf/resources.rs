//! Bytes from where URIs point: files beside the scene, and data URIs.

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
    let relative = String::from_utf8(percent_decoded(uri).into_owned())
        .map_err(|_| format!("'{uri}' is not UTF-8 after its %-signs are decoded"))?;
    Ok(scene.parent().unwrap_or(Path::new("")).join(&relative))
}

/// Content of a data URI (RFC 2397) after its `data:`.
fn decode_data_uri(data: &str) -> Result<Vec<u8>, String> {
    let (kind, content) = data.split_once(',').ok_or("the data URI has no comma; it is cut short")?;
    if kind.split(';').any(|part| part.eq_ignore_ascii_case("base64")) {
        decode_base64(&percent_decoded(content))
    } else {
        Ok(percent_decoded(content).into_owned())
    }
}

/// `%41` becomes `A`; a percent sign that no two hexadecimal digits follow stands for itself.
fn percent_decoded(text: &str) -> Cow<'_, [u8]> {
    let bytes = text.as_bytes();
    if !bytes.contains(&b'%') {
        return Cow::Borrowed(bytes);
    }
    let digit = |at: usize| bytes.get(at).and_then(|&b| char::from(b).to_digit(16));
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        if let (b'%', Some(high), Some(low)) = (bytes[at], digit(at + 1), digit(at + 2)) {
            decoded.push((high * 16 + low) as u8);
            at += 3;
        } else {
            decoded.push(bytes[at]);
            at += 1;
        }
    }
    Cow::Owned(decoded)
}

/// Base64 (RFC 4648), with the standard or the URL alphabet, padded or not; white space is passed over.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let mut decoded = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut count) = (0u32, 0u32);
    for (at, &symbol) in text.iter().enumerate() {
        let value = match symbol {
            b'A'..=b'Z' => symbol - b'A',
            b'a'..=b'z' => symbol - b'a' + 26,
            b'0'..=b'9' => symbol - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            b'=' => break,
            _ => return Err(format!("byte {at} of the data URI is no base64 symbol; it is damaged")),
        };
        bits = (bits << 6) | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            decoded.push((bits >> count) as u8);
        }
    }
    Ok(decoded)
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
        assert_eq!(&*percent_decoded("a%20b%2Fc%zz%4"), b"a b/c%zz%4");
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
