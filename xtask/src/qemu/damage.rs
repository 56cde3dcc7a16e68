//! A board with a bit of its model turned over: it says so, and starts nothing.

use std::fmt;
use std::fs;
use std::path::Path;

use link::{AckResult, Encoder, MAX_FRAME, Start, Streams, ToDevice};
use model::ADC_RATE_HZ;
use serde::Serialize;

use super::heard::Heard;
use super::input::Input;
use super::{IMAGE, PATIENCE, VIRTUAL_TIME, input, pipes};
use crate::benchmark::emulator::{Image, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// Seconds of samples; the command comes early in them.
const SECONDS: usize = 10;

/// What a board says of a damaged model in `Hello`.
const SAYS: &str = "the model in flash is damaged";

/// What became of a `Start`, on a sound image and on a damaged one.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Damage {
    /// What the damaged one says of itself.
    said: String,
    /// Codes of the sound one, and of the damaged one.
    codes: [usize; 2],
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl Damage {
    /// Runs the image as it is, and a copy with one bit of its weights turned over.
    ///
    /// # Errors
    /// The model is not found in the image, or QEMU fails.
    pub(super) fn of(
        image: &Image,
        machine: Machine,
        folder: &Path,
        input: &Input,
    ) -> Result<Self, Failure> {
        let folder = folder.join("damage");
        make_folder(&folder)?;
        let samples = folder.join(input::FILE);
        let bytes = input.bytes_of_first(SECONDS * usize::from(ADC_RATE_HZ));
        fs::write(&samples, bytes).map_err(|error| cannot_write(&samples, &error))?;
        let elf = fs::read(image.path()).map_err(|error| cannot_write(image.path(), &error))?;
        let damaged = folder.join("damaged.elf");
        let bytes = with_damage(elf).map_err(|count| Failure::Check {
            what: "looking for the model in the image".to_owned(),
            why: format!("its bias lies there {count} times"),
            next: "look at the symbols of `model` in it with `nm`".to_owned(),
        })?;
        fs::write(&damaged, bytes).map_err(|error| cannot_write(&damaged, &error))?;
        let damaged = image.copied_to(damaged);
        let mut buffer = [0; MAX_FRAME];
        let start = ToDevice::Start(Start {
            streams: Streams::CODES,
            mains_hz: 0,
        });
        let start = Encoder::starting_at(0).encode(0, &start, &mut buffer);
        let start = start.unwrap_or_default();
        let heard = |image: &Image| {
            let mut command = image.command(machine, &folder, &[IMAGE]);
            command.args(["-icount", VIRTUAL_TIME]);
            let none = std::time::Duration::ZERO;
            let sent = pipes::run_to_end(&mut command, &folder, start, PATIENCE, none)?;
            Ok(Heard::boots(&sent))
        };
        Ok(Self::new(&heard(image)?, &heard(&damaged)?))
    }

    fn new(sound: &[Heard], damaged: &[Heard]) -> Self {
        let said = |boots: &[Heard]| {
            let faults = boots[0].hellos.iter().map(|hello| hello.fault.clone());
            faults.collect::<Vec<_>>().join("; ")
        };
        let answers = |boots: &[Heard]| {
            let answers = boots[0].acks.iter().map(|ack| ack.result);
            answers.collect::<Vec<_>>()
        };
        let codes = [sound, damaged].map(|boots| boots[0].codes.len());
        let checks = [
            (
                sound.len() == 1 && damaged.len() == 1,
                "it has reset itself".to_owned(),
            ),
            (
                answers(sound) == [AckResult::Done] && codes[0] > 0 && said(sound).is_empty(),
                format!(
                    "a sound one answers {:?}, sends {} codes and says {:?}",
                    answers(sound),
                    codes[0],
                    said(sound)
                ),
            ),
            (
                answers(damaged) == [AckResult::NotSupported],
                format!("it answers {:?} to Start", answers(damaged)),
            ),
            (codes[1] == 0, format!("it sends {} codes", codes[1])),
            (
                said(damaged).contains(SAYS),
                format!("it says {:?}", said(damaged)),
            ),
        ];
        let faults = checks.into_iter().filter(|(sound, _)| !sound);
        Self {
            said: said(damaged),
            codes,
            faults: faults
                .map(|(_, what)| format!("a damaged model: {what}"))
                .collect(),
        }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [sound, damaged] = self.codes;
        write!(
            f,
            "a model with one wrong bit: {damaged} codes, where a sound one makes {sound}; it says {:?}",
            self.said
        )
    }
}

/// An image with one bit of the network's bias turned over.
///
/// # Errors
/// With how often the bias lies in it, when that is not once.
fn with_damage(mut image: Vec<u8>) -> Result<Vec<u8>, usize> {
    let bias = model::NETWORK.fc_bias.map(i32::to_le_bytes);
    let bias = bias.as_flattened();
    let places = image.windows(bias.len()).enumerate();
    let places = places.filter(|(_, bytes)| *bytes == bias);
    let places: Vec<usize> = places.map(|(place, _)| place).collect();
    let [place] = places[..] else {
        return Err(places.len());
    };
    image[place + bias.len() / 2] ^= 0x10;
    Ok(image)
}

#[cfg(test)]
mod tests {
    use link::Ack;

    use super::*;
    use crate::qemu::host;

    #[test]
    fn one_bit_of_an_image_is_turned_over_if_it_holds_the_model_once() {
        let bias = model::NETWORK.fc_bias.map(i32::to_le_bytes);
        let image = [&[7; 33], bias.as_flattened(), &[9; 5]].concat();
        let damaged = with_damage(image.clone()).expect("the model is there once");
        let bits = image
            .iter()
            .zip(&damaged)
            .map(|(a, b)| (a ^ b).count_ones());
        assert_eq!(bits.sum::<u32>(), 1);
        assert_eq!(with_damage(vec![0; 4_000]), Err(0));
        assert_eq!(with_damage([&image[..], &image].concat()), Err(2));
    }

    #[test]
    fn a_damaged_board_that_starts_or_says_nothing_is_a_fault() {
        let boots = |result, fault: &str| {
            let input = Input::make(40).expect("an input");
            let mut boots = Heard::boots(&host::sent(&input.samples).expect("host-sim"));
            boots[0].acks.push(Ack { of: 0, result });
            boots[0].hellos[0].fault = fault.to_owned();
            boots
        };
        let refused = || {
            let mut boots = boots(AckResult::NotSupported, SAYS);
            boots[0].codes.clear();
            boots
        };
        let sound = || boots(AckResult::Done, "");
        assert_eq!(Damage::new(&sound(), &refused()).faults, [""; 0]);
        assert_eq!(Damage::new(&refused(), &refused()).faults.len(), 1);
        let started = Damage::new(&sound(), &sound()).faults.join("; ");
        for what in ["[Done] to Start", "it sends 40 codes", "it says \"\""] {
            assert!(started.contains(what), "{started}");
        }
    }
}
