//! Buffers, bind groups and commands: what the engines on the graphics processor have in common.

use super::device::Device;
use crate::error::Result;
use crate::field::Complex32;
use crate::progress::Progress;
use pixels::wgpu;
use rayon::prelude::*;
use std::sync::mpsc::{Receiver, channel};

fn buffer(device: &Device, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}

/// A buffer for shaders to read and write, dark.
pub(super) fn storage(device: &Device, label: &str, size: u64) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    buffer(device, label, size, usage)
}

/// A buffer with contents.
pub(super) fn upload(device: &Device, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = storage(device, label, bytes.len() as u64);
    device.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// Constants of a dispatch.
pub(super) fn uniform(device: &Device, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    let buffer = buffer(device, label, bytes.len() as u64, usage);
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

/// Samples on their way to the host.
pub(super) struct Readback {
    staging: wgpu::Buffer,
    mapped: Receiver<std::result::Result<(), String>>,
}

impl Readback {
    /// Begins to copy the first `count` samples of a buffer, behind all that was submitted; then clears the buffer where
    /// `clear`.
    pub(super) fn new(device: &Device, buffer: &wgpu::Buffer, count: usize, clear: bool) -> Self {
        let size = (count * size_of::<Complex32>()) as u64;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = self::buffer(device, "staging", size, usage);
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        if clear {
            encoder.clear_buffer(buffer, 0, None);
        }
        device.queue.submit([encoder.finish()]);
        let (sender, mapped) = channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver is gone where the computation was given up.
            let _ = sender.send(result.map_err(|e| e.to_string()));
        });
        Self { staging, mapped }
    }

    /// Waits for the samples and adds them to those of the host.
    pub(super) fn add_to(self, device: &Device, samples: &mut [Complex32]) -> Result<()> {
        let mapped = loop {
            match self.mapped.try_recv() {
                Ok(mapped) => break mapped,
                Err(_) => device.wait(None)?,
            }
        };
        mapped.map_err(|what| device.failed(what))?;
        let bytes = self.staging.slice(..).get_mapped_range();
        let from: &[Complex32] = bytemuck::cast_slice(&bytes);
        samples.par_chunks_mut(1 << 16).zip(from.par_chunks(1 << 16)).for_each(|(to, from)| {
            to.iter_mut().zip(from).for_each(|(u, add)| *u += add);
        });
        Ok(())
    }
}
