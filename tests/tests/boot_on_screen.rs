//! A machine without a serial port shows on its screen what it has to say. The test reads it
//! there, by the kernel's own letters, as QEMU gives the picture. So does one that cannot
//! run, and then it halts.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use boot::screen::font::{HEIGHT, WIDTH, is_lit};
use harness::Guest;
use harness::altered::qemu_and;
use tool::qemu::{Ending, Loader};
use tool::system;

const VERDICT: &str = "{\"kind\":\"verdict\",\"status\":\"";

/// Makes a program that is QEMU with a screen, without a serial port and without an end, which
/// listens at `monitor`, and with another word in place of one of ours.
fn qemu_with_a_screen(monitor: &Path, other: &str, word: &str) -> PathBuf {
    let more = format!(
        "-vga std -monitor unix:{},server=on,wait=off",
        monitor.display()
    );
    let changes = [
        ("file:*", "none"),
        ("iobase=0xf4", "iobase=0xf8"),
        (other, word),
    ];
    qemu_and(&changes, &more)
}

/// Returns the rows of a picture in the format PPM that has letters as the kernel draws them.
fn rows(picture: &[u8]) -> Vec<String> {
    let mut fields = picture.splitn(4, |byte| byte.is_ascii_whitespace());
    let mut number = || {
        std::str::from_utf8(fields.next()?)
            .ok()?
            .parse::<usize>()
            .ok()
    };
    let (_, width, height) = (number(), number(), number());
    let (Some(width), Some(height)) = (width, height) else {
        return Vec::new();
    };
    let Some(pixels) = picture.len().checked_sub(3 * width * height) else {
        return Vec::new();
    };
    let scale = (width / 600).max(1);
    let is_white = |x: usize, y: usize| picture[pixels + 3 * (y * width + x)] > 127;
    let letter = |column: usize, row: usize| {
        let looks = |letter: &u8| {
            (0..WIDTH * HEIGHT).all(|pixel| {
                let (across, down) = (pixel % WIDTH, pixel / WIDTH);
                let x = (column * (WIDTH + 1) + across) * scale;
                let y = (row * (HEIGHT + 2) + 1 + down) * scale;
                is_white(x, y) == is_lit(*letter, across, down)
            })
        };
        (b' '..=b'~').find(looks).map_or('\u{fffd}', char::from)
    };
    let (columns, count) = (width / scale / (WIDTH + 1), height / scale / (HEIGHT + 2));
    let row = |row| {
        (0..columns)
            .map(|column| letter(column, row))
            .collect::<String>()
    };
    (0..count)
        .map(|number| row(number).trim_end().into())
        .collect()
}

/// Says something to QEMU's monitor and returns what it answers within half a second.
fn ask(monitor: &Path, command: &str) -> String {
    let mut answer = Vec::new();
    if let Ok(mut stream) = UnixStream::connect(monitor) {
        let _ = writeln!(stream, "{command}");
        let _ = stream.set_read_timeout(Some(Duration::from_millis(500)));
        let _ = stream.read_to_end(&mut answer);
    }
    String::from_utf8_lossy(&answer).into_owned()
}

/// Looks at the screen until a verdict is there and all cores halt, ends QEMU and returns the
/// rows, and how pages are mapped.
fn watch(monitor: &Path, cores: u64) -> (Vec<String>, String) {
    let picture = monitor.with_extension("ppm");
    let begun = Instant::now();
    let mut rows = Vec::new();
    let has_verdict = |rows: &[String]| rows.iter().any(|row| row.starts_with(VERDICT));
    while begun.elapsed() < Duration::from_secs(300) {
        thread::sleep(Duration::from_secs(1));
        ask(monitor, &format!("screendump {}", picture.display()));
        rows = self::rows(&fs::read(&picture).unwrap_or_default());
        let halted = || ask(monitor, "info registers -a").matches("HLT=1").count() as u64;
        if has_verdict(&rows) && halted() == cores {
            break;
        }
    }
    let pages = ask(monitor, "info tlb");
    ask(monitor, "quit");
    let _ = fs::remove_file(&picture);
    (rows, pages)
}

/// Boots what the guest describes, with another word in place of one of ours, and returns the
/// rows of the screen, and how pages are mapped.
fn rows_of(guest: &Guest, cores: u64, other: &str, word: &str) -> (Vec<String>, String) {
    let monitor = system::new_log("monitor").expect("a folder for logs");
    let program = qemu_with_a_screen(&monitor, other, word);
    let guest = guest.clone().cores(cores).program(&program);
    let watcher = thread::spawn(move || watch(&monitor, cores));
    let outcome = guest.boot();
    let (rows, pages) = watcher.join().expect("it does not panic");
    let _ = fs::remove_file(&program);
    assert_eq!(outcome.ending, Ending::Status(0), "{}", rows.join("\n"));
    assert_eq!(outcome.serial, "", "there is no serial port");
    (rows, pages)
}

/// Boots the demo and reads its table on the screen.
fn shows(loader: Loader) {
    let guest = Guest::new("fork-join").from_stick(loader);
    let guest = guest.word("jobs=3").word("subtasks=2");
    let (rows, pages) = rows_of(&guest, 2, "none", "none");
    // Written through (T), and not uncached (C) as a device's: so the kernel marks the screen's.
    assert!(pages.contains("-T-W"), "{pages}");
    let all = rows.join("\n");
    let at = |text: &str| rows.iter().position(|row| row.starts_with(text));
    let head = at("N = 2: 3 jobs, 3 joins, 0 semantic violations").expect(&all);
    for (row, name) in [
        "min",
        "join latency",
        "join to start",
        "response time",
        "release jitter",
    ]
    .into_iter()
    .enumerate()
    {
        assert!(rows[head + 1 + row].trim_start().starts_with(name), "{all}");
    }
    let last = rows.iter().rfind(|row| !row.is_empty());
    let success = format!("{VERDICT}success\"}}");
    assert_eq!(last, Some(&success), "{all}");
    assert!(!all.contains('\u{fffd}'), "{all}");
}

#[test]
fn of_uefi_without_grub() {
    shows(Loader::Efi);
}

#[test]
fn of_grub_under_a_bios() {
    shows(Loader::Bios);
}

/// Boots what cannot run, and reads on the screen why not.
fn refuses(guest: &Guest, cores: u64, other: &str, word: &str, why: &str) {
    let (rows, _) = rows_of(guest, cores, other, word);
    let all = rows.join("\n");
    let says_why = |row: &String| row.trim_start().starts_with(why);
    assert!(rows.iter().any(says_why), "{all}");
    let is_success = |row: &String| row.starts_with(&format!("{VERDICT}success"));
    assert!(!rows.iter().any(is_success), "{all}");
}

#[test]
fn why_a_machine_is_refused() {
    let guest = Guest::new("fork-join").from_stick(Loader::Bios);
    let why =
        "the processor has no no-execute pages (NX, XD); turn it on in the firmware's settings";
    refuses(&guest, 2, "#max", "max,-nx", why);
    let small = guest.memory_mib(8);
    refuses(
        &small,
        32,
        "none",
        "none",
        "each core needs 144 KiB of memory",
    );
}

#[test]
fn why_a_word_is_refused() {
    for loader in [Loader::Bios, Loader::Efi] {
        let guest = Guest::new("fork-join").from_stick(loader).word("avx=512");
        let why = "`avx=512`: allowed are on, off";
        refuses(&guest, 2, "none", "none", why);
    }
}
