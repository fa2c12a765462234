//! DXF, release 12: closed polylines on the layer FRINGES, in micrometres.

use super::mask_bytes::Bytes;
use crate::error::Result;

/// The header, and the beginning of the shapes.
pub(super) fn begin(out: &mut Bytes) -> Result<()> {
    out.write(
        b"999\nholodrive plate; units are micrometres\n0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n0\nSECTION\n2\n\
          ENTITIES\n",
    )
}

/// Micrometres to a millionth, without zeros at the end.
fn micrometres(metres: f64) -> String {
    let text = format!("{:.6}", metres * 1e6);
    let short = text.trim_end_matches('0').trim_end_matches('.');
    short.to_owned()
}

/// A closed polyline of four corners.
pub(super) fn rectangle(out: &mut Bytes, pitch: [f64; 2], x: [u64; 2], y: [u64; 2]) -> Result<()> {
    let [left, right] = x.map(|at| micrometres(at as f64 * pitch[0]));
    let [low, high] = y.map(|at| micrometres(at as f64 * pitch[1]));
    let mut text = String::from("0\nPOLYLINE\n8\nFRINGES\n66\n1\n70\n1\n");
    for (x, y) in [(&left, &low), (&right, &low), (&right, &high), (&left, &high)] {
        text += &format!("0\nVERTEX\n8\nFRINGES\n10\n{x}\n20\n{y}\n");
    }
    text += "0\nSEQEND\n8\nFRINGES\n";
    out.write(text.as_bytes())
}

/// The end of shapes and file.
pub(super) fn end(out: &mut Bytes) -> Result<()> {
    out.write(b"0\nENDSEC\n0\nEOF\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn micrometres_are_short() {
        assert_eq!(micrometres(12.5e-6), "12.5");
        assert_eq!(micrometres(0.0), "0");
        assert_eq!(micrometres(0.0254 / 2400.0), "10.583333");
        assert_eq!(micrometres(60e-3), "60000");
    }
}
