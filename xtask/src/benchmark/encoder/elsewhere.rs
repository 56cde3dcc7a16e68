//! What others take, counted elsewhere.

/// A figure from another run, on other code.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub(crate) struct Elsewhere {
    /// What was counted.
    pub(crate) name: &'static str,
    /// Instructions per code, both convolutions, fully connected layer and pool of this shape, without
    /// shortcut.
    pub(crate) insn_per_code: u32,
}

/// The same layers, counted on mps2-an386 with earlier compilers and with weights of their own. The
/// last is a prototype of this encoder without Winograd's transform.
pub(crate) const ELSEWHERE: [Elsewhere; 4] = [
    Elsewhere {
        name: "plain safe Rust, int8, batch",
        insn_per_code: 14_500_000,
    },
    Elsewhere {
        name: "CMSIS-NN, convolution by convolution, batch",
        insn_per_code: 11_150_000,
    },
    Elsewhere {
        name: "CMSIS-NN, tuned by hand, streamed",
        insn_per_code: 5_310_000,
    },
    Elsewhere {
        name: "direct SMLAD in Rust, streamed",
        insn_per_code: 2_480_000,
    },
];
