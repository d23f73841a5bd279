//! Runs the app in virtual time: the image's own code, without a machine below.

extern crate alloc;
extern crate kernel_on_host as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
