//! Frames from other programs on the panel: the clients themselves, unchanged.
//!
//! slmsuite's own client runs if the Python of `HOLODRIVE_PYTHON` (else `python3`) has it installed (`pip install slmsuite`).

use crate::child::{Job, Running, ShowJob};
use crate::desk::{Desk, PATIENCE};
use crate::frames::{Pattern, Picture};
use crate::server::{OPERATOR, PANEL};
use crate::{Case, Ended};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};

pub(crate) const CASES: &[Case] = &[
    ("what_slmpy_sends_is_on_the_panel_when_it_is_answered", slmpy),
    ("what_slmsuites_own_client_sends_is_on_the_panel", slmsuite),
];

fn start(desk: &Desk) -> (Running, u16, u16) {
    let job = ShowJob::new(PANEL, (Pattern::Checker, 1920, 1080), "software");
    let idle = job.picture();
    let mut running = Running::start(Some(desk.display()), &Job::Serve(job), &[]);
    let line = running.line();
    let (slmsuite, slmpy) = line.split_once(' ').expect("two ports");
    desk.wait_for(&desk.plug(PANEL), &idle);
    (running, slmsuite.parse().expect("port"), slmpy.parse().expect("port"))
}

fn slmpy(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let before = desk.capture_monitor(&desk.plug(OPERATOR));
    let (running, _, port) = start(desk);
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("connect");
    stream.set_read_timeout(Some(PATIENCE)).expect("timeout");
    for seed in 0..20 {
        let picture = Picture::new(Pattern::Random(seed), 1920, 1080);
        let levels: Vec<u8> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
        stream.write_all(&(levels.len() as i32).to_le_bytes()).expect("length");
        stream.write_all(&levels).expect("frame");
        let mut answer = [0; 4];
        stream.read_exact(&mut answer).expect("answer");
        assert_eq!(&answer, b"done");
        // No waiting: the answer says that it is there.
        let seen = desk.capture_monitor(&plug);
        assert!(seen == picture, "answered before it was shown: {}", seen.difference(&picture));
    }
    drop(stream);
    // The last frame stays when its client is gone.
    let last = Picture::new(Pattern::Random(19), 1920, 1080);
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert!(desk.capture_monitor(&plug) == last);
    assert!(desk.capture_monitor(&desk.plug(OPERATOR)) == before);
    let report = running.stop().expect("report");
    assert_eq!(report["shown"], 20, "{report}");
    Ended::Passed
}

/// The levels of frame n at row y and column x, as both sides compute them.
fn levels(number: u32) -> Picture {
    let level = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(number.wrapping_mul(40_503)) >> 13) as u8;
    Picture { width: 1920, height: 1080, pixels: (0..1920 * 1080).map(|i| [level(i); 3]).collect() }
}

/// Sends frame n through `RemoteSLM` for each line that it reads, and says so.
const CLIENT: &str = "
import sys
import numpy as np
from slmsuite.hardware.slms.remote import RemoteSLM
slm = RemoteSLM('panel', host='127.0.0.1', port=int(sys.argv[1]))
assert slm.shape == (1080, 1920), slm.shape
assert slm.bitdepth == 8
assert abs(slm.wav_um - 0.532) < 1e-9
i = np.arange(1920 * 1080, dtype=np.uint32)
for line in sys.stdin:
    n = np.uint32(int(line))
    levels = ((i * np.uint32(2654435761) + n * np.uint32(40503)) >> np.uint32(13)).astype(np.uint8)
    slm.set_phase(levels.reshape(1080, 1920), settle=False)
    print('sent', flush=True)
";

fn slmsuite(desk: &Desk) -> Ended {
    let python = std::env::var("HOLODRIVE_PYTHON").unwrap_or_else(|_| "python3".into());
    let installed =
        Command::new(&python).args(["-c", "import slmsuite.hardware.slms.remote"]).stderr(Stdio::null()).status();
    if !installed.is_ok_and(|status| status.success()) {
        assert!(std::env::var_os("HOLODRIVE_PYTHON").is_none(), "{python} has no slmsuite");
        return Ended::Optional(format!("{python} has no slmsuite"));
    }
    let plug = desk.plug(PANEL);
    let (running, port, _) = start(desk);
    let mut client = Command::new(&python)
        .args(["-c", CLIENT, &port.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("python");
    let mut said = BufReader::new(client.stdout.take().expect("output")).lines();
    for number in 0..5 {
        writeln!(client.stdin.as_mut().expect("input"), "{number}").expect("client");
        // slmsuite prints lines of its own.
        let sent = said.by_ref().map_while(Result::ok).find(|line| line == "sent");
        assert!(sent.is_some(), "slmsuite's client failed");
        let (seen, wanted) = (desk.capture_monitor(&plug), levels(number));
        assert!(seen == wanted, "not what Python sent: {}", seen.difference(&wanted));
    }
    drop(client.stdin.take());
    assert!(client.wait().expect("client").success());
    let report = running.stop().expect("report");
    assert_eq!((&report["shown"], &report["failed"]), (&5.into(), &0.into()), "{report}");
    Ended::Passed
}
