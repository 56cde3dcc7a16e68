//! The regions of a memory map.

/// A region of memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    /// Its name.
    pub(crate) name: String,
    /// Its first address.
    pub(crate) origin: u64,
    /// Its bytes.
    pub(crate) length: u64,
}

impl Region {
    /// Bytes up to the end of what lies in it, of pieces with an address and a length.
    pub(crate) fn used(&self, pieces: impl Iterator<Item = (u64, u64)>) -> u64 {
        let end = self.origin + self.length;
        pieces
            .filter(|(address, _)| (self.origin..end).contains(address))
            .map(|(address, length)| address + length - self.origin)
            .max()
            .unwrap_or(0)
    }

    /// The first address behind it.
    pub(crate) const fn end(&self) -> u64 {
        self.origin + self.length
    }
}

/// Regions of a linker script: `NAME : ORIGIN = 0x20000000, LENGTH = 32K`, one to a line. A line of
/// this kind that cannot be read is no region, and whoever asks for it misses it.
pub(crate) fn regions(script: &str) -> Vec<Region> {
    script.lines().filter_map(region).collect()
}

fn region(line: &str) -> Option<Region> {
    let (name, rest) = line.split_once(':')?;
    let rest = rest.trim().strip_prefix("ORIGIN = ")?;
    let (origin, length) = rest.split_once(", LENGTH = ")?;
    Some(Region {
        name: name.trim().to_owned(),
        origin: bytes(origin)?,
        length: bytes(length)?,
    })
}

/// `0x20000000`, `512`, `32K`, `4M`.
fn bytes(text: &str) -> Option<u64> {
    let text = text.trim();
    if let Some(digits) = text.strip_prefix("0x") {
        return u64::from_str_radix(digits, 16).ok();
    }
    let (digits, factor) = match text.strip_suffix('K') {
        Some(digits) => (digits, 1 << 10),
        None => text
            .strip_suffix('M')
            .map_or((text, 1), |digits| (digits, 1 << 20)),
    };
    Some(digits.parse::<u64>().ok()? * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_gives_its_regions_and_nothing_of_its_remarks() {
        let script = "/* RAM: below */\nMEMORY\n{\n  FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n  \
                      RAM   : ORIGIN = 0x20000000, LENGTH = 4M\n}\n_end = ORIGIN(RAM);\n";
        let regions = regions(script);
        let told = |region: &Region| (region.name.clone(), region.origin, region.length);
        assert_eq!(
            regions.iter().map(told).collect::<Vec<_>>(),
            [
                ("FLASH".to_owned(), 0x0800_0000, 512 << 10),
                ("RAM".to_owned(), 0x2000_0000, 4 << 20)
            ]
        );
    }

    #[test]
    fn a_gap_before_the_last_piece_is_used_and_other_regions_are_not() {
        let region = Region {
            name: "RAM".to_owned(),
            origin: 1_000,
            length: 100,
        };
        assert_eq!(
            region.used([(1_000, 10), (1_050, 5), (2_000, 7)].into_iter()),
            55
        );
        assert_eq!(region.used(std::iter::empty()), 0);
    }
}
