//! The app as a program for Linux: the same `main` as the image's.

extern crate kernel_on_linux as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
