//! Pictures with words: contact sheets, overviews and the operator's view; still, or moving as an animated PNG.

use super::picture::{encode, refused, write_coded_png};
use crate::error::{Error, Result};
use crate::files;
use std::path::Path;

/// Columns of a letter with the gap to the next one, at scale 1 [px].
pub const LETTER_WIDTH: usize = 6;
/// Rows of a letter with its tail and the gap to the next line, at scale 1 [px].
pub const LETTER_HEIGHT: usize = 11;
/// Letters with a tail: they stand two rows lower.
const TAILED: [char; 5] = ['g', 'p', 'q', 'y', 'µ'];

/// An 8-bit RGB picture that is drawn on, row 0 on top. What lies outside is left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixels, row-major.
    pub pixels: Vec<[u8; 3]>,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Fills a rectangle: left, top, width and height [px].
    pub fn fill(&mut self, [left, top, width, height]: [usize; 4], colour: [u8; 3]) {
        for row in top..(top + height).min(self.height) {
            let (from, to) = (left.min(self.width), (left + width).min(self.width));
            self.pixels[row * self.width + from..row * self.width + to].fill(colour);
        }
    }

    /// Puts gray bytes, `width` to a row, with their first pixel at (left, top).
    pub fn put_gray(&mut self, (left, top): (usize, usize), width: usize, gray: &[u8]) {
        for (row, line) in gray.chunks(width.max(1)).enumerate().take_while(|(row, _)| top + row < self.height) {
            for (column, &level) in line.iter().enumerate().take_while(|(column, _)| left + column < self.width) {
                self.pixels[(top + row) * self.width + left + column] = [level; 3];
            }
        }
    }

    /// Puts coloured pixels, `width` to a row, each as `scale × scale` pixels, with the first at (left, top).
    pub fn put(&mut self, (left, top): (usize, usize), width: usize, scale: usize, pixels: &[[u8; 3]]) {
        for (row, line) in pixels.chunks(width.max(1)).enumerate() {
            for (column, &colour) in line.iter().enumerate() {
                self.fill([left + column * scale, top + row * scale, scale, scale], colour);
            }
        }
    }

    /// Writes one line with its upper left corner at (left, top); a letter is `scale` × 5 by `scale` × 7 pixels, and a tail. A
    /// letter that is not known becomes a filled block.
    pub fn write(&mut self, (left, top): (usize, usize), scale: usize, colour: [u8; 3], text: &str) {
        for (place, letter) in text.chars().enumerate().filter(|(_, letter)| *letter != ' ') {
            let rows = LETTERS.iter().find(|(known, _)| *known == letter).map_or([0x1F; 7], |(_, rows)| *rows);
            let lower = if TAILED.contains(&letter) { 2 } else { 0 };
            for (row, bits) in rows.into_iter().enumerate() {
                let row = row + lower;
                for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                    let at = [left + (place * LETTER_WIDTH + column) * scale, top + row * scale, scale, scale];
                    self.fill(at, colour);
                }
            }
        }
    }

    /// Writes it as an 8-bit RGB PNG with text chunks (keyword, text).
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write_png(&self, path: &Path, texts: &[(&str, String)]) -> Result<()> {
        write_coded_png(path, self.width, self.height, self.pixels.as_flattened(), texts)
    }

    /// The bytes of such a PNG.
    ///
    /// # Errors
    /// [`Error::Parameter`] for what a PNG cannot hold.
    pub fn png(&self, texts: &[(&str, String)]) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        encode(&mut bytes, self.width, self.height, png::ColorType::Rgb, self.pixels.as_flattened(), texts)
            .map_err(|e| Error::parameter("picture", e.to_string()))?;
        Ok(bytes)
    }

    /// Writes canvases of one size as an animated PNG (8 bits, gray where all of it is) that plays again and again, each shown for
    /// so many milliseconds; a viewer that does not know of animation shows the first.
    ///
    /// # Errors
    /// [`Error::Parameter`] for no frames or frames of several sizes; [`Error::Io`].
    pub fn write_animated_png(frames: &[Self], milliseconds: u16, path: &Path, texts: &[(&str, String)]) -> Result<()> {
        let Some(first) = frames.first() else { return Err(Error::parameter("animation", "has no frames")) };
        if frames.iter().any(|frame| (frame.width, frame.height) != (first.width, first.height)) {
            return Err(Error::parameter("animation", "has frames of several sizes"));
        }
        let gray = frames.iter().all(|frame| frame.pixels.iter().all(|[r, g, b]| r == g && g == b));
        files::write_whole(path, |out| {
            let refused = |e| refused(path, e);
            let mut encoder = png::Encoder::new(out, first.width as u32, first.height as u32);
            encoder.set_color(if gray { png::ColorType::Grayscale } else { png::ColorType::Rgb });
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
            encoder.set_animated(frames.len() as u32, 0).map_err(refused)?;
            encoder.set_frame_delay(milliseconds, 1000).map_err(refused)?;
            for (keyword, text) in texts {
                encoder.add_itxt_chunk((*keyword).into(), text.clone()).map_err(refused)?;
            }
            let mut writer = encoder.write_header().map_err(refused)?;
            for frame in frames {
                let level = |pixel: &[u8; 3]| if gray { vec![pixel[0]] } else { pixel.to_vec() };
                let bytes: Vec<u8> = frame.pixels.iter().flat_map(level).collect();
                writer.write_image_data(&bytes).map_err(refused)?;
            }
            writer.finish().map_err(refused)
        })
    }
}

/// Letters of 5 columns and 7 rows: a row a byte, its left column in the fifth bit.
#[rustfmt::skip]
const LETTERS: &[(char, [u8; 7])] = &[
    ('0', [0x0E, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0E]),
    ('1', [0x04, 0x0C, 0x04, 0x04, 0x04, 0x04, 0x0E]),
    ('2', [0x0E, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1F]),
    ('3', [0x1F, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0E]),
    ('4', [0x02, 0x06, 0x0A, 0x12, 0x1F, 0x02, 0x02]),
    ('5', [0x1F, 0x10, 0x1E, 0x01, 0x01, 0x11, 0x0E]),
    ('6', [0x06, 0x08, 0x10, 0x1E, 0x11, 0x11, 0x0E]),
    ('7', [0x1F, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08]),
    ('8', [0x0E, 0x11, 0x11, 0x0E, 0x11, 0x11, 0x0E]),
    ('9', [0x0E, 0x11, 0x11, 0x0F, 0x01, 0x02, 0x0C]),
    ('A', [0x0E, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11]),
    ('B', [0x1E, 0x11, 0x11, 0x1E, 0x11, 0x11, 0x1E]),
    ('C', [0x0E, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0E]),
    ('D', [0x1C, 0x12, 0x11, 0x11, 0x11, 0x12, 0x1C]),
    ('E', [0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x1F]),
    ('F', [0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x10]),
    ('G', [0x0E, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0F]),
    ('H', [0x11, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11]),
    ('I', [0x0E, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0E]),
    ('J', [0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0C]),
    ('K', [0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11]),
    ('L', [0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1F]),
    ('M', [0x11, 0x1B, 0x15, 0x15, 0x11, 0x11, 0x11]),
    ('N', [0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11]),
    ('O', [0x0E, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E]),
    ('P', [0x1E, 0x11, 0x11, 0x1E, 0x10, 0x10, 0x10]),
    ('Q', [0x0E, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0D]),
    ('R', [0x1E, 0x11, 0x11, 0x1E, 0x14, 0x12, 0x11]),
    ('S', [0x0F, 0x10, 0x10, 0x0E, 0x01, 0x01, 0x1E]),
    ('T', [0x1F, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04]),
    ('U', [0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E]),
    ('V', [0x11, 0x11, 0x11, 0x11, 0x11, 0x0A, 0x04]),
    ('W', [0x11, 0x11, 0x11, 0x15, 0x15, 0x15, 0x0A]),
    ('X', [0x11, 0x11, 0x0A, 0x04, 0x0A, 0x11, 0x11]),
    ('Y', [0x11, 0x11, 0x11, 0x0A, 0x04, 0x04, 0x04]),
    ('Z', [0x1F, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1F]),
    ('a', [0x00, 0x00, 0x0E, 0x01, 0x0F, 0x11, 0x0F]),
    ('b', [0x10, 0x10, 0x16, 0x19, 0x11, 0x11, 0x1E]),
    ('c', [0x00, 0x00, 0x0E, 0x10, 0x10, 0x11, 0x0E]),
    ('d', [0x01, 0x01, 0x0D, 0x13, 0x11, 0x11, 0x0F]),
    ('e', [0x00, 0x00, 0x0E, 0x11, 0x1F, 0x10, 0x0E]),
    ('f', [0x06, 0x09, 0x08, 0x1C, 0x08, 0x08, 0x08]),
    ('g', [0x0F, 0x11, 0x11, 0x0F, 0x01, 0x01, 0x0E]),
    ('h', [0x10, 0x10, 0x16, 0x19, 0x11, 0x11, 0x11]),
    ('i', [0x04, 0x00, 0x0C, 0x04, 0x04, 0x04, 0x0E]),
    ('j', [0x02, 0x00, 0x06, 0x02, 0x02, 0x12, 0x0C]),
    ('k', [0x10, 0x10, 0x12, 0x14, 0x18, 0x14, 0x12]),
    ('l', [0x0C, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0E]),
    ('m', [0x00, 0x00, 0x1A, 0x15, 0x15, 0x11, 0x11]),
    ('n', [0x00, 0x00, 0x16, 0x19, 0x11, 0x11, 0x11]),
    ('o', [0x00, 0x00, 0x0E, 0x11, 0x11, 0x11, 0x0E]),
    ('p', [0x1E, 0x11, 0x11, 0x1E, 0x10, 0x10, 0x10]),
    ('q', [0x0F, 0x11, 0x11, 0x0F, 0x01, 0x01, 0x01]),
    ('r', [0x00, 0x00, 0x16, 0x19, 0x10, 0x10, 0x10]),
    ('s', [0x00, 0x00, 0x0E, 0x10, 0x0E, 0x01, 0x1E]),
    ('t', [0x08, 0x08, 0x1C, 0x08, 0x08, 0x09, 0x06]),
    ('u', [0x00, 0x00, 0x11, 0x11, 0x11, 0x13, 0x0D]),
    ('v', [0x00, 0x00, 0x11, 0x11, 0x11, 0x0A, 0x04]),
    ('w', [0x00, 0x00, 0x11, 0x11, 0x15, 0x15, 0x0A]),
    ('x', [0x00, 0x00, 0x11, 0x0A, 0x04, 0x0A, 0x11]),
    ('y', [0x11, 0x11, 0x11, 0x0F, 0x01, 0x01, 0x0E]),
    ('z', [0x00, 0x00, 0x1F, 0x02, 0x04, 0x08, 0x1F]),
    ('.', [0x00, 0x00, 0x00, 0x00, 0x00, 0x0C, 0x0C]),
    (',', [0x00, 0x00, 0x00, 0x00, 0x0C, 0x04, 0x08]),
    (':', [0x00, 0x0C, 0x0C, 0x00, 0x0C, 0x0C, 0x00]),
    (';', [0x00, 0x0C, 0x0C, 0x00, 0x0C, 0x04, 0x08]),
    ('-', [0x00, 0x00, 0x00, 0x1F, 0x00, 0x00, 0x00]),
    ('±', [0x04, 0x04, 0x1F, 0x04, 0x04, 0x00, 0x1F]),
    ('+', [0x00, 0x04, 0x04, 0x1F, 0x04, 0x04, 0x00]),
    ('/', [0x00, 0x01, 0x02, 0x04, 0x08, 0x10, 0x00]),
    ('%', [0x18, 0x19, 0x02, 0x04, 0x08, 0x13, 0x03]),
    ('(', [0x02, 0x04, 0x08, 0x08, 0x08, 0x04, 0x02]),
    (')', [0x08, 0x04, 0x02, 0x02, 0x02, 0x04, 0x08]),
    ('[', [0x0E, 0x08, 0x08, 0x08, 0x08, 0x08, 0x0E]),
    (']', [0x0E, 0x02, 0x02, 0x02, 0x02, 0x02, 0x0E]),
    ('=', [0x00, 0x00, 0x1F, 0x00, 0x1F, 0x00, 0x00]),
    ('_', [0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x1F]),
    ('<', [0x02, 0x04, 0x08, 0x10, 0x08, 0x04, 0x02]),
    ('>', [0x08, 0x04, 0x02, 0x01, 0x02, 0x04, 0x08]),
    ('#', [0x0A, 0x0A, 0x1F, 0x0A, 0x1F, 0x0A, 0x0A]),
    ('\'', [0x04, 0x04, 0x08, 0x00, 0x00, 0x00, 0x00]),
    ('!', [0x04, 0x04, 0x04, 0x04, 0x04, 0x00, 0x04]),
    ('?', [0x0E, 0x11, 0x01, 0x02, 0x04, 0x00, 0x04]),
    ('*', [0x00, 0x0A, 0x04, 0x1F, 0x04, 0x0A, 0x00]),
    ('×', [0x00, 0x11, 0x0A, 0x04, 0x0A, 0x11, 0x00]),
    ('µ', [0x11, 0x11, 0x11, 0x13, 0x1D, 0x10, 0x10]),
    ('λ', [0x08, 0x04, 0x04, 0x0A, 0x0A, 0x11, 0x11]),
    ('π', [0x00, 0x00, 0x1F, 0x0A, 0x0A, 0x0A, 0x09]),
    ('°', [0x06, 0x09, 0x09, 0x06, 0x00, 0x00, 0x00]),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(canvas: &Canvas) -> Vec<String> {
        let mark = |pixel: &[u8; 3]| if *pixel == [0; 3] { '.' } else { '#' };
        canvas.pixels.chunks(canvas.width).map(|row| row.iter().map(mark).collect()).collect()
    }

    #[test]
    fn letters_stand_upright_unmirrored_and_in_their_place() {
        let mut canvas = Canvas::new(8, 8, [0; 3]);
        canvas.write((2, 1), 1, [255; 3], "F");
        let wanted = ["........", "..#####.", "..#.....", "..#.....", "..####..", "..#.....", "..#.....", "..#....."];
        assert_eq!(rows(&canvas), wanted);
        // Twice as large, cut at the border.
        let mut canvas = Canvas::new(6, 4, [0; 3]);
        canvas.write((0, 0), 2, [255; 3], "L");
        assert_eq!(rows(&canvas), ["##....", "##....", "##....", "##...."]);
    }

    #[test]
    fn no_two_letters_look_alike_and_what_lies_outside_is_left_out() {
        for (i, (a, rows)) in LETTERS.iter().enumerate() {
            assert!(rows.iter().all(|row| row >> 5 == 0), "{a}");
            let alike = |b: &char| TAILED.contains(a) == TAILED.contains(b);
            assert!(LETTERS[..i].iter().all(|(b, other)| a != b && !(rows == other && alike(b))), "{a}");
        }
        let mut canvas = Canvas::new(3, 2, [7; 3]);
        canvas.fill([2, 1, 9, 9], [1; 3]);
        canvas.put_gray((1, 0), 5, &[9; 20]);
        canvas.put((2, 1), 2, 7, &[[9; 3]; 4]);
        canvas.write((40, 40), 3, [2; 3], "outside");
        assert_eq!(canvas.pixels, [[7; 3], [9; 3], [9; 3], [7; 3], [9; 3], [9; 3]]);
    }

    #[test]
    fn an_animation_has_its_frames_and_time_and_is_gray_where_they_are() {
        let folder = tempfile::tempdir().expect("folder");
        for (colour, expected) in [([90; 3], png::ColorType::Grayscale), ([90, 1, 2], png::ColorType::Rgb)] {
            let path = folder.path().join("moving.png");
            let frames = [Canvas::new(7, 5, [20; 3]), Canvas::new(7, 5, colour)];
            Canvas::write_animated_png(&frames, 80, &path, &[("Description", "moving".into())]).expect("written");
            let file = std::io::BufReader::new(std::fs::File::open(&path).expect("file"));
            let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
            assert_eq!(reader.info().color_type, expected);
            assert_eq!(reader.info().animation_control().map(|c| (c.num_frames, c.num_plays)), Some((2, 0)));
            let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
            for level in [20, 90] {
                reader.next_frame(&mut bytes).expect("a frame");
                let control = reader.info().frame_control().expect("control");
                assert_eq!((bytes[0], control.delay_num, control.delay_den), (level, 80, 1000));
            }
        }
        let path = folder.path().join("none.png");
        assert!(Canvas::write_animated_png(&[], 80, &path, &[]).is_err());
        let sizes = [Canvas::new(7, 5, [0; 3]), Canvas::new(5, 7, [0; 3])];
        assert!(Canvas::write_animated_png(&sizes, 80, &path, &[]).is_err() && !path.exists());
    }
}
