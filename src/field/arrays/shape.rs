//! Orders and sides: what other programs put round a picture is taken off.

use super::{Array, Values, sides};
use crate::error::{Error, Result};
use crate::field::Complex32;
use std::path::Path;

impl Array {
    /// An array whose values stand in Fortran order (the first side fastest).
    pub(super) fn from_fortran(shape: Vec<usize>, values: Values, origin: String) -> Self {
        let count = values.count();
        if shape.len() < 2 {
            return Self { shape, values, origin };
        }
        let mut at = Vec::with_capacity(count);
        // Counts through the places in C order, and follows them in the other one.
        let strides: Vec<usize> =
            shape.iter().scan(1, |step, side| Some(std::mem::replace(step, *step * side))).collect();
        let mut place = vec![0; shape.len()];
        let mut from = 0;
        for _ in 0..count {
            at.push(from);
            for axis in (0..shape.len()).rev() {
                place[axis] += 1;
                from += strides[axis];
                if place[axis] < shape[axis] {
                    break;
                }
                from -= strides[axis] * shape[axis];
                place[axis] = 0;
            }
        }
        Self { shape, values: values.taken(&at), origin }
    }

    /// Which axis of it is taken as real and imaginary part by [`Array::picture`], in words.
    pub fn parts(&self) -> Option<&'static str> {
        let sides: Vec<usize> = self.shape.iter().copied().filter(|side| *side != 1).collect();
        match (&sides[..], &self.values) {
            ([2, _, _], Values::Real(_)) => Some("the halves along its first axis taken as real and imaginary parts"),
            ([_, _, 2], Values::Real(_)) => Some("the halves along its last axis taken as real and imaginary parts"),
            _ => None,
        }
    }

    /// The one picture in it: columns, rows and values row by row.
    ///
    /// Sides of 1 before and behind it are left off. A side of 2 before or behind two others in an array of floats is real
    /// and imaginary part: the values become complex.
    ///
    /// # Errors
    /// [`Error::Input`] for an array that is no single picture.
    pub fn picture(self, path: &Path) -> Result<(usize, usize, Values)> {
        let mut shape = &self.shape[..];
        while shape.len() > 2 && shape[0] == 1 {
            shape = &shape[1..];
        }
        while shape.len() > 2 && shape[shape.len() - 1] == 1 {
            shape = &shape[..shape.len() - 1];
        }
        let refused = |what: &str| Error::input(path, format!("shape {}: {what}", sides(&self.shape)));
        if shape.contains(&0) {
            return Err(refused("has no values"));
        }
        match (shape, self.values) {
            (&[height, width], values) => Ok((width, height, values)),
            (&[2, height, width], Values::Real(values)) => {
                let (re, im) = values.split_at(width * height);
                Ok((width, height, Values::Complex(paired(re.iter().zip(im)))))
            }
            (&[height, width, 2], Values::Real(values)) => {
                let pairs = values.chunks_exact(2).map(|pair| (&pair[0], &pair[1]));
                Ok((width, height, Values::Complex(paired(pairs))))
            }
            (&[_, _, channels @ (3 | 4)], _) => Err(refused(&format!(
                "is a picture of {channels} channels; one of them is needed, or a file of a picture (.png)"
            ))),
            (&[count, ..], _) if shape.len() > 2 => Err(refused(&format!(
                "holds {count} or more pictures; one of height × width is needed: save one of them"
            ))),
            _ => Err(refused("height × width is needed")),
        }
    }
}

fn paired<'a>(pairs: impl Iterator<Item = (&'a f64, &'a f64)>) -> Vec<Complex32> {
    pairs.map(|(re, im)| Complex32::new(*re as f32, *im as f32)).collect()
}
