//! Frames from other programs on the panel: `holodrive serve` as a user starts it, and the clients themselves, unchanged.
//!
//! Python's clients run with the Python of `HOLODRIVE_PYTHON`, else with `python3`: slmsuite's own where slmsuite is
//! installed, holodrive's where NumPy is.

use crate::desk::{Desk, PATIENCE, Plug};
use crate::frames::{Pattern, Picture};
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

pub(crate) const CASES: &[Case] = &[
    ("what_slmpy_sends_is_on_the_panel_when_it_is_answered", slmpy),
    ("what_slmsuites_own_client_sends_is_on_the_panel", slmsuite),
    ("what_python_shows_is_on_the_panel_as_numpy_computes_it", python),
    ("levels_of_ten_four_and_one_bit_are_packed_as_the_profile_says", packing),
    ("a_client_that_dies_leaves_its_last_frame_or_the_idle_one", gone),
    ("bad_clients_disturb_neither_the_panel_nor_another_client", bad_clients),
    ("clients_are_told_when_the_monitor_is_away_and_served_when_it_is_back", unplugged),
    ("two_panels_are_served_at_once_and_found_by_name", two),
    ("a_corner_toggles_with_every_frame_and_the_rest_stays_exact", trigger),
    ("one_panel_spans_two_monitors_and_nothing_beside_them", region),
    ("serve_refuses_what_it_cannot_do", refused),
];

/// `holodrive serve` at work on the panel's monitor.
pub(crate) struct Served {
    process: Child,
    said: BufReader<ChildStdout>,
    folder: tempfile::TempDir,
    slmsuite: u16,
    slmpy: u16,
}

impl Served {
    /// Starts it with all protocols on free ports, a level of 77 on the idle panel, and `more` flags.
    fn start(desk: &Desk, monitor: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("folder");
        Self::start_in(desk, folder, monitor, more)
    }

    fn start_in(desk: &Desk, folder: tempfile::TempDir, monitor: &str, more: &[&str]) -> Self {
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
        let port = |name: &str| {
            let address = told["serving"][name].as_str().expect("address");
            address.strip_prefix("127.0.0.1:").expect("loopback").parse().expect("port")
        };
        assert_eq!(told["serving"]["on"], monitor, "{told}");
        Self { slmsuite: port("slmsuite"), slmpy: port("slmpy"), process, said, folder }
    }

    fn socket(&self) -> PathBuf {
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

fn program(desk: &Desk, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_holodrive"));
    command.current_dir(folder).env("DISPLAY", desk.display()).env_remove("WAYLAND_DISPLAY");
    command
}

fn flat(level: u8, plug: &Plug) -> Picture {
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

/// A Python program that answers each line of its input with one that begins with `>`.
struct Python {
    process: Child,
    said: std::io::Lines<BufReader<ChildStdout>>,
}

impl Python {
    /// Starts it, if that Python has `module`; else says what is missing.
    fn start(module: &str, text: &str, arguments: &[&str]) -> Result<Self, Ended> {
        let python = std::env::var("HOLODRIVE_PYTHON").unwrap_or_else(|_| "python3".into());
        let look = format!("import importlib.util, sys; sys.exit(importlib.util.find_spec('{module}') is None)");
        let probe = Command::new(&python).args(["-c", &look]).stderr(Stdio::null()).status();
        if !probe.is_ok_and(|status| status.success()) {
            assert!(std::env::var_os("HOLODRIVE_PYTHON").is_none(), "{python} has no {module}");
            return Err(Ended::Optional(format!("{python} has no {module}")));
        }
        let mut command = Command::new(&python);
        command.env("PYTHONPATH", Path::new(env!("CARGO_MANIFEST_DIR")).join("src/serve"));
        // Nothing is to be written into the source folder.
        command.env("PYTHONDONTWRITEBYTECODE", "1").arg("-c").arg(text).args(arguments);
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python");
        let said = BufReader::new(process.stdout.take().expect("output")).lines();
        Ok(Self { process, said })
    }

    /// slmsuite prints lines of its own.
    fn answer(&mut self) -> String {
        let line = self.said.by_ref().map_while(Result::ok).find_map(|line| Some(line.strip_prefix('>')?.to_owned()));
        line.expect("the Python client failed")
    }

    fn ask(&mut self, line: &str) -> String {
        writeln!(self.process.stdin.as_mut().expect("input"), "{line}").expect("client");
        self.answer()
    }

    fn end(mut self) {
        drop(self.process.stdin.take());
        assert!(self.process.wait().expect("client").success());
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The levels of frame n at row y and column x, as both sides compute them.
fn levels(number: u32, count: u32) -> impl Iterator<Item = u32> {
    (0..count).map(move |i| i.wrapping_mul(2_654_435_761).wrapping_add(number.wrapping_mul(40_503)))
}

/// "connect PORT BITS" makes a `RemoteSLM`; a number n sends frame n through it; "phase" sends all phases of a turn.
const SLMSUITE: &str = "
import sys
import numpy as np
from slmsuite.hardware.slms.remote import RemoteSLM
i = np.arange(1920 * 1080, dtype=np.uint32)
for line in sys.stdin:
    if line.startswith('connect'):
        port, bits = (int(word) for word in line.split()[1:])
        slm = RemoteSLM('panel', host='127.0.0.1', port=port)
        assert slm.shape == (1080, 1920), slm.shape
        assert slm.bitdepth == bits
        assert abs(slm.wav_um - 0.6328) < 1e-9
        assert abs(slm.phase_scaling - 1) < 1e-9, slm.phase_scaling
    elif line.startswith('phase'):
        slm.set_phase(2 * np.pi / 256 * (i.reshape(1080, 1920) % 256).astype(float), settle=False)
    else:
        n = np.uint32(int(line))
        levels = (i * np.uint32(2654435761) + n * np.uint32(40503)) >> np.uint32(32 - bits)
        slm.set_phase(levels.astype(slm.display.dtype).reshape(1080, 1920), settle=False)
    print('>sent', flush=True)
";

fn slmsuite(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let served = Served::start(desk, PANEL, &[]);
    let mut client = match Python::start("slmsuite", SLMSUITE, &[]) {
        Ok(client) => client,
        Err(ended) => return ended,
    };
    client.ask(&format!("connect {} 8", served.slmsuite));
    let picture = |level: &dyn Fn(u32) -> [u8; 3], number| {
        let pixels = levels(number, 1920 * 1080).map(level).collect();
        Picture { width: 1920, height: 1080, pixels }
    };
    for number in 0..5 {
        assert_eq!(client.ask(&number.to_string()), "sent");
        let (seen, wanted) = (desk.capture_monitor(&plug), picture(&|word| [(word >> 24) as u8; 3], number));
        assert!(seen == wanted, "not what Python sent: {}", seen.difference(&wanted));
    }
    let report = served.stop();
    assert_eq!((&report["served"]["shown"], &report["served"]["failed"]), (&5.into(), &0.into()), "{report}");
    // slmsuite's levels as phases: the panel's own curve, which rises, makes levels of them.
    let served = Served::start(desk, PANEL, &["--levels", "calibrated"]);
    client.ask(&format!("connect {} 8", served.slmsuite));
    client.ask("phase");
    let pixels = (0..1920 * 1080).map(|i| [(i % 256) as u8; 3]).collect();
    let (seen, wanted) = (desk.capture_monitor(&plug), Picture { width: 1920, height: 1080, pixels });
    assert!(seen == wanted, "not the phases that Python meant: {}", seen.difference(&wanted));
    served.stop();
    // Ten bits in a Santec head's colours.
    let folder = tempfile::tempdir().expect("folder");
    profile(folder.path(), "bits = 10", 1024, "[signal]\npacking = \"santec-60\"");
    let served = Served::start_in(desk, folder, PANEL, &["--panel", "panel.toml"]);
    client.ask(&format!("connect {} 10", served.slmsuite));
    client.ask("3");
    let (seen, wanted) = (desk.capture_monitor(&plug), picture(&|word| santec(word >> 22), 3));
    assert!(seen == wanted, "ten bits are packed otherwise: {}", seen.difference(&wanted));
    client.end();
    served.stop();
    Ended::Passed
}

/// Santec's packing, by its manual: R = (v≫7 & 7)≪5, G = (v≫4 & 7)≪5, B = (v & 15)≪4.
fn santec(level: u32) -> [u8; 3] {
    [((level >> 7 & 7) << 5) as u8, ((level >> 4 & 7) << 5) as u8, ((level & 15) << 4) as u8]
}

/// Writes `panel.toml`: a phase panel whose signal is of 1920 × 1080 pixels.
fn profile(folder: &Path, pixels: &str, levels_for_2pi: u32, more: &str) {
    let size = if pixels.contains("width") { "" } else { "width = 1920\nheight = 1080\n" };
    let text = format!(
        "name = \"panel\"\nmaker = \"test\"\nkind = \"phase-lcos\"\n{size}{pixels}\npitch = \"8um\"\nfill_factor = 0.9\n\
         wavelengths = [\"632.8nm\"]\nrefresh = \"60Hz\"\n{more}\n\n[[response]]\nkind = \"linear\"\n\
         levels_for_2pi = {levels_for_2pi}\n"
    );
    std::fs::write(folder.join("panel.toml"), text).expect("profile");
}

/// Shows what each line asks for by holodrive's own module; writes the levels that it expects, as bytes, to a file.
///
/// Phases are made of 96 values, and the correction of 16, so that the nearest of 256 levels on the circle is found for
/// each sum by trying all.
const LOCAL: &str = "
import json, sys, time
import numpy as np
import holodrive
socket, expected, curve, correction = sys.argv[1:5]
slm = holodrive.SLM(path=socket)
assert slm.shape == (1080, 1920) and slm.bits == 8 and slm.modulation == 'phase' and slm.name == 'panel'
assert abs(slm.wavelength - 632.8e-9) < 1e-15 and np.allclose(slm.pixel_pitch, 8e-6)
random = np.random.default_rng(26)
# Unwrapped phase of each level, as the profile's polynomial of level/255 says.
level_phase = np.polyval([float(c) for c in curve.split(',')][::-1], np.arange(256) / 255)
bend = np.load(correction).astype(float)
def nearest(values):
    wish = values[None, :, None] + np.unique(bend)[:, None, None]
    miss = np.abs((level_phase - wish + np.pi) % (2 * np.pi) - np.pi)
    order = np.sort(miss, axis=-1)
    # Whatever lies nearly half-way between two levels is a matter of rounding.
    clear = (order[..., 1] - order[..., 0]).min(axis=0) > 1e-4
    return np.argmin(miss, axis=-1), clear
def phases(turns):
    values = random.uniform(0, 2 * np.pi, 4000)
    table, clear = nearest(values)
    values, table = values[clear][:96], table[:, clear][:, :96]
    which = random.integers(0, 96, slm.shape)
    levels = table[np.searchsorted(np.unique(bend), bend), which]
    return values[which] + 2 * np.pi * (turns * random.integers(-8, 8, slm.shape)), levels
for line in sys.stdin:
    what = line.strip()
    try:
        if what == 'float64':
            array, levels = phases(1000)
        elif what == 'float32':
            array, levels = phases(0)
            array = array.astype(np.float32)
        elif what == 'levels':
            array = levels = random.integers(0, 256, slm.shape)
        elif what == 'turned':
            # Neither contiguous nor in rows.
            array = levels = random.integers(0, 256, slm.shape[::-1], dtype=np.uint8).T
        elif what == 'latency':
            array, levels = phases(0)
            array = array.astype(np.float32)
            taken, calls = [], []
            for _ in range(12):
                start = time.monotonic()
                shown = slm.show(array)
                calls.append(time.monotonic() - start)
                taken.append(shown.latency)
            print('>' + json.dumps([np.median(calls), np.median(taken), shown.missed]), flush=True)
            continue
        else:
            array = eval(what)
            levels = None
        before = time.monotonic()
        shown = slm.show(array)
        after = time.monotonic()
        assert before <= shown.time <= after, (before, shown, after)
        np.asarray(levels).astype(np.uint8).tofile(expected)
        print('>' + json.dumps(shown._asdict()), flush=True)
    except (holodrive.Error, ValueError) as error:
        print('>' + type(error).__name__ + ': ' + str(error), flush=True)
";

fn python(desk: &Desk) -> Ended {
    let plug = desk.plug(PANEL);
    let folder = tempfile::tempdir().expect("folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    // A bent curve of 1.94π in all, and a correction of sixteen values.
    let curve = "0.05,5.0,1.5,-0.4";
    let text = format!(
        "name = \"panel\"\nmaker = \"test\"\nkind = \"phase-lcos\"\nwidth = 1920\nheight = 1080\nbits = 8\npitch = \"8um\"\n\
         fill_factor = 0.9\nwavelengths = [\"632.8nm\"]\nrefresh = \"60Hz\"\n\n[[response]]\nkind = \"polynomial\"\n\
         unit = \"rad\"\ncoefficients = [{curve}]\n\n[[correction]]\nfile = \"bend.npy\"\nwavelength = \"632.8nm\"\n"
    );
    std::fs::write(folder.path().join("panel.toml"), text).expect("profile");
    let bend: Vec<f32> = (0..1920 * 1080).map(|i| ((i % 1920 / 100 + i / 1920 / 90) % 16) as f32 * 0.37).collect();
    holodrive::field::npy::write_intensity(&folder.path().join("bend.npy"), 1920, 1080, &bend).expect("correction");
    let (expected, bend) = (path("expected"), path("bend.npy"));
    let served = Served::start_in(desk, folder, PANEL, &["--panel", "panel.toml"]);
    let socket = served.socket().display().to_string();
    let mut client = match Python::start("numpy", LOCAL, &[&socket, &expected, curve, &bend]) {
        Ok(client) => client,
        Err(ended) => return ended,
    };
    for (count, what) in ["float64", "float32", "levels", "turned"].iter().enumerate() {
        let told = client.ask(what);
        let shown: serde_json::Value = serde_json::from_str(&told).unwrap_or_else(|_| panic!("{what}: {told}"));
        assert_eq!(shown["number"], count + 1, "{what}: {told}");
        let pixels = std::fs::read(&expected).expect("levels").into_iter().map(|level| [level; 3]).collect();
        let (seen, wanted) = (desk.capture_monitor(&plug), Picture { width: 1920, height: 1080, pixels });
        assert!(seen == wanted, "{what}: not what NumPy computed: {}", seen.difference(&wanted));
    }
    let last = desk.capture_monitor(&plug);
    for (wrong, word) in [
        ("np.zeros((1080, 1919))", "ValueError: the array is (1080, 1919)"),
        ("np.full(slm.shape, 256)", "ValueError: levels are 0 … 255"),
        ("np.full(slm.shape, -1)", "ValueError: levels"),
        ("np.zeros(slm.shape, bool)", "ValueError"),
        ("np.zeros(slm.shape, complex)", "ValueError"),
        ("np.full(slm.shape, np.nan)", "Error: pattern: the value at column 0, row 0 is not finite"),
    ] {
        let told = client.ask(wrong);
        assert!(told.starts_with(word), "{wrong}: {told}");
    }
    assert!(desk.capture_monitor(&plug) == last, "a refused array was shown");
    let told = client.ask("latency");
    let [call, flip, _]: [f64; 3] = serde_json::from_str(&told).expect("times");
    println!(
        "  Python, 1080p phases through curve and correction: {:.1} ms from request to flip, {:.1} ms a call (medians)",
        flip * 1e3,
        call * 1e3
    );
    client.end();
    let report = served.stop();
    assert_eq!((&report["served"]["shown"], &report["served"]["failed"]), (&16.into(), &1.into()), "{report}");
    Ended::Passed
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

/// Shows flat levels on both panels, which it finds in the usual place.
const TWO: &str = "
import sys, numpy, holodrive
for line in sys.stdin:
    try:
        print('>', holodrive.SLM(), flush=True)
    except holodrive.Error as error:
        print('>' + str(error), flush=True)
    with holodrive.SLM('left') as left, holodrive.SLM('right') as right:
        assert left.shape == (1080, 1920) and right.shape == (769, 1367)
        numbers = [left.show(numpy.full(left.shape, 10)).number, right.show(numpy.full(right.shape, 20)).number]
        print('>' + str(numbers), flush=True)
    try:
        holodrive.SLM('middle')
    except holodrive.Error as error:
        print('>' + str(error), flush=True)
    try:
        left.show(numpy.zeros(left.shape))
    except holodrive.Error as error:
        print('>' + str(error), flush=True)
";

fn two(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    let (left, right) = (desk.plug(PANEL), desk.plug(ODD_PANEL));
    profile(folder.path(), "bits = 8\nwidth = 1367\nheight = 769", 256, "");
    let runtime = folder.path().display().to_string();
    let start = |monitor: &str, name: &str, panel: &str| {
        let mut command = program(desk, folder.path());
        command.args(["serve", "--local", "--monitor", monitor, "--name", name, "--panel", panel]);
        let process = command.env("XDG_RUNTIME_DIR", &runtime).stdout(Stdio::piped()).spawn().expect("runs");
        let mut killed = Killed(process);
        let output = killed.0.stdout.as_mut().expect("output");
        BufReader::new(output).read_line(&mut String::new()).expect("first line");
        killed
    };
    let _served = [start(PANEL, "left", "generic"), start(ODD_PANEL, "right", "panel.toml")];
    let environment = format!("import os; os.environ['XDG_RUNTIME_DIR'] = '{runtime}'\n{TWO}");
    let mut client = match Python::start("numpy", &environment, &[]) {
        Ok(client) => client,
        Err(ended) => return ended,
    };
    assert_eq!(client.ask("go"), "more than one panel is served; name one of: left, right");
    assert_eq!(client.answer(), "[1, 1]");
    assert!(desk.capture_monitor(&left) == flat(10, &left));
    assert!(desk.capture_monitor(&right) == flat(20, &right));
    let told = client.answer();
    assert!(told.starts_with("no panel is served at") && told.contains("middle.sock"), "{told}");
    assert_eq!(client.answer(), "this SLM is closed");
    client.end();
    Ended::Passed
}

/// A program that ends with the test.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
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
