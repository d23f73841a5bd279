//! What `run` accepts: the one table behind its parser and its help text.

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
        /// The app to run: a package under apps/.
        "app": Takes::Text("NAME"), or "fork-join";
        /// Where it runs: on the bare machine in QEMU, as a program of this computer, or as one of
        /// Debian's Linux in QEMU, see docs/linux.md.
        "on": Takes::OneOf(&["machine", "linux", "debian"]), or "machine";
        /// Processors of the guest, 4 with --on debian; with --on linux no more than this computer
        /// has.
        "cores": Takes::number(1..=MOST_CORES), or "8";
        /// On Linux: what carries the order out, see docs/linux.md; fifo if nothing is said.
        "mechanism": Takes::OneOf(&["fifo", "sched_ext", "normal", "poll"]);
        /// With --on debian: so many programs compute next to it.
        "busy": Takes::number(0..=64);
        /// Jobs that each DAG releases; the default is 200 for fork-join, 50 for --dag; 0, for
        /// fork-join: no end, which is for --console.
        "jobs": Takes::number(0..=1_000_000);
        /// Seed of the app's random draws; the app's default is 1.
        "seed": Takes::number(0..=u64::MAX);
        /// Static priorities (the kernel's default), or earliest deadline first.
        "policy": Takes::OneOf(&["static", "edf"]);
        /// Whether a started instance may lose its core (the kernel's default: on).
        "preemption": Takes::OneOf(&["on", "off"]);
        /// --dag, and apps that offer it: divides the cores into clusters of so many each; auto: as
        /// the commit finds.
        "clusters": Takes::Text("N,N,...|auto");
        /// fork-join: parallel subtasks, one run each; the app's default is 2,4,6.
        "subtasks": Takes::numbers(1..=MOST_SUBTASKS);
        /// fork-join: the longest execution of a parallel subtask in ms; the paper's 50 is more
        /// than a period, and so nothing is proven of it.
        "longest": Takes::number(1..=50);
        /// fork-join: whether a subtask's execution is simulated (the app's default), or it really
        /// computes for the drawn time.
        "work": Takes::OneOf(&["simulate", "compute"]);
        /// fork-join, --dag: how a simulated execution occupies its core, which halts meanwhile
        /// (the app's default), or spins.
        "occupy": Takes::OneOf(&["hold", "spin"]);
        /// Run the DAGs of a file, see docs/dag-file.md: our text format, RD-Gen's .yaml, or task
        /// graphs in .json; of a folder, each of its files, in one table.
        "dag": Takes::File("FILE");
        /// Leave this file in the guest's memory, for the app: a recording for gait.
        "module": Takes::File("FILE");
        /// Set parameters of the app before it begins; at the console, `params` lists them.
        "set": Takes::Text("NAME=VALUE,...");
        /// Set those of this file, a line NAME=VALUE for each; --set prevails.
        "params": Takes::File("FILE");
        /// As --keep; it is an error if the app records no topic.
        "record": Takes::File("FILE");
        /// Keep all of the run in one file, while it goes on: model, events, times, the values of
        /// the topics that the app records, and machine lines; docs/recordings.md.
        "keep": Takes::File("FILE");
        /// Without --record, --keep and --replay: of how many jobs of each DAG the inputs are kept, for a
        /// file that shows a crash; 0: of none; the default is 16.
        "latest": Takes::number(0..=64);
        /// Take the values of sources from this recording, compare the others with it, and fail
        /// where one differs.
        "replay": Takes::File("FILE");
        /// --replay: begin with this job, or with the last one before it of which all states of the
        /// DAG are recorded.
        "from": Takes::Text("DAG/JOB");
        /// --dag: print the file in our text format; run nothing.
        "print-dag": Takes::Nothing;
        /// --dag: the one graph to take of a set of task graphs; else each is run.
        "graph": Takes::Text("NAME");
        /// --dag: what 1 stands for where a format has no units; 1ms.
        "unit": Takes::Text("TIME");
        /// --dag: execution times: wcet (the default), uniform:0.2..1 (drawn, fractions of the
        /// WCET), or samples (drawn from the file's).
        "execution": Takes::Text("MODEL");
        /// --dag: each DAG releases the jobs of so many seconds, instead of --jobs.
        "seconds": Takes::number(1..=1_000_000);
        /// --dag: a deadline miss makes the run a failure.
        "strict-deadlines": Takes::Nothing;
        /// The guest's memory in MiB; more than 24 cores take more than 16, and more than 48 get
        /// more than the default.
        "memory": Takes::number(LEAST_MEMORY_MIB..=65_536), or "32";
        /// What time means, see below; kvm where it works, else deterministic, or threads with
        /// --boot bios, uefi or efi.
        "mode": Takes::OneOf(Mode::NAMES);
        /// The board that QEMU imitates; with --boot bios, uefi or efi it is q35.
        "machine": Takes::OneOf(Machine::NAMES), or "microvm";
        /// What brings the image into memory: QEMU (pvh), or as on a PC, from a stick, GRUB,
        /// started by a BIOS (bios) or by UEFI (uefi), or an application of our own, started by
        /// UEFI (efi).
        "boot": Takes::OneOf(Loader::NAMES), or "pvh";
        /// Seconds of wall time until the run is ended, in order if it can be; 120 and one a job.
        "timeout": Takes::number(1..=86_400);
        /// Keep the serial log in this file.
        "serial": Takes::File("FILE");
        /// Keep the same without values, when a run is over; ./scripts/check-trace FILE judges it.
        "trace": Takes::File("FILE");
        /// Write the committed DAGs to this file, for Graphviz: `dot -Tsvg FILE`.
        "dot": Takes::File("FILE");
        /// Write what proves the commit's bounds to this file, which ./scripts/check-witness
        /// checks; of a second commit to FILE.1, and so on.
        "witness": Takes::File("FILE");
        /// Write what calls take to this file, as WCETs with a margin, and show it;
        /// docs/proving.md.
        "observe": Takes::File("FILE");
        /// --observe, --prove: what a WCET is above the longest call, in per cent; 20.
        "margin": Takes::number(0..=1_000);
        /// --observe, --prove: observe a run for each of so many seeds, from --seed on; 1.
        "seeds": Takes::number(1..=1_000);
        /// Commit with the WCETs of a file that --observe has written.
        "wcets": Takes::File("FILE");
        /// Observe a run (or take --wcets), commit with these WCETs, run again, and compare: for
        /// each DAG its bound, its longest response, and what the bound is made of.
        "prove": Takes::Nothing;
        /// Talk to the kernel while it runs: type `help`. Real time unless --mode says otherwise,
        /// no timeout unless --timeout does, no machine lines unless --json.
        "console": Takes::Nothing;
        /// Bytes for the app's wire, with their times: lines such as 4ms "on\n"; docs/wires.md.
        /// With - what comes on standard input, in real time unless --mode says otherwise.
        "input": Takes::File("FILE");
        /// Write what the app sends on its wire to this file.
        "output": Takes::File("FILE");
        /// More words for the guest's command line.
        "append": Takes::Text("WORDS");
        /// Only machine lines on standard output, the rest on standard error.
        "json": Takes::Nothing;
        /// No machine lines on standard output.
        "plain": Takes::Nothing;
        /// Only what the guest prints: no introduction, no progress.
        "quiet" 'q': Takes::Nothing;
        /// Wait for a debugger on TCP port 1234; no timeout.
        "gdb": Takes::Nothing;
        /// Boot this image, or start this program for Linux; build nothing.
        "image": Takes::File("FILE");
        /// Use this QEMU; install nothing.
        "qemu": Takes::File("PROGRAM");
    },
    notes: "\
modes:
  kvm            real time on real cores, by the host's virtualization
  deterministic  one instruction is one virtual nanosecond, idle time is skipped,
                 busy processors share one clock: the same bytes on every machine,
                 but no wall time
  threads        emulated processors in real time, one host thread each

While it runs, progress stands on standard error. Machine lines are JSON, one
object a line: `./scripts/run | grep '^{'`; docs/serial-protocol.md explains them.

Ctrl-C ends a run in order, with counts, recording and trace: nothing more is released, and
what is in flight goes on. So does the timeout. Ctrl-C again ends it at once, as it does at any
time with --on debian, and on the machine with --input -.

exit codes: 0 all is well; 1 a failure; 2 a refused command line; 130 ended by ctrl-C
",
};
