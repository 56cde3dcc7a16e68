//! `cargo xtask bench encoder`: instructions of each step, and whether the codes are the PC's.

mod counts;
mod cycles;
mod disassembly;
mod elsewhere;
mod inputs;
mod panics;
mod part;
mod report;

use pipeline::{CodeValues, Encoder, Step};

use self::counts::Counts;
use self::cycles::Loops;
use self::inputs::Inputs;
use self::report::Report;
use super::elf;
use super::emulator::{Image, MACHINES};
use crate::failure::Failure;

/// Lines that an image says beside those of its inputs: memory, acquisition, kernels.
const OTHER_LINES: usize = 8;

/// Runs at least so many windows through the encoder on each machine.
///
/// # Errors
/// QEMU or the target is missing, an image does not build or run, or an input cannot be had.
pub(crate) fn measure(windows: usize) -> Result<Report, Failure> {
    let inputs = Inputs::make(windows)?;
    for skipped in &inputs.skipped {
        eprintln!("SKIPPED: {skipped}");
    }
    let mut expected = codes(&inputs);
    // One more block of 128 bytes: kernels with weights and shapes that no model has.
    expected.extend(bench::any_network::digests());
    let lines = inputs.names.len() * model::HOP + OTHER_LINES;
    let progress = super::progress_bar(MACHINES.len() * lines);
    let mut counts = Vec::new();
    let mut loops = Vec::new();
    let mut flash_bytes = 0;
    for machine in MACHINES {
        // Each processor has kernels of its own; cargo puts both images in one place.
        let bare = Image::build("bench", "size", machine.features)?;
        flash_bytes = elf::flash_bytes(bare.path())?.max(flash_bytes);
        let tasks = Image::build("bench", "tasks", machine.features)?;
        panics::check(tasks.path())?;
        let image = Image::build("bench", "encoder", machine.features)?;
        loops.push(Loops::of(machine, &image));
        let folder = image.target_folder().join("bench").join("encoder");
        let work = folder.join(machine.name);
        let (said, came_out) = super::run(&image, machine, &work, &inputs.bytes(), &progress)?;
        counts.push(Counts::new(
            machine,
            &said,
            inputs.names.len(),
            &expected,
            &came_out,
        )?);
    }
    progress.finish_and_clear();
    for skipped in loops.iter().flat_map(|loops| &loops.skipped) {
        eprintln!("SKIPPED: {skipped}");
    }
    Ok(Report::new(&inputs, &counts, &loops, flash_bytes))
}

/// The codes that this PC makes of the inputs, each from an encoder that has seen nothing.
fn codes(inputs: &Inputs) -> Vec<u8> {
    let mut codes = Vec::new();
    for planes in &inputs.planes {
        let mut encoder = Encoder::new();
        for &plane in planes {
            let step = Step {
                plane,
                ..Step::default()
            };
            if let Some(code) = encoder.encode_step(&step) {
                codes.extend(code.values.to_bytes(&mut [0; CodeValues::MAX_BYTES]));
            }
        }
    }
    codes
}
