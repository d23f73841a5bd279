//! Chooses the loader by the options, and the board, the memory and the QEMU needed for it.

use std::path::PathBuf;

use crate::dag_file::PreparedRun;
use crate::files;
use crate::install;
use crate::options::{CommandLine, Refusal};
use crate::qemu::{Loader, Machine, Mode, PROGRAM};
use crate::run_options::name;
use crate::system;

/// Returns the loader chosen by the options.
pub(super) fn chosen(options: &CommandLine) -> Loader {
    let named = options.text(name::BOOT).and_then(Loader::from_name);
    named.unwrap_or(Loader::Pvh)
}

/// Returns the feature that a microvm lacks and an option needs, with the option's name.
fn needs_pc(options: &CommandLine) -> Option<(&'static str, &'static str)> {
    let stick = ("no firmware that boots from a stick", "boot");
    let boots = chosen(options).needs_stick().then_some(stick);
    let device = ("no PCI, which `--device` needs", "device");
    let network = ("no PCI, which `--net` needs", "net");
    boots
        .or(options.is_given(name::DEVICE).then_some(device))
        .or(options.is_given(name::NET).then_some(network))
}

/// Returns the board chosen or needed by the options.
pub(super) fn machine(options: &CommandLine) -> Machine {
    if needs_pc(options).is_some() {
        return Machine::Q35;
    }
    let named = options.text(name::MACHINE).and_then(Machine::from_name);
    named.unwrap_or(Machine::Microvm)
}

/// Makes sure that the loader is compatible with the other options.
///
/// # Errors
///
/// In words: the options contradict each other.
pub(super) fn check(options: &CommandLine, mode: Option<Mode>) -> Result<(), String> {
    let loader = chosen(options);
    let microvm = Machine::Microvm.name();
    // Only a board named by the person is refused: the default gives way.
    if let Some((lacks, option)) = needs_pc(options)
        && options.is_given(name::MACHINE)
        && options.text(name::MACHINE) == Some(microvm)
    {
        return Err(format!(
            "`--machine {microvm}`: it has {lacks}; give --machine q35, or leave --{option} out"
        ));
    }
    for option in [name::CARD, name::PCAP] {
        if options.is_given(option) && !options.is_given(name::NET) {
            let remedy = "give --net WORDS, such as --net user";
            return Err(format!("`--{option}`: there is no network; {remedy}"));
        }
    }
    if loader == Loader::Uefi && mode == Some(Mode::Deterministic) {
        return Err(
            "`--mode deterministic`: UEFI has been given up after minutes where instructions \
             are counted; give --mode threads, or --boot bios"
                .into(),
        );
    }
    Ok(())
}

/// Chooses the memory in MiB: the person's choice or the usual amount. Either must suffice for the
/// stacks and tables of all processors.
pub(super) fn choose_memory(
    options: &CommandLine,
    dags: Option<&PreparedRun>,
) -> Result<u64, Refusal> {
    let cores = options.number(name::CORES).unwrap_or(1);
    let loader = chosen(options);
    let bytes = |name| {
        let data = options.path(name).and_then(|path| path.metadata().ok());
        // A missing file counts as empty; reading it is refused later.
        data.map_or(0, |data| data.len())
    };
    // A replay also builds a table of its values in memory, in twice the file's size.
    let module_mib = (bytes(name::MODULE) + 3 * bytes(name::REPLAY)).div_ceil(1 << 20);
    // Each processor has stacks and tables; a quarter of the memory is for them, the rest is heap.
    let mut least = loader.least_memory_mib().max(8 + cores) + module_mib;
    // The DAG file's estimate is a usual amount; a person may know that less is enough.
    if let Some(dags) = dags.filter(|_| !options.is_given(name::MEMORY)) {
        least = least.max(dags.memory_mib);
    }
    let memory_mib = options.number(name::MEMORY).unwrap_or(least);
    if memory_mib >= least {
        return Ok(memory_mib);
    }
    if options.is_given(name::MEMORY) {
        let with = match module_mib {
            0 => String::new(),
            mib => format!(" with a module of {mib} MiB,"),
        };
        return Err(Refusal::Usage(format!(
            "`--memory {memory_mib}`: {cores} cores,{with} booted by {loader}, take at least \
             {least} MiB; give more, or fewer cores"
        )));
    }
    // The default is below the need and grows silently, since the person chose nothing.
    Ok(least)
}

/// Finds the QEMU to use. Installs QEMU if the person named none and none is there.
pub(super) fn choose_program(options: &CommandLine) -> Result<PathBuf, Refusal> {
    if let Some(named) = options.path(name::QEMU) {
        return system::find_program(named).ok_or_else(|| {
            let place = files::shown_path(named);
            Refusal::Usage(format!("`--qemu {place}`: there is no such program"))
        });
    }
    install::ensure_qemu()?;
    Ok(PROGRAM.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::RUN;
    use crate::tests::right;

    /// `tests/it/lines.rs` has what is refused.
    #[test]
    fn a_stick_takes_a_pc() {
        let board = |line: &str| machine(&right(&RUN, line));
        assert_eq!(board(""), Machine::Microvm);
        for line in [
            "--boot pvh --machine q35",
            "--boot bios",
            "--boot uefi",
            "--device edu",
            "--net user",
        ] {
            assert_eq!(board(line), Machine::Q35, "{line}");
        }
    }
}
