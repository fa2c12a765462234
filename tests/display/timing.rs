//! Frames in time: each once, in order, when it is due.

use crate::child::{Job, Running, ShowJob};
use crate::desk::Desk;
use crate::frames::{NUMBER_BITS, Pattern};
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};

pub(crate) const CASES: &[Case] = &[
    ("a_sequence_is_played_each_frame_once_and_in_order", |desk| sequence(desk, "software")),
    ("a_sequence_is_played_in_order_by_the_gpu", |desk| sequence(desk, "gpu")),
    ("a_sequence_without_a_rate_follows_the_monitor", monitor_rate),
    ("two_panels_at_once_show_their_own_frames", two),
];

/// Slow enough that each frame is captured many times on a busy machine.
const RATE: f64 = 8.0;
const COUNT: u64 = 24;

fn job(presenter: &str) -> ShowJob {
    let mut job = ShowJob::new(PANEL, (Pattern::Ramp, 1920, 1080), presenter);
    job.hold = Some(0.3);
    job
}

fn sequence(desk: &Desk, presenter: &str) -> Ended {
    let plug = desk.plug(PANEL);
    let before = desk.capture_monitor(&desk.plug(OPERATOR));
    let mut running = Running::start(Some(desk.display()), &Job::Play(job(presenter), COUNT, Some(RATE)), &[]);
    // The last row comes last where a frame is drawn from the top: half a frame would show the number before.
    let mut seen: Vec<u64> = Vec::new();
    desk.wait_until("the last frame comes", || {
        let corner = desk.capture(plug.x, plug.y + plug.height as i16 - 1, NUMBER_BITS as u16, 1);
        if let Some(number) = corner.number().filter(|number| seen.last() != Some(number)) {
            seen.push(number);
        }
        seen.last() == Some(&(COUNT - 1)) || running.refused()
    });
    let report = match running.end() {
        Err(message) if message.contains("no graphics presenter") => {
            return Ended::NotRun("no Vulkan driver is installed".into());
        }
        report => report.expect("report"),
    };
    // An empty desktop is black, which reads as 0, as the first frame does.
    assert_eq!(seen, (0..COUNT).collect::<Vec<_>>());
    let times = report["times"].as_array().expect("times");
    assert_eq!(times.len() as u64, COUNT);
    for (number, time) in times.iter().enumerate() {
        assert_eq!(time["number"], number, "{time}");
        assert_eq!(time["taken"], true, "{time}");
        assert!(time["presented"].as_f64() >= time["due"].as_f64(), "presented before it was due: {time}");
    }
    let (first, last) = (times[0]["presented"].as_f64(), times[COUNT as usize - 1]["presented"].as_f64());
    let taken = last.expect("time") - first.expect("time");
    assert!(taken >= (COUNT - 1) as f64 / RATE - 1e-3, "too fast: {taken} s");
    assert_eq!(report["report"]["frames"], COUNT);
    assert_eq!(report["report"]["end"], "held");
    assert!(desk.capture_monitor(&desk.plug(OPERATOR)) == before, "the operator's monitor was touched");
    Ended::Passed
}

fn monitor_rate(desk: &Desk) -> Ended {
    let report =
        Running::start(Some(desk.display()), &Job::Play(job("software"), 60, None), &[]).end().expect("report");
    let times = report["times"].as_array().expect("times");
    let blanks: Vec<u64> = times.iter().skip(1).map(|time| time["vertical_blank"].as_u64().expect("count")).collect();
    assert!(blanks.is_sorted_by(|a, b| a < b), "two frames in one refresh: {blanks:?}");
    // The dummy's own clock is a timer of 16 ms. A frame each other refresh is what a busy machine may come down to.
    let mean = report["report"]["mean_interval"].as_f64().expect("interval");
    assert!(mean > 0.014, "frames came faster than the monitor refreshes: {mean} s");
    Ended::Passed
}

fn two(desk: &Desk) -> Ended {
    let one = ShowJob::new(PANEL, (Pattern::Colours(31), 1920, 1080), "software");
    let other = ShowJob::new(ODD_PANEL, (Pattern::Colours(32), 1367, 769), "auto");
    let before = desk.capture_monitor(&desk.plug(OPERATOR));
    let running = Running::start(Some(desk.display()), &Job::Two(one.clone(), other.clone()), &[]);
    desk.wait_for(&desk.plug(PANEL), &one.picture());
    desk.wait_for(&desk.plug(ODD_PANEL), &other.picture());
    desk.wait_for(&desk.plug(PANEL), &one.picture());
    assert!(desk.capture_monitor(&desk.plug(OPERATOR)) == before, "the operator's monitor was touched");
    assert_eq!(running.stop().expect("report"), serde_json::json!([PANEL, ODD_PANEL]));
    Ended::Passed
}
