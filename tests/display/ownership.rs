//! The panel stays the program's own: cursor, other windows, cables, keys.

use crate::child::{Job, Running, ShowJob};
use crate::desk::Desk;
use crate::frames::Pattern;
use crate::server::{OPERATOR, PANEL};
use crate::{Case, Ended};
use std::process::Command;
use std::time::Duration;

pub(crate) const CASES: &[Case] = &[
    ("the_cursor_is_hidden_over_the_panel", cursor),
    ("a_window_raised_above_the_panel_does_not_stay_there", raised),
    ("unplugging_ends_the_show_and_touches_no_other_monitor", unplugged),
    ("unplugging_is_waited_out_where_asked", replugged),
    ("no_screen_saver_comes_while_a_frame_is_shown", awake),
    ("escape_in_the_window_ends_the_show", escape),
    ("a_second_program_is_refused_the_panel_and_another_monitor_is_free", second),
];

fn job() -> ShowJob {
    ShowJob::new(PANEL, (Pattern::Random(5), 1920, 1080), "software")
}

fn start(desk: &Desk, job: &ShowJob) -> Running {
    let running = Running::start(Some(desk.display()), &Job::Show(job.clone()), &[]);
    desk.wait_for(&desk.plug(PANEL), &job.picture());
    running
}

/// Of two windows over each other one would not be on the panel, whatever its program says.
fn second(desk: &Desk) -> Ended {
    let (plug, job) = (desk.plug(PANEL), job());
    let first = start(desk, &job);
    let other = ShowJob { pattern: Pattern::Random(6), hold: Some(0.1), ..job.clone() };
    let refused =
        Running::start(Some(desk.display()), &Job::Show(other.clone()), &[]).end().expect_err("a second window");
    assert!(refused.contains("another holodrive"), "{refused}");
    assert!(desk.capture_monitor(&plug) == job.picture(), "the first frame was touched");
    let operator = ShowJob { monitor: OPERATOR.into(), width: 1280, height: 720, exact: false, ..other.clone() };
    Running::start(Some(desk.display()), &Job::Show(operator), &[]).end().expect("another monitor is free");
    first.stop().expect("report");
    Running::start(Some(desk.display()), &Job::Show(other), &[]).end().expect("free again");
    Ended::Passed
}

fn cursor(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    desk.warp_pointer(plug.x + 300, plug.y + 200);
    desk.wait_until("the cursor is seen without the window", || desk.cursor_pixels() > 0);
    let running = start(desk, &job());
    desk.wait_until("the cursor is hidden", || desk.cursor_pixels() == 0);
    desk.warp_pointer(plug.x + 1000, plug.y + 900);
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(desk.cursor_pixels(), 0);
    running.stop().expect("report");
    desk.wait_until("the cursor is back", || desk.cursor_pixels() > 0);
    desk.warp_pointer(10, 10);
    Ended::Passed
}

pub(crate) fn raised(desk: &Desk) -> Ended {
    let (plug, job) = (desk.plug(PANEL), job());
    let running = start(desk, &job);
    // Once the report may count it: the window is watched from its first frame on.
    std::thread::sleep(Duration::from_millis(500));
    for managed in [false, true] {
        let other = desk.raise_other_window(plug.x - 200, 300, 600, 400, managed);
        desk.wait_for(&plug, &job.picture());
        std::thread::sleep(Duration::from_millis(200));
        desk.wait_for(&plug, &job.picture());
        desk.close_other_window(other);
    }
    let report = running.stop().expect("report");
    assert!(report["covered"].as_u64() >= Some(1), "{report}");
    Ended::Passed
}

pub(crate) fn unplugged(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let operator = desk.plug(OPERATOR);
    let before = desk.capture_monitor(&operator);
    let running = start(desk, &job());
    desk.pull(&plug);
    // Not for a moment either: whoever moves the window there does so before it is closed.
    let moved = (0..200).map(|_| desk.capture_monitor(&operator)).find(|seen| *seen != before);
    let report = running.end();
    let after = desk.capture_monitor(&operator);
    desk.put_back(&plug);
    let report = report.expect("report");
    assert!(moved.is_none(), "for a moment the window was on the operator's monitor");
    assert!(report["end"]["absent"]["why"].as_str().is_some_and(|why| why.contains("DUMMY1 is gone")), "{report}");
    assert!(after == before, "the operator's monitor was touched: {}", after.difference(&before));
    Ended::Passed
}

pub(crate) fn replugged(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let job = ShowJob { wait: true, ..job() };
    let wanted = job.picture();
    let running = start(desk, &job);
    desk.pull(&plug);
    // The monitor's part of the desktop is still there to be captured: the window must leave it.
    desk.wait_until("the window goes", || desk.capture_monitor(&plug) != wanted);
    desk.put_back(&plug);
    desk.wait_for(&plug, &wanted);
    assert_eq!(running.stop().expect("report")["end"], "stopped");
    Ended::Passed
}

pub(crate) fn escape(desk: &Desk) -> Ended {
    if Command::new("xdotool").arg("version").output().is_err() {
        return Ended::NotRun("xdotool is not installed".into());
    }
    let running = start(desk, &job());
    std::thread::sleep(Duration::from_millis(500));
    desk.warp_pointer(10, 10);
    let pressed = Command::new("xdotool").args(["key", "Escape"]).env("DISPLAY", desk.display()).status();
    assert!(pressed.is_ok_and(|status| status.success()));
    assert_eq!(running.end().expect("report")["end"], "closed");
    Ended::Passed
}

fn awake(desk: &Desk) -> Ended {
    let running = start(desk, &job());
    std::thread::sleep(Duration::from_millis(500));
    desk.set_screen_saver(1);
    std::thread::sleep(Duration::from_secs(3));
    let with_panel = desk.screen_saver_is_on();
    running.stop().expect("report");
    desk.wait_until("the screen saver comes without the panel", || desk.screen_saver_is_on());
    desk.set_screen_saver(0);
    assert!(!with_panel);
    Ended::Passed
}
