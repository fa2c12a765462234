//! Requests of the local protocol, read from their lines.

use super::task::Task;
use serde::Deserialize;

/// Longest request [bytes]: that of a play of many names.
pub(super) const LINE_LIMIT: usize = 512 * 1024;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Quantity {
    Phase,
    Amplitude,
    Levels,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Dtype {
    Uint8,
    Uint16,
    Float32,
    Float64,
}

impl Dtype {
    /// Bytes of a pixel.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Uint8 => 1,
            Self::Uint16 => 2,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// What the array in the buffer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ArrayType {
    pub(super) quantity: Quantity,
    pub(super) dtype: Dtype,
}

/// What a client says.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Command {
    /// It has mapped the buffer.
    Mapped,
    /// What is in the buffer is to be shown, or kept.
    Array(Task, ArrayType),
    /// Something is to be done that needs no array.
    Other(Task),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Request {
    mapped: bool,
    show: Option<Quantity>,
    dtype: Option<Dtype>,
    preload: Option<String>,
    recall: Option<String>,
    play: Option<Vec<String>>,
    rate: Option<f64>,
    arm: Option<Vec<String>>,
    forget: Option<Vec<String>>,
}

/// Reads a request: the line without its end. The error is an answer to the client.
pub(super) fn read(line: &[u8]) -> Result<Command, String> {
    let request: Request =
        serde_json::from_slice(line).map_err(|error| format!("The request is not understood: {error}."))?;
    let Request { mapped, show, dtype, preload, recall, play, rate, arm, forget } = request;
    let mut asked = Vec::new();
    if mapped {
        asked.push(Command::Mapped);
    }
    if let Some(quantity) = show {
        let dtype = dtype.ok_or("An array is of a \"dtype\".")?;
        if matches!(dtype, Dtype::Uint8 | Dtype::Uint16) != (quantity == Quantity::Levels) {
            return Err("Levels are uint8 or uint16; phases and amplitudes are float32 or float64.".into());
        }
        let task = preload.clone().map_or(Task::Show, Task::Preload);
        asked.push(Command::Array(task, ArrayType { quantity, dtype }));
    } else if preload.is_some() || dtype.is_some() {
        return Err("An array says what it is: {\"show\": \"phase\", \"dtype\": \"float32\"}.".into());
    }
    let others = [
        recall.map(Task::Recall),
        play.map(|names| Task::Play { names, rate }),
        arm.map(Task::Arm),
        forget.map(Task::Forget),
    ];
    asked.extend(others.into_iter().flatten().map(Command::Other));
    match (asked.pop(), asked.is_empty()) {
        (Some(Command::Array(task, array)), true) if rate.is_none() => {
            task.check().map(|()| Command::Array(task, array))
        }
        (Some(Command::Other(task)), true) if rate.is_none() || matches!(task, Task::Play { .. }) => {
            task.check().map(|()| Command::Other(task))
        }
        (Some(Command::Mapped), true) if rate.is_none() => Ok(Command::Mapped),
        _ => Err(
            "A request is one of mapped, show (with dtype, perhaps preload), recall, play (perhaps rate), arm, forget."
                .into(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn requests_are_read_and_others_answered() {
        let ask = |text: &str| read(text.as_bytes());
        let phase = ArrayType { quantity: Quantity::Phase, dtype: Dtype::Float32 };
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert_eq!(ask(r#"{"show": "phase", "dtype": "float32"}"#), Ok(Command::Array(Task::Show, phase)));
        let kept = Command::Array(Task::Preload("a".into()), phase);
        assert_eq!(ask(r#"{"show": "phase", "dtype": "float32", "preload": "a"}"#), Ok(kept));
        assert_eq!(ask(r#"{"mapped": true}"#), Ok(Command::Mapped));
        assert_eq!(ask(r#"{"recall": "a"}"#), Ok(Command::Other(Task::Recall("a".into()))));
        let play = Task::Play { names: names(&["a", "b", "a"]), rate: Some(30.0) };
        assert_eq!(ask(r#"{"play": ["a", "b", "a"], "rate": 30}"#), Ok(Command::Other(play)));
        assert_eq!(ask(r#"{"arm": []}"#), Ok(Command::Other(Task::Arm(Vec::new()))));
        assert_eq!(ask(r#"{"forget": ["a"]}"#), Ok(Command::Other(Task::Forget(names(&["a"])))));
        for wrong in [
            "",
            "{}",
            "[]",
            "{\"show\": \"phase\"}",
            r#"{"show": "phase", "dtype": "uint8"}"#,
            r#"{"show": "levels", "dtype": "float64"}"#,
            r#"{"show": "levels", "dtype": "int64"}"#,
            r#"{"show": "levels", "dtype": "uint8", "path": "/etc/passwd"}"#,
            r#"{"mapped": true, "show": "phase", "dtype": "float32"}"#,
            r#"{"preload": "a"}"#,
            r#"{"preload": "", "show": "phase", "dtype": "float32"}"#,
            r#"{"recall": "a", "rate": 3}"#,
            r#"{"recall": "a\n"}"#,
            r#"{"recall": "a", "arm": ["a"]}"#,
            r#"{"play": []}"#,
            r#"{"play": ["a"], "rate": 0}"#,
            r#"{"play": ["a"], "rate": 1e9}"#,
            r#"{"rate": 3}"#,
        ] {
            assert!(ask(wrong).is_err(), "{wrong}");
        }
        let many = format!("{{\"play\": [{}\"a\"]}}", "\"a\", ".repeat(super::super::MOST_PLAYED));
        assert!(many.len() < LINE_LIMIT && ask(&many).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_judged_without_panic(line in prop::collection::vec(any::<u8>(), 0..100)) {
            let _ = read(&line);
        }
    }
}
