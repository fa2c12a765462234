//! How the user names a monitor.

use super::monitor::Monitor;
use super::rectangle::Rectangle;
use super::region;
use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

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
    use super::super::monitor::tests::desk;
    use super::*;

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
}
