//! The paper's figures 3 and 4, written out.
//!
//! Figure 3 elides the functions' bodies and the last arguments; filled in, it
//! compiles as printed. Figure 4 names the traits and the loop that the system
//! generates from a function's type; here they are used by those names.

use core::time::Duration;
use std::any::type_name;
use std::sync::mpsc;

use fass::{MulRecv, MulSend, SubtaskAttributes, VecToPubs, VecToSubs};
use fass::{create_dag, finish_create_dags};

#[test]
#[allow(clippy::cloned_ref_to_slice_refs, reason = "the figure's own words")]
fn figure_3_compiles_and_runs() {
    crate::support::install();
    let period = Duration::from_millis(100);
    let relative_deadline = Duration::from_millis(100);
    let (results, received) = mpsc::channel();
    let f0 = || -> (i32,) { (7,) };
    let f1 = |(a,): (i32,)| -> (i32, i32) { (a + 1, a * 2) };
    let f2 = move |(b, c): (i32, i32)| results.send((b, c)).expect("the test listens");

    let dag = create_dag();
    dag.register_periodic_subtask::<_, (i32,)>(
        f0, // || -> (i32,)
        vec!["topic0"],
        period,
        SubtaskAttributes::default(),
    );

    dag.register_subtask::<_, (i32,), (i32, i32)>(
        f1, // |(i32,)| -> (i32, i32)
        vec!["topic0"],
        vec!["topic1", "topic2"],
        SubtaskAttributes::default(),
    );

    dag.register_sink_subtask::<_, (i32, i32)>(
        f2, // |(i32, i32)| -> ()
        vec!["topic1", "topic2"],
        relative_deadline,
        SubtaskAttributes::default(),
    );

    finish_create_dags(&[dag.clone()]).expect("the paper's DAG is faultless");

    crate::support::run_job(&mut crate::support::take(), 0);
    assert_eq!(received.try_iter().collect::<Vec<_>>(), [(8, 14)]);
}

/// The bounds of figure 4's `create_subtask`, with its type-level equalities.
fn accepts_figure_4<F, Args, Ret>(_: F) -> (&'static str, &'static str)
where
    F: Fn(<Args::Subs as MulRecv>::Items) -> <Ret::Pubs as MulSend>::Items + Send + 'static,
    Args: VecToSubs,
    Ret: VecToPubs,
    Args::Subs: Send,
    Ret::Pubs: Send,
{
    (
        type_name::<<Args::Subs as MulRecv>::Items>(),
        type_name::<<Ret::Pubs as MulSend>::Items>(),
    )
}

#[test]
fn figure_4_names_what_a_function_type_generates() {
    let f = |(a,): (i32,)| (a, i64::from(a));
    let (items_in, items_out) = accepts_figure_4::<_, (i32,), (i32, i64)>(f);
    assert_eq!((items_in, items_out), ("(i32,)", "(i32, i64)"));
}

/// `recv_all` and `send_all` give futures that may move between threads.
#[allow(dead_code, reason = "compiling it is the test")]
fn figure_4_futures_are_send<S: MulRecv, P: MulSend>(subs: &mut S, pubs: &mut P, items: P::Items) {
    fn is_send<T: Send>(_: T) {}
    is_send(subs.recv_all());
    is_send(pubs.send_all(items));
}

#[test]
fn arities_from_0_to_16() {
    macro_rules! check {
        () => { check!(@0); };
        ($arity:literal $($rest:literal)*) => {
            check!(@$arity [u8; $arity] $(, [u8; $rest])*);
            check!($($rest)*);
        };
        (@$arity:literal $($Type:ty),*) => {
            assert_eq!(<($($Type,)*) as VecToSubs>::input_types().len(), $arity);
            assert_eq!(<($($Type,)*) as VecToPubs>::output_types().len(), $arity);
        };
    }
    check!(16 15 14 13 12 11 10 9 8 7 6 5 4 3 2 1);
}
