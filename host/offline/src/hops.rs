//! Codes, decoded to one continuous signal.

use artifact::Description;
use artifact::reconstruction::{HopLayout, Overlap, Source, Window, WindowDecoder, dequantise};
use link::Flags;

use crate::code_file::Announcement;

/// One hop of decoded steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DecodedHop<'a> {
    /// Index of the first row: the step since the start of the run.
    pub(crate) first_row: u64,
    /// Microvolts, all electrodes of the first step, then of the next.
    pub(crate) uv: &'a [f32],
    /// Flags of all windows that contain the hop. The filler flag marks values that stand for steps of which
    /// every code is missing: they repeat the last step.
    pub(crate) flags: Flags,
}

/// Decodes codes in the order of their windows. Each window completes one hop; after the last one,
/// [`Self::finish`] completes the others.
pub(crate) struct Hops<'d> {
    decoder: &'d WindowDecoder,
    announcement: &'d Announcement,
    electrodes: usize,
    /// Number of hops in a window.
    per_window: usize,
    overlap: Overlap,
    /// Number of windows decoded, missing ones included.
    windows: u32,
    z: Vec<f32>,
    uv: Vec<f32>,
}

impl<'d> Hops<'d> {
    /// Creates the decoder of a file.
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

    /// Decodes the code of the window with this index. Passes the hops of missing windows before it, and the hop that it completes, to
    /// `emit`.
    ///
    /// # Errors
    /// That of `emit`.
    pub(crate) fn decode<E>(
        &mut self,
        (index, flags): (u32, Flags),
        levels: &[i32],
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        while self.windows < index {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        let numbers = self
            .announcement
            .scale
            .iter()
            .zip(&self.announcement.zero_point);
        for (z, (level, (scale, zero_point))) in self.z.iter_mut().zip(levels.iter().zip(numbers)) {
            *z = dequantise(*level, *scale, *zero_point);
        }
        let values = self.decoder.decode(&self.z);
        self.complete(Some(values), flags, &mut emit)
    }

    /// Passes the last hops, which only windows decoded before contain, to `emit`.
    ///
    /// # Errors
    /// That of `emit`.
    pub(crate) fn finish<E>(
        mut self,
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        for _ in 1..self.per_window {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        Ok(())
    }

    fn complete<E>(
        &mut self,
        values: Option<Vec<f32>>,
        flags: Flags,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        let window = Window {
            index: self.windows,
            flags: flags.bits(),
            values,
        };
        let hop = self.overlap.next_hop(window, &mut self.uv);
        let mut flags = Flags::from_bits(hop.flags);
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
        emit(DecodedHop {
            first_row,
            uv: &self.uv,
            flags,
        })
    }
}
