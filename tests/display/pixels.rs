//! Every level on the chosen monitor, none anywhere else.

use crate::child::{Job, Running, ShowJob};
use crate::desk::Desk;
use crate::frames::{Pattern, Picture};
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};

pub(crate) const CASES: &[Case] = &[
    ("software_presenter_shows_every_level_there_and_nothing_elsewhere", software),
    ("gpu_presenter_shows_every_level_there_and_nothing_elsewhere", gpu),
    ("auto_takes_the_software_presenter_without_an_adapter", fallback),
    ("a_hundred_frames_in_a_row_are_shown_each_unchanged", hundred),
    ("the_first_thing_on_the_panel_is_the_frame", first),
];

/// The whole list for one presenter: patterns on the panel, and on a panel of odd size.
///
/// The window opens with another frame than those that are compared: the server itself paints the first one as the
/// window's background, the rest can only come from the presenter.
pub(crate) fn exact(desk: &Desk, presenter: &str) -> Ended {
    for monitor in [PANEL, ODD_PANEL] {
        let plug = desk.plug(monitor);
        let (width, height) = (plug.width.into(), plug.height.into());
        let others: Vec<_> = [OPERATOR, PANEL, ODD_PANEL].into_iter().filter(|name| *name != monitor).collect();
        let before: Vec<Picture> = others.iter().map(|name| desk.capture_monitor(&desk.plug(name))).collect();
        let patterns = [Pattern::Ramp, Pattern::Random(7), Pattern::Checker, Pattern::Colours(7)];
        let job = ShowJob::new(monitor, (Pattern::Random(1), width, height), presenter);
        let opening = job.picture();
        let mut running = Running::start(Some(desk.display()), &Job::Frames(job, patterns.to_vec()), &[]);
        desk.wait_for(&plug, &opening);
        for pattern in patterns {
            running.next();
            desk.wait_for(&plug, &Picture::new(pattern, width, height));
            for (name, before) in others.iter().zip(&before) {
                let after = desk.capture_monitor(&desk.plug(name));
                assert!(after == *before, "{name} was touched: {}", after.difference(before));
            }
        }
        let report = running.stop().expect("report");
        assert_eq!(report["presenter"], presenter, "{report}");
        for (index, presented) in report["presented"].as_array().expect("list").iter().enumerate() {
            assert_eq!(presented["number"], index + 1, "{report}");
            assert_eq!(presented["taken"], true, "{report}");
        }
        let last = Picture::new(patterns[3], width, height);
        desk.wait_until("the window goes", || desk.capture_monitor(&plug) != last);
    }
    Ended::Passed
}

fn software(desk: &Desk) -> Ended {
    exact(desk, "software")
}

fn gpu(desk: &Desk) -> Ended {
    let mut probe = ShowJob::new(PANEL, (Pattern::Ramp, 1920, 1080), "gpu");
    probe.hold = Some(0.0);
    match Running::start(Some(desk.display()), &Job::Show(probe), &[]).end() {
        Err(message) if message.contains("no graphics presenter") => {
            Ended::NotRun("no Vulkan driver is installed".into())
        }
        Err(message) => panic!("{message}"),
        Ok(report) => {
            assert!(report["adapter"].is_string(), "{report}");
            exact(desk, "gpu")
        }
    }
}

fn fallback(desk: &Desk) -> Ended {
    let no_driver = [("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];
    let mut job = ShowJob::new(PANEL, (Pattern::Random(3), 1920, 1080), "gpu");
    let refused =
        Running::start(Some(desk.display()), &Job::Show(job.clone()), &no_driver).end().expect_err("no adapter");
    assert!(refused.contains("no graphics presenter") && !refused.contains('\n'), "{refused}");
    job.presenter = "auto".into();
    let wanted = job.picture();
    let running = Running::start(Some(desk.display()), &Job::Show(job), &no_driver);
    desk.wait_for(&desk.plug(PANEL), &wanted);
    assert_eq!(running.stop().expect("report")["presenter"], "software");
    Ended::Passed
}

/// Looks at a part of the panel as fast as it can while the window comes up: it must go from what was there to the
/// frame, with nothing (white, black, half a frame) between.
pub(crate) fn first(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let job = ShowJob::new(PANEL, (Pattern::Random(11), 1920, 1080), "software");
    let whole = job.picture();
    let (width, height) = (64, 4);
    let part = |picture: &Picture| {
        let rows = picture.pixels.chunks_exact(1920).skip(1076);
        Picture { width, height, pixels: rows.flat_map(|row| row[1856..].to_vec()).collect() }
    };
    let (before, wanted) = (part(&desk.capture_monitor(&plug)), part(&whole));
    let running = Running::start(Some(desk.display()), &Job::Show(job), &[]);
    desk.wait_until("the frame comes", || {
        let seen = desk.capture(plug.x + 1856, plug.y + 1076, width as u16, height as u16);
        assert!(seen == before || seen == wanted, "something else was shown: {}", seen.difference(&wanted));
        seen == wanted
    });
    for _ in 0..2000 {
        let seen = desk.capture(plug.x + 1856, plug.y + 1076, width as u16, height as u16);
        assert!(seen == wanted, "the frame went away: {}", seen.difference(&wanted));
    }
    running.stop().expect("report");
    Ended::Passed
}

fn hundred(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let patterns: Vec<Pattern> = (100..200).map(Pattern::Random).collect();
    let job = ShowJob::new(PANEL, (Pattern::Ramp, 1920, 1080), "software");
    let mut running = Running::start(Some(desk.display()), &Job::Frames(job, patterns.clone()), &[]);
    for pattern in patterns {
        running.next();
        desk.wait_for(&plug, &Picture::new(pattern, 1920, 1080));
    }
    let report = running.stop().expect("report");
    assert_eq!(report["frames"], 101, "{report}");
    Ended::Passed
}
