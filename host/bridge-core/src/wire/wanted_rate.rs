//! Rate of the packed code that a device is to have.

/// Rate that the device is to have, and whether it has answered the command for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WantedRate {
    rate: u8,
    is_answered: bool,
}

impl WantedRate {
    pub(crate) const fn new(rate: u8) -> WantedRate {
        WantedRate {
            rate,
            is_answered: false,
        }
    }

    /// Returns the rate if the device has not answered the command for it.
    pub(crate) fn due(self) -> Option<u8> {
        (!self.is_answered).then_some(self.rate)
    }

    /// Records that the device has answered the command for `rate`, whatever it says.
    pub(crate) fn answered(&mut self, rate: u8) {
        self.is_answered |= rate == self.rate;
    }

    /// Makes the rate due again, for a device that may have another one.
    pub(crate) fn mark_unsent(&mut self) {
        self.is_answered = false;
    }
}
