//! The paper's figures 3 and 4, written out.
//!
//! Figure 3 elides the functions' bodies and the last arguments; filled in, it
//! compiles as printed. Figure 4 names the traits and the loop that the system
//! generates from a function's type; here they are used by those names.

mod support;

use core::time::Duration;
use std::any::type_name;
use std::sync::mpsc;

use fass::{MulRecv, MulSend, SubtaskAttributes, VecToPubs, VecToSubs};
use fass::{create_dag, finish_create_dags};

#[test]
#[allow(clippy::cloned_ref_to_slice_refs, reason = "the figure's own words")]
fn figure_3_compiles_and_runs() {
    support::install();
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

    support::run_job(&mut support::take(), 0);
    assert_eq!(received.try_iter().collect::<Vec<_>>(), [(8, 14)]);
}

/// The figure says functions; named ones do as well as closures.
#[test]
fn plain_functions_are_subtasks() {
    fn source() -> (i32,) {
        (20,)
    }
    fn middle((a,): (i32,)) -> (i32, i32) {
        (a + 1, a + 2)
    }
    fn sink((b, c): (i32, i32)) {
        assert_eq!((b, c), (21, 22));
    }
    let period = Duration::from_millis(100);
    let dag = create_dag();
    let attributes = SubtaskAttributes::default;
    dag.register_periodic_subtask(source, vec!["a"], period, attributes());
    dag.register_subtask(middle, vec!["a"], vec!["b", "c"], attributes());
    dag.register_sink_subtask(sink, vec!["b", "c"], period, attributes());
    support::run_job(&mut support::commit(&[dag]), 0);
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

/// Arity 16 both ways, and every arity's type list on the way there.
#[test]
fn arities_from_0_to_16() {
    macro_rules! check {
        ($($number:literal)*) => { check!(@ [] $($number)*); };
        (@ [$($taken:literal)*] $next:literal $($rest:literal)*) => {
            check!(@one $($taken)*);
            check!(@ [$($taken)* $next] $($rest)*);
        };
        (@ [$($taken:literal)*]) => { check!(@one $($taken)*); };
        (@one $($number:literal)*) => {{
            type Tuple = ($(check!(@type $number),)*);
            let expected: &[u16] = &[$($number),*];
            assert_eq!(<Tuple as VecToSubs>::input_types().len(), expected.len());
            assert_eq!(<Tuple as VecToPubs>::output_types().len(), expected.len());
        }};
        (@type $number:literal) => { [u8; $number] };
    }
    check!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
}

#[test]
fn sixteen_values_arrive_in_their_places() {
    type Sixteen = (
        [u8; 0],
        [u8; 1],
        [u8; 2],
        [u8; 3],
        [u8; 4],
        [u8; 5],
        [u8; 6],
        [u8; 7],
        u8,
        u16,
        u32,
        u64,
        i8,
        i16,
        i32,
        i64,
    );
    const VALUES: Sixteen = (
        [0; 0], [1; 1], [2; 2], [3; 3], [4; 4], [5; 5], [6; 6], [7; 7], 8, 9, 10, 11, 12, 13, 14,
        15,
    );
    let names: Vec<String> = (0..16).map(|number| format!("topic {number}")).collect();
    let topics: Vec<&str> = names.iter().map(String::as_str).collect();
    let (results, received) = mpsc::channel();
    let period = Duration::from_millis(1);
    let dag = create_dag();
    let attributes = SubtaskAttributes::named("source");
    dag.register_periodic_subtask(|| VALUES, topics.clone(), period, attributes);
    let sink = move |values: Sixteen| results.send(values).expect("the test listens");
    dag.register_sink_subtask(sink, topics, period, SubtaskAttributes::named("sink"));
    let mut plan = support::commit(&[dag]);
    for job in 0..100 {
        support::run_job(&mut plan, job);
        let values: Vec<Sixteen> = received.try_iter().collect();
        assert_eq!(values.len(), 1);
        assert_eq!(format!("{:?}", values[0].0), "[]");
        assert_eq!((values[0].7, values[0].8, values[0].15), ([7; 7], 8, 15));
        assert_eq!((values[0].9, values[0].10, values[0].14), (9, 10, 14));
    }
}
