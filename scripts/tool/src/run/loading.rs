//! What brings the image into memory: which loader the options choose, and on what board.

use crate::options::Parsed;
use crate::qemu::{Loader, Machine, Mode};

/// Returns the loader that the options choose.
pub(super) fn chosen(options: &Parsed) -> Loader {
    let named = options.text("boot").and_then(Loader::from_name);
    named.unwrap_or(Loader::Pvh)
}

/// Returns the board that the options choose, which a stick needs to be a PC.
pub(super) fn machine(options: &Parsed) -> Machine {
    if chosen(options).needs_stick() {
        return Machine::Q35;
    }
    let named = options.text("machine").and_then(Machine::from_name);
    named.unwrap_or(Machine::Microvm)
}

/// Makes sure that the loader goes with the other options.
///
/// # Errors
///
/// In words: it does not.
pub(super) fn check(options: &Parsed, mode: Option<Mode>) -> Result<(), String> {
    let loader = chosen(options);
    let microvm = Machine::Microvm.name();
    if loader.needs_stick()
        && options.is_given("machine")
        && options.text("machine") == Some(microvm)
    {
        return Err(format!(
            "`--machine {microvm}`: it has no firmware that boots from a stick, as `--boot \
             {loader}` does; give --machine q35, or leave --boot out"
        ));
    }
    if loader.is_by_uefi() && mode == Some(Mode::Deterministic) {
        return Err(
            "`--mode deterministic`: UEFI has been given up after minutes where instructions \
             are counted; give --mode threads, or --boot bios"
                .into(),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{check, machine};
    use crate::qemu::{Machine, Mode};
    use crate::run::RUN;

    #[test]
    fn a_stick_takes_a_pc() {
        for (line, board) in [
            ("", Machine::Microvm),
            ("--boot pvh --machine q35", Machine::Q35),
            ("--boot bios", Machine::Q35),
            ("--boot uefi --machine q35", Machine::Q35),
        ] {
            let options = RUN.right(line);
            assert_eq!(check(&options, None), Ok(()), "{line}");
            assert_eq!(machine(&options), board, "{line}");
        }
        let refused = check(&RUN.right("--boot bios --machine microvm"), None);
        assert!(refused.unwrap_err().starts_with("`--machine microvm`: "));
    }

    #[test]
    fn uefi_is_not_counted() {
        let counted = Some(Mode::Deterministic);
        assert_eq!(check(&RUN.right("--boot bios"), counted), Ok(()));
        for line in ["--boot uefi", "--boot efi"] {
            let refused = check(&RUN.right(line), counted).unwrap_err();
            assert!(refused.contains("--mode threads"), "{refused}");
        }
    }
}
