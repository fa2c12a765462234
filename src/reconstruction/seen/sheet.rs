//! The gallery on paper: one sheet with all of it, single pictures, and moving ones.

use super::{SeenGallery, SeenShot};
use crate::error::Result;
use crate::reconstruction::canvas::{Canvas, LETTER_HEIGHT, LETTER_WIDTH};
use crate::reconstruction::{Reconstruction, write_coded_png};
use crate::scene::texture::srgb_from_linear;
use std::path::Path;

/// Room between cells [px].
const GAP: usize = 10;
/// Least width of a cell [px]: smaller pictures are shown in larger pixels.
const CELL: usize = 300;
/// Size of letters.
const SCALE: usize = 2;
const LINE: usize = LETTER_HEIGHT * SCALE + 2;
const GROUND: [u8; 3] = [24; 3];
const INK: [u8; 3] = [236; 3];
const PALE: [u8; 3] = [150; 3];
/// How long each picture of a sweep is shown [ms].
const PACE: u16 = 90;

/// sRGB-coded pixels; white is 1.
fn coded(picture: &Reconstruction) -> Vec<[u8; 3]> {
    let code = |v: f32| (srgb_from_linear(v.clamp(0.0, 1.0)) * 255.0).round() as u8;
    match picture {
        Reconstruction::Gray(seen) => seen.values.iter().map(|v| [code(*v); 3]).collect(),
        Reconstruction::Color(seen) => seen.rgb.iter().map(|rgb| rgb.map(code)).collect(),
    }
}

/// How pictures of one size stand on a canvas.
#[derive(Clone, Copy)]
struct Cells {
    size: (usize, usize),
    scale: usize,
}

impl Cells {
    fn of(picture: &Reconstruction) -> Self {
        let size = picture.size();
        Self { size, scale: CELL.div_ceil(size.0.max(1)).clamp(1, 8) }
    }

    fn width(&self) -> usize {
        self.size.0 * self.scale
    }

    fn height(&self) -> usize {
        self.size.1 * self.scale
    }

    fn put(&self, canvas: &mut Canvas, at: (usize, usize), picture: &Reconstruction) {
        canvas.put(at, self.size.0, self.scale, &coded(picture));
    }

    /// A line that is cut where the cell ends.
    fn line(&self, canvas: &mut Canvas, at: (usize, usize), colour: [u8; 3], text: &str) {
        let fits: String = text.chars().take(self.width() / (LETTER_WIDTH * SCALE)).collect();
        canvas.write(at, SCALE, colour, &fits);
    }
}

/// A name as it is read: `eye-left` is "eye left".
fn title(name: &str) -> String {
    name.replace('-', " ")
}

impl SeenGallery {
    /// The sheet: what should be seen above what the hologram shows; the scene through a pinhole and all depths in focus, then the
    /// places of the eye box.
    pub fn overview(&self) -> Canvas {
        let cells = Cells::of(&self.traced);
        let columns = 1 + self.focus.len().max(self.eyes.len());
        let bands = if self.eyes.is_empty() { 1 } else { 2 };
        let band = 2 * LINE + 2 * cells.height() + GAP;
        let width = GAP + columns * (cells.width() + GAP);
        let mut canvas = Canvas::new(width, GAP + LINE + bands * (band + GAP), GROUND);
        let fits: String = self.viewer.chars().take((width - 2 * GAP) / (LETTER_WIDTH * SCALE)).collect();
        canvas.write((GAP, GAP), SCALE, INK, &fits);
        let (top, below) = (GAP + LINE, LINE + cells.height() + GAP);
        let left = |column: usize| GAP + column * (cells.width() + GAP);

        cells.line(&mut canvas, (left(0), top), INK, "traced");
        cells.put(&mut canvas, (left(0), top + LINE), &self.traced);
        for (line, (colour, text)) in self.lines().into_iter().enumerate() {
            cells.line(&mut canvas, (left(0), top + below + line * LINE), colour, &text);
        }
        let mut pair = |shot: &SeenShot, left: usize, top: usize| {
            cells.line(&mut canvas, (left, top), INK, &title(&shot.name));
            cells.put(&mut canvas, (left, top + LINE), &shot.wanted);
            cells.put(&mut canvas, (left, top + below), &shot.seen);
            let figures = format!("{:.1} dB, SSIM {:.3}", shot.figures.psnr, shot.figures.ssim);
            cells.line(&mut canvas, (left, top + below + cells.height() + 4), PALE, &figures);
        };
        for (column, shot) in self.focus.iter().enumerate() {
            pair(shot, left(column + 1), top);
        }
        for (column, shot) in self.eyes.iter().enumerate() {
            pair(shot, left(column + 1), top + band + GAP);
        }
        if !self.eyes.is_empty() {
            for (line, (colour, text)) in self.lines_of_box().into_iter().enumerate() {
                cells.line(&mut canvas, (left(0), top + band + GAP + (line + 1) * LINE), colour, &text);
            }
        }
        canvas
    }

    /// What stands below the traced picture.
    fn lines(&self) -> Vec<([u8; 3], String)> {
        let all = &self.figures.all;
        vec![
            (INK, "above: to be seen".to_owned()),
            (INK, "below: hologram".to_owned()),
            (PALE, format!("{} held-out looks:", self.figures.looks)),
            (INK, format!("PSNR {:.1} dB", all.psnr)),
            (INK, format!("worst {:.1} dB", all.psnr_worst)),
            (INK, format!("SSIM {:.3}", all.ssim)),
            (INK, format!("contrast {:.3}", all.contrast)),
            match all.psnr_in_focus {
                Some(sharp) if self.whole => (INK, format!("in focus {sharp:.1} dB")),
                _ => (INK, format!("light in eye {:.1} %", 1e2 * all.efficiency)),
            },
        ]
    }

    /// What stands beside the places of the eye box.
    fn lines_of_box(&self) -> Vec<([u8; 3], String)> {
        let all = &self.figures.all;
        vec![
            (INK, "the eye moves".to_owned()),
            (INK, "through its box".to_owned()),
            (PALE, "over the box:".to_owned()),
            (INK, format!("brightness ±{:.0} %", 1e2 * all.brightness_spread)),
            (INK, format!("light in box {:.1} %", 1e2 * all.box_efficiency)),
        ]
    }

    /// Frames of a sweep: what should be seen beside what the hologram shows.
    fn frames(&self, sweep: &[SeenShot]) -> Vec<Canvas> {
        let frame = |shot: &SeenShot| {
            let cells = Cells::of(&shot.seen);
            let mut canvas = Canvas::new(3 * GAP + 2 * cells.width(), 2 * GAP + LINE + cells.height(), GROUND);
            let right = 2 * GAP + cells.width();
            cells.line(&mut canvas, (GAP, GAP), INK, &title(&shot.name));
            cells.line(&mut canvas, (right, GAP), INK, &format!("hologram {:.1} dB", shot.figures.psnr));
            cells.put(&mut canvas, (GAP, GAP + LINE), &shot.wanted);
            cells.put(&mut canvas, (right, GAP + LINE), &shot.seen);
            canvas
        };
        sweep.iter().map(frame).collect()
    }

    /// Writes `overview.png`, `seen-NAME.png` and `wanted-NAME.png` of each look into a folder, the sweeps as `sweep-focus.png` and
    /// `sweep-eye.png`, and, where the traced picture is not the caller's own, `traced.png`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        let figures = serde_json::to_string(&self.figures).unwrap_or_default();
        let texts = |what: &str| [("Description", format!("simulated: {what}")), ("holodrive", figures.clone())];
        let overview = format!("what an eye should see, and what it sees of the hologram ({})", self.viewer);
        self.overview().write_png(&folder.join("overview.png"), &texts(&overview))?;
        let single = |name: String, what: &str, picture: &Reconstruction| {
            let (width, height) = picture.size();
            write_coded_png(&folder.join(name), width, height, coded(picture).as_flattened(), &texts(what))
        };
        if self.pinhole {
            single("traced.png".into(), "the scene through a pinhole", &self.traced)?;
        }
        for shot in self.focus.iter().chain(&self.eyes) {
            single(format!("seen-{}.png", shot.name), "what an eye sees of the hologram", &shot.seen)?;
            single(format!("wanted-{}.png", shot.name), "what an eye should see", &shot.wanted)?;
        }
        if !self.focus_sweep.is_empty() {
            let mut frames = self.frames(&self.focus_sweep);
            let back: Vec<Canvas> = frames[1..frames.len() - 1].iter().rev().cloned().collect();
            frames.extend(back);
            let path = folder.join("sweep-focus.png");
            Canvas::write_animated_png(&frames, PACE, &path, &texts("the eye focuses from near to far and back"))?;
        }
        if !self.eye_sweep.is_empty() {
            let path = folder.join("sweep-eye.png");
            let frames = self.frames(&self.eye_sweep);
            Canvas::write_animated_png(&frames, PACE, &path, &texts("the eye goes round its box"))?;
        }
        Ok(())
    }
}
