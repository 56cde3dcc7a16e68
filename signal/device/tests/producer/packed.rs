//! Blocks of the packed code: their content, rate and faults.

use pipeline::{PackedCode, PackedEncoder, Rate};

use super::*;

const PER_BLOCK: u64 = PER_STEP * HOP as u64;

/// Returns the samples of a run with signals at the electrodes, without the `lost` samples.
fn signals(streams: Streams, count: u64, lost: &[u64]) -> impl Iterator<Item = AcquiredSample> {
    samples(streams, count, lost).map(|mut acquired| {
        if let Some(step) = &mut acquired.step {
            for (electrode, value) in (0_i32..).zip(&mut step.electrodes) {
                let phase = i32::try_from(acquired.step_index % 40).expect("few") - 20;
                *value = (phase * (electrode % 7 - 3)) << 14;
            }
        }
        acquired
    })
}

/// Returns block, time and faults of every output that is a packed block.
fn blocks(outputs: &[Output<'_>]) -> Vec<(PackedCode, u64, Marks)> {
    let blocks = outputs.iter().filter_map(|output| match &output.payload {
        Payload::PackedCode(code, marks) => Some((**code, output.at_us, *marks)),
        _ => None,
    });
    blocks.collect()
}

#[test]
fn a_run_makes_the_blocks_of_the_packed_encoder_at_the_time_of_their_last_steps() {
    let count = 70 * PER_BLOCK;
    let made = blocks(&outputs_of(signals(Streams::PACKED, count, &[])));
    let mut encoder = Box::new(PackedEncoder::new());
    let steps = signals(Streams::PACKED, count, &[]).filter_map(|acquired| acquired.step);
    let expected: Vec<PackedCode> = steps.filter_map(|step| encoder.encode_step(&step)).collect();
    assert_eq!(made.len(), 70);
    for ((code, at_us, marks), expected) in made.iter().zip(&expected) {
        assert_eq!(code, expected);
        assert_eq!(
            *at_us,
            step_us(u64::from(code.block + 1) * HOP as u64 - 1),
            "the last step's sample"
        );
        assert_eq!(*marks, Marks::NONE);
        assert_eq!(code.is_reset, code.block % 64 == 0);
    }
    assert!(made.iter().any(|(code, ..)| code.bytes().len() > 20));
}

#[test]
fn exactly_the_blocks_with_a_lost_sample_have_its_faults_and_their_number_stays_right() {
    // A sample of block 1 is lost, and so are the samples from the third step of block 2 to the
    // first step of block 4.
    let lost: Vec<u64> = [PER_BLOCK + 3]
        .into_iter()
        .chain(2 * PER_BLOCK + 2 * PER_STEP..4 * PER_BLOCK + PER_STEP)
        .collect();
    let input = signals(Streams::PACKED, 8 * PER_BLOCK, &lost).map(|mut acquired| {
        acquired.lost.lead_off = acquired.lost.overrun;
        acquired
    });
    let made = blocks(&outputs_of(input));
    let numbers: Vec<u32> = made.iter().map(|(code, ..)| code.block).collect();
    assert_eq!(numbers, [0, 1, 2, 3, 4, 5, 6, 7]);
    for (code, _, marks) in made {
        let is_marked = (1..=4).contains(&code.block);
        assert_eq!((marks.overrun, marks.lead_off), (is_marked, is_marked));
    }
}

/// `tests/acceptance` also builds this test with an ADC rate that is no multiple of the step rate.
#[test]
fn blocks_of_repeated_steps_have_their_own_times() {
    let hop = HOP as u64;
    let lost: Vec<u64> = (sample_of(2 * hop + 3)..sample_of(4 * hop + 2)).collect();
    let made = blocks(&outputs_of(signals(Streams::PACKED, sample_of(6 * hop), &lost)));
    assert_eq!(made.len(), 6);
    for (code, at_us, _) in &made {
        let due_us = step_us(u64::from(code.block + 1) * hop - 1);
        let block = code.block;
        assert!(at_us.abs_diff(due_us) <= 2, "block {block}: {at_us} {due_us}");
    }
}

#[test]
fn a_window_of_repeated_steps_states_the_sample_of_its_first_step() {
    let lost: Vec<u64> = (sample_of(20)..sample_of(44)).collect();
    let count = sample_of((STEPS + 6 * HOP) as u64);
    let outputs = outputs_of(samples(Streams::CODES, count, &lost));
    let codes = codes(&outputs).into_iter();
    let codes = codes.map(|(code, ..)| (code.window, code.first_sample));
    let due = (0..7).map(|window| (window, sample_of(u64::from(window) * HOP as u64)));
    assert!(codes.eq(due));
}

#[test]
fn faults_of_the_samples_after_a_gap_are_in_their_own_blocks() {
    // The last sample of block 0 is lost; in the second pass, the `2 * PER_STEP` samples before it
    // are lost too. The next `PER_STEP` samples belong to the first step of block 1; the last of
    // these carries the step.
    let last = sample_of(HOP as u64 - 1);
    for first_lost in [last, last - 2 * PER_STEP] {
        let lost: Vec<u64> = (first_lost..=last).collect();
        for after in 1..=PER_STEP {
            let input = signals(Streams::PACKED, 3 * PER_BLOCK, &lost).map(|mut acquired| {
                acquired.marks.adc_status_bad = acquired.index == last + after;
                acquired
            });
            let made = blocks(&outputs_of(input));
            let faults = |fault: fn(&Marks) -> bool| -> Vec<u32> {
                let faulty = made.iter().filter(|(_, _, marks)| fault(marks));
                faulty.map(|(code, ..)| code.block).collect()
            };
            assert_eq!(faults(|marks| marks.adc_status_bad), [1]);
            assert_eq!(faults(|marks| marks.overrun), [0, 1]);
        }
    }
}

#[test]
fn steps_missing_at_the_start_of_a_run_are_silent_and_not_settled() {
    let mut input: Vec<AcquiredSample> = signals(Streams::PACKED, 3 * PER_BLOCK, &[]).collect();
    for acquired in &mut input {
        if let Some(step) = &mut acquired.step {
            step.saturated = 1 << 5;
        }
    }
    let lost: Vec<u64> = (0..2 * PER_BLOCK).collect();
    input.extend(signals(Streams::PACKED, 4 * PER_BLOCK, &lost).map(|mut acquired| {
        acquired.new_run = acquired.new_run.map(|_| run(2, Streams::PACKED));
        acquired
    }));
    let mut outputs = outputs_of(input);
    outputs.retain(|output| output.run == 2);
    let found: Vec<(u32, bool, u64, usize)> = blocks(&outputs)
        .iter()
        .map(|(code, ..)| (code.block, code.settling, code.saturated, code.bytes().len()))
        .collect();
    let [(0, true, 0, 2..6), (1, true, 0, 0..6), (2, false, 0, 1..), (3, false, 0, 1..)] =
        found[..]
    else {
        panic!("{found:?}")
    };
}

#[test]
fn a_rate_applies_from_the_next_block_on_and_outlives_the_run() {
    let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
    let rate = |index| Rate::new(index).expect("a rate");
    let mut made = Vec::new();
    for number in 1..3 {
        for mut acquired in signals(Streams::PACKED, 3 * PER_BLOCK, &[]) {
            acquired.new_run = acquired.new_run.map(|_| run(number, Streams::PACKED));
            if number == 1 && acquired.index == PER_BLOCK + 1 {
                producer.set_rate(rate(9));
            }
            producer.process(&acquired, &mut |output| made.push(keep(output)));
        }
    }
    let rates: Vec<u8> = blocks(&made).iter().map(|(code, ..)| code.rate).collect();
    let first = PackedEncoder::DEFAULT_RATE.index();
    assert_eq!(rates, [first, 9, 9, 9, 9, 9]);
    assert_ne!(first, 9);
}

#[test]
fn an_encoder_alone_makes_its_own_stream_and_no_other() {
    fn kinds(encoders: impl Encoders) -> (bool, bool) {
        let mut producer = Box::new(Producer::new(encoders));
        let mut outputs = Vec::new();
        for acquired in signals(Streams::ALL, 4 * PER_BLOCK, &[]) {
            producer.process(&acquired, &mut |output| outputs.push(keep(output)));
        }
        (!codes(&outputs).is_empty(), !blocks(&outputs).is_empty())
    }
    assert_eq!(kinds(EncoderMemory::EMPTY), (true, false));
    assert_eq!(kinds(pipeline::PackedMemory::EMPTY), (false, true));
    assert_eq!(kinds(BothEncoders::EMPTY), (true, true));
    assert!(BothEncoders::model_is_sound());
}

/// Returns the indices of the windows that a device with these encoders audits, each with the
/// number of code values in its audit.
fn audits_at_the_host(encoders: impl Encoders) -> Vec<(u32, usize)> {
    let count = sample_of((STEPS + 160 * HOP) as u64);
    let mut producer = Box::new(Producer::new(encoders));
    let mut audits = Vec::new();
    for acquired in signals(Streams::AUDIT, count, &[]) {
        producer.process(&acquired, &mut |output| {
            let Payload::Audit(audit) = &output.payload else {
                return;
            };
            let mut values = [0; pipeline::CodeValues::MAX_BYTES];
            let message = link::ToHost::Audit(audit.message(model::MODEL_ID, &mut values));
            let mut frame = [0; link::MAX_FRAME];
            let mut frame = link::Encoder::default()
                .encode(output.at_us, &message, &mut frame)
                .expect("an audit fits a frame");
            let mut host = link::Decoder::<{ link::MAX_FRAME }>::new();
            let received = host.next::<link::ToHost>(&mut frame).expect("a frame");
            let link::ToHost::Audit(audit) = received.expect("a valid frame").message else {
                panic!("another message");
            };
            assert_eq!(audit.planes.len(), STEPS * CELLS);
            let steps = STEPS as u64 + u64::from(audit.window) * HOP as u64;
            assert_eq!(output.at_us, step_us(steps - 1));
            audits.push((audit.window, audit.values.len()));
        });
    }
    audits
}

/// `tests/acceptance` also builds this test with a model without a network.
#[test]
fn audits_reach_the_host_and_have_a_code_if_the_device_has_the_network() {
    let numbers = if model::HAS_NETWORK { model::CODE } else { 0 };
    let both = audits_at_the_host(BothEncoders::EMPTY);
    assert_eq!(both, [(0, numbers), (160, numbers)]);
    let packed = audits_at_the_host(pipeline::PackedMemory::EMPTY);
    assert_eq!(packed, [(0, 0), (160, 0)]);
}
