use super::*;

#[test]
fn the_least_of_the_rounds_counts_for_each() {
    let mut rounds = [(0.3, Some(0.9)), (0.2, Some(1.0)), (0.4, Some(0.8))].into_iter();
    let mut taken = 0;
    let least = in_turns(Duration::from_secs(3), || {
        taken += 1;
        Ok(rounds.next().unwrap())
    });
    assert_eq!(least.unwrap(), (0.2, Some(0.8)));
    assert_eq!(taken, 3);
}

#[test]
fn a_peer_that_is_missing_has_no_figure_and_no_ratio() {
    let least = in_turns(Duration::ZERO, || Ok((0.5, None))).unwrap();
    assert_eq!(least, (0.5, None));
    let row = Row {
        item: "item".to_owned(),
        unit: "steps/s",
        ours: 1234.5,
        peer: least.1,
        peer_name: Some("numba"),
        floor: Floor {
            count: 9_273_600,
            of: "operations",
        },
    };
    assert_eq!(
        row.cells()[2..],
        ["1,235", "-", "numba", "-", "9,273,600 operations"]
    );
}

#[test]
fn a_peer_that_does_not_run_is_no_error() {
    assert!(peer::Peer::start("/missing/python3", "numba", "", "", "").is_none());
    // Python also ends without output if a package is missing.
    assert!(peer::Peer::start("false", "numba", "", "", "[]").is_none());
}

#[test]
fn the_name_of_a_cpu_is_found_where_there_is_one() {
    let text = "processor\t: 0\nmodel name\t: AMD EPYC 7\nprocessor\t: 1\n";
    assert_eq!(cpu(text), Some("AMD EPYC 7".to_owned()));
    assert_eq!(cpu("BogoMIPS\t: 50.00\n"), None);
}
