//! `page` and `run --page`: command lines that are refused before anything is built.
//! `in_chromium.rs` opens pages.

use std::fs;

use crate::support::{assert_refused, folder};
use crate::traces::good;

#[test]
fn what_is_neither_a_dag_file_nor_a_record_is_refused_and_no_input_is_overwritten() {
    let folder = folder("no-page");
    for (name, content) in [
        ("good.rec", &good()[..]),
        ("cut.rec", &good()[..40]),
        ("empty", b""),
        ("cut.dag", b"dag x period 10ms\nsubtask a\n"),
        ("x.yaml", b"nodes:\n"),
    ] {
        fs::write(folder.join(name), content).expect("the test's folder takes a file");
    }
    let rows = "
page none.rec | none.rec: cannot be read: No such file or directory
page none.dag | none.dag: cannot be read: No such file or directory
page empty | empty: there is no run in it; `./scripts/run --trace FILE` keeps one (the name of a DAG file ends in .dag)
page cut.rec | cut.rec: 
page good.rec cut.dag | cut.dag:2: subtask `a` 
page x.yaml | x.yaml: there is no run in it; `./scripts/run --trace FILE` keeps one (the name of a DAG file ends in .dag)
page good.rec -o good.rec | `good.rec` and `--out good.rec` are one file, which would be overwritten
page good.rec ./good.rec | `good.rec` and `./good.rec` are one file; give it once
page -o none/page.html | `--out none/page.html`: cannot be written
run --page --on debian | `--page` is not for `--on debian`; leave it out, or give `--on linux`
run --page --replay good.rec | `--replay` and `--page` exclude each other
run --page --prove | `--page` is for a run that is not observed; leave one of them out
run --page --dag . | `--page` is for one file; name one with `--dag`";
    assert_refused(&folder, rows);
    assert_eq!(fs::read(folder.join("good.rec")).expect("a file"), good());
    assert!(!folder.join("page.html").exists());
}
