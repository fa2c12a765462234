//! Views of a plate with words: what it is, where the eye stands, in which light; two eyes side by side, and an eye that moves.

use super::view::PlateView;
use crate::error::Result;
use crate::reconstruction::ColorPicture;
use crate::reconstruction::canvas::{Canvas, LETTER_HEIGHT, LETTER_WIDTH};
use crate::scene::texture::srgb_from_linear;
use crate::units::show_length;
use std::path::Path;

/// Room around pictures and words [px].
const GAP: usize = 10;
/// Size of letters.
const SCALE: usize = 2;
const LINE: usize = LETTER_HEIGHT * SCALE + 2;
/// Least width of a picture [px]: smaller ones are shown in larger pixels.
const CELL: usize = 300;
const GROUND: [u8; 3] = [24; 3];
const INK: [u8; 3] = [236; 3];
const PALE: [u8; 3] = [150; 3];
/// How long each picture of a walk is shown [ms].
const PACE: u16 = 120;

/// Words in lines of so many letters; a longer word is a line of its own, and is cut by the canvas.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= columns => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A place in words.
pub(super) fn place(position: [f64; 3]) -> String {
    position.map(show_length).join(", ")
}

impl PlateView {
    /// What is seen, from where, and in which light: a line each.
    pub fn words(&self) -> [String; 3] {
        let report = &self.report;
        let made_of = self.inputs().join(", ");
        let light = match &report.lamp {
            Some(lamp) => lamp.to_string(),
            None => "laser".into(),
        };
        let waves: Vec<String> = report.wavelengths.iter().map(|w| show_length(*w)).collect();
        [
            format!("plate {} of {made_of}, simulated", self.plate().name),
            format!(
                "eye {}; pupil {}, focus {}",
                place(report.eye),
                show_length(self.pupil()),
                show_length(report.focus)
            ),
            format!("light: {light}; {}", waves.join(", ")),
        ]
    }

    /// The value of this view that a share of its pixels does not pass: what is shown as white.
    pub fn white(&self, share: f64) -> f32 {
        self.picture().percentile(share)
    }

    fn coded(&self, white: f32) -> Vec<[u8; 3]> {
        coded(&self.picture(), white)
    }

    /// The traced picture below its words.
    pub(super) fn traced_with_words(&self, traced: &ColorPicture, white: f32) -> Canvas {
        let [_, eye, _] = self.words();
        let mut words = vec![format!("{}, ray-traced: what should be seen", self.inputs().join(", ")), eye];
        words.extend(self.report.likeness.map(|alike| format!("the plate's SSIM to it is {:.3}", alike.ssim)));
        canvas(&[(coded(traced, white), String::new())], self.size(), &words)
    }

    /// The view below its words, with light of the value `white` shown as white.
    pub fn labelled(&self, white: f32) -> Canvas {
        canvas(&[(self.coded(white), String::new())], self.size(), &self.words())
    }
}

/// sRGB-coded pixels of a picture.
fn coded(picture: &ColorPicture, white: f32) -> Vec<[u8; 3]> {
    let gain = if white > 0.0 { 1.0 / white } else { 0.0 };
    let code = |v: f32| (srgb_from_linear((v * gain).clamp(0.0, 1.0)) * 255.0).round() as u8;
    picture.rgb.iter().map(|rgb| rgb.map(code)).collect()
}

/// Pictures beside each other, each below its own name, all below words.
fn canvas(pictures: &[(Vec<[u8; 3]>, String)], (width, height): (usize, usize), words: &[String]) -> Canvas {
    let scale = CELL.div_ceil(width.max(1)).clamp(1, 8);
    let whole = GAP + pictures.len() * (width * scale + GAP);
    let columns = (whole - 2 * GAP) / (LETTER_WIDTH * SCALE);
    let lines: Vec<(usize, String)> = words
        .iter()
        .enumerate()
        .flat_map(|(i, text)| wrapped(text, columns).into_iter().map(move |l| (i, l)))
        .collect();
    let named = usize::from(pictures.iter().any(|(_, name)| !name.is_empty()));
    let top = GAP + lines.len() * LINE + named * LINE;
    let mut canvas = Canvas::new(whole, top + height * scale + GAP, GROUND);
    for (row, (index, line)) in lines.iter().enumerate() {
        canvas.write((GAP, GAP + row * LINE), SCALE, if *index == 0 { INK } else { PALE }, line);
    }
    for (column, (pixels, name)) in pictures.iter().enumerate() {
        let left = GAP + column * (width * scale + GAP);
        canvas.write((left, top - LINE), SCALE, INK, if named == 1 { name } else { "" });
        canvas.put((left, top), width, scale, pixels);
    }
    canvas
}

/// Writes what the left and the right eye see, side by side: left for the left eye. The same light is white in both.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn write_pair(left: &PlateView, right: &PlateView, share: f64, path: &Path) -> Result<()> {
    let white = left.white(share).max(right.white(share));
    let side = |view: &PlateView, name: &str| {
        (view.coded(white), format!("{name} eye, x = {}", show_length(view.report.eye[0])))
    };
    let [what, _, light] = left.words();
    let pictures = [side(left, "left"), side(right, "right")];
    let drawn = canvas(&pictures, left.size(), &[what, light]);
    drawn.write_png(path, &left.texts("simulated views of a plate by both eyes, side by side"))
}

/// Writes what an eye sees that walks past a plate and back, as an animated PNG. The same light is white in all.
///
/// # Errors
/// [`crate::Error::Parameter`] for no views, [`crate::Error::Io`].
pub fn write_walk(views: &[PlateView], share: f64, path: &Path) -> Result<()> {
    let white = views.iter().map(|view| view.white(share)).fold(0.0, f32::max);
    let back = views.iter().rev().skip(1).take(views.len().saturating_sub(2));
    let frames: Vec<Canvas> = views.iter().chain(back).map(|view| view.labelled(white)).collect();
    let texts = views.first().map(|view| view.texts("simulated views of a plate by an eye that walks past it"));
    Canvas::write_animated_png(&frames, PACE, path, texts.as_ref().map_or(&[][..], |texts| texts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_break_where_they_must_and_none_is_lost() {
        let text = "eye 0 mm, 0 mm, 40 mm; pupil 4 mm";
        for columns in [1, 8, 12, 33, 90] {
            let lines = wrapped(text, columns);
            assert_eq!(lines.join(" "), text);
            assert!(lines.iter().all(|line| line.chars().count() <= columns || !line.contains(' ')), "{lines:?}");
        }
        assert_eq!(wrapped(text, 33), [text]);
    }

    #[test]
    fn pictures_stand_beside_each_other_below_their_words() {
        let (red, blue) = (vec![[255, 0, 0]; 150 * 20], vec![[0, 0, 255]; 150 * 20]);
        let drawn = canvas(&[(red, "left".into()), (blue, "right".into())], (150, 20), &["what it is".into()]);
        // Shown twice as large, so that names have room.
        assert_eq!((drawn.width, drawn.height), (2 * 300 + 3 * GAP, 2 * GAP + 2 * LINE + 40));
        let at = |x: usize, y: usize| drawn.pixels[y * drawn.width + x];
        let top = GAP + 2 * LINE;
        assert_eq!((at(GAP, top), at(GAP + 299, top + 39)), ([255, 0, 0], [255, 0, 0]));
        assert_eq!((at(2 * GAP + 300, top), at(2 * GAP + 599, top + 39)), ([0, 0, 255], [0, 0, 255]));
        assert_eq!(at(GAP + 304, top), GROUND);
        assert!(drawn.pixels[..top * drawn.width].contains(&INK));
    }
}
