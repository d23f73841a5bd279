//! Which test binaries there are: cargo compiles them and says where.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::Stdio;

use crate::install::{self, Need};
use crate::json::{self, Value};
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
    command.args([
        "test",
        "--workspace",
        "--no-run",
        "--no-fail-fast",
        "--quiet",
    ]);
    command.arg("--message-format=json-render-diagnostics");
    command.stdin(Stdio::null()).stdout(Stdio::piped());
    let mut cargo = match command.spawn() {
        Ok(cargo) => cargo,
        Err(error) => return (Vec::new(), Err(format!("cannot start cargo: {error}"))),
    };
    let output = cargo.stdout.take().map(BufReader::new);
    let lines = output
        .into_iter()
        .flat_map(|output| output.lines().map_while(Result::ok));
    let mut binaries: Vec<TestBinary> = lines.filter_map(|line| binary(&line)).collect();
    // Cheap ones first: a mistake shows soon.
    binaries.sort_by_key(|binary| (binary.boots_guests(), binary.name()));
    let compiled = match cargo.wait() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err("cargo's errors stand above".into()),
        Err(error) => Err(format!("cargo was lost: {error}")),
    };
    (binaries, compiled)
}

/// Reads one of cargo's messages: the test binary, if it announces one.
fn binary(message: &str) -> Option<TestBinary> {
    let message = json::parse(message).ok()?;
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

    #[test]
    fn a_message_about_a_test_binary_is_told_from_others() {
        let message = |test: bool| {
            format!(
                r#"{{"reason":"compiler-artifact","manifest_path":"/w/a/Cargo.toml",
                "target":{{"kind":["test"],"name":"boot_x"}},
                "profile":{{"test":{test}}},"executable":"/w/target/boot_x-1"}}"#
            )
        };
        let found = binary(&message(true)).unwrap();
        assert_eq!(found.name(), "/w/a: boot_x");
        assert!(found.boots_guests());
        assert_eq!(binary(&message(false)), None);
        assert_eq!(
            binary(r#"{"reason":"build-finished","success":true}"#),
            None
        );
    }
}
