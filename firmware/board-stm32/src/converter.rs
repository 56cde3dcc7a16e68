//! The chain of converters behind [`firmware::Converter`].

use ads1299::{CHANNELS, Chain, Configured, Decoder, Error, Settings, Streaming};
use defmt::{Display2Format, error, info};
use embassy_stm32::{exti::ExtiInput, gpio::Output, mode::Blocking};
use embassy_time::{Instant, with_deadline};
use firmware::{Conversion, Converter, deadlines};
use pipeline::Sample;

use crate::{Bus, FRAME_BYTES, delay::Delay, drdy};

/// Converters in the chain.
pub const CHIPS: usize = 8;

const _: () = assert!(model::CHANNELS == CHIPS * CHANNELS);

/// Samples without DRDY after which the chain is taken to be silent.
const SILENCE: u32 = 4;

/// The wires between microcontroller and chain.
pub struct Wires {
    /// SPI of all chips.
    pub bus: Bus,
    /// Their selects; chip 0 is the one at MISO.
    pub selects: [Output<'static>; CHIPS],
    /// START of all chips.
    pub start: Output<'static>,
    /// RESET of all chips.
    pub reset: Output<'static>,
    /// DRDY of chip 0, for falling edges, on one of EXTI's lines 5 to 9.
    pub drdy: ExtiInput<'static, Blocking>,
}

type Wired = Chain<Bus, Output<'static>, Delay, CHIPS>;
type Started<'a> = Streaming<'a, Bus, Output<'static>, Delay, CHIPS>;

impl Wires {
    /// The chain, and the input that tells of its samples, asleep.
    pub(crate) fn into_chain(mut self) -> (Wired, ExtiInput<'static, Blocking>) {
        self.drdy.disable_interrupt();
        let chain = Chain {
            spi: self.bus,
            selects: self.selects,
            start: self.start,
            reset: self.reset,
            delay: Delay,
        };
        (chain, self.drdy)
    }
}

/// Brings the chain up; what is wrong is logged, and then nothing converts.
pub(crate) async fn power_up(
    chain: &mut Wired,
) -> Option<Configured<'_, Bus, Output<'static>, Delay, CHIPS>> {
    said(chain.power_up(&Settings::EEG).await)
}

fn said<T>(result: Result<T, Error>) -> Option<T> {
    result
        .inspect_err(|error| error!("{}", Display2Format(error)))
        .ok()
}

/// A chain that converts, or one that could not be brought up.
pub(crate) struct Adc<'a> {
    chain: Option<Started<'a>>,
    decoder: Decoder<CHIPS>,
    frame: [u8; FRAME_BYTES],
    counts: [[i32; CHANNELS]; CHIPS],
    /// Until when the next edge must come.
    due: Instant,
    silent: bool,
}

impl<'a> Adc<'a> {
    /// Starts the chain, if there is one.
    pub(crate) async fn start(
        configured: Option<&'a mut Configured<'_, Bus, Output<'static>, Delay, CHIPS>>,
        drdy: &mut ExtiInput<'static, Blocking>,
    ) -> Self {
        drdy.enable_interrupt();
        let mut chain = None;
        if let Some(configured) = configured {
            chain = said(configured.start().await);
        }
        if let Some(chain) = &mut chain {
            chain.chain.spi.quicken();
            info!("{} converters run", CHIPS);
        }
        Self {
            chain,
            decoder: Decoder::new(),
            frame: [0; FRAME_BYTES],
            counts: [[0; CHANNELS]; CHIPS],
            due: Instant::now() + SILENCE * deadlines::SAMPLE,
            silent: false,
        }
    }

    /// Reads the frame that is ready; chips with a bad status keep their counts of before.
    async fn read(&mut self, sample: &mut Sample) -> (bool, bool) {
        let Some(chain) = &mut self.chain else {
            return (true, false);
        };
        if chain.read(&mut self.frame).await.is_err() {
            return (true, false);
        }
        let status = self.decoder.decode(&self.frame, &mut self.counts);
        let places = sample.counts.as_chunks_mut::<CHANNELS>().0;
        for (chip, (place, counts)) in places.iter_mut().zip(&self.counts).enumerate() {
            if status.bad >> chip & 1 == 0 {
                *place = *counts;
            }
        }
        let words = status.words.iter();
        let off = words.fold(0, |off, word| {
            off | word.off_positive() | word.off_negative()
        });
        (!status.is_sound(), off != 0)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "ticks wrap")]
impl Converter for Adc<'_> {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        if let Ok(edge) = with_deadline(self.due, drdy::next()).await {
            self.silent = false;
            self.due = Instant::from_micros(edge.us) + SILENCE * deadlines::SAMPLE;
            let (status_bad, lead_off) = self.read(sample).await;
            return Conversion {
                drdy_us: edge.us,
                drdy_ticks: edge.us as u32,
                missed: edge.missed,
                status_bad,
                lead_off,
            };
        }
        // Nothing converts: samples that say so, in their rhythm.
        let drdy_us = self.due.as_micros();
        self.due += deadlines::SAMPLE;
        let before = core::mem::replace(&mut self.silent, true);
        Conversion {
            drdy_us,
            drdy_ticks: drdy_us as u32,
            missed: if before { 0 } else { SILENCE - 1 },
            status_bad: true,
            lead_off: false,
        }
    }
}
