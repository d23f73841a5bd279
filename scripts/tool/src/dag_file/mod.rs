//! Reads DAG files of all formats on the host, and prepares runs of them.
//!
//! The kernel reads one format only, described in `docs/dag-file.md`. `scripts/convert` converts
//! other formats to ours:
//!
//! - [`load()`] reads a file of any format and checks it as the guest's commit will;
//! - [`prepare()`] prepares the input of `./scripts/run --dag FILE`: the boot module, words for the
//!   guest, and enough memory and time.
//!
//! Every message about a file begins with `FILE:LINE:` and a line of the file named by the person,
//! even if the guest reads the file in another form. The guest gets the file rewritten in our
//! format, and the commit knows names only. So this module checks everything that can be checked
//! before a boot, with the right lines. Two kinds of faults are left to the guest: words for the
//! guest, which the host does not read, and a machine too small for the file.

mod foreign;

use std::path::{Path, PathBuf};

use fass_dag_file::time::parse_ns;
use fass_dag_file::{DagFile, Execution, FileDag, Length, Set, check, kernel_overheads_ns, parse};
use sched_dag::{CommitOptions, CoreDivision, Policy};
use text::{Malformed, shown};

use crate::files;
use crate::options::{CommandLine, OptionName};
use crate::run_options::name;

/// Settings for reading a DAG file and checking it for a run.
#[derive(Clone, Debug)]
pub struct ImportSettings {
    /// The length of a time unit, for formats with plain numbers; `None` means the format's
    /// default.
    pub unit_ns: Option<u64>,
    /// The only graph wanted from a set of task graphs.
    pub graph: Option<String>,
    /// The number of cores for the run.
    pub cores: u32,
    /// The division of the cores into clusters.
    pub clusters: CoreDivision,
    /// The length of the run.
    pub length: Length,
    /// The longest time for converting another format, in seconds.
    pub limit_s: u64,
}

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// Our own.
    Ours,
    /// A format read by `scripts/convert`.
    Foreign,
}

/// The file name endings accepted in a folder, ours first.
pub(crate) const ENDINGS: [&str; 9] = [
    "dag", "yaml", "yml", "json", "dot", "gv", "graphml", "xml", "tgff",
];

impl Format {
    /// Returns the format stated by a file's name, in small or in capital letters; `None` if its
    /// ending is unknown.
    pub(crate) fn of(path: &Path) -> Option<Format> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ENDINGS.iter().position(|known| *known == ending)? {
            0 => Some(Format::Ours),
            _ => Some(Format::Foreign),
        }
    }
}

/// Reads a file in the format stated by its name, else in our own, and checks it as the guest's
/// commit will.
///
/// # Errors
///
/// Lines for people, each beginning with the file and mostly the line.
pub fn load(path: &Path, import: &ImportSettings) -> Result<DagFile, Vec<String>> {
    let file = read(path, import)?;
    check_sets(path, &file, import).map(|()| file)
}

/// Returns faults as lines for people.
fn located(path: &Path, faults: Vec<Malformed>) -> Vec<String> {
    let place = files::shown_path(path);
    let located = faults.into_iter();
    located
        .map(|Malformed { line, reason }| format!("{place}:{line}: {reason}"))
        .collect()
}

/// Reads a file as [`load`] does, without checking its sets.
fn read(path: &Path, import: &ImportSettings) -> Result<DagFile, Vec<String>> {
    let place = files::shown_path(path);
    let text = files::read_text(path).map_err(|line| vec![line])?;
    let text = text.as_str();
    let format = Format::of(path);
    if format != Some(Format::Foreign)
        && let Some(graph) = &import.graph
    {
        return Err(vec![format!(
            "{place}: `--graph {}` is for a set of task graphs in JSON; leave it out",
            shown(graph)
        )]);
    }
    match format {
        Some(Format::Foreign) => foreign::read(path, import),
        Some(Format::Ours) => parse(text).map_err(|one| located(path, vec![one])),
        // A wrong ending is the likeliest cause, so the message names the others.
        None => parse(text).map_err(|Malformed { line, reason }| {
            let others = ENDINGS[1..].join(", .");
            let reason = format!("{reason} (read as our format; others end in .{others})");
            located(path, vec![Malformed { line, reason }])
        }),
    }
}

/// Checks all sets of a file as the commit will.
fn check_sets(path: &Path, file: &DagFile, import: &ImportSettings) -> Result<(), Vec<String>> {
    // A commit with static priorities makes all checks of a commit with EDF, and more.
    let options = CommitOptions::new(Policy::StaticPriority, import.cores)
        .with_clusters(import.clusters.clone());
    for set in &file.sets {
        check(set, &options, import.length).map_err(|faults| located(path, faults))?;
    }
    Ok(())
}

/// The options that are meaningful only together with `--dag`.
const COMPANIONS: [OptionName; 6] = [
    name::GRAPH,
    name::UNIT,
    name::PRINT_DAG,
    name::EXECUTION,
    name::SECONDS,
    name::STRICT_DEADLINES,
];

/// The default length of a run, as a multiple of the longest period; the guest has the same
/// default.
const PERIODS: u64 = 50;

/// Returns the guest's word for the kernel's worst-case overheads. The commit adds them to the
/// WCETs before computing bounds.
fn overheads(cores: u64) -> String {
    let [switch, dispatch, interrupt, ready] = kernel_overheads_ns(cores);
    format!("overheads_ns={switch},{dispatch},{interrupt},{ready}")
}

/// Reports whether a command line states the kernel's overheads or orders a measurement of them.
pub(crate) fn states_overheads(words: &str) -> bool {
    words
        .split_whitespace()
        .any(|word| word.starts_with("overheads_ns=") || word.starts_with("overheads="))
}

/// A DAG file ready to run, with settings for the run.
#[derive(Debug)]
pub struct PreparedRun {
    /// The file's name.
    pub path: PathBuf,
    /// The file's content.
    pub file: DagFile,
    /// The length of the run.
    pub length: Length,
    /// The memory needed, in MiB.
    pub memory_mib: u64,
    /// Words for the guest besides the options' own.
    pub words: Vec<String>,
    /// A time limit in seconds, generous even where jobs take their real time.
    pub limit_s: u64,
}

impl PreparedRun {
    /// Translates a guest's refusal of the file into messages as from [`load`], one line a fault.
    /// Returns `None` for a refusal about anything else.
    pub fn translate(&self, said: &str) -> Option<String> {
        translate(said, &self.path, &self.file)
    }
}

/// Reads the file named by `--dag`; returns `None` without this option.
///
/// # Errors
///
/// Lines for people: the faults of the options or of the file.
#[allow(clippy::too_many_lines, reason = "one option after the other")]
pub fn prepare(options: &CommandLine) -> Result<Option<PreparedRun>, Vec<String>> {
    let refuse = |line: String| vec![line];
    // Without a file, an option about DAG files is a mistake.
    let Some(path) = options.path(name::DAG) else {
        let without = options.check_without(&COMPANIONS, "needs `--dag FILE`; give that, too");
        return without.map(|()| None).map_err(refuse);
    };
    let apart = [(name::APP, name::DAG), (name::JOBS, name::SECONDS)];
    let apart = apart.map(|(one, other)| (one, other, "exclude each other"));
    options.check_apart(&apart).map_err(refuse)?;
    if options.number(name::JOBS) == Some(0) {
        let line = "`--jobs 0` has no end, which is for fork-join; with `--dag` give at least 1";
        return Err(refuse(line.into()));
    }
    if let Some(text) = options.text(name::EXECUTION) {
        Execution::parse(text).map_err(|why| refuse(format!("`--execution`: {why}")))?;
    }
    let unit_ns = match options.text(name::UNIT).map(parse_ns).transpose() {
        Ok(Some(0)) => Err("a unit of 0; give at least 1ns".into()),
        other => other,
    };
    let unit_ns = unit_ns.map_err(|why| refuse(format!("`--unit`: {why}")))?;
    let length = length(options);
    let cores = options.number(name::CORES).unwrap_or(1);
    let import = ImportSettings {
        unit_ns,
        graph: options.text(name::GRAPH).map(String::from),
        cores: u32::try_from(cores).unwrap_or(u32::MAX),
        clusters: clusters(options.text(name::CLUSTERS)).map_err(refuse)?,
        length,
        limit_s: options.number(name::TIMEOUT).unwrap_or(600),
    };
    // In virtual time neither a guest's memory nor its time is a limit. Among many sets, a refused
    // set must not keep the others from running: the program checks each set itself.
    let is_booted = options.text(name::ON) != Some("host");
    let file = read(path, &import)?;
    if is_booted || file.sets.len() == 1 {
        check_sets(path, &file, &import)?;
    }
    let memory_mib = memory_mib(&file, length, cores);
    if is_booted && memory_mib > MOST_MEMORY_MIB && !options.is_given(name::MEMORY) {
        return Err(refuse(format!(
            "{}: its {} subtasks, their jobs and the file itself need {memory_mib} MiB, and a \
             guest has {MOST_MEMORY_MIB} at most; give fewer subtasks, or fewer jobs, in the file or by \
             --jobs",
            files::shown_path(path),
            file.most_subtasks()
        )));
    }
    let limit_s = limit_s(&file, length);
    let has_limit = options.is_given(name::TIMEOUT) || options.is_given(name::PRINT_DAG);
    // Printing boots nothing, and a person's limit is a person's choice.
    if is_booted && limit_s > MOST_S && !has_limit {
        return Err(refuse(format!(
            "{}: its jobs take {} hours or more, and a run has {} if nobody says how long; give \
             fewer jobs, in the file or by --jobs, or a limit by --timeout",
            files::shown_path(path),
            limit_s / 3600,
            MOST_S / 3600
        )));
    }
    let mut words = Vec::new();
    if options.is_given(name::STRICT_DEADLINES) {
        words.push("deadlines=strict".into());
    }
    if !states_overheads(options.text(name::APPEND).unwrap_or_default()) {
        words.push(overheads(cores));
    }
    Ok(Some(PreparedRun {
        length,
        memory_mib,
        limit_s: limit_s.min(MOST_S),
        path: path.into(),
        file,
        words,
    }))
}

/// Reads the division of the cores. With `auto` the commit finds a division, so none is stated
/// here.
fn clusters(text: Option<&str>) -> Result<CoreDivision, String> {
    let Some(text) = text.filter(|text| *text != "auto") else {
        return Ok(CoreDivision::Undivided);
    };
    let sizes: Result<Vec<u32>, _> = text.split(',').map(str::parse).collect();
    sizes.map(CoreDivision::Of).map_err(|_| {
        let text = shown(text);
        format!("`--clusters {text}`: give the number of cores of each cluster, as in 2,2, or auto")
    })
}

fn length(options: &CommandLine) -> Length {
    match (options.number(name::SECONDS), options.number(name::JOBS)) {
        (Some(seconds), _) => Length::Span(seconds.saturating_mul(1_000_000_000)),
        (None, Some(jobs)) => Length::Jobs(jobs),
        (None, None) => Length::Periods(PERIODS),
    }
}

/// Returns the number of records written by a set in a run: its jobs, instances and waits.
fn records(set: &Set, length: Length) -> u64 {
    let length = length.of(set);
    let of = |dag: &FileDag| {
        let jobs = length.jobs(&dag.spec);
        let waits: usize = dag.spec.subtasks.iter().map(|of| of.waits.len()).sum();
        jobs.saturating_mul((dag.subtasks.len() + waits) as u64 + 1)
    };
    set.dags.iter().map(of).fold(0, u64::saturating_add)
}

/// The most memory in MiB: a guest's stacks and heap lie below 3 GiB.
const MOST_MEMORY_MIB: u64 = 3072;

/// Returns the memory needed by a set's jobs in flight, in bytes. By measurement, a job takes 960
/// bytes of the heap and each of its instances 260; the number of places for jobs is a power of
/// two.
fn in_flight_bytes(set: &Set, length: Length) -> u64 {
    const OF_A_JOB: u64 = 1024 * 4 / 3;
    const OF_AN_INSTANCE: u64 = 288 * 4 / 3;
    let length = length.of(set);
    let of = |dag: &FileDag| {
        let jobs = dag.spec.most_in_flight().min(length.jobs(&dag.spec));
        let places = jobs.checked_next_power_of_two().unwrap_or(u64::MAX);
        let instances = dag.subtasks.len() as u64;
        places.saturating_mul(
            instances
                .saturating_mul(OF_AN_INSTANCE)
                .saturating_add(OF_A_JOB),
        )
    };
    set.dags.iter().map(of).fold(0, u64::saturating_add)
}

/// Returns the memory needed by a file, in MiB. A quarter of the memory becomes stacks, one for
/// each subtask and a few for each core; the rest is the heap, and records may take half of the
/// heap.
///
/// The guest keeps the file as text, and its content in the heap. By measurement, an edge takes
/// some 210 bytes and a sample some 17, while their text takes 12 bytes for a line and 4 for a
/// sample. So the heap gets 20 bytes for each byte of text, and the memory is 4/3 of the heap.
fn memory_mib(file: &DagFile, length: Length, cores: u64) -> u64 {
    const OF_A_CORE: u64 = 4 * (336 << 10);
    const OF_A_SUBTASK: u64 = 4 * (65 << 10);
    const OF_A_RECORD: u64 = 256;
    const OF_A_BYTE: u64 = 1 + 20 * 4 / 3;
    const MIB: u64 = 1 << 20;
    let subtasks = file.most_subtasks() as u64;
    // Sets run one after the other, so the largest counts.
    let of_jobs = |set| {
        let records = records(set, length).saturating_mul(OF_A_RECORD);
        records.saturating_add(in_flight_bytes(set, length))
    };
    let bytes = (subtasks.saturating_mul(OF_A_SUBTASK))
        .saturating_add(file.sets.iter().map(of_jobs).max().unwrap_or(0))
        .saturating_add(cores.saturating_mul(OF_A_CORE))
        // The text as the guest gets it; it may be longer than the person's file.
        .saturating_add((file.to_string().len() as u64).saturating_mul(OF_A_BYTE));
    12 + bytes.div_ceil(MIB)
}

/// The longest run without a stated limit, in seconds: a day.
const MOST_S: u64 = 86_400;

/// Returns the time limit of a run in seconds: the sum of two minutes, the time from the first
/// release to the last, the time of all jobs with their waits on one core, and a second for every
/// 500 records.
fn limit_s(file: &DagFile, length: Length) -> u64 {
    const NS_PER_S: u128 = 1_000_000_000;
    // In 128 bits: periods and numbers of jobs come from a file and may have any size.
    let mut seconds = 120_u128;
    for set in &file.sets {
        seconds += u128::from(records(set, length) / 500);
        let length = length.of(set);
        let (mut span_ns, mut busy_ns) = (0_u128, 0_u128);
        for dag in &set.dags {
            let spec = &dag.spec;
            let jobs = u128::from(length.jobs(spec));
            let wcets = (0..spec.subtasks.len()).map(|subtask| dag.most_ns(subtask));
            let waits = spec.subtasks.iter().flat_map(|subtask| &subtask.waits);
            let each_ns = wcets.chain(waits.map(|wait| wait.limit_ns));
            let of_job_ns: u128 = each_ns.map(u128::from).sum();
            let period_ns = u128::from(spec.period_ns.unwrap_or(0));
            let last_ns =
                period_ns.saturating_mul(jobs.saturating_sub(1)) + u128::from(spec.offset_ns);
            // DAGs of a set run at the same time: the longest span counts, but all of the work.
            span_ns = span_ns.max(last_ns);
            busy_ns = busy_ns.saturating_add(of_job_ns.saturating_mul(jobs));
        }
        seconds = seconds.saturating_add(span_ns.saturating_add(busy_ns) / NS_PER_S);
    }
    u64::try_from(seconds).unwrap_or(u64::MAX)
}

/// Translates a guest's message: puts `path` and its lines in place of the words `DAG file`, one
/// line a fault. Returns `None` for a message about anything else.
pub(crate) fn translate(said: &str, path: &Path, file: &DagFile) -> Option<String> {
    let place = path.display();
    let said = said.strip_prefix("DAG file")?;
    if let Some(reason) = said.strip_prefix(": ") {
        return Some(format!("{place}: {reason}"));
    }
    let mut lines = Vec::new();
    for fault in said.strip_prefix(", line ")?.split("; line ") {
        let (line, reason) = fault.split_once(": ")?;
        lines.push(match source_line(file, line.parse().ok()?) {
            Some(line) => format!("{place}:{line}: {reason}"),
            None => format!("{place}: {reason}"),
        });
    }
    Some(lines.join("\n"))
}

/// Finds the line of the person's file for a line of the guest's file.
fn source_line(file: &DagFile, line: usize) -> Option<usize> {
    // Parsed again: only the parser knows the lines of the written form.
    let written = parse(&file.to_string()).ok()?;
    let dags = |file: &DagFile| -> Vec<Vec<usize>> {
        let dags = file.sets.iter().flat_map(|set| &set.dags);
        dags.map(lines).collect()
    };
    let (written, read) = (dags(&written), dags(file));
    let mut pairs = written.iter().flatten().zip(read.iter().flatten());
    pairs
        .find(|(written, _)| **written == line)
        .map(|(_, read)| *read)
}

/// Returns all lines of a DAG, in an order independent of how the DAG is written.
fn lines(dag: &FileDag) -> Vec<usize> {
    let subtasks = dag.subtasks.iter().map(|subtask| subtask.line);
    let all = std::iter::once(dag.line).chain(subtasks);
    all.chain(dag.edge_lines.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_options::RUN;
    use crate::tests::{right, rows};

    #[test]
    fn the_ending_of_a_name_tells_the_format() {
        for (file, format) in [
            ("a/gnp_01.yaml", Some(Format::Foreign)),
            ("a b.Yml", Some(Format::Foreign)),
            ("->.dag", Some(Format::Ours)),
            ("{x.JSON", Some(Format::Foreign)),
            ("a\u{1b}\u{202e}b.txt", None),
            ("yaml", None),
        ] {
            assert_eq!(Format::of(Path::new(file)), format, "{file}");
        }
    }

    fn file(subtasks: usize) -> DagFile {
        let subtasks = (0..subtasks).map(|number| format!("subtask s{number} wcet 1ms\n"));
        let subtasks: String = subtasks.collect();
        parse(&format!("dag x period 1s\n{subtasks}end")).unwrap()
    }

    #[test]
    fn memory_grows_with_subtasks_records_cores_and_the_file_itself() {
        let of = |subtasks, jobs, cores| memory_mib(&file(subtasks), Length::Jobs(jobs), cores);
        let (usual, long) = (of(20, 50, 8), of(20, 1_000_000, 8));
        assert!(usual <= 32 && of(20, 50, 64) > 2 * usual, "{usual}");
        // A quarter of it holds 10,000 stacks of 64 KiB.
        assert!(of(10_000, 1, 1) >= 4 * 625);
        assert!(long > 21 * 200 && of(1, u64::MAX, 8) > long, "{long}");
        let samples = vec!["1us"; 2_000_000].join(",");
        let text = format!("dag x period 1s\nsubtask a wcet 1ms samples {samples}\nend");
        let many = memory_mib(&parse(&text).unwrap(), Length::Jobs(1), 8);
        // Measured: a heap of 34 MB at its peak, besides the text of 8 MB.
        assert!((64..512).contains(&many), "{many}");
        // Measured: 20,000 jobs in flight of one subtask take 40 MB.
        let text = "dag x period 1ms deadline 20s\nsubtask a wcet 1us\nend";
        let waiting = memory_mib(&parse(text).unwrap(), Length::Jobs(20_000), 1);
        assert!((64..256).contains(&waiting), "{waiting}");
    }

    #[test]
    fn the_limit_has_room_for_real_time_and_is_a_day_at_most_if_nobody_says_how_long() {
        assert_eq!(limit_s(&file(1), Length::Jobs(101)), 120 + 100);
        assert!(limit_s(&file(1), Length::Jobs(u64::MAX)) > MOST_S);
        // A job may wait for as long as its limits say.
        let text = "dag x period 1s\nsubtask a wcet 1ms wait 3s wcet 1ms\nend";
        assert_eq!(
            limit_s(&parse(text).unwrap(), Length::Jobs(101)),
            120 + 100 + 303
        );
        // DAGs of a set run side by side, sets one after the other.
        let dag = |name: &str| format!("dag {name} period 10s\nsubtask a wcet 1s\n");
        let text = format!("set one\n{}{}set two\n{}end", dag("x"), dag("y"), dag("z"));
        let of_sets = limit_s(&parse(&text).unwrap(), Length::Jobs(11));
        assert_eq!(of_sets, 120 + (100 + 22) + (100 + 11));

        let name = format!("century-{}.dag", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "dag x period 3153600000s\nsubtask a wcet 1ms\nend\n").unwrap();
        let prepared = |line: &str| prepare(&right(&RUN, line).with(name::DAG, path.clone()));
        let said = prepared("--jobs 2").unwrap_err().join("\n");
        let words = "its jobs take 876000 hours or more, and a run has 24 if nobody says how long; \
                     give fewer jobs, in the file or by --jobs, or a limit by --timeout";
        assert!(said.ends_with(words), "{said}");
        assert_eq!(prepared("--jobs 1").unwrap().unwrap().limit_s, 120);
        assert!(prepared("--jobs 2 --timeout 60").is_ok());
        assert!(prepared("--jobs 2 --print-dag").is_ok());
        std::fs::remove_file(path).unwrap();
    }

    /// The guest's message, and the one for the person.
    const SAID: &str = r"DAG file, line 1: late; drop it | f.dag:3: late; drop it
DAG file, line 2: a | f.dag:5: a
DAG file, line 4: a | f.dag:8: a
DAG file, line 1: a: b; c; line 6: d | f.dag:3: a: b; c\nf.dag:9: d
DAG file, line 99: a | f.dag: a
DAG file: too large | f.dag: too large";

    #[test]
    fn the_guests_lines_become_those_of_the_file() {
        let text = "# one\n\ndag x period 1s\n# two\nsubtask a wcet 1ms\nsubtask b wcet 1ms\n\n\
                    edge a -> b\ndag y period 1s\nsubtask a wcet 1ms\nend";
        let file = parse(text).unwrap();
        // The guest's has no comments.
        assert!(file.to_string().starts_with("dag x "));
        let told = |said: &str| translate(said, Path::new("f.dag"), &file);
        for [said, expected] in rows(SAID) {
            assert_eq!(told(&said), Some(expected), "{said}");
        }
        assert_eq!(told("`jbos` is no option"), None);
    }
}
