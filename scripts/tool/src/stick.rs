//! The subcommand `image`: an app as a file that boots on a PC.
//!
//! The file is an ISO ([`medium`]) or an application of UEFI ([`efi`]), with the app's image, the
//! words that it is to be given and a file that it is to find in memory. What can be refused is,
//! before anything is built, and nothing is written before all of it is there.
//!
//! Exit codes: 0 the files are there, 1 one could not be made, 2 a refused command line.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use crate::efi;
use crate::files;
use crate::image::{self, Contents};
use crate::medium::{self, Medium};
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::qemu::{Loader, Qemu};

/// The table of `image`.
pub static IMAGE: Command = Command {
    invocation: "./scripts/image",
    about: "Makes a file that boots an app on a PC: to be written to a stick, or to a disc.",
    positional: Some((
        Takes::Text("WORD..."),
        "Words for the app and the kernel, such as `jobs=20`.",
    )),
    options: options! {
        /// The app: a package under apps/.
        "app": Takes::Text("NAME"), or "fork-join";
        /// The ISO to be made.
        "iso": Takes::File("FILE");
        /// The application of UEFI to be made: EFI/BOOT/BOOTX64.EFI of any FAT stick.
        "efi": Takes::File("FILE");
        /// A file that the app finds in memory, as dag-file does its DAGs.
        "module": Takes::File("MODULE");
        /// Take this image; build nothing.
        "image": Takes::File("IMAGE");
    },
    notes: "\
The ISO boots by GRUB, under BIOS and UEFI. `cp FILE /dev/DEVICE` writes it to a stick,
and what was there is lost. The application needs UEFI, and no GRUB: a stick with a FAT file
system keeps what it has, and gets one file more. docs/stick.md says how, and what is known of
real PCs.

DAGs of a file: `./scripts/run --dag FILE --print-dag > MODULE` makes the module for
`--app dag-file`, whose words are those that `./scripts/run --dag FILE` shows.

exit codes: 0 the files are there; 1 one could not be made; 2 a refused command line
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn image(words: &[OsString]) -> ExitCode {
    IMAGE.carry_out(words, |options| {
        let guest_words = check(options).map_err(Refusal::Usage)?;
        print!("{}", make(options, &guest_words)?);
        Ok(ExitCode::SUCCESS)
    })
}

/// Makes sure of everything that can be refused, and returns the words for the guest.
fn check(options: &Parsed) -> Result<String, String> {
    let outputs = options.named(&["iso", "efi"]);
    if outputs.is_empty() {
        return Err("which file? give --iso FILE or --efi FILE".into());
    }
    let inputs = options.named(&["module", "image"]);
    files::check(&inputs, &outputs)?;
    for input in &inputs {
        let (option, place) = (input.option, files::place(input.path));
        let read = match option {
            "image" => image::check_file(input.path).map(|_| ()),
            _ => files::read(input.path).map(|_| ()),
        };
        read.map_err(|why| format!("`--{option} {place}`: {why}"))?;
    }
    if !options.is_given("image") {
        let app = options.text("app").unwrap_or_default();
        image::check_app(app)?;
    }
    let words = options.files().map(Path::to_string_lossy);
    let guest_words = words.collect::<Vec<_>>().join(" ");
    if options.is_given("iso") {
        medium::check_words(&guest_words)?;
    }
    let guest = Qemu {
        guest_words,
        ..Qemu::default()
    };
    guest.check_words()?;
    Ok(guest.guest_words)
}

/// Makes the files, and returns what to say of each, a line.
fn make(options: &Parsed, words: &str) -> Result<String, String> {
    let image = match options.path("image") {
        Some(path) => path.into(),
        None => image::build(options.text("app").unwrap_or_default())?.path,
    };
    let module = options.path("module");
    let mut lines = String::new();
    if let Some(path) = options.path("iso") {
        let made = Medium::new(Loader::Bios, &image, words, module)?;
        let place = files::place(path);
        let bytes = fs::copy(made.path(), path)
            .map_err(|why| format!("`--iso {place}`: cannot be written: {why}"))?;
        lines += &format!(
            "{place}: {} KiB that boot under BIOS and UEFI; `cp {place} /dev/DEVICE` writes it to a \
             stick, and what was there is lost\n",
            bytes >> 10
        );
    }
    if let Some(path) = options.path("efi") {
        let made = efi::application(&Contents::read(&image, words, module)?)?;
        files::write_named("efi", path, &made)?;
        let place = files::place(path);
        lines += &format!(
            "{place}: {} KiB that boot under UEFI; copy it to {} of a FAT stick\n",
            made.len() >> 10,
            efi::PLACE
        );
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::{IMAGE, check};
    use crate::system;

    #[test]
    fn what_cannot_be_made_is_refused_before_the_work() {
        let iso = system::new_log("refused").unwrap();
        for (line, words) in [
            ("--app fork-jion", "did you mean `fork-join`?"),
            ("it's", "`it's`: GRUB"),
            ("--module /dev/zero", "`--module /dev/zero`: cannot"),
            ("--image /etc/passwd", "`--image /etc/passwd`: is no image"),
            (&"x".repeat(2049), "2049 bytes"),
        ] {
            let refused = check(&IMAGE.right(line).with("iso", &iso)).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
        let why = check(&IMAGE.right("jobs=3")).unwrap_err();
        assert_eq!(why, "which file? give --iso FILE or --efi FILE");
        let twice = IMAGE.right("").with("iso", &iso).with("efi", &iso);
        assert!(check(&twice).unwrap_err().contains("`--efi "));
        // Without GRUB any word will do.
        for (option, words) in [("efi", "it's"), ("iso", "jobs=3 seed=7")] {
            let right = check(&IMAGE.right(words).with(option, &iso));
            assert_eq!(right.as_deref(), Ok(words));
        }
        assert!(!iso.exists());
    }
}
