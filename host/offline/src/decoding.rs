//! Decodes a file of codes to a file of signals.

use std::{
    fs::File,
    path::{Path, PathBuf},
};

use artifact::Description;
use new_file::{Existing, NewFile};
use pipeline::Mains;
use recordings::Missing;

use crate::code_file::{CodeFile, CodeFileError, CodeKind, Content};
use crate::comparison::{Comparing, Comparison};
use crate::error::OfflineError;
use crate::histogram::LevelHistogram;
use crate::hops::{DecodedHop, Hops, PackedHops};
use crate::model::Model;
use crate::played::{Original, Played};
use crate::progress::Progress;
use crate::row_events::RowEvents;
use crate::signal_file::{self, RowEvent, Signal, SignalFormat};
use crate::survey::Survey;

/// Length of the excerpt that is kept for a picture, seconds.
const EXCERPT_S: u64 = 4;
/// Largest permitted difference between the lengths of a recording and of its decoded signal,
/// seconds. The decoded signal is shorter, because the last samples of the recording do not fill a
/// hop.
const LENGTH_TOLERANCE_S: f64 = 0.5;

/// Options for decoding files of codes.
#[derive(Debug)]
pub struct Decoding<'m> {
    /// Model with which the codes were made, and which decodes them.
    pub model: &'m Model,
    /// Format of the files to write.
    pub format: SignalFormat,
    /// Kind of codes to decode if a file holds both kinds; `None` for the kind that comes first.
    pub kind: Option<CodeKind>,
    /// Whether the output replaces a file of the same name.
    pub existing: Existing,
}

/// Result of decoding one file of codes.
#[derive(Debug, Clone)]
pub struct Decoded {
    /// Number of codes, or of packed blocks, that were decoded.
    pub codes: u64,
    /// Total number of bits of the packed blocks; `None` for codes of the network.
    pub packed_bits: Option<u64>,
    /// Number of missing codes or packed blocks. Steps that lie only in windows without a code
    /// repeat the last values before them; a missing block is predicted.
    pub missing: u64,
    /// Number of frames whose content is lost because they are damaged.
    pub damaged: u32,
    /// Number of rows, one for each step of the signal.
    pub rows: u64,
    /// Rows per second, Hz.
    pub rate_hz: u32,
    /// Number of values that were limited to the range of the file's format.
    pub limited: u64,
    /// Texts of the recording's events, each with the type that stands for it in a GDF file; empty
    /// for other formats.
    pub event_types: Vec<(String, u16)>,
    /// Defects of the original recording, differences between it and the codes, and malformed
    /// blocks, one sentence each.
    pub warnings: Vec<String>,
    /// Histogram of the codes' values.
    pub levels: LevelHistogram,
    /// Comparison with the original recording; `None` without one.
    pub comparison: Option<Comparison>,
}

impl Decoded {
    /// Returns whether packed blocks, of one hop each, were decoded instead of network codes.
    pub const fn is_packed(&self) -> bool {
        self.packed_bits.is_some()
    }

    /// Returns the mean length of the packed blocks, bits; `None` for codes of the network.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 bits")]
    pub fn bits_per_block(&self) -> Option<f64> {
        self.packed_bits.map(|bits| bits as f64 / self.codes.max(1) as f64)
    }

    /// Returns the length of the signal, seconds.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows")]
    pub fn signal_s(&self) -> f64 {
        self.rows as f64 / f64::from(self.rate_hz)
    }
}

impl Decoding<'_> {
    /// Decodes the file of codes `input` to the file `output`. `original` is the recording from
    /// which the codes were made: its events are written to the output, and its signal is compared
    /// with the decoded one.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be read or written, or [`Progress::interrupt`] was called.
    /// After an error, an existing output file is unchanged.
    pub fn decode(
        &self,
        input: &Path,
        output: &Path,
        original: Option<&Path>,
        progress: &Progress,
    ) -> Result<Decoded, OfflineError> {
        progress.check()?;
        let unusable = |error| OfflineError::Codes(input.to_owned(), error);
        let description = &self.model.description;
        let survey = self.open(input).and_then(|file| Survey::new(file, description));
        let survey = survey.map_err(unusable)?;
        let inputs = [Some(input), original].into_iter().flatten();
        let inputs: Vec<PathBuf> = inputs.map(PathBuf::from).collect();
        let file = NewFile::create(output, self.existing, &inputs)?;
        let original = original.map(|path| self.open_original(path, input, &survey));
        let original = original.transpose()?;
        let played = original.as_ref().map(|original| &original.played);
        let mut events = RowEvents::new(played.map(|played| &played.onsets), &survey, description);
        if self.format == SignalFormat::Gdf {
            events.assign_types();
        }
        let mut warnings = played.map_or_else(Vec::new, |played| played.warnings.clone());
        for (count, why) in [
            (events.outside, "they are outside the decoded signal"),
            (
                events.untyped,
                "a GDF file has no types for more than 254 different texts; --to edf, bdf, csv and npz \
                 keep the texts",
            ),
        ] {
            if count > 0 {
                warnings.push(format!("{count} events are left out: {why}"));
            }
        }
        warnings.extend(left_out_warning(&survey));
        warnings.extend(exclusion_warning(&survey, description));
        warnings.extend(played.and_then(|played| length_warning(played, &survey, description)));
        let signal = self.signal(&survey, events.rows);
        let failed = OfflineError::write(output);
        let handle = file.handle().map_err(&failed)?;
        let mut writer = signal_file::create(self.format, handle, &signal).map_err(&failed)?;
        let mut comparing = original.map(|original| comparing(original, &survey, description));
        let mut levels = LevelHistogram::new(survey.announcement.levels.clone());
        let mut hops = Hops::new(&self.model.decoder, description, &survey.announcement);
        let mut packed_hops = self.packed_hops(&survey).map_err(unusable)?;
        let mut emit = |hop: DecodedHop| {
            let rows = u64::from(signal.rows_per_hop);
            let rate_hz = u64::from(signal.rate_hz);
            if (hop.first_row + rows) / rate_hz > hop.first_row / rate_hz {
                progress.add_second()?;
            }
            if let Some(comparing) = &mut comparing {
                comparing.add(&hop)?;
            }
            writer.write_hop(hop.uv, hop.flags).map_err(&failed)
        };
        let mut codes = self.open(input).map_err(unusable)?;
        let mut bits = 0;
        while let Some(code) = codes.next_code().map_err(unusable)? {
            let place = (code.window, code.flags);
            match (code.content, &mut packed_hops) {
                (Content::Levels(values), _) => {
                    levels.add(&values);
                    hops.decode(place, &values, &mut emit)?;
                }
                (Content::Block { bytes, rate }, Some(hops)) => {
                    bits += 8 * bytes.len() as u64;
                    hops.decode(place, (&bytes, rate), &mut emit)?;
                }
                (Content::Block { .. }, None) => {}
            }
        }
        let malformed = match packed_hops {
            Some(hops) => hops.finish(&mut emit)?,
            None => hops.finish(&mut emit).map(|()| 0)?,
        };
        if malformed > 0 {
            warnings.push(format!(
                "{malformed} packed blocks are malformed, and predictions are in their place; decode the file \
                 with the release that wrote it"
            ));
        }
        let adc = comparing.as_ref().map(Comparing::adc_counters);
        let of_original = adc.unwrap_or_default().warnings().into_iter();
        warnings.extend(of_original.map(|warning| format!("original: {warning}")));
        let limited = writer.finish().map_err(&failed)?;
        file.finish()?;
        Ok(Decoded {
            codes: survey.codes,
            packed_bits: (survey.kind == CodeKind::Packed).then_some(bits),
            missing: survey.missing(),
            damaged: survey.damaged,
            rows: signal.rows,
            rate_hz: signal.rate_hz,
            limited,
            event_types: events.types,
            warnings,
            levels,
            comparison: comparing.map(Comparing::finish),
        })
    }

    /// Returns the decoder of a file with packed blocks; `None` for codes of the network.
    fn packed_hops(&self, survey: &Survey) -> Result<Option<PackedHops>, CodeFileError> {
        if survey.kind == CodeKind::Codes {
            return Ok(None);
        }
        let packed = self.model.packed.as_ref();
        let packed = packed.ok_or(CodeFileError::NotPacked(self.model.id))?;
        let full_scale_uv = survey.announcement.full_scale_uv;
        Ok(Some(PackedHops::new(packed, &self.model.description, full_scale_uv)))
    }

    /// Describes the decoded signal for the file that is written.
    fn signal<'s>(&'s self, survey: &'s Survey, events: Vec<RowEvent>) -> Signal<'s> {
        let description = &self.model.description;
        Signal {
            labels: &description.montage.electrodes,
            rate_hz: description.window.rate_hz,
            rows_per_hop: u32::try_from(description.window.hop).unwrap_or(u32::MAX),
            rows: survey.rows(description),
            group_delay_us: survey.announcement.group_delay_us,
            full_scale_uv: survey.announcement.full_scale_uv,
            exclusions: &survey.exclusions,
            events,
            description: format!("Corticode model {}", self.model.id),
        }
    }

    fn open(&self, input: &Path) -> Result<CodeFile<File>, CodeFileError> {
        if !input.metadata()?.is_file() {
            return Err(CodeFileError::NoFile);
        }
        let windows_per_hour = windows_per_hour(&self.model.description);
        Ok(CodeFile::new(File::open(input)?, self.model.id, self.kind, windows_per_hour))
    }

    fn open_original(
        &self,
        path: &Path,
        codes: &Path,
        survey: &Survey,
    ) -> Result<Original, OfflineError> {
        if !self.model.is_built_in() {
            return Err(OfflineError::OtherOriginal(path.to_owned(), self.model.id));
        }
        let mains_hz = survey.announcement.mains_hz;
        let mains = Mains::from_hz(mains_hz)
            .ok_or_else(|| OfflineError::Codes(codes.to_owned(), CodeFileError::Mains(mains_hz)))?;
        // Treat missing electrodes as the device did when it encoded the recording.
        let missing = if survey.announcement.substitutes.zero == 0 {
            Missing::Interpolate
        } else {
            Missing::Zero
        };
        Original::open(path, mains, missing)
    }
}

/// Returns a warning if the file holds codes of both kinds.
fn left_out_warning(survey: &Survey) -> Option<String> {
    let ((decoded, _), (others, name)) = (survey.kind.names(), survey.kind.other().names());
    (survey.left_out > 0).then(|| {
        format!(
            "the file holds {} {others} too, and its {decoded} are decoded; --stream {name} decodes the others",
            survey.left_out
        )
    })
}

/// Returns a warning that names the electrodes that the device excluded, if there are any.
fn exclusion_warning(survey: &Survey, description: &Description) -> Option<String> {
    let labels = &description.montage.electrodes;
    let stretches = (survey.exclusions).stretches(labels.len(), survey.rows(description));
    let rate_hz = f64::from(description.window.rate_hz);
    let excluded = stretches.chunk_by(|a, b| a.electrode == b.electrode);
    let excluded = excluded.map(|of| {
        let rows: u64 = of.iter().map(|stretch| stretch.rows.end - stretch.rows.start).sum();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows")]
        let seconds = rows as f64 / rate_hz;
        format!("{} for {seconds:.1} s", labels[of[0].electrode])
    });
    let excluded: Vec<String> = excluded.collect();
    (!excluded.is_empty()).then(|| {
        format!(
            "the device excluded electrodes and filled them from the others: {}; their error leaves \
             this time out",
            excluded.join(", ")
        )
    })
}

/// Returns a warning if the original and the decoded signal differ in length by too much.
fn length_warning(played: &Played, survey: &Survey, description: &Description) -> Option<String> {
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 samples")]
    let recorded_s = played.adc.samples() as f64 / f64::from(::model::ADC_RATE_HZ);
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows")]
    let decoded_s = survey.rows(description) as f64 / f64::from(description.window.rate_hz);
    ((recorded_s - decoded_s).abs() > LENGTH_TOLERANCE_S).then(|| {
        format!(
            "the original is {recorded_s:.1} s long and the decoded signal {decoded_s:.1} s: are the codes \
             complete, and those of this recording?"
        )
    })
}

/// Starts the comparison of a file of codes with its recording.
fn comparing(original: Original, survey: &Survey, description: &Description) -> Comparing {
    let rows = survey.rows(description);
    let excerpt = (EXCERPT_S * u64::from(description.window.rate_hz)).min(rows);
    let first = (rows - excerpt) / 2;
    let electrodes = description.montage.electrodes.len();
    let exclusions = survey.exclusions.clone();
    Comparing::new(original, exclusions, electrodes, first..first + excerpt)
}

fn windows_per_hour(description: &Description) -> u32 {
    let hop = u32::try_from(description.window.hop).unwrap_or(1).max(1);
    3_600 * description.window.rate_hz / hop
}
