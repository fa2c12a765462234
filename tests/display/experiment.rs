//! Frames kept ready on a real panel: recalled, played and triggered, each level by level, and nothing else in between.

use crate::desk::Desk;
use crate::frames::Picture;
use crate::python::Python;
use crate::server::PANEL;
use crate::serving::Served;
use crate::{Case, Ended};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};

pub(crate) const CASES: &[Case] =
    &[("frames_that_are_kept_are_on_the_panel_when_they_are_called_played_or_triggered", kept)];

/// Frames that are kept.
const FRAMES: u64 = 8;

/// Does what each line says with frames that carry their numbers in their first pixels.
const EXPERIMENT: &str = "
import json, sys
import numpy as np
import holodrive
slm = holodrive.SLM(path=sys.argv[1])
def frame(number):
    row = np.arange(1920, dtype=np.uint32) & 255
    row[:16] = [255 if number >> x & 1 else 0 for x in range(16)]
    return np.broadcast_to(row, (1080, 1920)).astype(np.uint8)
for line in sys.stdin:
    try:
        print('>' + json.dumps(eval(line)), flush=True)
    except holodrive.Error as error:
        print('>' + json.dumps(str(error)), flush=True)
";

fn kept(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let served = Served::start(desk, PANEL, &["--idle", "77", "--trigger", "0"]);
    let mut client = match Python::start("numpy", EXPERIMENT, &[&served.socket().display().to_string()]) {
        Ok(client) => client,
        Err(ended) => return ended,
    };
    let mut ask = |line: &str| -> serde_json::Value { serde_json::from_str(&client.ask(line)).expect("answer") };
    let idle = desk.capture_monitor(&plug);
    assert_eq!(ask(&format!("[slm.preload(k, frame(k)) for k in range({FRAMES})][-1]")), FRAMES);
    assert!(desk.capture_monitor(&plug) == idle, "a frame that is only kept was shown");
    // No waiting: the answer says that it is there.
    let is_there = |number: u64| {
        let (seen, wanted) = (desk.capture_monitor(&plug), Picture::numbered(number, 1920, 1080));
        assert!(seen == wanted, "frame {number}: {}", seen.difference(&wanted));
    };
    for number in [3, 0, 7, 7, 1] {
        let told = ask(&format!("slm.show('{number}')._asdict()"));
        assert!(told["latency"].as_f64().is_some_and(|t| t < 2.0), "{told}");
        is_there(number);
    }
    // Sixty frames at 20 a second, while the screen is captured: whole frames of the list, one after another.
    let order = "[k % 5 + 2 for k in range(60)]";
    let ended = AtomicBool::new(false);
    let (told, seen) = std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut seen: Vec<u64> = Vec::new();
            while !ended.load(Ordering::Relaxed) {
                let picture = desk.capture_monitor(&plug);
                let number = picture.number().expect("a frame's number");
                let wanted = Picture::numbered(number, 1920, 1080);
                assert!(picture == wanted, "torn: {}", picture.difference(&wanted));
                if seen.last() != Some(&number) {
                    seen.push(number);
                }
            }
            seen
        });
        let told = ask(&format!("[shown._asdict() for shown in slm.play({order}, 20)]"));
        ended.store(true, Ordering::Relaxed);
        (told, watch.join().expect("watch"))
    });
    let shown = told.as_array().expect("frames");
    let times: Vec<f64> = shown.iter().map(|frame| frame["time"].as_f64().expect("time")).collect();
    assert_eq!(times.len(), 60);
    // None is left out; where capturing takes the screen's time they come late, and are said to.
    let (lasted, missed) = (times[59] - times[0], shown.iter().any(|frame| frame["missed"].as_u64() > Some(0)));
    assert!(lasted > 2.9 && (lasted < 3.1 || missed), "{lasted} s for 59 steps: {told}");
    assert!(times.windows(2).all(|pair| pair[1] > pair[0]));
    is_there(59 % 5 + 2);
    let steps = seen.windows(2).filter(|pair| pair[1] == if pair[0] == 6 { 2 } else { pair[0] + 1 }).count();
    assert!(seen.len() > 10 && 10 * steps > 8 * (seen.len() - 1), "out of order: {seen:?}");
    // A trigger's answer, too, says that its frame is there.
    ask("slm.arm([4, 6])");
    let wire = TcpStream::connect(("127.0.0.1", served.trigger.expect("a port"))).expect("connect");
    wire.set_read_timeout(Some(crate::desk::PATIENCE)).expect("timeout");
    let mut lines = BufReader::new(wire);
    for (said, number) in [("", 4), ("", 6), ("5", 5), ("", 4)] {
        lines.get_mut().write_all(format!("{said}\n").as_bytes()).expect("trigger");
        let mut told = String::new();
        lines.read_line(&mut told).expect("answer");
        assert!(!told.starts_with("error"), "{told}");
        is_there(number);
    }
    assert_eq!(ask(&format!("slm.forget(*range({}))", FRAMES - 1)), 1);
    assert!(ask("slm.show('0')").as_str().is_some_and(|told| told.contains("preload")));
    is_there(4);
    served.stop();
    Ended::Passed
}
