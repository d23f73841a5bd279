//! Properties of all commands of the laboratory, as the tool's own tests hold them of its commands.

use tool::system::workspace;

use crate::support::{
    assert_explained, assert_needs_room, assert_refused, assert_visible, code_without_readers,
};

/// Every command, by the words that name it.
const COMMANDS: &str = "test, soak, bench, \
    bench bounds, bench hand-off, bench join-latency, bench native, bench sizes, oracle, oracle assignment, \
    oracle bounds, oracle one-core, oracle responses, oracle schedules, oracle schedules --in-kernel, oracle synchronizer, \
    oracle waiting";

#[test]
fn every_command_explains_itself_and_names_an_unknown_option() {
    assert_explained(COMMANDS);
}

#[test]
fn that_no_one_reads_is_no_failure_and_that_there_is_no_room_is_one() {
    let line = "oracle synchronizer tests/oracle/synchronizer.txt";
    assert_eq!(code_without_readers(line), Some(0));
    assert_needs_room("fass-lab", line);
}

#[test]
fn what_does_not_fit_is_refused_with_the_remedy() {
    let rows = "
oracle schedules --in-kernal | oracle schedules: unknown option `--in-kernal`; did you mean `--in-kernel`?
bench hand-of | bench: unknown WHAT `hand-of`; did you mean `hand-off`?
oracle bound | oracle: unknown KIND `bound`; did you mean `bounds`?
tset | fass-lab: unknown SUBCOMMAND `tset`; did you mean `test`?
bench bounds --cores 2,2 | `--cores`: `2` stands twice
bench bounds sets.txt --seed 2 | bench bounds: `--seed` is for random sets; leave it or the files out
bench native --only join,join | `--only`: `join` stands twice
bench join-latency --subtasks 2,2 | `--subtasks`: `2` stands twice
bench join-latency --policies exact,exact | `--policies`: `exact` stands twice
bench join-latency --on linux --mode kvm | `--mode` is for guests";
    assert_refused(workspace(), rows);
}

#[test]
fn what_a_message_repeats_cannot_rewrite_the_terminal() {
    assert_visible(&[
        "oracle bounds WORD",
        "bench WORD",
        "bench join-latency --policies fassWORDexact",
        "soak --mode WORD",
    ]);
}
