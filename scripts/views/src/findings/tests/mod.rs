//! Traces by hand: one good one for each part of the rules, and each breach.
//!
//! A trace is written in the order of time, one event a line. A breach is made by
//! replacing lines of a good trace. Times and bounds are a few nanoseconds.

mod breaches;

use sched_dag::law::Violation;

use super::check;
use crate::made::{self, event, lines_of, record_of};
use crate::record::Record;
use crate::record::Run;

/// The longest wait allowed in these traces.
const BOUND_NS: u64 = 5;

/// Makes a run of a commit, and of events in the order of time.
pub(crate) fn run_of(commit: &str, events: &str) -> Run {
    let record = record_of("", &made::commit(commit), "");
    let mut run = Record::read(&record).unwrap().runs.remove(0);
    run.events = lines_of(events).into_iter().map(event).collect();
    run.complete = false;
    run
}

/// Changes a good trace, and asserts the breaches of the changed one.
///
/// A row `FROM -> TO` replaces the line that begins with FROM, or all from that one on if FROM ends
/// with `..`, by other lines, with `; ` between. A row `lost` or `complete` sets the run's own
/// statement. A row `= BREACH` judges the changed trace: it shows this breach, perhaps among
/// others, or none if nothing stands behind `=`. The next row changes the good trace again.
fn assert_each(header: &str, good: &str, rows: &str) {
    let (mut run, mut lines) = (run_of(header, ""), lines_of(good));
    for row in lines_of(rows) {
        if let Some(breach) = row.strip_prefix('=') {
            run.events = lines.iter().map(|line| event(line)).collect();
            let found = check(&run, BOUND_NS).breaches;
            found.iter().for_each(assert_documented_with_its_rule);
            let found = found.iter().map(|it| it.with_names(&run.task_set));
            let found: Vec<String> = found.map(|it| it.to_string()).collect();
            let is_as_it_says = match breach.trim() {
                "" => found.is_empty(),
                breach => found.iter().any(|text| text == breach),
            };
            let (found, trace) = (found.join("\n"), lines.join("\n"));
            assert!(is_as_it_says, "not `{breach}`, but\n{found}\nof\n{trace}");
            (run, lines) = (run_of(header, ""), lines_of(good));
        } else if let Some((from, to)) = row.split_once(" ->") {
            change(&mut lines, from, to.trim());
        } else {
            run.lost += u64::from(row == "lost");
            run.complete |= row == "complete";
            assert!(["lost", "complete"].contains(&row), "{row}");
        }
    }
}

/// Replaces one line, which must occur once, or all from it on.
pub(crate) fn change<'t>(lines: &mut Vec<&'t str>, from: &str, to: &'t str) {
    let (from, is_all) = match from.strip_suffix("..") {
        Some(from) => (from, true),
        None => (from, false),
    };
    let places = (0..lines.len()).filter(|&place| lines[place].starts_with(from));
    let places: Vec<usize> = places.collect();
    assert_eq!(places.len(), 1, "{from}");
    let end = if is_all { lines.len() } else { places[0] + 1 };
    let instead = to.split("; ").filter(|line| !line.is_empty());
    lines.splice(places[0]..end, instead);
}

/// Asserts that the documentation of a violation begins with its rule.
fn assert_documented_with_its_rule(breach: &Violation) {
    let code = breach.code();
    let kind = Violation::CODES.iter().position(|it| *it == code).unwrap();
    let (rule, _) = Violation::MEANINGS[kind].trim().split_once(": ").unwrap();
    let whole = breach.rule().to_string();
    assert!(
        whole.starts_with(&rule.replace('O', "o")),
        "{code}: {whole}"
    );
}
