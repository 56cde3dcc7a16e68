//! Decodes codes to microvolts on a continuous time axis.
//!
//! Consecutive windows overlap. Each code completes one hop of steps, whose values are averaged
//! over all windows that contain these steps. Every program that decodes codes uses this module, so
//! all programs yield the same bits.
//!
//! ```text
//! code ──WindowDecoder──► window, uV ──Overlap──► hop, uV
//! 16 Hz                   electrodes of each step     continuous
//!
//! packed code ──PackedDecoder──► hop, uV ──PackedOverlap──► hop, uV
//! ```
//!
//! ```
//! use artifact::reconstruction::{HopLayout, Overlap, Source, Window};
//!
//! let layout = HopLayout { steps: 2, electrodes: 1, low_latency: false, full_scale_uv: 100.0 };
//! let mut overlap = Overlap::new(layout);
//! let mut hop = [0.0; 2];
//! // Windows of four steps: the last two steps of a window are the first two of the next.
//! let window = |index, values: [f32; 4]| Window { index, flags: 0, values: Some(values.to_vec()) };
//! let first = overlap.next_hop(window(0, [1.0, 2.0, 3.0, 4.0]), &mut hop);
//! assert_eq!((first.source, hop), (Source::Window, [1.0, 2.0]));
//! let second = overlap.next_hop(window(1, [5.0, 6.0, 7.0, 8.0]), &mut hop);
//! assert_eq!((second.source, hop), (Source::Average, [4.0, 5.0]));
//! ```

mod overlap;
mod packed_decoder;
mod packed_overlap;
mod synthesis;
mod window_decoder;

pub use overlap::{Hop, HopLayout, Overlap, Source, Window};
pub use packed_decoder::{HEALING_BLOCKS, PackedBlock, PackedDecoder};
pub use packed_overlap::{PackedHop, PackedOverlap, PackedSource};
pub use synthesis::synthesis;
pub use window_decoder::{WindowDecoder, code_range, dequantise};
