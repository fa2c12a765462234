//! Files that appear whole or not at all.
//!
//! ```
//! let path = std::env::temp_dir().join(format!("holodrive-{}.txt", std::process::id()));
//! holodrive::files::write_bytes(&path, b"whole")?;
//! assert_eq!(std::fs::read(&path).map_err(holodrive::Error::io(&path))?, b"whole");
//! # std::fs::remove_file(&path).map_err(holodrive::Error::io(&path))?;
//! # Ok::<(), holodrive::Error>(())
//! ```

pub(crate) mod pictures;

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Numbers partial files, so that two threads that write the same name do not share one.
static PARTIAL: AtomicU64 = AtomicU64::new(0);

/// Writes `path` through `fill`: into a partial file beside it, synced, then renamed over `path`.
///
/// If `fill` or the disk fails, the partial file is removed and what stood at `path` before is untouched.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let partial = partial_name(path);
    with_begun(|begun| begun.push(partial.clone()));
    let written = (|| {
        let file = create(&partial).map_err(Error::io(path))?;
        let mut writer = BufWriter::with_capacity(1 << 20, file);
        fill(&mut writer)?;
        writer.flush().map_err(Error::io(path))?;
        let file = writer.into_inner().map_err(|e| Error::Io { path: path.into(), source: e.into_error() })?;
        file.sync_all().map_err(Error::io(path))?;
        drop(file);
        fs::rename(&partial, path).map_err(Error::io(path))
    })();
    if written.is_err() {
        // The first error is the one to report; a partial file that cannot be removed either changes nothing.
        let _ = fs::remove_file(&partial);
    }
    with_begun(|begun| begun.retain(|other| *other != partial));
    written
}

/// Partial files that are being written.
static BEGUN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn with_begun(change: impl FnOnce(&mut Vec<PathBuf>)) {
    change(&mut BEGUN.lock().unwrap_or_else(PoisonError::into_inner));
}

/// Removes the partial files of this process, for one that ends at once.
pub fn remove_begun() {
    with_begun(|begun| begun.drain(..).for_each(|partial| drop(fs::remove_file(partial))));
}

/// Writes `bytes` as the whole content of `path`.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, |w| w.write_all(bytes).map_err(Error::io(path)))
}

/// Makes the folder `path` if it is not there, and proves that files can be written in it.
pub fn output_folder(path: &Path) -> Result<()> {
    if path.is_file() {
        return Err(Error::input(path, "is a file; what is written here needs a folder"));
    }
    fs::create_dir_all(path).map_err(Error::io(path))?;
    let probe = partial_name(&path.join("probe"));
    create(&probe).map_err(Error::io(path))?;
    fs::remove_file(&probe).map_err(Error::io(path))
}

/// A new file; whatever has its name already, a link too, is removed and not written through.
fn create(partial: &Path) -> std::io::Result<File> {
    match File::create_new(partial) {
        Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
            fs::remove_file(partial)?;
            File::create_new(partial)
        }
        other => other,
    }
}

fn partial_name(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let number = PARTIAL.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".{name}.{}-{number}.partial", std::process::id()))
}

/// Free space [bytes] for files in a folder that may not exist yet; none where the system does not tell.
pub fn free_space(folder: &Path) -> Option<u64> {
    let there = std::path::absolute(folder).ok()?.ancestors().find(|a| a.is_dir())?.to_path_buf();
    free_in(&there)
}

#[cfg(unix)]
fn free_in(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    disk.f_bavail.checked_mul(disk.f_frsize)
}

#[cfg(windows)]
fn free_in(folder: &Path) -> Option<u64> {
    use std::os::windows::ffi::OsStrExt;
    use windows_sys::Win32::Storage::FileSystem::GetDiskFreeSpaceExW;
    let name: Vec<u16> = folder.as_os_str().encode_wide().chain([0]).collect();
    let mut free = 0;
    // SAFETY: the name ends in a zero; the one number asked for is ours.
    let told = unsafe { GetDiskFreeSpaceExW(name.as_ptr(), &mut free, std::ptr::null_mut(), std::ptr::null_mut()) };
    (told != 0).then_some(free)
}

#[cfg(not(any(unix, windows)))]
fn free_in(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(any(unix, windows))]
    fn a_disk_tells_how_much_is_free_on_it() {
        let folder = tempfile::tempdir().expect("folder");
        assert!(free_space(&folder.path().join("not/there/yet")).is_some_and(|bytes| bytes > 0));
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_partial() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.txt");
        write_bytes(&path, b"old").expect("first write");
        let failed = write_whole(&path, |w| {
            w.write_all(b"half").map_err(Error::io(&path))?;
            Err(Error::Interrupted)
        });
        assert!(matches!(failed, Err(Error::Interrupted)));
        assert_eq!(fs::read(&path).expect("read"), b"old");
        assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 1);
    }
}
