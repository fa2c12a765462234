//! What is known of the machine behind a plate's profile.

use crate::config::ConfigFile;
use crate::error::Result;
use crate::field::grid::LENGTHS;
use crate::units;
use serde::{Deserialize, Serialize};

/// The machine that a profile is for: what it takes, how it exposes, and what of this nobody has checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Printer {
    /// What it is, in words.
    pub machine: String,
    /// Columns and rows of a stitching field or shot [px]; `export` cuts frames so where nothing else is asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<[u64; 2]>,
    /// The smallest line or gap that it prints [m]; it may be wider than a pixel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smallest: Option<f64>,
    /// Keys of the profile that come from memory or one secondary source.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unverified: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PrinterFile {
    machine: String,
    field: Option<[u64; 2]>,
    smallest: Option<String>,
    #[serde(default)]
    unverified: Vec<String>,
}

impl PrinterFile {
    pub(super) fn read(&self, at: ConfigFile) -> Result<Printer> {
        let smallest =
            self.smallest.as_ref().map(|text| at.read("printer.smallest", text, units::positive_length)).transpose()?;
        let Self { machine, field, unverified, .. } = self;
        Ok(Printer { machine: machine.clone(), field: *field, smallest, unverified: unverified.clone() })
    }
}

impl Printer {
    /// The first number outside its domain, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        if let Some([width, height]) = self.field
            && !((1..=1 << 22).contains(&width) && (1..=1 << 22).contains(&height))
        {
            return Err(format!("printer.field of {width}×{height} pixels: each side must be 1 to 4194304"));
        }
        match self.smallest {
            Some(smallest) if !LENGTHS.contains(&smallest) => {
                Err(format!("printer.smallest = {smallest:e} m is no length of a bench"))
            }
            _ => Ok(()),
        }
    }
}
