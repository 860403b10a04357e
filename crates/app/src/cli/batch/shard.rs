use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// One of several shares of a batch, each for a machine of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Shard {
    /// Which, from 1.
    pub index: usize,
    /// Of how many.
    pub count: usize,
}

/// Shares that one may want.
const MOST: usize = 10_000;

impl Shard {
    /// Whether it has the input at that place of the sorted list.
    pub fn holds(self, place: usize) -> bool {
        place % self.count == self.index - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let numbers = (s.split_once('/')).and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if 1 <= index && index <= count && count <= MOST => {
                Ok(Self { index, count })
            }
            _ => Err(format!(
                "write which share of how many, the first is 1, at most {MOST}: 1/4"
            )),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(s: String) -> Result<Self, String> {
        s.parse()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl From<Shard> for String {
    fn from(s: Shard) -> Self {
        s.to_string()
    }
}

/// Where a manifest is: that of the whole, or of a share.
pub fn manifest(directory: &Path, shard: Option<Shard>) -> PathBuf {
    directory.join(match shard {
        None => "manifest.jsonl".into(),
        Some(s) => format!("manifest-{}-of-{}.jsonl", s.index, s.count),
    })
}

/// The share that a manifest of that name is of.
pub fn of_manifest(name: &str) -> Option<Shard> {
    let (index, count) = name
        .strip_prefix("manifest-")?
        .strip_suffix(".jsonl")?
        .split_once("-of-")?;
    format!("{index}/{count}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_input_is_in_one_share() {
        let shards: Vec<Shard> = ["1/3", "2/3", "3/3"].map(|s| s.parse().unwrap()).into();
        for place in 0..10 {
            assert_eq!(shards.iter().filter(|s| s.holds(place)).count(), 1);
        }
        for bad in ["0/3", "4/3", "1", "1/0", "-1/3", "1/99999", "a/b"] {
            assert!(bad.parse::<Shard>().unwrap_err().contains("1/4"), "{bad}");
        }
        let path = manifest(Path::new("d"), Some(shards[1]));
        assert_eq!(
            of_manifest(path.file_name().unwrap().to_str().unwrap()),
            Some(shards[1])
        );
        assert_eq!(of_manifest("manifest.jsonl"), None);
    }
}
