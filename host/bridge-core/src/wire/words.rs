//! Names of commands, answers and reset causes in messages to the user.

use link::{AckResult, ResetCause, ToDevice};

/// Returns the name of a command, as docs/wire-format.md spells it.
pub(crate) fn command(command: &ToDevice) -> &'static str {
    match command {
        ToDevice::Start(_) => "Start",
        ToDevice::Stop => "Stop",
        ToDevice::Identify => "Identify",
        ToDevice::Ping => "Ping",
        ToDevice::SelfTest => "SelfTest",
        ToDevice::SyncTime { .. } => "SyncTime",
        ToDevice::Reset(_) => "Reset",
        ToDevice::SetRate { .. } => "SetRate",
        ToDevice::SetExclusion(_) => "SetExclusion",
        ToDevice::ModelBegin(_) => "ModelBegin",
        ToDevice::ModelChunk(_) => "ModelChunk",
        ToDevice::ModelEnd => "ModelEnd",
        ToDevice::SetFeatures(_) => "SetFeatures",
        ToDevice::SetImpedance { .. } => "SetImpedance",
    }
}

/// Returns why a device refused a command, as a clause such as "it is busy".
pub(crate) fn reason(result: AckResult) -> String {
    match result {
        AckResult::Done => "done".to_owned(),
        AckResult::UnknownCommand => "it does not know the command".to_owned(),
        AckResult::BadArgument => "an argument is out of range".to_owned(),
        AckResult::Busy => "it is busy".to_owned(),
        AckResult::NotSupported => "its board or model cannot do that".to_owned(),
        AckResult::Failed => "it tried and failed".to_owned(),
        AckResult::Newer(number) => format!("reason {number}, newer than this bridge"),
    }
}

/// Converts the device's answer to a command: a refusal becomes its reason, in words.
pub(crate) fn answer(result: AckResult) -> Result<(), String> {
    match result {
        AckResult::Done => Ok(()),
        result => Err(reason(result)),
    }
}

/// Returns a sentence for the log: which command the device refuses, why, and what the user can do.
pub(crate) fn refusal(refused: &ToDevice, result: AckResult) -> String {
    let remedy = match (refused, result) {
        (ToDevice::Start(_), AckResult::NotSupported) => {
            "its model may be damaged: see the fault that it reported in the log, and flash it again"
        }
        (ToDevice::Start(_), _) => {
            "choose other --streams (a device without a network has packed in the place of codes) or --mains, or \
             update firmware or bridge"
        }
        _ => "bring firmware and bridge to the same release",
    };
    format!("the device refuses {}: {}; {remedy}", command(refused), reason(result))
}

/// Returns a sentence for the log: why the device takes no packed model, and what the user can do.
pub(crate) fn upload_refusal(result: AckResult) -> String {
    let remedy = match result {
        AckResult::Failed => {
            "it has found the model unsound each time, though every frame arrived intact: the scale of its input may \
             be another, another program may use its port, or its memory may be damaged; restart the device, then \
             this program"
        }
        _ => {
            "it has no memory for one, its own packed model, window or codes have other dimensions, or its firmware \
             is older than this bridge; build an image with the model (CORTICODE_ARTIFACT), use a NUCLEO-H743ZI2, \
             or fit a model without --numbers"
        }
    };
    let reason = reason(result);
    format!("the device does not take the model: {reason}; {remedy}")
}

/// Returns a sentence for the log: why the device measures no impedance, and what the user can do.
pub(crate) fn impedance_refusal(result: AckResult) -> String {
    let remedy = match result {
        AckResult::Busy => {
            "at its sample rate the current is inside the band of the EEG, so measure before the session, with \
             corticode-bridge impedance"
        }
        AckResult::UnknownCommand => "its firmware is older than this bridge; update the firmware",
        _ => {
            "its image has no room for it, or it has no converters, as a replay; use a NUCLEO-H743ZI2 or host-sim"
        }
    };
    let reason = reason(result);
    format!("the device does not measure the impedance of the electrodes: {reason}; {remedy}")
}

/// Returns the cause of a device's last reset, worded to follow "started by".
pub(crate) fn reset_cause(cause: ResetCause) -> String {
    match cause {
        ResetCause::NotKnown => "an unknown cause".to_owned(),
        ResetCause::PowerOn => "power on".to_owned(),
        ResetCause::Pin => "the reset pin".to_owned(),
        ResetCause::BrownOut => "a supply voltage dip (brown-out)".to_owned(),
        ResetCause::Watchdog => "its watchdog".to_owned(),
        ResetCause::Software => "a command".to_owned(),
        ResetCause::Fault => "a fault".to_owned(),
        ResetCause::Newer(number) => format!("cause {number}, newer than this bridge"),
    }
}

#[cfg(test)]
mod tests {
    use link::{Start, Streams};

    use super::*;

    #[test]
    fn the_remedy_depends_on_the_reason() {
        let start = ToDevice::Start(Start { streams: Streams::CODES, mains_hz: 50 });
        let damaged = refusal(&start, AckResult::NotSupported);
        assert!(damaged.contains("flash it again"), "{damaged}");
        let streams = refusal(&start, AckResult::BadArgument);
        assert!(streams.contains("choose other --streams"), "{streams}");
        let older = refusal(&ToDevice::SelfTest, AckResult::UnknownCommand);
        assert!(older.contains("to the same release"), "{older}");
        let unsound = upload_refusal(AckResult::Failed);
        assert!(unsound.contains("restart the device"), "{unsound}");
        let without = upload_refusal(AckResult::NotSupported);
        assert!(without.contains("no memory"), "{without}");
    }
}
