//! Measured lamps: intensity by direction, from the files of lamp makers (IES LM-63).
//!
//! Photometry of type C: vertical angles γ from the direction that the lamp aims at, horizontal ones φ about it. Planes that a file
//! leaves out follow from its symmetry: one plane is a lamp of revolution; 0 … 90°, 0 … 180° and (LM-63-1995) 90 … 270° are
//! mirrored. Between the angles it is linear, beyond the vertical ones dark. Source: ANSI/IES LM-63-19.

use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Most intensities of a file.
const MOST: usize = 1 << 22;

/// Intensity by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Angles from the aim, rising [degrees].
    vertical: Vec<f64>,
    /// Angles about it, rising [degrees].
    horizontal: Vec<f64>,
    /// Candela with all factors, one horizontal angle after another.
    candela: Vec<f32>,
}

/// Numbers of a file, one after another.
struct Numbers<'a>(std::str::SplitAsciiWhitespace<'a>);

impl Numbers<'_> {
    fn next(&mut self, what: &str) -> Result<f64, String> {
        let word = self.0.next().ok_or_else(|| format!("it ends before its {what}"))?;
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("its {what}: '{}' is no number", word.escape_debug()))
    }

    fn count(&mut self, what: &str) -> Result<usize, String> {
        let number = self.next(what)?;
        let whole = number.fract() == 0.0 && (1.0..=MOST as f64).contains(&number);
        if whole { Ok(number as usize) } else { Err(format!("its {what} is {number}; it must be 1 to {MOST}")) }
    }

    fn many(&mut self, count: usize, what: &str) -> Result<Vec<f64>, String> {
        (0..count).map(|_| self.next(what)).collect()
    }
}

impl Photometry {
    /// Reads the bytes of an LM-63 file of 1986 to 2019; the error is one line. Its `TILT` table is left out: it tells of lamps that
    /// are mounted otherwise than measured.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        // Names of makers may be in any encoding; the numbers are ASCII.
        let text = String::from_utf8_lossy(bytes).replace(',', " ");
        let mut lines = text.lines();
        let tilt = lines.by_ref().map(str::trim).find_map(|line| line.strip_prefix("TILT="));
        let tilt = tilt.ok_or("it has no line TILT=, so it is no photometric file (IES LM-63)")?.trim();
        let rest: Vec<&str> = lines.collect();
        let rest = rest.join("\n");
        let mut numbers = Numbers(rest.split_ascii_whitespace());
        if tilt.eq_ignore_ascii_case("INCLUDE") {
            numbers.next("tilt")?;
            let pairs = numbers.count("number of tilts")?;
            numbers.many(2 * pairs.min(MOST), "tilt")?;
        }
        numbers.many(2, "lamps")?;
        let multiplier = numbers.next("candela multiplier")?;
        let [across, around] =
            [numbers.count("number of vertical angles")?, numbers.count("number of horizontal angles")?];
        let kind = numbers.next("photometric type")?;
        if kind != 1.0 {
            let name = if kind == 2.0 { "B" } else { "A" };
            return Err(format!("its photometry is of type {name} ({kind}); type C (1) is read"));
        }
        numbers.many(4, "dimensions")?;
        let factors = numbers.many(2, "ballast factors")?;
        numbers.next("watts")?;
        if across.saturating_mul(around) > MOST {
            return Err(format!("{across} × {around} intensities; at most {MOST} are read"));
        }
        let vertical = numbers.many(across, "vertical angles")?;
        let horizontal = numbers.many(around, "horizontal angles")?;
        let values = numbers.many(across * around, "candela values")?;
        let rises = |angles: &[f64]| angles.windows(2).all(|pair| pair[0] < pair[1]);
        if !(rises(&vertical) && vertical[0] >= 0.0 && vertical[across - 1] <= 180.0) {
            return Err("its vertical angles do not rise within 0 to 180 degrees".into());
        }
        let last = horizontal[around - 1];
        let is_whole = match (horizontal[0], last) {
            (0.0, 90.0) | (90.0, 270.0) => true,
            (first, last) => first == 0.0 && (180.0..=360.0).contains(&last),
        };
        if around > 1 && !(rises(&horizontal) && is_whole) {
            return Err(format!(
                "its horizontal angles run from {} to {last} degrees; they must rise from 0 to 90, 180 or 360, or from 90 to 270",
                horizontal[0]
            ));
        }
        let factor = multiplier * factors[0] * factors[1];
        let candela: Vec<f32> = values.iter().map(|value| (value * factor) as f32).collect();
        if let Some(wrong) = candela.iter().find(|value| !value.is_finite() || **value < 0.0) {
            return Err(format!("one of its intensities is {wrong} candela; none may be below zero"));
        }
        Ok(Self { vertical, horizontal, candela })
    }

    /// Intensity in a direction γ from the aim and φ about it [radians; candela].
    pub fn intensity(&self, vertical: f64, horizontal: f64) -> f64 {
        let [first, last] = [self.vertical[0], self.vertical[self.vertical.len() - 1]];
        let vertical = vertical.to_degrees();
        // A float's own rounding is no darkness.
        if vertical < first - 1e-4 || vertical > last + 1e-4 {
            return 0.0;
        }
        let (down, share) = between(&self.vertical, vertical);
        let [(left, _), (right, across)] = self.planes(horizontal.to_degrees().rem_euclid(360.0));
        let at = |plane: usize| {
            let line = &self.candela[plane * self.vertical.len()..][..self.vertical.len()];
            let [a, b] = [down, (down + 1).min(line.len() - 1)].map(|k| f64::from(line[k]));
            a + share * (b - a)
        };
        let (a, b) = (at(left), at(right));
        a + across * (b - a)
    }

    /// The planes on both sides of an angle of 0 … 360°, and the second one's share.
    fn planes(&self, angle: f64) -> [(usize, f64); 2] {
        let count = self.horizontal.len();
        let [first, last] = [self.horizontal[0], self.horizontal[count - 1]];
        let half = if angle > 180.0 { 360.0 - angle } else { angle };
        let angle = match (first, last) {
            _ if count == 1 => 0.0,
            (_, 90.0) => half.min(180.0 - half),
            (_, 180.0) => half,
            (90.0, 270.0) if angle < 90.0 => 180.0 - angle,
            (90.0, 270.0) if angle > 270.0 => 540.0 - angle,
            _ => angle,
        };
        if angle > last {
            // The plane of 360° is that of 0.
            let share = (angle - last) / (360.0 - last);
            return [(count - 1, 1.0 - share), (0, share)];
        }
        let (left, share) = between(&self.horizontal, angle);
        [(left, 1.0 - share), ((left + 1).min(count - 1), share)]
    }

    /// The brightest intensity [candela].
    pub fn brightest(&self) -> f32 {
        self.candela.iter().copied().fold(0.0, f32::max)
    }
}

/// The last entry that is not above a value, and how far the value is on to the next.
fn between(rising: &[f64], value: f64) -> (usize, f64) {
    let at = rising.partition_point(|entry| *entry <= value).saturating_sub(1);
    let Some(next) = rising.get(at + 1) else { return (at, 0.0) };
    (at, ((value - rising[at]) / (next - rising[at])).clamp(0.0, 1.0))
}

/// A measured lamp as it hangs in the scene.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Its intensities.
    pub photometry: Arc<Photometry>,
    /// The lamp's x, y and z: it aims at −z, and φ runs from x to y.
    pub axes: [Vec3; 3],
}

impl Measured {
    /// Intensity in a unit direction away from the lamp [candela].
    pub fn towards(&self, direction: DVec3) -> f64 {
        let [x, y, z] = self.axes.map(|axis| axis.as_dvec3().dot(direction));
        self.photometry.intensity((-z).clamp(-1.0, 1.0).acos(), y.atan2(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(head: &str, angles: &str) -> Vec<u8> {
        format!("IESNA:LM-63-2002\n[TEST] caf\u{e9}\n[MANUFAC] none\nTILT=NONE\n{head}\n{angles}\n").into_bytes()
    }

    #[test]
    fn angles_and_symmetries_mean_what_the_standard_says() {
        let degrees = |p: &Photometry, v: f64, h: f64| p.intensity(v.to_radians(), h.to_radians());
        // Of revolution, with all factors: 2 × 0.9 × 0.5.
        let lamp =
            Photometry::read(&file("1 1000 2 3 1 1 2 0 0 0\n0.9 0.5 60", "0 45 90\n0\n100 50, 10")).expect("lamp");
        for (vertical, wanted) in [(0.0, 90.0), (22.5, 67.5), (45.0, 45.0), (90.0, 9.0), (91.0, 0.0), (180.0, 0.0)] {
            for horizontal in [0.0, 77.0, 300.0] {
                assert!((degrees(&lamp, vertical, horizontal) - wanted).abs() < 1e-4, "{vertical} {horizontal}");
            }
        }
        // A quarter, a half, a half about the other plane, and all round: φ and its intensity.
        for (angles, wanted) in [
            ("0 45 90", [(0.0, 1.0), (45.0, 2.0), (90.0, 3.0), (135.0, 2.0), (180.0, 1.0), (270.0, 3.0), (337.5, 1.5)]),
            (
                "0 90 180",
                [(0.0, 1.0), (90.0, 2.0), (135.0, 2.5), (180.0, 3.0), (225.0, 2.5), (270.0, 2.0), (359.0, 1.0111)],
            ),
            (
                "90 180 270",
                [(90.0, 1.0), (0.0, 2.0), (180.0, 2.0), (225.0, 2.5), (270.0, 3.0), (315.0, 2.5), (45.0, 1.5)],
            ),
            (
                "0 120 240",
                [(0.0, 1.0), (60.0, 1.5), (120.0, 2.0), (180.0, 2.5), (240.0, 3.0), (300.0, 2.0), (359.99, 1.0)],
            ),
            (
                "0 180 360",
                [(0.0, 1.0), (90.0, 1.5), (180.0, 2.0), (270.0, 2.5), (359.99, 3.0), (45.0, 1.25), (315.0, 2.75)],
            ),
        ] {
            let text = file("1 1000 1 2 3 1 2 0 0 0 1 1 60", &format!("0 180\n{angles}\n1 1\n2 2\n3 3"));
            let lamp = Photometry::read(&text).expect("lamp");
            for (horizontal, wanted) in wanted {
                let found = degrees(&lamp, 30.0, horizontal);
                assert!((found - wanted).abs() < 1e-3, "{angles}: {horizontal} is {found}, not {wanted}");
            }
        }
        // Hung with its aim along +x and its own x along +z: what goes along the scene's z is of φ = 0.
        let web = Photometry::read(&file("1 1000 1 2 2 1 2 0 0 0 1 1 60", "0 180\n0 90\n1 1\n3 3")).expect("lamp");
        let hung = Measured { photometry: Arc::new(web), axes: [Vec3::Z, Vec3::Y, Vec3::NEG_X] };
        assert!((hung.towards(DVec3::Z) - 1.0).abs() < 1e-6 && (hung.towards(DVec3::NEG_Y) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_such_file_is_refused_in_a_line() {
        let good = "1 1000 1 2 1 1 2 0 0 0 1 1 60";
        for (bytes, word) in [
            (b"\x00\xffnothing".to_vec(), "TILT"),
            (Vec::new(), "TILT"),
            (file("1 1000", ""), "ends before"),
            (file("1 1000 1 2 one", ""), "no number"),
            (file("1 1000 1 1e9 1e9 1 2 0 0 0 1 1 60", ""), "1 to"),
            (file("1 1000 1 4000 4000 1 2 0 0 0 1 1 60", ""), "at most"),
            (file("1 1000 1 2 1 2 2 0 0 0 1 1 60", "0 90\n0\n1 1"), "type B"),
            (file("1 1000 nan 2 1 1 2 0 0 0 1 1 60", "0 90\n0\n1 1"), "no number"),
            (file(good, "90 0\n0\n1 1"), "vertical"),
            (file(good, "0 90\n0\n1 -1"), "below zero"),
            (file(good, "0 90\n0\n1"), "ends before"),
            (file("1 1000 1 2 2 1 2 0 0 0 1 1 60", "0 90\n0 33\n1 1 1 1"), "horizontal"),
        ] {
            let told = Photometry::read(&bytes).expect_err(word);
            assert!(told.contains(word) && !told.contains('\n'), "{word}: {told}");
        }
        // A table of tilts is passed over.
        let tilted = String::from_utf8(file(good, "0 90\n0\n5 1"))
            .expect("text")
            .replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1 0.5");
        assert_eq!(Photometry::read(tilted.as_bytes()).expect("lamp").brightest(), 5.0);
    }
}
