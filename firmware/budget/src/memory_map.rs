//! Regions of a linker's memory map.

/// A region of memory: name, first address, bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) name: String,
    pub(crate) origin: u64,
    pub(crate) length: u64,
}

impl Region {
    /// First address after the region.
    pub(crate) const fn end(&self) -> u64 {
        self.origin + self.length
    }

    /// Bytes from the region's start to the end of the last piece in it; a piece has an address and a length.
    pub(crate) fn used(&self, pieces: impl Iterator<Item = (u64, u64)>) -> u64 {
        let inside = pieces.filter(|(address, _)| (self.origin..self.end()).contains(address));
        let ends = inside.map(|(address, length)| address + length - self.origin);
        ends.max().unwrap_or(0)
    }
}

/// Parses the regions of a linker script: `NAME : ORIGIN = 0x20000000, LENGTH = 32K`, one per line. A line
/// that cannot be parsed is left out; whoever looks for its region by name then finds none.
pub(crate) fn regions(script: &str) -> Vec<Region> {
    script.lines().filter_map(region).collect()
}

fn region(line: &str) -> Option<Region> {
    let (name, rest) = line.split_once(':')?;
    let (origin, length) = rest
        .trim()
        .strip_prefix("ORIGIN = ")?
        .split_once(", LENGTH = ")?;
    let (name, origin, length) = (name.trim().to_owned(), bytes(origin)?, bytes(length)?);
    Some(Region {
        name,
        origin,
        length,
    })
}

/// Parses `0x20000000`, `512`, `32K` or `4M`.
fn bytes(text: &str) -> Option<u64> {
    let text = text.trim();
    if let Some(digits) = text.strip_prefix("0x") {
        return u64::from_str_radix(digits, 16).ok();
    }
    let digits = text.trim_end_matches(['K', 'M']);
    let shift = ["", "K", "M"]
        .iter()
        .position(|unit| *unit == &text[digits.len()..])?;
    Some(digits.parse::<u64>().ok()? << (10 * shift))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_gives_its_regions_and_nothing_of_its_remarks() {
        let script = "/* RAM: below */\nMEMORY\n{\n  FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n  \
                      RAM   : ORIGIN = 0x20000000, LENGTH = 4M\n}\n_end = ORIGIN(RAM);\n";
        let region = |name: &str, origin, length| Region {
            name: name.to_owned(),
            origin,
            length,
        };
        let expected = [
            region("FLASH", 0x0800_0000, 512 << 10),
            region("RAM", 0x2000_0000, 4 << 20),
        ];
        assert_eq!(regions(script), expected);
    }

    #[test]
    fn a_gap_before_the_last_piece_is_used_and_other_regions_are_not() {
        let region = Region {
            name: "RAM".to_owned(),
            origin: 1_000,
            length: 100,
        };
        let pieces = [(1_000, 10), (1_050, 5), (2_000, 7)];
        assert_eq!(region.used(pieces.into_iter()), 55);
        assert_eq!(region.used(std::iter::empty()), 0);
    }
}
