//! A simulated acquisition: frames of synthetic EEG, and the codes of a recording of them.

use std::io::Cursor;

use artifact::classifier::Classifier;
use artifact::reconstruction::dequantise;
use neuro_ros::{Header, NeuroDataFloat, NeuroDataInfo, NeuroFrame, NeuroHeader, Stamp};
use pipeline::{
    ExclusionPolicy, FeatureExtractor, FeatureFilters, Features, Mains, Pipeline, Sample,
    Substitution,
};
use recordings::{AdcSpec, FileToWrite, GdfWriter, Missing, MontageMap, Recording, VirtualAdc};

/// A simulated acquisition, whose frames are computed on request.
#[derive(Clone)]
pub(crate) struct Acquisition {
    pub(crate) rate_hz: u16,
    pub(crate) samples: u16,
    pub(crate) labels: Vec<String>,
}

impl Acquisition {
    /// Returns an acquisition with all electrodes of the model, in the order of the montage.
    pub(crate) fn new(rate_hz: u16, samples: u16) -> Acquisition {
        let labels = model::LABELS.split(' ').map(str::to_owned).collect();
        Acquisition { rate_hz, samples, labels }
    }

    /// Returns the frame with the index `index`, counted from 0; its `seq` is `index` + 1.
    pub(crate) fn frame(&self, index: u32) -> NeuroFrame {
        let channels = u16::try_from(self.labels.len()).unwrap();
        let samples = u32::from(self.samples);
        let seconds = f64::from(index * samples) / f64::from(self.rate_hz);
        NeuroFrame {
            header: Header {
                #[expect(clippy::cast_possible_truncation, reason = "a minute")]
                stamp: Stamp::from_nanoseconds(1_700_000_000_000_000_000 + (seconds * 1e9) as i64),
                ..Header::default()
            },
            neuroheader: NeuroHeader { seq: index + 1 },
            sr: self.rate_hz,
            eeg: NeuroDataFloat {
                info: NeuroDataInfo {
                    nsamples: self.samples,
                    nchannels: channels,
                    stride: channels * 4,
                    unit: "uV".to_owned(),
                    labels: self.labels.clone(),
                    minmax: vec![-187_500.0, 187_500.0],
                    ..NeuroDataInfo::default()
                },
                data: self.values(index * samples, samples),
            },
            ..NeuroFrame::default()
        }
    }

    /// Returns `samples` samples of all channels, beginning with the sample of index `first`, uV.
    /// Each channel has an alpha rhythm, drift and noise.
    fn values(&self, first: u32, samples: u32) -> Vec<f32> {
        let rows = first..first + samples;
        let values = rows.flat_map(|row| {
            let seconds = f64::from(row) / f64::from(self.rate_hz);
            (0_u32..).zip(&self.labels).map(move |(channel, _)| {
                let phase = f64::from(channel);
                let mut hash = (row * 977 + channel).wrapping_mul(2_654_435_761);
                hash ^= hash >> 15;
                let noise = f64::from(hash.wrapping_mul(2_246_822_519) >> 16) / 4096.0;
                let alpha = 30.0 * (62.8 * seconds + phase).sin();
                #[expect(clippy::cast_possible_truncation, reason = "about 100 uV")]
                let value = (50.0 * (0.5 * seconds + phase).cos() + alpha + noise) as f32;
                value
            })
        });
        values.collect()
    }

    /// Returns the dequantised codes that host-sim makes of a recording of `frames` frames.
    pub(crate) fn codes_of_recording(&self, frames: u32, mains: Mains) -> Vec<Vec<f32>> {
        let mut pipeline = Pipeline::new(mains);
        let samples = self.samples_of_recording(frames);
        let codes = samples.filter_map(|sample| pipeline.encode_sample(&sample));
        codes.map(|code| dequantised(&code.values)).collect()
    }

    /// Returns the features of a recording of the first `frames` frames, at 50 Hz mains.
    pub(crate) fn features(&self, frames: u32, classifier: &Classifier) -> Vec<Features> {
        let weights = classifier.weight_bytes();
        let filters = FeatureFilters::new(classifier.id(), classifier.band.sections, &weights);
        let mut extractor = FeatureExtractor::NEW;
        extractor.set_filters(filters.unwrap());
        let mut acquisition = Box::new(pipeline::Acquisition::new(Mains::Hz50));
        let mut substitution = Box::new(Substitution::NEW);
        let samples = self.samples_of_recording(frames);
        let made = samples.filter_map(|sample| {
            substitution.observe_sample(&sample);
            let mut step = acquisition.process_sample(&sample)?;
            if let Some(table) = &model::SUBSTITUTION {
                substitution.fill_step(&mut step, ExclusionPolicy::AUTOMATIC, table);
            }
            extractor.add_step(&step)
        });
        made.collect()
    }

    /// Returns the samples that host-sim reads from a recording of the first `frames` frames.
    fn samples_of_recording(&self, frames: u32) -> impl Iterator<Item = Sample> {
        let range = [-187_500.0, 187_500.0];
        let [rate_hz, rows] = [self.rate_hz, self.samples].map(u32::from);
        let file = FileToWrite::microvolts(&self.labels, range, rate_hz, rows);
        let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &file).unwrap();
        for index in 0..frames {
            writer.write_record(&self.frame(index).eeg.data).unwrap();
        }
        let bytes = writer.finish(&[]).unwrap().into_inner();
        let recording = Recording::from_source(Cursor::new(bytes)).unwrap();
        let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
        let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate).unwrap();
        // Rate and microvolts per count as in host-sim's virtual ADC.
        let spec = AdcSpec {
            rate_hz: model::ADC_RATE_HZ.into(),
            lsb_uv: f64::from(model::LSB_NV) / 1_000.0,
        };
        let samples = VirtualAdc::new(recording, &map, spec).unwrap();
        samples.map(|counts| {
            // The virtual ADC can have more channels than a sample. Leave out the excess channels.
            let counts = counts.unwrap();
            Sample { counts: std::array::from_fn(|channel| counts[channel]) }
        })
    }
}

fn dequantised(values: &pipeline::CodeValues) -> Vec<f32> {
    let scales = model::CODE_SCALE.iter().zip(&model::CODE_ZERO_POINT);
    let levels = values.levels().into_iter().zip(scales);
    levels.map(|(level, (scale, zero_point))| dequantise(level, *scale, *zero_point)).collect()
}
