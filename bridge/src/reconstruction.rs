//! From codes back to electrodes.

use std::sync::Arc;

use link::{CODE_LEN, Flags};
use neuro_ros::{NeuroFrame, Stamp};

use crate::tri::TriWords;
use crate::{Device, FillerPolicy, Model, Settings};

/// Weight of the older of two windows at the first and at the last step that they share.
///
/// Least-squares weights per time step for the built-in model on EEGMMIDB S001 R11 and R12 (held
/// out; float codes) are 0.37 0.42 0.46 0.38 0.65 0.56 0.59 0.61; this is the line through them. A
/// window's ends are reconstructed better than its middle: the older one is at its middle at the
/// first shared step and at its end at the last. Normalised error there: one window alone
/// 0.01034, plain mean 0.00971, this line 0.00968, the eight fitted weights 0.00968.
const OLDER_WEIGHT: [f32; 2] = [0.37, 0.63];

/// One window on its way to the decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// The code, dequantised; `None` if it was lost.
    pub z: Option<Box<[f32; CODE_LEN]>>,
    /// Stamp of the frame that this window completes.
    pub stamp: Stamp,
    /// Its status.
    pub words: TriWords,
}

/// Turns windows into frames of `/neurodata_reconstructed`: one frame of `hop` steps per window.
#[derive(Debug)]
pub struct Reconstruction {
    model: Arc<Model>,
    low_latency: bool,
    filler: FillerPolicy,
    hop: usize,
    electrodes: usize,
    full_scale_uv: f32,
    /// The previous window in microvolts, unless it was lost.
    previous: Option<Vec<f32>>,
    frame: NeuroFrame,
}

impl Reconstruction {
    /// For a device that the model fits ([`Model::objection`]).
    pub fn new(device: &Device, model: Arc<Model>, settings: Settings) -> Reconstruction {
        #[expect(clippy::cast_possible_truncation, reason = "a bound, 187500")]
        let full_scale_uv = device.full_scale_uv as f32;
        Reconstruction {
            model,
            low_latency: settings.low_latency,
            filler: settings.filler,
            hop: usize::from(device.hop_steps),
            electrodes: device.labels.len(),
            full_scale_uv,
            previous: None,
            frame: device.reconstructed_frame(),
        }
    }

    /// Steps from the first step of the frame that a window completes to the window's last step.
    pub(crate) fn reach(device: &Device, low_latency: bool) -> u32 {
        let steps = if low_latency {
            device.hop_steps
        } else {
            device.window_steps
        };
        u32::from(steps) - 1
    }

    /// The frame that `window` completes: its own last `hop` steps (low latency), or the `hop`
    /// steps that it shares with the window before. `None` if there is nothing to say and lost
    /// codes are not filled.
    pub fn push(&mut self, window: &Window) -> Option<&NeuroFrame> {
        let decoded = window.z.as_ref().map(|z| self.model.decode(z));
        let values = self.hop * self.electrodes;
        let data = &mut self.frame.eeg.data;
        let mut words = window.words;
        words.flags &= !Flags::FILLER.bits();
        // The window before began one hop earlier, so this one begins at its second hop.
        let shared = self
            .previous
            .as_ref()
            .and_then(|old| old.get(values..2 * values));
        match (&decoded, shared) {
            (Some(new), _) if self.low_latency => {
                data.copy_from_slice(&new[new.len() - values..]);
            }
            (Some(new), Some(old)) => average(old, new, self.electrodes, data),
            (Some(new), None) => data.copy_from_slice(&new[..values]),
            // A window lost: the one before still tells of the half that they share.
            (None, Some(old)) if !self.low_latency => data.copy_from_slice(old),
            (None, _) => {
                words.flags |= Flags::FILLER.bits();
                match self.filler {
                    FillerPolicy::Off => {
                        self.previous = None;
                        return None;
                    }
                    FillerPolicy::Zeros => data.fill(0.0),
                    FillerPolicy::Last => hold_last_step(data, self.electrodes),
                }
            }
        }
        for value in data.iter_mut() {
            // What lies beyond the announced range reads back as infinite from a recording.
            *value = value.clamp(-self.full_scale_uv, self.full_scale_uv);
        }
        self.previous = decoded;
        self.number(window.stamp, &words);
        Some(&self.frame)
    }

    fn number(&mut self, stamp: Stamp, words: &TriWords) {
        let frame = &mut self.frame;
        frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
        frame.header.seq = frame.neuroheader.seq;
        frame.header.stamp = stamp;
        for row in frame.tri.data.chunks_exact_mut(8) {
            row.copy_from_slice(&words.words());
        }
    }
}

/// The weighted mean of the older window's last steps and the newer one's first.
fn average(old: &[f32], new: &[f32], electrodes: usize, out: &mut [f32]) {
    let steps = out.len() / electrodes;
    let rows = old
        .chunks_exact(electrodes)
        .zip(new.chunks_exact(electrodes));
    for (step, (out, (old, new))) in out.chunks_exact_mut(electrodes).zip(rows).enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "a few steps")]
        let along = step as f32 / (steps - 1).max(1) as f32;
        let weight = OLDER_WEIGHT[0] + (OLDER_WEIGHT[1] - OLDER_WEIGHT[0]) * along;
        for (out, (old, new)) in out.iter_mut().zip(old.iter().zip(new)) {
            *out = weight * old + (1.0 - weight) * new;
        }
    }
}

fn hold_last_step(data: &mut [f32], electrodes: usize) {
    let last = data.len() - electrodes;
    for step in 0..data.len() / electrodes - 1 {
        data.copy_within(last.., step * electrodes);
    }
}
