//! LAS of laser scanners, by the crate `las`. Its packed form LAZ is refused: the unpackers there are take what memory a
//! file asks for.

use super::{Gather, Role, Vertex};
use crate::error::{Error, Result};
use crate::points::ply::Read;
use glam::DVec3;
use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Points that are read at a time.
const BATCH: u64 = 1 << 16;

/// Fewest bytes of a point, unpacked.
const LEAST: u64 = 20;

/// Largest colour of files that write bytes into the format's 16 bits.
const BYTE: u16 = 255;

/// Where a header of version 1.4 says where its extended records begin (`u64`) and how many they are (`u32`), and where
/// such a record says how many bytes follow its head.
const EXTENDED: (u64, u64) = (235, 20);

/// Where the header has the format of points, and the bit of it that packed files have.
const FORMAT: usize = 104;
const PACKED: u8 = 0x80;

/// Bytes of the head of an extended record.
const EXTENDED_HEAD: u64 = 60;

struct Scanned {
    position: DVec3,
    color: [u16; 3],
    intensity: u16,
}

/// Reads positions, colours (16 bits, or bytes in them) and intensities; points that the scanner withheld are left out.
pub(super) fn read(path: &Path) -> Result<Read> {
    let refused =
        |why: &dyn std::fmt::Display| Error::input(path, format!("not a LAS or LAZ file, or a damaged one: {why}"));
    let open = || File::open(path).map_err(Error::io(path)).map(BufReader::new);
    let length = std::fs::metadata(path).map_err(Error::io(path))?.len();
    let mut head = Vec::new();
    open()?.take(EXTENDED.0 + 12).read_to_end(&mut head).map_err(Error::io(path))?;
    if head.starts_with(b"LASF") && head.get(FORMAT).is_some_and(|format| format & PACKED != 0) {
        return Err(Error::input(path, "packed as LAZ; unpack it first: `laszip -i FILE.laz -o FILE.las`"));
    }
    if extended(&head, open()?).is_some_and(|end| end > length) {
        return Err(refused(&"a record goes beyond its end"));
    }
    let mut reader = las::Reader::new(open()?).map_err(|why| refused(&why))?;
    let header = reader.header();
    let promised = header.number_of_points();
    if promised.saturating_mul(LEAST) > length {
        return Err(refused(&format!("it promises {promised} points, more than its {length} bytes can hold")));
    }
    let (mut scanned, mut withheld) = (Vec::new(), 0usize);
    let mut batch = las::PointDataBuilder::new().for_header(header).build();
    while reader.fill_points(BATCH, &mut batch).map_err(|why| refused(&why))? > 0 {
        for point in batch.points() {
            let point = point.map_err(|why| refused(&why))?;
            if point.is_withheld {
                withheld += 1;
                continue;
            }
            let color = point.color.map_or([0; 3], |color| [color.red, color.green, color.blue]);
            let position = DVec3::new(point.x, point.y, point.z);
            scanned.push(Scanned { position, color, intensity: point.intensity });
        }
    }
    if scanned.is_empty() {
        return Err(Error::input(path, "it has no points"));
    }
    let brightest = scanned.iter().flat_map(|point| point.color).max().unwrap_or(0);
    let full = f64::from(if brightest <= BYTE { BYTE } else { u16::MAX });
    let mut roles = vec![Role::Position(0), Role::Position(1), Role::Position(2)];
    if brightest > 0 {
        roles.extend([0, 1, 2].map(|c| Role::Color(c, Some(full))));
    }
    if scanned.iter().any(|point| point.intensity > 0) {
        roles.push(Role::Intensity);
    }
    let mut gather = Gather::new(&roles, scanned.len());
    for point in &scanned {
        let mut vertex = Vertex::new();
        for role in &roles {
            let value = match role {
                Role::Position(axis) => point.position[*axis],
                Role::Color(c, _) => f64::from(point.color[*c]),
                _ => f64::from(point.intensity),
            };
            gather.put(*role, value, &mut vertex);
        }
        gather.push(&vertex);
    }
    let mut read = gather.finish();
    let left =
        if withheld > 0 { format!("; {withheld} that the scanner withheld are left out") } else { String::new() };
    read.origin = format!("{} points of a laser scan{left}", scanned.len());
    Ok(read)
}

/// Where the extended record of a file of version 1.4 ends, which the crate reads whatever length it states.
fn extended(head: &[u8], mut file: BufReader<File>) -> Option<u64> {
    let of_four = head.get(24..26)? == [1, 4];
    let (start, count) =
        (head.get(EXTENDED.0 as usize..)?.split_at_checked(8)?.0, head.get(EXTENDED.0 as usize + 8..)?);
    if !of_four || count.first_chunk() == Some(&[0u8; 4]) {
        return None;
    }
    let start = u64::from_le_bytes(start.try_into().ok()?);
    let mut states = [0; 8];
    let read = file.seek(SeekFrom::Start(start.saturating_add(EXTENDED.1))).and_then(|_| file.read_exact(&mut states));
    let long = if read.is_ok() { u64::from_le_bytes(states) } else { u64::MAX };
    Some(start.saturating_add(EXTENDED_HEAD).saturating_add(long))
}
