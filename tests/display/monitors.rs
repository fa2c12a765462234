//! Which monitor is meant.

use crate::child::{Job, Running, ShowJob};
use crate::desk::Desk;
use crate::frames::Pattern;
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};
use std::collections::BTreeMap;

pub(crate) const CASES: &[Case] = &[
    ("monitors_are_listed_as_the_server_has_them", listed),
    ("a_monitor_is_found_by_its_edid", by_edid),
    ("an_unknown_monitor_is_refused_with_a_list", unknown),
    ("a_frame_of_another_size_is_refused", other_size),
    ("a_gamma_table_that_changes_levels_is_refused", gamma),
    ("the_doctor_finds_what_alters_levels", doctor),
    ("without_a_display_server_there_is_one_clear_error", no_server),
];

fn listed(desk: &Desk) -> Ended {
    let report = Running::start(Some(desk.display()), &Job::Monitors, &[]).end().expect("list");
    let monitors = report.as_array().expect("array");
    assert_eq!(monitors.len(), 3);
    for (index, (monitor, name)) in monitors.iter().zip([OPERATOR, PANEL, ODD_PANEL]).enumerate() {
        let plug = desk.plug(name);
        assert_eq!(monitor["index"], index);
        assert_eq!(monitor["name"], name);
        assert_eq!(monitor["x"], plug.x);
        assert_eq!(monitor["y"], plug.y);
        assert_eq!(monitor["width"], plug.width);
        assert_eq!(monitor["height"], plug.height);
        assert_eq!(monitor["primary"], name == OPERATOR);
        assert_eq!(monitor["scale"], 1.0);
        assert_eq!(monitor["scan_out"]["gamma"], "identity");
        assert_eq!(monitor["scan_out"]["rotated"], false);
        assert_eq!(monitor["scan_out"]["transformed"], false);
    }
    // 148.5 MHz over 2200 × 1125 pixels.
    assert!((monitors[1]["refresh"].as_f64().expect("refresh") - 60.0).abs() < 1e-9);
    Ended::Passed
}

/// A base block (EDID 1.4) with that name and serial number in its descriptors, and a right checksum.
fn edid(name: &str, serial: &str) -> Vec<u8> {
    let mut block = vec![0; 128];
    block[..8].copy_from_slice(&[0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0]);
    block[8..10].copy_from_slice(&[0x21, 0xE5]);
    block[18..20].copy_from_slice(&[1, 4]);
    block[20] = 0xA2;
    for (at, tag, text) in [(72, 0xFC, name), (90, 0xFF, serial)] {
        block[at..at + 5].copy_from_slice(&[0, 0, 0, tag, 0]);
        let padded = format!("{text}\n            ");
        block[at + 5..at + 18].copy_from_slice(&padded.as_bytes()[..13]);
    }
    block[127] = block.iter().fold(0u8, |sum, &byte| sum.wrapping_sub(byte));
    block
}

fn by_edid(desk: &Desk) -> Ended {
    let plugs = [desk.plug(PANEL), desk.plug(ODD_PANEL)];
    desk.set_edid(&plugs[0], Some(&edid("HE PLUTO-2.1", "A17")));
    desk.set_edid(&plugs[1], Some(&edid("HE PLUTO-2.1", "A18")));
    let list = Running::start(Some(desk.display()), &Job::Monitors, &[]).end().expect("list");
    assert!(list[0]["edid"].is_null(), "{list}");
    for (index, serial) in [(1, "A17"), (2, "A18")] {
        let edid = &list[index]["edid"];
        assert_eq!(edid["name"], "HE PLUTO-2.1", "{list}");
        assert_eq!(edid["serial"], serial, "{list}");
        assert_eq!(edid["manufacturer"], "HOE", "{list}");
        assert_eq!(edid["checksum_valid"], true, "{list}");
    }
    let shown = |monitor: &str| {
        let job = ShowJob::new(monitor, (Pattern::Random(21), 1367, 769), "software");
        let wanted = job.picture();
        let running = Running::start(Some(desk.display()), &Job::Show(job), &[]);
        desk.wait_for(&plugs[1], &wanted);
        running.stop().expect("report")
    };
    assert_eq!(shown("serial:A18")["monitor"]["name"], ODD_PANEL);
    let doubtful = refusal(desk, ShowJob::new("edid:HE PLUTO-2.1", (Pattern::Ramp, 1920, 1080), "software"));
    assert!(doubtful.contains("A17") && doubtful.contains("A18"), "{doubtful}");
    desk.set_edid(&plugs[1], Some(&edid("LCOS-SLM,SOC", "8001")));
    assert_eq!(shown("edid:lcos-slm,soc")["monitor"]["name"], ODD_PANEL);
    plugs.iter().for_each(|plug| desk.set_edid(plug, None));
    Ended::Passed
}

fn refusal(desk: &Desk, job: ShowJob) -> String {
    Running::start(Some(desk.display()), &Job::Show(job), &[]).end().expect_err("this must be refused")
}

fn unknown(desk: &Desk) -> Ended {
    for monitor in ["DUMMY7", "edid:HE PLUTO-2.1", "serial:1", "index:3", "at:7,7"] {
        let message = refusal(desk, ShowJob::new(monitor, (Pattern::Ramp, 1920, 1080), "software"));
        assert!(message.contains(monitor), "{message}");
        for name in [OPERATOR, PANEL, ODD_PANEL] {
            assert!(message.contains(name), "{message}");
        }
        assert!(!message.contains('\n'), "{message}");
    }
    Ended::Passed
}

fn other_size(desk: &Desk) -> Ended {
    for (width, height) in [(1919, 1080), (1920, 1081), (1280, 720), (3840, 2160)] {
        let message = refusal(desk, ShowJob::new(PANEL, (Pattern::Ramp, width, height), "software"));
        assert!(message.contains(&format!("{width}x{height}")) && message.contains("1920x1080"), "{message}");
    }
    Ended::Passed
}

fn gamma(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let curve: Vec<u16> = (0..256).map(|i| ((f64::from(i) / 255.0).powf(1.0 / 2.2) * 65_535.0) as u16).collect();
    let identity = desk.set_gamma(&plug, &curve);
    let mut job = ShowJob::new(PANEL, (Pattern::Ramp, 1920, 1080), "software");
    let message = refusal(desk, job.clone());
    job.exact = false;
    job.hold = Some(0.0);
    let report = Running::start(Some(desk.display()), &Job::Show(job), &[]).end().expect("allowed");
    desk.set_gamma(&plug, &identity);
    assert!(message.contains("gamma") && message.contains(PANEL), "{message}");
    assert_eq!(report["warnings"].as_array().map(Vec::len), Some(1), "{report}");
    Ended::Passed
}

fn no_server(_: &Desk) -> Ended {
    let job = Job::Show(ShowJob::new(PANEL, (Pattern::Ramp, 1920, 1080), "auto"));
    let nowhere = Running::start(None, &job, &[]).end().expect_err("no server");
    let wrong = Running::start(Some(":4095"), &job, &[]).end().expect_err("no such server");
    for message in [nowhere, wrong] {
        assert!(message.contains("no display server") && !message.contains('\n'), "{message}");
    }
    Ended::Passed
}

fn doctor(desk: &Desk) -> Ended {
    let findings = || {
        let job = Job::Examine(PANEL.into());
        let report = Running::start(Some(desk.display()), &job, &[]).end().expect("findings");
        let severity = |finding: &serde_json::Value| finding["severity"].as_str().map(str::to_owned);
        let list = report.as_array().expect("list").iter();
        list.map(|f| (f["subject"].as_str().expect("subject").to_owned(), severity(f).expect("severity"))).collect()
    };
    let plug = desk.plug(PANEL);
    let clean: BTreeMap<String, String> = findings();
    let swapped: Vec<u16> = (0..256).map(|i: u16| (i ^ 1) << 8).collect();
    let identity = desk.set_gamma(&plug, &swapped);
    desk.set_output_word(&plug, "Broadcast RGB", "Limited 16:235");
    let spoilt: BTreeMap<String, String> = findings();
    desk.set_gamma(&plug, &identity);
    desk.remove_output_property(&plug, "Broadcast RGB");
    for (subject, before) in &clean {
        let expected = match subject.as_str() {
            "gamma" | "range" => "fault",
            _ => before.as_str(),
        };
        assert_eq!(spoilt[subject], expected, "{subject}");
        assert_eq!(before, if subject == "range" { "unknown" } else { "good" }, "{subject}");
    }
    assert!(clean.len() >= 9, "{clean:?}");
    Ended::Passed
}
