//! The app on Linux: the same `main` as the image's, on this computer.

extern crate kernel_on_linux as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
