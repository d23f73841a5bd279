//! What `run` accepts: the one table behind its parser and its help text.

use crate::options::{Command, Opt, Takes};
use crate::qemu::{LEAST_MEMORY_MIB, MOST_CORES, Machine, Mode};

/// The options that become words `name=value` on the guest's command line, if
/// they are given: kernel and apps have defaults of their own, and not every app
/// knows every word.
pub(super) const GUEST_WORDS: &[&str] = &[
    "policy",
    "preemption",
    "jobs",
    "seconds",
    "seed",
    "execution",
    "subtasks",
    "occupy",
];

/// The most subtasks side by side: a function returns at most 16 values.
const MOST_SUBTASKS: u64 = 16;

/// The table of `run`.
pub static RUN: Command = Command {
    invocation: "./scripts/run",
    about: "Builds an app, boots it on the bare machine in QEMU, and judges the run.",
    positional: None,
    options: &[
        Opt {
            name: "app",
            short: None,
            takes: Takes::Text("NAME"),
            default: "fork-join",
            help: "The app to run: a package under apps/.",
        },
        Opt {
            name: "cores",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: MOST_CORES,
            },
            default: "8",
            help: "Processors of the guest.",
        },
        Opt {
            name: "jobs",
            short: None,
            takes: Takes::Number {
                least: 0,
                most: 1_000_000,
            },
            default: "",
            help: "Jobs that each DAG releases; the default is 200 for fork-join, 50 for --dag; \
                   0, for fork-join: no end, which is for --console.",
        },
        Opt {
            name: "seed",
            short: None,
            takes: Takes::Number {
                least: 0,
                most: u64::MAX,
            },
            default: "",
            help: "Seed of the app's random draws; the app's default is 1.",
        },
        Opt {
            name: "policy",
            short: None,
            takes: Takes::OneOf(&["static", "edf"]),
            default: "",
            help: "Static priorities (the kernel's default), or earliest deadline first.",
        },
        Opt {
            name: "preemption",
            short: None,
            takes: Takes::OneOf(&["on", "off"]),
            default: "",
            help: "Whether a started instance may lose its core (the kernel's default: on).",
        },
        Opt {
            name: "subtasks",
            short: None,
            takes: Takes::Numbers {
                least: 1,
                most: MOST_SUBTASKS,
            },
            default: "",
            help: "fork-join: parallel subtasks, one run each; the app's default is 2,4,6.",
        },
        Opt {
            name: "occupy",
            short: None,
            takes: Takes::OneOf(&["hold", "spin"]),
            default: "",
            help: "fork-join, --dag: how a subtask executes: it holds its core while the \
                   processor halts (the app's default), or it spins.",
        },
        Opt {
            name: "dag",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "Run the DAGs of a file, see docs/dag-file.md: our text format, RD-Gen's .yaml, \
                   or task graphs in .json; of a folder, each of its files, in one table.",
        },
        Opt {
            name: "print-dag",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "--dag: print the file in our text format; run nothing.",
        },
        Opt {
            name: "graph",
            short: None,
            takes: Takes::Text("NAME"),
            default: "",
            help: "--dag: the one graph to take of a set of task graphs; else each is run.",
        },
        Opt {
            name: "unit",
            short: None,
            takes: Takes::Text("TIME"),
            default: "",
            help: "--dag: what 1 stands for where a format has no units; 1ms.",
        },
        Opt {
            name: "execution",
            short: None,
            takes: Takes::Text("MODEL"),
            default: "",
            help: "--dag: execution times: wcet (the default), uniform:0.2..1 (drawn, fractions of \
                   the WCET), or samples (drawn from the file's).",
        },
        Opt {
            name: "seconds",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: 1_000_000,
            },
            default: "",
            help: "--dag: each DAG releases the jobs of so many seconds, instead of --jobs.",
        },
        Opt {
            name: "strict-deadlines",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "--dag: a deadline miss makes the run a failure.",
        },
        Opt {
            name: "memory",
            short: None,
            takes: Takes::Number {
                least: LEAST_MEMORY_MIB,
                most: 65_536,
            },
            default: "32",
            help: "The guest's memory in MiB; more than 24 cores take more than 16, and more than \
                   48 get more than the default.",
        },
        Opt {
            name: "mode",
            short: None,
            takes: Takes::OneOf(Mode::NAMES),
            default: "",
            help: "What time means, see below; kvm where it works, else deterministic.",
        },
        Opt {
            name: "machine",
            short: None,
            takes: Takes::OneOf(Machine::NAMES),
            default: "microvm",
            help: "The board that QEMU imitates.",
        },
        Opt {
            name: "timeout",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: 86_400,
            },
            default: "",
            help: "Seconds of wall time until the guest is killed; 120 and one a job.",
        },
        Opt {
            name: "serial",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "Keep the serial log in this file.",
        },
        Opt {
            name: "trace",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "Keep the serial log in this file, with the trace of each run, which is not \
                   shown; ./scripts/check-trace FILE judges it.",
        },
        Opt {
            name: "dot",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "Write the committed DAGs to this file, for Graphviz: `dot -Tsvg FILE`.",
        },
        Opt {
            name: "console",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Talk to the kernel while it runs: type `help`. Real time unless --mode says \
                   otherwise, no timeout unless --timeout does, no machine lines unless --json.",
        },
        Opt {
            name: "append",
            short: None,
            takes: Takes::Text("WORDS"),
            default: "",
            help: "More words for the guest's command line.",
        },
        Opt {
            name: "json",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Only machine lines on standard output, the rest on standard error.",
        },
        Opt {
            name: "plain",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "No machine lines on standard output.",
        },
        Opt {
            name: "quiet",
            short: Some('q'),
            takes: Takes::Nothing,
            default: "",
            help: "Only what the guest prints: no introduction, no progress.",
        },
        Opt {
            name: "gdb",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Wait for a debugger on TCP port 1234; no timeout.",
        },
        Opt {
            name: "image",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "Boot this image; build nothing.",
        },
        Opt {
            name: "qemu",
            short: None,
            takes: Takes::Text("PROGRAM"),
            default: "",
            help: "Use this QEMU; install nothing.",
        },
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

exit codes: 0 all is well; 1 a failure; 2 a refused command line
",
};
