//! The checksum over constants in flash, which reveals damage.

use ::packed::Starts;
use int8_nn::Pair;

/// FNV-1a checksum of the words added so far.
pub(crate) struct Checksum(u32);

impl Checksum {
    pub(crate) const EMPTY: Self = Self(0x811c_9dc5);

    pub(crate) const fn add_word(&mut self, word: u32) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0100_0193);
    }

    pub(crate) const fn add_words(&mut self, words: &[i32]) {
        let mut index = 0;
        while index < words.len() {
            self.add_word(words[index].cast_unsigned());
            index += 1;
        }
    }

    pub(crate) const fn add_pairs(&mut self, pairs: &[Pair]) {
        let mut index = 0;
        while index < pairs.len() {
            self.add_word(pairs[index].0);
            index += 1;
        }
    }

    pub(crate) const fn add_bytes(&mut self, bytes: &[u8]) {
        let mut index = 0;
        while index < bytes.len() {
            self.add_word(bytes[index] as u32);
            index += 1;
        }
    }

    pub(crate) const fn add_starts(&mut self, starts: &Starts) {
        let numbers = starts.as_flattened().as_flattened();
        let mut index = 0;
        while index < numbers.len() {
            self.add_word(numbers[index] as u32);
            index += 1;
        }
    }

    pub(crate) const fn value(&self) -> u32 {
        self.0
    }
}
