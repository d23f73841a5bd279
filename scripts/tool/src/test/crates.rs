//! Which test binaries there are: cargo compiles them and says where.

use std::path::PathBuf;

use crate::install::{self, Need};
use crate::json::Value;
use crate::lasting::Lasting;
use crate::system;

/// A compiled libtest binary.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct TestBinary {
    /// The package's folder.
    pub(super) folder: PathBuf,
    /// The target: the library's or the integration test's name.
    target: String,
    pub(super) executable: PathBuf,
}

impl TestBinary {
    /// Names it for people: the package's folder and the target.
    pub(super) fn name(&self) -> String {
        let folder = self
            .folder
            .strip_prefix(system::workspace())
            .unwrap_or(&self.folder);
        format!("{}: {}", folder.display(), self.target)
    }

    /// Whether its tests need QEMU; they say so by the target's name.
    pub(super) fn boots_guests(&self) -> bool {
        self.target.starts_with("boot_") || self.target.ends_with("_qemu")
    }

    /// Installs what its tests need besides QEMU, if it is missing; they say so by the
    /// target's name.
    ///
    /// # Errors
    ///
    /// Why they cannot run, in words.
    pub(super) fn ensure_needs(&self) -> Result<(), String> {
        let needs = NEEDS.iter().find(|(target, _)| *target == self.target);
        let needs = needs.map_or(&[][..], |(_, needs)| needs);
        needs.iter().copied().try_for_each(install::ensure)
    }
}

/// What test programs need besides QEMU.
const NEEDS: [(&str, &[&Need]); 4] = [
    ("boot_by_efi", &[&install::MTOOLS, &install::OVMF]),
    (
        "boot_on_screen",
        &[&install::GRUB, &install::MTOOLS, &install::OVMF],
    ),
    ("boot_by_grub", &[&install::GRUB, &install::OVMF]),
    ("boot_in_bochs", &[&install::GRUB, &install::BOCHS]),
];

/// Compiles the tests of all packages. Cargo's errors go to standard error.
pub(super) fn compile() -> (Vec<TestBinary>, Result<(), String>) {
    let _lasting = Lasting::new("compiling the tests");
    let mut command = system::cargo();
    let words = "test --workspace --no-run --no-fail-fast --quiet \
                 --message-format=json-render-diagnostics";
    command.args(words.split_whitespace());
    let (messages, compiled) = system::messages_of(&mut command);
    let mut binaries: Vec<TestBinary> = messages.iter().filter_map(binary).collect();
    // Cheap ones first: a mistake shows soon.
    binaries.sort_by_key(|binary| (binary.boots_guests(), binary.name()));
    (binaries, compiled)
}

/// Reads one of cargo's messages: the test binary, if it announces one.
fn binary(message: &Value) -> Option<TestBinary> {
    let is_test = message.at(&["profile", "test"]).and_then(Value::as_bool);
    if is_test != Some(true) {
        return None;
    }
    let manifest = message.get("manifest_path").and_then(Value::as_text)?;
    let target = message.at(&["target", "name"]).and_then(Value::as_text)?;
    let kind = message
        .at(&["target", "kind"])?
        .elements()
        .first()?
        .as_text()?;
    let executable = message.get("executable").and_then(Value::as_text)?;
    let target = match kind {
        // The tool's package has a library and a program of one name.
        "bin" => format!("{target} (program)"),
        _ => target.into(),
    };
    Some(TestBinary {
        folder: PathBuf::from(manifest).parent()?.into(),
        target,
        executable: executable.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::binary;
    use crate::json::parse;

    #[test]
    fn a_message_about_a_test_binary_is_told_from_others() {
        let message = r#"{"reason":"compiler-artifact","manifest_path":"/w/a/Cargo.toml",
            "target":{"kind":["test"],"name":"boot_x"},
            "profile":{"test":true},"executable":"/w/target/boot_x-1"}"#;
        let found = binary(&parse(message).unwrap()).unwrap();
        assert!(found.name() == "/w/a: boot_x" && found.boots_guests());
        let of_product = message.replace("true", "false");
        for other in [&of_product, r#"{"reason":"build-finished","success":true}"#] {
            assert_eq!(binary(&parse(other).unwrap()), None);
        }
    }
}
