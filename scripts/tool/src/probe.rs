//! Whether KVM is of use here, and so in which mode a guest is booted.
//!
//! The device `/dev/kvm` may exist and be of no use: no permission, no hardware
//! behind it, or hardware that runs a guest of a few instructions and no kernel. So the
//! image that is to be booted is booted first with the word `probe=on`, on the machine
//! that it is to have: it then only shows that its cores come up, take interrupts and
//! calculate (`kernel/src/start/probe.rs`).
//!
//! Every command that boots takes its mode from [`choose`].

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::outcome::boot;
use crate::qemu::{Ending, Loader, Mode, Qemu};
use crate::system;

/// How long the probe may take; where all is well it takes a tenth of this.
const LIMIT: Duration = Duration::from_secs(3);

/// Settles the mode in which `image` is booted on `machine`: the one that the person has
/// named; without one, KVM if it is of use and else `otherwise`, and the reason.
///
/// # Errors
///
/// In words: the person has named KVM, and it is of no use.
pub fn choose(
    named: Option<Mode>,
    otherwise: Mode,
    machine: &Qemu,
    image: &Path,
) -> Result<(Mode, Option<String>), String> {
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

/// Boots the probe under KVM.
///
/// # Errors
///
/// Why KVM is of no use here, in words.
pub fn kvm(machine: &Qemu, image: &Path) -> Result<(), String> {
    let mut machine = machine.clone();
    machine.mode = Mode::Kvm;
    run(&machine, image, LIMIT)
}

/// Boots the probe on `machine`, for at most `limit`, without a firmware, which takes longer.
///
/// # Errors
///
/// What happened instead of success, in words.
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
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&log);
    let outcome = outcome?;
    let Err(fault) = outcome.judge() else {
        return Ok(());
    };
    if matches!(outcome.ending, Ending::Guest(_)) {
        return Err(fault.reason);
    }
    // The first complaint is the cause, the others follow from it.
    let mut complaints = outcome.complaints.split("; ");
    let first = complaints.find(|line| !line.is_empty() && !line.contains("warning: "));
    let ending = outcome.ending;
    Err(first.map_or(ending.to_string(), |line| {
        let line = line.rsplit("qemu-system-x86_64: ").next().unwrap_or(line);
        format!("{ending} ({line})")
    }))
}
