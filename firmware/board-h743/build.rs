//! Links the image for the board. On a PC there is nothing to link.
#![forbid(unsafe_code)]

#[path = "../board-stm32/image.rs"]
mod image;

fn main() {
    image::describe("stm32h743.x");
}
