//! Putting pixels into a window unchanged: by the graphics card or by the processor.

use super::frame::DisplayFrame;
use crate::error::{Error, Result};
use crate::names::{Name, Named};
use pixels::wgpu;
use pixels::{Pixels, PixelsBuilder, SurfaceTexture};
use serde::Serialize;
use std::fmt;
use std::future::Future;
use std::num::NonZeroU32;
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};
use winit::window::Window;

/// Who puts a frame into the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Presenter {
    /// The graphics card; the processor where there is none that can.
    #[default]
    Auto,
    /// The graphics card, by wgpu. Waits for the monitor's vertical blank.
    Gpu,
    /// The processor, by shared memory with the window system. Needs no graphics driver and no waiting.
    Software,
}

impl Named for Presenter {
    const KIND: &'static str = "presenter";
    const NAMES: &'static [Name<Self>] = &[
        ("auto", || Self::Auto, "the graphics card where there is one"),
        ("gpu", || Self::Gpu, "the graphics card"),
        ("software", || Self::Software, "the processor"),
    ];
}

/// A presenter at work on one window.
pub(super) struct Surface {
    kind: Kind,
    width: u32,
    height: u32,
}

enum Kind {
    Gpu { pixels: Box<Pixels<'static>>, adapter: String, fault: Arc<Mutex<Option<String>>> },
    Software(softbuffer::Surface<Arc<Window>, Arc<Window>>),
}

impl Surface {
    /// Prepares to present frames of `width × height` pixels, the inner size of `window`, one pixel for one.
    pub(super) fn new(choice: Presenter, window: &Arc<Window>, width: u32, height: u32) -> Result<Self> {
        let inner = window.inner_size();
        if (inner.width, inner.height) != (width, height) {
            let what = format!("the window is {}x{} px, the frame {width}x{height}", inner.width, inner.height);
            return Err(Error::Display { what });
        }
        let kind = match choice {
            Presenter::Gpu => gpu(window, width, height)?,
            Presenter::Software => software(window, width, height)?,
            Presenter::Auto => match gpu(window, width, height) {
                Ok(kind) => kind,
                Err(no_gpu) => software(window, width, height).map_err(|no_software| Error::Display {
                    what: format!("nothing can draw into the window: {no_gpu}; {no_software}"),
                })?,
            },
        };
        Ok(Self { kind, width, height })
    }

    /// Which presenter it is; never [`Presenter::Auto`].
    pub(super) fn presenter(&self) -> Presenter {
        match self.kind {
            Kind::Gpu { .. } => Presenter::Gpu,
            Kind::Software(_) => Presenter::Software,
        }
    }

    /// The graphics adapter's name, if one is at work.
    pub(super) fn adapter(&self) -> Option<&str> {
        match &self.kind {
            Kind::Gpu { adapter, .. } => Some(adapter),
            Kind::Software(_) => None,
        }
    }

    /// Hands `frame` to the window system and returns when it has taken it.
    ///
    /// False when the window system would not take it now (window covered or hidden): the frame is not on the panel.
    pub(super) fn present(&mut self, frame: &DisplayFrame) -> Result<bool> {
        if (frame.width(), frame.height()) != (self.width, self.height) {
            let what = format!(
                "the frame is {}x{} px, the panel's window {}x{}: frames are not scaled",
                frame.width(),
                frame.height(),
                self.width,
                self.height
            );
            return Err(Error::Display { what });
        }
        match &mut self.kind {
            Kind::Gpu { pixels, fault, .. } => {
                for (out, &[r, g, b]) in pixels.frame_mut().chunks_exact_mut(4).zip(frame.pixels()) {
                    out.copy_from_slice(&[r, g, b, 255]);
                }
                let mut drawn = false;
                pixels
                    .render_with(|encoder, target, context| {
                        context.scaling_renderer.render(encoder, target);
                        // Not called, though the answer is Ok, when the surface is occluded or timed out.
                        drawn = true;
                        Ok(())
                    })
                    .map_err(|error| refused("the graphics card", &error))?;
                // The GPU reads the frame after this returns: wait, so that "presented" is true of it.
                pixels
                    .device()
                    .poll(wgpu::PollType::wait_indefinitely())
                    .map_err(|e| refused("the graphics card", &e))?;
                match fault.lock().ok().and_then(|mut fault| fault.take()) {
                    Some(fault) => Err(refused("the graphics card", &fault)),
                    None => Ok(drawn),
                }
            }
            Kind::Software(surface) => {
                let mut buffer = surface.buffer_mut().map_err(|error| refused("the window system", &error))?;
                for (out, &[r, g, b]) in buffer.iter_mut().zip(frame.pixels()) {
                    *out = u32::from_be_bytes([0, r, g, b]);
                }
                buffer.present().map_err(|error| refused("the window system", &error))?;
                // On X11 `present` leaves the request in a queue. Asking for the buffer again sends it and waits
                // until the server has drawn.
                surface.buffer_mut().map_err(|error| refused("the window system", &error))?;
                Ok(true)
            }
        }
    }
}

fn refused(who: &str, why: &dyn fmt::Display) -> Error {
    Error::Display { what: format!("{who} did not take the frame: {why}") }
}

fn no_gpu(why: impl fmt::Display) -> Error {
    Error::Display {
        what: format!(
            "no graphics presenter: {why} (a Vulkan driver may be missing; or choose the software presenter)"
        ),
    }
}

fn software(window: &Arc<Window>, width: u32, height: u32) -> Result<Kind> {
    let no = |error: softbuffer::SoftBufferError| Error::Display { what: format!("no software presenter: {error}") };
    let context = softbuffer::Context::new(window.clone()).map_err(no)?;
    let mut surface = softbuffer::Surface::new(&context, window.clone()).map_err(no)?;
    let (Some(columns), Some(rows)) = (NonZeroU32::new(width), NonZeroU32::new(height)) else {
        return Err(Error::Display { what: "the window has no pixels".into() });
    };
    surface.resize(columns, rows).map_err(no)?;
    Ok(Kind::Software(surface))
}

fn gpu(window: &Arc<Window>, width: u32, height: u32) -> Result<Kind> {
    // wgpu's GL backend is left out: it needs the display handle, which `pixels` does not hand on.
    let backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
    let format = surface_format(window, backends)?;
    // Both textures linear: with one of them sRGB, 254 of 256 levels change; with both, exactness hangs on the
    // driver's rounding. Blending would mix in what was there.
    let pixels = PixelsBuilder::new(width, height, SurfaceTexture::new(width, height, window.clone()))
        .wgpu_backend(backends)
        .texture_format(wgpu::TextureFormat::Rgba8Unorm)
        .surface_texture_format(format)
        .blend_state(wgpu::BlendState::REPLACE)
        .present_mode(wgpu::PresentMode::AutoVsync)
        .build()
        .map_err(no_gpu)?;
    // Its size is computed in single precision.
    if pixels.frame().len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err(no_gpu(format!("{width}x{height} px are too many for it")));
    }
    let fault = Arc::new(Mutex::new(None));
    let reported = Arc::clone(&fault);
    // Without a handler wgpu panics.
    pixels.device().on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        if let Ok(mut fault) = reported.lock() {
            fault.get_or_insert_with(|| error.to_string().replace('\n', " "));
        }
    }));
    let adapter = pixels.adapter().get_info();
    let adapter = format!("{} ({})", adapter.name, adapter.backend);
    Ok(Kind::Gpu { pixels: Box::new(pixels), adapter, fault })
}

/// A linear 8-bit format that the surface takes. `pixels` does not check, and wgpu panics on one that it does not.
fn surface_format(window: &Arc<Window>, backends: wgpu::Backends) -> Result<wgpu::TextureFormat> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle().with_env()
    });
    let surface = instance.create_surface(window.clone()).map_err(no_gpu)?;
    // The same choice as `pixels` makes.
    let adapter = ready(wgpu::util::initialize_adapter_from_env_or_default(&instance, Some(&surface)))
        .ok_or_else(|| no_gpu("the adapter does not answer"))?
        .map_err(no_gpu)?;
    let formats = surface.get_capabilities(&adapter).formats;
    [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm]
        .into_iter()
        .find(|format| formats.contains(format))
        .ok_or_else(|| no_gpu(format!("the adapter offers no linear 8-bit surface, only {formats:?}")))
}

/// The value of a future that is ready at once, as those of native wgpu are.
fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}
