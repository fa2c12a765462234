//! Test cards: frames whose errors an eye sees, on a screen behind the panel or through a lens, without a detector.
//!
//! | card | what is right | what an error looks like |
//! |---|---|---|
//! | `half-turn` | of nine fields the fifth, between two bars, is the darkest in the undiffracted light | another one is: its level for 2π is the true one |
//! | `lenses` | a square lattice of sharp spots at the distance | spots that are blurred or out of line: the panel is not flat there |
//! | `letters` | an upright F left of an upright L, at the distance | mirrored, turned over, or seen at −distance: flips, sign of the phase |
//!
//! *Half turn*: a checkerboard of phases 0 and δ sends cos²(δ/2) of its light straight on, none at δ = π. The fields
//! ask for δ = π·(0.8 … 1.2). *Lenses*: pieces of the panel, each a lens of its own (Shack & Platt, *J. Opt. Soc. Am.* 61,
//! 656 (1971), with the panel as lens array). *Letters*: points of light in front of the panel.

use super::series::{Entry, FrameSeries};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::hologram::{self, HologramSettings};
use crate::panel::{Frame, PanelProfile, Pattern, PhasePattern, Wavefront, drive};
use crate::points::PointSource;
use crate::progress::Progress;
use crate::random::Random;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// A frame with what to look for.
#[derive(Clone, Debug)]
pub struct Card {
    /// Short name, for files.
    pub name: &'static str,
    /// The frame.
    pub frame: Frame,
    /// What is seen where all is right, and what else would mean.
    pub look_for: String,
}

/// The cards as frames to show.
pub fn card_frames(cards: &[Card]) -> FrameSeries<'_> {
    let make = |index: usize| {
        let card = &cards[index];
        let cells = format!("\"{}\"", card.look_for.replace('"', "'"));
        Ok(Entry { name: format!("{}.png", card.name), cells, frame: card.frame.clone() })
    };
    FrameSeries::new("look for", cards.len(), make)
}

/// Fields of the half-turn card.
const FIELDS: usize = 9;

/// δ/π of each field of the half-turn card.
fn half_turn_factor(field: usize) -> f64 {
    0.8 + 0.4 * field as f64 / (FIELDS - 1) as f64
}

/// All cards for a phase panel; `distance` [m] in front of it is where lenses and letters are seen.
///
/// # Errors
/// [`Error::Parameter`] for a panel that modulates amplitude, or a distance that is not positive or too near for the
/// panel's pixels; otherwise as [`drive`].
pub fn cards(
    profile: &PanelProfile,
    wavelength: f64,
    correction: Option<&Wavefront>,
    distance: f64,
    progress: &Progress,
) -> Result<Vec<Card>> {
    let grid = profile.grid()?;
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(Error::out_of_range("distance", format!("{distance} m"), "must be greater than zero"));
    }
    let shown = |phase: Vec<f32>, name: &str| -> Result<Frame> {
        let pattern = Pattern::Phase(PhasePattern::new(grid, wavelength, phase)?);
        let mut frame = drive(&pattern, correction, profile)?.frame;
        frame.metadata.origin.notes = vec![format!("calibration card: {name}")];
        Ok(frame)
    };
    let far = crate::units::show_length(distance);
    progress.start("cards", 0);
    Ok(vec![
        Card {
            name: "half-turn",
            frame: shown(half_turn(grid), "half-turn")?,
            look_for: format!(
                "image the panel with undiffracted light alone (a stop that lets only the zero order pass): of {FIELDS} \
                 fields from {:.1} to {:.1} of a half turn the middle one, between two bars, is the darkest; if the field marked \
                 by k steps to the right is, the curve's 2π level is {:.0} % too low for each step",
                half_turn_factor(0),
                half_turn_factor(FIELDS - 1),
                40.0 / (FIELDS - 1) as f64
            ),
        },
        Card {
            name: "lenses",
            frame: shown(lenses(grid, wavelength, distance)?, "lenses")?,
            look_for: format!(
                "on a screen {far} in front of the panel: a square lattice of sharp spots; out of line or blurred where the \
                 panel is not flat"
            ),
        },
        Card {
            name: "letters",
            frame: shown(letters(grid, wavelength, distance, progress)?, "letters")?,
            look_for: format!(
                "on a screen {far} in front of the panel, seen from behind it: an upright F on the left, an upright L on the \
                 right; mirrored or turned over means a flip, light that converges behind the panel a wrong phase sign"
            ),
        },
    ])
}

/// Checkerboards of 0 and δ in fields from left to right; bars mark the middle field.
fn half_turn(grid: Grid) -> Vec<f32> {
    /// Side of a square of the checkerboard [pixels]: crosstalk must not decide the mean.
    const SIDE: usize = 4;
    let one = |i: usize| {
        let (column, row) = (i % grid.width, i / grid.width);
        let field = column * FIELDS / grid.width;
        let inside = (column * FIELDS % grid.width) as f64 / grid.width as f64;
        // Borders of a field and the upper and lower rims stay bright, but for the bars at the middle field.
        let rim = row * 8 < grid.height || row * 8 >= 7 * grid.height;
        let edge = !(0.06..0.94).contains(&inside);
        let bar = rim && field == FIELDS / 2 && !edge;
        let factor = if bar { 1.0 } else { half_turn_factor(field) };
        let odd = !(column / SIDE + row / SIDE).is_multiple_of(2);
        if odd && (bar || !(rim || edge)) { (factor * PI) as f32 } else { 0.0 }
    };
    (0..grid.len()).map(one).collect()
}

/// Square lenses side by side.
fn lenses(grid: Grid, wavelength: f64, distance: f64) -> Result<Vec<f32>> {
    // As large as the pixels can focus to that distance, and no fewer than four along the shorter side.
    let pitch = grid.pitch_x.max(grid.pitch_y);
    let steepest = 0.8 * wavelength * distance / pitch;
    let side = steepest.min(grid.extent_x().min(grid.extent_y()) / 4.0);
    // A lens is sharp only where it spans several Fresnel zones.
    let zones = (0.5 * side).powi(2) / (wavelength * distance);
    if zones < 1.0 {
        let what = format!(
            "{}: the panel is too small for lenses that focus so far away; take a distance below {}",
            crate::units::show_length(distance),
            crate::units::show_length((0.5 * side).powi(2) / wavelength)
        );
        return Err(Error::parameter("distance", what));
    }
    let from_middle = |x: f64| x - (x / side).round() * side;
    let one = |i: usize| {
        let (x, y) = (from_middle(grid.x(i % grid.width)), from_middle(grid.y(i / grid.width)));
        // Converges on a point in front: the phase falls outwards.
        let turns = -(x * x + y * y) / (2.0 * wavelength * distance);
        (turns.rem_euclid(1.0) * TAU) as f32
    };
    Ok((0..grid.len()).map(one).collect())
}

/// Points of two letters on a plane in front; the phase of their hologram.
fn letters(grid: Grid, wavelength: f64, distance: f64, progress: &Progress) -> Result<Vec<f32>> {
    const F: [&str; 7] = ["#####", "#....", "#....", "####.", "#....", "#....", "#...."];
    const L: [&str; 7] = ["#....", "#....", "#....", "#....", "#....", "#....", "#####"];
    // Within half of the angle that the pixels reach from every place of the panel, so that conjugates lie elsewhere.
    let reach = 0.25 * (wavelength / (2.0 * grid.pitch_x)).min(1.0).asin().tan() * distance;
    let height = reach.max(0.125 * grid.extent_y()).min(0.4 * grid.extent_y());
    let step = 2.0 * height / 13.0;
    let mut points = Vec::new();
    let mut random = Random::new(1, 0);
    for (letter, left) in [(F, -11.0), (L, 3.0)] {
        // Points of a regular lattice would have their products on the same lattice: each is moved a little.
        for (row, line) in letter.iter().enumerate() {
            for (column, _) in line.char_indices().filter(|(_, c)| *c == '#') {
                for sub in 0..4 {
                    let (du, dv) = (f64::from(sub % 2) * 0.5, f64::from(sub / 2) * 0.5);
                    let mut astray = || 0.9 * (random.uniform() - 0.5);
                    let x = (left + 2.0 * (column as f64 + du) + astray()) * step;
                    let y = (6.0 - 2.0 * (row as f64 + dv) + astray()) * step;
                    let position = DVec3::new(x, y, distance);
                    points.push(PointSource { position, amplitude: 1.0, phase: random.phase() });
                }
            }
        }
    }
    let plan = hologram::plan(&points, &grid, wavelength, &HologramSettings::default())?;
    let field = hologram::compute(&points, &grid, wavelength, &plan, progress)?.field;
    Ok(field.samples.iter().map(|u| u.arg()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::{Curve, Faults, Response, Simulation, simulate};
    use std::path::Path;

    fn panel() -> PanelProfile {
        let text = "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = 360\nheight = 256\npitch = \"8um\"\n\
                    bits = 8\nfill_factor = 1.0\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"linear\"\n\
                    levels_for_2pi = 200\n";
        PanelProfile::parse(text, Path::new("t.toml")).expect("profile")
    }

    #[test]
    fn the_darkest_field_tells_a_wrong_level_of_a_turn() {
        let profile = panel();
        let card = &cards(&profile, 532e-9, None, 0.1, &Progress::new()).expect("cards")[0];
        for (truth, darkest) in [(200.0, 4), (210.0, 5), (190.0, 3), (220.0, 6)] {
            let response = Some(Response { wavelength: None, curve: Curve::Linear { levels_for_2pi: truth } });
            let settings = Simulation { faults: Faults { response, ..Faults::default() }, ..Simulation::default() };
            let seen = simulate(&card.frame, &settings, &Progress::new()).expect("simulate");
            // Undiffracted light of each field: its mean.
            let mean = |field: usize| -> f32 {
                let columns = field * 40 + 4..field * 40 + 36;
                let part = (32..224).flat_map(|row| columns.clone().map(move |column| row * 360 + column));
                part.map(|i| seen.samples[i]).sum::<crate::field::Complex32>().norm()
            };
            let found = (0..FIELDS).min_by(|&a, &b| mean(a).total_cmp(&mean(b))).expect("fields");
            assert_eq!(found, darkest, "2π at level {truth}");
        }
    }

    #[test]
    fn lenses_and_letters_stand_in_front_of_the_panel() {
        let profile = panel();
        let (distance, progress) = (0.1, Progress::new());
        let made = cards(&profile, 532e-9, None, distance, &progress).expect("cards");
        for (card, peak) in made[1..].iter().zip([30.0, 15.0]) {
            let light = simulate(&card.frame, &Simulation::default(), &progress).expect("simulate");
            let brightest = |z: f64| {
                let seen = crate::propagation::propagate(&light, z, &progress).expect("propagate").intensity();
                let mean = seen.iter().sum::<f32>() / seen.len() as f32;
                seen.iter().fold(0.0, |a: f32, &b| a.max(b)) / mean
            };
            let (front, behind) = (brightest(distance), brightest(-distance));
            assert!(front > peak && front > 2.0 * behind, "{}: {front} {behind}", card.name);
        }
        // The F's upper bar is left and above of the middle, the L's lower bar right and below.
        let light = simulate(&made[2].frame, &Simulation::default(), &progress).expect("simulate");
        let seen = crate::propagation::propagate(&light, distance, &progress).expect("propagate").intensity();
        let quarter = |right: bool, lower: bool| -> f32 {
            let inside = |i: &usize| ((i % 360) >= 180) == right && ((i / 360) >= 128) == lower;
            (0..seen.len()).filter(inside).map(|i| seen[i].powi(2)).sum()
        };
        assert!(quarter(false, false) > 1.1 * quarter(false, true), "an F is heavier above");
        assert!(quarter(true, true) > 1.1 * quarter(true, false), "an L is heavier below");
        assert!(cards(&profile, 532e-9, None, 100.0, &progress).is_err());
        assert!(cards(&profile, 532e-9, None, -0.1, &progress).is_err());
    }
}
