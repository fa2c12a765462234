//! Which tiles one of several processes computes.

use crate::error::{Error, Result};
use std::ops::Range;

/// Part `index` of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 0 on.
    pub index: u64,
    /// At least one.
    pub count: u64,
}

impl Default for Shard {
    /// The whole plate.
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl Shard {
    /// Reads `i/n`, or `auto` and `auto/n`, which take i from a scheduler's variables: `SLURM_ARRAY_TASK_ID` (with
    /// `_MIN`, `_STEP` and `_COUNT`) of Slurm's job arrays, or `JOB_COMPLETION_INDEX` of Kubernetes' Indexed Jobs, with
    /// the number of completions in `JOB_COMPLETIONS`.
    ///
    /// With `auto/n` the scheduler's number is i itself, so that single tasks can be given anew.
    ///
    /// # Errors
    /// [`Error::Parameter`] for anything else, and for i ≥ n.
    pub fn parse(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<Self> {
        let wrong = |what: String| Error::parameter("shard", what);
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong(format!("`{text}` is no number")));
        let of = |name: &str| -> Result<Option<u64>> {
            variable(name).map(|v| number(&v).map_err(|_| wrong(format!("{name}=`{v}` is no number")))).transpose()
        };
        let needed =
            |name: &str, hint: &str| of(name)?.ok_or_else(|| wrong(format!("auto: {name} is not set; {hint}")));
        let unset = || wrong("auto: neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set; give i/n".into());
        let scheduled = || Ok((of("SLURM_ARRAY_TASK_ID")?, of("JOB_COMPLETION_INDEX")?));
        let shard = match text.split_once('/') {
            Some(("auto", count)) => {
                let (slurm, kubernetes) = scheduled()?;
                Self { index: slurm.or(kubernetes).ok_or_else(unset)?, count: number(count)? }
            }
            Some((index, count)) => Self { index: number(index)?, count: number(count)? },
            None if text == "auto" => match scheduled()? {
                (Some(id), _) => {
                    let (first, step) = (of("SLURM_ARRAY_TASK_MIN")?, of("SLURM_ARRAY_TASK_STEP")?);
                    let index = id.saturating_sub(first.unwrap_or(0)) / step.unwrap_or(1).max(1);
                    Self { index, count: needed("SLURM_ARRAY_TASK_COUNT", "give auto/n")? }
                }
                (None, Some(index)) => Self { index, count: needed("JOB_COMPLETIONS", "set it, or give auto/n")? },
                (None, None) => return Err(unset()),
            },
            None => return Err(wrong(format!("`{text}` is not i/n such as 0/8, nor auto"))),
        };
        if shard.count == 0 || shard.index >= shard.count {
            return Err(wrong(format!("{}/{}: the first is 0, the last n - 1", shard.index, shard.count)));
        }
        Ok(shard)
    }

    /// The tiles of this part: ranges of whole tiles, none twice, none left out.
    pub fn tiles(self, tiles: u64) -> Range<u64> {
        let cut = |i: u64| (u128::from(tiles) * u128::from(i) / u128::from(self.count)) as u64;
        cut(self.index)..cut(self.index + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_disjoint_and_whole() {
        for (tiles, count) in [(10, 4), (3, 8), (1_048_576, 1000), (1, 1)] {
            let mut next = 0;
            for index in 0..count {
                let range = Shard { index, count }.tiles(tiles);
                assert_eq!(range.start, next);
                next = range.end;
            }
            assert_eq!(next, tiles);
        }
    }

    #[test]
    fn schedulers_are_understood() {
        let with = |pairs: &[(&str, &str)], text: &str| {
            let pairs: Vec<(String, String)> = pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
            Shard::parse(text, |name| pairs.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone()))
        };
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
        ];
        assert_eq!(with(&slurm, "auto").expect("shard"), Shard { index: 3, count: 4 });
        assert_eq!(with(&slurm, "auto/9").expect("shard"), Shard { index: 7, count: 9 });
        assert_eq!(with(&slurm, "1/2").expect("shard"), Shard { index: 1, count: 2 });
        let cube = [("JOB_COMPLETION_INDEX", "2"), ("JOB_COMPLETIONS", "3")];
        assert_eq!(with(&cube, "auto").expect("shard"), Shard { index: 2, count: 3 });
        assert!(with(&cube[..1], "auto").unwrap_err().to_string().contains("JOB_COMPLETIONS"));
        for wrong in ["4/4", "1/0", "x/2", "-1/2", "auto", "3", "auto/0", ""] {
            assert!(with(&[], wrong).is_err(), "{wrong}");
        }
    }
}
