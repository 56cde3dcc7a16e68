//! The newest window of planes.

use link::Audit;
use model::{CELLS, CODE, HOP, STEP_RATE_HZ, STEPS};
use pipeline::{CodeValues, Plane};

use crate::message;

/// Seconds from one audit to the next.
const EVERY_S: u32 = 10;

/// Windows from one audit to the next.
#[expect(clippy::cast_possible_truncation, reason = "a hop is below 256")]
const EVERY: u32 = EVERY_S * STEP_RATE_HZ as u32 / HOP as u32;

/// The planes of the newest window, and its code when there is one.
#[derive(Clone, Debug)]
pub struct AuditedWindow {
    window: u32,
    values: CodeValues,
    planes: [u8; STEPS * CELLS],
}

impl AuditedWindow {
    /// Silence.
    pub(crate) const EMPTY: Self = Self {
        window: 0,
        values: CodeValues::Int8([0; CODE]),
        planes: [0; STEPS * CELLS],
    };

    /// Takes a plane in; the oldest one falls out.
    pub(crate) fn push(&mut self, plane: &Plane) {
        self.planes.copy_within(CELLS.., 0);
        let newest = &mut self.planes[(STEPS - 1) * CELLS..];
        for (place, cell) in newest.iter_mut().zip(plane) {
            *place = cell.cast_unsigned();
        }
    }

    /// Whether the host is told of this window.
    pub(crate) const fn is_due(window: u32) -> bool {
        window.is_multiple_of(EVERY)
    }

    /// These planes make this code.
    pub(crate) fn complete(&mut self, window: u32, values: &CodeValues) -> &Self {
        self.window = window;
        self.values = *values;
        self
    }

    /// As it goes over the wire.
    pub(crate) fn message(&self) -> Audit<'_> {
        Audit {
            model_id: model::MODEL_ID,
            window: self.window,
            planes: &self.planes,
            values: message::values(&self.values),
        }
    }
}
