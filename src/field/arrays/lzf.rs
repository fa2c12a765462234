//! LZF (Marc Lehmann's liblzf): runs of bytes and copies of earlier ones. PCD files and h5py pack by it.

/// Exactly `whole` bytes of what is packed; none for what is damaged.
pub(crate) fn unpack(input: &[u8], whole: usize) -> Option<Vec<u8>> {
    // Grows with what is there: a copy makes at most 264 bytes of two.
    let mut out = Vec::with_capacity(whole.min(input.len().saturating_mul(132)));
    let mut at = 0;
    while let Some(&control) = input.get(at) {
        at += 1;
        let control = usize::from(control);
        if control < 32 {
            out.extend(input.get(at..at + control + 1)?);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(*input.get(at)?);
                at += 1;
            }
            let back = ((control & 31) << 8) + usize::from(*input.get(at)?) + 1;
            at += 1;
            let begin = out.len().checked_sub(back)?;
            (0..length + 2).for_each(|i| out.push(out[begin + i]));
        }
        if out.len() > whole {
            return None;
        }
    }
    (out.len() == whole).then_some(out)
}
