//! Tests that blocks are read as they were written, for any magnitudes, rates and residuals.

use std::sync::LazyLock;

use packed::{
    BlockReader, Context, Costs, Header, LEVELS, MAGNITUDES, Magnitude, Malformed, Rate, Starts,
    Tables,
};
use proptest::prelude::*;

/// Returns tables of geometric distributions: at level 0 nearly all magnitudes are 0, at level 63
/// all magnitudes are nearly equally likely.
fn tables() -> Tables<'static> {
    static TABLES: LazyLock<(Box<Starts>, Box<Costs>)> = LazyLock::new(geometric);
    Tables { starts: &TABLES.0, costs: &TABLES.1 }
}

fn geometric() -> (Box<Starts>, Box<Costs>) {
    let mut starts = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    let mut costs = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    let rows = starts.iter_mut().flatten();
    for (level, (starts, costs)) in (0_u32..).zip(rows.zip(costs.iter_mut().flatten())) {
        let ratio = 0.001 + f64::from(level % 64) / 70.0;
        let weights: Vec<f64> = (0..16).map(|magnitude| ratio.powi(magnitude)).collect();
        let sum: f64 = weights.iter().sum();
        let mut start = 0;
        let places = starts.iter_mut().zip(costs).zip(&weights).zip(0_u8..);
        for (((place, cost), weight), magnitude) in places {
            *place = start;
            let count = u16::try_from(to_integer(weight / sum * 32_000.0)).expect("below 2^15");
            let count = count.clamp(1, 32_768 - start - (15 - u16::from(magnitude)));
            let bits = 15.0 - f64::from(count).log2() + f64::from(magnitude.min(1));
            *cost = u8::try_from(to_integer(bits * 16.0).min(255)).expect("at most 255");
            start += count;
        }
    }
    (starts, costs)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small positive numbers"
)]
fn to_integer(value: f64) -> u32 {
    value as u32
}

fn contexts(levels: &[u8], rate: Rate) -> Vec<Context> {
    let mut contexts = vec![Context::EMPTY; levels.len()];
    packed::prepare_contexts(levels, rate, &mut contexts);
    contexts
}

fn rates() -> impl Strategy<Value = Rate> {
    (0_u8..16).prop_map(|index| Rate::new(index).expect("sixteen rates"))
}

proptest! {
    #[test]
    fn every_block_is_read_as_it_was_written(
        levels in prop::collection::vec(0_u8..64, 1..200),
        values in prop::collection::vec(prop_oneof![8 => 0_u16..3, 3 => 0_u16..40, 1 => any::<u16>()], 200),
        signs in prop::collection::vec(any::<bool>(), 200),
        rate in rates(),
        announced in rates(),
        is_reset in any::<bool>(),
    ) {
        let tables = tables();
        prop_assert!(tables.is_consistent());
        let contexts = contexts(&levels, rate);
        let magnitudes: Vec<Magnitude> = values
            .iter()
            .zip(&signs)
            .take(levels.len())
            .map(|(&value, &sign)| Magnitude { value, is_negative: sign && value > 0 })
            .collect();
        let header = Header { rate, is_reset };
        let mut bytes = vec![0xaa; 2048];
        let length = packed::write_block(header, announced, &magnitudes, &contexts, &tables, &mut bytes);
        prop_assert!(length <= 8 + levels.len() * 6, "{length}");
        prop_assert!(length == 0 || bytes[length - 1] != 0);
        let reader = BlockReader::new(&bytes[..length], announced).expect("a block");
        prop_assert_eq!(reader.header(), header);
        let mut read = vec![Magnitude::default(); levels.len()];
        reader.read_magnitudes(&contexts, &tables, &mut read).expect("magnitudes");
        prop_assert_eq!(read, magnitudes.clone());
        // A buffer that is too short changes neither the length nor a byte after the buffer.
        let cut = length / 2;
        bytes[cut..].fill(0xaa);
        let again = packed::write_block(header, announced, &magnitudes, &contexts, &tables, &mut bytes[..cut]);
        prop_assert_eq!(again, length);
        prop_assert!(bytes[cut..].iter().all(|&byte| byte == 0xaa));
    }

    #[test]
    fn the_state_is_within_four_steps_of_every_residual(
        residual in prop::collection::vec(prop_oneof![3 => -300_i32..300, 1 => -32_768_i32..32_768], 1..256),
        rate in rates(),
    ) {
        let tables = tables();
        let contexts = contexts(&vec![30; residual.len()], rate);
        let mut survivors = vec![0; residual.len()];
        let mut magnitudes = vec![Magnitude::default(); residual.len()];
        packed::quantise(&residual, &contexts, &tables, rate, &mut survivors, &mut magnitudes);
        let mut state = vec![0; residual.len()];
        packed::update_state(&magnitudes, rate, &mut state);
        for (state, residual) in state.iter().zip(&residual) {
            // The error is largest where magnitude 0 replaces a point: up to four steps.
            prop_assert!((i32::from(*state) - residual).abs() <= 4 * rate.step() + 1);
        }
    }

    #[test]
    fn no_bytes_make_the_reader_fail_otherwise_than_with_an_error(
        bytes in prop::collection::vec(any::<u8>(), 0..120),
        rate in rates(),
    ) {
        let tables = tables();
        let read = || -> Result<(), Malformed> {
            let reader = BlockReader::new(&bytes, rate)?;
            let contexts = contexts(&[20; 192], reader.header().rate);
            let mut magnitudes = vec![Magnitude::default(); 192];
            reader.read_magnitudes(&contexts, &tables, &mut magnitudes)?;
            let mut state = vec![0; 192];
            packed::update_state(&magnitudes, rate, &mut state);
            Ok(())
        };
        let _ = read();
    }
}

#[test]
fn a_block_of_zeros_has_no_bytes() {
    let tables = tables();
    let rate = Rate::MIDDLE;
    let contexts = contexts(&[10; 192], rate);
    let zeros = [Magnitude::default(); 192];
    let header = Header { rate, is_reset: false };
    let length = packed::write_block(header, rate, &zeros, &contexts, &tables, &mut []);
    assert_eq!(length, 0);
    let reader = BlockReader::new(&[], rate).expect("no bytes are a block");
    assert_eq!(reader.header(), header);
    let mut read = [Magnitude { value: 7, is_negative: true }; 192];
    reader.read_magnitudes(&contexts, &tables, &mut read).expect("zeros");
    assert_eq!(read, zeros);
}

#[test]
fn bytes_behind_a_block_are_refused() {
    let tables = tables();
    let rate = Rate::MIDDLE;
    let contexts = contexts(&[10; 16], rate);
    let bytes = [1; 60];
    let reader = BlockReader::new(&bytes, rate).expect("a header");
    let mut read = [Magnitude::default(); 16];
    assert_eq!(reader.read_magnitudes(&contexts, &tables, &mut read), Err(Malformed));
    assert_eq!(BlockReader::new(&[1, 0], rate).map(|_| ()), Err(Malformed));
}
