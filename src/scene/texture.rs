//! Decoded images, sampled as glTF says: sRGB decoding, wrapping, filtering by footprint.

use glam::{Vec2, Vec4};

/// How coordinates outside [0, 1] are brought back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The picture repeats.
    #[default]
    Repeat,
    /// Every other repetition is mirrored.
    MirroredRepeat,
    /// The edge goes on for ever.
    ClampToEdge,
}

/// One level of a mip pyramid: linear RGBA.
#[derive(Clone, Debug)]
pub struct Level {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Linear RGBA, row-major, row 0 on top (v = 0).
    pub texels: Vec<Vec4>,
}

/// An image with its sampler.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name or address in the file, for messages.
    pub name: String,
    /// Mip pyramid, finest first, averaged in linear light.
    pub levels: Vec<Level>,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
    /// Whether the magnified picture is interpolated (glTF LINEAR) or blocky (NEAREST).
    pub linear: bool,
}

/// sRGB code value in [0, 1] to linear light (IEC 61966-2-1).
pub fn linear_from_srgb(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Linear light in [0, 1] to sRGB code value (IEC 61966-2-1).
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

impl Texture {
    /// Builds the pyramid from 8-bit RGBA; `srgb` for colour, not for data such as roughness. Alpha is always linear.
    pub fn from_rgba8(
        name: String,
        width: usize,
        height: usize,
        rgba: &[u8],
        srgb: bool,
        wrap: [Wrap; 2],
        linear: bool,
    ) -> Self {
        let decode: Vec<f32> = (0..256)
            .map(|code| {
                let value = code as f32 / 255.0;
                if srgb { linear_from_srgb(value) } else { value }
            })
            .collect();
        let texels = rgba
            .chunks_exact(4)
            .map(|p| {
                Vec4::new(decode[p[0] as usize], decode[p[1] as usize], decode[p[2] as usize], f32::from(p[3]) / 255.0)
            })
            .collect();
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            let next = halved(last);
            levels.push(next);
        }
        Self { name, levels, wrap, linear }
    }

    /// Colour at `uv`, averaged over a footprint of `width` in texture coordinates (0: no averaging). Trilinear.
    pub fn sample(&self, uv: Vec2, width: f32) -> Vec4 {
        let finest = &self.levels[0];
        let texels = width * finest.width.max(finest.height) as f32;
        let lod = if texels > 1.0 { texels.log2().min((self.levels.len() - 1) as f32) } else { 0.0 };
        let below = lod.floor() as usize;
        let part = lod - below as f32;
        let fine = self.bilinear(below, uv);
        if part == 0.0 { fine } else { fine.lerp(self.bilinear(below + 1, uv), part) }
    }

    fn bilinear(&self, level: usize, uv: Vec2) -> Vec4 {
        let picture = &self.levels[level];
        let fetch = |x: i64, y: i64| {
            let x = wrapped(x, picture.width, self.wrap[0]);
            let y = wrapped(y, picture.height, self.wrap[1]);
            picture.texels[y * picture.width + x]
        };
        // Coordinates beyond ±1e6 repetitions have no meaningful fraction left in f32; they are read as 0.
        let clean = |c: f32| if c.is_finite() && c.abs() < 1e6 { c } else { 0.0 };
        let (u, v) = (clean(uv.x) * picture.width as f32, clean(uv.y) * picture.height as f32);
        if !self.linear && level == 0 {
            return fetch(u.floor() as i64, v.floor() as i64);
        }
        let (u, v) = (u - 0.5, v - 0.5);
        let (x, y) = (u.floor(), v.floor());
        let (fx, fy) = (u - x, v - y);
        let (x, y) = (x as i64, y as i64);
        let top = fetch(x, y).lerp(fetch(x + 1, y), fx);
        let bottom = fetch(x, y + 1).lerp(fetch(x + 1, y + 1), fx);
        top.lerp(bottom, fy)
    }
}

fn wrapped(i: i64, n: usize, wrap: Wrap) -> usize {
    let n = n as i64;
    let inside = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::ClampToEdge => i.clamp(0, n - 1),
        Wrap::MirroredRepeat => {
            let j = i.rem_euclid(2 * n);
            if j < n { j } else { 2 * n - 1 - j }
        }
    };
    inside as usize
}

fn halved(level: &Level) -> Level {
    let (width, height) = ((level.width / 2).max(1), (level.height / 2).max(1));
    let texels = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            // Each coarse texel is the mean of the fine texels that it covers, also when a side is odd or 1.
            let (x0, x1) = (x * level.width / width, (x + 1) * level.width / width);
            let (y0, y1) = (y * level.height / height, (y + 1) * level.height / height);
            let sum: Vec4 = (y0..y1).flat_map(|y| (x0..x1).map(move |x| level.texels[y * level.width + x])).sum();
            sum / ((x1 - x0) * (y1 - y0)) as f32
        })
        .collect();
    Level { width, height, texels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trip_and_known_values() {
        for i in 0..=255u8 {
            let code = f32::from(i) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(code)) - code).abs() < 1e-5);
        }
        // IEC 61966-2-1: code 188/255 is 0.5029 linear.
        assert!((linear_from_srgb(188.0 / 255.0) - 0.5029).abs() < 1e-3);
    }

    #[test]
    fn wrapping_and_mean() {
        let rgba: Vec<u8> = [0u8, 255, 255, 0].iter().flat_map(|&v| [v, v, v, 255]).collect();
        let t = Texture::from_rgba8("t".into(), 2, 2, &rgba, false, [Wrap::Repeat; 2], false);
        assert_eq!(t.sample(Vec2::new(0.25, 0.25), 0.0).x, 0.0);
        assert_eq!(t.sample(Vec2::new(0.75, 0.25), 0.0).x, 1.0);
        assert_eq!(t.sample(Vec2::new(1.25, 0.25), 0.0).x, 0.0);
        assert_eq!(t.sample(Vec2::new(-0.25, 0.25), 0.0).x, 1.0);
        assert!((t.sample(Vec2::new(0.3, 0.3), 1.0).x - 0.5).abs() < 1e-6);
        assert_eq!(wrapped(-1, 4, Wrap::MirroredRepeat), 0);
        assert_eq!(wrapped(4, 4, Wrap::MirroredRepeat), 3);
        assert_eq!(wrapped(9, 4, Wrap::ClampToEdge), 3);
    }
}
