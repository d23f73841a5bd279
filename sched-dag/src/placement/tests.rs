//! Tests of what cores have and should have.

use super::*;

type Cores = Placement<char, &'static str>;

const X: Vertex = Vertex(0);
const Y: Vertex = Vertex(1);

impl Cores {
    /// Two cores, which run nothing.
    fn with_bodies() -> Cores {
        let mut cores = Cores::empty(2, 2);
        cores.replace(X, 'x');
        cores.replace(Y, 'y');
        cores
    }

    /// Notes a decision to run, or to preempt if `target` is `None`.
    fn decide(&mut self, core: u32, target: Option<Vertex>) {
        self.set_target(CoreId(core), target);
    }
}

/// Two cores; core 0 runs `X`, and the scheduler wants `Y` there instead.
fn about_to_preempt() -> Cores {
    let mut cores = Cores::with_bodies();
    cores.decide(0, Some(X));
    assert_eq!(cores.next(0), NextWork::Start(X, 'x'));
    assert!(!cores.must_suspend(0));
    cores.decide(0, None);
    cores.decide(0, Some(Y));
    assert!(cores.must_suspend(0));
    cores
}

/// Core 0 leaves what it has.
fn suspend(cores: &mut Cores, context: &'static str) -> Option<CoreId> {
    let instance = cores.detach(0).unwrap();
    assert_eq!(cores.take_suspended(0), None);
    cores.suspend(instance, context)
}

#[test]
fn what_finishes_while_it_is_parked_is_wanted_nowhere() {
    let mut cores = about_to_preempt();
    assert_eq!(suspend(&mut cores, "the thread of x"), None);
    cores.decide(1, Some(X));
    cores.finish_parked(X, 'x');
    assert!(!cores.is_wanted(1));
    assert_eq!(cores.next(1), NextWork::Nothing);
    assert_eq!(cores.resting(X), Some(&mut 'x'));
}

#[test]
fn only_what_rests_is_taken_out_and_once() {
    let mut cores = Cores::with_bodies();
    cores.decide(0, Some(X));
    assert_eq!(cores.next(0), NextWork::Start(X, 'x'));
    assert_eq!(cores.take(X), None);
    cores.finish(0, X, 'x');
    assert_eq!((cores.take(X), cores.take(X)), (Some('x'), None));
    assert_eq!(cores.take(Y), Some('y'));
}

#[test]
fn a_preempted_instance_continues_on_any_core() {
    let mut cores = about_to_preempt();
    assert_eq!(suspend(&mut cores, "context of x"), None);
    assert_eq!(cores.next(0), NextWork::Start(Y, 'y'));
    cores.decide(1, Some(X));
    assert!(cores.is_wanted(1));
    assert_eq!(cores.next(1), NextWork::Continue("context of x"));
    cores.finish(1, X, 'x');
    assert_eq!(cores.next(1), NextWork::Nothing);
    assert_eq!(cores.current(0), Some(Y));
}

#[test]
fn a_core_exchanges_what_it_has_finished_for_what_it_should_have() {
    let mut cores = Cores::with_bodies();
    cores.decide(0, Some(X));
    assert_eq!(cores.next(0), NextWork::Start(X, 'x'));
    assert_eq!(cores.exchange(CoreId(0), X, 'x', Y), Some('y'));
    assert_eq!(
        (cores.current(0), cores.resting(X)),
        (Some(Y), Some(&mut 'x'))
    );
    // The next job's instance of the same subtask.
    assert_eq!(cores.exchange(CoreId(0), Y, 'y', Y), Some('y'));
    let mut cores = about_to_preempt();
    suspend(&mut cores, "context of x");
    assert_eq!(cores.next(0), NextWork::Start(Y, 'y'));
    assert_eq!(cores.exchange(CoreId(0), Y, 'y', X), None);
    assert!(cores.current(0).is_none() && cores.is_wanted(0));
    assert_eq!(cores.next(0), NextWork::Continue("context of x"));
}

#[test]
fn a_core_waits_for_an_instance_that_another_still_has() {
    let mut cores = about_to_preempt();
    cores.decide(1, Some(X));
    assert_eq!(cores.next(1), NextWork::Nothing);
    assert_eq!(suspend(&mut cores, "context of x"), Some(CoreId(1)));
    assert_eq!(cores.next(1), NextWork::Continue("context of x"));
}

#[test]
fn an_instance_that_is_to_make_way_or_wanted_elsewhere_may_finish_where_it_is() {
    for is_wanted_elsewhere in [false, true] {
        let mut cores = about_to_preempt();
        cores.decide(1, is_wanted_elsewhere.then_some(X));
        cores.finish(0, X, 'x');
        assert!(!cores.must_suspend(0));
        assert_eq!(cores.next(1), NextWork::Nothing);
        assert_eq!(cores.next(0), NextWork::Start(Y, 'y'));
    }
}

#[test]
fn a_preemption_that_is_taken_back_changes_nothing() {
    let mut cores = about_to_preempt();
    cores.decide(0, None);
    cores.decide(0, Some(X));
    assert!(!cores.must_suspend(0));
    cores.decide(1, Some(Y));
    assert_eq!(cores.next(1), NextWork::Start(Y, 'y'));
}

#[test]
fn a_lost_instance_is_never_run_again_but_another_body_takes_its_place() {
    let mut cores = about_to_preempt();
    assert_eq!(cores.lose(0), Some(X));
    cores.decide(1, Some(X));
    assert_eq!(cores.next(1), NextWork::Nothing);
    assert!(cores.resting(X).is_none());
    assert_eq!(cores.next(0), NextWork::Start(Y, 'y'));
    cores.replace(X, 'z');
    assert_eq!(cores.next(1), NextWork::Start(X, 'z'));
}
