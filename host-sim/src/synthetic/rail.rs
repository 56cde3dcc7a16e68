//! Episodes with one electrode at the ADC's rail, as if the electrode had come loose.

use super::noise::Noise;

/// Added voltage, uV: far beyond the ADC's +-187,500 uV, so the count is clipped whatever the other
/// components are.
const RAIL_UV: f64 = 1e6;

#[derive(Debug, Clone)]
pub(super) struct Rails {
    noise: Noise,
    electrodes: usize,
    rate: f64,
    wait: u32,
    /// Index of the electrode, added voltage in uV and number of remaining samples of the current
    /// episode; `None` between episodes.
    now: Option<(usize, f64, u32)>,
}

impl Rails {
    pub(super) fn new(mut noise: Noise, electrodes: usize, rate: f64) -> Self {
        let wait = noise.samples(5.0, 20.0, rate);
        Self {
            noise,
            electrodes,
            rate,
            wait,
            now: None,
        }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        let Some((electrode, added_uv, left)) = self.now else {
            self.wait -= 1;
            if self.wait == 0 && self.electrodes > 0 {
                let electrode = self.noise.index(self.electrodes);
                let added_uv = if self.noise.uniform(0.0, 1.0) < 0.5 {
                    -RAIL_UV
                } else {
                    RAIL_UV
                };
                self.now = Some((electrode, added_uv, self.noise.samples(0.2, 1.5, self.rate)));
            }
            if self.wait == 0 {
                self.wait = self.noise.samples(5.0, 20.0, self.rate);
            }
            return;
        };
        microvolts[electrode] += added_uv;
        self.now = (left > 1).then_some((electrode, added_uv, left - 1));
    }
}
