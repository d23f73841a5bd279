//! DAGs run in virtual time, with their record, as of a boot by `./scripts/run --keep`.

use dag_file::{RunSettings, build};
use fass::commit::{ConstructionPolicy, Overheads, finish_create_dags_in_order};
use fass::{Dag, Occupation};
use fass_dag_file::{Execution, FileDag, Length, check, kernel_overheads_ns, parse};
use sched_dag::{CommitOptions, CoreDivision, Policy, Preemption};
use text::{MOST_CORES, quoted};
use virtual_time::VirtualTime;

use crate::request::{Faults, Request};
use crate::stamps;

/// The most instances: they take some ten seconds, and a gigabyte.
const MOST_INSTANCES: u64 = 500_000;

/// Plays the app or the file of a request; returns the record, and the warnings of the commit.
pub(crate) fn play(request: &Request<'_>) -> Result<(Vec<u8>, Vec<String>), Faults> {
    let (machine, options) = machine(request)?;
    let seed = request.number("seed", 0..=u64::MAX, 1)?;
    let mut say: Box<dyn Fn() -> Option<String>> = Box::new(|| None);
    let mut lists = Vec::new();
    let dags = match request.text("app") {
        None => {
            let (dags, of_file) = of_file(request, &options, seed)?;
            lists = of_file;
            dags
        }
        Some("drone") => {
            let workload = drone::Workload {
                seconds: 8,
                seed,
                takes_wcet: true,
                delay: std::time::Duration::ZERO,
                fault_at: None,
                survived: 0,
            };
            workload.build().dags.into()
        }
        Some("stamps") => {
            let (dags, told) = stamps::build(seed);
            say = Box::new(move || Some(told()));
            dags.into()
        }
        Some(app) => {
            let why = "none of the page's; give drone or stamps";
            return Err(format!("app: {} is {why}", quoted(app)).into());
        }
    };
    let lists: Vec<&str> = lists.iter().map(String::as_str).collect();
    let commit = finish_create_dags_in_order(&dags, ConstructionPolicy::any_graph(), &lists);
    let commit = commit.map_err(|error| error.to_string())?;
    machine.try_run().map_err(|error| error.to_string())?;
    let warnings = commit.warnings().iter().map(ToString::to_string);
    Ok((machine.recording(), warnings.chain(say()).collect()))
}

/// Builds the DAGs of a file, and returns also the file's lists of cores.
fn of_file(
    request: &Request<'_>,
    options: &CommitOptions,
    seed: u64,
) -> Result<(Vec<Dag>, Vec<String>), Faults> {
    let text = String::from_utf8_lossy(request.body);
    let file = parse(&text).map_err(|fault| Faults(vec![fault]))?;
    let wanted = request.text("set").unwrap_or(&file.sets[0].name);
    let found = file.sets.iter().find(|set| set.name == wanted);
    let why = "is not in the file; name another";
    let set = found.ok_or_else(|| format!("set: {} {why}", quoted(wanted)))?;
    let length = Length::Periods(request.number("periods", 1..=1_000_000, 5)?).of(set);
    let of_dag = |FileDag { spec, subtasks, .. }: &FileDag| {
        length.jobs(spec).saturating_mul(subtasks.len() as u64)
    };
    let instances = set.dags.iter().map(of_dag).fold(0, u64::saturating_add);
    if instances > MOST_INSTANCES {
        let why = format!("periods: that makes {instances} instances, and {MOST_INSTANCES}");
        return Err(format!("{why} are possible here; give fewer, or fewer jobs").into());
    }
    check(set, options, length).map_err(Faults)?;
    let execution = Execution::parse(request.text("execution").unwrap_or("wcet"));
    let settings = RunSettings {
        execution: execution.map_err(|why| format!("execution: {why}"))?,
        seed,
        occupation: Occupation::Hold,
        length,
        grid_ns: 0,
    };
    let lists = set.core_lists().into_iter().map(Into::into);
    Ok((build(set, &settings), lists.collect()))
}

/// Makes the machine described by a request, and the demands of its commits.
fn machine(request: &Request<'_>) -> Result<(VirtualTime, CommitOptions), String> {
    let cores = request.number("cores", 1..=MOST_CORES, 4)?;
    let policy = request.choice("policy", &Policy::ALL.map(|it| (it.word(), it)))?;
    let preemption = [("on", Preemption::Enabled), ("off", Preemption::Disabled)];
    let preemption = request.choice("preemption", &preemption)?;
    let [switch, dispatch, interrupt, ready] = kernel_overheads_ns(u64::from(cores));
    let kernel = Overheads::of_terms_ns([switch, dispatch, interrupt, ready, 0, 0]);
    let overheads = [("none", Overheads::NONE), ("kernel", kernel)];
    let overheads = request.choice("overheads", &overheads)?;
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let machine = machine.preemption(preemption).overheads(overheads);
    let options = CommitOptions::new(policy, cores);
    Ok(match request.text("clusters") {
        None => (machine, options),
        Some("auto") => (machine.assign_clusters(), options),
        Some(word) => {
            let sizes: Result<Vec<u32>, _> = word.split(',').map(str::parse).collect();
            let how = "give the cores of each, as in 2,2, or auto";
            let sizes = sizes.map_err(|_| format!("clusters: {}: {how}", quoted(word)))?;
            let machine = machine.clusters(&sizes);
            (machine, options.with_clusters(CoreDivision::Of(sizes)))
        }
    })
}
