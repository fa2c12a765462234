//! Gradient descent on the phases of one or several frames, so that pupils see the light field's pictures.
//!
//! Loss of K looks of N sub-frames: the mean over looks and over the retina of (s·a − √T)², with a = √(Σₙ|Vₙ|²/N), the picture T
//! that the look should show, and the factor s that is best for all looks together, which makes their brightness alike. Its
//! derivative by Vₙ* is s·(s·a − √T)/(a·N)·Vₙ over the number of samples; the adjoint optics carry it to the panel, where
//! ∂L/∂φ = −2·Im(conj(A*·∂L/∂V*)·u). Steps are Adam's (Kingma & Ba, arXiv:1412.6980, algorithm 1); looks are drawn anew for
//! each. Levels, range, dead space and crosstalk stand inside: the light is that of the level that the panel would show, its
//! derivative moves the wish ("straight through", Bengio et al., arXiv:1308.3432).

use crate::encode::model::{PanelModel, Range, slope};
use crate::error::Result;
use crate::field::Complex32;
use crate::light_field::Look;
use crate::panel::crosstalk::smoothed;
use crate::progress::Progress;
use crate::random::Random;
use rayon::prelude::*;
use std::sync::OnceLock;

/// How the descent goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Descent {
    pub(super) iterations: usize,
    /// Largest step of a pixel's phase [rad]; it falls along half a cosine to a twentieth.
    pub(super) rate: f64,
    /// Looks per step.
    pub(super) looks: usize,
    pub(super) seed: u64,
    /// Whether steps are smoothed over neighbours before they are made, on a panel whose pixels run into each other: Adam makes
    /// them alike in size, which roughens them, and beside rough phases such a panel loses light. A picture in a Gaussian beam on
    /// 0.4 pixels of crosstalk comes to 30.9 dB in 50 steps, without it to 29.2.
    pub(super) smooth: bool,
}

/// Light of a panel's rows: writes a row's samples into the slice.
pub(super) type Rows<'a> = &'a (dyn Fn(usize, &mut [Complex32]) + Sync);

/// The linear way from a panel's light to what is seen of it at looks, and its adjoint.
pub(super) trait Sight: Sync {
    /// A look, made ready.
    type Ready: Send + Sync;

    /// What stands between the panel and the picture at a look, and what the picture should be.
    fn ready(&self, look: &Look) -> Self::Ready;

    /// √T, on the picture's samples.
    fn wanted<'r>(&self, ready: &'r Self::Ready) -> &'r [f32];

    /// How much each sample of the picture weighs; empty where all weigh the same.
    fn weights<'r>(&self, ready: &'r Self::Ready) -> &'r [f32];

    /// The fields V at the looks, laid out as this way likes them.
    fn fields(&self, looks: &[&Self::Ready], light: Rows, progress: &Progress) -> Vec<Vec<Complex32>>;

    /// Adds `share` of a field's intensity to the picture of its look.
    fn expose(&self, ready: &Self::Ready, field: &[Complex32], share: f32, picture: &mut [f32]);

    /// What a field becomes when each sample of the picture pulls at its part of it, some way back towards the panel.
    fn pulled(&self, ready: &Self::Ready, field: Vec<Complex32>, pull: &[f32]) -> Vec<Complex32>;

    /// The rest of the adjoint: hands A*·g at the panel's pixels row by row to `take(row, state of the row, A*·g)`.
    fn slopes<T: Send>(
        &self,
        pulls: Vec<(&Self::Ready, Vec<Complex32>)>,
        rows: &mut [T],
        take: impl Fn(usize, &mut T, &[Complex32]) + Sync,
        progress: &Progress,
    );

    /// Takes fields back that nothing more is done with.
    fn done(&self, _fields: Vec<Vec<Complex32>>) {}
}

/// The looks that steps draw from: each is made ready when it is first drawn.
pub(super) struct Looks<'s, S: Sight> {
    sight: &'s S,
    looks: Vec<Look>,
    ready: Vec<OnceLock<S::Ready>>,
}

impl<'s, S: Sight> Looks<'s, S> {
    pub(super) fn new(sight: &'s S, looks: Vec<Look>) -> Self {
        let ready = looks.iter().map(|_| OnceLock::new()).collect();
        Self { sight, looks, ready }
    }

    /// These looks, made ready together.
    fn prepared(&self, picked: &[usize]) -> Vec<&S::Ready> {
        let get = |&index: &usize| self.ready[index].get_or_init(|| self.sight.ready(&self.looks[index]));
        picked.par_iter().map(get).collect()
    }
}

/// Wishes and moments of one frame.
struct Frame {
    wish: Vec<f32>,
    moments: [Vec<f32>; 2],
}

/// What the descent found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Wishes of each frame, row-major [rad].
    pub(super) wishes: Vec<Vec<f32>>,
    /// Best loss so far on looks that are kept for this, before the first step and at each check.
    pub(super) history: Vec<f64>,
    /// The factor s of the best frames.
    pub(super) scale: f64,
    /// Steps made.
    pub(super) iterations: usize,
}

/// Makes wishes of each frame.
pub(super) type Wishes<'a> = &'a dyn Fn() -> Result<Vec<Vec<f32>>>;

/// What a descent begins with.
pub(super) struct Start<'a> {
    /// Wishes of each frame.
    pub(super) wishes: Vec<Vec<f32>>,
    /// Makes others, and how many steps from these, where the given ones are so bad that others may be better.
    pub(super) others: Option<(Wishes<'a>, usize)>,
}

/// Loss of given wishes above which others are looked at, too: 26 dB. What moved by little begins well above that, and others take two
/// steps' time to make and to look at.
const DOUBTFUL: f64 = 2.5e-3;

/// What the pupils see of all frames together.
struct Seen {
    /// Field on the retina, by frame and look.
    fields: Vec<Vec<Vec<Complex32>>>,
    /// a, by look.
    amplitudes: Vec<Vec<f32>>,
    scale: f64,
    loss: f64,
}

/// The panel and the way to the eye.
pub(super) struct Problem<'a, S> {
    pub(super) sight: &'a S,
    pub(super) model: &'a PanelModel,
    pub(super) progress: &'a Progress,
}

impl<S: Sight> Problem<'_, S> {
    /// Descends from the given wishes, drawing from `looks`; frames are judged by the `kept` ones.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when asked to stop.
    pub(super) fn descend(
        &self,
        start: Start<'_>,
        looks: &Looks<S>,
        kept: &Looks<S>,
        settings: &Descent,
    ) -> Result<Found> {
        let pixels = self.model.grid.len();
        let fresh = |wish: Vec<f32>| Frame { wish, moments: [vec![0.0; pixels], vec![0.0; pixels]] };
        let mut frames: Vec<Frame> = start.wishes.into_iter().map(fresh).collect();
        let all: Vec<usize> = (0..kept.looks.len()).collect();
        let judge = |frames: &[Frame]| -> Result<(f64, f64)> {
            let seen = self.look(frames, &kept.prepared(&all))?;
            seen.fields.into_iter().for_each(|fields| self.sight.done(fields));
            Ok((seen.loss, seen.scale))
        };
        let (mut loss, mut scale) = judge(&frames)?;
        let mut settings = *settings;
        if let Some((others, iterations)) = start.others.filter(|_| loss > DOUBTFUL) {
            let theirs: Vec<Frame> = others()?.into_iter().map(fresh).collect();
            let judged = judge(&theirs)?;
            if judged.0 < loss {
                (frames, (loss, scale), settings.iterations) = (theirs, judged, iterations);
            }
        }
        let wishes = |frames: &[Frame]| frames.iter().map(|f| f.wish.clone()).collect();
        let mut found = Found { wishes: wishes(&frames), history: vec![loss], scale, iterations: settings.iterations };
        let (mut best, between) = (loss, (settings.iterations / 8).max(1));
        self.progress.start("view", settings.iterations as u64);
        for iteration in 0..settings.iterations {
            let pick = |step: usize| draw(looks.looks.len(), settings.looks, settings.seed, step as u64);
            if iteration % AHEAD == 0 {
                // Together, since one look is made ready on one thread.
                looks.prepared(
                    &(iteration..(iteration + AHEAD).min(settings.iterations)).flat_map(pick).collect::<Vec<_>>(),
                );
                self.progress.check()?;
            }
            let prepared = looks.prepared(&pick(iteration));
            self.step(&mut frames, &prepared, &settings, iteration)?;
            self.progress.advance(1);
            if (iteration + 1) % between == 0 || iteration + 1 == settings.iterations {
                let (loss, scale) = judge(&frames)?;
                if loss < best {
                    (best, found.wishes, found.scale) = (loss, wishes(&frames), scale);
                }
                found.history.push(best);
            }
        }
        Ok(found)
    }

    /// Looks at the frames.
    fn look(&self, frames: &[Frame], looks: &[&S::Ready]) -> Result<Seen> {
        let mut amplitudes: Vec<Vec<f32>> = looks.iter().map(|look| vec![0.0; self.sight.wanted(look).len()]).collect();
        let share = 1.0 / frames.len() as f32;
        let mut fields = Vec::with_capacity(frames.len());
        for frame in frames {
            let light = self.model.blended(&frame.wish);
            self.progress.check()?;
            let seen = self.fields(&frame.wish, light.as_deref(), looks);
            self.progress.check()?;
            amplitudes
                .par_iter_mut()
                .zip(looks)
                .zip(&seen)
                .for_each(|((sum, look), seen)| self.sight.expose(look, seen, share, sum));
            fields.push(seen);
            self.progress.check()?;
        }
        // Sums of each look in its own order, so that threads do not matter.
        let sums: Vec<[f64; 4]> = amplitudes
            .par_iter_mut()
            .zip(looks)
            .map(|(seen, look)| {
                let (wanted, weights) = (self.sight.wanted(look), self.sight.weights(look));
                let mut sums = [0.0f64; 4];
                for (i, (a, &t)) in seen.iter_mut().zip(wanted).enumerate() {
                    *a = (*a + DARKEST).sqrt();
                    let (a, t) = (f64::from(*a), f64::from(t));
                    let weight = weights.get(i).map_or(1.0, |&w| f64::from(w));
                    sums[0] += weight * a * a;
                    sums[1] += weight * a * t;
                    sums[2] += weight * t * t;
                    sums[3] += weight;
                }
                sums
            })
            .collect();
        let [aa, at, tt, all] = sums.iter().fold([0.0; 4], |sum, one| [0, 1, 2, 3].map(|i| sum[i] + one[i]));
        let scale = if aa > 0.0 { at / aa } else { 0.0 };
        let loss = (tt - scale * at).max(0.0) / all.max(f64::MIN_POSITIVE);
        Ok(Seen { fields, amplitudes, scale, loss })
    }

    fn fields(&self, wish: &[f32], blended: Option<&[Complex32]>, looks: &[&S::Ready]) -> Vec<Vec<Complex32>> {
        let width = self.model.grid.width;
        if let Some(light) = blended {
            let row = |row: usize, out: &mut [Complex32]| out.copy_from_slice(&light[row * width..][..width]);
            return self.sight.fields(looks, &row, self.progress);
        }
        let row = |row: usize, out: &mut [Complex32]| {
            let wishes = &wish[row * width..][..width];
            out.iter_mut().zip(wishes).for_each(|(u, &wish)| *u = self.model.show(wish).1 + self.model.dead);
            if let Some(wave) = &self.model.incident {
                out.iter_mut().zip(&wave[row * width..]).for_each(|(u, wave)| *u *= wave);
            }
        };
        self.sight.fields(looks, &row, self.progress)
    }

    /// One step of all frames.
    fn step(&self, frames: &mut [Frame], looks: &[&S::Ready], settings: &Descent, iteration: usize) -> Result<()> {
        let Seen { fields, mut amplitudes, scale, loss } = self.look(frames, looks)?;
        let scale = scale as f32;
        // Slopes fall with the root of the loss; divided by it they weigh alike in Adam's means.
        let even = (1.0 / loss.sqrt().max(1e-6)) as f32;
        // s·(s·a − √T)/(a·N), in place of a; the number of samples is left out: Adam's steps do not depend on it.
        amplitudes.par_iter_mut().zip(looks).for_each(|(seen, look)| {
            let pull = |(a, t): (&mut f32, &f32)| *a = even * scale * (scale * *a - t) / (*a * frames.len() as f32);
            seen.iter_mut().zip(self.sight.wanted(look)).for_each(pull);
            seen.iter_mut().zip(self.sight.weights(look)).for_each(|(pull, weight)| *pull *= weight);
        });
        let adam = Adam::at(settings, iteration, self.model.range);
        for (frame, mut seen) in frames.iter_mut().zip(fields) {
            self.progress.check()?;
            let pulls: Vec<(&S::Ready, Vec<Complex32>)> = seen
                .par_iter_mut()
                .enumerate()
                .map(|(k, field)| (looks[k], self.sight.pulled(looks[k], std::mem::take(field), &amplitudes[k])))
                .collect();
            self.move_frame(frame, pulls, &adam);
            self.progress.check()?;
        }
        Ok(())
    }

    fn move_frame(&self, frame: &mut Frame, pulls: Vec<(&S::Ready, Vec<Complex32>)>, adam: &Adam) {
        let width = self.model.grid.width;
        let Frame { wish, moments: [first, second] } = frame;
        if self.model.blends() {
            // A pixel's slope takes its neighbours', so that all of the pull must be there first.
            let mut pull = vec![Complex32::default(); wish.len()];
            let mut rows: Vec<&mut [Complex32]> = pull.chunks_mut(width).collect();
            let keep = |_: usize, row: &mut &mut [Complex32], pulled: &[Complex32]| row.copy_from_slice(pulled);
            self.sight.slopes(pulls, &mut rows, keep, self.progress);
            // Each pixel's slope becomes its step.
            let mut change = self.model.blended_slopes(wish, pull);
            let cells = change.par_iter_mut().zip(first).zip(second);
            cells.for_each(|((change, first), second)| *change = adam.change(first, second, *change));
            if adam.smooth {
                change = smoothed(&change, width);
            }
            wish.par_iter_mut().zip(&change).for_each(|(wish, change)| adam.moved(wish, *change));
            return;
        }
        let incident = self.model.incident.as_ref();
        let rows = wish.chunks_mut(width).zip(first.chunks_mut(width)).zip(second.chunks_mut(width));
        let mut rows: Vec<_> = rows.collect();
        type Row<'r> = ((&'r mut [f32], &'r mut [f32]), &'r mut [f32]);
        let take = |row: usize, ((wish, first), second): &mut Row, pulled: &[Complex32]| {
            let cells = wish.iter_mut().zip(first.iter_mut()).zip(second.iter_mut()).zip(pulled);
            if let Some(wave) = incident {
                cells.zip(&wave[row * width..]).for_each(|((((wish, first), second), p), wave)| {
                    adam.turn(wish, first, second, slope(*p, self.model.show(*wish).1 * wave));
                });
                return;
            }
            cells.for_each(|(((wish, first), second), p)| {
                let light = self.model.show(*wish).1;
                adam.turn(wish, first, second, slope(*p, light));
            });
        };
        self.sight.slopes(pulls, &mut rows, take, self.progress);
    }
}

/// Steps whose looks are made ready together.
const AHEAD: usize = 4;

/// Light below which a place of the retina has no direction to grow in, over white's.
const DARKEST: f32 = 1e-8;

/// Adam's step at one iteration.
struct Adam {
    step: f32,
    unbiased: [f32; 2],
    range: Option<Range>,
    smooth: bool,
}

impl Adam {
    const BETA: [f32; 2] = [0.9, 0.95];

    fn at(settings: &Descent, iteration: usize, range: Option<Range>) -> Self {
        let share = iteration as f64 / settings.iterations as f64;
        let step = settings.rate * (0.05 + 0.95 * 0.5 * (1.0 + (std::f64::consts::PI * share).cos()));
        let power = iteration as i32 + 1;
        Self {
            step: step as f32,
            unbiased: Self::BETA.map(|b| 1.0 / (1.0 - b.powi(power))),
            range,
            smooth: settings.smooth,
        }
    }

    /// By how much to move a phase of this slope, in steps.
    fn change(&self, first: &mut f32, second: &mut f32, slope: f32) -> f32 {
        *first = Self::BETA[0] * *first + (1.0 - Self::BETA[0]) * slope;
        *second = Self::BETA[1] * *second + (1.0 - Self::BETA[1]) * slope * slope;
        *first * self.unbiased[0] / ((*second * self.unbiased[1]).sqrt() + 1e-12)
    }

    fn moved(&self, wish: &mut f32, change: f32) {
        *wish -= self.step * change;
        if let Some(range) = self.range {
            *wish = wish.clamp(range.low, range.high);
        }
    }

    fn turn(&self, wish: &mut f32, first: &mut f32, second: &mut f32, slope: f32) {
        let change = self.change(first, second, slope);
        self.moved(wish, change);
    }
}

/// `count` different looks of `all`.
fn draw(all: usize, count: usize, seed: u64, iteration: u64) -> Vec<usize> {
    let mut random = Random::new(seed ^ 0x100c, iteration);
    let mut places: Vec<usize> = (0..all).collect();
    let count = count.min(all);
    for i in 0..count {
        let other = i + (random.uniform() * (all - i) as f64) as usize;
        places.swap(i, other.min(all - 1));
    }
    places.truncate(count);
    places
}

#[cfg(test)]
mod tests;
