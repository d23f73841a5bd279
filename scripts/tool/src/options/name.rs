//! The names of all options, as constants: a look-up of an option that no command has does not
//! compile.

use std::fmt;

/// The name of an option, without its dashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name(&'static str);

impl Name {
    /// Makes the name of an option; empty for a positional word.
    pub(super) const fn new(name: &'static str) -> Name {
        Name(name)
    }

    /// Returns the name as a person types it after the dashes.
    pub const fn as_str(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// Makes a constant of each name.
macro_rules! names {
    ($($constant:ident $name:literal,)*) => {
        $(
            #[doc = concat!("`--", $name, "`")]
            pub const $constant: Name = Name($name);
        )*
    };
}

names! {
    APP "app",
    APPEND "append",
    BLESS "bless",
    BOOT "boot",
    BOUND_US "bound-us",
    BREAK "break",
    BUSY "busy",
    CLUSTERS "clusters",
    COMMANDS "commands",
    COMPARE "compare",
    CONSOLE "console",
    CORES "cores",
    CORES_UP_TO "cores-up-to",
    CSV "csv",
    DAG "dag",
    DETERMINISTIC "deterministic",
    DOT "dot",
    EXECUTION "execution",
    FIRST "first",
    FROM "from",
    FROM_CSV "from-csv",
    GDB "gdb",
    GIT "git",
    GRAPH "graph",
    IGNORE "ignore",
    IMAGE "image",
    IN_KERNEL "in-kernel",
    INPUT "input",
    ISO "iso",
    JOBS "jobs",
    JSON "json",
    KEEP "keep",
    LATEST "latest",
    LISTING "listing",
    LONGEST "longest",
    MACHINE "machine",
    MARGIN "margin",
    MCAP "mcap",
    MECHANISM "mechanism",
    MEMORY "memory",
    MIRI "miri",
    MODE "mode",
    MODULE "module",
    OBSERVE "observe",
    OCCUPY "occupy",
    ON "on",
    ONCE "once",
    ONLY "only",
    OUT "out",
    OUTPUT "output",
    PARAMS "params",
    PERIOD "period",
    PERIODS "periods",
    POLICIES "policies",
    POLICY "policy",
    PREEMPTION "preemption",
    PRINT_DAG "print-dag",
    PROVE "prove",
    QEMU "qemu",
    QUEUE "queue",
    QUICK "quick",
    QUIET "quiet",
    REPEAT "repeat",
    REPLAY "replay",
    ROUND_MS "round-ms",
    ROUNDS "rounds",
    RUN "run",
    SAVE_BASELINE "save-baseline",
    SCALE "scale",
    SECONDS "seconds",
    SEED "seed",
    SEEDS "seeds",
    SERIAL "serial",
    SET "set",
    SETS "sets",
    SHORT "short",
    SHOW "show",
    SIDE_BY_SIDE "side-by-side",
    STRICT_DEADLINES "strict-deadlines",
    SUBTASKS "subtasks",
    SVG "svg",
    THREAD_SANITIZER "thread-sanitizer",
    TIMEOUT "timeout",
    TO "to",
    TOPIC "topic",
    TRACE "trace",
    TYPE "type",
    UNIT "unit",
    UNIT_US "unit-us",
    UNTIL "until",
    VERBOSE "verbose",
    WCETS "wcets",
    WITNESS "witness",
    WORK "work",
}
