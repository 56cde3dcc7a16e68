//! The schedule for a Cortex-M4, which groups loads: one LDM and three LDRD for every twelve SMLAD.

schedule! {
    []
    []
    [
        "ldm lr!, {{r6-r9}}",
        "ldrd r10, r11, [r12, #(3 * {position} * block + 8 * round)]",
        ".if segment + round == 0",
        "smuad r0, r10, r6",
        "smuad r1, r10, r8",
        ".else",
        "smlad r0, r10, r6, r0",
        "smlad r1, r10, r8, r1",
        ".endif",
        "smlad r0, r11, r7, r0",
        "smlad r1, r11, r9, r1",
        "ldrd r10, r11, [r12, #((3 * block + 1) * {position} + 8 * round)]",
        ".if segment + round == 0",
        "smuad r2, r10, r6",
        "smuad r3, r10, r8",
        ".else",
        "smlad r2, r10, r6, r2",
        "smlad r3, r10, r8, r3",
        ".endif",
        "smlad r2, r11, r7, r2",
        "smlad r3, r11, r9, r3",
        "ldrd r10, r11, [r12, #((3 * block + 2) * {position} + 8 * round)]",
        ".if segment + round == 0",
        "smuad r4, r10, r6",
        "smuad r5, r10, r8",
        ".else",
        "smlad r4, r10, r6, r4",
        "smlad r5, r10, r8, r5",
        ".endif",
        "smlad r4, r11, r7, r4",
        "smlad r5, r11, r9, r5",
    ]
    [
        ".if {shared}",
        "sub lr, #{weights_of_block}",
        ".endif",
    ]
}
