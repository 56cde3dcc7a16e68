//! `cargo xtask budget`: how much flash and RAM the boards' images take, what is left, and whether their
//! variables are where their memory maps want them.
//!
//! ```text
//! NAME.elf ── Image ──┬─ layout::faults (both images of a board) ──┬─ table or JSON, exit status
//! *.x ── memory_map ──┴─ measure, limits (the default image) ──────┘
//! ```
#![forbid(unsafe_code)]

mod image;
mod layout;
mod limits;
mod memory_map;

use std::env;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use serde_json::{Value, json};

use crate::image::{Image, Segment};
use crate::limits::{BOARDS, Limits};
use crate::memory_map::Region;

fn main() -> ExitCode {
    let mut words: Vec<String> = env::args().skip(1).collect();
    let json = words.pop_if(|word| word == "--json").is_some();
    let [folder] = &words[..] else {
        eprintln!(
            "usage: budget FOLDER_OF_IMAGES [--json]; `cargo xtask budget` builds the images"
        );
        return ExitCode::from(2);
    };
    match budget(Path::new(folder)) {
        Ok((boards, faults)) => {
            let object = json!({"boards": boards, "faults": faults});
            // `cargo xtask test` compares this file with docs/figures.md.
            if let Some(file) = env::var_os("CORTICODE_OBJECT")
                && let Err(error) = fs::write(&file, object.to_string())
            {
                eprintln!("\nerror: writing {} failed: {error}", file.display());
                return ExitCode::FAILURE;
            }
            if json {
                println!("{object}");
            } else {
                print_table(&boards);
            }
            if faults.is_empty() {
                return ExitCode::SUCCESS;
            }
            eprintln!(
                "\nerror: the budget failed: {}\n  next: find what has grown with `nm --size-sort`, or argue \
                 for a limit in firmware/budget/src/limits.rs",
                faults.join("; ")
            );
        }
        Err(error) => eprintln!(
            "\nerror: {error}\n  next: remove the image and build it again; RUSTFLAGS must not be set"
        ),
    }
    ExitCode::FAILURE
}

/// Returns the figures of every board, and what is wrong with the images in a folder.
fn budget(folder: &Path) -> Result<(Vec<Value>, Vec<String>), String> {
    let read = |path: &Path| {
        fs::read(path).map_err(|error| format!("reading {} failed: {error}", path.display()))
    };
    let (mut boards, mut faults) = (Vec::new(), Vec::new());
    for limits in &BOARDS {
        let map = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../..")
            .join(limits.memory_map);
        let regions = memory_map::regions(&String::from_utf8_lossy(&read(&map)?));
        for name in limits.images {
            let path = folder.join(name).with_extension("elf");
            let image = Image::parse(&read(&path)?)
                .ok_or_else(|| format!("{} is no 32-bit ELF file for ARM", path.display()))?;
            let misplaced = layout::faults(&image, &regions).into_iter();
            faults.extend(misplaced.map(|fault| format!("{name}: {fault}")));
            if name == limits.images[0] {
                let (rows, above) = measure(limits, &image, &regions);
                boards.push(json!({"board": limits.name, "regions": rows}));
                faults.extend(above);
            }
        }
    }
    Ok((boards, faults))
}

/// Returns the figures of an image's regions, and what is wrong with them. For a region without a limit only
/// the length is returned, because the linker puts nothing there.
fn measure(limits: &Limits, image: &Image, regions: &[Region]) -> (Vec<Value>, Vec<String>) {
    let mut faults = Vec::new();
    let place = |wanted: &str| regions.iter().find(|region| region.name == wanted);
    match (place("FLASH"), place("STACK")) {
        (Some(flash), Some(stack)) => {
            faults.extend(image.fault(flash.origin, stack.end()));
            if stack.length < limits.stack {
                let (has, least) = (stack.length, limits.stack);
                faults.push(format!("a stack of {has} bytes, {least} at least"));
            }
        }
        _ => faults.push("no FLASH or no STACK in its memory map".to_owned()),
    }
    let mut rows = Vec::new();
    for region in regions {
        let Region { name, length, .. } = region;
        let limit = limits.regions.iter().find(|(limited, _)| limited == name);
        let limit = limit.map(|(_, bytes)| *bytes);
        let (used, most) = (used(region, &image.segments), limit.unwrap_or(0));
        if used > most {
            faults.push(format!("{used} bytes of {name}, the limit is {most}"));
        }
        let left = limit.map(|_| length.saturating_sub(used));
        let used = limit.map(|_| used);
        rows.push(
            json!({"region": name, "length": length, "used": used, "left": left, "limit": limit}),
        );
    }
    let missing = limits
        .regions
        .iter()
        .filter(|(wanted, _)| place(wanted).is_none());
    faults.extend(missing.map(|(wanted, _)| format!("no region {wanted} in its memory map")));
    let faults = faults
        .into_iter()
        .map(|fault| format!("{}: {fault}", limits.name));
    (rows, faults.collect())
}

/// Bytes of a region that are flashed, or taken when the program runs.
fn used(region: &Region, segments: &[Segment]) -> u64 {
    let flashed = segments.iter().filter(|segment| segment.file_size > 0);
    let flashed = flashed.map(|segment| (segment.load_address, segment.file_size));
    let running = segments
        .iter()
        .map(|segment| (segment.address, segment.memory_size));
    region.used(flashed.chain(running))
}

fn print_table(boards: &[Value]) {
    let print = |[board, region, used, left, length, limit]: [&str; 6]| {
        println!("{board:<16} {region:<6} {used:>9} {left:>9} {length:>9} {limit:>9}");
    };
    print(["board", "region", "used", "left", "of", "limit"]);
    for board in boards {
        for row in board["regions"].as_array().into_iter().flatten() {
            let cells = [
                &board["board"],
                &row["region"],
                &row["used"],
                &row["left"],
                &row["length"],
                &row["limit"],
            ]
            .map(|cell| {
                cell.as_str()
                    .map_or_else(|| cell.to_string(), str::to_owned)
            });
            print(
                cells
                    .each_ref()
                    .map(|cell| if cell == "null" { "-" } else { cell }),
            );
        }
    }
    println!("bytes");
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        name: "BOARD",
        images: ["", ""],
        memory_map: "",
        regions: &[("FLASH", 300), ("RAM", 50)],
        stack: 100,
    };

    fn regions() -> Vec<Region> {
        memory_map::regions(
            "FLASH : ORIGIN = 0x1000, LENGTH = 512\nSTACK : ORIGIN = 0x2000, LENGTH = 100\n\
             RAM : ORIGIN = 0x3000, LENGTH = 64\nKEPT : ORIGIN = 0x4000, LENGTH = 8",
        )
    }

    /// Code with the vector table, then a variable whose initial value is in flash.
    fn image(code: u64, variables: u64) -> Image {
        let code = Segment {
            address: 0x1000,
            load_address: 0x1000,
            file_size: code,
            memory_size: code,
            executed: true,
            first_words: [0x2064, 0x1009],
        };
        let variables = Segment {
            address: 0x3000,
            load_address: 0x1000 + code.file_size,
            file_size: 16,
            memory_size: variables,
            executed: false,
            ..code
        };
        let segments = vec![code, variables];
        Image {
            segments,
            sections: Vec::new(),
            symbols: [].into(),
        }
    }

    #[test]
    fn initial_values_of_variables_take_flash_and_ram() {
        let (rows, faults) = measure(&LIMITS, &image(200, 48), &regions());
        assert_eq!(faults, [""; 0]);
        let used: Vec<_> = rows.iter().map(|row| row["used"].as_u64()).collect();
        assert_eq!(used, [Some(216), None, Some(48), None]);
        assert_eq!(rows[2]["left"], 16);
    }

    #[test]
    fn each_limit_that_is_passed_is_named() {
        let faults = |code, variables, regions: &[Region]| {
            measure(&LIMITS, &image(code, variables), regions)
                .1
                .join("; ")
        };
        assert!(faults(400, 48, &regions()).contains("416 bytes of FLASH, the limit is 300"));
        assert!(faults(200, 51, &regions()).contains("51 bytes of RAM, the limit is 50"));
        let mut small = regions();
        small[1].origin += 50;
        small[1].length -= 50;
        assert!(faults(200, 48, &small).contains("a stack of 50 bytes, 100 at least"));
        assert!(faults(200, 48, &regions()[..2]).contains("no region RAM"));
        let mut kept = regions();
        kept[3].origin = 0x3000;
        assert!(faults(200, 48, &kept).contains("48 bytes of KEPT, the limit is 0"));
    }
}
