//! A list in a message.

use std::fmt::{self, Display, Formatter};

/// Displays elements as TOML writes them: `[2, 2, 1]`.
#[derive(Clone, Copy, Debug)]
pub struct List<'e, T>(pub &'e [T]);

impl<T: Display> Display for List<'_, T> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str("[")?;
        for (index, element) in self.0.iter().enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            write!(formatter, "{separator}{element}")?;
        }
        formatter.write_str("]")
    }
}

#[cfg(test)]
mod tests {
    use super::List;

    #[test]
    fn a_list_is_displayed_as_in_toml() {
        assert_eq!(List(&[2, 12, 1]).to_string(), "[2, 12, 1]");
        assert_eq!(List(&[0.5, 60.0]).to_string(), "[0.5, 60]");
        assert_eq!(List::<u8>(&[]).to_string(), "[]");
    }
}
