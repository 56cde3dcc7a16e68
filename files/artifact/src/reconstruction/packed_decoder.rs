//! Blocks of the packed code back to microvolts.

use crate::PackedModel;
use packed::{BlockReader, Context, Magnitude, Malformed, RATES, Rate, Tables};

use super::synthesis::Synthesis;

/// Number of predicted blocks after a loss until the error is nearly that of a stream without loss.
/// Measured after this many blocks: 1.12 to 1.20 times that error after 1 to 12 lost blocks, and
/// 1.15 times if the first received block comes from the middle of a run of predicted blocks.
pub const HEALING_BLOCKS: usize = 8;

/// Decodes consecutive blocks of the packed code.
///
/// The state is that of the encoder, bit for bit, from the first block without prediction on. After
/// a lost block it differs, and approaches the encoder's with every block; the next block without
/// prediction sets it right.
#[derive(Clone, Debug)]
pub struct PackedDecoder {
    model: PackedModel,
    costs: Box<packed::Costs>,
    synthesis: Synthesis,
    /// Smoother of each rate that has occurred, `[coefficient][residual of the next block]`.
    smoothers: Vec<Option<Vec<f32>>>,
    state: Vec<i16>,
    /// Signals of the prediction, microvolts, once it is equal to the state: they are then those of
    /// every further lost block.
    standing: Option<Vec<f32>>,
    health: Health,
}

/// How closely the decoder's state follows the encoder's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Health {
    /// The states are equal, bit for bit.
    Equal,
    /// A block was lost, and `blocks` predicted blocks have been decoded since; the states approach
    /// each other.
    Healing { blocks: usize },
    /// No block has been decoded.
    Unknown,
}

/// A decoded block.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedBlock {
    /// Signals of the block as decoded without the next one, microvolts, in the order step,
    /// electrode.
    pub microvolts: Vec<f32>,
    /// Signals of the block before, better than when they were decoded; `None` if this block says
    /// nothing about them, because it has no prediction or is not the next one.
    pub smoothed: Option<Vec<f32>>,
    /// True if the state is close to that of the encoder: equal, or long enough after a loss.
    pub is_sound: bool,
}

impl PackedDecoder {
    /// Creates a decoder that waits for a block without prediction.
    pub fn new(model: &PackedModel) -> Self {
        Self {
            costs: model.costs(),
            synthesis: Synthesis::new(model),
            smoothers: vec![None; RATES],
            state: vec![0; model.coefficients()],
            standing: None,
            health: Health::Unknown,
            model: model.clone(),
        }
    }

    /// Forgets all blocks: waits for a block without prediction again.
    pub fn restart(&mut self) {
        self.state.fill(0);
        self.standing = None;
        self.health = Health::Unknown;
    }

    /// Decodes the next block; `announced` is the rate of the stream.
    ///
    /// # Errors
    /// If the bytes are no block of this model. The decoder is unchanged; call [`Self::skip`] for
    /// the block.
    pub fn decode(&mut self, bytes: &[u8], announced: Rate) -> Result<PackedBlock, Malformed> {
        let reader = BlockReader::new(bytes, announced)?;
        let header = reader.header();
        let levels = if header.is_reset {
            &self.model.reset_levels
        } else {
            &self.model.predicted_levels
        };
        let mut contexts = vec![Context::EMPTY; levels.len()];
        packed::prepare_contexts(levels, header.rate, &mut contexts);
        let tables = Tables {
            starts: &self.model.starts,
            costs: &self.costs,
        };
        let mut magnitudes = vec![Magnitude::ZERO; levels.len()];
        reader.read_magnitudes(&contexts, &tables, &mut magnitudes)?;
        self.standing = None;
        let before = self.state.clone();
        let prediction = self.prediction(header.is_reset);
        self.state.clone_from(&prediction);
        packed::update_state(&magnitudes, header.rate, &mut self.state);
        let is_continuation = !header.is_reset && self.health != Health::Unknown;
        let smoothed = is_continuation.then(|| self.smoothed(&before, &prediction, header.rate));
        self.health = match self.health {
            _ if header.is_reset => Health::Equal,
            // The block before it is lost.
            Health::Unknown => Health::Healing { blocks: 1 },
            Health::Healing { blocks } => Health::Healing {
                blocks: blocks.saturating_add(1),
            },
            Health::Equal => Health::Equal,
        };
        Ok(PackedBlock {
            microvolts: self.synthesis.microvolts(&self.state),
            smoothed,
            is_sound: self.is_sound(),
        })
    }

    /// Passes a lost block: its signals are those of its prediction, which the call returns,
    /// microvolts.
    ///
    /// # Timing
    /// As long as decoding, until the prediction is equal to the state. Then, which is after some
    /// blocks, nothing is left to compute.
    pub fn skip(&mut self) -> Vec<f32> {
        self.health = Health::Healing { blocks: 0 };
        if let Some(microvolts) = &self.standing {
            return microvolts.clone();
        }
        let prediction = self.prediction(false);
        let microvolts = self.synthesis.microvolts(&prediction);
        if prediction == self.state {
            self.standing = Some(microvolts.clone());
        }
        self.state = prediction;
        microvolts
    }

    /// Returns the state after the newest block, units of a coefficient.
    pub fn state(&self) -> &[i16] {
        &self.state
    }

    fn is_sound(&self) -> bool {
        match self.health {
            Health::Equal => true,
            Health::Healing { blocks } => blocks > HEALING_BLOCKS,
            Health::Unknown => false,
        }
    }

    fn prediction(&self, is_reset: bool) -> Vec<i16> {
        if is_reset {
            vec![0; self.state.len()]
        } else {
            self.model.predict(&self.state)
        }
    }

    /// Returns the signals of the block before, whose state was `before`, corrected by what the
    /// newest block adds to its prediction.
    fn smoothed(&mut self, before: &[i16], prediction: &[i16], rate: Rate) -> Vec<f32> {
        let model = &self.model;
        let smoother = self
            .smoothers
            .get_mut(usize::from(rate.index()))
            .map(|smoother| smoother.get_or_insert_with(|| model.smoother.matrix(rate.index())));
        let residual: Vec<f32> = self
            .state
            .iter()
            .zip(prediction)
            .map(|(&state, &prediction)| f32::from(state) - f32::from(prediction))
            .collect();
        let rows = smoother
            .map_or(&[][..], |matrix| matrix)
            .chunks_exact(residual.len().max(1));
        let corrected: Vec<f32> = before
            .iter()
            .zip(rows)
            .map(|(&state, row)| {
                let products = row.iter().zip(&residual);
                f32::from(state)
                    + products
                        .map(|(weight, residual)| weight * residual)
                        .sum::<f32>()
            })
            .collect();
        self.synthesis.microvolts_of(&corrected)
    }
}
