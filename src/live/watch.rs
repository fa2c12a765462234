//! Whether files have changed.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Length and time of the last change of files; a file that is not there has neither.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    files: Vec<(PathBuf, Option<Stamp>)>,
    /// A change that was seen, and not yet a second time: editors write a file in several steps.
    unsettled: bool,
}

type Stamp = (u64, SystemTime);

impl Watch {
    /// Watches these files from how they are now.
    pub fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let files = files.into_iter().map(|path| (stamp(&path), path)).map(|(stamp, path)| (path, stamp)).collect();
        Self { files, unsettled: false }
    }

    /// Whether a file has changed and was the same at two looks since. Call it some five times a second.
    pub fn changed(&mut self) -> bool {
        let mut moving = false;
        for (path, seen) in &mut self.files {
            let now = stamp(path);
            if now != *seen {
                (*seen, moving) = (now, true);
            }
        }
        let settled = self.unsettled && !moving;
        self.unsettled = moving || (self.unsettled && !settled);
        settled
    }
}

fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_once_when_it_is_over() {
        let folder = tempfile::tempdir().expect("folder");
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        std::fs::write(&a, "1").expect("write");
        let mut watch = Watch::new([a.clone(), b.clone()]);
        assert!(!watch.changed());
        std::fs::write(&a, "12").expect("write");
        assert!(!watch.changed(), "it may go on");
        std::fs::write(&a, "123").expect("write");
        assert!(!watch.changed(), "it goes on");
        assert!(watch.changed() && !watch.changed());
        // A file that comes, and one that goes.
        std::fs::write(&b, "").expect("write");
        std::fs::remove_file(&a).expect("remove");
        assert!(!watch.changed() && watch.changed() && !watch.changed());
    }
}
