//! The board without a board: sources, virtual board, ports.
#![forbid(unsafe_code)]
