//! The same again under a window manager: it must neither move, resize, cover nor keep the panel's window.

use crate::desk::Desk;
use crate::{Case, Ended, live, ownership, pixels};
use std::process::{Child, Command, Stdio};

pub(crate) const CASES: &[Case] = &[
    ("under_a_window_manager_every_level_is_there_and_nothing_elsewhere", |desk| {
        under_openbox(desk, |desk| pixels::exact(desk, "software"))
    }),
    ("under_a_window_manager_the_first_thing_on_the_panel_is_the_frame", |desk| under_openbox(desk, pixels::first)),
    ("under_a_window_manager_a_window_raised_above_the_panel_does_not_stay_there", |desk| {
        under_openbox(desk, ownership::raised)
    }),
    ("under_a_window_manager_unplugging_touches_no_other_monitor", |desk| under_openbox(desk, ownership::unplugged)),
    ("under_a_window_manager_unplugging_is_waited_out", |desk| under_openbox(desk, ownership::replugged)),
    ("under_a_window_manager_the_operators_view_stays_off_the_panel", |desk| under_openbox(desk, live::beside)),
    ("under_a_window_manager_escape_ends_the_show", |desk| under_openbox(desk, ownership::escape)),
];

struct Openbox {
    process: Child,
    _home: tempfile::TempDir,
}

impl Drop for Openbox {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn under_openbox(desk: &Desk, case: impl FnOnce(&Desk) -> Ended) -> Ended {
    let home = tempfile::tempdir().expect("folder");
    let started = Command::new("openbox")
        .arg("--sm-disable")
        .env("DISPLAY", desk.display())
        .env("HOME", home.path())
        .env("XDG_CONFIG_HOME", home.path())
        .env("XDG_CACHE_HOME", home.path())
        .env("XDG_DATA_HOME", home.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let Ok(process) = started else { return Ended::NotRun("openbox is not installed".into()) };
    let openbox = Openbox { process, _home: home };
    desk.wait_until("the window manager takes over", || desk.window_manager_is_there());
    let ended = case(desk);
    drop(openbox);
    desk.wait_until("the window manager goes", || !desk.window_manager_is_there());
    ended
}
