//! Parses the regions of a linker's memory map.

/// A region of memory: its name, its first address and its length in bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) name: String,
    pub(crate) origin: u64,
    pub(crate) length: u64,
}

impl Region {
    /// Returns the first address after the region.
    pub(crate) const fn end(&self) -> u64 {
        self.origin + self.length
    }
}

/// Parses the regions of a linker script, one per line, such as `NAME : ORIGIN = 0x20000000, LENGTH
/// = 32K`. Leaves out a line of any other form; the budget then reports the region as missing.
pub(crate) fn regions(script: &str) -> Vec<Region> {
    script.lines().filter_map(region).collect()
}

fn region(line: &str) -> Option<Region> {
    let (name, rest) = line.split_once(':')?;
    let rest = rest.trim().strip_prefix("ORIGIN = ")?;
    let (origin, length) = rest.split_once(", LENGTH = ")?;
    Some(Region { name: name.trim().to_owned(), origin: bytes(origin)?, length: bytes(length)? })
}

/// Parses an address or a number of bytes, such as `0x20000000`, `512`, `32K` or `4M`.
fn bytes(text: &str) -> Option<u64> {
    let (digits, shift) = match text.chars().last()? {
        'K' => (text.strip_suffix('K')?, 10),
        'M' => (text.strip_suffix('M')?, 20),
        _ => (text, 0),
    };
    let number = match digits.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => digits.parse(),
    };
    Some(number.ok()? << shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_gives_its_regions_and_nothing_of_its_remarks() {
        let script = "/* RAM: below */\nMEMORY\n{\n  FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n  \
                      RAM   : ORIGIN = 0x20000000, LENGTH = 4M\n  KEPT : ORIGIN = 0x3, LENGTH = 8\n}\n\
                      _end = ORIGIN(RAM);\n";
        let expected =
            [("FLASH", 0x0800_0000, 512 << 10), ("RAM", 0x2000_0000, 4 << 20), ("KEPT", 3, 8)];
        let expected =
            expected.map(|(name, origin, length)| Region { name: name.to_owned(), origin, length });
        assert_eq!(regions(script), expected);
    }
}
