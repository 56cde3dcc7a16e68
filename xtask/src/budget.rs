//! `cargo xtask budget`: what the boards' images take of flash and RAM, what is left, and whether their
//! variables are where their memory maps want them.

mod image;
mod layout;
mod limits;
mod memory_map;

use std::fmt;
use std::fs;

use clap::Args;
use serde::Serialize;

use self::image::{Image, Segment};
use self::limits::{BOARDS, FLASH, Limits, STACK};
use self::memory_map::Region;
use crate::benchmark::emulator;
use crate::command::{cargo_with, root, run};
use crate::failure::Failure;
use crate::verify::{self, BOARD_TARGET};

/// Its options.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct BudgetOptions {
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl BudgetOptions {
    /// As a table.
    pub(crate) const TABLE: Self = Self { json: false };
}

/// What cargo is told for each of a board's ports: USB, UART.
pub(crate) const PORTS: [&[&str]; 2] = [&["--no-default-features"], &["--features=uart"]];

/// The boards' packages.
pub(crate) fn packages() -> impl Iterator<Item = &'static str> {
    BOARDS.iter().map(|limits| limits.package)
}

/// What all boards take; the object of `--json`.
#[derive(Debug, Serialize)]
struct Budget {
    boards: Vec<BoardBudget>,
    faults: Vec<String>,
}

#[derive(Debug, Serialize)]
struct BoardBudget {
    board: &'static str,
    regions: Vec<RegionBudget>,
}

/// Bytes of a region. Of one without a limit nothing is known but its size: the linker puts nothing there.
#[derive(Debug, Serialize)]
struct RegionBudget {
    region: String,
    length: u64,
    used: Option<u64>,
    left: Option<u64>,
    limit: Option<u64>,
}

/// Builds the boards' images, and holds them against their limits.
///
/// # Errors
/// An image does not build, is none, or takes more than its limit.
pub(crate) fn budget(options: BudgetOptions) -> Result<(), Failure> {
    verify::board_target()?;
    let mut budget = Budget {
        boards: Vec::new(),
        faults: Vec::new(),
    };
    for limits in &BOARDS {
        let script = root().join(limits.memory_map);
        let script = fs::read_to_string(&script).map_err(|error| Failure::Check {
            what: format!("reading {}", script.display()),
            why: error.to_string(),
            next: "`git status`".to_owned(),
        })?;
        let regions = memory_map::regions(&script);
        for port in PORTS {
            let faults = layout::faults(&build(limits, port)?, &regions);
            let named = |fault| format!("{} with {}: {fault}", limits.name, port.concat());
            budget.faults.extend(faults.into_iter().map(named));
        }
        // The default port comes last: its image is the one that stays.
        let (board, faults) = judge(limits, &build(limits, &[])?, &regions);
        budget.boards.push(board);
        budget.faults.extend(faults);
    }
    if options.json {
        let json = serde_json::to_string(&budget);
        println!(
            "{}",
            json.unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
        );
    } else {
        print!("{budget}");
    }
    if budget.faults.is_empty() {
        return Ok(());
    }
    Err(Failure::Check {
        what: "the budget".to_owned(),
        why: budget.faults.join("; "),
        next: "find what has grown with `nm --size-sort`, or argue for a limit in \
               xtask/src/budget/limits.rs"
            .to_owned(),
    })
}

/// A board's image with a port. One after the other: one chip's features must not be another's.
fn build(limits: &Limits, port: &[&str]) -> Result<Image, Failure> {
    let target = format!("--target={BOARD_TARGET}");
    let package = format!("--package={}", limits.package);
    let mut cargo = cargo_with(&["build", "--profile=firmware", &target, &package]);
    run(cargo.args(port), "read the compiler's message above")?;
    let path = emulator::target_folder()?
        .join(BOARD_TARGET)
        .join("firmware")
        .join(limits.package);
    Image::read(&path)
}

/// An image's figures, and what is wrong with them.
fn judge(limits: &Limits, image: &Image, regions: &[Region]) -> (BoardBudget, Vec<String>) {
    let mut faults = Vec::new();
    let name = limits.name;
    let place = |wanted: &str| regions.iter().find(|region| region.name == wanted);
    match (place(FLASH), place(STACK)) {
        (Some(flash), Some(stack)) => {
            let fault = image.fault(flash.origin, stack.end());
            faults.extend(fault.map(|fault| format!("{name}: {fault}")));
            if stack.length < limits.stack {
                let (has, least) = (stack.length, limits.stack);
                faults.push(format!("{name}: a stack of {has} bytes, {least} at least"));
            }
        }
        _ => faults.push(format!(
            "{name}: no {FLASH} or no {STACK} in its memory map"
        )),
    }
    let mut budget = Vec::new();
    for region in regions {
        let limit = limits.regions.iter().find(|(name, _)| *name == region.name);
        let limit = limit.map(|(_, bytes)| *bytes);
        let used = used(region, &image.segments);
        let (bytes, region_name) = (limit.unwrap_or(0), &region.name);
        if used > bytes {
            faults.push(format!(
                "{name}: {used} bytes of {region_name}, the limit is {bytes}"
            ));
        }
        budget.push(RegionBudget {
            region: region.name.clone(),
            length: region.length,
            used: limit.map(|_| used),
            left: limit.map(|_| region.length.saturating_sub(used)),
            limit,
        });
    }
    for (wanted, _) in limits.regions {
        if place(wanted).is_none() {
            faults.push(format!("{name}: no region {wanted} in its memory map"));
        }
    }
    let board = BoardBudget {
        board: name,
        regions: budget,
    };
    (board, faults)
}

/// What is flashed into a region, or lies there when the program runs.
fn used(region: &Region, segments: &[Segment]) -> u64 {
    let flashed = segments.iter().filter(|segment| segment.file_size > 0);
    let flashed = flashed.map(|segment| (segment.load_address, segment.file_size));
    let running = segments
        .iter()
        .map(|segment| (segment.address, segment.memory_size));
    region.used(flashed.chain(running))
}

impl fmt::Display for Budget {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cell = |bytes: Option<u64>| bytes.map_or("-".to_owned(), |bytes| bytes.to_string());
        writeln!(
            formatter,
            "{:<16} {:<6} {:>9} {:>9} {:>9} {:>9}   bytes",
            "board", "region", "used", "left", "of", "limit"
        )?;
        for board in &self.boards {
            for region in &board.regions {
                writeln!(
                    formatter,
                    "{:<16} {:<6} {:>9} {:>9} {:>9} {:>9}",
                    board.board,
                    region.region,
                    cell(region.used),
                    cell(region.left),
                    region.length,
                    cell(region.limit)
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        package: "board",
        name: "BOARD",
        memory_map: "",
        regions: &[(FLASH, 300), ("RAM", 50)],
        stack: 100,
    };

    fn regions() -> Vec<Region> {
        memory_map::regions(
            "FLASH : ORIGIN = 0x1000, LENGTH = 512\nSTACK : ORIGIN = 0x2000, LENGTH = 100\n\
             RAM : ORIGIN = 0x3000, LENGTH = 64\nKEPT : ORIGIN = 0x4000, LENGTH = 8",
        )
    }

    /// Code with the vector table, then a variable that is flashed and lies elsewhere.
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
        Image {
            segments: vec![code, variables],
            sections: Vec::new(),
            symbols: Vec::new(),
        }
    }

    #[test]
    fn what_variables_start_with_takes_flash_and_ram() {
        let (board, faults) = judge(&LIMITS, &image(200, 48), &regions());
        assert_eq!(faults, [""; 0]);
        let used: Vec<_> = board.regions.iter().map(|region| region.used).collect();
        assert_eq!(used, [Some(216), None, Some(48), None]);
        assert_eq!(board.regions[2].left, Some(16));
    }

    #[test]
    fn each_limit_that_is_passed_is_named() {
        let faults = |code, variables, regions: &[Region]| {
            judge(&LIMITS, &image(code, variables), regions)
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
