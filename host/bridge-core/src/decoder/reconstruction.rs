//! Reconstruction of the electrode signals from codes.

use std::sync::Arc;

use artifact::reconstruction::{HopLayout, Overlap, Source, Window};
use link::Flags;
use neuro_ros::{NeuroFrame, Stamp, TriWords};

use crate::decoder::model::Model;
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};

/// Input of the decoder: a received code, or a placeholder for a lost code, with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedCode {
    /// Dequantised values of the code; `None` if the code was lost.
    pub z: Option<Vec<f32>>,
    /// Stamp of the `/neurodata_reconstructed` frame that this code completes.
    pub stamp: Stamp,
    /// Status words of the code. The published frame has the flags of this window and of the
    /// earlier windows that share its steps.
    pub words: TriWords,
}

/// Decodes codes to frames of `/neurodata_reconstructed`. Each code completes one frame, which
/// holds one hop of steps.
#[derive(Debug)]
pub struct Reconstruction {
    model: Arc<Model>,
    filler: FillerPolicy,
    electrodes: usize,
    /// Number of values in a decoded window: steps times electrodes.
    window_values: usize,
    overlap: Overlap,
    frame: NeuroFrame,
}

impl Reconstruction {
    /// Creates a reconstruction for a device whose codes `model` can decode ([`Model::objection`]
    /// returns `None`).
    pub fn new(device: &Device, model: Arc<Model>, settings: Settings) -> Reconstruction {
        #[expect(clippy::cast_possible_truncation, reason = "187500, exact in f32")]
        let full_scale_uv = device.full_scale_uv as f32;
        let electrodes = device.labels.len();
        Reconstruction {
            model,
            filler: settings.filler,
            electrodes,
            window_values: usize::from(device.window_steps) * electrodes,
            overlap: Overlap::new(HopLayout {
                steps: usize::from(device.hop_steps),
                electrodes,
                low_latency: settings.low_latency,
                full_scale_uv,
            }),
            frame: device.reconstructed_frame(),
        }
    }

    /// Returns the number of steps from a frame's first step to the last step of the window that
    /// completes the frame.
    pub fn lookback_steps(device: &Device, low_latency: bool) -> u32 {
        let steps = [device.window_steps, device.hop_steps].map(u32::from);
        HopLayout::lookback_steps(steps[0], steps[1], low_latency)
    }

    /// Sets the sequence number of the newest published frame; the next frame gets the next number.
    pub(crate) fn set_number(&mut self, number: u32) {
        self.frame.header.seq = number;
        self.frame.neuroheader.seq = number;
    }

    /// Returns the sequence number of the newest frame.
    pub(crate) fn number(&self) -> u32 {
        self.frame.neuroheader.seq
    }

    /// Continues the sequence numbers of `before`, the previous device's reconstruction, and takes
    /// over that reconstruction's last values for fillers. The frames of both must have the same
    /// shape.
    pub fn continue_from(&mut self, before: &Reconstruction) {
        self.set_number(before.number());
        self.frame.eeg.data.clone_from(&before.frame.eeg.data);
    }

    /// Skips a window whose frame nobody receives: increments the sequence number, but decodes
    /// nothing. Forgets the earlier windows, so the next frame is decoded from one window alone.
    pub(crate) fn skip_frame(&mut self) {
        self.overlap.forget();
        self.count_frame();
    }

    /// Returns the frame that `window` completes. With low latency it holds the window's last hop
    /// of steps; otherwise the first hop, which the window shares with earlier windows. Returns
    /// `None` if no code with these steps was received and the user wants no fillers.
    pub fn next_frame(&mut self, window: &TimedCode) -> Option<&NeuroFrame> {
        let decoded = window.z.as_ref().map(|z| self.model.decode(z));
        self.frame_of(window, decoded)
    }

    /// Returns the frame that [`Self::next_frame`] would return, with correct times and flags but
    /// meaningless values, because nothing is decoded. For a caller that needs no values.
    pub fn next_times(&mut self, window: &TimedCode) -> Option<&NeuroFrame> {
        let values = window.z.as_ref().map(|_| vec![0.0; self.window_values]);
        self.frame_of(window, values)
    }

    /// Returns the frame that a window with the decoded values `decoded` completes; `None` if no
    /// code with the frame's steps was received and the user wants no fillers.
    fn frame_of(&mut self, window: &TimedCode, decoded: Option<Vec<f32>>) -> Option<&NeuroFrame> {
        let data = &mut self.frame.eeg.data;
        let mut words = window.words;
        words.flags &= !Flags::FILLER.bits();
        let hop = self
            .overlap
            .next_hop(Window { index: words.window, flags: words.flags, values: decoded }, data);
        words.flags = hop.flags;
        if hop.source != Source::Missing && !hop.is_whole {
            words.flags |= Flags::HEALING.bits();
        }
        if hop.source == Source::Missing {
            words.flags |= Flags::FILLER.bits();
            match self.filler {
                FillerPolicy::Off => return None,
                FillerPolicy::Zeros => data.fill(0.0),
                FillerPolicy::Last => hold_last_step(data, self.electrodes),
            }
        }
        self.finish_frame(window.stamp, &words);
        Some(&self.frame)
    }

    fn count_frame(&mut self) {
        let header = &mut self.frame.neuroheader;
        header.seq = header.seq.wrapping_add(1);
        self.frame.header.seq = header.seq;
    }

    fn finish_frame(&mut self, stamp: Stamp, words: &TriWords) {
        self.count_frame();
        let frame = &mut self.frame;
        frame.header.stamp = stamp;
        for row in frame.tri.data.chunks_exact_mut(8) {
            row.copy_from_slice(&words.words());
        }
    }
}

/// Overwrites all steps in `data` with the values of the last step; a step has `electrodes` values.
fn hold_last_step(data: &mut [f32], electrodes: usize) {
    let last = data.len() - electrodes;
    for step in 0..data.len() / electrodes - 1 {
        data.copy_within(last.., step * electrodes);
    }
}
