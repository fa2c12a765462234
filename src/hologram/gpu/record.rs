//! Buffers, bind groups and commands: what the engines on the graphics processor have in common.

use super::device::Device;
use crate::error::Result;
use crate::field::Complex32;
use crate::progress::Progress;
use pixels::wgpu;
use rayon::prelude::*;
use std::sync::mpsc::channel;

/// A buffer for shaders to read and write, dark.
pub(super) fn storage(device: &Device, label: &str, size: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// A buffer with contents.
pub(super) fn upload(device: &Device, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = storage(device, label, bytes.len() as u64);
    device.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// Constants of a dispatch.
pub(super) fn uniform(device: &Device, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    device.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// Buffers bound in order to a pipeline's first group.
pub(super) fn group(device: &Device, pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
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

/// Commands on their way to the device.
pub(super) struct Recorder<'a> {
    pub(super) device: &'a Device,
    progress: &'a Progress,
    encoder: Option<wgpu::CommandEncoder>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(device: &'a Device, progress: &'a Progress) -> Self {
        Self { device, progress, encoder: None }
    }

    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        let device = &self.device.device;
        self.encoder.get_or_insert_with(|| device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()))
    }

    /// Clears a part of a buffer [bytes]; nothing where it is empty.
    pub(super) fn clear(&mut self, buffer: &wgpu::Buffer, from: u64) {
        if from < buffer.size() {
            self.encoder().clear_buffer(buffer, from, None);
        }
    }

    /// Records a dispatch. A software adapter, whose dispatches take as long as a host's loops, runs it at once.
    pub(super) fn dispatch(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        groups: [u32; 2],
    ) -> Result<()> {
        {
            let mut pass = self.encoder().begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        if self.device.software {
            let submission = self.submit()?;
            self.device.wait(submission)?;
        }
        Ok(())
    }

    /// Submits what was recorded; fails once the job was asked to end.
    pub(super) fn submit(&mut self) -> Result<Option<wgpu::SubmissionIndex>> {
        self.progress.check()?;
        Ok(self.encoder.take().map(|encoder| self.device.queue.submit([encoder.finish()])))
    }
}

/// Copies the first samples of a buffer to the host, when all that was submitted is done.
pub(super) fn fetch(device: &Device, buffer: &wgpu::Buffer, samples: &mut [Complex32]) -> Result<()> {
    let size = size_of_val(samples) as u64;
    let staging = device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
    device.queue.submit([encoder.finish()]);
    let (sender, mapped) = channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver is gone where the computation was given up.
        let _ = sender.send(result.map_err(|e| e.to_string()));
    });
    let mapped = loop {
        match mapped.try_recv() {
            Ok(mapped) => break mapped,
            Err(_) => device.wait(None)?,
        }
    };
    mapped.map_err(|what| device.failed(what))?;
    let bytes = staging.slice(..).get_mapped_range();
    let from: &[Complex32] = bytemuck::cast_slice(&bytes);
    samples.par_chunks_mut(1 << 16).zip(from.par_chunks(1 << 16)).for_each(|(to, from)| to.copy_from_slice(from));
    Ok(())
}
