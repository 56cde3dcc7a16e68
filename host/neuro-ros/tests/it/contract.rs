//! Frames that violate the contract are refused before a consumer receives them.

use neuro_ros::{
    AcquisitionInfo, BlockError, ContractError, NeuroDataInfo, NeuroFrame, Shape, WireError,
};

/// Returns a frame of 32 samples of `channels` electrodes, without bipolar channels.
fn frame_of(channels: usize) -> NeuroFrame {
    let eeg = NeuroDataInfo { nsamples: 32, minmax: vec![-1.0, 1.0], ..NeuroDataInfo::default() };
    let labels = (0..channels).map(|channel| format!("c{channel}"));
    let eeg = eeg.with_labels(labels.collect());
    NeuroFrame::zeros(512, "test", eeg, NeuroDataInfo::default())
}

fn frame() -> NeuroFrame {
    frame_of(61)
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
    let expected = Shape { sr: 512, nsamples: 32, nchannels: [61, 0, 8] };
    assert_eq!(shape, expected);
    let text = "32 samples of 61 + 0 + 8 channels at 512 Hz";
    assert_eq!(shape.to_string(), text);
}

#[test]
fn every_rule_is_checked_in_every_block() {
    use BlockError::{IsInt, Labels, Length, MinMax, Stride};
    use ContractError::{Block, Rate};
    macro_rules! assert_error {
        ($change:expr, $error:pat) => {
            let error = error_after($change);
            assert!(matches!(error, $error), "{error}");
        };
    }
    assert_error!(|f| drop(f.eeg.info.labels.pop()), Block("eeg", Labels { .. }));
    assert_error!(|f| f.exg.info.labels.push("x".into()), Block("exg", Labels { .. }));
    assert_error!(|f| f.tri.info.minmax.clear(), Block("tri", MinMax(_)));
    assert_error!(|f| f.eeg.info.minmax = vec![1.0, -1.0], Block(_, MinMax(_)));
    assert_error!(|f| f.eeg.info.minmax[1] = f64::INFINITY, Block(_, MinMax(_)));
    assert_error!(|f| f.eeg.info.minmax.push(2.0), Block(_, MinMax(_)));
    assert_error!(|f| f.exg.info.stride = 4, Block("exg", Stride(4, _)));
    assert_error!(|f| f.tri.data.push(0), Block("tri", Length { .. }));
    assert_error!(|f| f.tri.info.nsamples = 1, Block("tri", Length { .. }));
    assert_error!(|f| f.tri.info.isint = 0, Block("tri", IsInt(0)));
    assert_error!(|f| f.sr = 500, Rate { sr: 500, nsamples: 32 });
    assert_error!(|f| f.sr = 0, Rate { .. });
}

#[test]
fn an_inconsistent_frame_cannot_be_announced() {
    let mut wrong = frame();
    wrong.eeg.info.minmax.clear();
    assert!(AcquisitionInfo::new("board", "1", wrong).is_err());
}

#[test]
fn a_frame_of_another_shape_is_refused_for_the_rest_of_the_session() {
    let shape = Shape::from_frame(&frame()).unwrap();
    assert_eq!(shape.admit(&frame()), Ok(()));
    let error = shape.admit(&frame_of(62)).unwrap_err();
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
    assert!(matches!(cut, Err(WireError::Truncated(_))));
}
