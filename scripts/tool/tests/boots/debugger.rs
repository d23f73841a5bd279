//! `debug` as a person uses it: gdb stops in a subtask and shows its variables.

use std::fs;

use tool::system::workspace;

use crate::support::{call, folder};

#[test]
fn a_breakpoint_in_a_subtask_shows_locals_and_callers() {
    let folder = folder("debugged");
    let lines = "next\nnext\ninfo locals\nprint goal[2]\nbacktrace 2\n";
    fs::write(folder.join("commands"), lines).expect("a file in it");
    let line = "debug --app=drone --break=control --cores=2 --commands commands";
    let called = call(&folder, line.split(' '));
    let said = called.out + &called.complaint;
    assert_eq!(called.code, Some(0), "{said}");
    for shown in [
        "drone::attitude::control (estimate=",
        "apps/drone/src/attitude.rs:",
        "\nwanted = [0, 0]\n",
        "\n$1 = 3\n",
        "drone::dags::{impl#0}::register_attitude::{closure#2}",
        // The guest's lines for people stand between, and no machine line does.
        "dag `attitude` takes at most ",
    ] {
        assert!(said.contains(shown), "no `{shown}` in:\n{said}");
    }
    assert!(!said.contains("{\"kind\""), "{said}");
}

#[test]
fn a_place_that_is_not_there_is_refused() {
    for (place, remedy) in [
        ("contrl", "; did you mean `control`?"),
        ("attitude.rs:9999", "no code of that line; name a file"),
    ] {
        let called = call(workspace(), ["debug", "--app=drone", "--break", place]);
        let said = called.complaint;
        assert_eq!(called.code, Some(2), "{said}");
        assert!(said.contains(place) && said.contains(remedy), "{said}");
    }
}
