//! The schedule for a Cortex-M7, which issues an LDR and an SMLAD in the same cycle: loads and
//! products alternate.
//!
//! Within a segment, each register is reloaded right after its last use, and at least two other
//! products come before its next use.

schedule! {
    [
        // Load the weights of the first round. Each round loads the weights of the next one.
        ".if {shared} || (block == 0)",
        "ldm lr, {{r6-r9}}",
        ".endif",
    ]
    [
        ".set at, 3 * {position} * block",
        "ldr r10, [r12, #at]",
        "ldr r11, [r12, #(at + 4)]",
    ]
    [
        ".set last_of_segment, round == {rounds} - 1",
        ".set last_of_block, last_of_segment && (segment == {segments} - 1)",
        ".set more, !(last_of_block && ({shared} || (block == {blocks} - 1)))",
        ".if segment + round == 0",
        "smuad r0, r10, r6",
        "smuad r1, r10, r8",
        ".else",
        "smlad r0, r10, r6, r0",
        "smlad r1, r10, r8, r1",
        ".endif",
        "ldr r10, [r12, #(at + {position})]",
        "smlad r0, r11, r7, r0",
        "smlad r1, r11, r9, r1",
        "ldr r11, [r12, #(at + {position} + 4)]",
        ".if segment + round == 0",
        "smuad r2, r10, r6",
        "smuad r3, r10, r8",
        ".else",
        "smlad r2, r10, r6, r2",
        "smlad r3, r10, r8, r3",
        ".endif",
        "ldr r10, [r12, #(at + 2 * {position})]",
        "smlad r2, r11, r7, r2",
        "smlad r3, r11, r9, r3",
        "ldr r11, [r12, #(at + 2 * {position} + 4)]",
        ".if segment + round == 0",
        "smuad r4, r10, r6",
        ".else",
        "smlad r4, r10, r6, r4",
        ".endif",
        ".if more",
        "ldr r6, [lr, #16]!",
        ".endif",
        ".if segment + round == 0",
        "smuad r5, r10, r8",
        ".else",
        "smlad r5, r10, r8, r5",
        ".endif",
        ".set at, at + 8",
        ".if !last_of_segment",
        "ldr r10, [r12, #at]",
        ".endif",
        "smlad r4, r11, r7, r4",
        ".if more",
        "ldr r8, [lr, #8]",
        ".endif",
        "smlad r5, r11, r9, r5",
        ".if more",
        "ldr r7, [lr, #4]",
        "ldr r9, [lr, #12]",
        ".endif",
        ".if !last_of_segment",
        "ldr r11, [r12, #(at + 4)]",
        ".endif",
    ]
    [
        // Move lr from the weights of the last round to the weights of the next block's first
        // round.
        ".if {shared}",
        "sub lr, #({weights_of_block} - 16)",
        ".elseif block == {blocks} - 1",
        "add lr, #16",
        ".endif",
    ]
}
