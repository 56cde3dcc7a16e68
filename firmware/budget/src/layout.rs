//! Checks that an image's variables, stack and DMA memory are where its memory map wants them.

use crate::image::{Image, Section};
use crate::memory_map::Region;

/// Start and end symbols of the variables that are zeroed, copied from flash, and not initialised
/// (cortex-m-rt, link.x.in).
const RANGES: [(&str, &str); 3] = [
    ("__sbss", "__ebss"),
    ("__sdata", "__edata"),
    ("__suninit", "__euninit"),
];

/// Section and region of the DMA's memory, on a board whose DMA does not reach all RAM.
const DMA: (&str, &str) = (".dma", "SRAM1");

/// Returns what is wrong with the places of an image's variables, stack and DMA memory.
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
            faults.push(format!(
                "{start} {first:#010x} to {end} {last:#010x} is not in RAM, {:#010x} to {:#010x}: is a \
                 section between .bss and .uninit placed elsewhere?",
                ram.origin,
                ram.end()
            ));
        }
    }
    let hex = |address: Option<u64>| {
        address.map_or("missing".to_owned(), |address| format!("{address:#010x}"))
    };
    for (symbol, wanted) in [
        ("_stack_start", place("STACK").map(Region::end)),
        ("_stack_end", place("STACK").map(|stack| stack.origin)),
        ("_kept", place("KEPT").map(|kept| kept.origin)),
    ] {
        let found = image.symbols.get(symbol).copied();
        if found.is_none() || found != wanted {
            faults.push(format!(
                "{symbol} is {}, {} by the map",
                hex(found),
                hex(wanted)
            ));
        }
    }
    for Section {
        name,
        address,
        size,
    } in &image.sections
    {
        let holds = |region: &&Region| *address >= region.origin && address + size <= region.end();
        match regions.iter().find(holds).map(|region| &region.name[..]) {
            None => faults.push(format!(
                "{name}, {size} bytes at {address:#010x}, is in no region"
            )),
            Some(region)
                if (name == DMA.0) != (region == DMA.1) || ["KEPT", "STACK"].contains(&region) =>
            {
                faults.push(format!("{name} is in {region}"));
            }
            Some(_) => {}
        }
    }
    if place(DMA.1).is_some() && !image.sections.iter().any(|section| section.name == DMA.0) {
        faults.push(format!("no {} in {}", DMA.0, DMA.1));
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

    /// An image without faults in the regions of this test.
    fn image() -> Image {
        let section = |(name, address, size): (&str, _, _)| {
            let name = name.to_owned();
            Section {
                name,
                address,
                size,
            }
        };
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
        let sections = [
            (".text", 0x1000, 100),
            (".data", 0x3000, 8),
            (".bss", 0x3008, 16),
            (".uninit", 0x3018, 4),
            (".dma", 0x5000, 32),
        ];
        Image {
            segments: Vec::new(),
            sections: sections.map(section).into(),
            symbols: symbols
                .map(|(name, address)| (name.to_owned(), address))
                .into(),
        }
    }

    /// Faults of an image with one symbol or section moved.
    fn moved(name: &str, address: u64) -> String {
        let mut image = image();
        let sections = image
            .sections
            .iter_mut()
            .filter(|section| section.name == name);
        sections.for_each(|section| section.address = address);
        image
            .symbols
            .entry(name.to_owned())
            .and_modify(|symbol| *symbol = address);
        faults(&image, &regions()).join("; ")
    }

    #[test]
    fn a_sound_image_has_no_fault() {
        assert_eq!(faults(&image(), &regions()), [""; 0]);
    }

    #[test]
    fn variables_that_end_in_another_region_are_named() {
        // With .dma after .bss the start-up would zero everything in between.
        assert!(moved("__ebss", 0x5020).contains("__ebss 0x00005020 is not in RAM"));
        assert!(moved("__ebss", 0x3000).contains("__sbss 0x00003008"));
        assert!(moved("__edata", 0x3041).contains("__edata"));
        assert!(moved("__euninit", 0x5000).contains("__euninit"));
        assert!(moved("__sdata", 0x2ff8).contains("__sdata"));
    }

    #[test]
    fn a_stack_and_a_kept_place_that_are_not_the_maps_are_named() {
        assert!(moved("_stack_start", 0x20f8).contains("_stack_start is 0x000020f8"));
        assert!(moved("_stack_end", 0x2004).contains("_stack_end"));
        assert!(moved("_kept", 0x3000).contains("_kept is 0x00003000, 0x00004000 by the map"));
        let mut nameless = image();
        nameless.symbols.remove("_kept");
        assert!(
            faults(&nameless, &regions())
                .join("; ")
                .contains("_kept is missing")
        );
    }

    #[test]
    fn each_section_belongs_to_one_region_and_what_the_dma_reaches_to_its_own() {
        assert!(moved(".dma", 0x3018).contains(".dma is in RAM"));
        assert!(moved(".bss", 0x5020).contains(".bss is in SRAM1"));
        assert!(moved(".uninit", 0x4000).contains(".uninit is in KEPT"));
        assert!(moved(".bss", 0x3038).contains(".bss, 16 bytes at 0x00003038, is in no region"));
        let mut without = image();
        without.sections.retain(|section| section.name != ".dma");
        assert_eq!(faults(&without, &regions()), ["no .dma in SRAM1"]);
    }
}
