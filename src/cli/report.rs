//! What a command did: lines for people, JSON for machines.

use holodrive::{Error, Result};
use serde_json::{Map, Value};
use std::io::Write;

/// A report in the order in which its entries were added.
#[derive(Debug, Default)]
pub(crate) struct Report {
    entries: Vec<(String, Value, String)>,
    warnings: Vec<String>,
}

impl Report {
    /// For the command `name`.
    pub(crate) fn new(name: &str) -> Self {
        let mut report = Self::default();
        report.entries.push(("command".into(), name.into(), String::new()));
        report
    }
    /// Adds a value for machines with the line for people (empty: none).
    pub(crate) fn add(&mut self, key: &str, value: impl Into<Value>, line: impl Into<String>) {
        self.entries.push((key.into(), value.into(), line.into()));
    }
    /// Adds anything that serialises.
    pub(crate) fn add_serialised(&mut self, key: &str, value: &impl serde::Serialize, line: impl Into<String>) {
        // A report is plain data; what cannot be JSON (a NaN) becomes null.
        let value = serde_json::to_value(value).unwrap_or(Value::Null);
        self.add(key, value, line);
    }
    /// Adds the report of a part: an object under its name for machines, its lines under `line` for people.
    pub(crate) fn add_part(&mut self, name: &str, line: impl Into<String>, part: Self) {
        self.add(name, part.json(), line);
        let new: Vec<String> = part.warnings.into_iter().filter(|w| !self.warnings.contains(w)).collect();
        self.warnings.extend(new);
        let lines = part.entries.into_iter().map(|(_, _, line)| line).filter(|line| !line.is_empty());
        self.entries.extend(lines.map(|line| (String::new(), Value::Null, format!("  {line}"))));
    }
    /// Adds warnings; they go to standard error at once, and into the JSON.
    pub(crate) fn warn<W: ToString>(&mut self, warnings: impl IntoIterator<Item = W>) {
        for warning in warnings {
            let warning = warning.to_string();
            if !self.warnings.contains(&warning) {
                eprintln!("warning: {warning}");
                self.warnings.push(warning);
            }
        }
    }
    /// The report as JSON.
    pub(crate) fn json(&self) -> Value {
        let mut map: Map<String, Value> =
            self.entries.iter().filter(|(k, _, _)| !k.is_empty()).map(|(k, v, _)| (k.clone(), v.clone())).collect();
        map.insert("warnings".into(), self.warnings.clone().into());
        Value::Object(map)
    }
    /// Prints it on standard output.
    pub(crate) fn print(&self, json: bool) -> Result<()> {
        let mut text = String::new();
        if json {
            text = serde_json::to_string_pretty(&self.json()).unwrap_or_default() + "\n";
        } else {
            for (_, _, line) in self.entries.iter().filter(|(_, _, line)| !line.is_empty()) {
                text += line;
                text.push('\n');
            }
        }
        match std::io::stdout().write_all(text.as_bytes()) {
            // A reader that has seen enough (`| head`) is no failure.
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => other.map_err(|source| Error::Io { path: "standard output".into(), source }),
        }
    }
}

/// Seconds with as many digits as they deserve.
pub(crate) fn seconds(seconds: f64) -> String {
    if seconds < 1.0 { format!("{:.0} ms", seconds * 1e3) } else { format!("{seconds:.2} s") }
}

/// A count with separators: 161 056.
pub(crate) fn count(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}
