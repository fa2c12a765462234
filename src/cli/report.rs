//! What a command did: lines for people, JSON for machines.

use super::bar::aside;
use crate::units::show_length;
use crate::{Error, Result, files};
use serde::Serialize;
use serde_json::{Map, Value};
use std::io::Write;
use std::path::Path;

/// Values for machines, lines for people, warnings for both.
#[derive(Debug, Default)]
pub(crate) struct Report {
    values: Map<String, Value>,
    lines: Vec<String>,
    warnings: Vec<String>,
}

impl Report {
    /// For the command `name`.
    pub(crate) fn new(name: &str) -> Self {
        let mut report = Self::default();
        report.value("command", name);
        report
    }
    /// Adds all fields of a struct, each under its name.
    pub(crate) fn section(&mut self, fields: impl Serialize) {
        if let Value::Object(fields) = json(fields) {
            self.values.extend(fields);
        }
    }
    /// Adds a value for machines.
    pub(crate) fn value(&mut self, key: &str, value: impl Serialize) {
        self.values.insert(key.into(), json(value));
    }
    /// Adds a line for people.
    pub(crate) fn line(&mut self, line: impl Into<String>) {
        self.lines.push(line.into());
    }
    /// Adds a value for machines with the line for people (empty: none).
    pub(crate) fn add(&mut self, key: &str, value: impl Serialize, line: impl Into<String>) {
        if !key.is_empty() {
            self.value(key, value);
        }
        let line = line.into();
        if !line.is_empty() {
            self.line(line);
        }
    }
    /// Adds what serialises, by reference.
    pub(crate) fn add_serialised(&mut self, key: &str, value: &impl Serialize, line: impl Into<String>) {
        self.add(key, value, line);
    }
    /// Adds a list, a line for each of its entries, and writes it to a file where that is asked for.
    pub(crate) fn list<T: Serialize>(
        &mut self,
        key: &str,
        lines: impl Iterator<Item = String>,
        entries: &[T],
        path: Option<&Path>,
    ) -> Result<()> {
        lines.for_each(|line| self.line(line));
        self.add_serialised(key, &entries, "");
        let Some(path) = path else { return Ok(()) };
        let text = serde_json::to_string_pretty(entries).map_err(|e| Error::unsupported(e.to_string()))?;
        files::write_bytes(path, text.as_bytes())
    }
    /// Adds what was written, and where.
    pub(crate) fn output(&mut self, what: &str, path: &Path) {
        self.file("output", what, path);
    }
    /// Adds a file that was written, under a key of its own.
    pub(crate) fn file(&mut self, key: &str, what: &str, path: &Path) {
        self.add(key, path.display().to_string(), format!("{what:<12} {}", path.display()));
    }
    /// Adds the report of a part: an object under its name for machines, its lines under `line` for people.
    pub(crate) fn add_part(&mut self, name: &str, line: impl Into<String>, part: Self) {
        self.add(name, part.json(), line);
        let new: Vec<String> = part.warnings.into_iter().filter(|w| !self.warnings.contains(w)).collect();
        self.warnings.extend(new);
        self.lines.extend(part.lines.iter().map(|line| format!("  {line}")));
    }
    /// Adds warnings; they go to standard error at once, and into the JSON.
    pub(crate) fn warn<W: ToString>(&mut self, warnings: impl IntoIterator<Item = W>) {
        for warning in warnings {
            let warning = super::refusal::one_line(&warning.to_string());
            if !self.warnings.contains(&warning) {
                aside(&format!("warning: {warning}"));
                self.warnings.push(warning);
            }
        }
    }
    /// Tells people at once what is about to begin, on standard error.
    pub(crate) fn begins(&self, line: &str) {
        eprintln!("{line}");
    }
    /// Warns of a typed depth on the other side of the panel than all of the content: with a wrong sign the picture is out
    /// of focus, and nothing else tells.
    pub(crate) fn check_side(&mut self, flag: &str, z: f64, content: Option<[f64; 2]>) {
        let Some([near, far]) = content else { return };
        if (near < 0.0 && far < 0.0 && z > 0.0) || (near > 0.0 && far > 0.0 && z < 0.0) {
            let side = |z: f64| if z < 0.0 { "behind" } else { "in front of" };
            self.warn([format!(
                "--{flag}: {} is {} the panel, the content stands {} it, from {} to {}; depths are negative behind the panel",
                show_length(z),
                side(z),
                side(near),
                show_length(near),
                show_length(far)
            )]);
        }
    }
    /// Adds all of another report.
    pub(crate) fn merge(&mut self, other: Self) {
        self.values.extend(other.values);
        self.lines.extend(other.lines);
        self.warnings.extend(other.warnings);
    }
    /// Writes it as `report.json` into the folder that holds the results, and says so.
    pub(crate) fn written_to(mut self, folder: &Path) -> Result<Self> {
        let shown = folder.display().to_string();
        let line = format!("pictures and data in {shown}");
        self.add("output", shown, line);
        let text = serde_json::to_string_pretty(&self.json()).unwrap_or_default();
        files::write_bytes(&folder.join("report.json"), text.as_bytes())?;
        Ok(self)
    }
    /// The report as JSON.
    pub(crate) fn json(&self) -> Value {
        let mut all = self.values.clone();
        all.insert("warnings".into(), self.warnings.clone().into());
        Value::Object(all)
    }
    fn text(&self, json: bool) -> String {
        if json {
            return serde_json::to_string_pretty(&self.json()).unwrap_or_default() + "\n";
        }
        self.lines.iter().flat_map(|line| [line.as_str(), "\n"]).collect()
    }
    /// Prints it on standard error, where standard output is taken.
    pub(crate) fn print_aside(&self, json: bool) {
        eprint!("{}", self.text(json));
    }
    /// Prints it on standard output.
    pub(crate) fn print(&self, json: bool) -> Result<()> {
        let text = self.text(json);
        match std::io::stdout().write_all(text.as_bytes()) {
            // A reader that has seen enough (`| head`) is no failure.
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => other.map_err(|source| Error::Io { path: "standard output".into(), source }),
        }
    }
}

/// A report is plain data; what cannot be JSON (a NaN) becomes null.
fn json(value: impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or(Value::Null)
}

/// A line that begins with a step's name and how long it took.
pub(crate) fn step(name: &str, took: f64, what: impl std::fmt::Display) -> String {
    format!("{name:<12} {:>8}  {what}", seconds(took)).trim_end().to_owned()
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
