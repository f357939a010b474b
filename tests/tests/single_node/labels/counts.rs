//! Tests counts of labels: by annotator, and current or superseded.

use crate::labels::{campaign, files::write};

#[test]
fn what_the_synthetic_annotator_answered_is_counted_apart() {
    let (folder, murmuration) = campaign();
    let rows = "index,class,annotator\n0,ring,ana\n1,ring,ana\n2,clump,ben\n3,not sure,ben\n";
    let file = write(folder.path(), "mine.csv", rows);
    for arguments in [
        vec!["label", "latest", "--csv", &file],
        vec!["label", "latest", "--synthetic", "5"],
    ] {
        assert_eq!(murmuration.run(&arguments).code, Some(0));
    }
    let labels = folder.path().join("labels.csv").display().to_string();
    let written = murmuration.run(&["labels", "latest", "--csv", &labels]);
    assert_eq!(written.code, Some(0), "{}", written.stderr);
    let expected = "3 behaviours with a class given by an annotator\n\
                skipped: 5 answers by the synthetic annotator, which is the rule-based judge\n";
    for arguments in [
        vec!["lab", "judge", "--labels", &labels],
        vec!["lab", "accuracy", "--features", "--labels", &labels],
        vec!["lab", "accuracy", "--untrained", "1", "--labels", &labels],
    ] {
        let told = murmuration.run(&arguments);
        assert!(
            told.code == Some(0) && told.stderr.ends_with(expected),
            "{}",
            told.stderr
        );
        let told = murmuration.run(&[arguments.as_slice(), &["--json"]].concat());
        let told = told.last_line();
        assert_eq!(
            (&told["behaviours"], &told["synthetic_left_out"]),
            (&3.into(), &5.into()),
            "{told}"
        );
    }
    for name in ["synthetic", "Syn-Thetic"] {
        let refused = murmuration.run(&["label", "latest", "--csv", &file, "--annotator", name]);
        assert!(
            refused.code == Some(2) && refused.stderr.contains("a person's name"),
            "{}",
            refused.stderr
        );
    }
}

#[test]
fn every_count_of_labels_says_what_it_counts() {
    let (folder, murmuration) = campaign();
    for rows in ["1,ring,ana\n2,clump,ana\n3,skip,ana\n", "1,clump,ana\n"] {
        let file = write(
            folder.path(),
            "rows.csv",
            &format!("index,class,annotator\n{rows}"),
        );
        assert_eq!(
            murmuration.run(&["label", "latest", "--csv", &file]).code,
            Some(0)
        );
    }
    let message = |arguments: &[&str]| {
        let told = murmuration.run(arguments);
        format!("{}{}", told.stdout, told.stderr)
    };
    for (arguments, counts) in [
        (["doctor"].as_slice(), "4 entries of the label log"),
        (&["labels", "latest"], "3 answers, 2 with a class;"),
        (&["classes", "latest"], "2 answers with a class"),
    ] {
        let told = message(arguments);
        assert!(told.contains(counts), "{told}\nnot {counts:?}");
    }
}
