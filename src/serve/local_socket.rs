//! The local protocol's socket, and the memory that a client shares with the server.

use super::ServedPanel;
use super::local::{Source, WIDEST};
use crate::error::{Error, Result};
use rustix::process::geteuid;
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Numbers buffers, so that two connections do not share one.
static BUFFERS: AtomicU64 = AtomicU64::new(0);

/// The folder in which servers of this user have their sockets: `$XDG_RUNTIME_DIR/holodrive`, or a folder of the user's
/// own among the temporary files.
pub(super) fn runtime_folder() -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| Path::new(folder).is_absolute()) {
        Some(folder) => Path::new(&folder).join("holodrive"),
        None => PathBuf::from(format!("/tmp/holodrive-{}", geteuid().as_raw())),
    }
}

/// The folder of a file that other users are not to reach; made where it is not there.
///
/// # Errors
/// [`Error::Display`] where somebody else may write in it; [`Error::Io`].
pub(super) fn private_folder(file: &Path) -> Result<PathBuf> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !folder.exists() {
        DirBuilder::new().mode(0o700).create(&folder).map_err(Error::io(&folder))?;
    }
    // In a folder that others may write in, they could put a socket of theirs in the place of ours.
    let private = folder == runtime_folder();
    let about = if private { fs::symlink_metadata(&folder) } else { fs::metadata(&folder) };
    let about = about.map_err(Error::io(&folder))?;
    let own = about.uid() == geteuid().as_raw() || (!private && about.uid() == 0);
    if !about.is_dir() || !own || about.mode() & 0o022 != 0 {
        let hint = if private { "remove it" } else { "take one that is yours" };
        let what = format!("{} is not a folder that only you can write in; {hint}", folder.display());
        return Err(Error::Display { what });
    }
    Ok(folder)
}

/// A socket that is ours, and the folder that it is in.
pub(super) struct LocalSocket {
    socket: PathBuf,
    folder: PathBuf,
}

impl LocalSocket {
    /// Makes the folder, where it is not there, and the socket in it.
    ///
    /// # Errors
    /// [`Error::Display`] when another server has the socket, or the folder belongs to somebody else; [`Error::Io`].
    pub(super) fn take(socket: &Path) -> Result<(Self, UnixListener)> {
        let folder = private_folder(socket)?;
        if fs::symlink_metadata(socket).is_ok() {
            if UnixStream::connect(socket).is_ok() {
                let socket = socket.display();
                let what =
                    format!("{socket} is another server's; end that one, or give this one another name or socket");
                return Err(Error::Display { what });
            }
            // Left behind by a server that was killed. Anything but a socket is somebody's file.
            use std::os::unix::fs::FileTypeExt;
            if !fs::symlink_metadata(socket).is_ok_and(|about| about.file_type().is_socket()) {
                return Err(Error::Display { what: format!("{} is a file, not a socket", socket.display()) });
            }
            fs::remove_file(socket).map_err(Error::io(socket))?;
        }
        let listener = UnixListener::bind(socket).map_err(Error::io(socket))?;
        fs::set_permissions(socket, fs::Permissions::from_mode(0o600)).map_err(Error::io(socket))?;
        Ok((Self { socket: socket.to_path_buf(), folder }, listener))
    }

    pub(super) fn socket(&self) -> &Path {
        &self.socket
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Removes the socket.
    pub(super) fn remove(&self) {
        // One that is gone already is no loss.
        let _ = fs::remove_file(&self.socket);
    }
}

/// The memory that one client shares with the server.
pub(super) struct Buffer {
    file: File,
    path: PathBuf,
    bytes: usize,
}

impl Buffer {
    /// A new one in `folder`, for one frame of `panel`; it takes no memory until it is written.
    pub(super) fn new(folder: &Path, panel: &ServedPanel) -> io::Result<Self> {
        let number = BUFFERS.fetch_add(1, Ordering::Relaxed);
        // Clients in another folder must find it, too.
        let folder = fs::canonicalize(folder)?;
        let path = folder.join(format!(".frame-{}-{number}", std::process::id()));
        let file = OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(&path)?;
        let bytes = WIDEST * panel.pixels();
        let buffer = Self { file, path, bytes };
        buffer.file.set_len(bytes as u64)?;
        Ok(buffer)
    }

    /// Where it is, and its length [bytes].
    pub(super) fn place(&self) -> (&Path, usize) {
        (&self.path, self.bytes)
    }

    /// Removes its name: nothing is left behind, however server and client end.
    pub(super) fn unlink(&self) {
        let _ = fs::remove_file(&self.path);
    }
}

impl Source for &Buffer {
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        let read = self.file.read_exact_at(bytes, 0);
        read.map_err(|error| format!("The shared file cannot be read: {error}."))
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.unlink();
    }
}

#[cfg(test)]
mod tests {
    use super::super::SentFrame;
    use super::super::local::{check, take};
    use super::super::local_request::{ArrayType, Dtype, Quantity};
    use super::*;
    use crate::panel::Modulation;
    use std::f64::consts::TAU;

    fn panel(modulation: Modulation) -> ServedPanel {
        ServedPanel {
            name: "panel".into(),
            width: 5,
            height: 3,
            bits: 10,
            modulation,
            pixel_pitch: [8e-6, 8e-6],
            wavelength: 532e-9,
            design_wavelength: 633e-9,
            settle_time: 0.05,
            curve: vec![0.0, 0.5],
        }
    }

    fn array(quantity: Quantity, dtype: Dtype) -> ArrayType {
        ArrayType { quantity, dtype }
    }

    #[test]
    fn each_type_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("folder");
        let panel = panel(Modulation::Phase);
        let buffer = Buffer::new(folder.path(), &panel).expect("buffer");
        let levels: Vec<u16> = (0..15).map(|i| i * 73).collect();
        buffer.file.write_all_at(bytemuck::cast_slice(&levels), 0).expect("write");
        assert_eq!(take(array(Quantity::Levels, Dtype::Uint16), &panel, &mut &buffer), Ok(SentFrame::Levels(levels)));
        let phases: Vec<f64> = (0..15).map(|i| 0.1 + f64::from(i) + 1e6 * TAU * f64::from(i - 7)).collect();
        buffer.file.write_all_at(bytemuck::cast_slice(&phases), 0).expect("write");
        let Ok(SentFrame::Values(read)) = take(array(Quantity::Phase, Dtype::Float64), &panel, &mut &buffer) else {
            panic!("not read");
        };
        for (i, value) in read.iter().enumerate() {
            let wanted = (0.1 + i as f64).rem_euclid(TAU);
            // Seven million turns cost 8 digits of 16.
            assert!((f64::from(*value) - wanted).abs() < 1e-6, "{i}: {value} {wanted}");
        }
        let narrow: Vec<f32> = phases.iter().map(|v| *v as f32).collect();
        buffer.file.write_all_at(bytemuck::cast_slice(&narrow), 0).expect("write");
        assert_eq!(take(array(Quantity::Phase, Dtype::Float32), &panel, &mut &buffer), Ok(SentFrame::Values(narrow)));
        let bytes: Vec<u8> = (200..215).collect();
        buffer.file.write_all_at(&bytes, 0).expect("write");
        let wanted = bytes.into_iter().map(u16::from).collect();
        assert_eq!(take(array(Quantity::Levels, Dtype::Uint8), &panel, &mut &buffer), Ok(SentFrame::Levels(wanted)));
    }

    #[test]
    fn a_file_cut_short_or_levels_too_high_are_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let phase = panel(Modulation::Phase);
        let buffer = Buffer::new(folder.path(), &phase).expect("buffer");
        buffer.file.write_all_at(&[0xFF; 30], 0).expect("write");
        let why = take(array(Quantity::Levels, Dtype::Uint16), &phase, &mut &buffer).expect_err("levels of 16 bits");
        assert!(why.contains("1023"), "{why}");
        let why = check(array(Quantity::Amplitude, Dtype::Float32), &phase).expect_err("a phase panel");
        assert!(why.contains("modulates phase"), "{why}");
        let why = check(array(Quantity::Phase, Dtype::Float32), &panel(Modulation::Amplitude));
        assert!(why.expect_err("an amplitude panel").contains("modulates amplitude"));
        buffer.file.set_len(59).expect("cut");
        let why = take(array(Quantity::Phase, Dtype::Float32), &phase, &mut &buffer).expect_err("15 values of 4 bytes");
        assert!(why.contains("shared file"), "{why}");
        drop(buffer);
        assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 0);
    }

    #[test]
    fn a_socket_is_taken_once_and_a_dead_ones_is_taken_over() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("own").join("panel.sock");
        let (place, listener) = LocalSocket::take(&path).expect("socket");
        let about = fs::metadata(&path).expect("socket");
        assert_eq!(about.mode() & 0o777, 0o600);
        assert_eq!(fs::metadata(place.folder()).expect("folder").mode() & 0o777, 0o700);
        let why = LocalSocket::take(&path).err().expect("taken").to_string();
        assert!(why.contains("another server"), "{why}");
        // As a killed server leaves it.
        drop(listener);
        let (place, _listener) = LocalSocket::take(&path).expect("taken over");
        place.remove();
        assert!(!path.exists());
        fs::write(&path, "a file").expect("write");
        assert!(LocalSocket::take(&path).is_err());
        assert!(path.exists(), "somebody's file was removed");
    }
}
