//! Witnesses of the examples' bounds, next to the checker that Coq has proven right.

use std::fs;
use std::process::Command;

use crate::support::{folder, succeed};
use tool::system::workspace;

#[test]
fn witnesses_of_the_examples_are_accepted() {
    let folder = folder("proven");
    let examples = workspace().join("apps/dag-file/examples");
    let mut checker = Command::new(workspace().join("scripts/check-witness"));
    checker.arg("--proven");
    for name in [
        "branches", "demo", "drive", "hogs", "lent", "policies", "robot", "vision",
    ] {
        let file = examples.join(name).with_extension("dag");
        let run = format!(
            "run --on host --jobs 1 --keep {name} --dag {}",
            file.display()
        );
        succeed(&folder, &run);
        succeed(
            &folder,
            &format!("recording {name} --witness {name}.witness"),
        );
        checker.arg(folder.join(name).with_extension("witness"));
    }
    let output = checker.output().expect("Python runs");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(
        !said.contains("refused") && !said.contains("does not accept"),
        "{said}"
    );
    assert!(said.matches(": proven by machine").count() >= 16, "{said}");
    fs::remove_dir_all(&folder).expect("it was made");
}
