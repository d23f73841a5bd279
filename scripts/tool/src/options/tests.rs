//! Command lines that a table accepts or refuses, and the words of refusals.

use super::*;
use crate::tests::{right, rows};
use std::os::unix::ffi::OsStringExt;

static COMMAND: Command = Command {
    invocation: "./scripts/example",
    about: "Does nothing.",
    positional: None,
    options: OPTIONS,
    notes: "Exit codes: none.",
};

options! {
    /// Processors of the guest.
    CORES: ValueKind::Number(1, 64), or "8";
    /// Parallel subtasks.
    SUBTASKS: ValueKind::Numbers(1, 14);
    /// The meaning of time.
    MODE: ValueKind::OneOf(&["kvm", "deterministic", "threads"]);
    /// Keep the log.
    SERIAL: ValueKind::File("FILE");
    /// Only this.
    ONLY: ValueKind::Text("NAME");
    /// Say less.
    QUIET 'q': ValueKind::Nothing;
}

fn parsed(line: &str) -> CommandLine {
    right(&COMMAND, line)
}

fn refusal(line: &str) -> String {
    refusal_of(
        &line
            .split_whitespace()
            .map(OsString::from)
            .collect::<Vec<_>>(),
    )
}

fn refusal_of(words: &[OsString]) -> String {
    match COMMAND.parse(words) {
        Err(Refusal::Usage(line)) => line,
        other => panic!("{words:?} gave {other:?}"),
    }
}

#[test]
fn what_is_given_holds_and_else_the_default() {
    let given = parsed("");
    assert_eq!(given.number(name::CORES), Some(8));
    assert_eq!(given.text(name::MODE), None);
    assert!(!given.is_given(name::QUIET) && !given.is_given(name::CORES));
    let given = parsed("--cores 4 --mode=threads -q --subtasks=2,4,6");
    assert_eq!(given.number(name::CORES), Some(4));
    assert_eq!(given.text(name::MODE), Some("threads"));
    assert_eq!(given.text(name::SUBTASKS), Some("2,4,6"));
    assert!(given.is_given(name::QUIET));
    for (line, file) in [("--serial=--quiet", "--quiet"), ("--serial -x", "-x")] {
        assert_eq!(parsed(line).path(name::SERIAL), Some(Path::new(file)));
    }
}

/// Command lines, and the words of their refusal.
const REFUSED: &str = "\
--cores 0 | `--cores 0`: must be a number from 1 to 64
--cores 65 | `--cores 65`: must be a number from 1 to 64
--cores x | `--cores x`: must be a number from 1 to 64
--cores -1 | `--cores -1`: must be a number from 1 to 64
--cores +1 | `--cores +1`: must be a number from 1 to 64
--cores 1.5 | `--cores 1.5`: must be a number from 1 to 64
--cores 99999999999999999999999 | `--cores 99999999999999999999999`: must be a number from 1 to 64
--subtasks 2,0,6 | `--subtasks 2,0,6`: must be numbers from 1 to 14 with commas between
--subtasks 2,,6 | `--subtasks 2,,6`: must be numbers from 1 to 14 with commas between
--core 4 | unknown option `--core`; did you mean `--cores`?
--frobnicate | unknown option `--frobnicate`; allowed are --cores, --subtasks, --mode, --serial, --only, --quiet, --help
-x | unknown option `-x`; allowed are --cores, --subtasks, --mode, --serial, --only, --quiet, --help
-é | unknown option `-é`; allowed are --cores, --subtasks, --mode, --serial, --only, --quiet, --help
--mode thread | `--mode thread`: must be one of kvm, deterministic, threads; did you mean `threads`?
stray | unknown word `stray`; options begin with `--`, see ./scripts/example --help
--cores | option `--cores` lacks its value: a number from 1 to 64
--cores 1 --cores 2 | option `--cores` stands twice; give it once
--quiet=yes | option `--quiet` takes no value; write it alone
--serial= | `--serial `: must be a file
--help=1 | option `--help` takes no value; write it alone
-h= | option `--help` takes no value; write it alone
--serial --quiet | option `--serial` lacks its value: a file; one that begins with `-` is written `--serial=VALUE`
--serial -q | option `--serial` lacks its value: a file; one that begins with `-` is written `--serial=VALUE`
--serial --frobnicate | option `--serial` lacks its value: a file; one that begins with `-` is written `--serial=VALUE`
--cores --quiet | option `--cores` lacks its value: a number from 1 to 64";

#[test]
fn what_the_table_does_not_allow_is_named_with_what_it_does() {
    for [line, said] in rows(REFUSED) {
        assert_eq!(refusal(&line), said);
    }
}

#[test]
fn only_a_file_may_have_a_name_that_is_not_utf_8() {
    let odd = OsStr::from_bytes(b"\xff.log");
    let with = |option: &str| {
        let words = vec![OsString::from(option), odd.into()];
        let mut attached = OsString::from(format!("{option}=")).into_vec();
        attached.extend(odd.as_bytes());
        [words, vec![OsString::from_vec(attached)]]
    };
    for words in with("--serial") {
        let parsed = COMMAND.parse(&words).expect("a file may have any name");
        assert_eq!(parsed.path(name::SERIAL), Some(Path::new(odd)));
    }
    for (option, must) in [
        ("--cores", "a number from 1 to 64"),
        ("--mode", "one of kvm, deterministic, threads"),
        ("--only", "a name"),
    ] {
        let said = format!("`{option} \u{fffd}.log`: is not UTF-8 text; must be {must}");
        assert_eq!(with(option).map(|words| refusal_of(&words)), [&*said; 2]);
    }
    let word = refusal_of(&[odd.into()]);
    assert!(word.starts_with("unknown word `\u{fffd}.log`; "), "{word}");
}

#[test]
fn a_value_is_repeated_in_part_and_visibly() {
    let long = "9".repeat(5000);
    let shown = "9".repeat(40);
    let range = "must be a number from 1 to 64";
    assert_eq!(
        refusal(&format!("--cores {long}")),
        format!("`--cores {shown}...`: {range}")
    );
    let words = [OsString::from("--cores"), "1\n\u{1b}[2J".into()];
    let said = refusal_of(&words);
    assert_eq!(said, format!("`--cores 1\\n\\u{{1b}}[2J`: {range}"));
}

#[test]
fn help_shows_the_table() {
    let words = ["--cores", "3", "--help"].map(OsString::from);
    let refusal = COMMAND.parse(&words).unwrap_err();
    let expected = "\
Does nothing.

usage: ./scripts/example [options]

      --cores N           Processors of the guest. [1 to 64; default 8]
      --subtasks N,N,...  Parallel subtasks. [1 to 14]
      --mode WORD         The meaning of time. [kvm | deterministic | threads]
      --serial FILE       Keep the log.
      --only NAME         Only this.
  -q, --quiet             Say less.
  -h, --help              Show this text.

Exit codes: none.
";
    assert_eq!(refusal, Refusal::Help(expected.into()));
}

#[test]
fn a_group_has_its_name_and_all_options_of_run_stand_on_one_page() {
    let help = crate::run::RUN.help();
    let lines: Vec<&str> = help.lines().collect();
    assert!(lines.len() <= 60, "{} lines:\n{help}", lines.len());
    assert!(help.contains("\n  where          --on WORD "), "{help}");
    assert!(lines.iter().all(|line| line.len() <= 100), "{help}");
}
