//! Every fault that an app can make is found and said as the page
//! `docs/commit-faults.md` shows it: here on the host, in virtual time; a boot
//! test does the same in the guest.

use std::collections::BTreeMap;

use harness::fault_page::documented_faults;

#[test]
fn every_fault_is_found_and_said_as_documented() {
    let machine = virtual_time::VirtualTime::new();
    let _machine = machine.policy(fass::Policy::StaticPriority);
    let mut said = BTreeMap::new();
    guest_tests::faults::provoke(|case, fault, text| {
        assert_eq!(
            fault, case,
            "the commit did not find the fault of this case"
        );
        said.insert(fault.to_string(), text.to_string());
    });
    let documented = documented_faults().unwrap_or_default();
    // What to paste into the page if a text was changed on purpose.
    let page: String = said
        .iter()
        .map(|(f, t)| format!("### `{f}`\n\n    {t}\n\n"))
        .collect();
    assert!(
        said == documented,
        "the page must have these sections:\n\n{page}"
    );
}

#[test]
fn every_text_is_one_line_and_ends_in_a_remedy() {
    for (fault, text) in documented_faults().expect("the page") {
        assert_eq!(text.lines().count(), 1, "{fault}");
        let remedy = text
            .rsplit("; ")
            .next()
            .filter(|remedy| remedy.len() < text.len());
        assert!(
            remedy.is_some(),
            "no remedy after a semicolon: {fault}: {text}"
        );
    }
}
