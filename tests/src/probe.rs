//! Whether virtualization truly works here.
//!
//! The device `/dev/kvm` may exist and be of no use: no permission, no
//! hardware behind it, or a guest that never gets on. So a guest is run: one
//! that does nothing but say that it ran.

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::outcome::boot;
use crate::protocol::Status;
use crate::qemu::{Ending, Mode, Qemu};
use crate::system;
use crate::tiny::{TinyEnd, tiny_image};

/// How long the guest may take; where all is well it takes a tenth of this.
const LIMIT: Duration = Duration::from_secs(4);

/// Runs a guest under KVM.
///
/// # Errors
///
/// Why KVM is of no use here, in words.
pub fn kvm(program: &Path) -> Result<(), String> {
    if !Path::new("/dev/kvm").exists() {
        return Err("there is no /dev/kvm".into());
    }
    let qemu = Qemu {
        program: program.into(),
        mode: Mode::Kvm,
        ..Qemu::default()
    };
    run_tiny(&qemu)
}

/// Runs the tiny guest on `qemu`.
///
/// # Errors
///
/// What happened instead of the agreed exit status, in words.
pub fn run_tiny(qemu: &Qemu) -> Result<(), String> {
    let log = system::new_log("probe")?;
    let image = log.with_extension("image");
    let written = fs::write(&image, tiny_image("", TinyEnd::Exit(0x10)));
    written.map_err(|error| format!("cannot write `{}`: {error}", image.display()))?;
    let outcome = boot(qemu, &image, &log, LIMIT, |_| {});
    // Both are ours, and a failure to remove them harms no one.
    let _ = fs::remove_file(&image);
    let _ = fs::remove_file(&log);
    let outcome = outcome?;
    match outcome.ending {
        Ending::Guest(Status::Success) => Ok(()),
        ending if outcome.complaints.is_empty() => Err(ending.to_string()),
        ending => {
            // The first complaint is the cause, the others follow from it.
            let first = outcome.complaints.split("; ").next().unwrap_or_default();
            let first = first.rsplit("qemu-system-x86_64: ").next().unwrap_or(first);
            Err(format!("{ending} ({first})"))
        }
    }
}
