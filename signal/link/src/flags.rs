//! Status flags of a window or of samples.

bit_set! {
    /// Faults and conditions, such as clipping, of a code's window or of the samples in a message:
    /// one bit for each.
    ///
    /// The host's bridge publishes the 16 bits as one value (in `tri` of
    /// `rosneuro_msgs/NeuroFrame`), which a recorder stores as float32 without loss. Bits that this
    /// version does not name are kept.
    #[derive(Hash)]
    pub struct Flags {
        /// Bit 0: a status word of the ADC chain was wrong at least once (chip dead, data shifted).
        const ADC_STATUS_BAD = 0;
        /// Bit 1: at least one ADC sample reached the converter's rail
        /// ([`crate::Code::saturated`]).
        const SATURATED = 1;
        /// Bit 2: the ADC reported lead-off, an electrode without contact, on at least one channel.
        const LEAD_OFF = 2;
        /// Bit 3: the filters have not settled yet after a start.
        const SETTLING = 3;
        /// Bit 4: at least one electrode value was clipped to int8 ([`crate::Code::clipped`]).
        const CLIPPED = 4;
        /// Bit 5: at least one ADC sample was lost: not read in time, or dropped by a full queue.
        const OVERRUN = 5;
        /// Bit 6: at least one value of the code was clipped ([`crate::Code::clipped_values`]).
        const CODE_CLIPPED = 6;
        /// Bit 7: the model does not represent the packed block well, for example because an
        /// electrode has no contact or the cap is not the model's.
        const MISFIT = 7;
        /// Bit 8: the packed block was too long and has no content; the host predicts its signals.
        const BLANK = 8;
        /// Bit 9: at least one electrode was excluded, and its values were filled from the others;
        /// [`Exclusion`](crate::Exclusion) names the electrodes.
        const SUBSTITUTED = 9;
        /// Bit 14: decoded signals have a larger error because of a loss. Either packed blocks
        /// before this block were lost, and the state of the host's decoder still differs from the
        /// device's, or a code is missing whose window contains steps of this message. Never set on
        /// the wire.
        const HEALING = 14;
        /// Bit 15: the bridge inserted this code or packed block in place of a lost one. Never set
        /// on the wire.
        const FILLER = 15;
    }
}

impl Flags {
    /// Names of the flags, in the order of their bits.
    pub const NAMES: [(Flags, &'static str); 12] = [
        (Flags::ADC_STATUS_BAD, "adc_status_bad"),
        (Flags::SATURATED, "saturated"),
        (Flags::LEAD_OFF, "lead_off"),
        (Flags::SETTLING, "settling"),
        (Flags::CLIPPED, "clipped"),
        (Flags::OVERRUN, "overrun"),
        (Flags::CODE_CLIPPED, "code_clipped"),
        (Flags::MISFIT, "misfit"),
        (Flags::BLANK, "blank"),
        (Flags::SUBSTITUTED, "substituted"),
        (Flags::HEALING, "healing"),
        (Flags::FILLER, "filler"),
    ];
}
