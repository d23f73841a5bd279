//! The contents of answers, natively.

use views::json::Value;

use crate::{Answer, answer, file, native, request};

const DRIVE: &str = "apps/dag-file/examples/drive.dag";

#[test]
fn a_play_tells_bounds_tests_and_reasons() {
    let played = answer("play cores=4 policy=edf periods=3", &file(DRIVE));
    assert_eq!(played.text("dags.0.name"), "drive");
    assert_eq!(played.number("dags.0.bound_ns"), 36_000_000);
    assert_eq!(played.number("dags.0.max_ns"), 28_000_000);
    let test = "multiple paths under global EDF";
    assert_eq!(played.text("dags.0.test"), test);
    assert_eq!(played.text("dags.0.why"), "");
    assert_eq!(played.number("dags.1.jobs"), 15);
    assert_eq!(played.at("dags.0.subtasks").elements().len(), 7);
    assert!(played.text("dags.0.notes.0").starts_with("3 jobs"));
    assert!(played.text("graph").starts_with("<svg"));
    assert_eq!(played.text("policy"), "edf");
    assert_eq!(played.text("preemption"), "on");
    assert_eq!(*played.at("is_judged"), Value::Bool(true));
    assert_eq!(played.number("breach_count"), 0);
    assert_eq!(played.column("job_dag").len(), 3 + 15);
    // On two cores no test bounds `control`, so none bounds `drive`.
    let played = answer("play cores=2 policy=edf judge=no", &file(DRIVE));
    assert_eq!(played.text("dags.1.test"), "");
    assert!(played.text("dags.1.why").starts_with("no test bounds"));
    assert!(played.text("dags.0.why").contains("`control`"));
    assert_eq!(*played.at("is_judged"), Value::Bool(false));
}

/// `tests/tests/boots/dag_file.rs` draws the same by README's commands, of a boot.
#[test]
fn the_readmes_picture_is_the_pages() {
    let words = "svg-of-play cores=2 policy=static overheads=kernel periods=5";
    let drawn = native(&request(words, &file("apps/dag-file/examples/vision.dag")));
    assert!(drawn == file("docs/schedule.svg"));
}

#[test]
fn the_picture_of_a_play_is_that_of_its_record() {
    let words = "cores=2 policy=static preemption=off periods=4 from=10ms to=90ms dags=control";
    let record = native(&request(&format!("record-of-play {words}"), &file(DRIVE)));
    let drawn = native(&request(&format!("svg-of-play {words}"), &file(DRIVE)));
    assert!(drawn.starts_with(b"<svg"));
    assert!(drawn == native(&request(&format!("svg {words}"), &record)));
    let opened = answer("open", &record);
    assert_eq!(opened.number("tolerance_ns"), 1_000_000);
    assert_eq!(opened.number("dags.1.jobs"), 20);
}

#[test]
fn a_record_that_grows_is_read_as_far_as_it_goes() {
    let record = native(&request("record-of-play periods=50", &file(DRIVE)));
    let cut = &record[..record.len() * 2 / 3];
    let (whole, live) = (answer("open", &record), answer("open live=yes", cut));
    assert!((1..whole.number("events")).contains(&live.number("events")));
    assert!(live.at("warnings").elements().is_empty());
    let died = answer("open", cut);
    assert!(died.text("warnings.0").contains("ends before its run"));
}

#[test]
fn faults_are_told_at_their_lines_with_names_and_remedies() {
    let cyclic =
        b"dag a period 9ms\nsubtask x wcet 1ms\nsubtask y wcet 1ms\nedge x -> y\nedge y -> x\nend";
    let refused = answer("play", cyclic);
    assert_eq!(refused.number("faults.0.line"), 5);
    let why = refused.text("faults.0.why");
    assert!(why.contains("has a cycle: subtask `x`"), "{why}");
    assert_eq!(answer("play", b"dag a\nend").number("faults.0.line"), 1);
    for (line, offender, remedy) in [
        ("play policy=rm", "`rm`", "edf"),
        ("play cores=65", "`65`", "1 to 64"),
        ("play cores=0", "`0`", "1 to 64"),
        ("play clusters=2,x", "`2,x`", "auto"),
        ("play execution=often", "often", "uniform"),
        ("play overheads=some", "`some`", "kernel"),
        ("play app=cat", "`cat`", "stamps"),
        ("play set=none", "`none`", "name another"),
        ("play speed=9", "`speed=9`", "known are"),
        ("open", "no run", "--trace FILE"),
        ("open sizes=9,99999", "9,99999", "records that follow"),
        ("svg-of-play dags=camera", "`camera`", "control"),
        ("svg-of-play from=yesterday", "from", "yesterday"),
        ("job of=play dag=9", "9", "2"),
        ("dance", "`dance`", "play"),
    ] {
        let refused = answer(line, &file(DRIVE));
        let why = refused.text("faults.0.why");
        assert_eq!(refused.number("faults.0.line"), 0, "{line}: {why}");
        let is_told = why.contains(offender) && why.contains(remedy);
        assert!(is_told, "{line}: {why}");
    }
    let refused = Answer::read(native(b"play"));
    assert!(refused.text("faults.0.why").contains("line"));
}

#[test]
fn names_of_any_letters_stay_text() {
    let name = "<img/src=x/onerror=alert(1)>";
    let text = format!("dag {name} period 9ms\nsubtask \"&'{name} wcet 1ms\nend # {name}");
    let played = answer("play", text.as_bytes());
    assert_eq!(played.text("dags.0.name"), name);
    let graph = played.text("graph");
    assert!(!graph.contains("<img"), "{graph}");
}

#[test]
fn a_match_by_stamps_takes_frames_of_different_jobs_and_a_join_none() {
    let played = answer("play app=stamps cores=4", b"");
    let told = played.text("warnings.0");
    assert!(told.contains("different jobs in 8 of 40 jobs"), "{told}");
    assert!(told.ends_with("`joined` in 0 of 40"), "{told}");
    // All are proven to meet their deadlines all the same, and do.
    for dag in 0..4 {
        assert!(played.number(&format!("dags.{dag}.bound_ns")) > 0);
        assert_eq!(played.number(&format!("dags.{dag}.misses")), 0);
        assert_eq!(played.number(&format!("dags.{dag}.completed")), 40);
    }
    let values = answer("job of=play app=stamps cores=4 dag=3 job=2", b"");
    let told = |member| [0, 1, 2].map(|at| values.text(&format!("values.{at}.{member}")));
    assert_eq!(told("way"), ["took", "took", "gave"]);
    assert_eq!(told("of"), ["camera #2", "lidar #2", ""]);
    let [.., pair] = told("text");
    let is_mixed = pair.starts_with("[{\"job\":2,") && pair.contains(",{\"job\":1,");
    assert!(is_mixed, "{pair}");
    assert_eq!(played.column("job_flags")[0], Some(8));
}

#[test]
fn the_drone_flies_and_lands() {
    let flown = answer("play app=drone cores=4", b"");
    assert_eq!(flown.number("dags.0.jobs"), 8000);
    assert_eq!(flown.number("breach_count"), 0);
    let misses = (0..7).map(|dag| flown.number(&format!("dags.{dag}.misses")));
    assert_eq!(misses.sum::<u64>(), 0);
    let marks = flown.at("marks").elements().iter();
    let modes = marks.filter(|mark| mark.get("kind").unwrap().as_text() == Some("mode"));
    assert_eq!(modes.count(), 2);
    assert!(!flown.at("chains").elements().is_empty());
}
