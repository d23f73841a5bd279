//! The remains of a run: memory that faults have kept, and values that cannot be dropped.

use alloc::vec;
use alloc::vec::Vec;
use core::hint::black_box;
use core::time::Duration;

use fass::{Dag, FaultLimit, SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine};

const PERIOD: Duration = Duration::from_millis(10);

/// Has each of three faults keep 1000 bytes, next to a DAG that keeps as much without a fault.
pub(crate) fn keep(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    let [tidy, careless] = ["tidy", "careless"].map(|name| {
        let dag = create_dag();
        dag.name(name).jobs(3).relative_deadline(PERIOD);
        dag
    });
    let mut kept = Vec::new();
    let keep = move || kept.push(vec![1_u8; 1000]);
    tidy.register_periodic_subtask(keep, vec![], PERIOD, SubtaskAttributes::named("keep"));
    careless.survive_faults(FaultLimit {
        faults: 1,
        window: 1,
        in_all: 3,
    });
    let lose = |()| {
        let bytes = black_box(vec![1_u8; 1000]);
        assert!(bytes.is_empty(), "they are lost");
    };
    let attributes = SubtaskAttributes::named("lose");
    (careless.period(PERIOD).restarting(move || lose)).register(attributes);
    finish_create_dags(&[tidy, careless])?;
    machine.run().map(drop)
}

struct Stubborn {
    loops: bool,
}

impl Drop for Stubborn {
    fn drop(&mut self) {
        while black_box(self.loops) {}
        panic!("it cannot be dropped");
    }
}

/// Has a function own what cannot be dropped, next to a DAG that ends well.
pub(crate) fn behind(machine: &Machine, loops: bool) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    let dag = |name: &str| -> Dag {
        let dag = create_dag();
        dag.name(name).jobs(3).relative_deadline(PERIOD);
        dag
    };
    let [good, stubborn] = ["good", "stubborn"].map(dag);
    let attributes = SubtaskAttributes::named("return");
    good.register_periodic_subtask(|| (), vec![], PERIOD, attributes.clone());
    let owned = Stubborn { loops };
    let f = move || {
        black_box(&owned);
    };
    stubborn.register_periodic_subtask(f, vec![], PERIOD, attributes);
    finish_create_dags(&[good, stubborn])?;
    machine.run().map(drop)
}
