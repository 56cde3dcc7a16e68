//! The report of a self-test, and its form as a table of text.

use std::fmt;

use ads1299::Register;
use link::{ChannelFault, ChannelTest, ChipTest, Hello, SelfTest};
use serde::Serialize;

use crate::device::{channel_label, hexadecimal};
use crate::wire::words;

/// Mask of the bits in a chip's ID register that identify the part: bit 4 is 1, DEV_ID (bits 3 and
/// 2) is 11, and NU_CH (bits 1 and 0) is 00, 01 or 10 for 4, 6 or 8 channels. The three higher bits
/// are the revision (data sheet SBAS499, section 9.6.1.1).
const PART_MASK: u8 = 0x1F;

/// Report of a device's self-test, with a verdict for each chip, for each channel and for the
/// device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelfTestReport {
    /// Device that was tested.
    pub device: DeviceSummary,
    /// First fault in words, as the device reports it; empty if there is none.
    pub fault: String,
    /// Measured rate of the data-ready signal (DRDY), and its faults.
    pub ready: DrdyReport,
    /// Chips in the order of the daisy chain, starting with the chip at MISO.
    pub chips: Vec<ChipReport>,
    /// Channels of all chips, in the order of the ADC channels.
    pub channels: Vec<ChannelReport>,
    /// Whether all chips and channels were tested and have no fault.
    pub passed: bool,
    /// One-line summary, the last line of the table.
    pub verdict: String,
}

/// Identity of a device and the cause of its last start; displays as one line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DeviceSummary {
    /// Name of the board, such as `NUCLEO-H743ZI2`.
    pub board: String,
    /// Firmware version, including the commit.
    pub firmware: String,
    /// Id of the model, 16 hexadecimal digits.
    pub model: String,
    /// Unique id of the microcontroller, 24 hexadecimal digits.
    pub uid: String,
    /// Cause of the device's last reset, in words.
    pub reset_cause: String,
    /// Fault that was found at the last start or caused the last reset; empty if there is none.
    pub fault: String,
}

/// Rate and faults of the data-ready signal (DRDY) of the converters. At each edge of this signal
/// the device reads a sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DrdyReport {
    /// Rate of the DRDY edges, measured by the device's clock, Hz; `None` if it was not measured.
    pub rate_hz: Option<f64>,
    /// Sampling rate to which the converters are set, Hz.
    pub expected_hz: f64,
    /// Deviation of `rate_hz` from `expected_hz`, parts per million of `expected_hz`; `None` if
    /// either rate is unknown.
    pub ppm: Option<f64>,
    /// Number of DRDY edges that came too early.
    pub early: u32,
    /// Number of DRDY periods without an edge.
    pub missed: u32,
}

/// Identity and faults of one converter chip.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ChipReport {
    /// Position of the chip in the daisy chain; the chip at MISO has 0.
    pub chip: usize,
    /// Content of the chip's ID register.
    pub id: u8,
    /// Name of the chip's type, according to the ID register.
    pub part: String,
    /// Number of registers that did not keep the value written to them.
    pub registers_wrong: u8,
    /// Name and address of the first register that did not keep its value; `None` if all did.
    pub first_wrong: Option<String>,
    /// Number of the chip's frames that were damaged, or equal to the frame before.
    pub frames_bad: u32,
    /// Whether the part is an 8-channel ADS1299 and all its registers are correct.
    pub in_order: bool,
}

/// Measurements and verdict of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelReport {
    /// Number of the channel, from 1.
    pub channel: usize,
    /// Label of the channel's electrode, or exg1, exg2, ... for a spare channel.
    pub label: String,
    /// Relative error of the measured amplitude of the chip's square-wave test signal, percent;
    /// `None` if it was not measured.
    pub gain_error_percent: Option<f64>,
    /// Mean of the two levels of the square wave, microvolts; `None` if it was not measured.
    pub offset_uv: Option<f32>,
    /// Noise around the two levels of the square wave, microvolts RMS; `None` if not measured.
    pub noise_uv: Option<f32>,
    /// Noise with the input shorted, microvolts RMS; `None` if not measured.
    pub shorted_noise_uv: Option<f32>,
    /// Verdict on the channel: its fault in words, "not measured", or "in order".
    pub verdict: String,
    /// Whether the channel was measured and has no fault.
    pub in_order: bool,
}

impl SelfTestReport {
    /// Creates the report of the self-test `test` on a device with `channels` ADC channels.
    /// `labels` are the electrodes of the first channels; further channels are spare.
    pub(crate) fn new(
        device: DeviceSummary,
        test: &SelfTest,
        channels: usize,
        labels: &[String],
    ) -> SelfTestReport {
        let chips: Vec<ChipReport> = test.chips.iter().enumerate().map(chip_report).collect();
        let tests = test.channels.iter().enumerate();
        let tested: Vec<ChannelReport> = tests
            .map(|(index, test)| channel_report(index, test, channel_label(labels, index)))
            .collect();
        let bad =
            |count: usize, of: usize, what| (count > 0).then(|| format!("{count} of {of} {what}"));
        let bad_chips = chips.iter().filter(|chip| !chip.in_order).count();
        let count = |is: fn(&&ChannelTest) -> bool| test.channels.iter().filter(is).count();
        let measured = count(|test| !is_unmeasured(test));
        let bad_channels = count(|test| test.fault != ChannelFault::None);
        let all = channels.max(tested.len());
        let faults: Vec<String> = [
            (!test.fault.is_empty()).then(|| test.fault.as_str().to_owned()),
            bad(bad_chips, chips.len(), "chips"),
            bad(bad_channels, tested.len(), "channels"),
            bad(all - measured, all, "channels not measured"),
        ]
        .into_iter()
        .flatten()
        .collect();
        let passed = faults.is_empty();
        let (chip_count, channel_count) = (chips.len(), tested.len());
        let verdict = if passed {
            format!("all in order: {chip_count} chips, {channel_count} channels")
        } else {
            format!("NOT IN ORDER: {}", faults.join("; "))
        };
        SelfTestReport {
            device,
            fault: test.fault.as_str().to_owned(),
            ready: DrdyReport::new(test),
            chips,
            channels: tested,
            passed,
            verdict,
        }
    }
}

impl DeviceSummary {
    /// Copies the summary's fields from `hello`.
    pub fn new(hello: &Hello) -> DeviceSummary {
        DeviceSummary {
            board: hello.board.to_owned(),
            firmware: hello.firmware.to_owned(),
            model: hexadecimal(&hello.model_id),
            uid: hexadecimal(&hello.chip_uid),
            reset_cause: words::reset_cause(hello.reset_cause),
            fault: hello.fault.to_owned(),
        }
    }
}

impl DrdyReport {
    fn new(test: &SelfTest) -> DrdyReport {
        let hz = |mhz: u32| f64::from(mhz) / 1000.0;
        let expected_hz = hz(test.expected_millihertz);
        let rate_hz = (test.drdy_millihertz > 0).then(|| hz(test.drdy_millihertz));
        let known = rate_hz.filter(|_| test.expected_millihertz > 0);
        DrdyReport {
            rate_hz,
            expected_hz,
            ppm: known.map(|rate_hz| (rate_hz / expected_hz - 1.0) * 1e6),
            early: test.drdy_early,
            missed: test.drdy_missed,
        }
    }
}

fn chip_report((chip, test): (usize, &ChipTest)) -> ChipReport {
    let ChipTest { id, registers_wrong, first_wrong, frames_bad } = *test;
    let name = || match Register::at(first_wrong) {
        Some(register) => format!("{register} (0x{first_wrong:02X})"),
        None => format!("0x{first_wrong:02X}"),
    };
    ChipReport {
        chip,
        id,
        part: part_name(id).to_owned(),
        registers_wrong,
        first_wrong: (registers_wrong > 0).then(name),
        frames_bad,
        in_order: id & PART_MASK == ads1299::ID & PART_MASK && registers_wrong == 0,
    }
}

/// Returns the name of the part whose ID register has the content `id`.
fn part_name(id: u8) -> &'static str {
    match (id, id & PART_MASK) {
        (0x00 | 0xFF, _) => "no answer",
        (_, 0x1E) => "ADS1299, 8 channels",
        (_, 0x1D) => "ADS1299-6, 6 channels",
        (_, 0x1C) => "ADS1299-4, 4 channels",
        _ => "not an ADS1299",
    }
}

/// Returns whether the test stopped before both measurements of the channel, with the square wave
/// and with the input shorted, were complete. A measured channel has noise in both, or a fault.
fn is_unmeasured(test: &ChannelTest) -> bool {
    let silent = test.noise_uv == 0.0 || test.shorted_noise_uv == 0.0;
    test.fault == ChannelFault::None && silent
}

fn channel_report(index: usize, test: &ChannelTest, label: String) -> ChannelReport {
    let too_few = test.fault == ChannelFault::Samples;
    // For a channel without samples, a device reports zeros and a gain error of -1. It reports -1
    // also if it had too few samples to measure both levels of the square wave.
    let nothing = test.offset_uv == 0.0 && test.noise_uv == 0.0;
    let square_wave = !(nothing || too_few && test.gain_error <= -1.0);
    let nothing = test.shorted_noise_uv == 0.0;
    let shorted = !(nothing && (too_few || !square_wave || is_unmeasured(test)));
    ChannelReport {
        channel: index + 1,
        label,
        gain_error_percent: square_wave.then(|| f64::from(test.gain_error) * 100.0),
        offset_uv: square_wave.then_some(test.offset_uv),
        noise_uv: square_wave.then_some(test.noise_uv),
        shorted_noise_uv: shorted.then_some(test.shorted_noise_uv),
        verdict: match test.fault {
            ChannelFault::None if is_unmeasured(test) => "not measured".to_owned(),
            ChannelFault::None => "in order".to_owned(),
            ChannelFault::Samples => "too few samples".to_owned(),
            ChannelFault::Gain => "wrong gain".to_owned(),
            ChannelFault::Offset => "wrong offset".to_owned(),
            ChannelFault::Noisy => "too loud".to_owned(),
            ChannelFault::Silent => "too quiet (dead channel)".to_owned(),
            ChannelFault::Newer(number) => format!("fault {number}, newer than this bridge"),
        },
        in_order: test.fault == ChannelFault::None && !is_unmeasured(test),
    }
}

/// Writes one line for the device and one for DRDY, a table of the chips, a table of the channels,
/// and the verdict.
impl fmt::Display for SelfTestReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "device  {}", self.device)?;
        writeln!(formatter, "DRDY    {}", self.ready)?;
        if !self.chips.is_empty() {
            writeln!(formatter)?;
            let header = ["chip", "ID", "registers", "frames bad"];
            let rows = self.chips.iter().map(chip_row);
            write_columns(formatter, header, [true, false, false, true], rows)?;
        }
        if !self.channels.is_empty() {
            writeln!(formatter)?;
            let header = [
                "channel",
                "electrode",
                "gain error %",
                "offset uV",
                "noise uV rms",
                "shorted uV rms",
                "verdict",
            ];
            let right = [true, false, true, true, true, true, false];
            let rows = self.channels.iter().map(channel_row);
            write_columns(formatter, header, right, rows)?;
        }
        write!(formatter, "\n{}", self.verdict)
    }
}

impl fmt::Display for DeviceSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DeviceSummary { board, firmware, model: _, uid, reset_cause, fault } = self;
        write!(formatter, "{board}, firmware {firmware}, uid {uid}, started by {reset_cause}")?;
        if fault.is_empty() {
            return Ok(());
        }
        write!(formatter, "; it reports: {fault}")
    }
}

impl fmt::Display for DrdyReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DrdyReport { rate_hz, expected_hz, ppm, early, missed } = self;
        match (rate_hz, ppm) {
            (Some(rate_hz), Some(ppm)) => write!(
                formatter,
                "{rate_hz:.3} Hz, {ppm:+.0} ppm off the {expected_hz} Hz that were set"
            )?,
            (Some(rate_hz), None) => write!(formatter, "{rate_hz:.3} Hz")?,
            (None, _) => write!(formatter, "not measured, {expected_hz} Hz were set")?,
        }
        write!(formatter, "; {early} early, {missed} missed")
    }
}

fn chip_row(chip: &ChipReport) -> [String; 4] {
    let registers = match &chip.first_wrong {
        None => "all kept".to_owned(),
        Some(first) => format!("{} wrong, the first is {first}", chip.registers_wrong),
    };
    [
        chip.chip.to_string(),
        format!("0x{:02X} {}", chip.id, chip.part),
        registers,
        chip.frames_bad.to_string(),
    ]
}

fn channel_row(channel: &ChannelReport) -> [String; 7] {
    let noise = |uv: Option<f32>| or_dash(uv.map(|uv| format!("{uv:.2}")));
    [
        channel.channel.to_string(),
        channel.label.clone(),
        or_dash(channel.gain_error_percent.map(|off| format!("{off:+.2}"))),
        or_dash(channel.offset_uv.map(|uv| format!("{uv:+.1}"))),
        noise(channel.noise_uv),
        noise(channel.shorted_noise_uv),
        channel.verdict.clone(),
    ]
}

fn or_dash(measured: Option<String>) -> String {
    measured.unwrap_or_else(|| "-".to_owned())
}

/// Writes a table with a header. Every column is as wide as its widest cell. `right` states for
/// each column whether it is aligned to the right.
///
/// # Errors
///
/// The errors of `formatter`.
pub fn write_columns<const N: usize>(
    formatter: &mut fmt::Formatter<'_>,
    header: [&str; N],
    right: [bool; N],
    rows: impl Iterator<Item = [String; N]>,
) -> fmt::Result {
    let mut table = vec![header.map(str::to_owned)];
    table.extend(rows);
    let widest = |column: usize| {
        let cells = table.iter().map(|row| row[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let widths: [usize; N] = std::array::from_fn(widest);
    for row in &table {
        let cells = row.iter().zip(widths).zip(right);
        let cells: Vec<String> = cells
            .map(
                |((cell, width), right)| {
                    if right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
                },
            )
            .collect();
        writeln!(formatter, "{}", cells.join("  ").trim_end())?;
    }
    Ok(())
}
