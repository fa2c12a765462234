//! A panel that is more, or less, than one monitor: several heads side by side, or a part of a large desktop.

use super::monitor::Monitor;
use super::rectangle::Rectangle;
use crate::error::{Error, Result};

/// The region as if it were one monitor, with those that show it as its parts.
///
/// Its rate is that of the slowest. Monitors are not in step with each other unless the graphics card keeps them so.
///
/// # Errors
/// [`Error::Display`] when a part of it is on no monitor: frames would lose pixels.
pub(super) fn joined(region: Rectangle, monitors: &[Monitor]) -> Result<Monitor> {
    let parts: Vec<Monitor> = monitors.iter().filter(|monitor| monitor.rectangle().meets(&region)).cloned().collect();
    let Rectangle { x, y, width, height } = region;
    if let Some((column, row)) = uncovered(region, &parts) {
        let list: Vec<String> = monitors.iter().map(ToString::to_string).collect();
        let what = format!("no monitor shows {column},{row} of the region {region}; there are: {}", list.join("; "));
        return Err(Error::Display { what });
    }
    let rates = parts.iter().map(|part| part.refresh);
    let refresh = rates.reduce(|a, b| Some(a?.min(b?))).flatten();
    Ok(Monitor {
        index: parts.first().map_or(0, |part| part.index),
        name: format!("region:{x},{y},{width},{height}"),
        width,
        height,
        x,
        y,
        refresh,
        scale: parts.iter().map(|part| part.scale).find(|scale| *scale != 1.0).unwrap_or(1.0),
        primary: parts.iter().any(|part| part.primary),
        edid: None,
        scan_out: None,
        parts,
    })
}

impl Monitor {
    /// The monitor that `self` was, among those that are there now: same connector, same EDID, though perhaps at another
    /// place. A region is again there when all monitors that showed it show it.
    pub(super) fn again(&self, monitors: &[Self]) -> Option<Self> {
        if self.parts.is_empty() {
            return monitors.iter().find(|now| now.name == self.name && now.edid == self.edid).cloned();
        }
        let now = joined(self.rectangle(), monitors).ok()?;
        (now.parts.len() == self.parts.len() && self.parts.iter().all(|part| part.again(&now.parts).is_some()))
            .then_some(now)
    }
}

/// The smallest rectangle about some monitors.
pub(super) fn about(monitors: &[&Monitor]) -> Option<Rectangle> {
    let x = monitors.iter().map(|monitor| monitor.x).min()?;
    let y = monitors.iter().map(|monitor| monitor.y).min()?;
    let right = monitors.iter().map(|monitor| i64::from(monitor.x) + i64::from(monitor.width)).max()?;
    let bottom = monitors.iter().map(|monitor| i64::from(monitor.y) + i64::from(monitor.height)).max()?;
    let (width, height) = (u32::try_from(right - i64::from(x)).ok()?, u32::try_from(bottom - i64::from(y)).ok()?);
    Some(Rectangle { x, y, width, height })
}

/// A pixel of `region` that none of `monitors` shows.
fn uncovered(region: Rectangle, monitors: &[Monitor]) -> Option<(i64, i64)> {
    // Between the edges of all monitors each cell lies inside one or outside all.
    let range = |start: i32, length: u32| (i64::from(start), i64::from(start) + i64::from(length));
    let edges = |own: (i64, i64), of: &dyn Fn(&Monitor) -> (i64, i64)| {
        let mut edges: Vec<i64> =
            monitors.iter().flat_map(|m| [of(m).0, of(m).1]).filter(|edge| (own.0..own.1).contains(edge)).collect();
        edges.push(own.0);
        edges.sort_unstable();
        edges.dedup();
        edges
    };
    let across = |m: &Monitor| range(m.x, m.width);
    let down = |m: &Monitor| range(m.y, m.height);
    let columns = edges(range(region.x, region.width), &across);
    let rows = edges(range(region.y, region.height), &down);
    let shown = |x: i64, y: i64| {
        monitors.iter().any(|m| (across(m).0..across(m).1).contains(&x) && (down(m).0..down(m).1).contains(&y))
    };
    rows.iter().flat_map(|&y| columns.iter().map(move |&x| (x, y))).find(|&(x, y)| !shown(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(name: &str, (x, y): (i32, i32), (width, height): (u32, u32), refresh: f64) -> Monitor {
        Monitor {
            index: 0,
            name: name.into(),
            width,
            height,
            x,
            y,
            refresh: Some(refresh),
            scale: 1.0,
            primary: false,
            edid: None,
            scan_out: None,
            parts: Vec::new(),
        }
    }

    #[test]
    fn a_region_is_covered_whole_or_refused_with_what_is_missing() {
        let desk = [
            monitor("A", (0, 0), (1280, 720), 60.0),
            monitor("B", (1280, 0), (1920, 1080), 120.0),
            monitor("C", (3200, 100), (1367, 769), 59.0),
        ];
        let of = |x, y, width, height| joined(Rectangle { x, y, width, height }, &desk);
        let names = |monitor: Monitor| monitor.parts.into_iter().map(|part| part.name).collect::<Vec<_>>();
        let wide = of(1280, 100, 1920 + 1367, 769).expect("covered");
        assert_eq!((wide.width, wide.height, wide.refresh), (3287, 769, Some(59.0)));
        assert_eq!(names(wide), ["B", "C"]);
        assert_eq!(names(of(1300, 20, 100, 100).expect("inside")), ["B"]);
        assert_eq!(names(of(1279, 0, 2, 720).expect("two columns")), ["A", "B"]);
        for (region, missing) in [
            ((0, 0, 3200, 1080), "no monitor shows 0,720"),
            ((1280, 0, 3287, 869), "no monitor shows 3200,0"),
            ((1280, 100, 3288, 769), "no monitor shows 4567,100"),
            ((-1, 0, 10, 10), "no monitor shows -1,0"),
            ((9000, 0, 10, 10), "no monitor shows 9000,0"),
        ] {
            let (x, y, width, height) = region;
            let why = of(x, y, width, height).expect_err(missing).to_string();
            assert!(why.contains(missing), "{why}");
        }
        let about = about(&[&desk[0], &desk[1]]).expect("two");
        assert_eq!(about, Rectangle { x: 0, y: 0, width: 3200, height: 1080 });
    }
}
