//! Checks that an image's variables, stack and DMA memory are where its memory map places them.

use crate::image::Image;
use crate::memory_map::Region;

/// Symbols at the start and end of the zeroed, the initialised and the uninitialised variables
/// (cortex-m-rt, link.x.in).
const RANGES: [(&str, &str); 3] =
    [("__sbss", "__ebss"), ("__sdata", "__edata"), ("__suninit", "__euninit")];

/// Sections that belong in a region of their own if the board has this region: the DMA's buffers on
/// a chip whose DMA cannot reach all RAM, and the memory for an uploaded model.
const PLACES: [(&str, &str); 2] = [(".dma", "SRAM1"), (".slot", "AXI")];

/// Returns one sentence for each symbol or section that is missing or is not where `regions`
/// requires it.
pub(crate) fn faults(image: &Image, regions: &[Region]) -> Vec<String> {
    let place = |wanted: &str| regions.iter().find(|region| region.name == wanted);
    let mut faults = Vec::new();
    for (start, end) in RANGES {
        let (first, last) = (image.symbols.get(start), image.symbols.get(end));
        let (Some(first), Some(last), Some(ram)) = (first, last, place("RAM")) else {
            faults.push(format!("no {start}, no {end} or no RAM"));
            continue;
        };
        if !(ram.origin <= *first && first <= last && *last <= ram.end()) {
            let (ram_start, ram_end) = (ram.origin, ram.end());
            faults.push(format!(
                "{start} {first:#010x} to {end} {last:#010x} is not in RAM, {ram_start:#010x} to {ram_end:#010x}: \
                 is a section between .bss and .uninit placed elsewhere?"
            ));
        }
    }
    let hex =
        |address: Option<u64>| address.map_or("missing".to_owned(), |at| format!("{at:#010x}"));
    for (symbol, wanted) in [
        ("_stack_start", place("STACK").map(Region::end)),
        ("_stack_end", place("STACK").map(|stack| stack.origin)),
        ("_kept", place("KEPT").map(|kept| kept.origin)),
    ] {
        let found = image.symbols.get(symbol).copied();
        if found.is_none() || found != wanted {
            let (found, wanted) = (hex(found), hex(wanted));
            faults.push(format!("{symbol} is {found}, {wanted} by the map"));
        }
    }
    for (name, address, size) in &image.sections {
        let holds = |region: &&Region| *address >= region.origin && address + size <= region.end();
        let Some(region) = regions.iter().find(holds).map(|region| &region.name[..]) else {
            faults.push(format!("{name}, {size} bytes at {address:#010x}, is in no region"));
            continue;
        };
        let is_misplaced = |(section, own)| (name == section) != (region == own);
        if PLACES.into_iter().any(is_misplaced) || ["KEPT", "STACK"].contains(&region) {
            faults.push(format!("{name} is in {region}"));
        }
    }
    for (section, region) in PLACES {
        if place(region).is_some() && !image.sections.iter().any(|(name, ..)| name == section) {
            faults.push(format!("no {section} in {region}"));
        }
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory_map;

    fn regions() -> Vec<Region> {
        memory_map::regions(
            "FLASH : ORIGIN = 0x1000, LENGTH = 512\nSTACK : ORIGIN = 0x2000, LENGTH = 256\n\
             RAM : ORIGIN = 0x3000, LENGTH = 64\nKEPT : ORIGIN = 0x4000, LENGTH = 8\n\
             SRAM1 : ORIGIN = 0x5000, LENGTH = 64",
        )
    }

    /// Returns an image whose symbols and sections are where [`regions`] requires them.
    fn image() -> Image {
        let sections = [
            (".text", 0x1000, 100),
            (".data", 0x3000, 8),
            (".bss", 0x3008, 16),
            (".uninit", 0x3018, 4),
            (".dma", 0x5000, 32),
        ];
        let symbols = [
            ("__sdata", 0x3000),
            ("__edata", 0x3008),
            ("__sbss", 0x3008),
            ("__ebss", 0x3018),
            ("__suninit", 0x3018),
            ("__euninit", 0x301c),
            ("_stack_start", 0x2100),
            ("_stack_end", 0x2000),
            ("_kept", 0x4000),
        ];
        Image {
            segments: Vec::new(),
            sections: sections.map(|(name, at, size)| (name.to_owned(), at, size)).into(),
            symbols: symbols.map(|(name, at)| (name.to_owned(), at)).into(),
        }
    }

    #[test]
    fn a_sound_image_has_no_fault() {
        assert_eq!(faults(&image(), &regions()), [""; 0]);
    }

    #[test]
    fn a_section_or_symbol_in_the_wrong_place_is_named() {
        for (name, address, fault) in [
            // As if a section .dma had been linked into .bss: the start-up code, which zeroes
            // everything up to `__ebss`, would zero the section too.
            ("__ebss", 0x5020, "__ebss 0x00005020 is not in RAM"),
            ("__ebss", 0x3000, "__sbss 0x00003008"),
            ("__edata", 0x3041, "__edata"),
            ("__euninit", 0x5000, "__euninit"),
            ("__sdata", 0x2ff8, "__sdata"),
            ("_stack_start", 0x20f8, "_stack_start is 0x000020f8"),
            ("_stack_end", 0x2004, "_stack_end"),
            ("_kept", 0x3000, "_kept is 0x00003000, 0x00004000 by the map"),
            (".dma", 0x3018, ".dma is in RAM"),
            (".bss", 0x5020, ".bss is in SRAM1"),
            (".uninit", 0x4000, ".uninit is in KEPT"),
            (".bss", 0x3038, ".bss, 16 bytes at 0x00003038, is in no region"),
        ] {
            let mut image = image();
            let places = image.sections.iter_mut().map(|(name, at, _)| (&*name, at));
            let (_, place) = places
                .chain(&mut image.symbols)
                .find(|(other, _)| *other == name)
                .expect("a section or symbol");
            *place = address;
            let faults = faults(&image, &regions()).join("; ");
            assert!(faults.contains(fault), "{name}: {faults}");
        }
    }

    #[test]
    fn a_section_or_symbol_that_is_not_there_is_named() {
        let mut image = image();
        image.symbols.remove("_kept");
        image.sections.retain(|(name, ..)| name != ".dma");
        let expected = ["_kept is missing, 0x00004000 by the map", "no .dma in SRAM1"];
        assert_eq!(faults(&image, &regions()), expected);
    }
}
