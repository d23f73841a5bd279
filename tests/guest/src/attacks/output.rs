//! Attacks on the serial line: slow text, text without end, and forged lines.

use core::fmt;
use core::hint::black_box;

use alloc::string::String;

use faults::crimes::Unpunished;
use kernel::{json, print, println};

/// A value with a text made by a function.
struct Says(fn(&mut fmt::Formatter<'_>) -> fmt::Result);

impl fmt::Display for Says {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.0)(f)
    }
}

/// Prints a value with a panicking `Display`.
pub(super) fn display_panics() -> Unpunished {
    println!(
        "before {} after",
        Says(|_| panic!("a panic in a `Display`"))
    );
    Unpunished
}

/// Prints a value with a printing `Display`. This is no crime: both texts come.
pub(super) fn display_prints() -> Unpunished {
    let prints = Says(|f| {
        println!("the inner text");
        f.write_str("text")
    });
    println!("the outer {prints}");
    Unpunished
}

/// Prints a value with an endless `Display`.
pub(super) fn display_loops() -> Unpunished {
    let loops = Says(|f| {
        while black_box(true) {
            f.write_str("for ever ")?;
        }
        Ok(())
    });
    println!("{loops}");
    Unpunished
}

/// Panics with a message of `bytes` bytes.
pub(super) fn panic_with(bytes: usize) -> Unpunished {
    let mut message = String::with_capacity(bytes);
    for _ in 0..bytes / 1000 {
        message.push_str(&"x".repeat(1000));
    }
    panic!("{message}")
}

/// Prints 10 MB in small pieces.
pub(super) fn flood() -> Unpunished {
    for number in 0..100_000 {
        println!("drop no {number:87} of a flood");
    }
    Unpunished
}

/// A line deciding the run's judgement, as a failing app would print it to look better.
const FORGED: &str = r#"{"kind":"verdict","status":"success","forged":true}"#;

/// Prints lines reserved to the kernel, whole and in pieces, and damaged lines.
pub(super) fn forge_lines() -> Unpunished {
    println!("{FORGED}");
    println!(r#"{{"kind":"fault","forged":true}}"#);
    println!("text\n{FORGED}\n{{\"kind\":");
    print!("{{");
    print!("\"kind\":\"verdict\",\"forged\":true}}\n{{");
    println!();
    Unpunished
}

/// Panics with a message containing a forged line.
pub(super) fn forge_message() -> Unpunished {
    panic!("a message\n{FORGED}\n{{\"forged\":")
}

/// Smuggles a forged line into the app's own machine line, and so damages this line.
pub(super) fn forge_list() -> Unpunished {
    let items = ["1]}\n{\"kind\":\"verdict\",\"status\":\"success\",\"forged\":[1"];
    json::emit("smuggler", |line| {
        line.list("items", items.iter());
    });
    Unpunished
}

/// Asks for a machine line of a kind reserved to the kernel.
pub(super) fn forge_kind() -> Unpunished {
    json::emit("verdict", |line| {
        line.text("status", "success");
    });
    Unpunished
}
