//! Random changes of valid inputs.

use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};

/// Bytes that are likely to break numbers in texts, and fields with lengths.
const SPECIAL: &[u8] = b"0189-+.,eE \0\x01\x14\x7f\x80\xff<>&\"=[]";

/// Returns one of `seeds` with up to eight changes.
///
/// # Panics
/// When there is no seed.
pub(crate) fn mutate(seeds: &[Vec<u8>], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = seeds.choose(random).expect("a seed").clone();
    for _ in 0..random.random_range(0..=8) {
        change(&mut bytes, seeds, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut impl Rng) {
    let at = random.random_range(0..=bytes.len());
    let length = random.random_range(0..=16.min(bytes.len() - at));
    let special = |random: &mut _| *SPECIAL.choose(random).unwrap_or(&0);
    match random.random_range(0..8) {
        0 => bytes[at..at + length].fill_with(|| random.random()),
        1 => bytes[at..at + length].fill_with(|| special(random)),
        2 => drop(bytes.drain(at..at + length)),
        3 => {
            let copy = bytes[at..at + length].to_vec();
            bytes.splice(at..at, copy);
        }
        4 => bytes.truncate(at),
        5 => {
            let other = seeds.choose(random).expect("a seed");
            let from = random.random_range(0..=other.len());
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from..]);
        }
        6 => {
            let number: i64 =
                *[0, 1, -1, 127, 255, 65_535, i64::MAX, i64::MIN].choose(random).unwrap_or(&0);
            let number = number.to_le_bytes();
            bytes[at..at + length.min(8)].copy_from_slice(&number[..length.min(8)]);
        }
        _ => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << random.random_range(0..8);
            }
        }
    }
}
