//! Tests of the impedances that a virtual board measures while it streams.

use super::*;

/// Returns a board that streams, has the impedances of `contacts`, and measures them if `measures`.
fn started(streams: Streams, measures: bool, contacts: &[&str]) -> (VirtualBoard, Outbox) {
    let contacts: Vec<Contact> =
        contacts.iter().map(|text| text.parse().expect("a contact")).collect();
    let (board, outbox) = board();
    let mut board = board.with_contacts(&contacts);
    let mut host = Encoder::default();
    send(&mut board, &mut host, start(streams));
    send(&mut board, &mut host, ToDevice::SetImpedance { on: measures });
    (board, outbox)
}

/// Processes `seconds` of synthetic EEG.
fn play(board: &mut VirtualBoard, seconds: usize) {
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let eeg = Generator::new(&spec).expect("a generator");
    let rate = usize::from(model::ADC_RATE_HZ);
    for (index, counts) in eeg.take(seconds * rate).enumerate() {
        let now_us = index as u64 * 1_000_000 / rate as u64;
        board.process_sample(&Sample { counts }, now_us);
    }
}

/// Returns the impedances in the outbox.
fn reports(outbox: &Outbox) -> Vec<Vec<Option<u32>>> {
    frames(outbox, |message| match message {
        ToHost::Impedance(impedance) => Some(impedance.electrodes().collect()),
        _ => None,
    })
}

#[test]
fn known_impedances_are_reported_every_second_under_synthetic_eeg() {
    let contacts = ["5k", "1k:Fz", "20k:Cz", "100k:Pz"];
    let (mut board, outbox) = started(Streams::CODES, true, &contacts);
    play(&mut board, 4);
    let found = reports(&outbox);
    assert_eq!(found.len(), 3, "4 s without the first samples");
    for (electrode, label) in model::LABELS.split(' ').enumerate() {
        let set = match label {
            "Fz" => 1_000.0,
            "Cz" => 20_000.0,
            "Pz" => 100_000.0,
            _ => 5_000.0,
        };
        for ohms in &found {
            let measured = f64::from(ohms[electrode].expect("not open"));
            // The synthetic EEG itself has 0.4 uV in the 1 Hz around 128 Hz, which is measured as
            // 75 ohms RMS.
            let limit = 0.02 * set + 300.0;
            assert!((measured - set).abs() < limit, "{label}: {measured} of {set}");
        }
    }
    assert_eq!(board.stats().adc_status_bad, 0);
    // `Stop` ends the measurement, so the next run does not continue it.
    let mut host = Encoder::default();
    send(&mut board, &mut host, ToDevice::Stop);
    send(&mut board, &mut host, START);
    play(&mut board, 2);
    assert!(reports(&outbox).is_empty());
}

#[test]
fn an_electrode_that_comes_off_is_open() {
    let outbox = Outbox::new(WhenFull::DropOldest);
    let off = "lead-off@2s:Cz".parse().expect("a fault");
    let faults = Faults::new(&[off]).expect("one fault");
    let mut board =
        VirtualBoard::with_faults(Identity::default(), Mains::Hz50, faults, outbox.clone());
    let mut host = Encoder::default();
    send(&mut board, &mut host, START);
    send(&mut board, &mut host, ToDevice::SetImpedance { on: true });
    play(&mut board, 4);
    let cz = model::LABELS.split(' ').position(|label| label == "Cz");
    let cz = cz.expect("an electrode of the default model");
    let found: Vec<bool> = reports(&outbox).iter().map(|ohms| ohms[cz].is_none()).collect();
    assert_eq!(found, [false, true, true]);
}

/// Returns the filtered steps in microvolts, electrode by electrode, from second `from` on.
fn filtered(measures: bool, ohms: &str, from: usize) -> Vec<Vec<f64>> {
    let (mut board, outbox) = started(Streams::FILTERED, measures, &[ohms]);
    let mut electrodes = vec![Vec::new(); pipeline::ELECTRODES];
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let mut eeg = Generator::new(&spec).expect("a generator");
    for second in 0..from + 4 {
        for counts in eeg.by_ref().take(model::ADC_RATE_HZ.into()) {
            board.process_sample(&Sample { counts }, 0);
        }
        let values = frames(&outbox, |message| match message {
            ToHost::Filtered(filtered) => Some(filtered.values().collect::<Vec<_>>()),
            _ => None,
        });
        if second < from {
            continue;
        }
        for (index, value) in values.into_iter().flatten().enumerate() {
            let uv = f64::from(value) / 32.0 * f64::from(model::LSB_NV) / 1000.0;
            electrodes[index % pipeline::ELECTRODES].push(uv);
        }
    }
    electrodes
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = u32::try_from(values.len()).expect("few values");
    values.sum::<f64>() / f64::from(count)
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    mean(values.map(|value| value * value)).sqrt()
}

#[test]
fn the_filtered_eeg_hardly_changes_while_impedances_are_measured() {
    for (ohms, limit_uv) in [("5k", 0.5), ("20k", 2.0)] {
        let [with, without] = [true, false].map(|measures| filtered(measures, ohms, 12));
        let (mut worst, mut worst_alternating) = (0.0_f64, 0.0_f64);
        for (with, without) in with.iter().zip(&without) {
            let difference: Vec<f64> = with.iter().zip(without).map(|(a, b)| a - b).collect();
            let mean = mean(difference.iter().copied());
            worst = worst.max(rms(difference.iter().copied()));
            worst_alternating = worst_alternating.max(rms(difference.iter().map(|x| x - mean)));
        }
        println!("{ohms}: {worst:.3} uV RMS, {worst_alternating:.4} around its mean");
        assert!(worst < limit_uv, "{worst}");
        // Decimation folds the excitation's tone to a constant, so only rounding is left.
        assert!(worst_alternating < 0.02, "{worst_alternating}");
    }
}
