//! Frames from other programs on the panel: `holodrive serve` as a user starts it, before clients that speak the protocols
//! as they are written down. Clients that others wrote are in `python`.

use crate::desk::{Desk, PATIENCE, Plug};
use crate::frames::{Pattern, Picture};
use crate::python::Python;
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

pub(crate) const CASES: &[Case] = &[
    ("what_slmpy_sends_is_on_the_panel_when_it_is_answered", slmpy),
    ("levels_of_ten_four_and_one_bit_are_packed_as_the_profile_says", packing),
    ("a_client_that_dies_leaves_its_last_frame_or_the_idle_one", gone),
    ("bad_clients_disturb_neither_the_panel_nor_another_client", bad_clients),
    ("clients_are_told_when_the_monitor_is_away_and_served_when_it_is_back", unplugged),
    ("a_corner_toggles_with_every_frame_and_the_rest_stays_exact", trigger),
    ("one_panel_spans_two_monitors_and_nothing_beside_them", region),
    ("serve_refuses_what_it_cannot_do", refused),
];

/// `holodrive serve` at work on the panel's monitor.
pub(crate) struct Served {
    process: Child,
    said: BufReader<ChildStdout>,
    folder: tempfile::TempDir,
    pub(crate) slmsuite: u16,
    slmpy: u16,
    /// Where triggers are heard, if they are.
    pub(crate) trigger: Option<u16>,
}

impl Served {
    /// Starts it with all protocols on free ports, a level of 77 on the idle panel, and `more` flags.
    pub(crate) fn start(desk: &Desk, monitor: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("folder");
        Self::start_in(desk, folder, monitor, more)
    }

    pub(crate) fn start_in(desk: &Desk, folder: tempfile::TempDir, monitor: &str, more: &[&str]) -> Self {
        Self::begin(program(desk, folder.path()), folder, monitor, more)
    }

    /// Starts it as `command`, which is the program in `folder` without arguments.
    pub(crate) fn begin(mut command: Command, folder: tempfile::TempDir, monitor: &str, more: &[&str]) -> Self {
        command.args(["serve", "--json", "--monitor", monitor, "--slmsuite", "0", "--slmpy", "0", "--local", "s.sock"]);
        command.args(["--present", "software", "--name", "panel"]).args(more);
        let mut process = command.stdout(Stdio::piped()).spawn().expect("runs");
        let mut said = BufReader::new(process.stdout.take().expect("output"));
        let mut line = String::new();
        said.read_line(&mut line).expect("first line");
        let told: serde_json::Value = serde_json::from_str(&line).expect("first line");
        let heard = |name: &str| -> Option<u16> {
            let address = told["serving"][name].as_str()?;
            Some(address.strip_prefix("127.0.0.1:").expect("loopback").parse().expect("port"))
        };
        let port = |name: &str| heard(name).expect("address");
        assert_eq!(told["serving"]["on"], monitor, "{told}");
        Self { slmsuite: port("slmsuite"), slmpy: port("slmpy"), trigger: heard("trigger"), process, said, folder }
    }

    pub(crate) fn socket(&self) -> PathBuf {
        self.folder.path().join("s.sock")
    }

    /// Ends it as a terminal's Ctrl-C does, and returns its report.
    pub(crate) fn stop(mut self) -> serde_json::Value {
        let pid = self.process.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().expect("kill").success());
        let mut text = String::new();
        self.said.read_to_string(&mut text).expect("report");
        assert!(self.process.wait().expect("ends").success());
        assert!(!self.socket().exists(), "the socket was left behind");
        serde_json::from_str(&text).expect("report")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

pub(crate) fn program(desk: &Desk, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_holodrive"));
    command.current_dir(folder).env("DISPLAY", desk.display()).env_remove("WAYLAND_DISPLAY");
    command
}

pub(crate) fn flat(level: u8, plug: &Plug) -> Picture {
    let (width, height) = (plug.width.into(), plug.height.into());
    Picture { width, height, pixels: vec![[level; 3]; usize::from(plug.width) * usize::from(plug.height)] }
}

/// A client of slmPy's protocol.
pub(crate) struct SlmPy(TcpStream);

impl SlmPy {
    pub(crate) fn connect(served: &Served) -> Self {
        let stream = TcpStream::connect(("127.0.0.1", served.slmpy)).expect("connect");
        stream.set_read_timeout(Some(PATIENCE)).expect("timeout");
        Self(stream)
    }

    pub(crate) fn send(&mut self, picture: &Picture) -> String {
        let levels: Vec<u8> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
        self.0.write_all(&(levels.len() as i32).to_le_bytes()).expect("length");
        self.0.write_all(&levels).expect("frame");
        let mut answer = [0; 4];
        let read = self.0.read(&mut answer).expect("answer");
        String::from_utf8_lossy(&answer[..read]).into_owned()
    }
}

fn slmpy(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let before = desk.capture_monitor(&desk.plug(OPERATOR));
    let served = Served::start(desk, PANEL, &["--idle", "77"]);
    desk.wait_for(&plug, &flat(77, &plug));
    let mut client = SlmPy::connect(&served);
    for seed in 0..20 {
        let picture = Picture::new(Pattern::Random(seed), 1920, 1080);
        assert_eq!(client.send(&picture), "done");
        // No waiting: the answer says that it is there.
        let seen = desk.capture_monitor(&plug);
        assert!(seen == picture, "answered before it was shown: {}", seen.difference(&picture));
    }
    assert!(desk.capture_monitor(&desk.plug(OPERATOR)) == before);
    let report = served.stop();
    assert_eq!(report["served"]["shown"], 20, "{report}");
    println!(
        "  slmPy, 1080p: frame ready to presented {:.1} ms on average, {:.1} ms at most, {} refreshes missed",
        report["served"]["latency"]["mean"].as_f64().expect("time") * 1e3,
        report["served"]["latency"]["longest"].as_f64().expect("time") * 1e3,
        report["served"]["missed"]
    );
    Ended::Passed
}

/// The levels of frame n at row y and column x, as both sides compute them.
pub(crate) fn levels(number: u32, count: u32) -> impl Iterator<Item = u32> {
    (0..count).map(move |i| i.wrapping_mul(2_654_435_761).wrapping_add(number.wrapping_mul(40_503)))
}

/// Santec's packing, by its manual: R = (v≫7 & 7)≪5, G = (v≫4 & 7)≪5, B = (v & 15)≪4.
pub(crate) fn santec(level: u32) -> [u8; 3] {
    [((level >> 7 & 7) << 5) as u8, ((level >> 4 & 7) << 5) as u8, ((level & 15) << 4) as u8]
}

/// Writes `panel.toml`: a phase panel whose signal is of 1920 × 1080 pixels.
pub(crate) fn profile(folder: &Path, pixels: &str, levels_for_2pi: u32, more: &str) {
    let size = if pixels.contains("width") { "" } else { "width = 1920\nheight = 1080\n" };
    let text = format!(
        "name = \"panel\"\nmaker = \"test\"\nkind = \"phase-lcos\"\n{size}{pixels}\npitch = \"8um\"\nfill_factor = 0.9\n\
         wavelengths = [\"632.8nm\"]\nrefresh = \"60Hz\"\n{more}\n\n[[response]]\nkind = \"linear\"\n\
         levels_for_2pi = {levels_for_2pi}\n"
    );
    std::fs::write(folder.join("panel.toml"), text).expect("profile");
}

/// Frame n of levels by the local protocol, in the words of its documentation and nothing else.
struct Local {
    stream: BufReader<std::os::unix::net::UnixStream>,
    buffer: std::fs::File,
}

impl Local {
    fn connect(socket: &Path) -> Self {
        let stream = std::os::unix::net::UnixStream::connect(socket).expect("connect");
        stream.set_read_timeout(Some(PATIENCE)).expect("timeout");
        let mut stream = BufReader::new(stream);
        let mut line = String::new();
        stream.read_line(&mut line).expect("greeting");
        let about: serde_json::Value = serde_json::from_str(&line).expect("greeting");
        let buffer =
            std::fs::File::options().write(true).open(about["buffer"].as_str().expect("path")).expect("buffer");
        Self { stream, buffer }
    }

    fn levels(&mut self, levels: &[u16]) -> serde_json::Value {
        use std::os::unix::fs::FileExt;
        let bytes: Vec<u8> = levels.iter().flat_map(|level| level.to_ne_bytes()).collect();
        self.buffer.write_all_at(&bytes, 0).expect("buffer");
        writeln!(self.stream.get_mut(), r#"{{"show": "levels", "dtype": "uint16"}}"#).expect("request");
        let mut line = String::new();
        self.stream.read_line(&mut line).expect("answer");
        serde_json::from_str(&line).expect("answer")
    }
}

fn packing(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let shown = |pixels: &str, bits: u32, more: &str, (columns, rows): (u32, u32)| {
        let folder = tempfile::tempdir().expect("folder");
        profile(folder.path(), pixels, 1 << bits, more);
        let served = Served::start_in(desk, folder, PANEL, &["--panel", "panel.toml"]);
        let sent: Vec<u16> = levels(7, columns * rows).map(|word| (word >> (32 - bits)) as u16).collect();
        let told = Local::connect(&served.socket()).levels(&sent);
        assert_eq!(told["number"], 1, "{told}");
        let seen = desk.capture_monitor(&plug);
        served.stop();
        (sent, seen)
    };
    let same = |name: &str, seen: &Picture, pixel: &dyn Fn(usize, usize) -> [u8; 3]| {
        for (i, seen) in seen.pixels.iter().enumerate() {
            assert_eq!(*seen, pixel(i % 1920, i / 1920), "{name}: column {}, row {}", i % 1920, i / 1920);
        }
    };
    let (sent, seen) = shown("bits = 10", 10, "[signal]\npacking = \"santec-60\"", (1920, 1080));
    same("ten bits", &seen, &|x, y| santec(sent[y * 1920 + x].into()));
    let pixels = "bits = 4\nwidth = 960\nheight = 540";
    let (sent, seen) = shown(pixels, 4, "[signal]\npacking = \"cells-2x2\"", (960, 540));
    let lit = |on: bool| [if on { 255 } else { 0 }; 3];
    same("four bits", &seen, &|x, y| lit(sent[y / 2 * 960 + x / 2] >> (x % 2 + 2 * (y % 2)) & 1 == 1));
    let (sent, seen) = shown("bits = 1", 1, "[signal]\npacking = \"gray1\"", (1920, 1080));
    same("one bit", &seen, &|x, y| lit(sent[y * 1920 + x] == 1));
    Ended::Passed
}

fn gone(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let idle = flat(77, &plug);
    let pictures = [1, 2].map(|seed| Picture::new(Pattern::Random(seed), 1920, 1080));
    for (policy, stays) in [("keep", &pictures[1]), ("idle", &idle)] {
        let served = Served::start(desk, PANEL, &["--idle", "77", "--on-client-gone", policy]);
        desk.wait_for(&plug, &idle);
        let (mut first, mut second) = (SlmPy::connect(&served), SlmPy::connect(&served));
        assert_eq!(first.send(&pictures[0]), "done");
        assert_eq!(second.send(&pictures[1]), "done");
        // The client that goes has nothing on the panel any more.
        drop(first);
        std::thread::sleep(Duration::from_millis(150));
        assert!(desk.capture_monitor(&plug) == pictures[1], "{policy}: another client's frame went");
        // As a killed one does it, in the middle of its next frame.
        second.0.write_all(&[0, 0xA4, 0x1F, 0, 9, 9, 9]).expect("half a frame");
        drop(second);
        std::thread::sleep(Duration::from_millis(150));
        desk.wait_for(&plug, stays);
        let mut third = SlmPy::connect(&served);
        assert_eq!(third.send(&pictures[0]), "done");
        assert!(desk.capture_monitor(&plug) == pictures[0]);
        let report = served.stop();
        assert_eq!(report["served"]["idled"], u32::from(policy == "idle"), "{report}");
    }
    // A program that is killed, and not only a connection that ends.
    let served = Served::start(desk, PANEL, &["--idle", "77", "--on-client-gone", "idle"]);
    let text = "
import sys, numpy, holodrive
slm = holodrive.SLM(path=sys.argv[1])
for line in sys.stdin:
    print('>', slm.show(numpy.full(slm.shape, int(line))).number, flush=True)
";
    let socket = served.socket().display().to_string();
    let mut client = match Python::start("numpy", text, &[&socket]) {
        Ok(client) => client,
        Err(ended) => return ended,
    };
    client.ask("200");
    assert!(desk.capture_monitor(&plug) == flat(200, &plug));
    client.process.kill().expect("kill");
    desk.wait_for(&plug, &idle);
    assert_eq!(served.stop()["served"]["idled"], 1);
    Ended::Passed
}

fn bad_clients(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let served = Served::start(desk, PANEL, &[]);
    let mut good = SlmPy::connect(&served);
    let mut still = |seed| {
        let picture = Picture::new(Pattern::Random(seed), 1920, 1080);
        let start = Instant::now();
        assert_eq!(good.send(&picture), "done");
        let taken = start.elapsed();
        assert!(desk.capture_monitor(&plug) == picture, "another client's frame is on the panel");
        taken
    };
    let alone = still(0);
    let mut crowd = Vec::new();
    for port in [served.slmsuite, served.slmpy] {
        for garbage in [&b"GET / HTTP/1.1\r\n\r\n"[..], &[0xFF; 5000], b"%7B%22name", b"\0\0\x10\0abc", b""] {
            let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("connect");
            let _ = stream.write_all(garbage);
            // Half of them stay, silent.
            if crowd.len() % 2 == 0 {
                crowd.push(stream);
            }
        }
    }
    let mut short = Local::connect(&served.socket());
    short.buffer.set_len(100).expect("cut");
    writeln!(short.stream.get_mut(), r#"{{"show": "phase", "dtype": "float64"}}"#).expect("request");
    let mut endless = Local::connect(&served.socket());
    let _ = endless.stream.get_mut().write_all(&vec![b'{'; 100_000]);
    let besides = (1..4).map(still).max().expect("times");
    println!(
        "  a frame among bad clients: {:.0} ms, alone {:.0} ms",
        besides.as_secs_f64() * 1e3,
        alone.as_secs_f64() * 1e3
    );
    // Nobody waited for anybody's patience (5 s).
    assert!(besides < Duration::from_secs(4), "{besides:?}");
    let report = served.stop();
    assert_eq!((&report["served"]["shown"], &report["served"]["failed"]), (&4.into(), &0.into()), "{report}");
    Ended::Passed
}

fn unplugged(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let operator = desk.plug(OPERATOR);
    let before = desk.capture_monitor(&operator);
    let served = Served::start(desk, PANEL, &[]);
    let mut client = Local::connect(&served.socket());
    let picture = |number| {
        let pixels = levels(number, 1920 * 1080).map(|word| [(word >> 24) as u8; 3]).collect();
        Picture { width: 1920, height: 1080, pixels }
    };
    let sent = |number| -> Vec<u16> { levels(number, 1920 * 1080).map(|word| (word >> 24) as u16).collect() };
    assert_eq!(client.levels(&sent(1))["number"], 1);
    desk.pull(&plug);
    desk.wait_until("the window goes", || desk.capture_monitor(&plug) != picture(1));
    let told = client.levels(&sent(2));
    assert!(told["error"].as_str().is_some_and(|why| why.contains("DUMMY1 is gone")), "{told}");
    assert!(desk.capture_monitor(&operator) == before, "the operator's monitor was touched");
    desk.put_back(&plug);
    // What was there is there again; what was refused does not come late.
    desk.wait_for(&plug, &picture(1));
    assert_eq!(client.levels(&sent(3))["error"], serde_json::Value::Null);
    assert!(desk.capture_monitor(&plug) == picture(3));
    let report = served.stop();
    assert_eq!((&report["served"]["shown"], &report["served"]["failed"]), (&2.into(), &1.into()), "{report}");
    Ended::Passed
}

fn trigger(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let served = Served::start(desk, PANEL, &["--idle", "77", "--trigger-patch", "bottom-left,40"]);
    let mut client = SlmPy::connect(&served);
    let marked = |mut picture: Picture, level: u8| {
        for row in picture.pixels.chunks_exact_mut(1920).skip(1040) {
            row[..40].fill([level; 3]);
        }
        picture
    };
    desk.wait_for(&plug, &marked(flat(77, &plug), 0));
    for number in 1..6 {
        let picture = Picture::new(Pattern::Random(number), 1920, 1080);
        assert_eq!(client.send(&picture), "done");
        let wanted = marked(picture, if number % 2 == 1 { 255 } else { 0 });
        let seen = desk.capture_monitor(&plug);
        assert!(seen == wanted, "frame {number}: {}", seen.difference(&wanted));
    }
    served.stop();
    Ended::Passed
}

fn region(desk: &Desk) -> Ended {
    let (left, right) = (desk.plug(PANEL), desk.plug(ODD_PANEL));
    // The rows that both monitors show: the second stands 100 rows lower.
    let (x, y) = (left.x, right.y);
    let (width, height) = (left.width + right.width, right.height);
    let name = format!("region:{x},{y},{width},{height}");
    let folder = tempfile::tempdir().expect("folder");
    profile(folder.path(), &format!("bits = 8\nwidth = {width}\nheight = {height}"), 256, "");
    let beside = |desk: &Desk| {
        let operator = desk.plug(OPERATOR);
        let above = desk.capture(x, 0, left.width, y as u16);
        let below = desk.capture(x, y + height as i16, left.width, left.height - y as u16 - height);
        [desk.capture_monitor(&operator), above, below]
    };
    let before = beside(desk);
    let served = Served::start_in(desk, folder, &name, &["--panel", "panel.toml", "--idle", "5"]);
    let mut client = SlmPy::connect(&served);
    for seed in 0..2 {
        let picture = Picture::new(Pattern::Random(seed), width.into(), height.into());
        assert_eq!(client.send(&picture), "done");
        let seen = desk.capture(x, y, width, height);
        assert!(seen == picture, "{}", seen.difference(&picture));
    }
    assert!(beside(desk) == before, "something beside the region was touched");
    // One of its two monitors is away.
    desk.pull(&right);
    let last = Picture::new(Pattern::Random(1), width.into(), height.into());
    desk.wait_until("the window goes", || desk.capture(x, y, width, height) != last);
    assert_eq!(client.send(&last), "err");
    desk.put_back(&right);
    desk.wait_until("the window is back", || desk.capture(x, y, width, height) == last);
    served.stop();
    // The rectangle about both has parts that nobody shows.
    let folder = tempfile::tempdir().expect("folder");
    let both = format!("{PANEL}+{ODD_PANEL}");
    let out = program(desk, folder.path()).args(["serve", "--monitor", &both]).output().expect("runs");
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(2) && said.contains("no monitor shows 3200,0"), "{said}");
    Ended::Passed
}

fn refused(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    let taken = Served::start(desk, PANEL, &[]);
    let port = taken.slmsuite.to_string();
    let socket = taken.socket().display().to_string();
    let operator = desk.capture_monitor(&desk.plug(OPERATOR));
    let odd = desk.capture_monitor(&desk.plug(ODD_PANEL));
    for (flags, word) in [
        (&["--monitor", "HDMI-7"][..], "HDMI-7"),
        // Of another size than the panel.
        (&["--monitor", OPERATOR, "--slmsuite", "0"], "1920"),
        (&["--monitor", ODD_PANEL, "--slmsuite", &port], "cannot listen"),
        (&["--monitor", ODD_PANEL, "--local", &socket], "another server"),
        (&["--monitor", PANEL, "--slmsuite", "0", "-o", "frames"], "--output"),
        (&["--monitor", PANEL, "--slmsuite", "0", "--trigger-patch", "middle,3"], "trigger-patch"),
        (&["--monitor", "region:1,2,3", "--slmsuite", "0"], "region"),
    ] {
        let out = program(desk, folder.path()).arg("serve").args(flags).output().expect("runs");
        let said = String::from_utf8_lossy(&out.stderr);
        let lines: Vec<&str> = said.lines().filter(|line| !line.starts_with("warning:")).collect();
        assert_eq!(out.status.code(), Some(2), "{flags:?}: {said}");
        assert!(lines.len() == 1 && lines[0].contains(word), "{flags:?}: {said}");
        assert!(out.stdout.is_empty(), "{flags:?}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("list").count(), 0);
    assert!(desk.capture_monitor(&desk.plug(OPERATOR)) == operator, "the operator's monitor was touched");
    assert!(desk.capture_monitor(&desk.plug(ODD_PANEL)) == odd, "a monitor was touched");
    taken.stop();
    Ended::Passed
}
