//! Definitions that belong in an image alone: its entry, its allocator, its panic handler and the
//! few functions that compiled code calls implicitly ([`mod@boot::memory_functions`]).
//!
//! The [`entry!`](crate::entry) macro defines them in the app's binary, not in this library. Host
//! programs that are linked with the library thus keep their own.

use core::panic::PanicInfo;
use core::sync::atomic::Ordering;

use front::app::ending::IS_UNOPTIMIZED;

pub use boot::BootInfo;
pub use executive::console::write_as;
pub use front::output;

#[cfg(test)]
front::output!(write_as);

/// Makes the image run an app's function.
///
/// Use once, in the `main.rs` of a `#![no_std] #![no_main]` binary whose `build.rs` calls
/// `boot_link::link_image()`:
///
/// ```ignore
/// kernel::entry!(main);
///
/// fn main(machine: &kernel::Machine) -> Result<(), kernel::AppError> { Ok(()) }
/// ```
#[macro_export]
macro_rules! entry {
    ($app:path) => {
        #[cfg(not(linked_as_image))]
        compile_error!(
            "the image is linked as a program of the host: let `build.rs` call \
             `boot_link::link_image()`, with `boot-link` in `[build-dependencies]`"
        );
        #[cfg(test)]
        compile_error!(
            "an image is compiled as a test: write `test = false` below `[[bin]]` in `Cargo.toml`"
        );
        #[cfg(not(any(test, panic = "abort")))]
        compile_error!(
            "an image cannot unwind: write `panic = \"abort\"` below `[profile.dev]` and below \
             `[profile.release]` in the `Cargo.toml` of the workspace"
        );

        #[global_allocator]
        static HEAP: $crate::KernelHeap = $crate::KernelHeap;

        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::entry::panic(info)
        }

        // SAFETY: the linker script makes the section part of the notes, and this static has the
        // layout of a note.
        #[used]
        #[unsafe(link_section = ".note.app")]
        static APP_NOTE: $crate::entry::AppNote =
            $crate::entry::AppNote::new(env!("CARGO_PKG_NAME"));

        // SAFETY: `boot` declares the function with this signature and calls it once; no other
        // symbol has the name.
        #[unsafe(no_mangle)]
        fn kernel_main(info: &'static $crate::entry::BootInfo) -> ! {
            $crate::entry::start(info, env!("CARGO_PKG_NAME"), cfg!(unoptimized), $app)
        }

        $crate::entry::output!($crate::entry::write_as);

        $crate::memory_functions!();
    };
}

/// The ELF note naming the image's app. The host reads the note without booting the image.
#[repr(C)]
pub struct AppNote {
    owner_bytes: u32,
    content_bytes: u32,
    kind: u32,
    owner: [u8; 4],
    content: [u8; 64],
}

impl AppNote {
    /// Names the app.
    ///
    /// # Panics
    ///
    /// While the app is compiled, if the name is longer than 64 bytes.
    pub const fn new(app: &str) -> AppNote {
        assert!(app.len() <= 64, "an app's name has 64 bytes at most");
        let mut content = [0; 64];
        let (name, _) = content.split_at_mut(app.len());
        name.copy_from_slice(app.as_bytes());
        AppNote {
            owner_bytes: 4,
            content_bytes: 64,
            kind: 1,
            owner: *b"App\0",
            content,
        }
    }
}

/// Implements `kernel_main` of the image.
pub fn start(
    info: &'static BootInfo,
    name: &'static str,
    is_unoptimized: bool,
    app: fn(&crate::Machine) -> Result<(), crate::AppError>,
) -> ! {
    IS_UNOPTIMIZED.store(is_unoptimized, Ordering::Relaxed);
    crate::start::start(info, name, app)
}

/// Implements the image's panic handler.
pub fn panic(info: &PanicInfo<'_>) -> ! {
    crate::watch::panic::panic(info)
}
