//! The pose at a time: local transforms and morph weights, from the nodes and an animation clip.

use super::Clip;
use super::document::{Document, choose};
use crate::error::Result;
use glam::{DMat4, DQuat, DVec3};
use gltf::json;
use json::animation::{Interpolation, Property};
use json::validation::Checked;

/// Local transforms and morph weights of all nodes at one time.
pub(super) struct Pose {
    /// Parent from node, for all nodes of the file.
    pub(super) parent_from_node: Vec<DMat4>,
    /// Morph weights by node; empty where neither node nor mesh nor animation sets any.
    pub(super) weights: Vec<Vec<f32>>,
}

#[derive(Clone, Copy)]
struct LocalTransform {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

impl LocalTransform {
    fn matrix(self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

impl Pose {
    /// The pose of `clip` at `time` [s].
    pub(super) fn new(document: &Document, clip: &Clip, time: f64) -> Result<Self> {
        let nodes = &document.root.nodes;
        let mut parent_from_node = Vec::with_capacity(nodes.len());
        let mut weights = Vec::with_capacity(nodes.len());
        let mut parts = Vec::with_capacity(nodes.len());
        for (i, node) in nodes.iter().enumerate() {
            let rest = LocalTransform {
                translation: node.translation.map_or(DVec3::ZERO, |t| glam::Vec3::from(t).as_dvec3()),
                rotation: unit(node.rotation.unwrap_or_default().0.map(f64::from)),
                scale: node.scale.map_or(DVec3::ONE, |s| glam::Vec3::from(s).as_dvec3()),
            };
            let matrix = node.matrix.map(|m| DMat4::from_cols_array(&m.map(f64::from)));
            let local = matrix.unwrap_or_else(|| rest.matrix());
            if !local.is_finite() {
                return Err(document.error(format!("{} has a transform that is not finite", document.node_name(i))));
            }
            parent_from_node.push(local);
            parts.push(rest);
            let mesh = node.mesh.map(|mesh| document.get(mesh, "a node's mesh")).transpose()?;
            weights.push(node.weights.as_ref().or(mesh.and_then(|m| m.weights.as_ref())).cloned().unwrap_or_default());
        }
        let mut pose = Self { parent_from_node, weights };
        if let Some(animation) = chosen_clip(document, clip)? {
            pose.animate(document, animation, &mut parts, time)?;
        }
        if let Some(i) = pose.weights.iter().position(|w| !w.iter().all(|x| x.is_finite())) {
            let name = document.node_name(i);
            return Err(document.error(format!("{name} has morph weights that are not finite")));
        }
        Ok(pose)
    }

    fn animate(
        &mut self,
        document: &Document,
        animation: &json::Animation,
        parts: &mut [LocalTransform],
        time: f64,
    ) -> Result<()> {
        for (i, channel) in animation.channels.iter().enumerate() {
            let what = format!("animation channel {i}");
            let sampler = animation.samplers.get(channel.sampler.value()).ok_or_else(|| {
                document.error(format!("{what} points to sampler {}, which is not there", channel.sampler))
            })?;
            document.get(channel.target.node, &what)?;
            let node = channel.target.node.value();
            let Checked::Valid(property) = channel.target.path else {
                // Properties of extensions, such as KHR_animation_pointer's, are not part of a pose.
                continue;
            };
            match property {
                Property::Translation => parts[node].translation = sample(document, sampler, time, &what)?.into(),
                Property::Scale => parts[node].scale = sample(document, sampler, time, &what)?.into(),
                Property::Rotation => parts[node].rotation = unit(sample(document, sampler, time, &what)?),
                Property::MorphTargetWeights => {
                    self.weights[node] = sample_weights(document, sampler, time, &what)?;
                    continue;
                }
            }
            self.parent_from_node[node] = parts[node].matrix();
        }
        Ok(())
    }
}

/// Files hold quaternions rounded to f32 or to normalised bytes, so that their length must be restored.
fn unit(q: [f64; 4]) -> DQuat {
    let q = DQuat::from_array(q);
    let length = q.length();
    if length.is_finite() && length > 0.0 { q / length } else { DQuat::IDENTITY }
}

fn chosen_clip<'a>(document: &'a Document, clip: &Clip) -> Result<Option<&'a json::Animation>> {
    let animations = &document.root.animations;
    match clip {
        Clip::Rest => Ok(None),
        Clip::First => Ok(animations.first()),
        Clip::Of(choice) => {
            let names: Vec<Vec<&str>> = animations.iter().map(|a| a.name.as_deref().into_iter().collect()).collect();
            Ok(Some(&animations[choose(choice, &names, "animation")?]))
        }
    }
}

/// First and last key time of a clip [s].
pub(super) fn times(document: &Document, clip: &Clip) -> Result<Option<[f64; 2]>> {
    let Some(animation) = chosen_clip(document, clip)? else { return Ok(None) };
    let mut ends: Option<[f64; 2]> = None;
    for (i, sampler) in animation.samplers.iter().enumerate() {
        let keys = document.vectors::<1>(sampler.input, &format!("animation sampler {i}"))?;
        for time in keys.iter().map(|key| f64::from(key[0])).filter(|time| time.is_finite()) {
            ends = Some(ends.map_or([time; 2], |[first, last]| [first.min(time), last.max(time)]));
        }
    }
    Ok(ends)
}

/// Where a time lies among key times.
struct KeyPosition {
    /// The key at or before the time (or the first one).
    key: usize,
    /// The key after it; the same one outside the keys.
    next: usize,
    /// From 0 at `key` to 1 at `next`.
    part: f64,
    /// Time from `key` to `next` [s].
    span: f64,
}

fn position(
    document: &Document,
    sampler: &json::animation::Sampler,
    time: f64,
    what: &str,
) -> Result<(KeyPosition, usize)> {
    let keys = document.vectors::<1>(sampler.input, what)?;
    if keys.is_empty() || keys.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(document.error(format!("{what} has key times that do not increase")));
    }
    let after = keys.partition_point(|key| f64::from(key[0]) <= time);
    let (key, next) = (after.saturating_sub(1), after.min(keys.len() - 1));
    let (start, end) = (f64::from(keys[key][0]), f64::from(keys[next][0]));
    let span = end - start;
    let part = if span > 0.0 { (time - start) / span } else { 0.0 };
    Ok((KeyPosition { key, next, part, span }, keys.len()))
}

fn interpolation(document: &Document, sampler: &json::animation::Sampler, what: &str) -> Result<Interpolation> {
    match sampler.interpolation {
        Checked::Valid(interpolation) => Ok(interpolation),
        Checked::Invalid => Err(document.error(format!("{what} has an unknown interpolation"))),
    }
}

/// Value of a vector (N = 3) or rotation (N = 4) channel. Rotations go along the great arc (slerp), as glTF says.
fn sample<const N: usize>(
    document: &Document,
    sampler: &json::animation::Sampler,
    time: f64,
    what: &str,
) -> Result<[f64; N]> {
    let (at, keys) = position(document, sampler, time, what)?;
    let interpolation = interpolation(document, sampler, what)?;
    let values: Vec<[f32; N]> = document.vectors(sampler.output, what)?;
    check_count(document, values.len(), keys, interpolation, what)?;
    let value = |i: usize| values[i].map(f64::from);
    Ok(match interpolation {
        Interpolation::Step => value(at.key),
        Interpolation::Linear if N == 4 => {
            let of = |i: usize| unit(std::array::from_fn(|c| value(i)[c.min(N - 1)]));
            let turned = of(at.key).slerp(of(at.next), at.part).to_array();
            std::array::from_fn(|c| turned[c])
        }
        Interpolation::Linear => {
            let (a, b) = (value(at.key), value(at.next));
            std::array::from_fn(|c| a[c] + at.part * (b[c] - a[c]))
        }
        Interpolation::CubicSpline => {
            let (key, next) = (3 * at.key, 3 * at.next);
            std::array::from_fn(|c| {
                let of = |i: usize| f64::from(values[i][c]);
                hermite(of(key + 1), of(key + 2), of(next + 1), of(next), &at)
            })
        }
    })
}

fn sample_weights(document: &Document, sampler: &json::animation::Sampler, time: f64, what: &str) -> Result<Vec<f32>> {
    let (at, keys) = position(document, sampler, time, what)?;
    let interpolation = interpolation(document, sampler, what)?;
    let values = document.vectors::<1>(sampler.output, what)?;
    let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let targets = values.len() / (keys * per_key);
    check_count(document, values.len(), keys * targets, interpolation, what)?;
    let value = |row: usize, target: usize| f64::from(values[row * targets + target][0]);
    let weight = |target: usize| match interpolation {
        Interpolation::Step => value(at.key, target),
        Interpolation::Linear => {
            let (a, b) = (value(at.key, target), value(at.next, target));
            a + at.part * (b - a)
        }
        Interpolation::CubicSpline => {
            let (key, next) = (3 * at.key, 3 * at.next);
            hermite(value(key + 1, target), value(key + 2, target), value(next + 1, target), value(next, target), &at)
        }
    };
    Ok((0..targets).map(|target| weight(target) as f32).collect())
}

fn check_count(
    document: &Document,
    values: usize,
    keys: usize,
    interpolation: Interpolation,
    what: &str,
) -> Result<()> {
    let expected = if interpolation == Interpolation::CubicSpline { 3 * keys } else { keys };
    if values != expected || values == 0 {
        return Err(document.error(format!("{what} has {values} values where its key times need {expected}")));
    }
    Ok(())
}

/// Cubic Hermite spline of glTF 2.0, appendix C: from `v0` with out-tangent `b0` to `v1` with in-tangent `a1`.
fn hermite(v0: f64, b0: f64, v1: f64, a1: f64, at: &KeyPosition) -> f64 {
    let (t, td) = (at.part, at.span);
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * v0 + td * (t3 - 2.0 * t2 + t) * b0 + (3.0 * t2 - 2.0 * t3) * v1 + td * (t3 - t2) * a1
}
