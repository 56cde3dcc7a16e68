//! Checks that the device answers, has no fault, and has a model that the bridge can decode.

use artifact::ModelId;
use bridge_core::{Device, DeviceError, DeviceSummary, Identity, Model};
use link::{Decoder, Encoder, MAX_FRAME, ToDevice, ToHost};

use crate::doctor::Check;

const DEVICE: &str = "device";

/// Checks the answer of the device at `port`. `model` is the model with which the bridge decodes,
/// or the reason why it cannot be read.
pub(crate) fn check_device(
    answer: &DeviceAnswer,
    port: &str,
    model: &Result<Model, String>,
) -> Vec<Check> {
    let device = match answer {
        DeviceAnswer::Identified(device) => device,
        other => return vec![check_answer(other, port)],
    };
    let summary = &device.summary;
    let version = link::VERSION;
    let mut checks = vec![Check::ok(
        DEVICE,
        format!(
            "{}, firmware {}, uid {}, wire format {version}",
            summary.board, summary.firmware, summary.uid
        ),
    )];
    checks.push(if summary.fault.is_empty() {
        Check::ok("fault", "the device reports none")
    } else {
        Check::warning(
            "fault",
            format!("the device reports: {}", summary.fault),
            format!(
                "corticode-bridge selftest --port {port}, then corticode-bridge reset --port {port}"
            ),
        )
    });
    checks.push(check_model(device, model));
    checks
}

fn check_answer(answer: &DeviceAnswer, port: &str) -> Check {
    match answer {
        DeviceAnswer::NotAsked => Check::unknown(
            DEVICE,
            "not asked, because the port cannot be opened",
            "the remedies above, then corticode-bridge doctor again",
        ),
        DeviceAnswer::NotOpen { why, remedy } => Check::error(DEVICE, why, remedy),
        DeviceAnswer::Lost { why } => Check::error(
            DEVICE,
            format!("{port} opens and closes again: {why}"),
            "end the other program that uses the device, or start the device again",
        ),
        DeviceAnswer::Silent => Check::error(
            DEVICE,
            "the port is open, and nothing answers",
            "check power and cable, press the board's reset button; a board on a UART answers at the \
             baud rate of its firmware: --baud",
        ),
        DeviceAnswer::Stranger { bytes } => Check::error(
            DEVICE,
            format!("nothing here speaks Corticode: {bytes} bytes and no frame"),
            "corticode-bridge ports lists the boards; a board on a UART needs the baud rate of its \
             firmware: --baud",
        ),
        DeviceAnswer::OtherVersion => Check::error(
            DEVICE,
            format!(
                "the device speaks another version of the wire format than this bridge ({})",
                link::VERSION
            ),
            "cargo flash, from the release of this bridge",
        ),
        DeviceAnswer::NoHello | DeviceAnswer::Identified(_) => Check::error(
            DEVICE,
            "the device sends frames and does not introduce itself",
            format!("corticode-bridge reset --port {port}"),
        ),
    }
}

fn check_model(device: &IdentifiedDevice, model: &Result<Model, String>) -> Check {
    const NAME: &str = "model";
    let id = ModelId(device.model_id);
    let model = match model {
        Ok(model) => model,
        Err(why) => {
            let remedy = "name the folder with model.toml, weights.safetensors and \
                          calibration.safetensors: --model FOLDER";
            return Check::error(NAME, why, remedy);
        }
    };
    if device.model_id != model.id() {
        let own = ModelId(model.id());
        return Check::warning(
            NAME,
            format!(
                "the device runs {id} and the bridge decodes {own}: no /neurodata_reconstructed"
            ),
            "corticode-bridge --model FOLDER, with the folder that the firmware was built with",
        );
    }
    let flash = "cargo flash, from the release of this bridge";
    match &device.device {
        None => Check::warning(NAME, "the device sends no description of its codes", flash),
        Some(Err(error)) => Check::error(NAME, error.to_string(), flash),
        Some(Ok(device)) if model.objection(device).is_some() => Check::warning(
            NAME,
            format!(
                "the device reports {id} with another montage or window: no /neurodata_reconstructed"
            ),
            flash,
        ),
        Some(Ok(_)) => Check::ok(NAME, format!("{id}, which the bridge decodes")),
    }
}

/// Outcome of asking the device at a port to `Identify`.
#[derive(Clone, Debug)]
pub(crate) enum DeviceAnswer {
    /// The port was not opened, because an earlier check found an error.
    NotAsked,
    /// The port cannot be opened, with the reason and the remedy.
    NotOpen { why: String, remedy: String },
    /// The connection broke before the device introduced itself.
    Lost { why: String },
    /// The device sent nothing.
    Silent,
    /// The port sent this number of bytes, but no frame.
    Stranger { bytes: u64 },
    /// The device sent only frames of another version of the wire format.
    OtherVersion,
    /// The device sent frames, but no `Hello` among them.
    NoHello,
    /// The device introduced itself.
    Identified(Box<IdentifiedDevice>),
}

/// A device that has introduced itself.
#[derive(Clone, Debug)]
pub(crate) struct IdentifiedDevice {
    pub(crate) summary: DeviceSummary,
    pub(crate) model_id: [u8; 8],
    /// Properties of the device, or why it cannot be used; `None` if it sent no `Capabilities`.
    pub(crate) device: Option<Result<Device, DeviceError>>,
}

/// Asks a device to identify itself, and collects the answer.
#[derive(Debug)]
pub(crate) struct Probe {
    decoder: Decoder<MAX_FRAME>,
    encoder: Encoder,
    identity: Option<Identity>,
    device: Option<Result<Device, DeviceError>>,
}

impl Probe {
    pub(crate) fn new() -> Probe {
        Probe { decoder: Decoder::new(), encoder: Encoder::default(), identity: None, device: None }
    }

    /// Returns the bytes of the next `Identify` frame.
    pub(crate) fn identify(&mut self) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        let frame = self.encoder.encode(0, &ToDevice::Identify, &mut buffer);
        frame.map(<[u8]>::to_vec).unwrap_or_default()
    }

    /// Handles bytes from the device. Returns whether `Hello` and `Capabilities` have been
    /// received.
    pub(crate) fn receive(&mut self, mut bytes: &[u8]) -> bool {
        while let Some(frame) = self.decoder.next::<ToHost>(&mut bytes) {
            let Ok(frame) = frame else { continue };
            match &frame.message {
                ToHost::Hello(hello) => self.identity = Some(Identity::new(hello)),
                ToHost::Capabilities(capabilities) => {
                    if let Some(identity) = &self.identity {
                        self.device = Some(Device::new(&identity.as_hello(), capabilities));
                    }
                }
                _ => {}
            }
        }
        self.device.is_some()
    }

    /// Returns what the device has answered so far.
    pub(crate) fn answer(self) -> DeviceAnswer {
        let counters = self.decoder.counters();
        match self.identity {
            Some(identity) => {
                let hello = identity.as_hello();
                DeviceAnswer::Identified(Box::new(IdentifiedDevice {
                    summary: DeviceSummary::new(&hello),
                    model_id: hello.model_id,
                    device: self.device,
                }))
            }
            None if counters.bytes == 0 => DeviceAnswer::Silent,
            None if counters.frames > 0 => DeviceAnswer::NoHello,
            None if counters.version > 0 => DeviceAnswer::OtherVersion,
            None => DeviceAnswer::Stranger { bytes: counters.bytes },
        }
    }
}

#[cfg(test)]
mod tests {
    use bridge_core::{DeviceSummary, Model};

    use super::{DeviceAnswer, IdentifiedDevice, check_device};
    use crate::doctor::{Check, Level};

    const PORT: &str = "/dev/ttyACM0";

    fn check(answer: &DeviceAnswer) -> Vec<Check> {
        let model = Model::embedded().map_err(|error| error.to_string());
        check_device(answer, PORT, &model)
    }

    fn remedy_of(check: &Check) -> &str {
        check.remedy.as_deref().unwrap()
    }

    fn identified(model_id: [u8; 8], fault: &str) -> DeviceAnswer {
        DeviceAnswer::Identified(Box::new(IdentifiedDevice {
            summary: DeviceSummary {
                board: "NUCLEO-H743ZI2".to_owned(),
                firmware: "0.1.0".to_owned(),
                model: "00".to_owned(),
                uid: "00".to_owned(),
                reset_cause: "power on".to_owned(),
                fault: fault.to_owned(),
            },
            model_id,
            device: None,
        }))
    }

    #[test]
    fn each_missing_answer_has_its_own_finding_and_remedy() {
        let stranger = DeviceAnswer::Stranger { bytes: 9 };
        let reset = "reset --port /dev/ttyACM0";
        for (answer, finding, remedy) in [
            (DeviceAnswer::NotAsked, "not asked", "doctor again"),
            (DeviceAnswer::Silent, "nothing answers", "check power"),
            (stranger, "9 bytes and no frame", "bridge ports"),
            (DeviceAnswer::OtherVersion, "than this bridge (1)", "cargo flash"),
            (DeviceAnswer::NoHello, "does not introduce itself", reset),
        ] {
            let checks = check(&answer);
            let level = match answer {
                DeviceAnswer::NotAsked => Level::Unknown,
                _ => Level::Error,
            };
            assert_eq!((checks.len(), checks[0].level), (1, level), "{answer:?}");
            assert!(checks[0].finding.contains(finding), "{checks:?}");
            assert!(remedy_of(&checks[0]).contains(remedy), "{checks:?}");
        }
    }

    #[test]
    fn a_fault_and_another_model_are_warnings() {
        let checks = check(&identified([9; 8], "the watchdog reset it"));
        let levels: Vec<Level> = checks.iter().map(|check| check.level).collect();
        assert_eq!(levels, [Level::Ok, Level::Warning, Level::Warning]);
        assert!(checks[1].finding.contains("the watchdog reset it"));
        assert!(remedy_of(&checks[1]).contains("selftest --port /dev/ttyACM0"));
        assert!(checks[2].finding.contains("0909090909090909"), "{checks:?}");
        assert!(remedy_of(&checks[2]).contains("--model FOLDER"));
    }

    #[test]
    fn a_model_that_cannot_be_read_is_an_error() {
        let model = Err("no model.toml".to_owned());
        let checks = check_device(&identified([9; 8], ""), PORT, &model);
        assert_eq!(checks[1].level, Level::Ok);
        assert_eq!(checks[2].level, Level::Error);
        assert_eq!(checks[2].finding, "no model.toml");
    }
}
