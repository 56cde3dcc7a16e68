//! What others publish: measured elsewhere, on other code and settings.

/// A published figure.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub(crate) struct Published {
    /// Library and function.
    pub(crate) name: &'static str,
    /// Instructions per sample and channel, six sections in 4-sample blocks.
    pub(crate) insn_per_sample_channel: [u32; 2],
    /// In-band noise, in words, where one is published.
    pub(crate) noise: &'static str,
}

/// CMSIS-DSP and idsp with six biquads on 61 channels, counted on mps2-an386 with an earlier
/// compiler; coefficients, scaling and order of the sections are not those of this run.
pub(crate) const PUBLISHED: [Published; 5] = [
    Published {
        name: "CMSIS-DSP arm_biquad_cas_df1_32x64_q31",
        insn_per_sample_channel: [462, 462],
        noise: "7.5 nV",
    },
    Published {
        name: "CMSIS-DSP arm_biquad_cascade_df1_q31",
        insn_per_sample_channel: [162, 162],
        noise: "660 nV",
    },
    Published {
        name: "CMSIS-DSP arm_biquad_cascade_df2T_f32",
        insn_per_sample_channel: [97, 108],
        noise: "12 nV",
    },
    Published {
        name: "idsp 0.23 DirectForm1Dither",
        insn_per_sample_channel: [133, 133],
        noise: "10 nV",
    },
    Published {
        name: "idsp 0.23 DirectForm1Wide",
        insn_per_sample_channel: [222, 222],
        noise: "7.5 nV",
    },
];
