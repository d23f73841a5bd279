//! Runs the app on Linux: the image's own code, with the host as machine.

extern crate kernel_on_linux as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
