//! Monitors: what they are, and what would spoil levels on the way to them.

use super::edid::Edid;
use super::rectangle::Rectangle;
use serde::Serialize;
use std::fmt;

/// One monitor of the desktop, as the window system has it now.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Monitor {
    /// Place in the list. Changes when monitors come and go: not a way to find a panel again.
    pub index: usize,
    /// Name of the connector, e.g. `HDMI-1`.
    pub name: String,
    /// Columns [px].
    pub width: u32,
    /// Rows [px].
    pub height: u32,
    /// Left edge on the desktop [px].
    pub x: i32,
    /// Top edge on the desktop [px].
    pub y: i32,
    /// Frames per second [Hz], where the system says so.
    pub refresh: Option<f64>,
    /// How many monitor pixels the window system makes of one pixel of a window; 1 on X11, where they are the same.
    pub scale: f64,
    /// Whether it is the operator's main monitor.
    pub primary: bool,
    /// What the monitor says about itself, where it can be had.
    pub edid: Option<Edid>,
    /// What happens between frame buffer and cable, where the system tells (X11, Windows; of rotation, Wayland).
    pub scan_out: Option<ScanOut>,
    /// The monitors that show it, where it is a region of the desktop and not one of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Monitor>,
}

/// What the graphics card does to pixels on their way from the frame buffer to the cable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScanOut {
    /// Whether the picture is turned or mirrored.
    pub rotated: bool,
    /// Whether a transform other than the identity scales or shears the picture.
    pub transformed: bool,
    /// The look-up table behind the frame buffer.
    pub gamma: Gamma,
    /// Whether levels are mapped into an HDR signal, where the system says so (Windows).
    pub high_dynamic_range: Option<bool>,
    /// Other monitors that show the same part of the desktop, whole or in part.
    pub shared_with: Vec<String>,
    /// The mode that the monitor prefers (columns, rows) [px]: the one with one pixel for one.
    pub preferred: Option<(u32, u32)>,
}

/// The look-up table that the graphics card applies to each colour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gamma {
    /// All 256 levels leave as they are.
    Identity,
    /// `levels` of the 256 leave as another one, in at least one colour.
    Altered {
        /// How many levels are changed.
        levels: usize,
    },
    /// The driver has no table to read.
    Unknown,
}

impl Gamma {
    /// Judges a hardware table: three columns of 16-bit values of the same length.
    ///
    /// Level i is looked up at i/255 of the table's length. It leaves unchanged if the value's nearest 8-bit level
    /// (value/257) or its top byte (value/256) is i: drivers fill the identity either way.
    pub fn of_table(red: &[u16], green: &[u16], blue: &[u16]) -> Self {
        let length = red.len().min(green.len()).min(blue.len());
        if length < 2 {
            return Self::Unknown;
        }
        let kept = |table: &[u16], level: usize| {
            let value = usize::from(table[(level * (length - 1) + 127) / 255]);
            (value + 128) / 257 == level || value >> 8 == level
        };
        let changed = |level: &usize| ![red, green, blue].iter().all(|table| kept(table, *level));
        match (0..256).filter(changed).count() {
            0 => Self::Identity,
            levels => Self::Altered { levels },
        }
    }
}

impl Monitor {
    /// Everything known that would keep levels from reaching this monitor unchanged, each with its remedy.
    pub fn faults(&self) -> Vec<String> {
        self.faults_by_subject().into_iter().map(|(_, fault)| fault).collect()
    }

    /// The faults, each under its subject: `scaling`, `rotation`, `gamma`, `hdr` or `mirroring`.
    pub(super) fn faults_by_subject(&self) -> Vec<(&'static str, String)> {
        if !self.parts.is_empty() {
            return self.parts.iter().flat_map(Self::faults_by_subject).collect();
        }
        let mut faults = Vec::new();
        let mut add = |subject, fault| faults.push((subject, fault));
        let name = &self.name;
        if self.scale != 1.0 {
            add("scaling", format!("{name} is scaled by {}; set its scale to 1 in the desktop's settings", self.scale));
        }
        let Some(scan_out) = &self.scan_out else { return faults };
        if scan_out.rotated {
            let how = by(
                &format!("xrandr --output {name} --rotate normal --reflect normal"),
                "Display orientation: Landscape",
            );
            add("rotation", format!("{name} is rotated or mirrored; turn that off in the desktop's settings ({how})"));
        }
        if scan_out.transformed {
            let how = by(
                &format!("xrandr --output {name} --scale 1 --transform none"),
                "Display resolution: the recommended one",
            );
            add("scaling", format!("{name} is scaled by the graphics card; turn that off ({how})"));
        }
        if let Gamma::Altered { levels } = scan_out.gamma {
            let how = by(
                &format!("xrandr --output {name} --gamma 1:1:1 --brightness 1"),
                "Night light: off; Colour profile: none",
            );
            let what = format!("the graphics card's gamma table changes {levels} of 256 levels on {name}");
            add("gamma", format!("{what}; turn night light and colour profiles off for it ({how})"));
        }
        if scan_out.high_dynamic_range == Some(true) {
            let how = by("in the desktop's settings", "Use HDR: off");
            add("hdr", format!("{name} is sent HDR, into which levels are mapped by a curve; turn that off ({how})"));
        }
        if !scan_out.shared_with.is_empty() {
            let others = scan_out.shared_with.join(", ");
            let how = by(&format!("xrandr --output {name} --right-of …"), "Multiple displays: Extend these displays");
            add("mirroring", format!("{name} shows the same part of the desktop as {others}; place it beside ({how})"));
        }
        faults
    }

    /// The part of the desktop that it shows.
    pub(super) fn rectangle(&self) -> Rectangle {
        Rectangle { x: self.x, y: self.y, width: self.width, height: self.height }
    }
}

impl fmt::Display for Monitor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}x{} at {},{}", self.name, self.width, self.height, self.x, self.y)?;
        if let Some(edid) = &self.edid {
            if let Some(name) = &edid.name {
                write!(f, ", {name}")?;
            }
            if let Some(serial) = &edid.serial {
                write!(f, ", serial {serial}")?;
            }
        }
        if self.primary { write!(f, ", primary)") } else { write!(f, ")") }
    }
}

/// How something is set: by X's own program, or where Windows has it.
pub(super) fn by(x11: &str, windows: &str) -> String {
    if cfg!(windows) { format!("Settings, System, Display, {windows}") } else { x11.to_owned() }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn monitor(index: usize, name: &str, x: i32, edid: Option<(&str, &str, u32)>) -> Monitor {
        let edid = edid.map(|(name, serial, number)| Edid {
            manufacturer: "HOE".into(),
            product: 1,
            number,
            name: Some(name.into()),
            serial: Some(serial.into()),
            year: 2021,
            native: None,
            bits_per_colour: None,
            hdmi: false,
            checksum_valid: true,
        });
        let scan_out = Some(ScanOut {
            rotated: false,
            transformed: false,
            gamma: Gamma::Identity,
            high_dynamic_range: None,
            shared_with: Vec::new(),
            preferred: None,
        });
        Monitor {
            index,
            name: name.into(),
            width: 1920,
            height: 1080,
            x,
            y: 0,
            refresh: Some(60.0),
            scale: 1.0,
            primary: index == 0,
            edid,
            scan_out,
            parts: Vec::new(),
        }
    }

    /// Three panels beside the operator's monitor.
    pub(in crate::display) fn desk() -> Vec<Monitor> {
        vec![
            monitor(0, "DP-1", 0, None),
            monitor(1, "HDMI-1", 1920, Some(("HE PLUTO-2.1", "A17", 17))),
            monitor(2, "HDMI-2", 3840, Some(("HE PLUTO-2.1", "A18", 18))),
            monitor(3, "HDMI-3", 5760, Some(("LCOS-SLM", "8001", 0))),
        ]
    }

    #[test]
    fn a_clean_monitor_has_no_faults_and_each_fault_is_told() {
        assert!(desk()[1].faults().is_empty());
        let mut spoilt = desk().remove(1);
        spoilt.scale = 1.25;
        spoilt.scan_out = Some(ScanOut {
            rotated: true,
            transformed: true,
            gamma: Gamma::Altered { levels: 7 },
            high_dynamic_range: Some(true),
            shared_with: vec!["DP-1".into()],
            preferred: None,
        });
        let faults = spoilt.faults();
        assert_eq!(faults.len(), 6);
        assert!(faults.iter().all(|fault| fault.contains("HDMI-1")));
    }

    #[test]
    fn identity_gamma_tables_of_all_lengths_pass_and_others_do_not() {
        for length in [256usize, 1024, 2048, 4096] {
            let full: Vec<u16> = (0..length).map(|i| (i * 65_535 / (length - 1)) as u16).collect();
            assert_eq!(Gamma::of_table(&full, &full, &full), Gamma::Identity, "{length}");
            let power: Vec<u16> =
                full.iter().map(|&v| ((f64::from(v) / 65_535.0).powf(0.9) * 65_535.0) as u16).collect();
            assert!(matches!(Gamma::of_table(&full, &power, &full), Gamma::Altered { .. }));
        }
        let shifted: Vec<u16> = (0..256).map(|i| i << 8).collect();
        assert_eq!(Gamma::of_table(&shifted, &shifted, &shifted), Gamma::Identity);
        let mut one: Vec<u16> = shifted.clone();
        one[100] = 101 << 8;
        assert_eq!(Gamma::of_table(&one, &shifted, &shifted), Gamma::Altered { levels: 1 });
        assert_eq!(Gamma::of_table(&[], &[], &[]), Gamma::Unknown);
    }
}
