//! The graphics processor: found once, kept for the life of the process.

use crate::error::{Error, Result};
use pixels::wgpu;
use std::pin::pin;
use std::sync::{Arc, Mutex, OnceLock};
use std::task::{Context, Poll, Waker};

/// An adapter that computes, its queue and the engine's pipelines.
#[derive(Debug)]
pub(super) struct Device {
    /// Name and interface, as the driver tells them.
    pub(super) name: String,
    /// Whether it computes on the CPU.
    pub(super) software: bool,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Products over tiles, and every pixel from its own path.
    pub(super) pipelines: [wgpu::ComputePipeline; 2],
    fault: Arc<Mutex<Option<String>>>,
}

/// The machine's graphics processor, or why there is none.
pub(super) fn device() -> Result<&'static Device> {
    static DEVICE: OnceLock<std::result::Result<Device, String>> = OnceLock::new();
    DEVICE.get_or_init(Device::open).as_ref().map_err(|why| {
        Error::unsupported(format!("no graphics processor that computes was found ({why}); take tiles or planes"))
    })
}

impl Device {
    fn open() -> std::result::Result<Self, String> {
        let one_line = |e: &dyn std::fmt::Display| e.to_string().replace('\n', " ");
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            // OpenGL has no compute shaders worth the name, and its driver is not safe to open from a second thread.
            backends: wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY),
            ..wgpu::InstanceDescriptor::new_without_display_handle().with_env()
        });
        // WGPU_ADAPTER_NAME chooses; otherwise the fastest.
        let named = ready(wgpu::util::initialize_adapter_from_env(&instance, None)).and_then(|found| found.ok());
        let adapter = match named {
            Some(adapter) => adapter,
            None => ready(instance.request_adapter(&wgpu::RequestAdapterOptions {
                power_preference: wgpu::PowerPreference::HighPerformance,
                ..wgpu::RequestAdapterOptions::default()
            }))
            .ok_or("the adapter does not answer")?
            .map_err(|e| one_line(&e))?,
        };
        let info = adapter.get_info();
        let name = format!("{} ({})", info.name, info.backend);
        let (device, queue) = ready(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("hologram"),
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        }))
        .ok_or("the device does not answer")?
        .map_err(|e| format!("{name}: {}", one_line(&e)))?;
        let fault = Arc::new(Mutex::new(None));
        let reported = Arc::clone(&fault);
        // Without a handler wgpu panics.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut fault) = reported.lock() {
                fault.get_or_insert_with(|| error.to_string().replace('\n', " "));
            }
        }));
        let pipelines = pipelines(&device, wgpu::include_wgsl!("sum.wgsl"), ["separable", "exact"]);
        let opened =
            Self { name, software: info.device_type == wgpu::DeviceType::Cpu, device, queue, pipelines, fault };
        opened.check().map_err(|e| e.to_string())?;
        Ok(opened)
    }

    /// Fails with what the driver reported since the last call.
    pub(super) fn check(&self) -> Result<()> {
        let fault = self.fault.lock().ok().and_then(|mut fault| fault.take());
        fault.map_or(Ok(()), |what| Err(self.failed(what)))
    }

    /// Waits until a submission is done, or all of them.
    pub(super) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<()> {
        let polled = self.device.poll(wgpu::PollType::Wait { submission_index: submission, timeout: None });
        polled.map_err(|e| self.failed(e.to_string()))?;
        self.check()
    }

    pub(super) fn failed(&self, what: impl std::fmt::Display) -> Error {
        Error::unsupported(format!("the graphics processor {} failed: {what}; take tiles or planes", self.name))
    }
}

/// Pipelines of a module's entry points.
pub(super) fn pipelines<const N: usize>(
    device: &wgpu::Device,
    source: wgpu::ShaderModuleDescriptor,
    entries: [&str; N],
) -> [wgpu::ComputePipeline; N] {
    let module = device.create_shader_module(source);
    entries.map(|entry| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    })
}

/// The value of a future that is ready at once, as those of native wgpu are.
fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}
