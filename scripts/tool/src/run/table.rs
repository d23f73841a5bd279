//! What `run` accepts: the one table behind its parser and its help text.

use crate::options::{Command, Opt, Takes};
use crate::qemu::{LEAST_MEMORY_MIB, Loader, MOST_CORES, Machine, Mode};

/// The options that become words `name=value` on the guest's command line, if
/// they are given: kernel and apps have defaults of their own, and not every app
/// knows every word.
pub(super) const GUEST_WORDS: &[&str] = &[
    "policy",
    "preemption",
    "clusters",
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
    options: &[
        Opt::new(
            "app",
            Takes::Text("NAME"),
            "The app to run: a package under apps/.",
        )
        .or("fork-join"),
        Opt::new(
            "on",
            Takes::OneOf(&["machine", "linux", "debian"]),
            "Where it runs: on the bare machine in QEMU, as a program of this computer, or as one \
             of Debian's Linux in QEMU, see docs/linux.md.",
        )
        .or("machine"),
        Opt::new(
            "cores",
            Takes::number(1..=MOST_CORES),
            "Processors of the guest, 4 with --on debian; with --on linux no more than this \
             computer has.",
        )
        .or("8"),
        Opt::new(
            "mechanism",
            Takes::OneOf(&["fifo", "sched_ext", "normal"]),
            "On Linux: what carries the order out, see docs/linux.md; fifo if nothing is said.",
        ),
        Opt::new(
            "busy",
            Takes::number(0..=64),
            "With --on debian: so many programs compute next to it.",
        ),
        Opt::new(
            "jobs",
            Takes::number(0..=1_000_000),
            "Jobs that each DAG releases; the default is 200 for fork-join, 50 for --dag; \
             0, for fork-join: no end, which is for --console.",
        ),
        Opt::new(
            "seed",
            Takes::number(0..=u64::MAX),
            "Seed of the app's random draws; the app's default is 1.",
        ),
        Opt::new(
            "policy",
            Takes::OneOf(&["static", "edf"]),
            "Static priorities (the kernel's default), or earliest deadline first.",
        ),
        Opt::new(
            "preemption",
            Takes::OneOf(&["on", "off"]),
            "Whether a started instance may lose its core (the kernel's default: on).",
        ),
        Opt::new(
            "clusters",
            Takes::Text("N,N,...|auto"),
            "--dag, and apps that offer it: divides the cores into clusters of so many each; auto: \
             as the commit finds.",
        ),
        Opt::new(
            "subtasks",
            Takes::numbers(1..=MOST_SUBTASKS),
            "fork-join: parallel subtasks, one run each; the app's default is 2,4,6.",
        ),
        Opt::new(
            "longest",
            Takes::number(1..=50),
            "fork-join: the longest execution of a parallel subtask in ms; the paper's 50 is more \
             than a period, and so nothing is proven of it.",
        ),
        Opt::new(
            "work",
            Takes::OneOf(&["simulate", "compute"]),
            "fork-join: whether a subtask's execution is simulated (the app's default), or it \
             really computes for the drawn time.",
        ),
        Opt::new(
            "occupy",
            Takes::OneOf(&["hold", "spin"]),
            "fork-join, --dag: how a simulated execution occupies its core, which halts \
             meanwhile (the app's default), or spins.",
        ),
        Opt::new(
            "dag",
            Takes::File("FILE"),
            "Run the DAGs of a file, see docs/dag-file.md: our text format, RD-Gen's .yaml, \
             or task graphs in .json; of a folder, each of its files, in one table.",
        ),
        Opt::new(
            "module",
            Takes::File("FILE"),
            "Leave this file in the guest's memory, for the app: a recording for gait.",
        ),
        Opt::new(
            "set",
            Takes::Text("NAME=VALUE,..."),
            "Set parameters of the app before it begins; at the console, `params` lists them.",
        ),
        Opt::new(
            "params",
            Takes::File("FILE"),
            "Set those of this file, a line NAME=VALUE for each; --set prevails.",
        ),
        Opt::new(
            "record",
            Takes::File("FILE"),
            "Write what crosses the edge of the run to this file: the values of the topics that \
             the app records, see docs/recordings.md.",
        ),
        Opt::new(
            "latest",
            Takes::number(0..=64),
            "Without --record and --replay: of how many jobs of each DAG the inputs are kept, for a \
             file that shows a crash; 0: of none; the default is 16.",
        ),
        Opt::new(
            "replay",
            Takes::File("FILE"),
            "Take the values of sources from this recording, compare the others with it, and \
             fail where one differs.",
        ),
        Opt::new(
            "print-dag",
            Takes::Nothing,
            "--dag: print the file in our text format; run nothing.",
        ),
        Opt::new(
            "graph",
            Takes::Text("NAME"),
            "--dag: the one graph to take of a set of task graphs; else each is run.",
        ),
        Opt::new(
            "unit",
            Takes::Text("TIME"),
            "--dag: what 1 stands for where a format has no units; 1ms.",
        ),
        Opt::new(
            "execution",
            Takes::Text("MODEL"),
            "--dag: execution times: wcet (the default), uniform:0.2..1 (drawn, fractions of \
             the WCET), or samples (drawn from the file's).",
        ),
        Opt::new(
            "seconds",
            Takes::number(1..=1_000_000),
            "--dag: each DAG releases the jobs of so many seconds, instead of --jobs.",
        ),
        Opt::new(
            "strict-deadlines",
            Takes::Nothing,
            "--dag: a deadline miss makes the run a failure.",
        ),
        Opt::new(
            "memory",
            Takes::number(LEAST_MEMORY_MIB..=65_536),
            "The guest's memory in MiB; more than 24 cores take more than 16, and more than \
             48 get more than the default.",
        )
        .or("32"),
        Opt::new(
            "mode",
            Takes::OneOf(Mode::NAMES),
            "What time means, see below; kvm where it works, else deterministic, or threads with \
             --boot bios, uefi or efi.",
        ),
        Opt::new(
            "machine",
            Takes::OneOf(Machine::NAMES),
            "The board that QEMU imitates; with --boot bios, uefi or efi it is q35.",
        )
        .or("microvm"),
        Opt::new(
            "boot",
            Takes::OneOf(Loader::NAMES),
            "What brings the image into memory: QEMU (pvh), or as on a PC, from a stick, GRUB, \
             started by a BIOS (bios) or by UEFI (uefi), or an application of our own, started \
             by UEFI (efi).",
        )
        .or("pvh"),
        Opt::new(
            "timeout",
            Takes::number(1..=86_400),
            "Seconds of wall time until the run is ended, in order if it can be; 120 and one a job.",
        ),
        Opt::new(
            "serial",
            Takes::File("FILE"),
            "Keep the serial log in this file.",
        ),
        Opt::new(
            "trace",
            Takes::File("FILE"),
            "Keep the serial log in this file, with the trace of each run, which is not \
             shown; ./scripts/check-trace FILE judges it.",
        ),
        Opt::new(
            "dot",
            Takes::File("FILE"),
            "Write the committed DAGs to this file, for Graphviz: `dot -Tsvg FILE`.",
        ),
        Opt::new(
            "witness",
            Takes::File("FILE"),
            "Write what proves the commit's bounds to this file, which ./scripts/check-witness \
             checks; of a second commit to FILE.1, and so on.",
        ),
        Opt::new(
            "observe",
            Takes::File("FILE"),
            "Write what calls take to this file, as WCETs with a margin, and show it; \
             docs/proving.md.",
        ),
        Opt::new(
            "margin",
            Takes::number(0..=1_000),
            "--observe, --prove: what a WCET is above the longest call, in per cent; 20.",
        ),
        Opt::new(
            "seeds",
            Takes::number(1..=1_000),
            "--observe, --prove: observe a run for each of so many seeds, from --seed on; 1.",
        ),
        Opt::new(
            "wcets",
            Takes::File("FILE"),
            "Commit with the WCETs of a file that --observe has written.",
        ),
        Opt::new(
            "prove",
            Takes::Nothing,
            "Observe a run (or take --wcets), commit with these WCETs, run again, and compare: \
             for each DAG its bound, its longest response, and what the bound is made of.",
        ),
        Opt::new(
            "console",
            Takes::Nothing,
            "Talk to the kernel while it runs: type `help`. Real time unless --mode says \
             otherwise, no timeout unless --timeout does, no machine lines unless --json.",
        ),
        Opt::new(
            "input",
            Takes::File("FILE"),
            "Bytes for the app's wire, with their times: lines such as 4ms \"on\\n\"; \
             docs/wires.md. With - what comes on standard input, in real time unless --mode says \
             otherwise.",
        ),
        Opt::new(
            "output",
            Takes::File("FILE"),
            "Write what the app sends on its wire to this file.",
        ),
        Opt::new(
            "append",
            Takes::Text("WORDS"),
            "More words for the guest's command line.",
        ),
        Opt::new(
            "json",
            Takes::Nothing,
            "Only machine lines on standard output, the rest on standard error.",
        ),
        Opt::new(
            "plain",
            Takes::Nothing,
            "No machine lines on standard output.",
        ),
        Opt::new(
            "quiet",
            Takes::Nothing,
            "Only what the guest prints: no introduction, no progress.",
        )
        .short('q'),
        Opt::new(
            "gdb",
            Takes::Nothing,
            "Wait for a debugger on TCP port 1234; no timeout.",
        ),
        Opt::new(
            "image",
            Takes::File("FILE"),
            "Boot this image; build nothing.",
        ),
        Opt::new(
            "qemu",
            Takes::File("PROGRAM"),
            "Use this QEMU; install nothing.",
        ),
    ],
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
