//! Runs DAGs built with `fass` in virtual time on the host.
#![forbid(unsafe_code)]
