//! Identity and properties of the connected device, from its `Hello` and `Capabilities`.

use std::fmt;

use artifact::reconstruction::{code_range, dequantise};
use link::{Capabilities, CodeFormat, CodeValues, Hello, ResetCause, Substitutes};
use thiserror::Error;

use crate::wire::words;

/// Properties of a device, by which the bridge interprets its codes, samples and steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Firmware version, including the commit, as `Hello` reports it.
    pub firmware: String,
    /// Name of the board, such as `NUCLEO-H743ZI2`.
    pub board: String,
    /// Unique id of the microcontroller, 24 hexadecimal digits.
    pub uid: String,
    /// Id of the model in the firmware; `Hello` reports it.
    pub model_id: [u8; 8],
    /// Sampling rate of the ADC, Hz.
    pub adc_rate_hz: u16,
    /// Rate of the time steps at the encoder's input, Hz.
    pub step_rate_hz: u16,
    /// Number of steps in the window of one code.
    pub window_steps: u8,
    /// Number of steps from the start of one window to the start of the next.
    pub hop_steps: u8,
    /// Mains frequency that the notch filter removes, Hz.
    pub mains_hz: u8,
    /// Group delay of the filters, microseconds. It is subtracted from the stamps of codes and
    /// filtered steps.
    pub group_delay_us: u32,
    /// Number of ADC channels: one for each electrode, plus spare channels.
    pub channels: u8,
    /// Electrode labels in the order of the montage.
    pub labels: Vec<String>,
    /// Electrodes without a recorded signal, which the device interpolates or sets to zero.
    pub substitutes: Substitutes,
    /// Description of the filters, published as `prefiltering`.
    pub filters: String,
    /// Full scale of the ADC: the largest input voltage, microvolt.
    pub full_scale_uv: f64,
    /// Scale of the ADC, microvolt per count.
    pub uv_per_count: f64,
    /// Format of the codes; never [`CodeFormat::Newer`].
    pub code_format: CodeFormat,
    scale: Vec<f32>,
    zero_point: Vec<i8>,
    /// Smallest and largest value (`z`, dequantised) that a code can contain.
    pub(crate) code_range: [f32; 2],
}

/// Reason why a device's codes cannot be published.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DeviceError {
    /// The number of codes per second is not a whole number.
    #[error(
        "the device makes {step_rate_hz} steps per second and one code every {hop_steps} steps; \
         consumers need a whole number of codes per second (4, 8 or 16 steps at 128 Hz)"
    )]
    CodeRate {
        /// Rate of the time steps, as the device reports it, Hz.
        step_rate_hz: u16,
        /// Number of steps from one code to the next, as the device reports it.
        hop_steps: u8,
    },
    /// The device's codes have a format that this bridge does not know.
    #[error(
        "the device's codes have a format that is newer than this bridge ({0}); bring firmware and \
         bridge to the same release"
    )]
    Format(CodeFormat),
    /// The numbers of scales and of zero points in `Capabilities` differ.
    #[error(
        "the device reports {scales} scales and {zero_points} zero points for the values of a code"
    )]
    Scales {
        /// Number of scales in `Capabilities`.
        scales: usize,
        /// Number of zero points in `Capabilities`.
        zero_points: usize,
    },
    /// A code scale, or the ADC's voltage per count, is not a positive finite number.
    #[error("the device reports a scale that is not a positive number (index {index})")]
    Scale {
        /// Index of the bad code scale, or the number of code scales if the voltage per count is
        /// bad.
        index: usize,
    },
    /// The device is not compatible with the device that was announced to recorders.
    #[error(
        "it differs from the announced device in its {what}; recorders ask once and keep the \
         answer, so restart this program and the recorder to use it"
    )]
    Changed {
        /// Name of the first property that differs between the two devices.
        what: &'static str,
    },
    /// The window is shorter than the hop.
    #[error("the device reports windows of {window_steps} steps every {hop_steps} steps")]
    Window {
        /// Length of a window, as the device reports it, steps.
        window_steps: u8,
        /// Number of steps from the start of one window to the next, as the device reports it.
        hop_steps: u8,
    },
}

impl Device {
    /// Checks `hello` and `capabilities` and returns the device that they describe.
    ///
    /// # Errors
    ///
    /// [`DeviceError`] if the device's codes cannot be published.
    pub fn new(hello: &Hello, capabilities: &Capabilities) -> Result<Device, DeviceError> {
        let Capabilities { step_rate_hz, window_steps, hop_steps, .. } = *capabilities;
        if hop_steps == 0 || step_rate_hz == 0 || step_rate_hz % u16::from(hop_steps) != 0 {
            return Err(DeviceError::CodeRate { step_rate_hz, hop_steps });
        }
        if window_steps < hop_steps {
            return Err(DeviceError::Window { window_steps, hop_steps });
        }
        let scale = capabilities.code_scale.to_vec();
        let zero_point = capabilities.code_zero_point.to_vec();
        if scale.len() != zero_point.len() {
            return Err(DeviceError::Scales { scales: scale.len(), zero_points: zero_point.len() });
        }
        let mut numbers = scale.iter().chain(std::iter::once(&capabilities.lsb_nv));
        if let Some(index) = numbers.position(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(DeviceError::Scale { index });
        }
        let code_format = capabilities.code_format;
        let Some(levels) = code_format.range() else {
            return Err(DeviceError::Format(code_format));
        };
        let labels = capabilities.labels.split_whitespace();
        Ok(Device {
            firmware: hello.firmware.to_owned(),
            board: hello.board.to_owned(),
            uid: hexadecimal(&hello.chip_uid),
            model_id: hello.model_id,
            adc_rate_hz: capabilities.adc_rate_hz,
            step_rate_hz,
            window_steps,
            hop_steps,
            mains_hz: capabilities.mains_hz,
            group_delay_us: capabilities.group_delay_us,
            channels: capabilities.channels,
            labels: labels.map(str::to_owned).collect(),
            substitutes: Substitutes::NONE,
            filters: capabilities.filters.to_owned(),
            // Full scale is 2^23 counts (24 bits with sign); 1000 nV is 1 uV.
            full_scale_uv: f64::from(capabilities.lsb_nv) * 8_388_608.0 / 1000.0,
            uv_per_count: f64::from(capabilities.lsb_nv) / 1000.0,
            code_format,
            code_range: code_range(levels, &scale, &zero_point),
            scale,
            zero_point,
        })
    }

    /// Returns the electrodes without a recorded signal, such as "interpolated: F1 F2; zero: Cz";
    /// `None` if the signals of all electrodes were recorded.
    pub fn unrecorded(&self) -> Option<String> {
        let labels = self.labels.iter().map(String::as_str);
        let text = self.substitutes.named(labels).to_string();
        (!text.is_empty()).then_some(text)
    }

    /// Checks that frames from `other` match the announcement of this device. The mains frequency,
    /// the firmware and the microcontroller are not compared.
    ///
    /// # Errors
    ///
    /// [`DeviceError::Changed`] with the first property that differs.
    pub fn check_compatible(&self, other: &Device) -> Result<(), DeviceError> {
        let differs = [
            ("model", self.model_id != other.model_id),
            ("rate and window", self.rates() != other.rates()),
            ("montage", self.labels != other.labels),
            ("channel count", self.channels != other.channels),
            ("code format", self.code_format != other.code_format),
            ("code scale", self.scales() != other.scales()),
            ("volts per count", self.full_scale_uv.to_bits() != other.full_scale_uv.to_bits()),
        ];
        match differs.into_iter().find(|(_, differs)| *differs) {
            Some((what, _)) => Err(DeviceError::Changed { what }),
            None => Ok(()),
        }
    }

    fn rates(&self) -> [u16; 4] {
        let steps = [self.window_steps, self.hop_steps].map(u16::from);
        [self.adc_rate_hz, self.step_rate_hz, steps[0], steps[1]]
    }

    fn scales(&self) -> (&[f32], &[i8]) {
        (&self.scale, &self.zero_point)
    }

    /// Returns the index of the ADC sample at the last step of window number `window`. Both are
    /// counted from 0 since the command `Start`.
    pub fn last_sample(&self, window: u32) -> u64 {
        let hops = u64::from(window) * u64::from(self.hop_steps);
        let step = hops + u64::from(self.window_steps) - 1;
        self.sample_of_step(step)
    }

    /// Returns the index of the ADC sample at step number `step`; both are counted from `Start`.
    pub fn sample_of_step(&self, step: u64) -> u64 {
        step.saturating_mul(u64::from(self.adc_rate_hz)) / u64::from(self.step_rate_hz)
    }

    /// Returns the number of codes that the device makes per second: step rate divided by hop.
    pub fn codes_per_second(&self) -> u16 {
        self.step_rate_hz / u16::from(self.hop_steps)
    }

    /// Returns the duration of `steps` encoder steps in microseconds, rounded down.
    pub fn steps_us(&self, steps: u32) -> i64 {
        i64::from(steps) * 1_000_000 / i64::from(self.step_rate_hz)
    }

    /// Returns the number of values in a code; 0 if the device's model has no network.
    pub const fn numbers(&self) -> usize {
        self.scale.len()
    }

    /// Returns whether the device's model has a network. Without a network the device has no codes.
    pub const fn has_network(&self) -> bool {
        self.numbers() > 0
    }

    /// Converts the values `z` of a float code to levels, `z / scale + zero_point`, with this
    /// device's scales. The levels are limited to the range of the code format, but not rounded.
    pub fn code_levels(&self, z: &[f32]) -> Vec<f64> {
        let [least, greatest] = self.code_format.range().unwrap_or_default().map(f64::from);
        let numbers = z.iter().zip(self.scale.iter().zip(&self.zero_point));
        let levels = numbers.map(|(z, (scale, zero_point))| {
            let level = f64::from(*z) / f64::from(*scale) + f64::from(*zero_point);
            level.clamp(least, greatest)
        });
        levels.collect()
    }

    pub(crate) fn zero_points(&self) -> &[i8] {
        &self.zero_point
    }

    /// Dequantises the values of a code, in any format, into `z`: `(level - zero_point) * scale`.
    pub fn dequantise(&self, values: &CodeValues, z: &mut [f32]) {
        let numbers = self.scale.iter().zip(&self.zero_point);
        for (z, (level, (scale, zero_point))) in z.iter_mut().zip(values.levels().zip(numbers)) {
            *z = dequantise(level, *scale, *zero_point);
        }
    }
}

/// Returns the label of an ADC channel: the name of its electrode, or `exg1`, `exg2`, ... for the
/// spare channels, which follow the electrodes.
pub(crate) fn channel_label(labels: &[String], channel: usize) -> String {
    let spare = || format!("exg{}", channel + 1 - labels.len());
    labels.get(channel).cloned().unwrap_or_else(spare)
}

/// Returns two hexadecimal digits for each byte, in lower case.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    let digits: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    digits.concat()
}

/// Copy of a device's [`Hello`] that owns its strings; a `Hello` borrows them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    firmware: String,
    board: String,
    chip_uid: [u8; 12],
    model_id: [u8; 8],
    session_id: u32,
    reset_cause: ResetCause,
    fault: String,
}

impl Identity {
    /// Copies all fields of `hello`, whose buffer can then be reused.
    pub fn new(hello: &Hello) -> Identity {
        Identity {
            firmware: hello.firmware.to_owned(),
            board: hello.board.to_owned(),
            chip_uid: hello.chip_uid,
            model_id: hello.model_id,
            session_id: hello.session_id,
            reset_cause: hello.reset_cause,
            fault: hello.fault.to_owned(),
        }
    }

    /// Returns this identity as a `Hello` that borrows the strings.
    pub fn as_hello(&self) -> Hello<'_> {
        Hello {
            firmware: &self.firmware,
            board: &self.board,
            chip_uid: self.chip_uid,
            model_id: self.model_id,
            session_id: self.session_id,
            reset_cause: self.reset_cause,
            fault: &self.fault,
        }
    }

    /// Returns whether `hello` is from the same device, by the unique id of its microcontroller.
    pub(crate) fn is_same_device(&self, hello: &Hello) -> bool {
        self.chip_uid == hello.chip_uid
    }

    /// Returns whether `hello` comes from the same device, which has not restarted since it sent
    /// this identity, and uses the same model.
    pub fn is_same_session(&self, hello: &Hello) -> bool {
        self.is_same_start(hello) && self.model_id == hello.model_id
    }

    /// Returns whether `hello` comes from the same device, which has not restarted since it sent
    /// this identity. Its model may have changed by an upload.
    pub fn is_same_start(&self, hello: &Hello) -> bool {
        self.session_id == hello.session_id && self.chip_uid == hello.chip_uid
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} with firmware {}, session {:08x}, started by {}",
            self.board,
            self.firmware,
            self.session_id,
            words::reset_cause(self.reset_cause)
        )
    }
}
