//! Models of other shapes, caps and codes than the checked-in one. Each builds the crates that
//! depend on the model again, which `cargo xtask test --fast` leaves out.

mod montages;
mod own_cap_page;
mod packed_alone;
mod variants;
