//! Links the image with the board's memory map.
#![forbid(unsafe_code)]

#[path = "../board-stm32/image.rs"]
mod image;

fn main() {
    image::configure("stm32f407.x");
}
