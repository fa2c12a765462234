//! A real X server with three dummy monitors, all of our own: no screen, keyboard or session of this machine is touched.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

/// The operator's monitor.
pub(crate) const OPERATOR: &str = "DUMMY0";
/// The panel: 1920×1080.
pub(crate) const PANEL: &str = "DUMMY1";
/// A second panel, of odd size.
pub(crate) const ODD_PANEL: &str = "DUMMY2";

/// Blanking is off; nothing is taken from the machine's own devices. The virtual size leaves room for other places.
const CONFIGURATION: &str = r#"
Section "ServerFlags"
  Option "DontVTSwitch" "true"
  Option "AutoAddDevices" "false"
  Option "AutoEnableDevices" "false"
  Option "AutoAddGPU" "false"
  Option "AutoBindGPU" "false"
  Option "BlankTime" "0"
  Option "StandbyTime" "0"
  Option "SuspendTime" "0"
  Option "OffTime" "0"
EndSection
Section "Monitor"
  Identifier "Operator"
  HorizSync 5.0 - 1000.0
  VertRefresh 5.0 - 500.0
  Modeline "operator" 74.25 1280 1390 1430 1650 720 725 730 750 +hsync +vsync
  Option "PreferredMode" "operator"
  Option "Primary" "true"
  Option "Enable" "true"
EndSection
Section "Monitor"
  Identifier "Panel"
  HorizSync 5.0 - 1000.0
  VertRefresh 5.0 - 500.0
  Modeline "panel" 148.5 1920 2008 2052 2200 1080 1084 1089 1125 +hsync +vsync
  Option "PreferredMode" "panel"
  Option "Position" "1280 0"
  Option "Enable" "true"
EndSection
Section "Monitor"
  Identifier "OddPanel"
  HorizSync 5.0 - 1000.0
  VertRefresh 5.0 - 500.0
  Modeline "odd" 85.0 1367 1430 1480 1800 769 772 778 798 +hsync +vsync
  Option "PreferredMode" "odd"
  Option "Position" "3200 100"
  Option "Enable" "true"
EndSection
Section "Device"
  Identifier "DummyCard"
  Driver "dummy"
  VideoRam 256000
  Option "Monitor-DUMMY0" "Operator"
  Option "Monitor-DUMMY1" "Panel"
  Option "Monitor-DUMMY2" "OddPanel"
EndSection
Section "Screen"
  Identifier "DummyScreen"
  Device "DummyCard"
  DefaultDepth 24
  SubSection "Display"
    Depth 24
    Virtual 8192 4320
  EndSubSection
EndSection
"#;

/// The server, ended when dropped. It also ends by itself when its last client is gone.
pub(crate) struct Server {
    process: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Server {
    /// Starts it on a free display number; the reason when this machine cannot.
    pub(crate) fn start() -> Result<Self, String> {
        let program = ["/usr/lib/xorg/Xorg", "/usr/libexec/Xorg", "/usr/bin/Xorg"]
            .iter()
            .map(PathBuf::from)
            .find(|path| path.exists())
            .ok_or("Xorg is not installed")?;
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let configuration = folder.path().join("xorg.conf");
        std::fs::write(&configuration, CONFIGURATION).map_err(|e| e.to_string())?;
        let log = folder.path().join("Xorg.log");
        let mut process = Command::new(program)
            .args(["-displayfd", "1", "-terminate", "-nolisten", "tcp", "-novtswitch", "-sharevts"])
            .arg("-config")
            .arg(&configuration)
            .arg("-logfile")
            .arg(&log)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("Xorg cannot be started: {e}"))?;
        let output = process.stdout.take().ok_or("Xorg has no output")?;
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let read = BufReader::new(output).read_line(&mut line);
            let _ = sender.send(read.map(|_| line));
        });
        let number = receiver.recv_timeout(Duration::from_secs(30));
        let mut server = Self { process, display: String::new(), folder };
        match number {
            Ok(Ok(line)) if line.trim().parse::<u32>().is_ok() => {
                server.display = format!(":{}", line.trim());
                Ok(server)
            }
            _ => Err(format!("Xorg did not come up: {}", server.errors())),
        }
    }

    /// The value for `DISPLAY`.
    pub(crate) fn display(&self) -> &str {
        &self.display
    }

    fn errors(&self) -> String {
        let log = std::fs::read_to_string(self.folder.path().join("Xorg.log")).unwrap_or_default();
        let faults: Vec<&str> = log.lines().filter(|line| line.contains("(EE)")).collect();
        if faults.is_empty() {
            "no log (a user who is not root may not give it a configuration)".into()
        } else {
            faults.join(" ")
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Asked politely it removes its lock and socket.
        let asked = Command::new("kill").arg(self.process.id().to_string()).status();
        if !asked.is_ok_and(|status| status.success()) {
            let _ = self.process.kill();
        }
        let _ = self.process.wait();
    }
}
