//! The local protocol by a port, and the file that tells where it is and with which key.

#[cfg(unix)]
use super::local_socket::private_folder;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fs::{self, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The ending of such a file's name.
pub(super) const ENDING: &str = "port";
/// Longest first line of a client [bytes].
pub(super) const KEY_LINE: usize = 256;
/// Random bytes of a key.
const KEY_BYTES: usize = 16;

/// What the file holds.
#[derive(Serialize, Deserialize)]
struct Told {
    address: SocketAddr,
    key: String,
}

/// The first line of a client.
#[derive(Serialize, Deserialize)]
struct Greeting {
    key: String,
}

/// A port that is ours, and the file that tells of it.
pub(super) struct PortFile {
    path: PathBuf,
    key: String,
}

/// Whether the local protocol is to be spoken by a port: by the ending of its file.
pub(super) fn is_port(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(ENDING))
}

/// The folder in which servers of this user have their files, where there are no sockets: a folder of the user's own.
#[cfg(not(unix))]
pub(super) fn runtime_folder() -> PathBuf {
    let own = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|folder| folder.is_absolute());
    own.unwrap_or_else(std::env::temp_dir).join("holodrive")
}

/// Makes the folder of a file, where it is not there: the user's own folders are private by what they inherit.
#[cfg(not(unix))]
fn private_folder(file: &Path) -> Result<PathBuf> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    Ok(folder)
}

impl PortFile {
    /// Listens on a free port of `address`, and writes where, and a new key, into the file.
    ///
    /// # Errors
    /// [`Error::Display`] when another server has the file, it is something else, or others may write in its folder;
    /// [`Error::Io`].
    pub(super) fn take(path: &Path, address: IpAddr) -> Result<(Self, TcpListener)> {
        let folder = private_folder(path)?;
        if fs::symlink_metadata(path).is_ok() {
            let Some(told) = read(path) else {
                return Err(Error::Display { what: format!("{} is a file, not a server's port", path.display()) });
            };
            if told.answers() {
                let path = path.display();
                let what = format!("{path} is another server's; end that one, or give this one another name or file");
                return Err(Error::Display { what });
            }
            // Left behind by a server that was killed.
            fs::remove_file(path).map_err(Error::io(path))?;
        }
        let no = |error: std::io::Error| Error::Display { what: format!("cannot listen on {address}: {error}") };
        let listener = TcpListener::bind(SocketAddr::new(address, 0)).map_err(no)?;
        let mut bytes = [0; KEY_BYTES];
        getrandom::fill(&mut bytes).map_err(|why| Error::unsupported(format!("the system gives no key: {why}")))?;
        let key: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let told = Told { address: listener.local_addr().map_err(no)?, key: key.clone() };
        let text = serde_json::to_string(&told).map_err(|why| Error::unsupported(why.to_string()))? + "\n";
        // Whole or not at all, and never readable by others.
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = folder.join(format!(".{name}.{}", std::process::id()));
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let _ = fs::remove_file(&part);
        let written = options.open(&part).and_then(|mut file| file.write_all(text.as_bytes()));
        written.and_then(|()| fs::rename(&part, path)).map_err(|error| {
            let _ = fs::remove_file(&part);
            Error::io(path)(error)
        })?;
        Ok((Self { path: path.to_path_buf(), key }, listener))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a client's first line holds the key.
    pub(super) fn opens(&self, line: &[u8]) -> bool {
        let Ok(Greeting { key }) = serde_json::from_slice(line) else { return false };
        // As long for a wrong key as for one that is nearly right.
        let differs = key.bytes().zip(self.key.bytes()).fold(0, |differs, (a, b)| differs | (a ^ b));
        key.len() == self.key.len() && differs == 0
    }

    /// Removes the file.
    pub(super) fn remove(&self) {
        // One that is gone already is no loss.
        let _ = fs::remove_file(&self.path);
    }
}

fn read(path: &Path) -> Option<Told> {
    let mut text = String::new();
    let file = fs::File::open(path).ok()?;
    file.take(4096).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

impl Told {
    /// Whether the server is there that wrote it.
    fn answers(&self) -> bool {
        let soon = Duration::from_secs(1);
        let ask = || -> std::io::Result<String> {
            let mut stream = TcpStream::connect_timeout(&super::stream::reachable(self.address), soon)?;
            stream.set_read_timeout(Some(soon))?;
            let greeting = serde_json::to_string(&Greeting { key: self.key.clone() })?;
            writeln!(stream, "{greeting}")?;
            let mut answer = String::new();
            BufReader::new(stream.take(1 << 20)).read_line(&mut answer)?;
            Ok(answer)
        };
        ask().is_ok_and(|answer| answer.contains("\"holodrive\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_told_to_its_user_only_and_a_dead_ones_file_is_taken_over() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("own").join("panel.port");
        let (place, listener) = PortFile::take(&path, std::net::Ipv4Addr::LOCALHOST.into()).expect("port");
        let told = read(&path).expect("told");
        assert_eq!(told.address, listener.local_addr().expect("address"));
        assert!(told.address.ip().is_loopback() && told.key.len() == 2 * KEY_BYTES);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(fs::metadata(&path).expect("file").permissions().mode() & 0o777, 0o600);
        }
        assert!(place.opens(format!("{{\"key\": \"{}\"}}", told.key).as_bytes()));
        for wrong in ["", "{}", "{\"key\": \"\"}", "{\"key\": 1}", &format!("{{\"key\": \"{}0\"}}", told.key)] {
            assert!(!place.opens(wrong.as_bytes()), "{wrong}");
        }
        // As a killed server leaves it.
        drop(listener);
        let (place, _listener) = PortFile::take(&path, std::net::Ipv4Addr::LOCALHOST.into()).expect("taken over");
        assert_ne!(read(&path).expect("told").key, told.key);
        place.remove();
        assert!(!path.exists());
        fs::write(&path, "a file").expect("write");
        assert!(PortFile::take(&path, std::net::Ipv4Addr::LOCALHOST.into()).is_err());
        assert_eq!(fs::read_to_string(&path).expect("file"), "a file", "somebody's file was removed");
    }
}
