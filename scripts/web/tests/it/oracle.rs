//! The reference cases of `tests/oracle`, as DAG files that the page plays.

use std::collections::BTreeMap;

use crate::{answer, file};

/// A case that can be played.
pub(crate) struct Case {
    pub(crate) name: String,
    /// The request's line.
    pub(crate) words: String,
    /// The DAG file.
    pub(crate) file: String,
    /// Of each instance (DAG, job, subtask) its start, finish and number of preemptions.
    instances: BTreeMap<[u64; 3], [u64; 3]>,
    /// Of each job (DAG, number) its release, finish and whether it misses.
    jobs: BTreeMap<[u64; 2], [u64; 3]>,
}

/// Reads the cases of a file; `has_schedules` tells those with whole schedules from sets alone.
fn cases(path: &str, has_schedules: bool) -> Vec<Case> {
    let text = String::from_utf8(file(&format!("tests/oracle/{path}"))).unwrap();
    let blocks = text.split("\nend").map(|block| {
        let lines = block.lines().map(str::trim);
        let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.map(|line| line.split(' ').collect()).collect()
    });
    let blocks: Vec<Vec<Vec<&str>>> = blocks.collect();
    let wanted = blocks.iter().filter(|lines| {
        let head = lines.first();
        head.is_some_and(|head| has_schedules == (head.len() == 6))
    });
    wanted.map(|lines| case(lines)).collect()
}

fn case(lines: &[Vec<&str>]) -> Case {
    let (name, words) = match lines[0][..] {
        [_, name, cores, edf, preemptive, _] => {
            let policy = ["static", "edf"][usize::from(edf == "1")];
            let preemption = ["off", "on"][usize::from(preemptive == "1")];
            let words = format!("cores={cores} policy={policy} preemption={preemption}");
            (name, format!("{words} execution=sequence"))
        }
        [_, name, cores, _] => (name, format!("cores={cores} policy=edf periods=1")),
        ref other => panic!("{other:?}"),
    };
    let mut case = Case {
        name: name.into(),
        words: format!("play {words}"),
        file: String::new(),
        instances: BTreeMap::new(),
        jobs: BTreeMap::new(),
    };
    // The lines of the DAG file, and where the last DAG's begin.
    let (mut file, mut at, mut dags) = (Vec::new(), 0, 0..);
    for line in &lines[1..] {
        if line[0] == "dag" {
            at = file.len();
            file.push(format!("dag d{}", dags.next().unwrap()));
        }
        record(line, &mut file, at, &mut case);
    }
    case.file = file.join("\n") + "\nend\n";
    case
}

/// Adds what a line of a case says.
fn record(line: &[&str], file: &mut Vec<String>, at: usize, case: &mut Case) {
    let number = |word: &str| word.parse::<u64>().unwrap();
    let place = |subtask: &str| at + 1 + usize::try_from(number(subtask)).unwrap();
    match *line {
        ["clusters", ref sizes @ ..] => case.words += &format!(" clusters={}", sizes.join(",")),
        ["dag", period, deadline, ref rest @ ..] => {
            file[at] += &format!(" period {period}ns deadline {deadline}ns");
            if let [offset, jobs, _, _] = rest {
                file[at] += &format!(" offset {offset}ns in-flight {jobs} jobs {jobs}");
            }
        }
        ["in", cluster] => file[at] += &format!(" cluster {cluster}"),
        // WCETs play no part in a schedule, and some are beyond deadlines.
        ["sub", _, priority, ref samples @ ..] => {
            let (subtask, samples) = (file.len() - at - 1, samples.join("ns,"));
            let subtask = format!("subtask s{subtask} priority {priority} samples {samples}ns");
            file.push(subtask);
        }
        ["wcet", ref wcets @ ..] => {
            let wcets = wcets.iter().enumerate();
            file.extend(wcets.map(|(number, wcet)| format!("subtask s{number} wcet {wcet}ns")));
        }
        ["edge", from, to] => file.push(format!("edge s{from} -> s{to}")),
        ["sink", subtask, deadline] => file[place(subtask)] += &format!(" deadline {deadline}ns"),
        ["wait", subtask, _, first, ref others @ ..] => {
            let line = &mut file[place(subtask)];
            let end = line.find(" samples ").or(line.find(" wcet "));
            let rest = line.split_off(end.unwrap());
            let segment = |wcet: &str| match rest.starts_with(" wcet ") {
                true => format!(" wcet {wcet}ns"),
                false => String::new(),
            };
            let waits = others.chunks(2);
            let waits = waits.map(|it| format!(" wait {}ns{}", it[0], segment(it[1])));
            *line += &(segment(first) + &waits.collect::<String>());
        }
        ["act", subtask, _, ref times @ ..] => {
            let line = &mut file[place(subtask)];
            *line += if line.contains(" samples ") {
                ","
            } else {
                " samples "
            };
            *line += &(times.join("ns+") + "ns");
        }
        ["x", ref instance @ .., start, finish, preemptions] => {
            let instance = instance.iter().map(|it| number(it)).collect::<Vec<_>>();
            let times = [start, finish, preemptions].map(number);
            case.instances.insert(instance.try_into().unwrap(), times);
        }
        ["j", dag, job, release, finish, _, missed] => {
            let times = [release, finish, missed].map(number);
            case.jobs.insert([dag, job].map(number), times);
        }
        // What else is expected of sets is of single tests, which a commit does not tell.
        _ => {}
    }
}

/// All cases, with schedules and without.
pub(crate) fn all() -> Vec<Case> {
    let mut lent = cases("lent.txt", false);
    lent.iter_mut()
        .for_each(|case| case.words += " clusters=auto");
    let sets = ["bounds.txt", "multi_path.txt", "waiting.txt"];
    let sets = sets.iter().flat_map(|path| cases(path, false));
    scheduled().chain(sets).chain(lent).collect()
}

fn scheduled() -> impl Iterator<Item = Case> {
    let files = ["schedules", "clusters", "waiting", "distinct"];
    files
        .into_iter()
        .flat_map(|name| cases(&format!("{name}.txt"), true))
}

#[test]
fn the_page_plays_the_reference_schedules_to_the_nanosecond() {
    let cases: Vec<Case> = scheduled().collect();
    assert_eq!(cases.len(), 40 + 30 + 40 + 10);
    for Case {
        name,
        words,
        file,
        instances,
        jobs,
    } in cases
    {
        let played = answer(&words, file.as_bytes());
        let known = |name: &str| played.column(name).into_iter().map(Option::unwrap);
        // Subtasks are numbered through all DAGs.
        let dags = (0..).zip(played.at("dags").elements());
        let of = dags.flat_map(|(dag, told)| {
            let subtasks = told.get("subtasks").unwrap().elements().len() as u64;
            (0..subtasks).map(move |subtask| (dag, subtask))
        });
        let of: Vec<(u64, u64)> = of.collect();
        let mut found = BTreeMap::<_, [u64; 3]>::new();
        let slices = known("subtask").zip(known("job"));
        let slices = slices.zip(known("from").zip(known("to")));
        for (((subtask, job), (from, to)), end) in slices.zip(known("end")) {
            let (dag, subtask) = of[usize::try_from(subtask).unwrap()];
            let times = found.entry([dag, job, subtask]).or_insert([from, to, 0]);
            let preemptions = times[2] + u64::from(end == 1);
            *times = [times[0].min(from), times[1].max(to), preemptions];
        }
        assert_eq!(found, instances, "{name}");
        let keys = known("job_dag").zip(known("job_number"));
        let times = known("job_release").zip(known("job_end"));
        let times = times.zip(known("job_flags"));
        let found = keys
            .zip(times)
            .map(|((dag, job), ((release, end), flags))| ([dag, job], [release, end, flags & 1]));
        assert_eq!(found.collect::<BTreeMap<_, _>>(), jobs, "{name}");
        assert_eq!(played.number("breach_count"), 0, "{name}");
    }
}
