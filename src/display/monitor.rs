//! Monitors: what they are, how one is named by the user, and what would spoil levels on the way to it.

use super::edid::Edid;
use super::region;
use super::x11::Rectangle;
use crate::error::{Error, Result};
use serde::Serialize;
use std::fmt;
use std::str::FromStr;

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
    /// What happens between frame buffer and cable, where the system tells (X11; of rotation, Wayland).
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
        if !self.parts.is_empty() {
            return self.parts.iter().flat_map(Self::faults).collect();
        }
        let mut faults = Vec::new();
        let name = &self.name;
        if self.scale != 1.0 {
            faults.push(format!("{name} is scaled by {}; set its scale to 1 in the desktop's settings", self.scale));
        }
        let Some(scan_out) = &self.scan_out else { return faults };
        if scan_out.rotated {
            faults.push(format!(
                "{name} is rotated or mirrored; turn that off in the desktop's settings (on X11: xrandr --output {name} --rotate \
                 normal --reflect normal)"
            ));
        }
        if scan_out.transformed {
            faults.push(format!(
                "{name} is scaled by the graphics card; turn that off (xrandr --output {name} --scale 1 --transform none)"
            ));
        }
        if let Gamma::Altered { levels } = scan_out.gamma {
            faults.push(format!(
                "the graphics card's gamma table changes {levels} of 256 levels on {name}; turn night light and colour \
                 profiles off for it (xrandr --output {name} --gamma 1:1:1 --brightness 1)"
            ));
        }
        if !scan_out.shared_with.is_empty() {
            faults.push(format!(
                "{name} shows the same part of the desktop as {}; place it beside (xrandr --output {name} --right-of …)",
                scan_out.shared_with.join(", ")
            ));
        }
        faults
    }

    /// Whether it stands at the same place with the same size: a window made for `other` still fits.
    pub fn same_place(&self, other: &Self) -> bool {
        (self.x, self.y, self.width, self.height) == (other.x, other.y, other.width, other.height)
    }

    /// The monitor that `self` was, among those that are there now: same connector, same EDID, though perhaps at another
    /// place. A region is again there when all monitors that showed it show it.
    pub(super) fn again(&self, monitors: &[Self]) -> Option<Self> {
        if self.parts.is_empty() {
            return monitors.iter().find(|now| now.name == self.name && now.edid == self.edid).cloned();
        }
        let now = region::joined(Rectangle::of(self), monitors).ok()?;
        (now.parts.len() == self.parts.len() && self.parts.iter().all(|part| part.again(&now.parts).is_some()))
            .then_some(now)
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

/// How the user names a monitor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MonitorChoice {
    /// By connector: `HDMI-1`.
    Connector(String),
    /// By the name in its EDID: `edid:HE PLUTO-2.1`. Survives another socket and another order.
    EdidName(String),
    /// By the serial number in its EDID, in text or as a number: `serial:6010-0042`. Tells two equal panels apart.
    Serial(String),
    /// By place in the list, from 0: `index:1`.
    Index(usize),
    /// By its top left corner on the desktop [px]: `at:1920,0`.
    Position(i32, i32),
    /// No monitor, but a rectangle of the desktop [px], on one monitor or over several: `region:1920,0,3840,1080`.
    Region {
        /// Left edge.
        x: i32,
        /// Top edge.
        y: i32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The rectangle that several monitors make together, by connector: `DP-1+DP-2`.
    Joined(Vec<String>),
}

impl FromStr for MonitorChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        let wrong = |expected: &str| Error::parameter("monitor", format!("\"{text}\" is not {expected}"));
        match text.split_once(':') {
            Some(("edid", name)) if !name.trim().is_empty() => Ok(Self::EdidName(name.trim().to_owned())),
            Some(("serial", serial)) if !serial.trim().is_empty() => Ok(Self::Serial(serial.trim().to_owned())),
            Some(("index", number)) => {
                number.trim().parse().map(Self::Index).map_err(|_| wrong("a place in the list, such as index:1"))
            }
            Some(("at", place)) => place
                .split_once(',')
                .and_then(|(x, y)| Some(Self::Position(x.trim().parse().ok()?, y.trim().parse().ok()?)))
                .ok_or_else(|| wrong("a place on the desktop, such as at:1920,0")),
            Some(("region", place)) => {
                let expected = "a rectangle of the desktop, such as region:1920,0,3840,1080";
                let numbers: Vec<i32> = place.split(',').map_while(|word| word.trim().parse().ok()).collect();
                let sides = |w: i32, h: i32| Some((u32::try_from(w).ok()?, u32::try_from(h).ok()?));
                match (numbers.as_slice(), place.split(',').count()) {
                    (&[x, y, w, h], 4) => match sides(w, h) {
                        Some((width, height)) if width > 0 && height > 0 => Ok(Self::Region { x, y, width, height }),
                        _ => Err(wrong(expected)),
                    },
                    _ => Err(wrong(expected)),
                }
            }
            None if text.contains('+') && text.split('+').all(|name| !name.trim().is_empty()) => {
                Ok(Self::Joined(text.split('+').map(|name| name.trim().to_owned()).collect()))
            }
            _ if text.is_empty() || matches!(text, "edid:" | "serial:") => {
                Err(wrong("a monitor: give its connector, edid:NAME, serial:NUMBER, index:N or at:X,Y"))
            }
            _ => Ok(Self::Connector(text.to_owned())),
        }
    }
}

impl fmt::Display for MonitorChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Connector(name) => write!(f, "{name}"),
            Self::EdidName(name) => write!(f, "edid:{name}"),
            Self::Serial(serial) => write!(f, "serial:{serial}"),
            Self::Index(index) => write!(f, "index:{index}"),
            Self::Position(x, y) => write!(f, "at:{x},{y}"),
            Self::Region { x, y, width, height } => write!(f, "region:{x},{y},{width},{height}"),
            Self::Joined(names) => write!(f, "{}", names.join("+")),
        }
    }
}

impl MonitorChoice {
    /// The one monitor that is meant; a region as if it were one ([`Monitor::parts`]).
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when no monitor or more than one answers, or a part of the region is on none; it lists those there
    /// are.
    pub fn find(&self, monitors: &[Monitor]) -> Result<Monitor> {
        match self {
            Self::Region { x, y, width, height } => {
                let region = Rectangle { x: *x, y: *y, width: *width, height: *height };
                return region::joined(region, monitors);
            }
            Self::Joined(names) => {
                let parts: Vec<Monitor> =
                    names.iter().map(|name| Self::Connector(name.clone()).find(monitors)).collect::<Result<_>>()?;
                let region = region::about(&parts.iter().collect::<Vec<_>>());
                let region = region.ok_or_else(|| Error::Display { what: format!("{self} is too large") })?;
                return region::joined(region, monitors);
            }
            _ => {}
        }
        let mut meant = monitors.iter().filter(|monitor| self.means(monitor));
        let list = || {
            let names: Vec<String> = monitors.iter().map(ToString::to_string).collect();
            if names.is_empty() { "none".to_owned() } else { names.join("; ") }
        };
        match (meant.next(), meant.next()) {
            (Some(monitor), None) => Ok(monitor.clone()),
            (None, _) => Err(Error::Display { what: format!("no monitor \"{self}\"; there are: {}", list()) }),
            (Some(_), Some(_)) => Err(Error::Display {
                what: format!(
                    "more than one monitor answers to \"{self}\"; name it by serial: or connector; there are: {}",
                    list()
                ),
            }),
        }
    }

    fn means(&self, monitor: &Monitor) -> bool {
        let edid = monitor.edid.as_ref();
        match self {
            Self::Connector(name) => *name == monitor.name,
            Self::EdidName(name) => {
                edid.and_then(|edid| edid.name.as_ref()).is_some_and(|own| own.eq_ignore_ascii_case(name))
            }
            Self::Serial(serial) => edid.is_some_and(|edid| {
                edid.serial.as_ref().is_some_and(|own| own.eq_ignore_ascii_case(serial))
                    || (edid.number != 0 && serial.parse() == Ok(edid.number))
            }),
            Self::Index(index) => *index == monitor.index,
            Self::Position(x, y) => (*x, *y) == (monitor.x, monitor.y),
            // Not one monitor.
            Self::Region { .. } | Self::Joined(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
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

    fn desk() -> Vec<Monitor> {
        vec![
            monitor(0, "DP-1", 0, None),
            monitor(1, "HDMI-1", 1920, Some(("HE PLUTO-2.1", "A17", 17))),
            monitor(2, "HDMI-2", 3840, Some(("HE PLUTO-2.1", "A18", 18))),
            monitor(3, "HDMI-3", 5760, Some(("LCOS-SLM", "8001", 0))),
        ]
    }

    fn found(text: &str) -> Result<usize> {
        text.parse::<MonitorChoice>()?.find(&desk()).map(|monitor| monitor.index)
    }

    #[test]
    fn each_way_of_naming_finds_its_monitor() {
        for (text, index) in [
            ("DP-1", 0),
            ("HDMI-2", 2),
            ("edid:lcos-slm", 3),
            ("serial:A18", 2),
            ("serial:17", 1),
            ("serial:8001", 3),
            ("index:1", 1),
            ("at:5760,0", 3),
            ("region:1920,0,3840,1080", 1),
            ("HDMI-2+HDMI-3", 2),
        ] {
            assert_eq!(found(text).expect(text), index, "{text}");
        }
    }

    #[test]
    fn an_unknown_or_doubtful_name_lists_the_monitors() {
        for text in ["HDMI-9", "edid:HE PLUTO-2.1", "edid:HE", "serial:0", "index:4", "at:1,0"] {
            let message = found(text).expect_err(text).to_string();
            assert!(message.contains("HDMI-2 (1920x1080 at 3840,0, HE PLUTO-2.1, serial A18)"), "{message}");
            assert!(!message.contains('\n'));
        }
    }

    #[test]
    fn malformed_choices_are_refused() {
        for text in [
            "",
            "edid:",
            "serial: ",
            "index:-1",
            "index:x",
            "at:1920",
            "at:a,b",
            "region:",
            "region:1,2,3",
            "region:1,2,3,0",
            "region:1,2,-3,4",
            "region:1,2,3,4,5",
            "region:0,0,a,4",
        ] {
            let refused = text.parse::<MonitorChoice>();
            assert!(matches!(refused, Err(Error::Parameter { .. })), "{text}: {refused:?}");
        }
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
            shared_with: vec!["DP-1".into()],
            preferred: None,
        });
        let faults = spoilt.faults();
        assert_eq!(faults.len(), 5);
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
