//! Points as files give them, one property after another, gathered into a cloud: what a property means is decided here once
//! for all kinds of file.

use super::ply::Read;
use super::{PointCloud, PointSource, luminance};
use crate::scene::texture::linear_from_srgb;
use glam::DVec3;

/// What a property of a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    Position(usize),
    Amplitude,
    AmplitudeRgb(usize),
    /// A colour, and the value of its full scale; none: floats, whose scale is found in the end.
    Color(usize, Option<f64>),
    Phase,
    /// What a scanner got back: the light's power.
    Intensity,
    /// First coefficient of a Gaussian splat's colour.
    Splat(usize),
    /// A splat's opacity before its logistic function.
    Opacity,
    Other,
}

impl Role {
    /// The role of a property of that name; `full`: full scale of whole numbers.
    pub(super) fn named(name: &str, full: Option<f64>) -> Self {
        let name = name.trim().to_ascii_lowercase();
        let plain = name.strip_prefix("scalar_").unwrap_or(&name);
        match plain {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "amplitude" => Self::Amplitude,
            "amplitude_r" => Self::AmplitudeRgb(0),
            "amplitude_g" => Self::AmplitudeRgb(1),
            "amplitude_b" => Self::AmplitudeRgb(2),
            "red" | "r" | "diffuse_red" => Self::Color(0, full),
            "green" | "g" | "diffuse_green" => Self::Color(1, full),
            "blue" | "b" | "diffuse_blue" => Self::Color(2, full),
            "phase" => Self::Phase,
            "intensity" | "i" | "reflectance" | "remission" => Self::Intensity,
            "f_dc_0" => Self::Splat(0),
            "f_dc_1" => Self::Splat(1),
            "f_dc_2" => Self::Splat(2),
            "opacity" => Self::Opacity,
            _ => Self::Other,
        }
    }
}

/// How a cloud's amplitudes are found.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Light {
    Exact,
    Amplitude,
    Color,
    Splat,
    Intensity,
    /// All points are alike.
    None,
}

/// A cloud in the making.
pub(super) struct Gather {
    light: Light,
    /// Full scale of colours that are whole numbers.
    full: Option<f64>,
    idle: bool,
    points: Vec<PointSource>,
    rgb: Vec<[f32; 3]>,
    left_out: usize,
}

/// One point as it stands in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    position: DVec3,
    amplitude: f64,
    phase: f64,
    color: [f64; 3],
    intensity: f64,
    opacity: f64,
}

impl Vertex {
    pub(super) fn new() -> Self {
        Self {
            position: DVec3::ZERO,
            amplitude: 1.0,
            phase: 0.0,
            color: [1.0; 3],
            intensity: 1.0,
            opacity: f64::INFINITY,
        }
    }
}

/// Intensities are signed numbers where the least is farther below zero than this part of the greatest.
const SIGNED: f32 = 0.25;

impl Gather {
    /// For files with these properties.
    pub(super) fn new(roles: &[Role], expected: usize) -> Self {
        let has = |role: Role| roles.contains(&role);
        let colors = roles.iter().any(|role| matches!(role, Role::Color(..)));
        let light = if (0..3).all(|c| has(Role::AmplitudeRgb(c))) {
            Light::Exact
        } else if has(Role::Amplitude) {
            Light::Amplitude
        } else if (0..3).all(|c| has(Role::Splat(c))) {
            Light::Splat
        } else if colors {
            Light::Color
        } else if has(Role::Intensity) {
            Light::Intensity
        } else {
            Light::None
        };
        let full = roles.iter().find_map(|role| match role {
            Role::Color(_, full) => *full,
            _ => None,
        });
        let colored = matches!(light, Light::Exact | Light::Color | Light::Splat);
        Self {
            light,
            full,
            idle: light == Light::Color && has(Role::Intensity),
            points: Vec::with_capacity(expected),
            rgb: Vec::with_capacity(if colored { expected } else { 0 }),
            left_out: 0,
        }
    }

    /// Puts a property's value into a point.
    pub(super) fn put(&self, role: Role, value: f64, point: &mut Vertex) {
        match role {
            Role::Position(axis) => point.position[axis] = value,
            Role::Amplitude => point.amplitude = value,
            Role::AmplitudeRgb(c) if self.light == Light::Exact => point.color[c] = value,
            Role::Color(c, _) if self.light == Light::Color => point.color[c] = value,
            Role::Splat(c) if self.light == Light::Splat => point.color[c] = value,
            Role::Phase => point.phase = value,
            Role::Intensity => point.intensity = value,
            Role::Opacity => point.opacity = value,
            _ => {}
        }
    }

    /// Adds a point; one that is not finite is left out and counted.
    pub(super) fn push(&mut self, point: &Vertex) {
        let light = match self.light {
            Light::Amplitude => point.amplitude,
            Light::Intensity => point.intensity,
            _ => point.color.iter().sum(),
        };
        if !(point.position.is_finite() && point.phase.is_finite() && light.is_finite()) {
            self.left_out += 1;
            return;
        }
        let amplitude = match self.light {
            Light::Amplitude => point.amplitude as f32,
            // Powers until their greatest is known.
            Light::Intensity => point.intensity as f32,
            _ => 1.0,
        };
        match self.light {
            Light::Exact | Light::Color => self.rgb.push(point.color.map(|c| c as f32)),
            Light::Splat => self.rgb.push(of_splat(point)),
            _ => {}
        }
        self.points.push(PointSource { position: point.position, amplitude, phase: point.phase });
    }

    /// The cloud, and what a user should know of it.
    pub(super) fn finish(mut self) -> Read {
        let mut read = Read::default();
        let count = self.points.len() + self.left_out;
        if self.left_out > 0 {
            let left_out = self.left_out;
            read.warnings
                .push(format!("{left_out} of {count} points are not finite (not measured); they are left out"));
        }
        if self.idle {
            read.warnings.push("it has colours and intensities; the colours are taken".into());
        }
        match self.light {
            Light::Color => self.scale_colors(&mut read),
            Light::Splat => {
                read.origin = format!("{count} Gaussian splats, taken as points of their colour and opacity")
            }
            Light::Intensity => {
                let most = self.points.iter().fold(f32::NEG_INFINITY, |a, p| a.max(p.amplitude));
                // Some scanners count from the middle of their range; a little below zero is noise.
                let least = self.points.iter().fold(0.0, |a: f32, p| a.min(p.amplitude));
                let least = if least < -SIGNED * most.max(0.0) { least } else { 0.0 };
                if most > least {
                    let part = |p: f32| (p - least).max(0.0) / (most - least);
                    self.points.iter_mut().for_each(|p| p.amplitude = part(p.amplitude).sqrt());
                    let from = if least < 0.0 { format!(" from {least}, which is taken as 0,") } else { String::new() };
                    read.origin = format!("{count} points with intensities{from} up to {most}, which is taken as 1");
                } else if !self.points.is_empty() {
                    self.points.iter_mut().for_each(|p| p.amplitude = 1.0);
                    read.warnings.push(format!("all its intensities are {most}; its points are taken as white"));
                }
            }
            _ => {}
        }
        for (point, rgb) in self.points.iter_mut().zip(&self.rgb) {
            point.amplitude = luminance(rgb.map(|a| a * a)).sqrt();
        }
        // A cloud whose three amplitudes are the same everywhere is colourless.
        let gray = self.light == Light::Color && self.rgb.iter().all(|c| c[0] == c[1] && c[1] == c[2]);
        if gray {
            self.points.iter_mut().zip(&self.rgb).for_each(|(point, c)| point.amplitude = c[0]);
        }
        let colored = matches!(self.light, Light::Exact | Light::Color | Light::Splat) && !gray;
        read.cloud = PointCloud { points: self.points, rgb: colored.then_some(self.rgb) };
        read
    }

    /// Brings colours to 0 … 1.
    fn scale_colors(&mut self, read: &mut Read) {
        let most = self.rgb.iter().flatten().fold(0.0, |a: f32, &b| a.max(b));
        let full = self.full.unwrap_or(match most {
            // A little above 1 is a bright colour, not another scale.
            most if most < 2.0 => 1.0,
            most if most <= 255.0 => 255.0,
            _ => 65535.0,
        });
        if self.full.is_none() && full > 1.0 {
            read.origin = format!("colours as floats up to {most}, taken as parts of {full}");
        }
        if most <= 0.0 && !self.rgb.is_empty() {
            self.rgb.fill([full as f32; 3]);
            read.warnings.push("all its colours are black; its points are taken as white".into());
        }
        let mut clamped = 0;
        for rgb in &mut self.rgb {
            let scaled = rgb.map(|c| (f64::from(c) / full) as f32);
            *rgb = scaled.map(|c| c.clamp(0.0, 1.0));
            clamped += usize::from(*rgb != scaled);
        }
        if clamped > 0 {
            read.warnings.push(format!("{clamped} points had a colour outside its range; it was clamped"));
        }
    }
}

/// Amplitudes of a splat, seen from anywhere: √(linear colour × opacity); the colour is ½ + c·Y₀₀ (Kerbl et al., *ACM Trans.
/// Graph.* 42 (2023)).
fn of_splat(point: &Vertex) -> [f32; 3] {
    const Y00: f64 = 0.282_094_791_773_878_14;
    let opacity = 1.0 / (1.0 + (-point.opacity).exp());
    point.color.map(|c| {
        let coded = (0.5 + Y00 * c).clamp(0.0, 1.0) as f32;
        (f64::from(linear_from_srgb(coded)) * opacity).sqrt() as f32
    })
}
