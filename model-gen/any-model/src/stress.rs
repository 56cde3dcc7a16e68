//! Synthetic inputs of the encoder: silence, and planes that are more extreme than any EEG.

/// A sequence of planes with any number of cells. Every cell has a signal, even cells without an
/// electrode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stress {
    /// Every cell is always 0.
    Silence,
    /// Every cell is at a rail, -128 or 127, and jumps to the other rail with a probability of 1/8
    /// per plane.
    Rails,
    /// In every plane, each cell is at a random rail with a probability of 1/500, and 0 otherwise.
    Impulses,
    /// Every cell is a random int8, uniform over the range.
    Noise,
}

impl Stress {
    /// All sequences, in the order in which reports list them.
    pub const ALL: [Self; 4] = [Self::Silence, Self::Rails, Self::Impulses, Self::Noise];

    /// Returns the sequence's name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Silence => "silence",
            Self::Rails => "rails",
            Self::Impulses => "impulses",
            Self::Noise => "noise",
        }
    }

    /// Returns an endless iterator over the planes of the sequence, of `cells` cells each. Every
    /// call with the same `cells` yields the same planes.
    pub fn planes(self, cells: usize) -> impl Iterator<Item = Vec<i8>> {
        let mut random = Random(4);
        let mut plane = vec![0; cells];
        std::iter::repeat_with(move || {
            for cell in &mut plane {
                *cell = self.next(*cell, &mut random);
            }
            plane.clone()
        })
    }

    /// Returns the value in the next plane for a cell whose current value is `cell`.
    fn next(self, cell: i8, random: &mut Random) -> i8 {
        // Use the highest 8 bits of the random number, which are uniform over int8.
        let [.., any] = random.next().to_le_bytes();
        let any = any.cast_signed();
        let rail = if any < 0 { i8::MIN } else { i8::MAX };
        match self {
            // A cell is 0 only in the first plane. Later, `!cell` is the opposite rail: !-128 is
            // 127.
            Self::Rails if cell == 0 => rail,
            Self::Rails if random.once_in(8) => !cell,
            Self::Rails => cell,
            Self::Impulses if random.once_in(500) => rail,
            Self::Silence | Self::Impulses => 0,
            Self::Noise => any,
        }
    }
}

/// State of a linear congruential generator with Knuth's 64-bit constants (MMIX; The Art of
/// Computer Programming 2, 3.3.4).
struct Random(u64);

impl Random {
    /// Returns the next number, uniform over 32 bits: the upper half, because the lowest bits have
    /// short periods.
    fn next(&mut self) -> u32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as u32
    }

    /// Returns true with a probability of 1 / `times`.
    fn once_in(&mut self, times: u32) -> bool {
        self.next() < u32::MAX / times
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of cells of a plane in the tests.
    const CELLS: usize = 90;

    /// Number of cells in which the tests count values, taken from successive planes.
    const COUNTED: usize = 9_000;

    /// Counts each int8 value in the first [`COUNTED`] cells; index 0 holds value 0, index 128
    /// value -128.
    fn histogram(stress: Stress) -> [u32; 256] {
        let mut histogram = [0; 256];
        for cell in stress.planes(CELLS).flatten().take(COUNTED) {
            histogram[usize::from(cell.cast_unsigned())] += 1;
        }
        histogram
    }

    #[test]
    fn every_sequence_holds_the_values_that_its_variant_documents() {
        let at = |stress, value: i8| histogram(stress)[usize::from(value.cast_unsigned())];
        assert_eq!(at(Stress::Silence, 0) as usize, COUNTED);
        let rails = [i8::MIN, i8::MAX].map(|rail| at(Stress::Rails, rail));
        assert_eq!(rails.iter().sum::<u32>() as usize, COUNTED);
        assert!(rails.iter().all(|count| *count > 4_000), "{rails:?}");
        let impulses = [i8::MIN, i8::MAX].map(|rail| at(Stress::Impulses, rail));
        assert!(impulses.iter().all(|count| *count > 2), "{impulses:?}");
        assert!(at(Stress::Impulses, 0) > 8_900);
        // Among 9,000 random cells, each of the 256 values occurs 35 times on average, with a
        // standard deviation of 6; the limit of 5 is five standard deviations below.
        assert!(histogram(Stress::Noise).iter().all(|count| *count > 5));
    }
}
