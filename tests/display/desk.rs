//! What a test does to the X server and sees of it: screen contents, cursor, cables pulled and put back.

use crate::frames::Picture;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::randr::{self, ConnectionExt as _};
use x11rb::protocol::screensaver::{self, ConnectionExt as _};
use x11rb::protocol::xfixes::ConnectionExt as _;
use x11rb::protocol::xproto::{
    AtomEnum, Blanking, ConnectionExt as _, CreateWindowAux, Exposures, ImageFormat, PropMode, ScreenSaver, StackMode,
    WindowClass,
};
use x11rb::rust_connection::RustConnection;

/// Generous: the machine may be busy, and software Vulkan compiles its shaders first.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

/// The test's own connection to the server.
pub(crate) struct Desk {
    connection: RustConnection,
    root: u32,
    display: String,
}

/// A monitor's place and how it is driven, to be put back after it was pulled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Plug {
    output: u32,
    crtc: u32,
    mode: u32,
    pub(crate) x: i16,
    pub(crate) y: i16,
    pub(crate) width: u16,
    pub(crate) height: u16,
}

impl Desk {
    pub(crate) fn new(display: &str) -> Self {
        let (connection, screen) = x11rb::connect(Some(display)).expect("connection to the test's X server");
        let root = connection.setup().roots[screen].root;
        connection.xfixes_query_version(5, 0).expect("XFixes").reply().expect("XFixes");
        Self { connection, root, display: display.to_owned() }
    }

    pub(crate) fn display(&self) -> &str {
        &self.display
    }

    pub(crate) fn plug(&self, name: &str) -> Plug {
        let c = &self.connection;
        let resources = c.randr_get_screen_resources_current(self.root).expect("RandR").reply().expect("RandR");
        for output in resources.outputs {
            let info = c.randr_get_output_info(output, 0).expect("RandR").reply().expect("output");
            if info.name == name.as_bytes() && info.crtc != 0 {
                let crtc = c.randr_get_crtc_info(info.crtc, 0).expect("RandR").reply().expect("crtc");
                let (x, y, width, height) = (crtc.x, crtc.y, crtc.width, crtc.height);
                return Plug { output, crtc: info.crtc, mode: crtc.mode, x, y, width, height };
            }
        }
        panic!("{name} is not lit");
    }

    /// Pulls the cable.
    pub(crate) fn pull(&self, plug: &Plug) {
        self.configure(plug, 0, &[]);
    }

    /// Puts the cable back.
    pub(crate) fn put_back(&self, plug: &Plug) {
        self.configure(plug, plug.mode, &[plug.output]);
    }

    fn configure(&self, plug: &Plug, mode: u32, outputs: &[u32]) {
        let c = &self.connection;
        let resources = c.randr_get_screen_resources_current(self.root).expect("RandR").reply().expect("RandR");
        let (x, y) = if mode == 0 { (0, 0) } else { (plug.x, plug.y) };
        let turned = randr::Rotation::ROTATE0;
        let time = resources.config_timestamp;
        let set = c.randr_set_crtc_config(plug.crtc, x11rb::CURRENT_TIME, time, x, y, mode, turned, outputs);
        let status = set.expect("RandR").reply().expect("crtc configuration").status;
        assert_eq!(status, randr::SetConfig::SUCCESS);
    }

    /// Gives the monitor an EDID, or takes it away.
    pub(crate) fn set_edid(&self, plug: &Plug, edid: Option<&[u8]>) {
        match edid {
            Some(bytes) => self.set_output_property(plug, "EDID", AtomEnum::INTEGER, 8, bytes.len(), bytes),
            None => self.remove_output_property(plug, "EDID"),
        }
    }

    /// Gives the monitor a setting whose value is a word, as graphics drivers do.
    pub(crate) fn set_output_word(&self, plug: &Plug, property: &str, word: &str) {
        self.set_output_property(plug, property, AtomEnum::ATOM, 32, 1, &self.atom(word).to_ne_bytes());
    }

    pub(crate) fn remove_output_property(&self, plug: &Plug, property: &str) {
        let deleted = self.connection.randr_delete_output_property(plug.output, self.atom(property));
        deleted.expect("RandR").check().expect("output property");
    }

    fn set_output_property(&self, plug: &Plug, name: &str, kind: AtomEnum, format: u8, count: usize, bytes: &[u8]) {
        let (c, mode, property) = (&self.connection, PropMode::REPLACE, self.atom(name));
        c.randr_change_output_property(plug.output, property, kind.into(), format, mode, count as u32, bytes)
            .expect("RandR")
            .check()
            .expect("output property");
    }

    fn atom(&self, name: &str) -> u32 {
        self.connection.intern_atom(false, name.as_bytes()).expect("atom").reply().expect("atom").atom
    }

    /// Fills the monitor's gamma table with `level -> value`, and returns what was there.
    pub(crate) fn set_gamma(&self, plug: &Plug, table: &[u16]) -> Vec<u16> {
        let c = &self.connection;
        let before = c.randr_get_crtc_gamma(plug.crtc).expect("RandR").reply().expect("gamma").red;
        assert_eq!(before.len(), table.len());
        c.randr_set_crtc_gamma(plug.crtc, table, table, table).expect("RandR").check().expect("gamma");
        before
    }

    /// What is on that part of the desktop.
    pub(crate) fn capture(&self, x: i16, y: i16, width: u16, height: u16) -> Picture {
        let image = self
            .connection
            .get_image(ImageFormat::Z_PIXMAP, self.root, x, y, width, height, !0)
            .expect("GetImage")
            .reply()
            .expect("GetImage");
        let pixels = image.data.chunks_exact(4).map(|bgrx| [bgrx[2], bgrx[1], bgrx[0]]).collect();
        Picture { width: width.into(), height: height.into(), pixels }
    }

    pub(crate) fn capture_monitor(&self, plug: &Plug) -> Picture {
        self.capture(plug.x, plug.y, plug.width, plug.height)
    }

    /// Waits until the monitor shows exactly `picture`.
    pub(crate) fn wait_for(&self, plug: &Plug, picture: &Picture) {
        let start = Instant::now();
        loop {
            let seen = self.capture_monitor(plug);
            if seen == *picture {
                return;
            }
            assert!(start.elapsed() < PATIENCE, "the monitor does not show the frame: {}", seen.difference(picture));
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until `done` holds.
    pub(crate) fn wait_until(&self, what: &str, mut done: impl FnMut() -> bool) {
        let start = Instant::now();
        while !done() {
            assert!(start.elapsed() < PATIENCE, "waited in vain: {what}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Lets the screen saver come after that many seconds without a key; 0: never.
    pub(crate) fn set_screen_saver(&self, seconds: i16) {
        let (blanking, exposures) = (Blanking::PREFERRED, Exposures::ALLOWED);
        self.connection.set_screen_saver(seconds, 0, blanking, exposures).expect("saver").check().expect("saver");
        self.connection.force_screen_saver(ScreenSaver::RESET).expect("saver").check().expect("saver");
    }

    /// Whether the screen is blanked.
    pub(crate) fn screen_saver_is_on(&self) -> bool {
        let info = self.connection.screensaver_query_info(self.root).expect("saver").reply().expect("saver");
        info.state == u8::from(screensaver::State::ON)
    }

    pub(crate) fn warp_pointer(&self, x: i16, y: i16) {
        self.connection.warp_pointer(x11rb::NONE, self.root, 0, 0, 0, 0, x, y).expect("WarpPointer");
        self.connection.flush().expect("flush");
    }

    /// Pixels of the cursor that are not transparent: the screen contents never hold it.
    pub(crate) fn cursor_pixels(&self) -> usize {
        let cursor = self.connection.xfixes_get_cursor_image().expect("XFixes").reply().expect("cursor");
        cursor.cursor_image.iter().filter(|&&pixel| pixel >> 24 != 0).count()
    }

    /// Whether a window manager says that it is at work.
    pub(crate) fn window_manager_is_there(&self) -> bool {
        let c = &self.connection;
        let name = self.atom("_NET_SUPPORTING_WM_CHECK");
        let check = c.get_property(false, self.root, name, AtomEnum::WINDOW, 0, 1).expect("property");
        let window = check.reply().expect("property").value32().and_then(|mut values| values.next());
        window.is_some_and(|window| c.get_geometry(window).expect("geometry").reply().is_ok())
    }

    /// Maps a window of the test's own and raises it above all; the window manager is asked if it is `managed`.
    pub(crate) fn raise_other_window(&self, x: i16, y: i16, width: u16, height: u16, managed: bool) -> u32 {
        let c = &self.connection;
        let window = c.generate_id().expect("id");
        let look = CreateWindowAux::new().background_pixel(0x00FF_00FF).override_redirect(u32::from(!managed));
        let class = WindowClass::INPUT_OUTPUT;
        c.create_window(24, window, self.root, x, y, width, height, 0, class, 0, &look).expect("window");
        c.map_window(window).expect("map");
        let above = x11rb::protocol::xproto::ConfigureWindowAux::new().stack_mode(StackMode::ABOVE);
        c.configure_window(window, &above).expect("raise").check().expect("raise");
        window
    }

    pub(crate) fn close_other_window(&self, window: u32) {
        self.connection.destroy_window(window).expect("destroy").check().expect("destroy");
    }
}
