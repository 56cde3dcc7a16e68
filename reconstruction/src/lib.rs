//! Decodes codes to microvolts on a continuous time axis.
//!
//! Consecutive windows overlap. Each code completes one hop of steps, whose values are averaged from the
//! two windows that contain these steps. Every program that decodes codes uses this crate, so all of them
//! yield the same bits.
//!
//! ```text
//! code ──WindowDecoder──► window, uV ──Overlap──► hop, uV
//! 16 Hz                   electrodes of each step     continuous
//! ```
//!
//! ```
//! use reconstruction::{HopLayout, Overlap, Source};
//!
//! let layout = HopLayout { steps: 2, electrodes: 1, low_latency: false, full_scale_uv: 100.0 };
//! let mut overlap = Overlap::new(layout);
//! let mut hop = [0.0; 2];
//! // Windows of four steps: the last two steps of a window are the first two of the next.
//! assert_eq!(overlap.next_hop(0, Some(vec![1.0, 2.0, 3.0, 4.0]), &mut hop), Source::Window);
//! assert_eq!(overlap.next_hop(1, Some(vec![5.0, 6.0, 7.0, 8.0]), &mut hop), Source::Both);
//! assert_eq!(hop, [4.0, 5.0]);
//! ```
#![forbid(unsafe_code)]

mod overlap;
mod window_decoder;

pub use overlap::{HopLayout, Overlap, Source};
pub use window_decoder::WindowDecoder;
