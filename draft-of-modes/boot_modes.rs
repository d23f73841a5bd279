
#[test]
fn modes_change_at_once_and_when_idle() {
    for cores in [1, 2, 4] {
        let guest = Guest::new("guest-tests").word("test=modes");
        let outcome = guest.cores(cores).word("trace=dump").succeed();
        assert_eq!(number(&outcome, "lifecycle", "violations"), 0);
        assert_eq!(number(&outcome, "lifecycle", "allocations"), 0);
        assert!(outcome.serial.contains("while no mode changes it takes at most"));

        let runs = tool::trace::read(&outcome.serial).expect("a trace");
        let findings = tool::trace::check(&runs[0], 1_000_000);
        assert_eq!(findings.breaches, [], "{cores} cores");
        // `cruise` is DAG 0 and mode 0, `descend` DAG 1 and mode 1.
        let (mut mode, mut entered, mut in_flight) = (0, Vec::new(), [0_u32; 3]);
        for event in &runs[0].events {
            let dag = event.dag.index();
            match event.what {
                What::Released => {
                    assert!(dag == 2 || dag == mode, "{event:?} in mode {mode}");
                    in_flight[dag] += 1;
                }
                What::Completed => in_flight[dag] -= 1,
                What::Entered => {
                    mode = usize::try_from(event.job).expect("few modes");
                    entered.push(mode);
                    let is_idle = in_flight[0] == 0;
                    assert!(mode == 0 || is_idle, "`cruise` has a job in flight");
                }
                _ => {}
            }
        }
        // Mode 0 at first, then 1 and 0 in turns: each six jobs of 40.
        assert_eq!(entered.len(), 14, "{entered:?}");
        let turns = entered.iter().enumerate();
        assert!(turns.clone().all(|(turn, mode)| turn % 2 == *mode));
    }
}
