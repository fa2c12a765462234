//! What keys set in a live show: how the scene stands, in which light and encoding, and how the operator looks at it.

use super::args::ShowArgs;
use crate::display::{Key, KeyPress};
use crate::encode::Encoding;
use crate::live::Look;
use crate::names::Named;
use crate::panel::{Modulation, Setup};
use glam::DVec3;

/// Lasers that are offered beside the profile's own, where the panel has a curve for them [m].
const LASERS: [f64; 4] = [638e-9, 532e-9, 520e-9, 450e-9];
/// Encodings of a field that take no iterations.
const PHASE: [&str; 3] = ["double-phase", "error-diffusion", "kinoform"];
const AMPLITUDE: [&str; 5] = ["off-axis-bipolar", "off-axis-intensity", "single-side-band", "burckhardt", "lee"];
/// What the keys do, as the operator's view says it.
pub(super) const KEYS: [&str; 7] = [
    "arrows      turn the scene by 5 degrees",
    "shift+arrows  shift it by 0.2 mm",
    "+ -         nearer, farther by 5 mm",
    "w e         next laser, next encoding",
    ", .         look nearer, farther by 2 mm",
    "p, i j k l  eye or plane; move the eye 1 mm",
    "r  as at first       Esc q  end",
];

/// What the keys have set.
#[derive(Clone, Debug)]
pub(super) struct Controls {
    /// Turns of the scene in steps to the right and up.
    pub(super) turn: [i32; 2],
    /// Shifts in steps along x and y, and towards the viewer.
    shift: [i32; 3],
    pub(super) wavelength: usize,
    pub(super) encoding: usize,
    /// Depth in focus, z [m]; the nearest object's until a key sets it.
    focus: Option<f64>,
    /// The eye beside the viewer's place, in steps.
    eye: Option<[i32; 2]>,
}

/// What a key has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Changed {
    Nothing,
    Hologram,
    Look,
}

/// Step of a turn [rad].
pub(super) const TURN_STEP: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Steps of shifts, of depth, of the focus and of the eye [m].
const SHIFT_STEP: f64 = 0.2e-3;
const DEPTH_STEP: f64 = 5e-3;
const FOCUS_STEP: f64 = 2e-3;
const EYE_STEP: f64 = 1e-3;
/// Steps that a turn or shift may be away.
const MOST_STEPS: i32 = 1000;

impl Controls {
    pub(super) fn new() -> Self {
        Self { turn: [0; 2], shift: [0; 3], wavelength: 0, encoding: 0, focus: None, eye: None }
    }

    pub(super) fn press(&mut self, press: KeyPress, choices: &Choices, near: f64) -> Changed {
        let step = |value: &mut i32, by: i32| *value = (*value + by).clamp(-MOST_STEPS, MOST_STEPS);
        let next = |value: usize, count: usize| (value + if press.shift { count - 1 } else { 1 }) % count.max(1);
        let arrow = match press.key {
            Key::Left => Some((0, -1)),
            Key::Right => Some((0, 1)),
            Key::Down => Some((1, -1)),
            Key::Up => Some((1, 1)),
            _ => None,
        };
        match (arrow, press.key) {
            (Some((axis, by)), _) if press.shift => step(&mut self.shift[axis], by),
            (Some((axis, by)), _) => step(&mut self.turn[axis], by),
            (_, Key::Letter('+' | '=') | Key::PageUp) => step(&mut self.shift[2], 1),
            (_, Key::Letter('-' | '_') | Key::PageDown) => step(&mut self.shift[2], -1),
            (_, Key::Letter('w')) => self.wavelength = next(self.wavelength, choices.wavelengths.len()),
            (_, Key::Letter('e')) => self.encoding = next(self.encoding, choices.encodings.len()),
            (_, Key::Letter('r')) => *self = Self::new(),
            (_, Key::Letter(letter)) => return self.look(letter, near),
            _ => return Changed::Nothing,
        }
        Changed::Hologram
    }

    fn look(&mut self, letter: char, near: f64) -> Changed {
        let eye = |eye: &mut Option<[i32; 2]>, axis: usize, by: i32| {
            let [x, y] = eye.get_or_insert([0; 2]);
            let value = if axis == 0 { x } else { y };
            *value = (*value + by).clamp(-MOST_STEPS, MOST_STEPS);
        };
        match letter {
            ',' | '<' => self.focus = Some(self.focus.unwrap_or(near) + FOCUS_STEP),
            '.' | '>' => self.focus = Some(self.focus.unwrap_or(near) - FOCUS_STEP),
            'p' => self.eye = if self.eye.is_some() { None } else { Some([0; 2]) },
            'j' => eye(&mut self.eye, 0, -1),
            'l' => eye(&mut self.eye, 0, 1),
            'k' => eye(&mut self.eye, 1, -1),
            'i' => eye(&mut self.eye, 1, 1),
            _ => return Changed::Nothing,
        }
        Changed::Look
    }

    pub(super) fn shifted(&self) -> DVec3 {
        let [x, y, z] = self.shift.map(f64::from);
        DVec3::new(x * SHIFT_STEP, y * SHIFT_STEP, z * DEPTH_STEP)
    }

    /// The eye beside its place [m].
    pub(super) fn eye_aside(&self) -> DVec3 {
        let [x, y] = self.eye.unwrap_or_default().map(|steps| f64::from(steps) * EYE_STEP);
        DVec3::new(x, y, 0.0)
    }

    pub(super) fn look_at(&self, near: f64) -> Look {
        Look {
            focus: self.focus.unwrap_or(near),
            eye: self.eye.map(|eye| eye.map(|steps| f64::from(steps) * EYE_STEP)),
            pupil: 4e-3,
        }
    }
}

/// What the keys choose from.
pub(super) struct Choices {
    pub(super) wavelengths: Vec<f64>,
    pub(super) encodings: Vec<Encoding>,
}

impl Choices {
    pub(super) fn new(args: &ShowArgs, setup: &Setup) -> Self {
        let profile = &setup.profile;
        let mut wavelengths = vec![setup.wavelength];
        for other in profile.wavelengths.iter().chain(&LASERS) {
            let new = wavelengths.iter().all(|known| (known - other).abs() > 1e-9);
            if new && profile.drive_curve(*other).is_ok() {
                wavelengths.push(*other);
            }
        }
        let usual: &[&str] = match profile.modulation() {
            Modulation::Phase => &PHASE,
            Modulation::Amplitude => &AMPLITUDE,
        };
        let mut encodings: Vec<Encoding> = args.encoding.encoding.iter().cloned().collect();
        let typed = encodings.first().map(Encoding::name);
        let others = usual.iter().filter(|name| Some(**name) != typed);
        encodings.extend(others.filter_map(|name| Encoding::named(name).ok()));
        Self { wavelengths, encodings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices() -> Choices {
        Choices { wavelengths: vec![633e-9, 520e-9], encodings: vec![Encoding::Kinoform; 3] }
    }

    #[test]
    fn keys_change_what_they_say_and_r_undoes_it_all() {
        let mut controls = Controls::new();
        let press =
            |controls: &mut Controls, key: Key, shift: bool| controls.press(KeyPress { key, shift }, &choices(), -0.1);
        assert_eq!(press(&mut controls, Key::Right, false), Changed::Hologram);
        press(&mut controls, Key::Up, false);
        press(&mut controls, Key::Left, true);
        press(&mut controls, Key::Letter('-'), false);
        assert_eq!(controls.turn, [1, 1]);
        assert!((controls.shifted() - DVec3::new(-SHIFT_STEP, 0.0, -DEPTH_STEP)).length() < 1e-15);
        press(&mut controls, Key::Letter('e'), true);
        press(&mut controls, Key::Letter('w'), false);
        press(&mut controls, Key::Letter('w'), false);
        assert_eq!((controls.encoding, controls.wavelength), (2, 0));
        assert_eq!(press(&mut controls, Key::Letter('x'), false), Changed::Nothing);
        // The look does not change the hologram: focus from the nearest object on, the eye in steps.
        assert_eq!(press(&mut controls, Key::Letter('.'), false), Changed::Look);
        press(&mut controls, Key::Letter('i'), false);
        let look = controls.look_at(-0.3);
        assert!((look.focus - (-0.1 - FOCUS_STEP)).abs() < 1e-15 && look.eye == Some([0.0, EYE_STEP]));
        press(&mut controls, Key::Letter('p'), false);
        assert_eq!(controls.look_at(-0.3).eye, None);
        press(&mut controls, Key::Letter('r'), false);
        assert_eq!((controls.turn, controls.shift, controls.focus), ([0; 2], [0; 3], None));
        assert_eq!(controls.look_at(-0.3).focus, -0.3);
    }
}
