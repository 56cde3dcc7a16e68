//! Encodes a recording to a file of codes or packed blocks.

mod device;

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use artifact::ModelId;
use link::Stats;
use new_file::{Existing, NewFile};
use pipeline::{Mains, PackedCode};
use recordings::{Missing, virtual_adc::AdcCounters};

use crate::error::OfflineError;
use crate::played::{Played, first_channels};
use crate::progress::Progress;
use device::Device;

/// Frames are collected until they have at least this many bytes in total, and then written to the
/// file.
const PIECE: usize = 1 << 16;

/// What a file of codes holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum EncodedStream {
    /// Codes of the network.
    #[default]
    Codes,
    /// Packed blocks at this rate, 0 (finest) to 15 (coarsest); `None` for the model's own rate.
    Packed(Option<u8>),
}

/// Options for encoding recordings.
#[derive(Debug, Clone, Copy)]
pub struct Encoding {
    /// Mains frequency that the notch filter removes.
    pub mains: Mains,
    /// Treatment of electrodes that a recording lacks.
    pub missing: Missing,
    /// Whether the output replaces a file of the same name.
    pub existing: Existing,
    /// Kind of codes that the file gets.
    pub stream: EncodedStream,
}

/// Result of encoding one recording.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// Text for the user that states where the samples of each electrode come from.
    pub montage: String,
    /// Defects of the recording, one sentence each.
    pub warnings: Vec<String>,
    /// Counters of the pipeline: samples, codes, clipped values.
    pub stats: Stats,
    /// Counters of the virtual ADC.
    pub adc: AdcCounters,
    /// Counts of the packed blocks; `None` for a file of codes.
    pub packed: Option<PackedCounts>,
    /// Size of the file of codes, bytes.
    pub bytes: u64,
}

impl Encoded {
    /// Returns the length of the encoded signal, seconds.
    #[expect(clippy::cast_precision_loss, reason = "sample counts are far below 2^52")]
    pub fn signal_s(&self) -> f64 {
        self.stats.samples as f64 / f64::from(model::ADC_RATE_HZ)
    }
}

impl Encoding {
    /// Encodes the recording `input` to the file `output`, which holds the frames of a device from
    /// its start to the end of the recording. The codes equal those of `host-sim run` bit for bit.
    ///
    /// # Errors
    /// [`OfflineError`] if the recording cannot be read to its end, the file cannot be written, or
    /// [`Progress::interrupt`] was called. After an error, an existing output file is unchanged.
    pub fn encode(
        &self,
        input: &Path,
        output: &Path,
        progress: &Progress,
    ) -> Result<Encoded, OfflineError> {
        progress.check()?;
        let model = ModelId(model::MODEL_ID);
        match self.stream {
            EncodedStream::Packed(_) if model::PACKED.is_none() => {
                return Err(OfflineError::NoPackedCode(model));
            }
            EncodedStream::Codes if !model::HAS_NETWORK => {
                return Err(OfflineError::NoNetwork(model));
            }
            _ => {}
        }
        let mut played = Played::open(input, self.missing)?;
        let mut file = NewFile::create(output, self.existing, &[PathBuf::from(input)])?;
        let mut device = Device::new(self.mains, played.substitutes, self.stream);
        let mut bytes = 0;
        let mut write = |frames: Vec<u8>| {
            bytes += frames.len() as u64;
            file.write_all(&frames).map_err(OfflineError::write(output))
        };
        let mut samples = 0_u64;
        for counts in &mut played.adc {
            let counts =
                counts.map_err(|error| OfflineError::Recording(input.to_owned(), error))?;
            device.process(first_channels(counts));
            samples += 1;
            if samples.is_multiple_of(model::ADC_RATE_HZ.into()) {
                progress.add_second()?;
                if device.waiting_bytes() >= PIECE {
                    write(device.take_frames())?;
                }
            }
        }
        let stats = device.finish();
        let packed = matches!(self.stream, EncodedStream::Packed(_)).then(|| device.packed());
        let (made, [item, span], steps) = match packed {
            Some(packed) => (packed.blocks, ["packed block", "block"], model::HOP),
            None => (stats.codes_made.into(), ["code", "window"], model::STEPS),
        };
        if made == 0 {
            played.warnings.push(format!(
                "it is shorter than one {span} ({steps} steps at {} Hz) and yields no {item}",
                model::STEP_RATE_HZ
            ));
        }
        let adc = played.adc.counters();
        played.warnings.extend(adc.warnings());
        let blanks = packed.map_or(0, |packed| packed.blanks);
        if blanks > 0 {
            played.warnings.push(format!(
                "{blanks} packed blocks were too long and have no content; a higher --packed-rate makes them shorter"
            ));
        }
        write(device.take_frames())?;
        file.finish()?;
        Ok(Encoded {
            montage: played.montage,
            warnings: played.warnings,
            stats,
            packed,
            adc,
            bytes,
        })
    }
}

/// Counts over all packed blocks of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedCounts {
    /// Number of packed blocks in the file.
    pub blocks: u64,
    /// Total size of the blocks in bits, without the frames around them.
    pub bits: u64,
    /// Number of electrode values clipped to the range that the encoder's inputs can have.
    pub clipped: u64,
    /// Number of blocks that the model does not represent well. Blocks made while the filters
    /// settle do not count.
    pub misfits: u64,
    /// Number of blocks that were too long and have no content. Blocks made while the filters
    /// settle do not count.
    pub blanks: u64,
}

impl PackedCounts {
    pub(crate) fn add(&mut self, code: &PackedCode) {
        self.blocks += 1;
        self.bits += 8 * code.bytes().len() as u64;
        self.clipped += u64::from(code.clipped);
        self.misfits += u64::from(code.is_misfit && !code.settling);
        self.blanks += u64::from(code.is_blank && !code.settling);
    }
}
