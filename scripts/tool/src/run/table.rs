//! The options of `run`: the one table behind its parser and its help text.

use crate::options::{Command, Takes, options};
use crate::qemu::{LEAST_MEMORY_MIB, Loader, MOST_CORES, Machine, Mode};

/// The options that become words `name=value` on the guest's command line, if
/// they are given: kernel and apps have defaults of their own, and not every app
/// knows every word.
pub(super) const GUEST_WORDS: &[&str] = &[
    "policy",
    "preemption",
    "clusters",
    "from",
    "jobs",
    "latest",
    "seconds",
    "seed",
    "execution",
    "subtasks",
    "longest",
    "work",
    "occupy",
];

/// The most subtasks side by side: a function returns at most 16 values.
const MOST_SUBTASKS: u64 = 16;

/// The table of `run`.
pub static RUN: Command = Command {
    invocation: "./scripts/run",
    about: "\
Builds an app, boots it on the bare machine in QEMU, or runs it on Linux, and judges the run.",
    positional: None,
    options: options! {
        /// The app: a package under apps/.
        "app" in "what": Takes::Text("NAME"), or "fork-join";
        /// A file of DAGs (docs/dag-file.md), or a folder.
        "dag": Takes::File("FILE");
        /// Boot this image, or program; build nothing.
        "image": Takes::File("FILE");
        /// Jobs that a DAG releases; 0: no end.
        "jobs": Takes::Number(0, 1_000_000);
        /// Seed of the app's random draws; 1.
        "seed": Takes::Number(0, u64::MAX);
        /// Parameters of the app, with commas between.
        "set": Takes::Text("NAME=VALUE");
        /// Those of a file, a line for each; --set prevails.
        "params": Takes::File("FILE");
        /// A file in the guest's memory, for the app.
        "module": Takes::File("FILE");
        /// More words for the guest's command line.
        "append": Takes::Text("WORDS");
        /// Platform.
        "on" in "where": Takes::OneOf(&["machine", "linux", "debian"]), or "machine";
        /// Processors; 4 on debian.
        "cores": Takes::Number(1, MOST_CORES), or "8";
        /// See docs/commands.md.
        "mode": Takes::OneOf(Mode::NAMES);
        /// The board.
        "machine": Takes::OneOf(Machine::NAMES), or "microvm";
        /// The loader.
        "boot": Takes::OneOf(Loader::NAMES), or "pvh";
        /// The guest's MiB.
        "memory": Takes::Number(LEAST_MEMORY_MIB, 65_536), or "32";
        /// Use this QEMU; install nothing.
        "qemu": Takes::File("PROGRAM");
        /// On Linux, by what.
        "mechanism": Takes::OneOf(&["fifo", "sched_ext", "normal", "poll"]);
        /// On debian: so many programs next to it.
        "busy": Takes::Number(0, 64);
        /// Fixed priorities, or by deadline.
        "policy" in "rules": Takes::OneOf(&["static", "edf"]);
        /// Whether instances may lose their cores.
        "preemption": Takes::OneOf(&["on", "off"]);
        /// Sizes of clusters of cores: N,N,... or auto.
        "clusters": Takes::Text("SIZES");
        /// Parallel ones, a run for each; 2,4,6.
        "subtasks" in "fork-join": Takes::Numbers(1, MOST_SUBTASKS);
        /// Milliseconds of the longest execution.
        "longest": Takes::Number(1, 50);
        /// Whether it really computes.
        "work": Takes::OneOf(&["simulate", "compute"]);
        /// How a simulated one has its core.
        "occupy": Takes::OneOf(&["hold", "spin"]);
        /// The one to take of a set of task graphs.
        "graph" in "--dag": Takes::Text("NAME");
        /// The unit of numbers where a format has none; 1ms.
        "unit": Takes::Text("TIME");
        /// wcet (if nothing is said), uniform:0.2..1, samples.
        "execution": Takes::Text("MODEL");
        /// The jobs of so many seconds.
        "seconds": Takes::Number(1, 1_000_000);
        /// A deadline miss is a failure.
        "strict-deadlines": Takes::Nothing;
        /// Print the file in our format; run nothing.
        "print-dag": Takes::Nothing;
        /// All of the run; docs/recordings.md.
        "keep" in "files": Takes::File("FILE");
        /// As --keep, without values; for check-trace.
        "trace": Takes::File("FILE");
        /// Jobs of a DAG to keep for a crash; 16.
        "latest": Takes::Number(0, 64);
        /// Take the sources' values from it, compare others.
        "replay": Takes::File("FILE");
        /// --replay: begin with this job.
        "from": Takes::Text("DAG/JOB");
        /// The serial log.
        "serial": Takes::File("FILE");
        /// The committed DAGs, for `dot -Tsvg FILE`.
        "dot": Takes::File("FILE");
        /// Measure, commit with that, and compare; docs/proving.md.
        "prove" in "bounds": Takes::Nothing;
        /// --prove: per cent that a WCET is above the longest call; 20.
        "margin": Takes::Number(0, 1_000);
        /// --prove: measure so many seeds; 1.
        "seeds": Takes::Number(1, 1_000);
        /// Commit with WCETs that `recording --observe` has written.
        "wcets": Takes::File("FILE");
        /// Talk to the kernel, in real time: type `help`.
        "console" in "person": Takes::Nothing;
        /// Bytes for the app's wire; docs/wires.md. -: stdin.
        "input": Takes::File("FILE");
        /// Write what the app sends on its wire.
        "output": Takes::File("FILE");
        /// Seconds until its end; 120, one a job.
        "timeout": Takes::Number(1, 86_400);
        /// Only machine lines on standard output.
        "json": Takes::Nothing;
        /// Only what the guest prints.
        "quiet" 'q': Takes::Nothing;
        /// Wait for a debugger on TCP port 1234.
        "gdb": Takes::Nothing;
    },
    notes: "\
Modes: docs/commands.md. Ctrl-C and the timeout end a run in order, ctrl-C again at once.
exit codes: 0 all is well; 1 a failure; 2 a refused command line; 130 ended by ctrl-C
",
};
