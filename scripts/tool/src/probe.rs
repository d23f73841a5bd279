//! Probes KVM, and chooses the mode for booting a guest.
//!
//! The device `/dev/kvm` may exist and still be useless: there is no permission, no hardware behind
//! the device, or hardware that runs a guest of a few instructions but no kernel. So the tool first
//! boots the image with the word `probe=on`, on the machine chosen for the run. The guest then only
//! shows that its cores come up, take interrupts and calculate (`kernel/src/start/probe.rs`).
//!
//! Every command that boots a guest takes the mode from [`choose`].

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::outcome::boot;
use crate::qemu::{Loader, Mode, Qemu, RunEnd};
use crate::system;

/// The time limit of the probe, ten times the need of a working KVM.
const LIMIT: Duration = Duration::from_secs(3);

/// Chooses the mode for booting `image` on `machine`: the mode named by the person, if any; else
/// KVM if it works, and `otherwise` if not. Without a named mode, also returns the reason.
///
/// # Errors
///
/// In words: the person has named KVM, but KVM does not work.
pub fn choose(
    named: Option<Mode>,
    otherwise: Mode,
    machine: &Qemu,
    image: &Path,
) -> Result<(Mode, Option<String>), String> {
    // Only KVM needs a probe; the emulator works everywhere.
    if let Some(mode) = named.filter(|mode| *mode != Mode::Kvm) {
        return Ok((mode, None));
    }
    match (kvm(machine, image), named) {
        (Ok(()), None) => {
            let why = "the image passed its probe under KVM";
            Ok((Mode::Kvm, Some(why.into())))
        }
        (Ok(()), Some(mode)) => Ok((mode, None)),
        (Err(why), None) => Ok((otherwise, Some(format!("KVM is of no use here: {why}")))),
        (Err(why), Some(_)) => Err(format!(
            "`--mode kvm`: KVM is of no use here: {why}; use deterministic or threads"
        )),
    }
}

/// Boots `image` with the probe under KVM, to learn whether KVM works.
///
/// # Errors
///
/// The reason why KVM does not work here, in words.
pub fn kvm(machine: &Qemu, image: &Path) -> Result<(), String> {
    let mut machine = machine.clone();
    machine.mode = Mode::Kvm;
    run(&machine, image, LIMIT)
}

/// Boots the probe on `machine`, for at most `limit`, and without a firmware, to save time.
///
/// # Errors
///
/// In words, how the probe failed.
pub fn run(machine: &Qemu, image: &Path, limit: Duration) -> Result<(), String> {
    let qemu = Qemu {
        guest_words: "probe=on".into(),
        module: None,
        loader: Loader::Pvh,
        has_input: false,
        stops: false,
        second: None,
        debugger: None,
        ..machine.clone()
    };
    let log = system::new_log("probe")?;
    let outcome = boot(&qemu, image, &log, limit, |_| {});
    // The log is ours; a leftover log harms nothing.
    let _ = fs::remove_file(&log);
    let outcome = outcome?;
    let Err(fault) = outcome.judge() else {
        return Ok(());
    };
    // The guest itself has found a fault, and its words say more than QEMU's.
    if matches!(outcome.ending, RunEnd::Guest(_)) {
        return Err(fault.reason);
    }
    // The first complaint is the cause, and the others follow from it.
    let mut complaints = outcome.complaints.split("; ");
    let first = complaints.find(|line| !line.is_empty() && !line.contains("warning: "));
    let ending = outcome.ending;
    Err(first.map_or(ending.to_string(), |line| {
        let line = line.rsplit("qemu-system-x86_64: ").next().unwrap_or(line);
        format!("{ending} ({line})")
    }))
}
