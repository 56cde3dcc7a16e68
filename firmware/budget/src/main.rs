//! `cargo xtask budget`: how much flash and RAM the boards' images take, how much is left, and
//! whether variables are where the memory maps place them.
//!
//! ```text
//! NAME.elf ── Image ──┬─ layout::faults (all images of a board) ───┬─ table or JSON, exit status
//! *.x ── memory_map ──┴─ measure, limits (the first image) ─────────┘
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod image;
mod layout;
mod limits;
mod memory_map;

use std::env;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;
use serde_json::json;

use crate::image::{Image, Segment};
use crate::limits::{BOARDS, Limits};
use crate::memory_map::Region;

/// A board and the figures of its image.
#[derive(Debug, Serialize)]
struct Board {
    board: &'static str,
    regions: Vec<Row>,
}

/// Figures of one memory region, bytes. In a region without a limit the image must take no memory,
/// and all fields but `length` are `None`.
#[derive(Debug, Serialize)]
struct Row {
    region: String,
    length: u64,
    used: Option<u64>,
    left: Option<u64>,
    limit: Option<u64>,
}

fn main() -> ExitCode {
    let mut words: Vec<String> = env::args().skip(1).collect();
    let mut option = |name: &str| {
        let before = words.len();
        words.retain(|word| word != name);
        words.len() < before
    };
    let (json, default_images) = (option("--json"), option("--default-images"));
    let [folder] = &words[..] else {
        new_file::message!(
            "usage: budget FOLDER_OF_IMAGES [--json] [--default-images]; `cargo xtask budget` builds the images, \
             `--default-images` leaves out all others than those that boards have by default"
        );
        return ExitCode::from(2);
    };
    let error = match budget(Path::new(folder), json, default_images) {
        Ok(faults) if faults.is_empty() => return ExitCode::SUCCESS,
        Ok(faults) => format!(
            "the budget failed: {}\n  next: find what has grown with `nm --size-sort`, or argue for a limit in \
             firmware/budget/src/limits.rs",
            faults.join("; ")
        ),
        Err(error) => error,
    };
    new_file::message!("\nerror: {error}");
    ExitCode::FAILURE
}

/// Prints the memory use of every board's first image as a table, or as one JSON object if
/// `json` is true. Returns one sentence for each fault of any image in `folder`. If
/// `default_images` is true, prints and checks only the default images.
fn budget(folder: &Path, json: bool, default_images: bool) -> Result<Vec<String>, String> {
    let (mut boards, mut faults) = (Vec::new(), Vec::new());
    let wanted = |limits: &&Limits| limits.is_default || !default_images;
    for limits in BOARDS.iter().filter(wanted) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let map = read(&root.join(limits.memory_map))?;
        let regions = memory_map::regions(&String::from_utf8_lossy(&map));
        let count = if default_images { 1 } else { limits.images.len() };
        for name in limits.images.iter().copied().take(count) {
            let path = folder.join(name).with_extension("elf");
            let image = Image::parse(&read(&path)?).ok_or_else(|| {
                format!("{} is no 32-bit ELF file for ARM\n  {NEXT}", path.display())
            })?;
            let misplaced = layout::faults(&image, &regions).into_iter();
            faults.extend(misplaced.map(|fault| format!("{name}: {fault}")));
            if name == limits.images[0] {
                let (regions, above) = measure(limits, &image.segments, &regions);
                let board = limits.name;
                faults.extend(above.into_iter().map(|fault| format!("{board}: {fault}")));
                boards.push(Board { board, regions });
            }
        }
    }
    let object = json!({"boards": boards, "faults": faults});
    // `cargo xtask test` sets this variable, and compares the object with docs/figures.md.
    if let Some(file) = env::var_os("CORTICODE_OBJECT") {
        let written = fs::write(&file, object.to_string());
        written.map_err(|error| format!("writing {} failed: {error}", file.display()))?;
    }
    if json {
        new_file::print(format_args!("{object}\n"))
    } else {
        new_file::print(table(&boards))
    }
    .map_err(|error| error.to_string())?;
    Ok(faults)
}

/// Advice to the user about an image that cannot be read.
const NEXT: &str = "next: remove the image and build it again; RUSTFLAGS must not be set";

fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("reading {} failed: {error}\n  {NEXT}", path.display()))
}

/// Returns the figures of all regions for an image of these `segments`, and one sentence for each
/// exceeded limit.
fn measure(limits: &Limits, segments: &[Segment], regions: &[Region]) -> (Vec<Row>, Vec<String>) {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for region in regions {
        let Region { name, length, .. } = region;
        let limit = limits.regions.iter().find(|(limited, _)| limited == name);
        let limit = limit.map(|(_, bytes)| *bytes);
        let (used, most) = (used(region, segments), limit.unwrap_or(0));
        if used > most {
            faults.push(format!("{used} bytes of {name}, the limit is {most}"));
        }
        if name == "STACK" && *length < limits.stack {
            faults.push(format!("a stack of {length} bytes, {} at least", limits.stack));
        }
        rows.push(Row {
            region: name.clone(),
            length: *length,
            used: limit.and(Some(used)),
            left: limit.and(Some(length.saturating_sub(used))),
            limit,
        });
    }
    for (wanted, _) in limits.regions {
        if !regions.iter().any(|region| region.name == *wanted) {
            faults.push(format!("no region {wanted} in its memory map"));
        }
    }
    (rows, faults)
}

/// Returns the number of bytes from a region's start to the end of the last segment in the region.
/// A segment counts both at its address in flash and at its address while the program runs.
fn used(region: &Region, segments: &[Segment]) -> u64 {
    let flashed = segments.iter().map(|one| (one.load_address, one.file_size));
    let running = segments.iter().map(|one| (one.address, one.memory_size));
    let places = flashed.filter(|(_, size)| *size > 0).chain(running);
    let inside = places.filter(|(at, _)| (region.origin..region.end()).contains(at));
    let ends = inside.map(|(at, size)| at + size - region.origin);
    ends.max().unwrap_or(0)
}

fn table(boards: &[Board]) -> String {
    let line = |[board, region, used, left, length, limit]: [&str; 6]| {
        format!("{board:<26} {region:<6} {used:>9} {left:>9} {length:>9} {limit:>9}\n")
    };
    let mut table = line(["board", "region", "used", "left", "of", "limit"]);
    for Board { board, regions } in boards {
        for row in regions {
            let bytes = [row.used, row.left, Some(row.length), row.limit];
            let bytes = bytes.map(|bytes| bytes.map_or("-".to_owned(), |bytes| bytes.to_string()));
            let [used, left, length, limit] = &bytes;
            table += &line([board, &row.region, used, left, length, limit]);
        }
    }
    table + "bytes\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        name: "",
        images: &["", ""],
        is_default: true,
        memory_map: "",
        regions: &[("FLASH", 300), ("RAM", 50)],
        stack: 100,
    };

    /// Measures an image with `code` bytes of instructions and `variables` bytes of variables,
    /// whose 16 bytes of initial values follow the instructions in flash after a gap of 4 bytes.
    fn measured(code: u64, variables: u64, map: &str) -> (Vec<Row>, String) {
        let code =
            Segment { address: 0x1000, load_address: 0x1000, file_size: code, memory_size: code };
        let variables = Segment {
            address: 0x3000,
            load_address: 0x1000 + code.file_size + 4,
            file_size: 16,
            memory_size: variables,
        };
        let (rows, faults) = measure(&LIMITS, &[code, variables], &memory_map::regions(map));
        (rows, faults.join("; "))
    }

    const MAP: &str = "FLASH : ORIGIN = 0x1000, LENGTH = 512\nSTACK : ORIGIN = 0x2000, LENGTH = 100\n\
                       RAM : ORIGIN = 0x3000, LENGTH = 64\nKEPT : ORIGIN = 0x4000, LENGTH = 8";

    #[test]
    fn initial_values_of_variables_take_flash_and_ram_and_so_does_a_gap_before_them() {
        let (rows, faults) = measured(200, 48, MAP);
        assert_eq!(faults, "");
        let used: Vec<_> = rows.iter().map(|row| row.used).collect();
        assert_eq!(used, [Some(220), None, Some(48), None]);
        assert_eq!(rows[2].left, Some(16));
    }

    #[test]
    fn each_limit_that_is_passed_is_named() {
        let small_stack = MAP.replace("LENGTH = 100", "LENGTH = 50");
        let no_ram = MAP.replace("RAM", "OTHER");
        let kept_in_ram = MAP.replace("0x4000", "0x3000");
        for (code, variables, map, fault) in [
            (400, 48, MAP, "420 bytes of FLASH, the limit is 300"),
            (200, 51, MAP, "51 bytes of RAM, the limit is 50"),
            (200, 48, &small_stack, "a stack of 50 bytes, 100 at least"),
            (200, 48, &no_ram, "no region RAM"),
            (200, 48, &kept_in_ram, "48 bytes of KEPT, the limit is 0"),
        ] {
            let (_, faults) = measured(code, variables, map);
            assert!(faults.contains(fault), "{faults}");
        }
    }
}
