//! Tables of text: a point a line, its numbers parted by blanks, commas, semicolons or tabs (`.xyz`, `.csv`, `.pts`, `.txt`).
//!
//! A first line of names says what the columns are; without one the first three are the position, and the others by how many
//! there are: one more is an intensity, three more a colour (or a normal, where all of the first lines have length 1), four more
//! an intensity and a colour.

use super::{Gather, Lines, Role, Vertex};
use crate::error::{Error, Result};
use crate::points::ply::Read;
use std::path::Path;

/// Lines that are looked at before columns without names are given a meaning.
const FIRST: usize = 100;
/// Most columns.
const MOST: usize = 256;

pub(super) fn read(path: &Path) -> Result<Read> {
    let mut lines = Lines::open(path)?;
    let mut names: Option<Vec<Role>> = None;
    let mut first: Vec<Vec<f64>> = Vec::new();
    let mut gather: Option<(Gather, Vec<Role>)> = None;
    while let Some(line) = lines.next()? {
        let (text, is_comment) = match line.strip_prefix('#').or(line.strip_prefix("//")) {
            Some(rest) => (rest, true),
            None => (line.as_str(), false),
        };
        let words = words_of(text);
        if words.is_empty() || (is_comment && (names.is_some() || !first.is_empty())) {
            continue;
        }
        // A column that was left empty was not measured.
        let numbers: Result<Vec<f64>, &str> = words.iter().map(|word| number(word)).collect();
        match numbers {
            // A comment of numbers is no point.
            _ if is_comment && roles_of(&words).is_none() => {}
            // Leica's .pts begins with the number of its points.
            Ok(numbers) if numbers.len() == 1 && first.is_empty() && gather.is_none() => {}
            Ok(numbers) if numbers.len() < 3 => return Err(lines.refused("has less than three numbers")),
            Ok(numbers) if numbers.len() > MOST => return Err(lines.refused("has too many numbers")),
            Ok(numbers) => match (&mut gather, &names) {
                (Some((gather, roles)), _) => push(gather, roles, &numbers),
                (None, Some(roles)) => {
                    let (roles, mut new) = (roles.clone(), Gather::new(roles, 0));
                    push(&mut new, &roles, &numbers);
                    gather = Some((new, roles));
                }
                (None, None) => {
                    first.push(numbers);
                    if first.len() == FIRST {
                        gather = Some(begun(&mut first));
                    }
                }
            },
            Err(_) if names.is_none() && first.is_empty() && gather.is_none() => {
                let found = roles_of(&words);
                if found.is_none() && !is_comment {
                    let what = format!(
                        "`{}` are no names of x, y and z, and no numbers",
                        words[..words.len().min(6)].join(" ")
                    );
                    return Err(lines.refused(&what));
                }
                names = found;
            }
            Err(_) if is_comment => {}
            Err(word) => {
                let short: String = word.chars().take(40).collect();
                return Err(lines.refused(&format!("`{short}` is not a number")));
            }
        }
    }
    let (gather, roles) = match gather {
        Some(all) => all,
        None if first.is_empty() => return Err(Error::input(path, "has no points: lines of three numbers or more")),
        None => begun(&mut first),
    };
    let mut read = gather.finish();
    let said = roles.iter().map(|role| what(*role)).collect::<Vec<_>>().join(", ");
    let origin = format!("{} points, columns {said}", read.cloud.points.len());
    read.origin = if read.origin.is_empty() { origin } else { format!("{origin}; {}", read.origin) };
    Ok(read)
}

/// The words of a line. Where it has commas, semicolons or tabs, these part it, and a name in quotes may have blanks; else
/// blanks do.
fn words_of(text: &str) -> Vec<&str> {
    if let Some(mark) = [';', '\t', ','].into_iter().find(|mark| text.contains(*mark)) {
        let words: Vec<&str> = text.split(mark).map(str::trim).collect();
        let whole = |word: &&str| word.starts_with(['"', '\'']) || !word.contains([' ', '\t', ',']);
        if words.iter().all(whole) {
            let filled = words.iter().rposition(|word| !word.is_empty()).map_or(0, |last| last + 1);
            return words[..filled].iter().map(|word| bare(word)).collect();
        }
    }
    text.split([',', ';', '\t', ' ']).map(bare).filter(|word| !word.is_empty()).collect()
}

fn number(word: &str) -> Result<f64, &str> {
    if word.is_empty() { Ok(f64::NAN) } else { word.parse().map_err(|_| word) }
}

/// A word without its quotes.
fn bare(word: &str) -> &str {
    word.trim_matches(['"', '\''])
}

/// What columns of these names are, where there is a position among them.
fn roles_of(words: &[&str]) -> Option<Vec<Role>> {
    let named = |word: &&str| Role::named(word.trim_start_matches("//"), None);
    let roles: Vec<Role> = words.iter().map(named).collect();
    (0..3).all(|axis| roles.contains(&Role::Position(axis))).then_some(roles)
}

/// What columns without names are; the first points are put in.
fn begun(first: &mut Vec<Vec<f64>>) -> (Gather, Vec<Role>) {
    let columns = first.iter().map(Vec::len).min().unwrap_or(3);
    let are_normals =
        columns == 6 && first.iter().all(|n| ((n[3] * n[3] + n[4] * n[4] + n[5] * n[5]).sqrt() - 1.0).abs() < 1e-2);
    let color = [Role::Color(0, None), Role::Color(1, None), Role::Color(2, None)];
    let mut roles = vec![Role::Position(0), Role::Position(1), Role::Position(2)];
    match columns {
        4 => roles.push(Role::Intensity),
        6 if !are_normals => roles.extend(color),
        7 => {
            roles.push(Role::Intensity);
            roles.extend(color);
        }
        _ => {}
    }
    roles.resize(columns, Role::Other);
    let mut gather = Gather::new(&roles, 0);
    first.drain(..).for_each(|numbers| push(&mut gather, &roles, &numbers));
    (gather, roles)
}

fn push(gather: &mut Gather, roles: &[Role], numbers: &[f64]) {
    let mut point = Vertex::new();
    // A line that is cut off has no position.
    if numbers.len() < roles.len() {
        gather.put(Role::Position(0), f64::NAN, &mut point);
    }
    roles.iter().zip(numbers).for_each(|(role, value)| gather.put(*role, *value, &mut point));
    if numbers.len() < roles.len() {
        gather.put(Role::Position(0), f64::NAN, &mut point);
    }
    gather.push(&point);
}

fn what(role: Role) -> &'static str {
    match role {
        Role::Position(axis) => ["x", "y", "z"][axis],
        Role::Color(c, _) | Role::AmplitudeRgb(c) | Role::Splat(c) => ["red", "green", "blue"][c],
        Role::Amplitude => "amplitude",
        Role::Phase => "phase",
        Role::Intensity => "intensity",
        Role::Opacity => "opacity",
        Role::Other => "(not used)",
    }
}
