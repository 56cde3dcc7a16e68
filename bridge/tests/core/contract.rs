//! What `/encoded` and the announcement hold.

use bridge::{AnnouncedStream, FillerPolicy, Settings, StampPoint, TRI_LABELS};
use link::ToDevice;

use crate::board::{Board, WALL_START_NS};
use crate::recorder::{Desk, SETTINGS};

#[test]
fn encoded_frames_are_what_ros_neuro_expects() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(-128, false);
    let frame = &desk.recorder.encoded[0];
    let info = &frame.eeg.info;
    assert_eq!(
        (frame.sr, info.nsamples, info.nchannels, info.stride),
        (16, 1, 128, 512)
    );
    assert_eq!(
        (info.labels[0].as_str(), info.labels[127].as_str()),
        ("z000", "z127")
    );
    assert_eq!(
        (info.transducter.as_str(), info.prefiltering.as_str()),
        ("autoencoder", "none")
    );
    assert_eq!(info.isint, 0);
    assert!(!info.unit.is_empty());
    // (q - 1) * 0.5 for q in -128..=127.
    assert_eq!(info.minmax, [-64.5, 63.0]);
    assert_eq!(frame.eeg.data, [-64.5; 128]);
    assert_eq!(frame.exg.info.nchannels, 0);
    assert_eq!(frame.tri.info.labels, TRI_LABELS);
    let announced = desk.recorder.announced[0].info.clone().unwrap();
    assert_eq!(announced.frame().eeg.info, *info);
    assert_eq!(announced.device_model(), "board test");
    assert_eq!(announced.device_id(), "07".repeat(12));
}

#[test]
fn hop_16_gives_8_codes_per_second() {
    let mut desk = Desk::streaming(
        SETTINGS,
        Board {
            hop_steps: 16,
            ..Board::new()
        },
    );
    desk.code(0, false);
    assert_eq!(desk.recorder.encoded[0].sr, 8);
}

#[test]
fn stamps_mean_what_was_asked_for() {
    // The code was read when it was made: device time 1.0625 s, no delay, equal clocks.
    let made_ns = WALL_START_NS + 1_062_500_000;
    for (stamp, expected) in [
        // 15 steps of 7.8125 ms (in whole microseconds) and 10 ms of filter delay earlier.
        (StampPoint::First, made_ns - 117_187_000 - 10_000_000),
        (StampPoint::Last, made_ns - 10_000_000),
        (StampPoint::Arrival, made_ns),
    ] {
        let mut desk = Desk::streaming(Settings { stamp, ..SETTINGS }, Board::new());
        desk.code(0, false);
        assert_eq!(
            desk.recorder.encoded[0].header.stamp.nanoseconds(),
            expected,
            "{stamp:?}"
        );
    }
}

#[test]
fn the_chosen_mains_go_to_the_device() {
    let settings = Settings {
        mains_hz: 60,
        filler: FillerPolicy::Off,
        ..SETTINGS
    };
    let desk = Desk::streaming(settings, Board::new());
    assert!(matches!(desk.board.seen[2].1, ToDevice::Start(start) if start.mains_hz == 60));
}

#[test]
fn diagnostics_tell_of_a_loss_once() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(0, false);
    desk.code(0, true);
    desk.code(0, false);
    let now = crate::board::at(desk.now_us);
    let levels = |desk: &mut Desk| -> Vec<String> {
        let report = desk.core.diagnostics(now);
        report
            .status
            .iter()
            .map(|status| format!("{} {:?}", status.name, status.level))
            .collect()
    };
    let with_loss = levels(&mut desk);
    assert!(
        with_loss.contains(&"corticode: loss Warn".to_owned()),
        "{with_loss:?}"
    );
    let after = levels(&mut desk);
    assert!(after.iter().all(|line| line.ends_with("Ok")), "{after:?}");
}

#[test]
fn the_reconstruction_is_announced_on_demand_and_only_if_there_is_one() {
    let settings = Settings {
        announced: AnnouncedStream::Reconstructed,
        ..SETTINGS
    };
    let announced = |board| {
        let mut desk = Desk::new(settings, board);
        desk.connect();
        desk.recorder.announced.remove(0).info
    };
    let info = announced(Board::new()).unwrap();
    assert_eq!(info.shape().nchannels, [61, 0, 8]);
    assert_eq!((info.shape().sr, info.shape().nsamples), (128, 8));
    let other = Board {
        model_id: [9; 8],
        ..Board::new()
    };
    assert_eq!(announced(other), None);
}
