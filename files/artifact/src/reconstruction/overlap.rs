//! Joins consecutive windows, which overlap, to one continuous signal.

use std::collections::VecDeque;

/// Layout of the hops that [`Overlap`] yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HopLayout {
    /// Length of a hop in steps: the distance between the starts of consecutive windows.
    pub steps: usize,
    /// Number of electrodes in each step.
    pub electrodes: usize,
    /// True if a hop is the newest steps of its window; false if it is older steps, averaged over
    /// all windows that contain them.
    pub low_latency: bool,
    /// Largest magnitude of a value, microvolts. Larger values are clipped to it, because a
    /// recorder that is configured for this range would store them as infinite.
    pub full_scale_uv: f32,
}

impl HopLayout {
    /// Returns the number of steps from the first step of a hop to the last step that
    /// [`Overlap::next_hop`] needs for it. A window has `window_steps` steps.
    pub fn lookback_steps(window_steps: u32, hop_steps: u32, low_latency: bool) -> u32 {
        let steps = if low_latency { hop_steps } else { window_steps };
        steps.saturating_sub(1)
    }

    /// Number of values in a hop: steps times electrodes.
    fn values(&self) -> usize {
        self.steps * self.electrodes
    }
}

/// A window of electrode signals, decoded from one code.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Index of the window in the stream; wraps.
    pub index: u32,
    /// Status flags that the device sent with the window.
    pub flags: u16,
    /// Microvolts, all electrodes of the first step, then of the next; `None` if the code was lost.
    pub values: Option<Vec<f32>>,
}

/// Which windows the values of a hop were computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Only the window that was passed to [`Overlap::next_hop`].
    Window,
    /// The average of earlier windows and the window that was passed to [`Overlap::next_hop`].
    Average,
    /// Only earlier windows, because the code of the window that was passed to
    /// [`Overlap::next_hop`] is lost.
    Earlier,
    /// No window: the codes of all windows that contain the hop are lost. Writes no values.
    Missing,
}

/// Source and flags of the values of a hop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hop {
    /// Which windows the values were computed from.
    pub source: Source,
    /// Flags of the window that was passed to [`Overlap::next_hop`] and of all windows in the
    /// average.
    pub flags: u16,
    /// Whether all windows that contain the hop contributed. Windows are missing where codes are
    /// lost, and at both ends of a stream.
    pub is_whole: bool,
}

/// Averages overlapping windows and returns one hop of steps for each window.
#[derive(Clone, Debug)]
pub struct Overlap {
    layout: HopLayout,
    /// Earlier windows that contain steps of hops not yet returned, oldest first.
    earlier: VecDeque<Window>,
}

impl Overlap {
    /// Creates an overlap without earlier windows.
    pub fn new(layout: HopLayout) -> Overlap {
        Overlap { layout, earlier: VecDeque::new() }
    }

    /// Forgets the earlier windows, so that the next hop is computed from one window alone.
    pub fn forget(&mut self) {
        self.earlier.clear();
    }

    /// Takes the next window of the stream, writes one hop to `hop`, and returns the hop's source
    /// and flags.
    ///
    /// With low latency, the hop is the last one of the window; otherwise it is the first one,
    /// averaged over this window and all earlier windows that contain it.
    ///
    /// # Panics
    ///
    /// If `hop` does not have the length that the layout states, or the window is shorter than a
    /// hop.
    pub fn next_hop(&mut self, window: Window, hop: &mut [f32]) -> Hop {
        let length = self.layout.values();
        let (index, mut flags) = (window.index, window.flags);
        if self.layout.low_latency {
            self.forget();
        }
        // After a restart of the stream, the indices do not continue, so no earlier window contains
        // the hop.
        self.earlier.retain(|earlier| hop_at(earlier, index, length).is_some());
        let mut shared: Vec<&[f32]> =
            self.earlier.iter().filter_map(|earlier| hop_at(earlier, index, length)).collect();
        let (source, is_whole) = match (&window.values, shared.is_empty()) {
            (Some(new), true) if self.layout.low_latency => {
                hop.copy_from_slice(&new[new.len() - length..]);
                (Source::Window, true)
            }
            (Some(new), true) => {
                hop.copy_from_slice(&new[..length]);
                (Source::Window, new.len() < 2 * length)
            }
            (Some(new), false) => {
                shared.push(&new[..length]);
                average(&shared, hop);
                (Source::Average, shared.len() == new.len() / length)
            }
            (None, false) => {
                average(&shared, hop);
                (Source::Earlier, false)
            }
            (None, true) => (Source::Missing, false),
        };
        let full_scale_uv = self.layout.full_scale_uv;
        for value in hop.iter_mut() {
            *value = value.clamp(-full_scale_uv, full_scale_uv);
        }
        flags |= self.earlier.iter().fold(0, |all, earlier| all | earlier.flags);
        if window.values.is_some() {
            self.earlier.push_back(window);
        }
        Hop { source, flags, is_whole }
    }
}

/// Returns the part of an earlier window that covers the first hop of window `index`; `None` if the
/// earlier window ends before this hop.
fn hop_at(earlier: &Window, index: u32, length: usize) -> Option<&[f32]> {
    let age = usize::try_from(index.wrapping_sub(earlier.index)).ok()?;
    let start = age.checked_mul(length).filter(|_| age > 0)?;
    earlier.values.as_ref()?.get(start..start.checked_add(length)?)
}

/// Averages the steps that windows share, which lowers the decoding error. With an earlier model
/// and two windows, the normalised squared error was 0.00971 for the average and 0.01034 for one
/// window (recordings EEGMMIDB S001 R11 and R12). The built-in model has not been measured.
fn average(windows: &[&[f32]], out: &mut [f32]) {
    #[expect(clippy::cast_precision_loss, reason = "at most 8 windows overlap")]
    let share = 1.0 / windows.len() as f32;
    out.fill(0.0);
    for window in windows {
        for (out, value) in out.iter_mut().zip(*window) {
            *out += value;
        }
    }
    for out in out.iter_mut() {
        *out *= share;
    }
}

#[cfg(test)]
mod tests {
    use super::{Hop, HopLayout, Overlap, Source, Window};

    const LAYOUT: HopLayout =
        HopLayout { steps: 1, electrodes: 2, low_latency: false, full_scale_uv: 100.0 };

    /// Returns hops and sources for windows (index, values), where `None` is a lost code. Window k
    /// has the flags 1 << k.
    fn hops(layout: HopLayout, windows: &[(u32, Option<&[f32]>)]) -> Vec<([f32; 2], Hop)> {
        let mut overlap = Overlap::new(layout);
        let mut hop = [0.0; 2];
        let mut next = |&(index, values): &(u32, Option<&[f32]>)| {
            let window =
                Window { index, flags: 1 << (index % 16), values: values.map(<[f32]>::to_vec) };
            let made = overlap.next_hop(window, &mut hop);
            (hop, made)
        };
        windows.iter().map(&mut next).collect()
    }

    /// Returns a hop that is whole if and only if its source is an average.
    fn made(source: Source, flags: u16) -> Hop {
        let is_whole = source == Source::Average;
        Hop { source, flags, is_whole }
    }

    /// Returns an average over some, but not all, windows that contain the hop.
    fn partial(flags: u16) -> Hop {
        Hop { is_whole: false, ..made(Source::Average, flags) }
    }

    /// Returns a hop that only one window contains.
    fn alone(flags: u16) -> Hop {
        Hop { is_whole: true, ..made(Source::Window, flags) }
    }

    #[test]
    fn shared_steps_are_averaged_and_lost_windows_are_covered_by_their_neighbours() {
        let windows: [(u32, Option<&[f32]>); 5] = [
            (0, Some(&[1.0, 2.0, 3.0, 4.0])),
            (1, Some(&[5.0, 6.0, 7.0, 8.0])),
            (2, None),
            (3, None),
            (4, Some(&[9.0, 9.0, 1.0, 1.0])),
        ];
        let expected = [
            ([1.0, 2.0], made(Source::Window, 0b1)),
            ([4.0, 5.0], made(Source::Average, 0b11)),
            ([7.0, 8.0], made(Source::Earlier, 0b110)),
            ([7.0, 8.0], made(Source::Missing, 0b1000)),
            ([9.0, 9.0], made(Source::Window, 0b1_0000)),
        ];
        assert_eq!(hops(LAYOUT, &windows), expected);
    }

    #[test]
    fn all_windows_that_contain_a_hop_are_averaged() {
        // A window has four steps and a hop has one step, so four windows contain each hop.
        let windows: [(u32, Option<&[f32]>); 4] = [
            (0, Some(&[0.0, 0.0, 10.0, 10.0, 20.0, 20.0, 30.0, 30.0])),
            (1, Some(&[12.0, 12.0, 21.0, 21.0, 33.0, 33.0, 0.0, 0.0])),
            (2, None),
            (3, Some(&[36.0, 60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
        ];
        let expected = [
            ([0.0, 0.0], made(Source::Window, 0b1)),
            ([11.0, 11.0], partial(0b11)),
            ([20.5, 20.5], made(Source::Earlier, 0b111)),
            ([33.0, 41.0], partial(0b1011)),
        ];
        assert_eq!(hops(LAYOUT, &windows), expected);
    }

    #[test]
    fn windows_that_do_not_overlap_or_do_not_follow_each_other_stand_alone() {
        for (windows, hop) in [
            ([(0, Some(&[1.0, 2.0][..])), (1, Some(&[5.0, 6.0]))], alone(0b10)),
            (
                [(7, Some(&[1.0, 2.0, 3.0, 4.0])), (1, Some(&[5.0, 6.0, 7.0, 8.0]))],
                made(Source::Window, 0b10),
            ),
        ] {
            assert_eq!(hops(LAYOUT, &windows)[1], ([5.0, 6.0], hop));
        }
    }

    #[test]
    fn low_latency_yields_the_newest_hop_and_large_values_are_limited() {
        let layout = HopLayout { low_latency: true, ..LAYOUT };
        let windows: [(u32, Option<&[f32]>); 2] =
            [(0, Some(&[1.0, 2.0, 3.0, 4000.0])), (1, Some(&[1.0, 2.0, 5.0, 6.0]))];
        let expected = [([3.0, 100.0], alone(0b1)), ([5.0, 6.0], alone(0b10))];
        assert_eq!(hops(layout, &windows), expected);
        let lookback = |low_latency| HopLayout::lookback_steps(16, 8, low_latency);
        assert_eq!([lookback(false), lookback(true)], [15, 7]);
    }
}
