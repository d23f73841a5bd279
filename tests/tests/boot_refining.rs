//! Subtasks that refine their results, on the machine.

use harness::Guest;

/// Two refinements of each job end and the third one never does, of 1000 jobs on so many cores.
fn a_cut_costs_nothing(cores: u64) {
    let guest = Guest::new("guest-tests").word("test=refining");
    let outcome = guest.cores(cores).succeed();
    let tail = || format!("{cores} cores\n{}", outcome.tail());
    let line = outcome.transcript.of_kind("refining").next();
    let line = line.unwrap_or_else(|| panic!("no line of kind `refining`: {}", tail()));
    let number = |name| {
        let number = line.number_at(name);
        number.unwrap_or_else(|| panic!("no `{name}`: {}", tail()))
    };
    let jobs = number("jobs");
    assert!(jobs >= 1000, "{}", tail());
    // Each job ends, with the last result that was complete.
    assert_eq!(number("cut"), jobs, "{}", tail());
    assert_eq!(number("complete"), number("steps") * jobs, "{}", tail());
    assert_eq!(number("completed"), jobs, "{}", tail());
    assert_eq!(
        (number("results"), number("right")),
        (jobs, jobs),
        "{}",
        tail()
    );
    // No other is harmed, although it preempts refinements.
    assert_eq!(number("healthy_completed"), jobs, "{}", tail());
    assert_eq!(number("healthy_misses"), 0, "{}", tail());
    assert!(cores > 1 || number("suspensions") > 0, "{}", tail());
    assert_eq!(
        (number("faults"), number("violations")),
        (0, 0),
        "{}",
        tail()
    );
    assert_eq!(outcome.transcript.of_kind("fault").count(), 0, "{}", tail());
    // And nothing stays behind.
    assert_eq!(number("allocations"), 0, "{}", tail());
    assert_eq!(number("leaks"), 0, "{}", tail());
}

#[test]
fn a_refinement_that_never_ends_costs_nothing_on_one_core() {
    a_cut_costs_nothing(1);
}

#[test]
fn a_refinement_that_never_ends_costs_nothing_on_four_cores() {
    a_cut_costs_nothing(4);
}

#[test]
fn a_refinement_that_keeps_a_lock_is_a_fault_of_its_own_dag() {
    for cores in [1, 4] {
        let guest = Guest::new("guest-tests").word("test=refining_in_section");
        let outcome = guest.cores(cores).succeed();
        let tail = || format!("{cores} cores\n{}", outcome.tail());
        let line = outcome.transcript.of_kind("refining").next();
        let line = line.unwrap_or_else(|| panic!("no line of kind `refining`: {}", tail()));
        let number = |name| line.number_at(name);
        assert_eq!(number("faults"), Some(1), "{}", tail());
        assert_eq!(
            (number("cut"), number("completed")),
            (Some(0), Some(0)),
            "{}",
            tail()
        );
        // The lock is lost; the other DAG, which does not use it, runs to its end.
        assert_eq!(number("healthy_completed"), number("jobs"), "{}", tail());
        assert_eq!(
            (number("healthy_faults"), number("violations")),
            (Some(0), Some(0)),
            "{}",
            tail()
        );
        let fault = outcome.transcript.of_kind("fault").next();
        let fault = fault.unwrap_or_else(|| panic!("no fault: {}", tail()));
        assert_eq!(fault.text_at("dag_name"), Some("refined"), "{}", tail());
        assert_eq!(fault.text_at("subtask_name"), Some("plan"), "{}", tail());
        assert_eq!(fault.text_at("cause"), Some("refinement"), "{}", tail());
    }
}
