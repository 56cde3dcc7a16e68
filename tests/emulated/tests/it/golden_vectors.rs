//! Test of the image `on-target`: the emulated microcontrollers check the golden vectors
//! themselves, and print the number of instructions that each vector takes.
//!
//! `cargo xtask hil --board` runs the same image on a real board.

use std::time::Duration;

use emulated::board::{machines, or_panic};
use emulator::{Image, Qemu, Uart};
use on_target::results;

const TEST: &str = "golden vectors on emulated microcontrollers";

/// Name of the package of the image, and of the program in that package.
const IMAGE: &str = "on-target";

/// Duration of an instruction in virtual time, as a power of two: 2^10 ns, which is 25.6 ticks of
/// the image's 25 MHz clock.
const INSTRUCTION_SHIFT: u8 = 10;
const TICKS_OF_10_INSTRUCTIONS: u64 = 256;

/// Time limit for QEMU to start, and for the result of each vector, enough on a busy PC.
const SILENCE: Duration = Duration::from_mins(1);

#[test]
fn every_golden_vector_passes() {
    for machine in machines(TEST) {
        let image = or_panic(Image::build(IMAGE, IMAGE, machine.features));
        let folder = or_panic(image.create_folder("emulated"));
        let mut qemu = Qemu::new(&image, machine, &folder, &[IMAGE]);
        qemu.instruction_time(INSTRUCTION_SHIFT).uart(Uart::None);
        let instructions = |ticks| ticks * 10 / TICKS_OF_10_INSTRUCTIONS;
        let lines = qemu.run(SILENCE, |line| {
            let line = results::readable(line, "instructions", instructions);
            println!("  {line}");
        });
        assert_eq!(results::check(&or_panic(lines)), Ok(()));
    }
}
