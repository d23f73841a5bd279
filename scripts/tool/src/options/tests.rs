//! What a table accepts, what it refuses, and in which words.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::Path;

use super::{Command, Opt, Parsed, Request, Takes};

static COMMAND: Command = Command {
    invocation: "./scripts/example",
    about: "Does nothing.",
    positional: None,
    options: &[
        Opt::new("cores", Takes::number(1..=64), "Processors of the guest.").or("8"),
        Opt::new("subtasks", Takes::numbers(1..=14), "Parallel subtasks."),
        Opt::new(
            "mode",
            Takes::OneOf(&["kvm", "deterministic", "threads"]),
            "What time means.",
        ),
        Opt::new("serial", Takes::File("FILE"), "Keep the log."),
        Opt::new("only", Takes::Text("NAME"), "Only this."),
        Opt::new("quiet", Takes::Nothing, "Say less.").short('q'),
    ],
    notes: "Exit codes: none.",
};

fn request(line: &str) -> Result<Request, String> {
    let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
    COMMAND.parse(&words).map_err(|error| error.to_string())
}

fn parsed(line: &str) -> Parsed {
    COMMAND.right(line)
}

fn refusal(line: &str) -> String {
    request(line).expect_err(line)
}

#[test]
fn defaults_hold_where_nothing_is_given() {
    let parsed = parsed("");
    assert_eq!(parsed.number("cores"), Some(8));
    assert_eq!(parsed.text("mode"), None);
    assert!(!parsed.is_given("quiet"));
    assert!(!parsed.is_given("cores"));
}

#[test]
fn values_are_separate_or_attached() {
    let parsed = parsed("--cores 4 --mode=threads -q --subtasks=2,4,6");
    assert_eq!(parsed.number("cores"), Some(4));
    assert_eq!(parsed.text("mode"), Some("threads"));
    assert_eq!(parsed.text("subtasks"), Some("2,4,6"));
    assert!(parsed.is_given("quiet"));
}

#[test]
fn a_number_out_of_range_is_named_with_its_range() {
    let range = "must be a number from 1 to 64";
    for value in ["0", "65", "x", "-1", "+1", "1.5", "99999999999999999999999"] {
        let refusal = refusal(&format!("--cores {value}"));
        assert_eq!(refusal, format!("`--cores {value}`: {range}"));
    }
    assert_eq!(
        refusal("--subtasks 2,0,6"),
        "`--subtasks 2,0,6`: must be numbers from 1 to 14 with commas between"
    );
    assert!(refusal("--subtasks 2,,6").contains("commas"));
}

#[test]
fn an_unknown_option_is_named_with_the_nearest() {
    assert_eq!(
        refusal("--core 4"),
        "unknown option `--core`; did you mean `--cores`?"
    );
    assert_eq!(
        refusal("--frobnicate"),
        "unknown option `--frobnicate`; \
         allowed are --cores, --subtasks, --mode, --serial, --only, --quiet, --help"
    );
    assert!(refusal("-x").starts_with("unknown option `-x`; "));
    assert!(refusal("-é").starts_with("unknown option `-é`; "));
}

#[test]
fn an_unknown_word_is_named_with_those_allowed() {
    assert_eq!(
        refusal("--mode thread"),
        "`--mode thread`: must be one of kvm, deterministic, threads; did you mean `threads`?"
    );
    assert_eq!(
        refusal("stray"),
        "unknown word `stray`; options begin with `--`, see ./scripts/example --help"
    );
}

#[test]
fn a_line_that_is_not_whole_is_refused() {
    assert_eq!(
        refusal("--cores"),
        "option `--cores` lacks its value: a number from 1 to 64"
    );
    assert_eq!(
        refusal("--cores 1 --cores 2"),
        "option `--cores` stands twice; give it once"
    );
    assert_eq!(
        refusal("--quiet=yes"),
        "option `--quiet` takes no value; write it alone"
    );
    assert_eq!(refusal("--serial="), "`--serial `: must be a file");
    for word in ["--help=1", "-h="] {
        let said = "option `--help` takes no value; write it alone";
        assert_eq!(refusal(word), said);
    }
}

#[test]
fn an_option_is_no_value() {
    for line in ["--serial --quiet", "--serial -q", "--serial --frobnicate"] {
        assert_eq!(
            refusal(line),
            "option `--serial` lacks its value: a file; \
             one that begins with `-` is written `--serial=VALUE`"
        );
    }
    assert_eq!(
        refusal("--cores --quiet"),
        "option `--cores` lacks its value: a number from 1 to 64"
    );
    assert_eq!(
        parsed("--serial=--quiet").path("serial"),
        Some(Path::new("--quiet"))
    );
    assert_eq!(parsed("--serial -x").path("serial"), Some(Path::new("-x")));
}

#[test]
fn only_a_file_may_have_a_name_that_is_not_utf_8() {
    let odd = OsStr::from_bytes(b"\xff.log");
    let with = |option: &str| {
        let words = [OsString::from(option), odd.into()];
        let mut attached = OsString::from(format!("{option}=")).into_vec();
        attached.extend(odd.as_bytes());
        let attached = COMMAND.parse(&[OsString::from_vec(attached)]);
        (COMMAND.parse(&words), attached)
    };
    let (Ok(Request::Work(one)), Ok(Request::Work(other))) = with("--serial") else {
        panic!("a file may have any name");
    };
    assert_eq!(one.path("serial"), Some(Path::new(odd)));
    assert_eq!(other.path("serial"), Some(Path::new(odd)));
    for (option, must) in [
        ("--cores", "a number from 1 to 64"),
        ("--mode", "one of kvm, deterministic, threads"),
        ("--only", "a name"),
    ] {
        let (one, other) = with(option);
        let said = format!("`{option} \u{fffd}.log`: is not UTF-8 text; must be {must}");
        assert_eq!(one.unwrap_err().0, said);
        assert_eq!(other.unwrap_err().0, said);
    }
    let word = COMMAND.parse(&[odd.into()]).unwrap_err().0;
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
    let said = COMMAND.parse(&words).unwrap_err().0;
    assert_eq!(said, format!("`--cores 1\\n\\u{{1b}}[2J`: {range}"));
}

#[test]
fn help_shows_the_table() {
    let Ok(Request::Help(text)) = request("--cores 3 --help") else {
        panic!("`--help` must give the help text");
    };
    let expected = "\
Does nothing.

usage: ./scripts/example [options]

      --cores N           Processors of the guest. [1 to 64; default 8]
      --subtasks N,N,...  Parallel subtasks. [1 to 14]
      --mode WORD         What time means. [kvm | deterministic | threads]
      --serial FILE       Keep the log.
      --only NAME         Only this.
  -q, --quiet             Say less.
  -h, --help              Show this text.

Exit codes: none.
";
    assert_eq!(text, expected);
}
