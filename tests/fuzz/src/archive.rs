//! Several files as one input, for readers that look beside the file they are given.

/// Puts named parts into one input; the first is the file that the reader is given.
pub fn pack(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut out = vec![parts.len() as u8];
    for (name, bytes) in parts {
        out.push(name.len() as u8);
        out.extend(name.as_bytes());
        out.extend((bytes.len() as u32).to_le_bytes());
    }
    parts.iter().for_each(|(_, bytes)| out.extend(*bytes));
    out
}

/// The parts of an input, with their names; lengths that a mutation made too long end with the input.
pub fn unpack(input: &[u8]) -> Vec<(String, &[u8])> {
    let Some((&count, mut rest)) = input.split_first() else { return Vec::new() };
    let mut heads = Vec::new();
    for _ in 0..count.min(8) {
        let Some((&length, after)) = rest.split_first() else { break };
        let Some((name, after)) = after.split_at_checked(length.into()) else { break };
        let Some((long, after)) = after.split_first_chunk::<4>() else { break };
        heads.push((String::from_utf8_lossy(name).into_owned(), u32::from_le_bytes(*long) as usize));
        rest = after;
    }
    let mut parts = Vec::new();
    for (name, length) in heads {
        let (bytes, after) = rest.split_at(length.min(rest.len()));
        parts.push((name, bytes));
        rest = after;
    }
    parts
}
