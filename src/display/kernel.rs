//! What Linux itself knows of the monitors that are plugged in, where the window system does not tell: their EDID.
//!
//! Wayland hides EDIDs from programs, and some X drivers give none. The kernel lists each connector as a folder
//! (`/sys/class/drm/card0-HDMI-A-1`) with its EDID, the modes that it offers, and whether something is plugged in.

use super::edid::Edid;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// Where the kernel lists connectors.
const CONNECTORS: &str = "/sys/class/drm";
/// Longest EDID: base block and 255 extensions [bytes].
const EDID_LIMIT: u64 = 256 * 128;
/// Longest list of modes that is looked at [bytes].
const MODES_LIMIT: u64 = 64 * 1024;

/// The EDID of the monitor on the connector that the window system calls `name`, which shows `size` pixels now.
///
/// None where there is no such connector, more than one (several graphics cards), nothing plugged into it, or where the
/// monitor does not offer that size: then the names mean different connectors.
pub(super) fn edid(name: &str, size: (u32, u32)) -> Option<Edid> {
    edid_in(Path::new(CONNECTORS), name, size)
}

fn edid_in(connectors: &Path, name: &str, (width, height): (u32, u32)) -> Option<Edid> {
    let mut found = None;
    for entry in fs::read_dir(connectors).ok()?.flatten() {
        let folder = entry.file_name();
        let connector =
            folder.to_str().and_then(|name| name.strip_prefix("card")).and_then(|name| name.split_once('-'));
        if !connector.is_some_and(|(card, own)| card.parse::<u32>().is_ok() && is_called(own, name)) {
            continue;
        }
        let path = entry.path();
        if text(&path.join("status"), 64).trim() != "connected" {
            continue;
        }
        if found.is_some() {
            return None;
        }
        found = Some(path);
    }
    let path = found?;
    let mode = format!("{width}x{height}");
    if !text(&path.join("modes"), MODES_LIMIT).lines().any(|line| line.trim() == mode) {
        return None;
    }
    let mut bytes = Vec::new();
    File::open(path.join("edid")).ok()?.take(EDID_LIMIT).read_to_end(&mut bytes).ok()?;
    // Too damaged to read, it identifies nothing.
    Edid::parse(&bytes).ok()
}

/// Whether the kernel's connector `own` is the one that a window system calls `name`: by the same name, or as X's
/// modesetting driver shortens it (`HDMI-A-1` to `HDMI-1`).
///
/// Drivers that count from 0 (`HDMI-A-0`) mean others by the same number; they give EDIDs themselves.
fn is_called(own: &str, name: &str) -> bool {
    own == name || own.strip_prefix("HDMI-A-").zip(name.strip_prefix("HDMI-")).is_some_and(|(own, name)| own == name)
}

/// What a small file says; nothing where it cannot be read.
fn text(path: &Path, limit: u64) -> String {
    let mut text = String::new();
    // What could not be read is not what was looked for.
    let _ = File::open(path).and_then(|file| file.take(limit).read_to_string(&mut text));
    text
}

#[cfg(test)]
mod tests {
    use super::super::edid::tests::pluto;
    use super::*;

    fn connector(root: &Path, name: &str, status: &str, edid: &[u8]) {
        let folder = root.join(name);
        fs::create_dir(&folder).expect("folder");
        fs::write(folder.join("status"), format!("{status}\n")).expect("status");
        fs::write(folder.join("modes"), "1920x1080\n1280x720\n").expect("modes");
        fs::write(folder.join("edid"), edid).expect("EDID");
    }

    #[test]
    fn a_monitor_is_found_by_either_name_and_only_if_it_is_that_one() {
        let root = tempfile::tempdir().expect("folder");
        let root = root.path();
        connector(root, "card0-HDMI-A-1", "connected", &pluto());
        connector(root, "card0-HDMI-A-2", "disconnected", &[]);
        connector(root, "card1-DP-1", "connected", &[]);
        connector(root, "card0-DP-3", "connected", &pluto()[..100]);
        fs::write(root.join("version"), "drm 1.1.0").expect("file");
        fs::create_dir(root.join("card0")).expect("folder");
        let name = |of: &str, size| edid_in(root, of, size).and_then(|edid| edid.name);
        assert_eq!(name("HDMI-A-1", (1920, 1080)).as_deref(), Some("HE PLUTO-2.1"));
        assert_eq!(name("HDMI-1", (1280, 720)).as_deref(), Some("HE PLUTO-2.1"));
        // Another mode, nothing plugged in, no EDID, half an EDID, no such connector.
        assert_eq!(name("HDMI-1", (1920, 1200)), None);
        for other in ["HDMI-A-2", "DP-1", "DP-3", "HDMI-A-0", "HDMI-B-1", "A-1", "1", ""] {
            assert_eq!(name(other, (1920, 1080)), None, "{other}");
        }
        // The same connector on a second graphics card.
        connector(root, "card1-HDMI-A-1", "connected", &pluto());
        assert_eq!(name("HDMI-A-1", (1920, 1080)), None);
        assert_eq!(edid_in(&root.join("nowhere"), "HDMI-A-1", (1920, 1080)), None);
    }
}
