//! Sectors of a chip's flash, as a DfuSe loader describes them.

use std::ops::Range;

/// Largest number of sectors in a layout; the chips of the boards have 16 at most.
const MAX_SECTORS: usize = 4096;

/// Address ranges of the sectors, at least one, in ascending order and without gaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FlashLayout {
    pub(crate) sectors: Vec<Range<u32>>,
}

impl FlashLayout {
    /// Parses a loader's description (UM0424, 4.3.2), such as
    /// `@Internal Flash  /0x08000000/04*016Kg,01*064Kg,03*128Kg`. Returns `None` for another text,
    /// for several regions, and for sectors that cannot be read, erased and written.
    pub(crate) fn parse(text: &str) -> Option<FlashLayout> {
        let mut parts = text.split('/');
        let _name = parts.next().filter(|name| name.starts_with('@'))?;
        let address = parts.next()?.trim().strip_prefix("0x")?;
        let mut address = u32::from_str_radix(address, 16).ok()?;
        let mut sectors = Vec::new();
        for part in parts.next()?.trim().split(',') {
            let (count, size) = part.split_once('*')?;
            let size = size.strip_suffix('g')?;
            let (size, unit) = match size.strip_suffix('K') {
                Some(size) => (size, 1 << 10),
                None => (size.strip_suffix('M')?, 1 << 20),
            };
            let size = size.parse::<u32>().ok()?.checked_mul(unit)?;
            let count = count.parse().ok()?;
            if size == 0 || count > MAX_SECTORS - sectors.len() {
                return None;
            }
            for _ in 0..count {
                let end = address.checked_add(size)?;
                sectors.push(address..end);
                address = end;
            }
        }
        let is_complete = parts.next().is_none() && !sectors.is_empty();
        is_complete.then_some(FlashLayout { sectors })
    }

    /// Returns the addresses of the whole flash.
    pub(crate) fn range(&self) -> Range<u32> {
        let first = self.sectors.first().map_or(0, |sector| sector.start);
        first..self.sectors.last().map_or(first, |sector| sector.end)
    }
}

#[cfg(test)]
mod tests {
    use super::FlashLayout;

    #[test]
    fn the_layouts_of_both_boards_are_read_and_others_refused() {
        let h743 = FlashLayout::parse("@Internal Flash   /0x08000000/16*128Kg").unwrap();
        assert_eq!(h743.range(), 0x0800_0000..0x0820_0000);
        let text = "@Internal Flash  /0x08000000/04*016Kg,01*064Kg,03*128Kg";
        let f446 = FlashLayout::parse(text).unwrap();
        assert_eq!(f446.range(), 0x0800_0000..0x0808_0000);
        assert_eq!(f446.sectors[4], 0x0801_0000..0x0802_0000);
        for other in [
            "",
            "@Option Bytes  /0x1FFFC000/01*016 e",
            "@Flash/0x08000000/00*016Kg",
            "@Flash/0x08000000/9999*016Kg",
            "@Flash/0x08000000/01*000Kg",
            "@Flash/0xFFFFF000/04*016Kg",
            "@Flash/0x08000000/04*016Ka,01*064Kg",
            "@Flash/0x08000000/01*064Kg/0x1FFF0000/01*016Kg",
        ] {
            assert_eq!(FlashLayout::parse(other), None, "{other}");
        }
    }
}
