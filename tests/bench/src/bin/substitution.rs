//! Image that counts the instructions of the substitution of bad electrodes, per step and per
//! sample, and the instructions of the feature extraction, per step. The documentation of the
//! library `bench` describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

bench::image!("substitution");

#[cfg(target_os = "none")]
mod image {
    use core::{fmt, hint::black_box};

    use bench::{
        machine::{Clock, Files, Refused, with_clock},
        substituted::{
            OwnedTable, SAMPLES_PER_STEP, STEP_BYTES, TABLE_BYTES, any_filters, from_bytes,
            to_bytes,
        },
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;
    use pipeline::{ExclusionPolicy, FeatureExtractor, Sample, Substitution};

    /// Instruction counts of one input, each as a tally (fewest, most, total).
    struct Counts {
        steps: Tally,
        samples: Tally,
        features: Tally,
    }

    impl fmt::Debug for Counts {
        /// Writes the counts as an inline TOML table, which the report reads.
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            let Self { steps, samples, features } = self;
            f.write_fmt(format_args!(
                "{{ steps = {steps:?}, samples = {samples:?}, features = {features:?} }}"
            ))
        }
    }

    #[entry]
    fn main() -> ! {
        with_clock(count_all)
    }

    /// Replaces bad electrodes in the steps of all inputs. Prints the instruction counts of each
    /// input.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        hprintln!("state_bytes = {}", size_of::<Substitution>());
        hprintln!("features_bytes = {}", size_of::<FeatureExtractor>());
        let mut files = Files::open()?;
        let steps = files.read_steps()?;
        let mut table = [0; TABLE_BYTES];
        files.read(1, &mut table)?;
        let table = OwnedTable::from_bytes(&table);
        files.count_inputs(|files| count_input(clock, steps, &table, files))
    }

    /// Replaces bad electrodes in the steps of the next input. Returns the input's counts, or
    /// `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        count: usize,
        table: &OwnedTable,
        files: &mut Files,
    ) -> Result<Option<Counts>, Refused> {
        let (table, policy) = (table.borrow(), ExclusionPolicy::AUTOMATIC);
        let mut substitution = Substitution::NEW;
        let mut extractor = FeatureExtractor::NEW;
        extractor.set_filters(any_filters());
        let [mut steps, mut samples, mut features] = [Tally::EMPTY; 3];
        let mut bytes = [0; STEP_BYTES];
        for index in 0..count {
            if !files.read(index, &mut bytes)? {
                return Ok(None);
            }
            let mut step = from_bytes(&bytes);
            let mut sample = Sample::default();
            sample.counts[..step.electrodes.len()].copy_from_slice(&step.electrodes);
            for _ in 0..SAMPLES_PER_STEP {
                samples.add(clock.count(&mut || substitution.observe_sample(&sample)));
            }
            steps.add(clock.count(&mut || substitution.fill_step(&mut step, policy, &table)));
            features.add(clock.count(&mut || {
                black_box(extractor.add_step(&step));
            }));
            files.outputs.write(&to_bytes(&step, step.excluded))?;
        }
        Ok(Some(Counts { steps, samples, features }))
    }
}
