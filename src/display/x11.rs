//! The X server, asked directly: monitors and what the graphics card does to them (RandR), where a window really is.
//!
//! The window itself belongs to winit. Its 0.30 releases never hear that monitors come or go on X11 (they select the
//! events, but Xlib drops those of extensions that nobody registered with it), and know neither EDID nor gamma, so
//! this second connection does.

use super::edid::Edid;
use super::frame::DisplayFrame;
use super::kernel;
use super::monitor::{Gamma, Monitor, ScanOut};
use super::rectangle::Rectangle;
use crate::error::{Error, Result};
use std::fmt;
use x11rb::connection::{Connection, RequestConnection};
use x11rb::cookie::Cookie;
use x11rb::errors::{ConnectionError, ReplyError};
use x11rb::protocol::Event;
use x11rb::protocol::randr::{self, ConnectionExt as _, Crtc, GetCrtcInfoReply, GetOutputInfoReply, ModeInfo, Output};
use x11rb::protocol::screensaver::{self, ConnectionExt as _};
use x11rb::protocol::xproto::{
    AtomEnum, ChangeWindowAttributesAux, ConfigureWindowAux, ConnectionExt as _, CreateGCAux, EventMask, ImageFormat,
    ImageOrder, InputFocus, MapState, StackMode, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::x11_utils::TryParse;

/// 1 in the 16.16 fixed point of RandR transforms.
const FIXED_ONE: i32 = 1 << 16;
/// Longest EDID asked for, in the 4-byte units of the request: base block and seven extensions.
const EDID_LIMIT: u32 = 8 * 128 / 4;

type Request<'a, R> = std::result::Result<Cookie<'a, RustConnection, R>, ConnectionError>;

/// A connection of our own to the X server.
pub(super) struct X11 {
    connection: RustConnection,
    root: Window,
    /// The screen's number on its server.
    number: usize,
    edid_property: u32,
}

/// What has happened on the desktop since the last look.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Changes {
    /// A monitor came, went, moved or changed its mode, gamma or rotation.
    pub(super) monitors: bool,
    /// A window was mapped, moved, resized or restacked.
    pub(super) windows: bool,
}

/// An output that shows a part of the desktop.
struct ActiveOutput {
    name: String,
    output: Output,
    info: GetOutputInfoReply,
    crtc: GetCrtcInfoReply,
}

/// What the X server tells of the desktop as a whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Screen {
    /// Bits per pixel that carry colour.
    pub(super) depth: u8,
    /// Whether a compositing manager is at work.
    pub(super) composited: bool,
}

/// A property of an output as its driver names it, with its value in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) value: String,
}

impl X11 {
    /// Connects to the server that `DISPLAY` names and asks to be told of changes.
    pub(super) fn connect() -> Result<Self> {
        let (connection, screen) = x11rb::connect(None).map_err(unanswered)?;
        let root = connection.setup().roots[screen].root;
        let version = answer(connection.randr_query_version(1, 3))?;
        if (version.major_version, version.minor_version) < (1, 3) {
            return Err(Error::unsupported("the X server has no RandR 1.3: its monitors cannot be told apart"));
        }
        let notify =
            randr::NotifyMask::SCREEN_CHANGE | randr::NotifyMask::CRTC_CHANGE | randr::NotifyMask::OUTPUT_CHANGE;
        connection.randr_select_input(root, notify).map_err(unanswered)?;
        let children = ChangeWindowAttributesAux::new().event_mask(EventMask::SUBSTRUCTURE_NOTIFY);
        connection.change_window_attributes(root, &children).map_err(unanswered)?;
        let edid_property = answer(connection.intern_atom(false, b"EDID"))?.atom;
        Ok(Self { connection, root, number: screen, edid_property })
    }

    /// The monitors that show a part of the desktop, in the server's order.
    pub(super) fn monitors(&self) -> Result<Vec<Monitor>> {
        let c = &self.connection;
        let resources = answer(c.randr_get_screen_resources_current(self.root))?;
        let primary = answer(c.randr_get_output_primary(self.root))?.output;
        let mut active = Vec::new();
        for &output in &resources.outputs {
            // What vanishes between two questions is not there.
            let Some(info) = found(c.randr_get_output_info(output, 0))? else { continue };
            if info.crtc == 0 {
                continue;
            }
            let Some(crtc) = found(c.randr_get_crtc_info(info.crtc, 0))? else { continue };
            if crtc.mode != 0 && crtc.width > 0 && crtc.height > 0 {
                let name = String::from_utf8_lossy(&info.name).into_owned();
                active.push(ActiveOutput { name, output, info, crtc });
            }
        }
        let mode = |id: u32| resources.modes.iter().find(|mode| mode.id == id);
        let mut monitors = Vec::with_capacity(active.len());
        for (index, one) in active.iter().enumerate() {
            let preferred = (one.info.num_preferred > 0).then(|| one.info.modes.first()).flatten();
            let place = rectangle_of(&one.crtc);
            let shares = |other: &&ActiveOutput| other.output != one.output && place.meets(&rectangle_of(&other.crtc));
            monitors.push(Monitor {
                index,
                name: one.name.clone(),
                width: place.width,
                height: place.height,
                x: place.x,
                y: place.y,
                refresh: mode(one.crtc.mode).and_then(refresh),
                scale: 1.0,
                primary: one.output == primary,
                edid: self.edid(one.output)?.or_else(|| kernel::edid(&one.name, (place.width, place.height))),
                scan_out: Some(ScanOut {
                    rotated: one.crtc.rotation != randr::Rotation::ROTATE0,
                    transformed: self.transformed(one.info.crtc)?,
                    gamma: self.gamma(one.info.crtc)?,
                    high_dynamic_range: None,
                    shared_with: active.iter().filter(shares).map(|other| other.name.clone()).collect(),
                    preferred: preferred
                        .and_then(|id| mode(*id))
                        .map(|mode| (u32::from(mode.width), u32::from(mode.height))),
                }),
                parts: Vec::new(),
            });
        }
        Ok(monitors)
    }

    fn edid(&self, output: Output) -> Result<Option<Edid>> {
        let (c, any) = (&self.connection, AtomEnum::ANY);
        let request = c.randr_get_output_property(output, self.edid_property, any, 0, EDID_LIMIT, false, false);
        // An EDID too damaged to read identifies nothing: the monitor is then known by its connector only.
        Ok(found(request)?.filter(|property| property.format == 8).and_then(|p| Edid::parse(&p.data).ok()))
    }

    fn transformed(&self, crtc: Crtc) -> Result<bool> {
        Ok(found(self.connection.randr_get_crtc_transform(crtc))?.is_some_and(|reply| {
            let m = reply.current_transform;
            [m.matrix11, m.matrix12, m.matrix13, m.matrix21, m.matrix22, m.matrix23, m.matrix31, m.matrix32, m.matrix33]
                != [FIXED_ONE, 0, 0, 0, FIXED_ONE, 0, 0, 0, FIXED_ONE]
        }))
    }

    fn gamma(&self, crtc: Crtc) -> Result<Gamma> {
        let table = found(self.connection.randr_get_crtc_gamma(crtc))?;
        Ok(table.map_or(Gamma::Unknown, |table| Gamma::of_table(&table.red, &table.green, &table.blue)))
    }

    /// What the server tells of the desktop as a whole.
    pub(super) fn screen(&self) -> Result<Screen> {
        let c = &self.connection;
        let depth = answer(c.get_geometry(self.root))?.depth;
        // A compositing manager owns this selection (ICCCM 2.8 and EWMH).
        let selection = format!("_NET_WM_CM_S{}", self.number);
        let atom = answer(c.intern_atom(false, selection.as_bytes()))?.atom;
        let owner = answer(c.get_selection_owner(atom))?.owner;
        Ok(Screen { depth, composited: owner != x11rb::NONE })
    }

    /// The driver's settings of an output: names and words as they are, numbers in decimal with commas.
    pub(super) fn properties(&self, name: &str) -> Result<Vec<Property>> {
        let c = &self.connection;
        let resources = answer(c.randr_get_screen_resources_current(self.root))?;
        let mut properties = Vec::new();
        for &output in &resources.outputs {
            let info = found(c.randr_get_output_info(output, 0))?;
            if info.is_none_or(|info| info.name != name.as_bytes()) {
                continue;
            }
            let Some(list) = found(c.randr_list_output_properties(output))? else {
                continue;
            };
            for atom in list.atoms.into_iter().filter(|&atom| atom != self.edid_property) {
                let request = c.randr_get_output_property(output, atom, AtomEnum::ANY, 0, 64, false, false);
                let (Some(name), Some(value)) = (self.atom_name(atom)?, found(request)?) else {
                    continue;
                };
                let words: Vec<String> = match (value.format, value.type_) {
                    (32, kind) if kind == u32::from(AtomEnum::ATOM) => words_of(&value.data)
                        .map(|atom| self.atom_name(atom))
                        .filter_map(Result::transpose)
                        .collect::<Result<_>>()?,
                    (32, _) => words_of(&value.data).map(|word| word.to_string()).collect(),
                    (8, _) => value.data.iter().map(ToString::to_string).collect(),
                    _ => continue,
                };
                properties.push(Property { name, value: words.join(",") });
            }
        }
        Ok(properties)
    }

    fn atom_name(&self, atom: u32) -> Result<Option<String>> {
        let name = found(self.connection.get_atom_name(atom))?;
        Ok(name.map(|name| String::from_utf8_lossy(&name.name).into_owned()))
    }

    /// Makes `frame` the background of `window`, so that the server itself paints it in the instant in which the
    /// window appears: no moment of white, or of what was there before.
    ///
    /// Does nothing on a screen whose pixels are not 8 bits of red, green and blue.
    pub(super) fn set_background(&self, window: Window, frame: &DisplayFrame) -> Result<()> {
        let c = &self.connection;
        let depth = answer(c.get_geometry(window))?.depth;
        let setup = c.setup();
        let four_bytes = setup.pixmap_formats.iter().any(|format| format.depth == depth && format.bits_per_pixel == 32);
        let (Ok(width), Ok(height)) = (u16::try_from(frame.width()), u16::try_from(frame.height())) else {
            return Ok(());
        };
        if depth != 24 || !four_bytes {
            return Ok(());
        }
        let (pixmap, gc) = (c.generate_id().map_err(unanswered)?, c.generate_id().map_err(unanswered)?);
        c.create_pixmap(depth, pixmap, window, width, height).map_err(unanswered)?;
        c.create_gc(gc, pixmap, &CreateGCAux::new()).map_err(unanswered)?;
        let little = setup.image_byte_order == ImageOrder::LSB_FIRST;
        // A request has a greatest length; 64 bytes leave room for its head.
        let row_bytes = 4 * usize::from(width);
        let rows = (c.maximum_request_bytes().saturating_sub(64) / row_bytes).clamp(1, usize::from(height));
        for (band, pixels) in frame.pixels().chunks(rows * usize::from(width)).enumerate() {
            let bytes: Vec<u8> =
                pixels.iter().flat_map(|&[r, g, b]| if little { [b, g, r, 0] } else { [0, r, g, b] }).collect();
            let (top, count) = ((band * rows) as i16, (pixels.len() / usize::from(width)) as u16);
            c.put_image(ImageFormat::Z_PIXMAP, pixmap, gc, width, count, 0, top, 0, depth, &bytes)
                .map_err(unanswered)?;
        }
        let background = ChangeWindowAttributesAux::new().background_pixmap(pixmap);
        c.change_window_attributes(window, &background).map_err(unanswered)?.check().map_err(unanswered)?;
        c.free_gc(gc).map_err(unanswered)?;
        c.free_pixmap(pixmap).map_err(unanswered)?;
        c.flush().map_err(unanswered)
    }

    /// Takes the background away again: once frames change, an uncovered part must not flash the first one.
    pub(super) fn clear_background(&self, window: Window) -> Result<()> {
        let none = ChangeWindowAttributesAux::new().background_pixmap(x11rb::NONE);
        self.connection.change_window_attributes(window, &none).map_err(unanswered)?;
        self.connection.flush().map_err(unanswered)
    }

    /// Where `window` is on the desktop, or none when it is not shown.
    pub(super) fn placement(&self, window: Window) -> Result<Option<Rectangle>> {
        let c = &self.connection;
        let Some(attributes) = found(c.get_window_attributes(window))? else {
            return Ok(None);
        };
        if attributes.map_state != MapState::VIEWABLE {
            return Ok(None);
        }
        let size = found(c.get_geometry(window))?;
        let corner = found(c.translate_coordinates(window, self.root, 0, 0))?;
        Ok(size.zip(corner).map(|(size, corner)| Rectangle {
            x: corner.dst_x.into(),
            y: corner.dst_y.into(),
            width: size.width.into(),
            height: size.height.into(),
        }))
    }

    /// Gives the keyboard to `window`, so that its keys end the show. The window manager does not do it for a window
    /// that it does not manage.
    pub(super) fn focus(&self, window: Window) -> Result<()> {
        let focus = self.connection.set_input_focus(InputFocus::POINTER_ROOT, window, x11rb::CURRENT_TIME);
        there(focus.map_err(unanswered)?.check())?;
        Ok(())
    }

    /// Keeps screen saver and power saving from coming on, or lets them again; requests are counted, and forgotten when
    /// the connection ends. A server without the extension has neither.
    pub(super) fn keep_awake(&self, awake: bool) -> Result<()> {
        let c = &self.connection;
        if c.extension_information(screensaver::X11_EXTENSION_NAME).map_err(unanswered)?.is_none() {
            return Ok(());
        }
        c.screensaver_query_version(1, 1).map_err(unanswered)?;
        c.screensaver_suspend(awake.into()).map_err(unanswered)?.ignore_error();
        c.flush().map_err(unanswered)
    }

    /// Raises `window` if another visible window covers a part of it. Tells whether one did.
    pub(super) fn keep_above(&self, window: Window) -> Result<bool> {
        let c = &self.connection;
        let Some(place) = self.placement(window)? else { return Ok(false) };
        // Bottom to top.
        let stack = answer(c.query_tree(self.root))?.children;
        let above = stack.iter().rev().take_while(|&&other| other != window);
        for &other in above {
            let attributes = found(c.get_window_attributes(other))?;
            let drawn = |a: &_| {
                matches!(a, x11rb::protocol::xproto::GetWindowAttributesReply { map_state, class, .. }
                    if *map_state == MapState::VIEWABLE && *class == WindowClass::INPUT_OUTPUT)
            };
            if !attributes.as_ref().is_some_and(drawn) {
                continue;
            }
            let Some(g) = found(c.get_geometry(other))? else { continue };
            let border = 2 * u32::from(g.border_width);
            let (width, height) = (u32::from(g.width) + border, u32::from(g.height) + border);
            if place.meets(&Rectangle { x: g.x.into(), y: g.y.into(), width, height }) {
                let raise = ConfigureWindowAux::new().stack_mode(StackMode::ABOVE);
                there(c.configure_window(window, &raise).map_err(unanswered)?.check())?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// What has happened since the last call; does not wait.
    pub(super) fn changes(&self) -> Result<Changes> {
        let mut changes = Changes::default();
        while let Some(event) = self.connection.poll_for_event().map_err(unanswered)? {
            match event {
                Event::RandrNotify(_) | Event::RandrScreenChangeNotify(_) => changes.monitors = true,
                Event::ConfigureNotify(_) | Event::MapNotify(_) | Event::UnmapNotify(_) | Event::CirculateNotify(_) => {
                    changes.windows = true;
                }
                _ => {}
            }
        }
        Ok(changes)
    }
}

/// The part of the desktop that a CRTC scans out.
fn rectangle_of(crtc: &GetCrtcInfoReply) -> Rectangle {
    Rectangle { x: crtc.x.into(), y: crtc.y.into(), width: crtc.width.into(), height: crtc.height.into() }
}

/// Frames per second of a mode [Hz]: the pixel clock over all pixels, blanking included.
fn refresh(mode: &ModeInfo) -> Option<f64> {
    let pixels = f64::from(mode.htotal) * f64::from(mode.vtotal);
    let flags = mode.mode_flags;
    let fields = if flags.contains(randr::ModeFlag::INTERLACE) { 2.0 } else { 1.0 };
    let scans = if flags.contains(randr::ModeFlag::DOUBLE_SCAN) { 2.0 } else { 1.0 };
    (pixels > 0.0 && mode.dot_clock > 0).then(|| f64::from(mode.dot_clock) * fields / (pixels * scans))
}

/// The 32-bit words of a property; x11rb has put them into this machine's byte order.
fn words_of(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.chunks_exact(4).map(|word| u32::from_ne_bytes([word[0], word[1], word[2], word[3]]))
}

/// The answer to a question about what is there for certain.
fn answer<R: TryParse>(request: Request<'_, R>) -> Result<R> {
    request.map_err(unanswered)?.reply().map_err(unanswered)
}

/// The answer to a question about a thing that may have gone; then there is none.
fn found<R: TryParse>(request: Request<'_, R>) -> Result<Option<R>> {
    there(request.map_err(unanswered)?.reply())
}

fn unanswered(error: impl fmt::Display) -> Error {
    Error::Display { what: format!("the X server does not answer as it should: {error}") }
}

/// None for a thing that is no longer there (the server answers with an error), an error for a lost connection.
fn there<T>(reply: Result<T, ReplyError>) -> Result<Option<T>> {
    match reply {
        Ok(reply) => Ok(Some(reply)),
        Err(ReplyError::X11Error(_)) => Ok(None),
        Err(error) => Err(unanswered(error)),
    }
}
