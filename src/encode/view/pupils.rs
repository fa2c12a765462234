//! What pupils of a diameter see: the way of the descent through [`Optics`].

use super::descent::{Rows, Sight};
use super::optics::{Aperture, Columns, Optics};
use crate::field::Complex32;
use crate::light_field::Look;
use crate::light_field::retina::Targets;
use crate::progress::Progress;
use rayon::prelude::*;

/// The panel through pupils, and the pictures that they should see.
pub(super) struct Pupils<'a> {
    pub(super) optics: &'a Optics,
    pub(super) targets: &'a Targets<'a>,
}

/// A look, made ready: what the pupil does, and what it should see.
pub(super) struct Prepared {
    aperture: Aperture,
    amplitude: Vec<f32>,
}

impl Pupils<'_> {
    fn columns<'r>(&self, looks: impl Iterator<Item = &'r Prepared>) -> Columns {
        let apertures: Vec<&Aperture> = looks.map(|look| &look.aperture).collect();
        Columns::of(&apertures, self.optics.retina.padded[0])
    }
}

impl Sight for Pupils<'_> {
    type Ready = Prepared;

    fn ready(&self, look: &Look) -> Prepared {
        Prepared { aperture: self.optics.aperture(look), amplitude: self.targets.amplitude(look) }
    }

    fn wanted<'r>(&self, ready: &'r Prepared) -> &'r [f32] {
        &ready.amplitude
    }

    fn weights<'r>(&self, _: &'r Prepared) -> &'r [f32] {
        &[]
    }

    fn fields(&self, looks: &[&Prepared], light: Rows, progress: &Progress) -> Vec<Vec<Complex32>> {
        let columns = self.columns(looks.iter().copied());
        let plane = self.optics.eye_plane(&columns, light);
        if progress.stopped() {
            return looks.iter().map(|_| vec![Complex32::default(); self.optics.retina.lattice.len()]).collect();
        }
        looks.par_iter().map(|look| self.optics.seen(&plane, &columns, &look.aperture)).collect()
    }

    fn expose(&self, _: &Prepared, field: &[Complex32], share: f32, picture: &mut [f32]) {
        picture.iter_mut().zip(field).for_each(|(sum, v)| *sum += share * v.norm_sqr());
    }

    fn pulled(&self, ready: &Prepared, mut field: Vec<Complex32>, pull: &[f32]) -> Vec<Complex32> {
        field.iter_mut().zip(pull).for_each(|(v, &pull)| *v *= pull);
        self.optics.pulled(field, &ready.aperture)
    }

    fn slopes<T: Send>(
        &self,
        pulls: Vec<(&Prepared, Vec<Complex32>)>,
        rows: &mut [T],
        take: impl Fn(usize, &mut T, &[Complex32]) + Sync,
        _: &Progress,
    ) {
        let columns = self.columns(pulls.iter().map(|(look, _)| *look));
        let pulls: Vec<_> = pulls.iter().map(|(look, pull)| (&look.aperture, pull.as_slice())).collect();
        self.optics.panel_slopes(&columns, &pulls, rows, take);
    }
}
