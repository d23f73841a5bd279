//! A machine without a serial port shows on its screen what it has to say. The test reads it
//! there, by the kernel's own letters, as QEMU gives the picture.

use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use boot::screen::font::{HEIGHT, WIDTH, is_lit};
use harness::Guest;
use tool::qemu::{Ending, Loader};
use tool::system;

const VERDICT: &str = "{\"kind\":\"verdict\",\"status\":\"success\"}";

/// Makes a program that is QEMU with a screen, without a serial port and without an end, which
/// listens at `monitor`.
fn qemu_with_a_screen(monitor: &Path) -> PathBuf {
    let program = monitor.with_extension("program");
    let script = format!(
        "#!/bin/bash\nset -- \"${{@/file:*/none}}\"\nset -- \"${{@/iobase=0xf4/iobase=0xf8}}\"\n\
         exec qemu-system-x86_64 \"$@\" -vga std -monitor unix:{},server=on,wait=off\n",
        monitor.display()
    );
    fs::write(&program, script).expect("the script is written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("it is ours");
    program
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

/// Looks at the screen until the verdict is there, ends QEMU and returns the rows.
fn watch(monitor: &Path) -> Vec<String> {
    let picture = monitor.with_extension("ppm");
    let begun = Instant::now();
    let mut rows = Vec::new();
    while begun.elapsed() < Duration::from_secs(300) && !rows.iter().any(|row| row == VERDICT) {
        thread::sleep(Duration::from_secs(1));
        if let Ok(mut stream) = UnixStream::connect(monitor) {
            let _ = writeln!(stream, "screendump {}", picture.display());
            thread::sleep(Duration::from_millis(500));
            rows = self::rows(&fs::read(&picture).unwrap_or_default());
        }
    }
    if let Ok(mut stream) = UnixStream::connect(monitor) {
        let _ = writeln!(stream, "quit");
        thread::sleep(Duration::from_millis(500));
    }
    let _ = fs::remove_file(&picture);
    rows
}

/// Boots the demo and reads its table on the screen.
fn shows(loader: Loader) {
    let monitor = system::new_log("monitor").expect("a folder for logs");
    let program = qemu_with_a_screen(&monitor);
    let guest = Guest::new("fork-join").from_stick(loader).cores(2);
    let guest = guest.program(&program).word("jobs=3").word("subtasks=2");
    let watcher = thread::spawn({
        let monitor = monitor.clone();
        move || watch(&monitor)
    });
    let outcome = guest.boot();
    let rows = watcher.join().expect("it does not panic");
    let _ = fs::remove_file(&program);
    let all = rows.join("\n");
    assert_eq!(outcome.ending, Ending::Status(0), "{all}");
    assert_eq!(outcome.serial, "", "there is no serial port");
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
    assert_eq!(last.map(String::as_str), Some(VERDICT), "{all}");
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
