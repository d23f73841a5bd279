//! The host tool builds images, starts QEMU, and judges the runs of guests.
//!
//! Some words. A *guest* is one boot of an image in QEMU. Its *serial log* is its whole output,
//! lines for people and machine lines mixed. Its *ending* is the way QEMU's process ended; its
//! *verdict* is its own last line. The scripts in `scripts/` call the tool's *subcommands* (`run`,
//! `image`, ...).
//!
//! The library serves the program (`main.rs`), the laboratory (`scripts/lab`), and two kinds of
//! tests, its own and the boot tests in `tests/`; both judge an [`Outcome`]. From the bottom up:
//!
//! - [`elf`], [`image`], [`medium`], [`places`]: images and media to boot;
//! - [`child`], [`qemu`], [`outcome`]: the boot, and the judgement of its end;
//! - [`install`], [`probe`], [`system`]: programs and abilities of the host;
//! - [`options`](mod@options): command lines described by a table; [`files`]: files named there;
//!   [`output`], [`progress`]: printing without a panic, and progress of long work;
//! - [`mod@dag_file`]: DAGs described by files of any supported format;
//! - [`trace`]: the events of a run, checked against the model's rules;
//! - [`recordings`]: the inputs of a run, and conversion to and from other formats;
//! - [`proof`]: the bounds of committed DAGs, and witnesses of these bounds;
//! - [`page`](mod@page): the page that plays and shows runs;
//! - [`run`](mod@run) with its [`run_options`], [`new_app`](mod@new_app): the subcommands.
//!
//! The library guarantees that no guest runs without a limit. A run counts as good only if both the
//! guest's verdict and QEMU's exit status say so. Besides crates of this workspace, the library
//! uses only the standard library, and it contains no `unsafe`.

#![forbid(unsafe_code)]

// First: the macros in this module hide the standard library's only in later modules.
#[macro_use]
pub mod output;

pub mod child;
pub mod dag_file;
pub mod debian;
pub mod elf;
pub mod files;
pub mod image;
pub mod install;
pub mod medium;
pub mod new_app;
pub mod options;
pub mod outcome;
pub mod page;
pub mod places;
pub mod probe;
pub mod program;
pub mod progress;
pub mod proof;
pub mod qemu;
pub mod recordings;
pub mod run;
pub mod run_options;
pub mod system;
pub mod trace;
pub mod wire_script;

pub use outcome::Outcome;
pub use qemu::{Machine, Mode};

use options::WordMenu;

/// The tool's subcommands.
pub static TOOL: WordMenu = WordMenu {
    invocation: "fass-tool",
    word: "SUBCOMMAND",
    about: "Does what the scripts in scripts/ are there for.",
    choices: choices! {
        "run": "boot an app in QEMU and judge the run", run::run;
        "debug": "boot an app in QEMU, under gdb", run::debug;
        "boot": "boot an image, and run any other program as it is: for cargo", run::boot;
        "image": "make a file that boots an app on a PC", medium::image;
        "new-app": "make an app of your own, in a repository of its own or under apps/",
            new_app::new_app;
        "check-trace": "replay the traces of runs against the model's rules", trace::check_trace;
        "trace": "convert the traces of runs for Perfetto's viewer", trace::trace;
        "page": "make a page that plays DAG files and shows runs in a browser", page::page;
        "recording": "show a recording, and convert it from and to other formats",
            recordings::recording;
    },
    notes: "Exit codes: 0 all is well, 1 a failure, 2 a refused command line.\n",
};

#[cfg(test)]
extern crate self as tool;

#[cfg(test)]
mod tests;
