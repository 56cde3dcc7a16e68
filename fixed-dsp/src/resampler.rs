//! Rate reduction by a rational factor, through a polyphase FIR filter.

use crate::DelayLine;

/// Output rate = input rate * `PHASES` / `down`, in lowest terms, through a low-pass of
/// `PHASES * TAPS` taps at `PHASES` times the input rate, of which every output needs `TAPS`.
///
/// Output `m` stands at the time `m * down / PHASES` in input samples, the first at the first input
/// sample. It is due with the last input sample that is not later than itself; its phase says how
/// much later it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resampler<const PHASES: usize, const TAPS: usize> {
    /// Input samples per `PHASES` output samples; at least `PHASES`.
    pub down: u16,
    /// Impulse response, Q2.30, `[phase][age]`, the newest input sample first.
    pub taps: [[i32; TAPS]; PHASES],
}

/// Where a resampler stands between its input samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// From the next input sample to the next output, in parts (1 / `PHASES`) of an input sample.
    ahead: u16,
}

impl Position {
    /// Before the first input sample.
    pub const START: Self = Self { ahead: 0 };
}

impl Resampler<1, 1> {
    /// Keeps the first and then every `down`-th sample as it is, without a filter of its own:
    /// whatever the signal still holds above half of the new rate folds back.
    ///
    /// # Panics
    /// When `down` is 0; at compile time in a `const` context.
    pub const fn every(down: u16) -> Self {
        assert!(down > 0, "a sample is at most kept once");
        Self {
            down,
            taps: [[Self::UNITY]],
        }
    }
}

impl<const PHASES: usize, const TAPS: usize> Resampler<PHASES, TAPS> {
    /// One in a tap's format, Q2.30.
    pub const UNITY: i32 = 1 << 30;

    /// True when there is at most one output for every input and no sum can leave the 64-bit
    /// accumulator, whatever the samples.
    pub const fn is_consistent(&self) -> bool {
        let mut sound = TAPS > 0 && PHASES > 0 && PHASES <= self.down as usize;
        let mut phase = 0;
        while phase < PHASES {
            let mut magnitude = 0;
            let mut age = 0;
            while age < TAPS {
                magnitude += self.taps[phase][age].unsigned_abs() as u64;
                age += 1;
            }
            // Times 2^31 of a sample this is 2^62; the rounding adds 2^29.
            sound = sound && magnitude < 1 << 31;
            phase += 1;
        }
        sound
    }

    /// Counts one input sample. When an output is due with it, gives the output's phase: how much
    /// later than this sample it stands, in parts (1 / `PHASES`) of an input sample.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "PHASES <= down, which has 16 bits"
    )]
    pub const fn advance(&self, position: &mut Position) -> Option<usize> {
        let parts = const { PHASES as u16 };
        if position.ahead < parts {
            let phase = position.ahead;
            position.ahead = phase + (self.down - parts);
            Some(phase as usize)
        } else {
            position.ahead -= parts;
            None
        }
    }

    /// The output of every channel at `phase`, in the samples' unit and format.
    ///
    /// An exact 64-bit sum, rounded half up once. Overflow: wraps; |output| < 2^31 is the caller's
    /// proof.
    ///
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the caller's proof: the output fits 32 bits"
    )]
    pub fn outputs<const CHANNELS: usize>(
        &self,
        phase: usize,
        line: &DelayLine<CHANNELS, TAPS>,
    ) -> [i32; CHANNELS] {
        let mut outputs = [0; CHANNELS];
        for (output, sum) in outputs
            .iter_mut()
            .zip(line.weighted(&self.taps[phase % PHASES]))
        {
            *output = ((sum + i64::from(Self::UNITY / 2)) >> 30) as i32;
        }
        outputs
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Phases of the outputs that come with each of `inputs` input samples.
    fn schedule<const PHASES: usize>(down: u16, inputs: usize) -> Vec<Option<usize>> {
        let resampler = Resampler {
            down,
            taps: [[0]; PHASES],
        };
        let mut position = Position::START;
        (0..inputs)
            .map(|_| resampler.advance(&mut position))
            .collect()
    }

    #[test]
    fn every_fourth_sample_stays_as_it_is_the_first_included() {
        let resampler = Resampler::every(4);
        let (mut position, mut line) = (Position::START, DelayLine::<1, 1>::SILENCE);
        let kept: Vec<i32> = [i32::MIN, 1, 2, 3, -4, 5, 6, 7, i32::MAX]
            .into_iter()
            .filter_map(|sample| {
                line.push([sample].into_iter());
                let phase = resampler.advance(&mut position)?;
                Some(resampler.outputs(phase, &line)[0])
            })
            .collect();
        assert_eq!(kept, [i32::MIN, -4, i32::MAX]);
    }

    #[test]
    fn outputs_stand_at_multiples_of_the_ratio_and_come_with_the_sample_before() {
        // 500 -> 128 Hz: 125 / 32 samples apart.
        let due: Vec<(usize, usize)> = schedule::<32>(125, 1_000)
            .into_iter()
            .enumerate()
            .filter_map(|(sample, phase)| Some((sample, phase?)))
            .collect();
        let expected: Vec<(usize, usize)> = (0..256)
            .map(|output| (output * 125 / 32, output * 125 % 32))
            .collect();
        assert_eq!(due, expected);
    }

    #[test]
    fn equal_rates_give_an_output_for_every_sample() {
        assert!(schedule::<1>(1, 9).iter().all(|&phase| phase == Some(0)));
    }

    #[test]
    fn a_resampler_that_makes_samples_up_or_could_overflow_is_inconsistent() {
        let unity = Resampler::<1, 1>::UNITY;
        assert!(Resampler::every(1).is_consistent());
        assert!(
            !Resampler {
                down: 2,
                taps: [[unity]; 3]
            }
            .is_consistent()
        );
        assert!(
            !Resampler {
                down: 4,
                taps: [[unity, -unity]]
            }
            .is_consistent()
        );
    }
}
