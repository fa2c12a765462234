//! HDF5 out: a file of contiguous arrays in its root, with nothing that a reader since version 1.8 does not know.
//!
//! (HDF5 File Format Specification 3.0: superblock 2, object headers 2 with their checksums, links in the header, layout 3.)
//! Complex values are compounds of `r` and `i`, as h5py writes and reads them.

/// An address that is none.
const NOWHERE: [u8; 8] = [0xff; 8];

/// Bytes of the superblock.
const SUPERBLOCK: usize = 48;

/// What the elements of an array are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stored {
    /// Two floats of four bytes.
    Complex,
    /// A float of four bytes.
    Single,
    /// A whole number without sign of so many bytes.
    Whole(u8),
}

impl Stored {
    fn size(self) -> usize {
        match self {
            Self::Complex => 8,
            Self::Single => 4,
            Self::Whole(bytes) => bytes.into(),
        }
    }

    /// Datatype message (IV.A.2.d).
    fn datatype(self) -> Vec<u8> {
        let mut out = Vec::new();
        match self {
            Self::Complex => {
                // Class 6, version 3; two members, each: name, offset, type.
                out.extend([0x36, 2, 0, 0, 8, 0, 0, 0]);
                for (name, offset) in [(b"r\0", 0), (b"i\0", 4)] {
                    out.extend(name);
                    out.push(offset);
                    out.extend(Self::Single.datatype());
                }
            }
            Self::Single => {
                // Class 1, version 1; little-endian, leading bit implied, sign in bit 31; exponent and mantissa of IEEE 754.
                out.extend([0x11, 0x20, 31, 0, 4, 0, 0, 0]);
                out.extend([0, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0]);
            }
            Self::Whole(bytes) => {
                out.extend([0x10, 0, 0, 0, bytes, 0, 0, 0]);
                out.extend([0, 0, 8 * bytes, 0]);
            }
        }
        out
    }
}

/// An array to be written: name, rows and columns, elements.
pub(crate) type Written<'a> = (&'a str, [usize; 2], Stored);

/// All that stands before the values; these follow in the arrays' order, without gaps.
pub(crate) fn head(arrays: &[Written]) -> Vec<u8> {
    // Addresses do not change the headers' lengths: first with none, then with the right ones.
    let links = |at: &[u64]| -> Vec<u8> {
        let mut messages = message(0x02, &[&[0, 0][..], &NOWHERE, &NOWHERE].concat());
        messages.extend(message(0x0a, &[0, 0]));
        for ((name, ..), at) in arrays.iter().zip(at) {
            let name = &name.as_bytes()[..name.len().min(255)];
            messages.extend(message(0x06, &[&[1, 0, name.len() as u8][..], name, &at.to_le_bytes()].concat()));
        }
        object(&messages)
    };
    let nowhere = vec![0; arrays.len()];
    let lengths: Vec<usize> = arrays.iter().map(|array| dataset(array, 0).len()).collect();
    let first = SUPERBLOCK + links(&nowhere).len();
    let begin = first + lengths.iter().sum::<usize>();
    let (mut at, mut value_at) = (first, begin);
    let (mut places, mut datasets) = (Vec::new(), Vec::new());
    for (array, length) in arrays.iter().zip(&lengths) {
        places.push(at as u64);
        datasets.extend(dataset(array, value_at as u64));
        at += length;
        value_at += values(array);
    }
    let mut out = b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".to_vec();
    out.extend(0u64.to_le_bytes());
    out.extend(NOWHERE);
    out.extend((value_at as u64).to_le_bytes());
    out.extend((SUPERBLOCK as u64).to_le_bytes());
    out.extend(checksum(&out).to_le_bytes());
    out.extend(links(&places));
    out.extend(datasets);
    out
}

fn values((_, [height, width], stored): &Written) -> usize {
    height * width * stored.size()
}

/// The object header of an array whose values stand at an address.
fn dataset(array: &Written, at: u64) -> Vec<u8> {
    let (_, shape, stored) = array;
    // Dataspace 2: two sides, no maxima, simple.
    let mut messages =
        message(0x01, &[&[2, 2, 0, 1][..], &shape.map(|side| (side as u64).to_le_bytes()).concat()].concat());
    messages.extend(message(0x03, &stored.datatype()));
    // Fill value 3: none of its own, room taken late, written where one is set.
    messages.extend(message(0x05, &[3, 0x0a]));
    // Layout 3, contiguous.
    messages.extend(message(0x08, &[&[3, 1][..], &at.to_le_bytes(), &(values(array) as u64).to_le_bytes()].concat()));
    object(&messages)
}

/// A message of an object header of version 2.
fn message(kind: u8, data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u16).to_le_bytes();
    [&[kind, length[0], length[1], 0][..], data].concat()
}

/// An object header of version 2, whose length has two bytes.
fn object(messages: &[u8]) -> Vec<u8> {
    let mut out = b"OHDR\x02\x01".to_vec();
    out.extend((messages.len() as u16).to_le_bytes());
    out.extend(messages);
    out.extend(checksum(&out).to_le_bytes());
    out
}

/// Bob Jenkins' `lookup3` (`hashlittle` with 0), which HDF5 uses for its metadata.
fn checksum(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let [mut a, mut b, mut c] = [start; 3];
    let word = |block: &[u8], i: usize| {
        (0..4).fold(0, |word, k| word | u32::from(block.get(4 * i + k).copied().unwrap_or(0)) << (8 * k))
    };
    let blocks = bytes.len().div_ceil(12).max(1);
    for (number, block) in bytes.chunks(12).enumerate() {
        a = a.wrapping_add(word(block, 0));
        b = b.wrapping_add(word(block, 1));
        c = c.wrapping_add(word(block, 2));
        if number + 1 < blocks {
            for (first, second, third) in [(4, 6, 8), (16, 19, 4)] {
                a = a.wrapping_sub(c) ^ c.rotate_left(first);
                c = c.wrapping_add(b);
                b = b.wrapping_sub(a) ^ a.rotate_left(second);
                a = a.wrapping_add(c);
                c = c.wrapping_sub(b) ^ b.rotate_left(third);
                b = b.wrapping_add(a);
            }
        }
    }
    c ^= b;
    c = c.wrapping_sub(b.rotate_left(14));
    a ^= c;
    a = a.wrapping_sub(c.rotate_left(11));
    b ^= a;
    b = b.wrapping_sub(a.rotate_left(25));
    c ^= b;
    c = c.wrapping_sub(b.rotate_left(16));
    a ^= c;
    a = a.wrapping_sub(c.rotate_left(4));
    b ^= a;
    b = b.wrapping_sub(a.rotate_left(14));
    c ^= b;
    c.wrapping_sub(b.rotate_left(24))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_jenkins_own() {
        // The driver of lookup3.c: hashlittle("Four score and seven years ago", 30, 0).
        assert_eq!(checksum(b"Four score and seven years ago"), 0x1777_0551);
    }
}
