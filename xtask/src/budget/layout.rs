//! Whether an image's variables are where its memory map wants them.

use super::image::{Image, Named};
use super::limits::STACK;
use super::memory_map::Region;

/// Variables.
const RAM: &str = "RAM";
/// What outlives a reset.
const KEPT: &str = "KEPT";
/// What a DMA reads and writes, where it does not reach all RAM.
const DMA: (&str, &str) = (".dma", "SRAM1");

/// Symbols that the start-up's loops run between (cortex-m-rt, link.x.in).
const RANGES: [(&str, &str); 3] = [
    ("__sbss", "__ebss"),
    ("__sdata", "__edata"),
    ("__suninit", "__euninit"),
];

/// What is wrong with the places of an image.
pub(crate) fn faults(image: &Image, regions: &[Region]) -> Vec<String> {
    let mut faults = Vec::new();
    for (start, end) in RANGES {
        faults.extend(range_fault(image, regions, start, end));
    }
    let place = |wanted: &str| regions.iter().find(|region| region.name == wanted);
    let stack = place(STACK);
    let kept = place(KEPT);
    for (symbol, wanted) in [
        ("_stack_start", stack.map(Region::end)),
        ("_stack_end", stack.map(|stack| stack.origin)),
        ("_kept", kept.map(|kept| kept.origin)),
    ] {
        let found = address(image, symbol);
        if found.is_none() || found != wanted {
            faults.push(format!(
                "{symbol} is {}, {} by the map",
                hex(found),
                hex(wanted)
            ));
        }
    }
    for Named {
        name,
        address,
        size,
    } in &image.sections
    {
        let region = regions
            .iter()
            .find(|region| *address >= region.origin && address + size <= region.end());
        let Some(region) = region else {
            faults.push(format!(
                "{name}, {size} bytes at {address:#010x}, is in no region"
            ));
            continue;
        };
        let is_dma = name == DMA.0;
        if is_dma != (region.name == DMA.1) || region.name == KEPT || region.name == STACK {
            faults.push(format!("{name} is in {}", region.name));
        }
    }
    if place(DMA.1).is_some() && !image.sections.iter().any(|section| section.name == DMA.0) {
        faults.push(format!("no {} in {}", DMA.0, DMA.1));
    }
    faults
}

/// Why the variables between two symbols are not in RAM alone.
fn range_fault(image: &Image, regions: &[Region], start: &str, end: &str) -> Option<String> {
    let ends = address(image, start).zip(address(image, end));
    let Some((first, last)) = ends else {
        return Some(format!("no {start} or no {end}"));
    };
    let ram = regions.iter().find(|region| region.name == RAM)?;
    let is_inside = ram.origin <= first && first <= last && last <= ram.end();
    (!is_inside).then(|| {
        format!(
            "{start} {first:#010x} to {end} {last:#010x} is not in {RAM}, {:#010x} to {:#010x}: is a \
             section between .bss and .uninit placed elsewhere?",
            ram.origin,
            ram.end()
        )
    })
}

fn address(image: &Image, symbol: &str) -> Option<u64> {
    let mut symbols = image.symbols.iter();
    symbols
        .find(|named| named.name == symbol)
        .map(|named| named.address)
}

fn hex(address: Option<u64>) -> String {
    address.map_or_else(
        || "missing".to_owned(),
        |address| format!("{address:#010x}"),
    )
}

#[cfg(test)]
mod tests {
    use super::super::memory_map;
    use super::*;

    fn named(name: &str, address: u64, size: u64) -> Named {
        let name = name.to_owned();
        Named {
            name,
            address,
            size,
        }
    }

    fn regions() -> Vec<Region> {
        memory_map::regions(
            "FLASH : ORIGIN = 0x1000, LENGTH = 512\nSTACK : ORIGIN = 0x2000, LENGTH = 256\n\
             RAM : ORIGIN = 0x3000, LENGTH = 64\nKEPT : ORIGIN = 0x4000, LENGTH = 8\n\
             SRAM1 : ORIGIN = 0x5000, LENGTH = 64",
        )
    }

    /// A sound image of these regions.
    fn image() -> Image {
        Image {
            segments: Vec::new(),
            sections: vec![
                named(".text", 0x1000, 100),
                named(".data", 0x3000, 8),
                named(".bss", 0x3008, 16),
                named(".uninit", 0x3018, 4),
                named(".dma", 0x5000, 32),
            ],
            symbols: vec![
                named("__sdata", 0x3000, 0),
                named("__edata", 0x3008, 0),
                named("__sbss", 0x3008, 0),
                named("__ebss", 0x3018, 0),
                named("__suninit", 0x3018, 0),
                named("__euninit", 0x301c, 0),
                named("_stack_start", 0x2100, 0),
                named("_stack_end", 0x2000, 0),
                named("_kept", 0x4000, 0),
            ],
        }
    }

    /// The faults of an image with one symbol or section moved.
    fn moved(name: &str, address: u64) -> String {
        let mut image = image();
        let all = image.symbols.iter_mut().chain(&mut image.sections);
        all.filter(|named| named.name == name)
            .for_each(|named| named.address = address);
        faults(&image, &regions()).join("; ")
    }

    #[test]
    fn a_sound_image_has_no_fault() {
        assert_eq!(faults(&image(), &regions()), [""; 0]);
    }

    #[test]
    fn variables_that_end_in_another_region_are_named() {
        // .dma inserted behind .bss: the start-up would zero all between.
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
        nameless.symbols.retain(|symbol| symbol.name != "_kept");
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
