//! The app on Linux: the function is the image's, the machine is this computer.

extern crate alloc;
extern crate kernel_on_linux as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
