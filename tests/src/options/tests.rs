//! What a table accepts, what it refuses, and in which words.

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
        Opt::new("serial", Takes::Text("FILE"), "Keep the log."),
        Opt::new("quiet", Takes::Nothing, "Say less.").short('q'),
    ],
    notes: "Exit codes: none.",
};

fn request(line: &str) -> Result<Request, String> {
    let words: Vec<String> = line.split_whitespace().map(String::from).collect();
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
         allowed are --cores, --subtasks, --mode, --serial, --quiet, --help"
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
  -q, --quiet             Say less.
  -h, --help              Show this text.

Exit codes: none.
";
    assert_eq!(text, expected);
}
