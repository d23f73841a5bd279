//! Boot media for a PC, and the subcommand `image`, which makes them.
//!
//! A medium is an ISO or an application of UEFI. It holds the loaded part of the app's image, its
//! words, and a file to leave in memory if there is one. A [`Medium`] is a stick for one boot: a
//! file that QEMU shows as one, and that is removed afterwards. Everything is checked before
//! anything is built, and no file is written before its content is complete.
//!
//! The ISO is for a stick or a disc. It holds GRUB for BIOS and for UEFI, and the commands by which
//! GRUB boots the image with the words. `grub-mkrescue` makes it, with the few modules of GRUB that
//! this takes.
//!
//! The application is one file for a FAT stick. It is a PE file: the application `boot-efi`, which
//! the firmware starts, and the sections that this looks for. The layout is that of Microsoft's PE
//! format, for a PE32+ file. The firmware loads it at any address, so each absolute address in it
//! is in its list of relocations; one that cannot be is refused.
//!
//! Exit codes: 0 the files are there, 1 one could not be made, 2 a refused command line.

use std::ffi::OsString;
use std::fs::{self, File};
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{self, ExitCode};

use boot_efi::file::{self, IMAGE, MODULE, SUM, WORDS};

use crate::elf::{self, Correction};
use crate::files::{self, Temporary};
use crate::image::{self, Contents};
use crate::install;
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::qemu::{Loader, Qemu};
use crate::system;

/// The table of `image`.
pub static TABLE: Command = Command {
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
system keeps what it has, and gets one file more. docs/pc.md says how, and what is known of
real PCs.

DAGs of a file: `./scripts/run --dag FILE --print-dag > MODULE` makes the module for
`--app dag-file`, whose words are those that `./scripts/run --dag FILE` shows.

exit codes: 0 the files are there; 1 one could not be made; 2 a refused command line
",
};

/// Runs the subcommand with the words after its name.
pub fn image(words: &[OsString]) -> ExitCode {
    TABLE.carry_out(words, |options| {
        let guest_words = check(options).map_err(Refusal::Usage)?;
        print!("{}", make(options, &guest_words)?);
        Ok(ExitCode::SUCCESS)
    })
}

/// Checks everything that can be refused, and returns the words for the guest.
fn check(options: &Parsed) -> Result<String, String> {
    let outputs = options.named(&["iso", "efi"]);
    if outputs.is_empty() {
        return Err("which file? give --iso FILE or --efi FILE".into());
    }
    let inputs = options.named(&["module", "image"]);
    files::check(&inputs, &outputs)?;
    for input in &inputs {
        let (option, place) = (input.option, files::shown_path(input.path));
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
    // Only GRUB changes words; the application passes them on as they are.
    if options.is_given("iso") {
        check_words(&guest_words)?;
    }
    let guest = Qemu {
        guest_words,
        ..Qemu::default()
    };
    guest.check_words()?;
    Ok(guest.guest_words)
}

/// Makes the files, and returns a line about each.
fn make(options: &Parsed, words: &str) -> Result<String, String> {
    let image = match options.path("image") {
        Some(path) => path.into(),
        None => image::build(options.text("app").unwrap_or_default())?,
    };
    let module = options.path("module");
    let mut lines = String::new();
    if let Some(path) = options.path("iso") {
        // `Bios` and `Uefi` boot the same ISO, so either will do.
        let made = Medium::new(Loader::Bios, &image, words, module)?;
        let place = files::shown_path(path);
        let bytes = fs::copy(made.path(), path)
            .map_err(|why| format!("`--iso {place}`: cannot be written: {why}"))?;
        lines += &format!(
            "{place}: {} KiB that boot under BIOS and UEFI; `cp {place} /dev/DEVICE` writes it to a \
             stick, and what was there is lost\n",
            bytes >> 10
        );
    }
    if let Some(path) = options.path("efi") {
        let made = application(&Contents::read(&image, words, module)?)?;
        files::write_named("efi", path, &made)?;
        let place = files::shown_path(path);
        lines += &format!(
            "{place}: {} KiB that boot under UEFI; copy it to {} of a FAT stick\n",
            made.len() >> 10,
            PLACE
        );
    }
    Ok(lines)
}

/// The content of a stick; the file is removed when this value is dropped.
#[derive(Debug)]
pub struct Medium(Temporary);

impl Medium {
    /// Makes the medium from which `loader` boots `image`, with `words`, and with `module` left in
    /// memory.
    ///
    /// # Errors
    ///
    /// As [`Contents::read`] or [`application`], or the words are refused, something is missing,
    /// `grub-mkrescue` failed, or there is no room.
    pub fn new(
        loader: Loader,
        image: &Path,
        words: &str,
        module: Option<&Path>,
    ) -> Result<Medium, String> {
        let contents = Contents::read(image, words, module)?;
        let log = system::new_log("stick")?;
        let is_fat = loader == Loader::Efi;
        let path = log.with_extension(if is_fat { "img" } else { "iso" });
        let medium = Medium(Temporary(Some(path)));
        match is_fat {
            true => write_fat(medium.path(), &application(&contents)?)?,
            false => write_iso(medium.path(), &contents)?,
        }
        Ok(medium)
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Writes a FAT file system with the application at the path where firmware looks for it.
fn write_fat(stick: &Path, application: &[u8]) -> Result<(), String> {
    install::ensure(&install::MTOOLS)?;
    // Room for the file system's own tables: 4 MiB and a 64th of the content.
    let bytes = (4 << 20) + application.len() as u64 / 64 * 65;
    let sized = File::create(stick).and_then(|file| file.set_len(bytes));
    sized.map_err(|why| format!("cannot write `{}`: {why}", stick.display()))?;
    let file = Temporary(Some(stick.with_extension("efi")));
    files::write(file.path(), application)?;
    let tool = |name: &str, words: &[&Path]| {
        system::run(process::Command::new(name).arg("-i").arg(stick).args(words)).map(drop)
    };
    let on_stick = |path: &str| PathBuf::from(format!("::/{path}"));
    tool("mformat", &[Path::new("::")])?;
    tool("mmd", &[&on_stick("EFI"), &on_stick("EFI/BOOT")])?;
    tool("mcopy", &[file.path(), &on_stick(PLACE)])
}

/// The modules of GRUB, besides those that it needs to read its own files. The kinds of partitions
/// are those that it asks for at its start. A test uses `wrmsr` to leave a processor as some
/// firmware does.
const MODULES: &str = "--install-modules=normal multiboot2 cpuid echo read wrmsr iso9660 \
                       all_video part_acorn \
                       part_amiga part_apple part_bsd part_dfly part_dvh part_gpt part_msdos \
                       part_plan part_sun part_sunpc";

/// Makes sure that words reach the image through GRUB as they are.
///
/// # Errors
///
/// In words, with the offender: it has a character that GRUB would change.
pub fn check_words(words: &str) -> Result<(), String> {
    let changes = |c: char| matches!(c, '\'' | '"' | '\\') || !(c.is_ascii_graphic());
    for word in words.split_whitespace() {
        if let Some(c) = word.chars().find(|c| changes(*c)) {
            return Err(format!(
                "`{word}`: GRUB would not hand on `{c}` as it is; give words of ASCII without \
                 quotes and backslashes"
            ));
        }
    }
    Ok(())
}

/// Writes the ISO `iso` that boots `contents`. Missing tools are installed.
fn write_iso(iso: &Path, contents: &Contents<'_>) -> Result<(), String> {
    check_words(contents.words)?;
    install::ensure(&install::GRUB)?;
    files::in_folder("iso", |folder| {
        let boot = folder.join("boot");
        let commands = commands(contents.words, contents.module.is_some());
        files::write(&boot.join("grub/grub.cfg"), commands)?;
        files::write(&boot.join("image"), &contents.image)?;
        if let Some(module) = &contents.module {
            files::write(&boot.join("module"), module)?;
        }
        rescue(folder, iso)
    })
}

/// Returns GRUB's commands. A file stays as it is, compressed or not. GRUB itself reports a
/// processor without 64 bits, on which the image cannot run a single instruction.
///
/// Under UEFI GRUB puts the first module at address 0. The firmware takes that address for a
/// missing one and reads no file to it, unless GRUB reads through its cache, which depends on where
/// the file lies. So a small module comes first, which always goes through the cache.
fn commands(words: &str, has_module: bool) -> String {
    let quoted = words.split_whitespace().map(|word| format!(" '{word}'"));
    let quoted: String = quoted.collect();
    let boot = match has_module {
        true => {
            "module2 /boot/grub/grub.cfg filler\n\
             if module2 --nounzip /boot/module; then\nboot\nelse\nread\nfi\n"
        }
        false => "boot\n",
    };
    format!(
        "if cpuid -l; then\nmultiboot2 /boot/image{quoted}\n{boot}else\n\
         echo 'this processor has no 64-bit mode, which the image needs'\nread\nfi\n"
    )
}

fn rescue(folder: &Path, iso: &Path) -> Result<(), String> {
    let mut output = OsString::from("--output=");
    output.push(iso);
    let mut command = process::Command::new("grub-mkrescue");
    command.args(["--locales=", "--themes=", "--fonts=", MODULES]);
    let made = system::run(command.arg(output).arg(folder));
    // Its success alone does not prove that the file is there.
    made.and_then(|_| match iso.is_file() {
        true => Ok(()),
        false => Err(format!(
            "`grub-mkrescue` has not made `{}`",
            files::shown_path(iso)
        )),
    })
}

/// The path on a stick where firmware looks for an application.
pub const PLACE: &str = "EFI/BOOT/BOOTX64.EFI";

/// The alignment of a section in memory, and in the file.
const PAGE: u64 = 4096;
const BLOCK: u64 = 512;

/// The characteristics of a section's header: its content and its access rights.
const CODE: u32 = 0x6000_0020;
const CONSTANT: u32 = 0x4000_0040;
const DISCARDABLE: u32 = 0x4200_0040;

/// A section of a PE file.
struct Section {
    name: &'static str,
    rights: u32,
    start: u64,
    bytes: Vec<u8>,
}

impl Section {
    fn bytes_in_file(&self) -> u64 {
        bytes_of(&self.bytes).next_multiple_of(BLOCK)
    }

    /// Returns the first address after it, page-aligned. An empty section takes a page, too.
    fn end_in_memory(&self) -> u64 {
        (self.start + bytes_of(&self.bytes).max(1)).next_multiple_of(PAGE)
    }
}

/// Makes the application that boots `contents`. The part that the firmware starts is built first.
///
/// # Errors
///
/// In words: the build failed, or its result is none of ours.
pub fn application(contents: &Contents<'_>) -> Result<Vec<u8>, String> {
    let own = image::build("boot-efi")?;
    let made = assemble(&files::read_at(&own)?, parts(contents));
    made.map_err(|why| format!("`{}`: {why}", files::shown_path(&own)))
}

/// Returns the sections that the application looks for.
fn parts(contents: &Contents<'_>) -> Vec<(&'static str, Vec<u8>)> {
    let Contents {
        image,
        words,
        module,
    } = contents;
    let content = module.as_deref().unwrap_or_default();
    // The application checks the sum before it boots, so that a damaged stick is found.
    let sum = file::sum([image, words.as_bytes(), content]);
    let always = [
        (IMAGE, image.clone()),
        (WORDS, (*words).into()),
        (SUM, sum.to_le_bytes().into()),
    ];
    let module = module.clone().map(|module| (MODULE, module));
    always.into_iter().chain(module).collect()
}

/// Makes a PE file from a position-independent program and further sections.
fn assemble(program: &[u8], parts: Vec<(&'static str, Vec<u8>)>) -> Result<Vec<u8>, String> {
    let corrections = elf::corrections(program)?;
    let entry = file::entry(program).ok_or("it has no entry")?;
    let mut sections = Vec::new();
    let kinds = [(".text", CODE), (".rdata", CONSTANT)];
    for (segment, (name, rights)) in file::segments(program).zip(kinds) {
        let mut bytes = segment.bytes.to_vec();
        // A segment longer in memory than in the file has zeroed variables, which no section here
        // holds.
        if bytes_of(&bytes) != segment.end - segment.start {
            return Err("it has variables".into());
        }
        for Correction { at, address } in &corrections {
            let place = at.checked_sub(segment.start);
            let place = place.and_then(|at| usize::try_from(at).ok());
            if let Some(place) = place.and_then(|at| bytes.get_mut(at..at + 8)) {
                // Stored as if loaded at 0: the firmware adds the load address.
                place.copy_from_slice(&address.to_le_bytes());
            }
        }
        sections.push(Section {
            name,
            rights,
            start: segment.start,
            bytes,
        });
    }
    let list = corrections_list(&corrections);
    let parts = parts.into_iter();
    let parts = parts.map(|(name, bytes)| (name, CONSTANT, bytes));
    for (name, rights, bytes) in parts.chain([(".reloc", DISCARDABLE, list)]) {
        let start = sections.last().map_or(PAGE, Section::end_in_memory);
        sections.push(Section {
            name,
            rights,
            start,
            bytes,
        });
    }
    Ok(lay_out(entry, &sections))
}

/// Returns the list of relocations: a block for each page that has some, with the page's address,
/// the block's size, and for each address its kind and its offset in the page. There is a block
/// even without relocations, as some firmware
fn corrections_list(corrections: &[Correction]) -> Vec<u8> {
    const ADDRESS_OF_64_BITS: u64 = 10;
    let mut list = Vec::new();
    let mut block = |page: u64, mut entries: Vec<u64>| {
        // A block's size is a multiple of 4; an entry of 0 is padding.
        entries.resize(entries.len().next_multiple_of(2).max(2), 0);
        list.extend(long(page));
        list.extend(long(8 + 2 * entries.len() as u64));
        list.extend(entries.into_iter().flat_map(short));
    };
    let page = |correction: &Correction| correction.at / PAGE;
    for of_page in corrections.chunk_by(|a, b| page(a) == page(b)) {
        let entry = |correction: &Correction| (ADDRESS_OF_64_BITS << 12) | (correction.at % PAGE);
        block(
            page(&of_page[0]) * PAGE,
            of_page.iter().map(entry).collect(),
        );
    }
    if corrections.is_empty() {
        block(0, Vec::new());
    }
    list
}

/// Returns the whole file.
fn lay_out(entry: u32, sections: &[Section]) -> Vec<u8> {
    let count = sections.len() as u64;
    let headers = (0x40 + 24 + 240 + 40 * count).next_multiple_of(BLOCK);
    let in_file = Section::bytes_in_file;
    let (code, list) = (sections.first(), sections.last());

    let mut file = b"MZ".to_vec();
    file.resize(0x3c, 0);
    file.extend(long(0x40)); // where the headers begin
    file.extend(b"PE\0\0");
    file.extend(short(0x8664)); // x86-64
    file.extend(short(count));
    file.extend([0; 12]); // no time, no symbols
    file.extend(short(240)); // what follows up to the sections
    file.extend(short(0x22)); // executable, at any address
    file.extend(short(0x20b)); // PE32+
    file.extend([0; 2]); // the linker's version
    file.extend(long(code.map_or(0, in_file)));
    file.extend(long(sections.iter().skip(1).map(in_file).sum()));
    file.extend(long(0)); // no variables
    file.extend(long(entry.into()));
    file.extend(long(code.map_or(0, |code| code.start)));
    file.extend([0; 8]); // the address that it would like to have: none
    file.extend(long(PAGE));
    file.extend(long(BLOCK));
    file.extend([0; 16]); // versions
    file.extend(long(list.map_or(0, Section::end_in_memory)));
    file.extend(long(headers));
    file.extend(long(0)); // no checksum
    file.extend(short(10)); // an application of UEFI
    file.extend(short(0));
    file.extend([0; 36]); // stack and heap are the firmware's affair
    file.extend(long(16)); // tables, of which the sixth corrects addresses
    file.extend([0; 5 * 8]);
    file.extend(long(list.map_or(0, |list| list.start)));
    file.extend(long(list.map_or(0, |list| bytes_of(&list.bytes))));
    file.extend([0; 10 * 8]);
    let mut at = headers;
    for section in sections {
        file.extend(section.name.bytes().chain(iter::repeat(0)).take(8));
        file.extend(long(bytes_of(&section.bytes)));
        file.extend(long(section.start));
        file.extend(long(in_file(section)));
        file.extend(long(at));
        file.extend([0; 12]);
        file.extend(section.rights.to_le_bytes());
        at += in_file(section);
    }
    let fill = |file: &mut Vec<u8>| {
        let block = usize::try_from(BLOCK).unwrap_or(1);
        file.resize(file.len().next_multiple_of(block), 0);
    };
    fill(&mut file);
    for section in sections {
        file.extend(&section.bytes);
        fill(&mut file);
    }
    file
}

fn bytes_of(bytes: &[u8]) -> u64 {
    bytes.len() as u64
}

/// Returns the four bytes of a number; a file has less than 4 GiB.
fn long(number: u64) -> [u8; 4] {
    u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes()
}

fn short(number: u64) -> [u8; 2] {
    u16::try_from(number).unwrap_or(u16::MAX).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::Contents;
    use super::Correction;
    use super::IMAGE;
    use super::MODULE;
    use super::TABLE;
    use super::WORDS;
    use super::assemble;
    use super::check;
    use super::check_words;
    use super::commands;
    use super::corrections_list;
    use super::parts;
    use crate::system;
    use crate::tiny::{TinyEnd, tiny_image};
    use boot_efi::file::{is_whole, section};

    /// `tests/tests/boots/by_grub.rs` shows that a module arrives.
    #[test]
    fn grub_gets_each_word_as_it_is_or_it_is_refused_by_name() {
        let words = "jobs=3  a=$x;{}#";
        assert!(commands(words, true).contains("multiboot2 /boot/image 'jobs=3' 'a=$x;{}#'\n"));
        assert_eq!(check_words(words), Ok(()));
        for word in ["it's", "say=\"x\"", "a\\b", "k=\u{e4}", "bell\u{7}"] {
            let why = check_words(&format!("jobs=3 {word}")).unwrap_err();
            assert!(why.starts_with(&format!("`{word}`: GRUB")), "{why}");
        }
    }

    /// Lays a PE file out in memory, as a firmware does.
    fn loaded(file: &[u8]) -> Vec<u8> {
        let number = |at: usize| {
            let bytes = file[at..at + 4].try_into().unwrap();
            u32::from_le_bytes(bytes) as usize
        };
        let mut memory = file[..number(0x40 + 24 + 60)].to_vec();
        memory.resize(number(0x40 + 24 + 56), 0);
        for section in 0..usize::from(file[0x46]) {
            let header = 0x40 + 24 + 240 + 40 * section;
            let [bytes, start, from] = [8, 12, 20].map(|at| number(header + at));
            assert!(start.is_multiple_of(4096) && from.is_multiple_of(512));
            memory[start..start + bytes].copy_from_slice(&file[from..from + bytes]);
        }
        memory
    }

    #[test]
    fn the_application_finds_what_the_file_has() {
        let program = tiny_image("program", TinyEnd::Never);
        for module in [Some(vec![9; 4096]), None] {
            let contents = Contents {
                image: vec![7; 5000],
                words: "jobs=3",
                module: module.clone(),
            };
            let file = assemble(&program, parts(&contents)).unwrap();
            assert!(file.len().is_multiple_of(512));
            let mut memory = loaded(&file);
            for (name, content) in [
                (IMAGE, Some(&[7; 5000][..])),
                (WORDS, Some(b"jobs=3")),
                (MODULE, module.as_deref()),
                ("other", None),
            ] {
                assert_eq!(section(&memory, name), content, "{name}");
            }
            assert!(is_whole(&memory));
            let image = memory.windows(9).position(|bytes| bytes == [7; 9]).unwrap();
            memory[image] = 8;
            assert!(!is_whole(&memory));
        }
    }

    #[test]
    fn addresses_are_corrected_page_by_page() {
        let list = |places: &[u64]| -> Vec<u16> {
            let at = |at: &u64| Correction {
                at: *at,
                address: 0,
            };
            let list = corrections_list(&places.iter().map(at).collect::<Vec<_>>());
            let pairs = list.chunks(2).map(|two| two.try_into().unwrap());
            pairs.map(u16::from_le_bytes).collect()
        };
        let first = [0x1000, 0, 12, 0, 0xa008, 0];
        let second = [0x3000, 0, 16, 0, 0xa010, 0xaff8, 0xa000, 0];
        let words = list(&[0x1008, 0x3010, 0x3ff8, 0x3000]);
        assert_eq!(words, [&first[..], &second[..]].concat());
        assert_eq!(list(&[]).len(), 6, "one that says nothing");
    }

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
            let refused = check(&TABLE.right(line).with("iso", &iso)).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
        let why = check(&TABLE.right("jobs=3")).unwrap_err();
        assert_eq!(why, "which file? give --iso FILE or --efi FILE");
        let twice = TABLE.right("").with("iso", &iso).with("efi", &iso);
        assert!(check(&twice).unwrap_err().contains("`--efi "));
        // Without GRUB every word is allowed.
        for (option, words) in [("efi", "it's"), ("iso", "jobs=3 seed=7")] {
            let right = check(&TABLE.right(words).with(option, &iso));
            assert_eq!(right.as_deref(), Ok(words));
        }
        assert!(!iso.exists());
    }
}
