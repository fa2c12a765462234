//! A small drawing of how a plate is lit and looked at, as SVG: from the side and from above.
//!
//! The viewer stands on the right, what is behind the plate on the left; from above +x is up. Angles are true, lengths are
//! not.

use super::plate::Plate;
use super::reference::{Reference, Side};
use std::fmt::Write;

/// Size of a drawing [px].
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 230.0;
/// Where the plate's middle stands.
const MIDDLE: [f64; 2] = [220.0, 125.0];
/// Length of the lamp's ray and of the object's light.
const REACH: f64 = 150.0;
/// Half of the plate's height.
const HALF: f64 = 55.0;

/// Which way the reference's light runs at the plate's middle: along an axis and along +z, of unit length.
pub(super) fn direction(plate: &Plate, axis: usize) -> Option<[f64; 2]> {
    match plate.reference {
        Reference::None => None,
        Reference::Plane { angle, side } => {
            let on = if side == Side::Front { -1.0 } else { 1.0 };
            Some([angle[axis].sin(), on * angle[axis].cos()])
        }
        Reference::Point { position } => {
            let length = position[axis].hypot(position[2]);
            Some([-position[axis] / length, -position[2] / length])
        }
    }
}

/// One drawing: `axis` 0 from above, 1 from the side; the object's light spreads by `angle` [rad] to each side.
fn drawing(plate: &Plate, axis: usize, angle: f64) -> String {
    let [x0, y0] = MIDDLE;
    let mut svg = String::new();
    let mut add = |part: std::fmt::Arguments| {
        // A string takes all that is written to it.
        let _ = svg.write_fmt(part);
    };
    let name = ["from above (right is up)", "from the side"][axis];
    add(format_args!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\">"));
    add(format_args!("<title>lamp, plate and eye {name}</title><text x=\"8\" y=\"16\" class=\"n\">{name}</text>"));
    let (sine, cosine) = angle.sin_cos();
    let (dx, dy) = (REACH * cosine, REACH * sine);
    add(format_args!(
        "<path class=\"o\" d=\"M{x0} {y0}L{:.1} {:.1}L{:.1} {:.1}Z\"/>",
        x0 + dx,
        y0 - dy,
        x0 + dx,
        y0 + dy
    ));
    let behind = plate.view.place < 0.0;
    let at = if behind { x0 - 75.0 } else { x0 + 45.0 };
    add(format_args!("<rect class=\"s\" x=\"{at}\" y=\"{}\" width=\"30\" height=\"60\"/>", y0 - 30.0));
    add(format_args!("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">scene</text>", at + 15.0, y0 + 45.0));
    add(format_args!("<path class=\"p\" d=\"M{x0} {}V{}\"/>", y0 - HALF, y0 + HALF));
    add(format_args!("<text x=\"{x0}\" y=\"{}\" text-anchor=\"middle\">plate</text>", y0 + HALF + 14.0));
    let eye = x0 + REACH + 30.0;
    add(format_args!(
        "<circle class=\"e\" cx=\"{eye}\" cy=\"{y0}\" r=\"9\"/><circle cx=\"{}\" cy=\"{y0}\" r=\"4\"/>",
        eye - 4.0
    ));
    add(format_args!("<text x=\"{eye}\" y=\"{}\" text-anchor=\"middle\">eye</text>", y0 + 25.0));
    add(format_args!(
        "<text x=\"{:.1}\" y=\"{:.1}\">object \u{b1}{:.1}\u{b0}</text>",
        x0 + 62.0,
        (y0 - dy - 8.0).max(30.0),
        angle.to_degrees()
    ));
    if let Some([along, on]) = direction(plate, axis) {
        let (from_x, from_y) = (x0 - REACH * on, y0 + REACH * along);
        add(format_args!("<path class=\"r\" marker-end=\"url(#a)\" d=\"M{from_x:.1} {from_y:.1}L{x0} {y0}\"/>"));
        // What goes straight on.
        add(format_args!(
            "<path class=\"z\" d=\"M{x0} {y0}L{:.1} {:.1}\"/>",
            x0 + 0.75 * REACH * on,
            y0 - 0.75 * REACH * along
        ));
        let below = if along > 0.0 { 16.0 } else { -8.0 };
        add(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">lamp {:+.1}\u{b0}</text>",
            from_x.clamp(40.0, WIDTH - 40.0),
            (from_y + below).clamp(30.0, HEIGHT - 6.0),
            along.asin().to_degrees()
        ));
    }
    svg.push_str("</svg>");
    svg
}

/// Both drawings; `angle` are the object's half angles along x and y [rad].
pub(super) fn diagram(plate: &Plate, angle: [f64; 2]) -> String {
    let arrow = "<svg width=\"0\" height=\"0\"><defs><marker id=\"a\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"8\" \
                 markerHeight=\"8\" orient=\"auto\"><path d=\"M0 0L8 4L0 8Z\" fill=\"#c60\"/></marker></defs></svg>";
    format!("{arrow}{}{}", drawing(plate, 1, angle[1]), drawing(plate, 0, angle[0]))
}
