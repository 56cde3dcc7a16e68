//! Division of the folds among processes.

use std::str::FromStr;

/// Shard K of N: every N-th fold, from the K-th on. The default is the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the shard, from 0.
    index: usize,
    /// Number of shards.
    count: usize,
}

/// Text that is no shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text} is no shard; write K/N with 1 <= K <= N, such as 2/8")]
pub struct ShardError {
    /// The text.
    text: String,
}

impl Shard {
    /// Returns whether the shard has the fold of this index, from 0.
    pub fn contains(&self, fold: usize) -> bool {
        fold % self.count == self.index
    }
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let error = || ShardError {
            text: text.to_owned(),
        };
        let (number, count) = text.split_once('/').ok_or_else(error)?;
        let number: usize = number.parse().map_err(|_| error())?;
        let count: usize = count.parse().map_err(|_| error())?;
        if number < 1 || number > count {
            return Err(error());
        }
        Ok(Self {
            index: number - 1,
            count,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fold_is_in_one_shard() {
        let shards: Vec<Shard> = ["1/3", "2/3", "3/3"]
            .map(|text| text.parse().unwrap())
            .into();
        for fold in 0..20 {
            let owners = shards.iter().filter(|shard| shard.contains(fold));
            assert_eq!(owners.count(), 1);
        }
        assert!((0..20).all(|fold| Shard::default().contains(fold)));
    }

    #[test]
    fn other_text_is_refused_with_an_example() {
        for text in ["0/3", "4/3", "3", "a/b", "1/0", "-1/2"] {
            let error = text.parse::<Shard>().unwrap_err().to_string();
            assert!(error.contains(text) && error.contains("2/8"), "{error}");
        }
    }
}
