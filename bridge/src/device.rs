//! The device as it introduced itself.

use link::{CODE_LEN, Capabilities, CodeFormat, CodeValues, Hello};
use thiserror::Error;

/// The device as it introduced itself: everything that its codes mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Version of the firmware.
    pub firmware: String,
    /// Board.
    pub board: String,
    /// Unique id of its microcontroller, hexadecimal.
    pub uid: String,
    /// Its model.
    pub model_id: [u8; 8],
    /// Samples per second of the ADC.
    pub adc_rate_hz: u16,
    /// Steps per second at the encoder's input.
    pub step_rate_hz: u16,
    /// Steps in a window.
    pub window_steps: u8,
    /// Steps from one window to the next.
    pub hop_steps: u8,
    /// Mains that its notch removes, Hz.
    pub mains_hz: u8,
    /// Delay of its filters, microseconds.
    pub group_delay_us: u32,
    /// Channels of the ADC: the electrodes, then the spare ones.
    pub channels: u8,
    /// Electrode labels in the montage's order.
    pub labels: Vec<String>,
    /// Filters in words.
    pub filters: String,
    /// Largest value the ADC can give, microvolt.
    pub full_scale_uv: f64,
    /// Microvolt per count of the ADC.
    pub count_uv: f64,
    /// Format of its codes; [`CodeFormat::Newer`] never.
    pub code_format: CodeFormat,
    scale: [f32; CODE_LEN],
    zero_point: [i8; CODE_LEN],
    /// The least and the greatest `z` that any value of any code can mean.
    pub(crate) code_range: [f32; 2],
}

/// A device introduced itself with numbers that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DeviceError {
    /// Codes per second are not a whole number.
    #[error(
        "the device makes {step_rate_hz} steps per second and a code every {hop_steps}; consumers \
         need a whole number of codes per second (8 or 16 steps at 128 Hz)"
    )]
    CodeRate {
        /// Steps per second.
        step_rate_hz: u16,
        /// Steps per code.
        hop_steps: u8,
    },
    /// Its codes cannot be read.
    #[error(
        "the device's codes have a format that is newer than this bridge ({0}); bring firmware and \
         bridge to the same release"
    )]
    Format(CodeFormat),
    /// Scales or zero points are missing.
    #[error("the device gives {scales} scales and {zero_points} zero points for 128 code values")]
    Scales {
        /// How many scales.
        scales: usize,
        /// How many zero points.
        zero_points: usize,
    },
    /// A scale is not positive and finite, or the converter's step is not.
    #[error("the device gives a scale that is no positive number (place {place})")]
    Scale {
        /// Which one; 128 is the converter's step.
        place: usize,
    },
    /// Its codes mean something else than those of the device that was announced.
    #[error(
        "its {what} are not those that were announced; recorders ask once and keep the answer, so \
         restart this bridge and the recorder to use it"
    )]
    Changed {
        /// What differs.
        what: &'static str,
    },
    /// A window is shorter than its hop.
    #[error("the device gives windows of {window_steps} steps every {hop_steps} steps")]
    Window {
        /// Steps in a window.
        window_steps: u8,
        /// Steps from one window to the next.
        hop_steps: u8,
    },
}

impl Device {
    /// What `hello` and `capabilities` say, checked.
    ///
    /// # Errors
    ///
    /// [`DeviceError`]; then its codes cannot be published.
    pub fn new(hello: &Hello, capabilities: &Capabilities) -> Result<Device, DeviceError> {
        let Capabilities {
            step_rate_hz,
            window_steps,
            hop_steps,
            ..
        } = *capabilities;
        if hop_steps == 0 || step_rate_hz == 0 || step_rate_hz % u16::from(hop_steps) != 0 {
            return Err(DeviceError::CodeRate {
                step_rate_hz,
                hop_steps,
            });
        }
        if window_steps < hop_steps {
            return Err(DeviceError::Window {
                window_steps,
                hop_steps,
            });
        }
        let scale = capabilities.code_scale.as_slice().try_into();
        let zero_point = capabilities.code_zero_point.as_slice().try_into();
        let (Ok(scale), Ok(zero_point)) = (scale, zero_point) else {
            let scales = capabilities.code_scale.len();
            let zero_points = capabilities.code_zero_point.len();
            return Err(DeviceError::Scales {
                scales,
                zero_points,
            });
        };
        let scale: [f32; CODE_LEN] = scale;
        let numbers = scale.iter().chain([&capabilities.lsb_nv]);
        if let Some(place) = numbers
            .into_iter()
            .position(|x| !(x.is_finite() && *x > 0.0))
        {
            return Err(DeviceError::Scale { place });
        }
        let code_format = capabilities.code_format;
        let Some(steps) = code_format.range() else {
            return Err(DeviceError::Format(code_format));
        };
        let uid: Vec<String> = hello
            .chip_uid
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        Ok(Device {
            firmware: hello.firmware.to_owned(),
            board: hello.board.to_owned(),
            uid: uid.concat(),
            model_id: hello.model_id,
            adc_rate_hz: capabilities.adc_rate_hz,
            step_rate_hz,
            window_steps,
            hop_steps,
            mains_hz: capabilities.mains_hz,
            group_delay_us: capabilities.group_delay_us,
            channels: capabilities.channels,
            labels: capabilities
                .labels
                .split_whitespace()
                .map(str::to_owned)
                .collect(),
            filters: capabilities.filters.to_owned(),
            // 24 bits: 2^23 counts; nanovolt to microvolt.
            full_scale_uv: f64::from(capabilities.lsb_nv) * 8_388_608.0 / 1000.0,
            count_uv: f64::from(capabilities.lsb_nv) / 1000.0,
            code_format,
            scale,
            zero_point,
            code_range: code_range(steps, &scale, &zero_point),
        })
    }

    /// Whether frames of `other` mean what this device's frames were announced to mean. Mains,
    /// firmware and the chip may differ.
    ///
    /// # Errors
    ///
    /// [`DeviceError::Changed`].
    pub fn admit(&self, other: &Device) -> Result<(), DeviceError> {
        let differs = [
            ("model", self.model_id != other.model_id),
            ("rate and window", self.rates() != other.rates()),
            ("electrodes", self.labels != other.labels),
            ("channels", self.channels != other.channels),
            ("code format", self.code_format != other.code_format),
            (
                "code scales",
                (self.scale, self.zero_point) != (other.scale, other.zero_point),
            ),
            (
                "volts per count",
                self.full_scale_uv.to_bits() != other.full_scale_uv.to_bits(),
            ),
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

    /// Index since Start of the ADC sample that a window's last step was picked from.
    pub fn last_sample(&self, window: u32) -> u64 {
        let hops = u64::from(window) * u64::from(self.hop_steps);
        let step = hops + u64::from(self.window_steps) - 1;
        self.sample_of_step(step)
    }

    /// Index since Start of the ADC sample that a step was picked from.
    pub fn sample_of_step(&self, step: u64) -> u64 {
        step.saturating_mul(u64::from(self.adc_rate_hz)) / u64::from(self.step_rate_hz)
    }

    /// Label of an ADC channel: an electrode, or `exg1`, `exg2`.. of the spare ones.
    pub fn channel_label(&self, channel: usize) -> String {
        channel_label(&self.labels, channel)
    }

    /// Codes per second.
    pub fn codes_per_second(&self) -> u16 {
        self.step_rate_hz / u16::from(self.hop_steps)
    }

    /// Time that `steps` take, microseconds, rounded down.
    pub fn steps_us(&self, steps: u32) -> i64 {
        i64::from(steps) * 1_000_000 / i64::from(self.step_rate_hz)
    }

    /// A float code in steps of this device's codes, within the range of their format:
    /// `step = z / scale + zero_point`, not rounded.
    pub fn steps_of(&self, z: &[f32; CODE_LEN]) -> [f64; CODE_LEN] {
        let range = self.code_format.range().unwrap_or_default().map(f64::from);
        std::array::from_fn(|index| {
            let step = f64::from(z[index]) / f64::from(self.scale[index]);
            let step = step + f64::from(self.zero_point[index]);
            step.clamp(range[0], range[1])
        })
    }

    pub(crate) fn zero_points(&self) -> &[i8; CODE_LEN] {
        &self.zero_point
    }

    /// `z = (step - zero_point) * scale`, whatever the format.
    pub fn dequantise(&self, values: &CodeValues, z: &mut [f32; CODE_LEN]) {
        let steps = values.levels();
        for (index, z) in z.iter_mut().enumerate() {
            *z = dequantised(steps[index], self.scale[index], self.zero_point[index]);
        }
    }
}

/// Label of an ADC channel whose first ones are these electrodes.
pub(crate) fn channel_label(labels: &[String], channel: usize) -> String {
    let spare = || format!("exg{}", channel + 1 - labels.len());
    labels.get(channel).cloned().unwrap_or_else(spare)
}

#[expect(
    clippy::cast_precision_loss,
    reason = "16 bits and a zero point have 17"
)]
fn dequantised(step: i32, scale: f32, zero_point: i8) -> f32 {
    (step - i32::from(zero_point)) as f32 * scale
}

/// The least and the greatest `z` that steps within these ends can mean.
fn code_range(
    [least, greatest]: [i32; 2],
    scale: &[f32; CODE_LEN],
    zero_point: &[i8; CODE_LEN],
) -> [f32; 2] {
    let ends = |step| {
        let numbers = scale.iter().zip(zero_point);
        numbers.map(move |(scale, zero_point)| dequantised(step, *scale, *zero_point))
    };
    [
        ends(least).fold(f32::INFINITY, f32::min),
        ends(greatest).fold(f32::NEG_INFINITY, f32::max),
    ]
}
