//! Decodes blocks of the packed code to microvolts.

use crate::PackedModel;
use packed::{BlockReader, Context, Magnitude, Malformed, RATES, Rate, Tables};

use super::synthesis::Synthesis;

/// Number of predicted blocks after a loss until the decoding error is nearly as small as without
/// loss. After 8 blocks, the error was 1.12 to 1.20 times the error without loss where 1 to 12
/// blocks were lost, and 1.15 times where decoding began in the middle of a run of predicted
/// blocks.
pub const HEALING_BLOCKS: usize = 8;

/// Decodes consecutive blocks of the packed code.
///
/// From the first block without prediction on, the decoder's state equals the encoder's, bit for
/// bit. After a lost block the two states differ. They approach each other with every block, and
/// are equal again after the next block without prediction.
#[derive(Clone, Debug)]
pub struct PackedDecoder {
    model: PackedModel,
    costs: Box<packed::Costs>,
    synthesis: Synthesis,
    /// Smoother matrix of each rate that has occurred, `[coefficient][residual of the next block]`.
    smoothers: Vec<Option<Vec<f32>>>,
    state: Vec<i16>,
    /// Signals, in microvolts, that every further lost block yields; `None` while a lost block
    /// still changes the state.
    standing: Option<Vec<f32>>,
    health: Health,
}

/// How closely the decoder's state follows the encoder's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Health {
    /// The decoder's state equals the encoder's, bit for bit.
    Equal,
    /// A block was lost, and `blocks` predicted blocks have been decoded since. The decoder's state
    /// approaches the encoder's.
    Healing { blocks: usize },
    /// No block has been decoded yet.
    Unknown,
}

/// The signals that the decoder returns for one block.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedBlock {
    /// Signals of the block, decoded without the next block: microvolts, in the order step,
    /// electrode.
    pub microvolts: Vec<f32>,
    /// Signals of the previous block, improved with this block; `None` if this block has no
    /// prediction or is the first one decoded.
    pub smoothed: Option<Vec<f32>>,
    /// True if the decoder's state equals the encoder's, or if more than [`HEALING_BLOCKS`]
    /// predicted blocks have been decoded since the last loss.
    pub is_sound: bool,
}

impl PackedDecoder {
    /// Creates a decoder that has seen no block yet.
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

    /// Forgets all blocks, as if the decoder were new.
    pub fn restart(&mut self) {
        self.state.fill(0);
        self.standing = None;
        self.health = Health::Unknown;
    }

    /// Decodes the next block. `announced` is the rate that the stream announces for its blocks.
    ///
    /// # Errors
    /// If the bytes are not a block of this model. The decoder is unchanged; call [`Self::skip`]
    /// instead.
    pub fn decode(&mut self, bytes: &[u8], announced: Rate) -> Result<PackedBlock, Malformed> {
        let reader = BlockReader::new(bytes, announced)?;
        let header = reader.header();
        let levels =
            if header.is_reset { &self.model.reset_levels } else { &self.model.predicted_levels };
        let mut contexts = vec![Context::EMPTY; levels.len()];
        packed::prepare_contexts(levels, header.rate, &mut contexts);
        let tables = Tables { starts: &self.model.starts, costs: &self.costs };
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
            // The first block that is decoded has a prediction, so earlier blocks were missed.
            Health::Unknown => Health::Healing { blocks: 1 },
            Health::Healing { blocks } => Health::Healing { blocks: blocks.saturating_add(1) },
            Health::Equal => Health::Equal,
        };
        Ok(PackedBlock {
            microvolts: self.synthesis.microvolts(&self.state),
            smoothed,
            is_sound: self.is_sound(),
        })
    }

    /// Replaces a lost block by its prediction, and returns the predicted signals, microvolts.
    ///
    /// # Timing
    /// Takes as long as decoding a block. After several lost blocks in a row, the prediction no
    /// longer changes the state, and the call only copies the previous result.
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

    /// Returns the state after the newest block, in units of a coefficient.
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
        if is_reset { vec![0; self.state.len()] } else { self.model.predict(&self.state) }
    }

    /// Returns the improved signals of the previous block, whose state was `before`. The newest
    /// block's residual (its state minus its `prediction`) reveals a part of the error of `before`.
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
        let rows = smoother.map_or(&[][..], |matrix| matrix).chunks_exact(residual.len().max(1));
        let corrected: Vec<f32> = before
            .iter()
            .zip(rows)
            .map(|(&state, row)| {
                let products = row.iter().zip(&residual);
                f32::from(state) + products.map(|(weight, residual)| weight * residual).sum::<f32>()
            })
            .collect();
        self.synthesis.microvolts_of(&corrected)
    }
}
