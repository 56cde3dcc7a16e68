//! Window and code for an audit: the host computes the code again from the planes of the window,
//! and compares the planes with the packed blocks.

use link::Audit;
use model::{CELLS, CODE, HOP, STEP_RATE_HZ, STEPS};
use pipeline::{CodeValues, Plane};

use crate::message::{self, ValueBytes};

/// Time from one audit to the next, in seconds.
const PERIOD_S: u32 = 10;

/// Number of windows from one audit to the next.
#[expect(clippy::cast_possible_truncation, reason = "a hop is below 256")]
const PERIOD_WINDOWS: u32 = PERIOD_S * STEP_RATE_HZ as u32 / HOP as u32;

/// Planes (steps on the scalp grid) of the newest window; once the window is complete, also its
/// index and, on a device with the network, its code.
#[derive(Clone, Copy, Debug)]
pub struct AuditedWindow {
    window: u32,
    has_code: bool,
    values: CodeValues,
    planes: [u8; STEPS * CELLS],
}

impl AuditedWindow {
    /// State before the first plane: all zeros, so that it takes no flash.
    pub(crate) const EMPTY: Self = Self {
        window: 0,
        has_code: false,
        values: CodeValues::Int8([0; CODE]),
        planes: [0; STEPS * CELLS],
    };

    /// Appends the plane of a step and discards the oldest plane.
    pub(crate) fn push_plane(&mut self, plane: &Plane) {
        self.planes.copy_within(CELLS.., 0);
        let newest = &mut self.planes[(STEPS - 1) * CELLS..];
        for (place, cell) in newest.iter_mut().zip(plane) {
            *place = cell.cast_unsigned();
        }
    }

    /// Returns true if `window` is sent to the host as an audit: window 0, then one window every
    /// ten seconds.
    pub(crate) const fn is_due(window: u32) -> bool {
        window.is_multiple_of(PERIOD_WINDOWS)
    }

    /// Stores index and code of the window that consists of the stored planes; `values` is `None`
    /// on a device without the network.
    pub(crate) fn complete(&mut self, window: u32, values: Option<&CodeValues>) {
        self.window = window;
        self.has_code = values.is_some();
        if let Some(values) = values {
            self.values = *values;
        }
    }

    /// Builds the wire message, which borrows the planes and the bytes of the values.
    pub fn message<'b>(&'b self, model_id: [u8; 8], bytes: &'b mut ValueBytes) -> Audit<'b> {
        Audit {
            model_id,
            window: self.window,
            planes: &self.planes,
            values: if self.has_code {
                message::values(&self.values, bytes)
            } else {
                message::NO_VALUES
            },
        }
    }
}
