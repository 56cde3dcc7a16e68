//! Models that differ from the checked-in one in shape, cap or code. Each test compiles the crates
//! that depend on the model again, so `cargo xtask test --fast` leaves these tests out.

mod montages;
mod own_cap_page;
mod packed_alone;
mod variants;
