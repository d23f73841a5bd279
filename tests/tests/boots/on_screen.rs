//! A machine without a serial port shows its output on its screen. The test reads the screen in
//! QEMU's picture, by the kernel's own letters. A machine unable to run shows its reason, too, and
//! then halts.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use boot::screen::font::{HEIGHT, WIDTH, is_lit};
use harness::Guest;
use harness::file::File;
use tool::qemu::{Loader, RunEnd};
use tool::system;

const VERDICT: &str = "{\"kind\":\"verdict\",\"status\":\"";

/// Returns the rows of text in a picture of the format PPM, with letters as drawn by the kernel.
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

/// Gives QEMU's monitor a command and returns the answer of the next half second.
fn ask(monitor: &Path, command: &str) -> String {
    let mut answer = Vec::new();
    if let Ok(mut stream) = UnixStream::connect(monitor) {
        let _ = writeln!(stream, "{command}");
        let _ = stream.set_read_timeout(Some(Duration::from_millis(500)));
        let _ = stream.read_to_end(&mut answer);
    }
    String::from_utf8_lossy(&answer).into_owned()
}

/// Looks at the screen until it has a verdict and all cores halt, ends QEMU and returns the rows,
/// and the mapping of pages.
fn watch(monitor: &Path, cores: u64) -> (Vec<String>, String) {
    let picture = File::new("screen", "ppm");
    let begun = Instant::now();
    let mut rows = Vec::new();
    let has_verdict = |rows: &[String]| rows.iter().any(|row| row.starts_with(VERDICT));
    while begun.elapsed() < Duration::from_secs(300) {
        thread::sleep(Duration::from_secs(1));
        ask(monitor, &format!("screendump {}", picture.0.display()));
        rows = self::rows(&fs::read(&picture.0).unwrap_or_default());
        let halted = || ask(monitor, "info registers -a").matches("HLT=1").count() as u64;
        if has_verdict(&rows) && halted() == cores {
            break;
        }
    }
    let pages = ask(monitor, "info tlb");
    ask(monitor, "quit");
    (rows, pages)
}

/// Boots the demo from a stick on a number of cores, with a screen, without a serial port and
/// without an end, on a processor of a model. Returns the rows of the screen, and the mapping of
/// pages.
fn rows_of(guest: &Guest, cores: u64, model: &str) -> (Vec<String>, String) {
    let monitor = system::new_log("monitor").expect("a folder for logs");
    let changes = [
        ("file:*", "none"),
        ("iobase=0xf4", "iobase=0xf8"),
        ("#max", model),
    ];
    let listens = format!("unix:{},server=on,wait=off", monitor.display());
    let guest = guest.clone().cores(cores);
    let guest = guest.altered(&changes, &format!("-vga std -monitor {listens}"));
    let watcher = thread::spawn(move || watch(&monitor, cores));
    let outcome = guest.boot();
    let (rows, pages) = watcher.join().expect("it does not panic");
    assert_eq!(outcome.ending, RunEnd::Status(0), "{}", rows.join("\n"));
    assert_eq!(outcome.serial, "", "there is no serial port");
    (rows, pages)
}

/// The demo's table, by UEFI and by a BIOS.
#[test]
fn what_a_run_says() {
    for loader in [Loader::Uefi, Loader::Bios] {
        let guest = Guest::new("fork-join").from_stick(loader);
        let (rows, pages) = rows_of(&guest.word("jobs=3 subtasks=2"), 2, "max");
        // Written through (T), and not uncached (C) as a device's: so the kernel marks the
        // screen's.
        assert!(pages.contains("-T-W"), "{pages}");
        let all = rows.join("\n");
        let head = "N = 2: 3 jobs, 3 joins, 0 semantic violations";
        let mut table = rows.iter().skip_while(|row| !row.starts_with(head)).skip(1);
        for name in [
            "min",
            "join latency",
            "join to start",
            "response time",
            "release jitter",
        ] {
            let is_there = table.next().map(|row| row.trim_start().starts_with(name));
            assert_eq!(is_there, Some(true), "{name}\n{all}");
        }
        let last = rows.iter().rfind(|row| !row.is_empty());
        let success = format!("{VERDICT}success\"}}");
        assert_eq!(last, Some(&success), "{all}");
        assert!(!all.contains('\u{fffd}'), "{all}");
    }
}

#[test]
fn why_a_machine_or_a_word_is_refused() {
    let guest = |loader| Guest::new("fork-join").from_stick(loader);
    let (bios, uefi) = (guest(Loader::Bios), guest(Loader::Uefi));
    let word = "`avx=512`: allowed are on, off";
    for (guest, cores, model, why) in [
        (
            bios.clone(),
            2,
            "max,-nx",
            "the processor has no no-execute pages (NX, XD); turn it on in the firmware's settings",
        ),
        (
            bios.clone().memory_mib(8),
            32,
            "max",
            "each core needs 144 KiB of memory",
        ),
        (bios.word("avx=512"), 2, "max", word),
        (uefi.word("avx=512"), 2, "max", word),
    ] {
        let (rows, _) = rows_of(&guest, cores, model);
        let all = rows.join("\n");
        let says_why = |row: &String| row.trim_start().starts_with(why);
        assert!(rows.iter().any(says_why), "{all}");
        let success = format!("{VERDICT}success");
        assert!(!rows.iter().any(|row| row.starts_with(&success)), "{all}");
    }
}
