//! Clients in Python on a served panel: slmsuite's own, unchanged, where slmsuite is installed, and holodrive's module where
//! NumPy is. They run with the Python of `HOLODRIVE_PYTHON`, else with `python3`.

use crate::desk::Desk;
use crate::frames::Picture;
use crate::server::{ODD_PANEL, PANEL};
use crate::serving::{Served, flat, levels, profile, program, santec};
use crate::{Case, Ended};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

pub(crate) const CASES: &[Case] = &[
    ("what_slmsuites_own_client_sends_is_on_the_panel", slmsuite),
    ("what_python_shows_is_on_the_panel_as_numpy_computes_it", python),
    ("two_panels_are_served_at_once_and_found_by_name", two),
];

/// A Python program that answers each line of its input with one that begins with `>`.
pub(crate) struct Python {
    pub(crate) process: Child,
    said: std::io::Lines<BufReader<ChildStdout>>,
}

impl Python {
    /// Starts it, if that Python has `module`; else says what is missing.
    pub(crate) fn start(module: &str, text: &str, arguments: &[&str]) -> Result<Self, Ended> {
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

    pub(crate) fn ask(&mut self, line: &str) -> String {
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
