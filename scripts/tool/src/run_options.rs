//! The options of `run`, in one table for the parser and the help text.

use sched_dag::Policy;

use crate::options::{Command, OptionName, ValueKind, options};
use crate::qemu::{LEAST_MEMORY_MIB, Loader, MOST_CORES, Machine, Mode};

/// The options that become words `name=value` on the guest's command line, if they are given. They
/// have no default here: kernel and apps have defaults of their own, and not every app knows every
/// word.
pub(crate) const GUEST_WORDS: &[OptionName] = &[
    name::POLICY,
    name::PREEMPTION,
    name::CLUSTERS,
    name::FROM,
    name::JOBS,
    name::LATEST,
    name::SECONDS,
    name::SEED,
    name::EXECUTION,
    name::SUBTASKS,
    name::LONGEST,
    name::OCCUPY,
];

/// The most subtasks side by side: a function returns at most 16 values.
const MOST_SUBTASKS: u64 = 16;

/// The options and the help text of `run`.
pub static RUN: Command = Command {
    invocation: "./scripts/run",
    about: "\
Builds an app, boots it on the bare machine in QEMU, or runs it on Linux, and judges the run.",
    positional: None,
    options: OPTIONS,
    notes: "\
Modes: docs/commands.md. Ctrl-C and the timeout end a run in order, ctrl-C again at once.
exit codes: 0 all is well; 1 a failure; 2 a refused command line; 130 ended by ctrl-C
",
};

options! {
    /// The app: a package under apps/.
    APP in "what": ValueKind::Text("NAME"), or "fork-join";
    /// A file of DAGs (docs/dag-file.md), or a folder.
    DAG: ValueKind::File("FILE");
    /// Boot this image, or program; build nothing.
    IMAGE: ValueKind::File("FILE");
    /// Jobs that a DAG releases; 0: no end.
    JOBS: ValueKind::Number(0, 1_000_000);
    /// Seed of the app's random draws; 1.
    SEED: ValueKind::Number(0, u64::MAX);
    /// Parameters of the app, with commas between.
    SET: ValueKind::Text("NAME=VALUE");
    /// Those of a file, a line for each; --set prevails.
    PARAMS: ValueKind::File("FILE");
    /// A file in the guest's memory, for the app.
    MODULE: ValueKind::File("FILE");
    /// More words for the guest's command line.
    APPEND: ValueKind::Text("WORDS");
    /// On.
    ON in "where": ValueKind::OneOf(&["machine", "linux", "debian", "host"]), or "machine";
    /// Processors; 4 on debian.
    CORES: ValueKind::Number(1, MOST_CORES), or "8";
    /// See docs/commands.md.
    MODE: ValueKind::OneOf(Mode::NAMES);
    /// The board.
    MACHINE: ValueKind::OneOf(Machine::NAMES), or "microvm";
    /// QEMU's words for devices, with blanks between; on q35.
    DEVICE: ValueKind::Text("WORDS");
    /// QEMU's words for a network; on q35.
    NET: ValueKind::Text("WORDS");
    /// Its card.
    CARD: ValueKind::OneOf(&["virtio", "e1000e"]), or "virtio";
    /// The network's traffic, for Wireshark.
    PCAP: ValueKind::File("FILE");
    /// The loader.
    BOOT: ValueKind::OneOf(Loader::NAMES), or "pvh";
    /// The guest's MiB.
    MEMORY: ValueKind::Number(LEAST_MEMORY_MIB, 65_536), or "32";
    /// Use this QEMU; install nothing.
    QEMU: ValueKind::File("PROGRAM");
    /// On Linux, by what.
    MECHANISM: ValueKind::OneOf(&["fifo", "sched_ext", "normal", "poll"]);
    /// On debian: so many programs next to it.
    BUSY: ValueKind::Number(0, 64);
    /// Order of instances.
    POLICY in "rules": ValueKind::OneOf(Policy::WORDS);
    /// Whether instances may lose their cores.
    PREEMPTION: ValueKind::OneOf(&["on", "off"]);
    /// Sizes of clusters of cores: N,N,... or auto.
    CLUSTERS: ValueKind::Text("SIZES");
    /// Parallel ones, a run for each; 2,4,6.
    SUBTASKS in "fork-join": ValueKind::Numbers(1, MOST_SUBTASKS);
    /// Milliseconds of the longest execution.
    LONGEST: ValueKind::Number(1, 50);
    /// How a simulated one has its core.
    OCCUPY: ValueKind::OneOf(&["hold", "spin"]);
    /// The one to take of a set of task graphs.
    GRAPH in "--dag": ValueKind::Text("NAME");
    /// The unit of numbers where a format has none; 1ms.
    UNIT: ValueKind::Text("TIME");
    /// wcet (default), uniform:0.2..1, samples, sequence.
    EXECUTION: ValueKind::Text("MODEL");
    /// The jobs of so many seconds.
    SECONDS: ValueKind::Number(1, 1_000_000);
    /// A deadline miss is a failure.
    STRICT_DEADLINES: ValueKind::Nothing;
    /// Print the file in our format; run nothing.
    PRINT_DAG: ValueKind::Nothing;
    /// All of the run; docs/recordings.md.
    KEEP in "files": ValueKind::File("FILE");
    /// As --keep, without values; for check-trace.
    TRACE: ValueKind::File("FILE");
    /// Serve a page that shows the run while it goes on.
    PAGE: ValueKind::Nothing;
    /// Jobs of a DAG to keep for a crash; 16.
    LATEST: ValueKind::Number(0, 64);
    /// Take the sources' values from it, compare others.
    REPLAY: ValueKind::File("FILE");
    /// --replay: begin with this job.
    FROM: ValueKind::Text("DAG/JOB");
    /// The serial log.
    SERIAL: ValueKind::File("FILE");
    /// Measure, commit, and compare; docs/proving.md.
    PROVE in "bounds": ValueKind::Nothing;
    /// --prove: per cent more; 20.
    MARGIN: ValueKind::Number(0, 1_000);
    /// --prove: measure so many seeds; 1.
    SEEDS: ValueKind::Number(1, 1_000);
    /// Commit with WCETs of `recording --observe`.
    WCETS: ValueKind::File("FILE");
    /// Talk to the kernel, in real time: type `help`.
    CONSOLE in "person": ValueKind::Nothing;
    /// Bytes for the app's wire; docs/wires.md. -: stdin.
    INPUT: ValueKind::File("FILE");
    /// Write what the app sends on its wire.
    OUTPUT: ValueKind::File("FILE");
    /// Seconds until its end; 120, one a job.
    TIMEOUT: ValueKind::Number(1, 86_400);
    /// Only machine lines on standard output.
    JSON: ValueKind::Nothing;
    /// Only what the guest prints.
    QUIET 'q': ValueKind::Nothing;
    /// Wait for a debugger on TCP port 1234.
    GDB: ValueKind::Nothing;
}
