//! Frames that violate the contract are refused before a consumer receives them.

use neuro_ros::{AcquisitionInfo, ContractError, NeuroDataInfo, NeuroFrame, Shape, WireError};

fn info(nsamples: u16, nchannels: u16, isint: u8) -> NeuroDataInfo {
    NeuroDataInfo {
        nsamples,
        nchannels,
        stride: nchannels * 4,
        unit: "uV".into(),
        transducter: "test".into(),
        prefiltering: String::new(),
        isint,
        minmax: vec![-1.0, 1.0],
        labels: (0..nchannels)
            .map(|channel| format!("c{channel}"))
            .collect(),
    }
}

fn frame() -> NeuroFrame {
    let mut frame = NeuroFrame {
        sr: 512,
        ..NeuroFrame::default()
    };
    frame.eeg.info = info(32, 61, 0);
    frame.eeg.data = vec![0.0; 32 * 61];
    frame.exg.info = info(32, 0, 0);
    frame.tri.info = info(32, 8, 1);
    frame.tri.data = vec![0; 32 * 8];
    frame
}

/// Applies `change` to a valid frame and returns the error from [`Shape::from_frame`].
fn error_after(change: impl FnOnce(&mut NeuroFrame)) -> ContractError {
    let mut frame = frame();
    change(&mut frame);
    Shape::from_frame(&frame).unwrap_err()
}

#[test]
fn a_frame_that_fulfils_the_contract_has_a_shape() {
    let shape = Shape::from_frame(&frame()).unwrap();
    let expected = Shape {
        sr: 512,
        nsamples: 32,
        nchannels: [61, 0, 8],
    };
    assert_eq!(shape, expected);
    let text = "32 samples of 61 + 0 + 8 channels at 512 Hz";
    assert_eq!(shape.to_string(), text);
}

#[test]
fn every_rule_is_checked_in_every_block() {
    use ContractError::{IsInt, Labels, Length, MinMax, Rate, Stride};
    macro_rules! assert_error {
        ($change:expr, $error:pat) => {
            let error = error_after($change);
            assert!(matches!(error, $error), "{error}");
        };
    }
    assert_error!(
        |f| drop(f.eeg.info.labels.pop()),
        Labels { block: "eeg", .. }
    );
    assert_error!(
        |f| f.exg.info.labels.push("x".into()),
        Labels { block: "exg", .. }
    );
    assert_error!(|f| f.tri.info.minmax.clear(), MinMax { block: "tri", .. });
    assert_error!(|f| f.eeg.info.minmax = vec![1.0, -1.0], MinMax { .. });
    assert_error!(|f| f.eeg.info.minmax[1] = f64::INFINITY, MinMax { .. });
    assert_error!(|f| f.eeg.info.minmax.push(2.0), MinMax { .. });
    assert_error!(|f| f.exg.info.stride = 4, Stride { block: "exg", .. });
    assert_error!(|f| f.tri.data.push(0), Length { block: "tri", .. });
    assert_error!(|f| f.tri.info.nsamples = 1, Length { block: "tri", .. });
    assert_error!(
        |f| f.tri.info.isint = 0,
        IsInt {
            block: "tri",
            isint: 0
        }
    );
    assert_error!(
        |f| f.sr = 500,
        Rate {
            sr: 500,
            nsamples: 32
        }
    );
    assert_error!(|f| f.sr = 0, Rate { .. });
}

#[test]
fn an_inconsistent_frame_cannot_be_announced() {
    let mut wrong = frame();
    wrong.eeg.info.minmax.clear();
    assert!(AcquisitionInfo::new("board", "1", wrong).is_err());
    let info = AcquisitionInfo::new("board", "1", frame()).unwrap();
    assert_eq!(info.shape().nchannels, [61, 0, 8]);
}

#[test]
fn a_frame_of_another_shape_is_refused_for_the_rest_of_the_session() {
    let shape = Shape::from_frame(&frame()).unwrap();
    assert_eq!(shape.admit(&frame()), Ok(()));
    let mut larger = frame();
    larger.eeg.info = info(32, 62, 0);
    larger.eeg.data = vec![0.0; 32 * 62];
    let error = shape.admit(&larger).unwrap_err();
    assert!(matches!(error, ContractError::Changed { .. }));
    assert!(error.to_string().contains("61 + 0 + 8") && error.to_string().contains("62 + 0 + 8"));
}

#[test]
fn the_announcement_survives_a_round_trip_and_a_false_result_is_none() {
    let info = AcquisitionInfo::new("board", "1", frame()).unwrap();
    let bytes = info.to_response();
    assert_eq!(bytes[0], 1);
    assert_eq!(AcquisitionInfo::from_response(&bytes), Ok(Some(Ok(info))));
    let mut nothing = bytes.clone();
    nothing[0] = 0;
    assert_eq!(AcquisitionInfo::from_response(&nothing), Ok(None));
    let cut = AcquisitionInfo::from_response(&bytes[..9]);
    assert!(matches!(cut, Err(WireError::Truncated { .. })));
}
