//! The streaming encoder against model-gen's batch reference: other loops, other layout, same
//! integers.

use std::{path::Path, sync::LazyLock};

use model_gen::IntegerModel;
use pipeline::{CELLS, Encoder, Plane};
use proptest::prelude::*;

const STEPS: usize = model::STEPS;

static REFERENCE: LazyLock<IntegerModel> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
    let artifact = artifact::Artifact::read(&folder).expect("the checked-in artifact is readable");
    model_gen::quantise(&artifact).expect("the checked-in artifact is quantisable")
});

/// Every code of a stream, and the reference's code of the window that it belongs to.
fn assert_equal_on(planes: &[Plane]) {
    let mut encoder = Encoder::new();
    let mut codes = 0;
    for (step, plane) in planes.iter().enumerate() {
        let Some(output) = encoder.push(plane) else {
            continue;
        };
        let window: &[Plane; STEPS] = planes[step + 1 - STEPS..=step]
            .try_into()
            .expect("a window has 16 steps");
        assert_eq!(
            output.values,
            REFERENCE.encode_window(window),
            "window {}",
            output.window
        );
        assert_eq!(output.window as usize, codes);
        codes += 1;
    }
    assert_eq!(codes, (planes.len() - STEPS) / model::HOP + 1);
}

fn stream(value: impl Fn(usize, usize) -> i8) -> Vec<Plane> {
    (0..40)
        .map(|step| std::array::from_fn(|cell| value(step, cell)))
        .collect()
}

#[test]
fn silence_rails_and_impulses_give_the_reference_s_codes() {
    assert_equal_on(&stream(|_, _| 0));
    assert_equal_on(&stream(|_, _| 127));
    assert_equal_on(&stream(|_, _| -128));
    assert_equal_on(&stream(
        |step, cell| if (step + cell) % 2 == 0 { 127 } else { -128 },
    ));
    assert_equal_on(&stream(
        |step, cell| if (step, cell) == (20, 40) { 127 } else { 0 },
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_stream_gives_the_reference_s_codes(
        planes in prop::collection::vec(prop::collection::vec(any::<i8>(), CELLS), 16..48)
    ) {
        let planes: Vec<Plane> =
            planes.into_iter().map(|plane| plane.try_into().expect("90 cells")).collect();
        assert_equal_on(&planes);
    }
}

#[test]
fn the_golden_codes_come_out_again() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
    let golden = artifact::Golden::read(&folder).expect("the checked-in golden is readable");
    assert!(
        !golden.windows.is_empty(),
        "a golden without windows proves nothing"
    );
    for (window, code) in golden.windows.iter().zip(&golden.codes) {
        let mut encoder = Encoder::new();
        let last = window.iter().filter_map(|plane| encoder.push(plane)).last();
        assert_eq!(last.map(|output| output.values).as_ref(), Some(code));
    }
}
