//! The vertices of a Wavefront OBJ as points: `v x y z`, with a colour behind it where a program puts one.

use super::{Gather, Lines, Role, Vertex};
use crate::error::{Error, Result};
use crate::points::ply::Read;
use std::path::Path;

pub(super) fn read(path: &Path) -> Result<Read> {
    let mut lines = Lines::open(path)?;
    let (mut vertices, mut faces, mut colored) = (Vec::new(), 0usize, false);
    while let Some(line) = lines.next()? {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("f") => faces += 1,
            Some("v") => {
                let mut numbers = [0.0; 6];
                let mut count = 0;
                for word in words.take(8) {
                    let value = word.parse().map_err(|_| lines.refused(&format!("`{word:.40}` is not a number")))?;
                    numbers.get_mut(count).into_iter().for_each(|n| *n = value);
                    count += 1;
                }
                if count < 3 {
                    return Err(lines.refused("a vertex has three numbers"));
                }
                // Four numbers are a position with its weight.
                colored |= count >= 6;
                vertices.push(numbers);
            }
            _ => {}
        }
    }
    if vertices.is_empty() {
        return Err(Error::input(path, "has no vertices: lines `v x y z`"));
    }
    let mut roles = vec![Role::Position(0), Role::Position(1), Role::Position(2)];
    if colored {
        roles.extend([Role::Color(0, None), Role::Color(1, None), Role::Color(2, None)]);
    }
    let mut gather = Gather::new(&roles, vertices.len());
    for numbers in &vertices {
        let mut point = Vertex::new();
        roles.iter().zip(numbers).for_each(|(role, value)| gather.put(*role, *value, &mut point));
        gather.push(&point);
    }
    let mut read = gather.finish();
    let left =
        if faces > 0 { format!("; {faces} faces are left out: they are not lit or hidden") } else { String::new() };
    read.origin = format!("{} vertices, taken as points{left}", vertices.len());
    Ok(read)
}
