//! Wine with a Windows of its own, and the program in it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const TARGET: &str = "x86_64-pc-windows-gnu";
const COMPILER: &str = "x86_64-w64-mingw32-gcc";
/// Where distributions put wine.
const PROGRAMS: [&str; 4] = ["/usr/lib/wine/wine64", "/usr/bin/wine64", "/usr/bin/wine", "/opt/wine-stable/bin/wine64"];

/// A Windows that ends with the test.
pub(crate) struct Wine {
    program: PathBuf,
    folder: tempfile::TempDir,
}

impl Wine {
    /// Builds the program and sets a Windows up; the reason when this machine cannot.
    pub(crate) fn start() -> Result<Self, String> {
        let program = PROGRAMS.iter().map(PathBuf::from).find(|path| path.exists()).ok_or("wine is not installed")?;
        let library = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
        let library = library.map_err(|e| format!("rustc: {e}"))?;
        if !Path::new(String::from_utf8_lossy(&library.stdout).trim()).is_dir() {
            return Err(format!("Rust's standard library for {TARGET} is not installed"));
        }
        if Command::new(COMPILER).arg("--version").stdout(Stdio::null()).status().is_err() {
            return Err(format!("{COMPILER} is not installed"));
        }
        let wine = Self { program, folder: tempfile::tempdir().map_err(|e| e.to_string())? };
        wine.build();
        let set_up = wine.run("wineboot").arg("-i").stdout(Stdio::null()).stderr(Stdio::null()).status();
        match set_up.map_err(|e| format!("wine: {e}"))?.success() {
            true => Ok(wine),
            false => Err("wine cannot set a Windows up".into()),
        }
    }

    /// The program without a warning, and beside it what wine lacks and what presses Ctrl-C.
    fn build(&self) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let built = Command::new(env!("CARGO"))
            .args(["build", "--release", "--locked", "--target", TARGET, "--bin", "holodrive"])
            .current_dir(root)
            .output()
            .expect("cargo");
        let said = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success() && !said.contains("warning:"), "{said}");
        let folder = Path::new(env!("CARGO_BIN_EXE_holodrive")).ancestors().nth(2).expect("target folder");
        let made = folder.join(TARGET).join("release/holodrive.exe");
        std::fs::copy(&made, self.folder.path().join("holodrive.exe")).expect("copy");
        for (source, flags, name) in [
            ("bcryptprimitives.c", &["-shared"][..], "bcryptprimitives.dll"),
            ("interrupt.c", &["-Wall", "-Werror"], "interrupt.exe"),
        ] {
            let compiled = Command::new(COMPILER)
                .args(["-O2", "-o"])
                .arg(self.folder.path().join(name))
                .arg(root.join("tests/windows").join(source))
                .args(flags)
                .arg("-ladvapi32")
                .status();
            assert!(compiled.expect("compiler").success(), "{source}");
        }
        let length = std::fs::metadata(&made).expect("program").len();
        println!("holodrive.exe: {:.1} MB", length as f64 / 1e6);
    }

    /// A program of that Windows: without a display and without wine's own remarks.
    pub(crate) fn run(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(&self.program);
        command
            .arg(program)
            .env("WINEPREFIX", self.folder.path().join("prefix"))
            .env("WINEDEBUG", "-all")
            .env("WINEDLLOVERRIDES", "mscoree,mshtml=")
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY");
        command
    }

    /// The program for Windows in `folder`.
    pub(crate) fn holodrive(&self, folder: &Path, arguments: &[&str]) -> Command {
        let mut command = self.run(self.folder.path().join("holodrive.exe"));
        command.args(arguments).current_dir(folder);
        command
    }

    /// The program for Windows, which is interrupted as by Ctrl-C after some time [ms].
    pub(crate) fn interrupted(&self, folder: &Path, after: u32, arguments: &[&str]) -> Output {
        let mut command = self.run(self.folder.path().join("interrupt.exe"));
        // Wine shows the files of this system as drive Z.
        let program = format!("Z:{}", self.folder.path().join("holodrive.exe").display()).replace('/', "\\");
        command.arg(after.to_string()).arg(program).args(arguments).current_dir(folder).output().expect("runs")
    }

    /// Ends all programs of that Windows, so that the next one sees the display that it is given.
    pub(crate) fn end_all(&self) {
        let server = ["/usr/lib/wine/wineserver64", "/usr/lib/wine/wineserver", "/usr/bin/wineserver"];
        for server in server.iter().filter(|path| Path::new(path).exists()).take(1) {
            // Without one there is nothing to end.
            let _ =
                Command::new(server).args(["-k", "-w"]).env("WINEPREFIX", self.folder.path().join("prefix")).status();
        }
    }
}

impl Drop for Wine {
    fn drop(&mut self) {
        self.end_all();
    }
}
