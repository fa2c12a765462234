//! Keys pressed in a window.

use winit::keyboard::{Key as WinitKey, ModifiersState, NamedKey};

/// A key that was pressed in a window, beside those that end the show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyPress {
    /// Which one.
    pub key: Key,
    /// Whether a shift key was held.
    pub shift: bool,
}

/// A key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Arrow to the left.
    Left,
    /// Arrow to the right.
    Right,
    /// Arrow up.
    Up,
    /// Arrow down.
    Down,
    /// Page up.
    PageUp,
    /// Page down.
    PageDown,
    /// What a key types, in lower case.
    Letter(char),
}

impl KeyPress {
    pub(super) fn of(key: &WinitKey, modifiers: ModifiersState) -> Option<Self> {
        let key = match key {
            WinitKey::Named(NamedKey::ArrowLeft) => Key::Left,
            WinitKey::Named(NamedKey::ArrowRight) => Key::Right,
            WinitKey::Named(NamedKey::ArrowUp) => Key::Up,
            WinitKey::Named(NamedKey::ArrowDown) => Key::Down,
            WinitKey::Named(NamedKey::PageUp) => Key::PageUp,
            WinitKey::Named(NamedKey::PageDown) => Key::PageDown,
            WinitKey::Character(text) => Key::Letter(text.chars().next()?.to_ascii_lowercase()),
            _ => return None,
        };
        Some(Self { key, shift: modifiers.shift_key() })
    }
}

/// Whether it ends the show: Esc, Q, Ctrl+C.
pub(super) fn ends(key: &WinitKey, modifiers: ModifiersState) -> bool {
    match key {
        WinitKey::Named(NamedKey::Escape) => true,
        WinitKey::Character(text) => {
            text.eq_ignore_ascii_case("q") || (modifiers.control_key() && text.eq_ignore_ascii_case("c"))
        }
        _ => false,
    }
}
