//! What needs a monitor: the list of them, the doctor, and every level of a frame on one of three.

use crate::Case;
use crate::desk::Desk;
use crate::frames::{Pattern, Picture};
use crate::server::{ODD_PANEL, OPERATOR, PANEL, Server};
use crate::wine::Wine;
use holodrive::panel::{Frame, PanelProfile};
use holodrive::random::Random;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

pub(crate) const CASES: &[Case] = &[("a_monitor_is_found_looked_at_and_shows_every_level_of_a_frame", on_a_monitor)];

/// A frame of random levels for the generic panel; what must be on the screen.
fn frame(folder: &Path) -> Picture {
    let profile = PanelProfile::generic().expect("profile");
    let mut random = Random::new(20, 26);
    let levels: Vec<u16> = (0..profile.width * profile.height).map(|_| (random.bits() & 255) as u16).collect();
    let pixels = levels.iter().map(|&level| [level as u8; 3]).collect();
    let frame = Frame::new(&profile, profile.default_wavelength(), levels).expect("frame");
    frame.write(&folder.join("frame.png")).expect("write");
    Picture { width: profile.width as u32, height: profile.height as u32, pixels }
}

fn on_a_monitor(wine: &Wine) {
    let server = match Server::start() {
        Ok(server) => server,
        Err(why) => {
            println!("  NOT RUN: {why}");
            assert!(std::env::var_os("HOLODRIVE_REQUIRE_DISPLAY").is_none(), "could not run: {why}");
            return;
        }
    };
    let desk = Desk::new(server.display());
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    wine.end_all();
    let on_desk = |arguments: &[&str]| -> Command {
        let mut command = wine.holodrive(f, arguments);
        command.env("DISPLAY", server.display());
        command
    };
    let told = |arguments: &[&str]| -> Value {
        let out = on_desk(arguments).output().expect("runs");
        assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
        serde_json::from_slice(&out.stdout).expect("JSON")
    };
    let listed = told(&["monitors", "--json"]);
    let monitors = listed["monitors"].as_array().expect("list");
    let plugs = [OPERATOR, PANEL, ODD_PANEL].map(|name| desk.plug(name));
    let place = |monitor: &Value| ["x", "y", "width", "height"].map(|key| monitor[key].as_i64().expect("number"));
    let mut found: Vec<_> = monitors.iter().map(place).collect();
    let mut wanted: Vec<[i64; 4]> =
        plugs.iter().map(|p| [p.x.into(), p.y.into(), p.width.into(), p.height.into()]).collect();
    found.sort_unstable();
    wanted.sort_unstable();
    assert_eq!(found, wanted, "{listed}");
    let panel = monitors.iter().find(|monitor| monitor["width"] == 1920).expect("the panel");
    let name = panel["name"].as_str().expect("name");
    assert!(name.starts_with("DISPLAY") && panel["scale"] == 1.0, "{listed}");
    let findings = told(&["doctor", "--monitor", name, "--card", "card.png", "--json"])["findings"].clone();
    let findings = findings.as_array().expect("list");
    let of = |subject: &str| findings.iter().find(|finding| finding["subject"] == subject).expect("finding");
    assert_eq!(of("window system")["what"], "Windows");
    assert!(findings.iter().all(|finding| finding["severity"] != "fault"), "{findings:?}");
    assert!(
        ["rotation", "scaling", "mirroring"].iter().all(|subject| of(subject)["severity"] == "good"),
        "{findings:?}"
    );

    let random = frame(f);
    let card = image::open(f.join("card.png")).expect("card").into_rgb8();
    let card = Picture { width: 1920, height: 1080, pixels: card.pixels().map(|pixel| pixel.0).collect() };
    let others = [OPERATOR, ODD_PANEL].map(|other| desk.plug(other));
    let before = others.each_ref().map(|plug| desk.capture_monitor(plug));
    for (file, picture, presenter) in
        [("frame.png", &random, "software"), ("card.png", &card, "software"), ("frame.png", &random, "auto")]
    {
        let arguments = ["show", file, "--monitor", name, "--present", presenter, "--hold", "20"];
        let mut showing = on_desk(&arguments).stdout(Stdio::null()).spawn().expect("runs");
        desk.wait_for(&plugs[1], picture);
        for (plug, before) in others.iter().zip(&before) {
            let after = desk.capture_monitor(plug);
            assert!(after == *before, "another monitor was touched: {}", after.difference(before));
        }
        wine.end_all();
        showing.wait().expect("ends");
        desk.wait_until("the window goes", || desk.capture_monitor(&plugs[1]) != *picture);
    }
    // One of another size, and one that is not there.
    let other = monitors.iter().find(|monitor| monitor["width"] == 1367).expect("the odd panel");
    for (monitor, expected) in [(other["name"].as_str().expect("name"), "1367x769"), ("DISPLAY9", "DISPLAY9")] {
        let refused = on_desk(&["show", "frame.png", "--monitor", monitor]).output().expect("runs");
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && said.lines().count() == 1 && said.contains(expected), "{said}");
    }
    // An odd width, row by row.
    let odd = Picture::new(Pattern::Ramp, 1367, 769);
    let profile = PanelProfile::phase(1367, 769, 8e-6, 8, 632.8e-9).expect("profile");
    let levels = odd.pixels.iter().map(|pixel| u16::from(pixel[0])).collect();
    Frame::new(&profile, 632.8e-9, levels).expect("frame").write(&f.join("odd.png")).expect("write");
    let generic = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/calib/generic.toml")).expect("profile");
    let text = generic.replace("width = 1920", "width = 1367").replace("height = 1080", "height = 769");
    std::fs::write(f.join("odd.toml"), text).expect("write");
    let name = other["name"].as_str().expect("name");
    let arguments =
        ["show", "odd.png", "--panel", "odd.toml", "--monitor", name, "--present", "software", "--hold", "20"];
    let mut showing = on_desk(&arguments).stdout(Stdio::null()).spawn().expect("runs");
    desk.wait_for(&plugs[2], &odd);
    wine.end_all();
    showing.wait().expect("ends");
}
