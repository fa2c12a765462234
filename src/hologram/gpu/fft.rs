//! Two-dimensional transforms on the graphics processor: Stockham's passes through memory, radices 5, 4, 3 and 2.
//!
//! Each pass reads one buffer and writes the other, so no bit reversal is needed, and any 2^a·3^b·5^c is a length. Roots
//! of unity come from f64.

use super::device::{Device, pipelines};
use super::record::{Recorder, group, uniform, upload};
use crate::error::Result;
use crate::field::{Complex32, Complex64};
use pixels::wgpu;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Threads of a workgroup; as in the shader.
const THREADS: usize = 64;

/// Constants of a pass, as the shader takes them.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Pass {
    length: u32,
    span: u32,
    stride: u32,
    pitch: u32,
    lines: u32,
    across: u32,
    sign: f32,
    unused: u32,
}

/// The direction of a transform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// Σ u·exp(−i2πkn/N).
    Forward,
    /// Σ u·exp(+i2πkn/N), without 1/N.
    Inverse,
}

/// Roots of unity of the two axes.
pub(super) struct Roots {
    size: [usize; 2],
    buffers: [wgpu::Buffer; 2],
}

impl Roots {
    pub(super) fn new(device: &Device, size: [usize; 2]) -> Self {
        let buffers = size.map(|n| {
            let root = |m: usize| {
                let root = Complex64::cis(TAU * m as f64 / n as f64);
                Complex32::new(root.re as f32, root.im as f32)
            };
            let roots: Vec<Complex32> = (0..n).map(root).collect();
            upload(device, "roots", bytemuck::cast_slice(&roots))
        });
        Self { size, buffers }
    }
}

/// The passes of one transform between two buffers.
pub(super) struct Transform {
    passes: Vec<(usize, wgpu::BindGroup, [u32; 2])>,
    /// Index, in the given buffers, of the one that holds the result.
    pub(super) result: usize,
    /// Whether the first row pass leaves the rows that it skips to the second buffer.
    pub(super) rows_end_in_second: bool,
}

/// Radices whose product is `n`; `None` where it has another prime factor than 2, 3 and 5.
pub(super) fn radices(mut n: usize) -> Option<Vec<usize>> {
    let mut found = Vec::new();
    for radix in [5, 4, 3, 2] {
        while n > 1 && n.is_multiple_of(radix) {
            found.push(radix);
            n /= radix;
        }
    }
    (n == 1).then_some(found)
}

impl Transform {
    /// Rows first, of which the first `rows` hold anything, then columns. The data stand in `buffers[0]`; where `source`
    /// is given the first pass reads it instead, and leaves it as it is.
    ///
    /// The size must be a product of 2, 3 and 5, and have two samples at least along each axis.
    pub(super) fn new(
        device: &Device,
        roots: &Roots,
        rows: usize,
        direction: Direction,
        buffers: [&wgpu::Buffer; 2],
        source: Option<&wgpu::Buffer>,
    ) -> Self {
        let [width, height] = roots.size;
        let sign = if direction == Direction::Forward { -1.0 } else { 1.0 };
        let (mut passes, mut at, mut rows_end_in_second) = (Vec::new(), 0, false);
        let all = pipelines_of(device);
        for axis in 0..2 {
            let (length, lines, stride, pitch) =
                if axis == 0 { (width, rows, 1, width) } else { (height, width, width, 1) };
            let mut span = 1;
            for radix in radices(length).unwrap_or_default() {
                let pass = Pass {
                    length: length as u32,
                    span: span as u32,
                    stride: stride as u32,
                    pitch: pitch as u32,
                    lines: lines as u32,
                    across: axis as u32,
                    sign,
                    unused: 0,
                };
                let job = uniform(device, "pass", bytemuck::bytes_of(&pass));
                let from = if passes.is_empty() { source.unwrap_or(buffers[0]) } else { buffers[at] };
                let bound = [&job, &roots.buffers[axis], from, buffers[1 - at]];
                let index = radix - 2;
                let butterflies = length / radix;
                let threads = if axis == 0 { [butterflies, lines] } else { [lines, butterflies] };
                let groups = [threads[0].div_ceil(THREADS) as u32, threads[1] as u32];
                passes.push((index, group(device, &all[index], &bound), groups));
                at = 1 - at;
                span *= radix;
            }
            if axis == 0 {
                rows_end_in_second = at == 1;
            }
        }
        Self { passes, result: at, rows_end_in_second }
    }

    /// Records all passes.
    pub(super) fn run(&self, recorder: &mut Recorder) -> Result<()> {
        let all = pipelines_of(recorder.device);
        self.passes.iter().try_for_each(|(index, group, groups)| recorder.dispatch(&all[*index], group, *groups))
    }
}

/// The pipelines of radices 2, 3, 4 and 5.
fn pipelines_of(device: &Device) -> &'static [wgpu::ComputePipeline; 4] {
    static PIPELINES: OnceLock<[wgpu::ComputePipeline; 4]> = OnceLock::new();
    PIPELINES.get_or_init(|| {
        pipelines(&device.device, wgpu::include_wgsl!("fft.wgsl"), ["radix2", "radix3", "radix4", "radix5"])
    })
}

#[cfg(test)]
mod tests {
    use super::super::record::{Readback, storage};
    use super::*;
    use crate::field::{Fft2, relative_error};
    use crate::progress::Progress;
    use crate::random::Random;

    #[test]
    fn lengths_are_cut_into_radices() {
        assert_eq!(radices(1), Some(vec![]));
        assert_eq!(radices(480), Some(vec![5, 4, 4, 3, 2]));
        assert_eq!(radices(7 * 16), None);
    }

    #[test]
    fn transforms_equal_those_of_the_cpu() {
        let Some(device) = super::super::tests::device() else { return };
        // Each radix first and last, odd lengths, an even and an odd number of passes, dark rows.
        for ([width, height], rows) in [([48, 80], 80), ([45, 32], 19), ([2, 81], 81), ([125, 6], 5), ([1280, 72], 31)]
        {
            let sample = |i: usize| {
                let mut random = Random::new(8, i as u64);
                Complex64::new(random.uniform() - 0.5, random.uniform() - 0.4)
            };
            let exact: Vec<Complex64> =
                (0..width * height).map(|i| if i / width < rows { sample(i) } else { Complex64::default() }).collect();
            let given: Vec<Complex32> = exact.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect();
            for direction in [Direction::Forward, Direction::Inverse] {
                let mut wanted = exact.clone();
                let fft = Fft2::new(width, height);
                match direction {
                    Direction::Forward => fft.forward(&mut wanted, &Progress::new()),
                    Direction::Inverse => {
                        fft.inverse(&mut wanted, &Progress::new());
                        wanted.iter_mut().for_each(|u| *u *= (width * height) as f64);
                    }
                }
                let buffers = [0, 1].map(|_| storage(device, "line", 8 * given.len() as u64));
                device.queue.write_buffer(&buffers[0], 0, bytemuck::cast_slice(&given));
                let roots = Roots::new(device, [width, height]);
                let transform = Transform::new(device, &roots, rows, direction, [&buffers[0], &buffers[1]], None);
                let progress = Progress::new();
                let mut recorder = Recorder::new(device, &progress);
                transform.run(&mut recorder).expect("passes");
                recorder.submit().expect("passes");
                let mut found = vec![Complex32::default(); given.len()];
                Readback::new(device, &buffers[transform.result], found.len(), false)
                    .add_to(device, &mut found)
                    .expect("read back");
                let error = relative_error(&found, &wanted);
                println!("{width}×{height} {direction:?}: {error:.2e}");
                assert!(error < 1e-6, "{width}×{height} {direction:?}: {error:.2e}");
            }
        }
    }
}
