//! The Wayland compositor, asked directly: how it turns each monitor's picture, which winit does not tell.
//!
//! A compositor turns pictures by itself, with the window's size unchanged for half turns and mirrorings: nothing else
//! would show it. What it does to colours (gamma tables, night light) no program can ask.

use crate::error::{Error, Result};
use std::fmt;
use wayland_client::backend::WaylandError;
use wayland_client::protocol::wl_output::{self, WlOutput};
use wayland_client::protocol::wl_registry::{self, WlRegistry};
use wayland_client::{Connection, Dispatch, EventQueue, Proxy, QueueHandle, WEnum};

/// First version of the protocol in which monitors have names.
const NAMED: u32 = 4;

/// A connection of our own to the compositor.
pub(super) struct Wayland {
    queue: EventQueue<Outputs>,
    outputs: Outputs,
}

/// The monitors, as the compositor describes them.
#[derive(Default)]
struct Outputs {
    list: Vec<Output>,
    changed: bool,
}

#[derive(Clone, Default)]
struct Output {
    /// The number by which the compositor announces and withdraws it.
    global: u32,
    name: Option<String>,
    turned: bool,
    preferred: Option<(u32, u32)>,
}

impl Wayland {
    /// Connects to the compositor that the environment names.
    pub(super) fn connect() -> Result<Self> {
        let connection = Connection::connect_to_env().map_err(unanswered)?;
        let mut queue = connection.new_event_queue();
        connection.display().get_registry(&queue.handle(), ());
        let mut outputs = Outputs::default();
        // The first brings the monitors, the second what they are.
        queue.roundtrip(&mut outputs).map_err(unanswered)?;
        queue.roundtrip(&mut outputs).map_err(unanswered)?;
        Ok(Self { queue, outputs })
    }

    /// Whether a monitor's picture is turned or mirrored, and its preferred mode if the compositor tells; none for one that
    /// it does not name.
    pub(super) fn scan_out(&self, monitor: &str) -> Option<(bool, Option<(u32, u32)>)> {
        let output = self.outputs.list.iter().find(|output| output.name.as_deref() == Some(monitor))?;
        Some((output.turned, output.preferred))
    }

    /// Whether a monitor came, went or changed since the last call; does not wait.
    pub(super) fn changes(&mut self) -> Result<bool> {
        self.queue.flush().or_else(later).map_err(unanswered)?;
        if let Some(reading) = self.queue.prepare_read() {
            reading.read().map(drop).or_else(later).map_err(unanswered)?;
        }
        self.queue.dispatch_pending(&mut self.outputs).map_err(unanswered)?;
        Ok(std::mem::take(&mut self.outputs.changed))
    }
}

/// Nothing to read or no room to write is no error.
fn later(error: WaylandError) -> Result<(), WaylandError> {
    match error {
        WaylandError::Io(error) if error.kind() == std::io::ErrorKind::WouldBlock => Ok(()),
        other => Err(other),
    }
}

fn unanswered(error: impl fmt::Display) -> Error {
    Error::Display { what: format!("the Wayland compositor does not answer as it should: {error}") }
}

impl Dispatch<WlRegistry, ()> for Outputs {
    fn event(
        outputs: &mut Self,
        registry: &WlRegistry,
        event: wl_registry::Event,
        (): &(),
        _: &Connection,
        handle: &QueueHandle<Self>,
    ) {
        match event {
            wl_registry::Event::Global { name, interface, version } if interface == WlOutput::interface().name => {
                registry.bind::<WlOutput, _, _>(name, version.min(NAMED), handle, name);
                outputs.list.push(Output { global: name, ..Output::default() });
                outputs.changed = true;
            }
            wl_registry::Event::GlobalRemove { name } => {
                outputs.list.retain(|output| output.global != name);
                outputs.changed = true;
            }
            _ => {}
        }
    }
}

impl Dispatch<WlOutput, u32> for Outputs {
    fn event(
        outputs: &mut Self,
        _: &WlOutput,
        event: wl_output::Event,
        global: &u32,
        _: &Connection,
        _: &QueueHandle<Self>,
    ) {
        outputs.changed = true;
        let Some(output) = outputs.list.iter_mut().find(|output| output.global == *global) else { return };
        match event {
            wl_output::Event::Geometry { transform, .. } => {
                output.turned = transform != WEnum::Value(wl_output::Transform::Normal);
            }
            wl_output::Event::Mode { flags: WEnum::Value(flags), width, height, .. }
                if flags.contains(wl_output::Mode::Preferred) =>
            {
                output.preferred = u32::try_from(width).ok().zip(u32::try_from(height).ok());
            }
            wl_output::Event::Name { name } => output.name = Some(name),
            _ => {}
        }
    }
}
