//! Contents of the frames on `/encoded` and of the answer to `/acquisition/get_info`.

use bridge_core::{AnnouncedStream, Settings, StampPoint, TRI_LABELS};
use link::{Streams, Substitutes, ToDevice};

use neuro_ros::{DiagnosticLevel, DiagnosticStatus};

use crate::board::{Board, WALL_START_NS, at, electrode, model};
use crate::recorder::{Harness, SETTINGS};

#[test]
fn encoded_frames_have_the_fields_that_ros_neuro_expects() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(-128, false);
    let frame = &harness.recorder.encoded[0];
    let info = &frame.eeg.info;
    assert_eq!((frame.sr, info.nsamples, info.nchannels, info.stride), (16, 1, 128, 512));
    assert_eq!((info.labels[0].as_str(), info.labels[127].as_str()), ("z000", "z127"));
    assert_eq!((info.transducter.as_str(), info.prefiltering.as_str()), ("autoencoder", "none"));
    assert_eq!(info.isint, 0);
    assert!(!info.unit.is_empty());
    // The range of (level - 1) * 0.5, for int8 levels from -128 to 127.
    assert_eq!(info.minmax, [-64.5, 63.0]);
    assert_eq!(frame.eeg.data, [-64.5; 128]);
    assert_eq!(frame.exg.info.nchannels, 0);
    assert_eq!(frame.tri.info.labels, TRI_LABELS);
    let announced = harness.recorder.announced[0].info.clone().unwrap();
    assert_eq!(announced.frame().eeg.info, *info);
    let id = artifact::ModelId(model().id()).to_string();
    assert_eq!(announced.device_model(), format!("board test, model {id}"));
    assert_eq!(announced.device_id(), "07".repeat(12));
}

#[test]
fn electrodes_that_were_not_recorded_are_named_until_another_device_answers() {
    let settings = Settings {
        announced: AnnouncedStream::Raw,
        streams: SETTINGS.streams | Streams::RAW,
        ..SETTINGS
    };
    let board =
        Board { substitutes: Substitutes { interpolated: 0b101, zero: 1 << 60 }, ..Board::new() };
    let mut harness = Harness::streaming(settings, board);
    harness.code(0, false);
    let [first, third, last] = [0, 2, 60].map(electrode);
    let unrecorded = format!("interpolated: {first} {third}; zero: {last}");
    let frame = &harness.recorder.encoded[0];
    assert_eq!(frame.header.frame_id, "autoencoder");
    let transducter = &frame.eeg.info.transducter;
    assert_eq!(*transducter, format!("autoencoder; {unrecorded}"));
    let announced = harness.recorder.announced[0].info.clone().unwrap();
    let [eeg, exg] = [&announced.frame().eeg.info, &announced.frame().exg.info];
    assert_eq!(eeg.transducter, format!("electrodes; {unrecorded}"));
    assert_eq!(exg.transducter, "electrodes");
    let key = "electrodes not recorded";
    assert_eq!(harness.figure("device", key), unrecorded);

    harness.board.substitutes = Substitutes::NONE;
    harness.reboot(0);
    harness.code(0, false);
    let frame = harness.recorder.encoded.last().unwrap();
    assert_eq!(frame.eeg.info.transducter, "autoencoder");
    assert!(!harness.report("device").contains(key));
}

#[test]
fn stamps_refer_to_the_chosen_point_of_the_frame() {
    // Device clock and host clock show the same time. The code is made and read at 1.0625 s.
    let made_ns = WALL_START_NS + 1_062_500_000;
    for (stamp, expected) in [
        // The first step of the window is 15 steps of 7.8125 ms before its last step: 117,187 us,
        // rounded down. The filters delay by 10 ms.
        (StampPoint::First, made_ns - 117_187_000 - 10_000_000),
        (StampPoint::Last, made_ns - 10_000_000),
        (StampPoint::Arrival, made_ns),
    ] {
        let mut harness = Harness::streaming(Settings { stamp, ..SETTINGS }, Board::new());
        harness.code(0, false);
        assert_eq!(harness.recorder.encoded[0].header.stamp.nanoseconds(), expected, "{stamp:?}");
    }
}

#[test]
fn the_mains_frequency_is_sent_to_the_device() {
    let settings = Settings { mains_hz: 60, ..SETTINGS };
    let harness = Harness::streaming(settings, Board::new());
    assert!(matches!(harness.board.received[2].1, ToDevice::Start(start) if start.mains_hz == 60));
}

#[test]
fn a_loss_is_a_warning_in_one_report() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(0, false);
    harness.code(0, true);
    harness.code(0, false);
    assert_eq!(harness.status("loss").unwrap().level, DiagnosticLevel::Warn);
    let after = harness.core.diagnostics(at(harness.now_us)).status;
    let is_ok = |status: &DiagnosticStatus| status.level == DiagnosticLevel::Ok;
    assert!(after.iter().all(is_ok), "{after:?}");
}

#[test]
fn the_reconstruction_is_announced_only_if_codes_can_be_decoded() {
    let settings = Settings { announced: AnnouncedStream::Reconstructed, ..SETTINGS };
    let announced = |board| {
        let mut harness = Harness::connected(settings, board);
        harness.recorder.announced.remove(0).info
    };
    let info = announced(Board::new()).unwrap();
    assert_eq!(info.shape().nchannels, [61, 0, 8]);
    assert_eq!((info.shape().sr, info.shape().nsamples), (128, 8));
    assert_eq!(announced(Board::of_another_model()), None);
}
