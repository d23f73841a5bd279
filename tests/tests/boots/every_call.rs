//! A `main` making every call of its machine is a single source for the machine and for Linux.

use harness::Guest;
use harness::markdown::page;
use tool::image;

#[test]
fn a_main_with_every_call_of_the_machine_is_one_source_on_the_machine_and_on_linux() {
    let calls = page("tests/guest/src/every_call.rs");
    let source = page("kernel/front/src/app/machine.rs");
    for call in source.split("pub fn ").skip(1) {
        let (name, arguments) = call.split_once('(').expect("a function");
        let is_made = calls.contains(&format!("machine.{name}("));
        assert!(
            is_made || !arguments.starts_with("&self"),
            "tests/guest/src/every_call.rs does not call `{name}`"
        );
    }
    let _ = Guest::test("every_call").cores(2).succeed_sending();
    let program = image::build_linux("guest-tests", None).expect("it is built");
    let program = program.display().to_string();
    let words = "test=every_call later=1 output=/dev/null";
    let place = ["--on", "linux", "--cores", "2", "--append", words];
    let _ = harness::run(
        "guest-tests",
        &[&["--image", &program], &place[..]].concat(),
    );
}
