//! Decodes codes and packed blocks to one continuous signal.

use artifact::reconstruction::{
    HopLayout, Overlap, PackedHop, PackedOverlap, PackedSource, Source, Window, WindowDecoder,
    dequantise,
};
use artifact::{Description, PackedModel};
use link::Flags;

use crate::code_file::Announcement;
use crate::error::OfflineError;

/// One hop of decoded steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DecodedHop<'a> {
    /// Index of the hop's first row, counted from the first row of the decoded signal; a row is a
    /// step.
    pub(crate) first_row: u64,
    /// Microvolts: the values of all electrodes at the first step, then at the next, and so on.
    pub(crate) uv: &'a [f32],
    /// Combined flags of all windows that contain the hop. `FILLER` marks a hop for which every
    /// code is missing: its values repeat the last step before it, or are predicted. `HEALING`
    /// marks a hop that is less exact because codes are missing.
    pub(crate) flags: Flags,
}

/// Decodes codes in the order of their windows. Each window completes one hop; after the last
/// window, [`Self::finish`] completes the remaining hops.
pub(crate) struct Hops<'d> {
    decoder: &'d WindowDecoder,
    announcement: &'d Announcement,
    electrodes: usize,
    /// Number of hops in a window.
    per_window: usize,
    overlap: Overlap,
    /// Number of windows decoded, including missing windows.
    windows: u32,
    /// Dequantised values of the code that is being decoded.
    z: Vec<f32>,
    /// Values of the hop that is passed to `emit`, microvolts.
    uv: Vec<f32>,
}

impl<'d> Hops<'d> {
    /// Creates the decoder of a file whose device sent `announcement`.
    pub(crate) fn new(
        decoder: &'d WindowDecoder,
        description: &Description,
        announcement: &'d Announcement,
    ) -> Self {
        let electrodes = description.montage.electrodes.len();
        let window = &description.window;
        Self {
            decoder,
            announcement,
            electrodes,
            per_window: window.steps / window.hop,
            overlap: Overlap::new(HopLayout {
                steps: window.hop,
                electrodes,
                low_latency: false,
                full_scale_uv: announcement.full_scale_uv,
            }),
            windows: 0,
            z: vec![0.0; announcement.scale.len()],
            uv: vec![0.0; window.hop * electrodes],
        }
    }

    /// Decodes the code of the window with this index. Passes to `emit` the hops of missing windows
    /// before the window, and the hop that the window completes.
    pub(crate) fn decode(
        &mut self,
        (index, flags): (u32, Flags),
        levels: &[i32],
        mut emit: impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        while self.windows < index {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        let numbers = self.announcement.scale.iter().zip(&self.announcement.zero_point);
        for (z, (level, (scale, zero_point))) in self.z.iter_mut().zip(levels.iter().zip(numbers)) {
            *z = dequantise(*level, *scale, *zero_point);
        }
        let values = self.decoder.decode(&self.z);
        self.complete(Some(values), flags, &mut emit)
    }

    /// Passes the remaining hops of the last window to `emit`.
    pub(crate) fn finish(
        mut self,
        mut emit: impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        for _ in 1..self.per_window {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        Ok(())
    }

    /// Completes one hop with the next window, and passes the hop to `emit`. `values` are the
    /// decoded values of the window, microvolts; `None` for a missing window.
    fn complete(
        &mut self,
        values: Option<Vec<f32>>,
        flags: Flags,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        let window = Window { index: self.windows, flags: flags.bits(), values };
        let hop = self.overlap.next_hop(window, &mut self.uv);
        let mut flags = Flags::from_bits(hop.flags);
        if hop.source != Source::Missing && !hop.is_whole {
            flags |= Flags::HEALING;
        }
        if hop.source == Source::Missing {
            flags |= Flags::FILLER;
            let last = self.uv.len() - self.electrodes;
            for step in 0..last / self.electrodes {
                self.uv.copy_within(last.., step * self.electrodes);
            }
        }
        let rows = (self.uv.len() / self.electrodes) as u64;
        let first_row = u64::from(self.windows) * rows;
        self.windows += 1;
        emit(DecodedHop { first_row, uv: &self.uv, flags })
    }
}

/// Decodes packed blocks in their order. Each block also corrects, and so completes, the hop of the
/// block before it; [`Self::finish`] completes the hop of the last block.
pub(crate) struct PackedHops {
    overlap: PackedOverlap<Label>,
    /// Number of rows of a hop.
    rows: u64,
    /// Index of the packed block that is expected next.
    next: u32,
}

#[derive(Clone, Copy)]
struct Label {
    index: u32,
    flags: Flags,
}

impl PackedHops {
    /// Creates the decoder of a file whose device has the full scale `full_scale_uv`, microvolts.
    pub(crate) fn new(model: &PackedModel, description: &Description, full_scale_uv: f32) -> Self {
        Self {
            overlap: PackedOverlap::new(model, false, full_scale_uv),
            rows: description.window.hop as u64,
            next: 0,
        }
    }

    /// Decodes the block with this index. Passes to `emit` the hops of missing blocks before the
    /// block, and the hop that the block completes. A malformed block is replaced like a missing
    /// one, and counted.
    pub(crate) fn decode(
        &mut self,
        (index, flags): (u32, Flags),
        block: (&[u8], u8),
        mut emit: impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        while self.next < index {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        self.complete(Some(block), flags, &mut emit)
    }

    /// Passes the hop of the last block to `emit`. Returns the number of malformed blocks.
    pub(crate) fn finish(
        mut self,
        mut emit: impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<u64, OfflineError> {
        if let Some(hop) = self.overlap.finish() {
            self.pass_on(&hop, &mut emit)?;
        }
        Ok(self.overlap.malformed())
    }

    /// Decodes the next block, and passes the hop that the block completes to `emit`. `block` is
    /// `None` if the block is missing.
    fn complete(
        &mut self,
        block: Option<(&[u8], u8)>,
        flags: Flags,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        let label = Label { index: self.next, flags };
        self.next += 1;
        match self.overlap.next_hop(block, label) {
            Some(hop) => self.pass_on(&hop, emit),
            None => Ok(()),
        }
    }

    /// Passes a decoded hop to `emit`, with the flags of its block. Adds `FILLER` to a predicted
    /// hop, and `HEALING` while the decoder's state differs from the device's after a lost block.
    fn pass_on(
        &self,
        hop: &PackedHop<Label>,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), OfflineError>,
    ) -> Result<(), OfflineError> {
        let Label { index, flags } = hop.label;
        let flags = match hop.source {
            PackedSource::Block => flags,
            PackedSource::Healing => flags | Flags::HEALING,
            PackedSource::Prediction => flags | Flags::FILLER,
        };
        emit(DecodedHop { first_row: u64::from(index) * self.rows, uv: &hop.microvolts, flags })
    }
}
