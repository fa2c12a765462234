//! What would spoil levels between a frame and the panel: everything that can be found out, with its remedy.

use super::choice::MonitorChoice;
use super::monitor::{Gamma, Monitor, by};
use super::session::Display;
#[cfg(windows)]
use super::win32::night_light;
use super::x11::{Property, Screen};
use crate::error::Result;
use serde::Serialize;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// As it should be.
    Good,
    /// Cannot be found out from here; to be made sure of by eye.
    Unknown,
    /// May alter or delay frames.
    Warning,
    /// Levels do not reach the panel unchanged.
    Fault,
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The monitor; none for the whole desktop.
    pub monitor: Option<String>,
    /// What was looked at: `gamma`, `hdr`, `rotation`, `scaling`, `mirroring`, `mode`, `range`, `dithering`,
    /// `colour matrix`, `depth`, `compositor`, `night light`, `window system`.
    pub subject: &'static str,
    /// How it stands.
    pub severity: Severity,
    /// What was found, and what to do about it where something can be done.
    pub what: String,
}

/// Looks at everything that is known to spoil levels: on one monitor, or on all.
///
/// # Errors
///
/// [`crate::Error::Display`] when the monitor is not there or the window system does not answer.
pub fn examine(display: &mut Display, choice: Option<&MonitorChoice>) -> Result<Vec<Finding>> {
    let monitors = display.monitors()?;
    let chosen: Vec<Monitor> = match choice {
        // Of a region, the monitors that show it.
        Some(choice) => match choice.find(&monitors)? {
            Monitor { parts, .. } if !parts.is_empty() => parts,
            monitor => vec![monitor],
        },
        None => monitors,
    };
    let x11 = display.x11();
    let screen = x11.as_ref().map(|x11| x11.screen()).transpose()?;
    let mut findings = match cfg!(windows) {
        true => judge_windows(night_light()),
        false => judge_screen(screen.as_ref()),
    };
    for monitor in chosen {
        let properties = match &x11 {
            Some(x11) => x11.properties(&monitor.name)?,
            None => Vec::new(),
        };
        findings.extend(judge_monitor(&monitor, &properties));
    }
    Ok(findings)
}

fn judge_screen(screen: Option<&Screen>) -> Vec<Finding> {
    let finding = |subject, severity, what: String| Finding { monitor: None, subject, severity, what };
    let Some(screen) = screen else {
        let what = "not X11: gamma and colour settings of the graphics card cannot be read; check the panel with the test \
                    card";
        return vec![finding("window system", Severity::Unknown, what.into())];
    };
    let depth = match screen.depth {
        24 => finding("depth", Severity::Good, "8 bits of each colour".into()),
        other => finding(
            "depth",
            Severity::Fault,
            format!(
                "the screen has {other} bits of colour instead of 24; set DefaultDepth 24 in the X server's configuration"
            ),
        ),
    };
    let compositor = if screen.composited {
        finding(
            "compositor",
            Severity::Warning,
            "a compositing manager is at work: it may delay frames, and colour or dimming effects of its own change levels; \
             turn it off, or exclude the panel's monitor"
                .into(),
        )
    } else {
        finding("compositor", Severity::Good, "none at work".into())
    };
    vec![finding("window system", Severity::Good, "X11".into()), depth, compositor]
}

#[cfg(not(windows))]
fn night_light() -> Option<bool> {
    None
}

/// Windows, and what it does to all monitors at once.
fn judge_windows(night_light: Option<bool>) -> Vec<Finding> {
    let finding = |subject, severity, what: &str| Finding { monitor: None, subject, severity, what: what.into() };
    let night_light = match night_light {
        Some(false) => finding("night light", Severity::Good, "off"),
        Some(true) => finding(
            "night light",
            Severity::Warning,
            "on: it changes levels (Settings, System, Display, Night light: off)",
        ),
        None => finding("night light", Severity::Unknown, "Windows does not tell; make sure that it is off"),
    };
    vec![finding("window system", Severity::Good, "Windows"), night_light]
}

fn judge_monitor(monitor: &Monitor, properties: &[Property]) -> Vec<Finding> {
    let name = &monitor.name;
    let mut findings = Vec::new();
    let finding = |subject, severity, what: String| Finding { monitor: Some(name.clone()), subject, severity, what };
    let faults = monitor.faults_by_subject();
    let judge = |subject, good: &str| {
        let of: Vec<&str> = faults.iter().filter(|(about, _)| *about == subject).map(|(_, fault)| &**fault).collect();
        match of.is_empty() {
            true => finding(subject, Severity::Good, good.into()),
            false => finding(subject, Severity::Fault, of.join("; ")),
        }
    };
    if let Some(scan_out) = &monitor.scan_out {
        findings.extend([
            judge("rotation", "neither turned nor mirrored"),
            judge("scaling", "not scaled"),
            judge("mirroring", "no other monitor shows its part of the desktop"),
            match scan_out.gamma {
                Gamma::Unknown => finding("gamma", Severity::Unknown, "the driver has no table to read".into()),
                Gamma::Identity | Gamma::Altered { .. } => judge("gamma", "the table is the identity"),
            },
        ]);
        if scan_out.high_dynamic_range.is_some() {
            findings.push(judge("hdr", "off"));
        }
    } else if monitor.scale != 1.0 {
        findings.push(judge("scaling", "not scaled"));
    }
    findings.push(judge_mode(monitor));
    findings.push(judge_range(monitor, properties));
    findings.extend(properties.iter().filter_map(|property| judge_property(name, property)));
    findings
}

fn judge_mode(monitor: &Monitor) -> Finding {
    let Monitor { name, width, height, .. } = monitor;
    let native = monitor.edid.as_ref().and_then(|edid| edid.native).map(|mode| (mode.width, mode.height));
    let (severity, what) = match native.or(monitor.scan_out.as_ref().and_then(|scan_out| scan_out.preferred)) {
        Some(native) if native == (*width, *height) => (Severity::Good, format!("native, {width}x{height}")),
        Some((columns, rows)) => (
            Severity::Fault,
            format!(
                "{width}x{height}, but {name} asks for {columns}x{rows}: its own scaler makes up the pixels ({})",
                by(
                    &format!("xrandr --output {name} --mode {columns}x{rows}"),
                    &format!("Display resolution: {columns}x{rows}")
                )
            ),
        ),
        None => (Severity::Unknown, format!("{width}x{height}; {name} does not say which mode is its own")),
    };
    Finding { monitor: Some(name.clone()), subject: "mode", severity, what }
}

/// Full or limited range (0–255 or 16–235): what the driver says, else what the sink makes likely.
fn judge_range(monitor: &Monitor, properties: &[Property]) -> Finding {
    let name = &monitor.name;
    let hdmi = monitor.edid.as_ref().is_some_and(|edid| edid.hdmi);
    let set = properties.iter().find(|property| property.name.eq_ignore_ascii_case("Broadcast RGB"));
    let (severity, what) = match set.map(|property| (property.value.to_ascii_lowercase(), &property.name)) {
        Some((value, _)) if value.starts_with("full") => (Severity::Good, "full range".into()),
        Some((value, property)) if value.starts_with("limited") => (
            Severity::Fault,
            format!(
                "limited range: 256 levels are squeezed into 220 (xrandr --output {name} --set \"{property}\" Full)"
            ),
        ),
        Some((value, property)) if hdmi => (
            Severity::Warning,
            format!(
                "{value}: an HDMI sink may be sent limited range (xrandr --output {name} --set \"{property}\" Full)"
            ),
        ),
        Some((value, _)) => (Severity::Good, format!("{value}, and the sink is not HDMI: full range")),
        None if hdmi => (
            Severity::Unknown,
            "the sink is HDMI and the driver does not tell: it may be sent limited range; look at the test card".into(),
        ),
        None => (Severity::Unknown, "the driver does not tell; look at the test card".into()),
    };
    Finding { monitor: Some(name.clone()), subject: "range", severity, what }
}

fn judge_property(name: &str, property: &Property) -> Option<Finding> {
    let value = property.value.to_ascii_lowercase();
    let set = |to: &str| format!("xrandr --output {name} --set \"{}\" {to}", property.name);
    let off = matches!(value.as_str(), "off" | "none" | "0" | "disabled");
    let (subject, severity, what) = match property.name.to_ascii_lowercase().as_str() {
        "dither" | "dithering" | "dithering mode" | "dither mode" if off => {
            ("dithering", Severity::Good, "off".to_owned())
        }
        "dither" | "dithering" | "dithering mode" | "dither mode" => {
            ("dithering", Severity::Warning, format!("{value}: levels may change from frame to frame ({})", set("off")))
        }
        "underscan" if off => return None,
        "underscan" => {
            ("scaling", Severity::Fault, format!("underscan is {value}: the picture is shrunk ({})", set("off")))
        }
        "ctm" if identity_matrix(&property.value) => ("colour matrix", Severity::Good, "the identity".to_owned()),
        "ctm" => (
            "colour matrix",
            Severity::Fault,
            format!("colours are mixed by the graphics card ({})", set(IDENTITY_CTM)),
        ),
        _ => return None,
    };
    Some(Finding { monitor: Some(name.to_owned()), subject, severity, what })
}

/// The unit matrix in the 31.32 fixed point of the kernel's property, low words first.
const IDENTITY_CTM: &str = "0,1,0,0,0,0,0,0,0,1,0,0,0,0,0,0,0,1";

/// A matrix is not applied when it is all zeros (not set).
fn identity_matrix(value: &str) -> bool {
    value == IDENTITY_CTM || value.split(',').all(|word| word == "0")
}

#[cfg(test)]
mod tests {
    use super::super::edid::{Edid, NativeMode};
    use super::super::monitor::ScanOut;
    use super::*;

    fn monitor() -> Monitor {
        Monitor {
            index: 0,
            name: "HDMI-1".into(),
            width: 1920,
            height: 1080,
            x: 0,
            y: 0,
            refresh: Some(60.0),
            scale: 1.0,
            primary: false,
            edid: Some(Edid {
                manufacturer: "HOE".into(),
                product: 1,
                number: 0,
                name: None,
                serial: None,
                year: 2021,
                native: Some(NativeMode { width: 1920, height: 1080, refresh: 60.0 }),
                bits_per_colour: Some(8),
                hdmi: true,
                checksum_valid: true,
            }),
            scan_out: Some(ScanOut {
                rotated: false,
                transformed: false,
                gamma: Gamma::Identity,
                high_dynamic_range: Some(false),
                shared_with: Vec::new(),
                preferred: None,
            }),
            parts: Vec::new(),
        }
    }

    fn property(name: &str, value: &str) -> Property {
        Property { name: name.into(), value: value.into() }
    }

    fn of<'a>(findings: &'a [Finding], subject: &str) -> &'a Finding {
        let mut about = findings.iter().filter(|finding| finding.subject == subject);
        let (one, none) = (about.next(), about.next());
        assert!(none.is_none(), "{subject} twice");
        one.expect(subject)
    }

    #[test]
    fn a_clean_monitor_is_good_in_everything_that_can_be_known() {
        let properties = [property("Broadcast RGB", "Full"), property("dither", "off"), property("CTM", IDENTITY_CTM)];
        let findings = judge_monitor(&monitor(), &properties);
        assert_eq!(findings.len(), 9);
        assert!(findings.iter().all(|finding| finding.severity == Severity::Good), "{findings:?}");
    }

    #[test]
    fn each_fault_is_told_under_its_subject_and_no_other() {
        type Spoil = fn(&mut Monitor);
        let spoil: [(&str, Spoil); 6] = [
            ("rotation", |m| m.scan_out.as_mut().expect("scan-out").rotated = true),
            ("scaling", |m| m.scale = 1.5),
            ("scaling", |m| m.scan_out.as_mut().expect("scan-out").transformed = true),
            ("mirroring", |m| m.scan_out.as_mut().expect("scan-out").shared_with = vec!["DP-1".into()]),
            ("hdr", |m| m.scan_out.as_mut().expect("scan-out").high_dynamic_range = Some(true)),
            ("gamma", |m| m.scan_out.as_mut().expect("scan-out").gamma = Gamma::Altered { levels: 9 }),
        ];
        for (subject, spoil) in spoil {
            let mut spoilt = monitor();
            spoil(&mut spoilt);
            let findings = judge_monitor(&spoilt, &[property("Broadcast RGB", "Full")]);
            for finding in &findings {
                let expected = if finding.subject == subject { Severity::Fault } else { Severity::Good };
                assert_eq!(finding.severity, expected, "{subject}: {finding:?}");
            }
        }
        let mut other_mode = monitor();
        other_mode.width = 1280;
        assert_eq!(of(&judge_monitor(&other_mode, &[]), "mode").severity, Severity::Fault);
    }

    #[test]
    fn range_is_judged_by_the_driver_and_then_by_the_sink() {
        let range = |monitor: &Monitor, properties: &[Property]| judge_range(monitor, properties).severity;
        let mut dvi = monitor();
        dvi.edid.as_mut().expect("EDID").hdmi = false;
        assert_eq!(range(&monitor(), &[property("Broadcast RGB", "Limited 16:235")]), Severity::Fault);
        assert_eq!(range(&monitor(), &[property("Broadcast RGB", "Automatic")]), Severity::Warning);
        assert_eq!(range(&dvi, &[property("Broadcast RGB", "Automatic")]), Severity::Good);
        assert_eq!(range(&monitor(), &[]), Severity::Unknown);
        assert_eq!(range(&dvi, &[]), Severity::Unknown);
    }

    #[test]
    fn driver_settings_that_alter_levels_are_found() {
        for (name, value, subject, severity) in [
            ("dithering mode", "dynamic 2x2", "dithering", Severity::Warning),
            ("dither", "off", "dithering", Severity::Good),
            ("underscan", "on", "scaling", Severity::Fault),
            ("CTM", "0,0,0,0,0,0,0,0,0,1,0,0,0,0,0,0,0,1", "colour matrix", Severity::Fault),
            ("CTM", "0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0", "colour matrix", Severity::Good),
        ] {
            let finding = judge_property("HDMI-1", &property(name, value)).expect(name);
            assert_eq!((finding.subject, finding.severity), (subject, severity), "{finding:?}");
        }
        assert_eq!(judge_property("HDMI-1", &property("max bpc", "8")), None);
    }

    #[test]
    fn the_desktop_is_judged_as_a_whole() {
        assert_eq!(of(&judge_screen(None), "window system").severity, Severity::Unknown);
        let good = judge_screen(Some(&Screen { depth: 24, composited: false }));
        assert!(good.iter().all(|finding| finding.severity == Severity::Good));
        let bad = judge_screen(Some(&Screen { depth: 30, composited: true }));
        assert_eq!(of(&bad, "depth").severity, Severity::Fault);
        assert_eq!(of(&bad, "compositor").severity, Severity::Warning);
        for (told, severity) in
            [(Some(false), Severity::Good), (Some(true), Severity::Warning), (None, Severity::Unknown)]
        {
            assert_eq!(of(&judge_windows(told), "night light").severity, severity);
        }
    }
}
