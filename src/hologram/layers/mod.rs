//! Pictures with depth and focal stacks, plane by plane: fast transforms instead of points, with occlusion.
//!
//! A sample of a layer is a point of the [definition](super::definition): its wave has the spectrum
//! i·W(f_x)·W(f_y)/f_z·exp(i2πf_z·d). So the whole layer's is that times the transform of its samples, and layers without
//! [`Layer::opaque`] give what the engines give for points on the lattice. Light goes from the farthest layer towards
//! the viewer, +z; at each layer what was carried so far is multiplied by what the layer lets through (silhouette by
//! silhouette, K. Matsushima & S. Nakahara, *Appl. Opt.* 48, H54 (2009)), and the layer's own light is added. From the
//! nearest layer the field is carried to the panel, back through it where that layer stands in front.
//!
//! Light of every layer goes in one step to the next plane that hides something, or to the panel: a leg of its way.
//! Cost: one transform a layer, on its lattice and as much beyond as light spreads on the leg, and one and a half more
//! where a layer occludes; memory: [`bytes`]. Factors are in f32 with phases reduced in f64: 1e-5 for any distance that
//! the grid can hold.

mod leg;
mod slices;
#[cfg(test)]
mod tests;
mod window;

use super::definition::Optics;
use super::lanes::InstructionSet;
use crate::error::{Error, Result};
use crate::field::{Complex32, Field, Grid};
use crate::progress::Progress;
use leg::{Buffers, Emission, Leg};
pub use slices::{SliceSettings, of_slices};
use window::Window;

/// Light on a plane parallel to the panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Depth of the plane; negative behind the panel [m].
    pub z: f64,
    /// Amplitude and phase of the point at each sample, row-major on the lattice; dark samples are zero.
    pub light: Vec<Complex32>,
    /// Samples that let nothing through from behind; none where empty.
    pub opaque: Vec<bool>,
}

/// Memory that [`compute`] takes at most beside layers and field [bytes]: the transformed rows of a layer, a padded
/// spectrum and the threads' strips of it; more for layers far from each other or from the panel.
///
/// # Errors
/// [`Error::Parameter`] for a wavelength or a size that cannot be.
pub fn bytes(lattice: &Grid, panel: &Grid, wavelength: f64, depths: impl Iterator<Item = f64>) -> Result<u64> {
    let optics = Optics::new(panel, wavelength)?;
    let ends = depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], z| [l.min(z), h.max(z)]);
    let [low, high] = if ends[0] <= ends[1] { ends } else { [0.0; 2] };
    let sizes = [
        Window::new(lattice, lattice).size(&optics, high - low),
        Window::new(lattice, panel).size(&optics, low.abs().max(high.abs())),
    ];
    // Refuses what has no grid.
    for [width, height] in sizes {
        Grid::new(width, height, panel.pitch_x, panel.pitch_y)?;
    }
    Ok(leg::bytes(lattice, &sizes))
}

/// The field of layers, all on `lattice`, on the panel.
///
/// # Errors
/// [`Error::Parameter`] for another pitch than the panel's, samples that do not fit the lattice, or a depth that is not
/// finite; [`Error::Memory`] when `memory` [bytes] is passed; [`Error::Interrupted`] when asked to stop.
pub fn compute(
    layers: &[Layer],
    lattice: &Grid,
    panel: &Grid,
    wavelength: f64,
    memory: u64,
    progress: &Progress,
) -> Result<Field> {
    let optics = Optics::new(panel, wavelength)?;
    if [lattice.pitch_x, lattice.pitch_y] != [panel.pitch_x, panel.pitch_y] {
        return Err(Error::parameter("layers", "the lattice must have the panel's pitch"));
    }
    for layer in layers {
        let fits = layer.light.len() == lattice.len() && [0, lattice.len()].contains(&layer.opaque.len());
        if !fits || !layer.z.is_finite() {
            let what = format!("a layer at {} m has {} samples for {}", layer.z, layer.light.len(), lattice.len());
            return Err(Error::parameter("layers", what));
        }
    }
    let needed = bytes(lattice, panel, wavelength, layers.iter().map(|layer| layer.z))?;
    if needed > memory {
        let hint = "give more memory or a smaller lattice".to_owned();
        return Err(Error::Memory { what: "layers", needed: needed.div_ceil(1 << 20), budget: memory >> 20, hint });
    }
    progress.start("hologram: layers", layers.len() as u64 + 1);
    let mut order: Vec<&Layer> = layers.iter().collect();
    order.sort_by(|a, b| a.z.total_cmp(&b.z));
    let stretches = stretches(&order);
    let onto = [Window::new(lattice, lattice), Window::new(lattice, panel)];
    // Each stretch of layers, and where its light goes.
    let legs: Vec<(&[&Layer], f64, Window)> = (0..stretches.len())
        .map(|i| match stretches.get(i + 1) {
            Some(next) => (stretches[i], next[0].z, onto[0]),
            None => (stretches[i], 0.0, onto[1]),
        })
        .collect();
    let farthest = |(stretch, to, _): &(&[&Layer], f64, Window)| {
        stretch.iter().map(|layer| (to - layer.z).abs()).fold(0.0, f64::max)
    };
    let sizes: Vec<[usize; 2]> = legs.iter().map(|leg| leg.2.size(&optics, farthest(leg))).collect();
    let mut buffers = Buffers::new(lattice, &sizes);
    let set = InstructionSet::detect();
    let mut field = Field::zeros(*panel, wavelength);
    // The last leg, if light went it.
    let mut before: Option<Leg> = None;
    for ((stretch, to, window), size) in legs.into_iter().zip(sizes) {
        let leg = Leg::new(&optics, size, set)?;
        let lit: Vec<&Layer> =
            stretch.iter().copied().filter(|layer| layer.light.iter().any(|u| u.norm_sqr() > 0.0)).collect();
        let carried = before.take();
        let parts = lit.len() + usize::from(carried.is_some());
        if let Some(carried) = &carried {
            carried.shutter(&mut buffers, lattice, &stretch[0].opaque, &leg, progress);
            progress.check()?;
            let factor = leg.factor(Emission::Field, to - stretch[0].z, window);
            leg.add(&mut buffers, lattice, &factor, true, parts == 1, progress);
            progress.check()?;
        }
        for (k, layer) in lit.iter().enumerate() {
            leg.emit(&mut buffers, lattice, &layer.light, progress);
            progress.check()?;
            let factor = leg.factor(Emission::Points { behind: layer.z <= 0.0 }, to - layer.z, window);
            let (first, last) = (k == 0 && carried.is_none(), k + 1 == lit.len());
            leg.add(&mut buffers, lattice, &factor, first, last, progress);
            progress.check()?;
            progress.advance(1);
        }
        progress.advance((stretch.len() - lit.len()) as u64);
        before = (parts > 0).then_some(leg);
    }
    if let Some(leg) = before {
        leg.land(&buffers, &mut field, progress);
    }
    progress.check()?;
    progress.advance(1);
    Ok(field)
}

/// Layers from the farthest on, cut where one hides what is behind it.
fn stretches<'a, 'b>(order: &'a [&'b Layer]) -> Vec<&'a [&'b Layer]> {
    let mut stretches = Vec::new();
    let mut rest = order;
    while !rest.is_empty() {
        let count = (1..rest.len()).find(|&i| rest[i].opaque.contains(&true)).unwrap_or(rest.len());
        let (stretch, after) = rest.split_at(count);
        stretches.push(stretch);
        rest = after;
    }
    stretches
}
