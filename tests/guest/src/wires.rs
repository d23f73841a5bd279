//! Two crossing wires: packets of each go out on the other.

use core::fmt::Write;
use core::time::Duration;

use fass::shared::{Received, Sender, Wire};
use fass::{create_dag, finish_create_dags};
use kernel::{AppError, Machine};

use crate::single::named;

/// Runs a DAG for each direction.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let [one, two] = ["one", "two"].map(Wire::new);
    machine.connect(&one)?;
    machine.connect(&two)?;
    machine.options().finish(&["test", "input"])?;
    let dags = [("there", &one, &two), ("back", &two, &one)].map(|(name, from, to)| {
        let (dag, period) = (create_dag(), Duration::from_millis(10));
        dag.name(name).jobs(5).relative_deadline(period);
        let cross = |(packets, mut to): (Received<'_, u8>, Sender<'_>)| {
            for packet in packets {
                let _ = write!(to, "{}!", char::from(packet.value));
                to.end_packet();
            }
        };
        let first = |bytes: &[u8]| bytes.first().copied();
        let using = dag
            .period(period)
            .using((from.receiving(first), to.sending()));
        using.source(cross).register(named("cross"));
        dag
    });
    finish_create_dags(&dags)?;
    machine.run().map(drop)
}
