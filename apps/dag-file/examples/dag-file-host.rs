//! The app in virtual time: the function is the image's, and no machine is below it.

extern crate alloc;
extern crate kernel_on_host as kernel;

#[path = "../src/main.rs"]
#[allow(unused_attributes, reason = "some are an image's only")]
mod image;

fn main() -> std::process::ExitCode {
    image::program()
}
