//! Tests labels on the command line and in files.

use crate::labels::campaign;
use serde_json::Value;
use std::{fs, os::unix::fs::symlink, path::Path};

pub(crate) fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn labels_go_through_files_unchanged() {
    let (folder, murmuration) = campaign();
    let text = "index,class,annotator,time\n3,ring,ana,2023-11-14T22:13:20Z\n3,\"clump, loose\",ben,2023-11-14T22:13:20.001Z\n\
                4,not sure,ana,2023-11-14T22:13:20.002Z\n99,skip,ana,2023-11-14T22:13:20.003Z\n";
    let file = write(folder.path(), "mine.csv", text);
    let added = murmuration
        .run(&["label", "latest", "--csv", &file, "--json"])
        .lines();
    assert_eq!(added[0]["added"], 4);
    let out = folder.path().join("out.csv").display().to_string();
    let exported = murmuration.run(&["labels", "latest", "--csv", &out, "--json"]);
    let written = fs::read_to_string(&out).unwrap();
    assert_eq!(written.lines().count(), text.lines().count());
    for (written, given) in written.lines().zip(text.lines()) {
        assert!(written.starts_with(given), "{written}");
    }
    let labels = exported.lines();
    assert_eq!(
        (&labels[1]["answer"]["answer"], &labels[1]["answer"]["annotator"]),
        (&"clump, loose".into(), &"ben".into())
    );

    // In another campaign the same file gives the same labels.
    let spec = folder.path().join("small.toml").display().to_string();
    assert_eq!(murmuration.run(&["run", &spec]).code, Some(0));
    let again = murmuration
        .run(&["label", "small-2", "--csv", &out, "--json"])
        .lines();
    assert_eq!(again[0]["label_digest"], added[0]["label_digest"]);
    let out = folder.path().join("written/to/again.csv").display().to_string();
    assert_eq!(
        murmuration.run(&["labels", "small-2", "--csv", &out]).code,
        Some(0)
    );
    assert_eq!(fs::read_to_string(&out).unwrap(), written);
}

#[test]
fn a_file_that_is_older_than_the_answers_changes_nothing() {
    let (folder, murmuration) = campaign();
    let rows = |name: &str, rows: &str| {
        let file = write(
            folder.path(),
            name,
            &format!("index,class,annotator,time\n{rows}"),
        );
        murmuration.run(&["label", "latest", "--csv", &file])
    };
    let class = |index: u64| {
        let labels = murmuration.run(&["labels", "latest", "--json"]).lines();
        let own = labels.iter().find(|label| label["answer"]["index"] == index);
        own.unwrap()["answer"]["answer"].clone()
    };
    // The name in two Unicode forms is one annotator.
    let newer = rows("newer.csv", "7,ring,Jos\u{e9},2025-11-21T00:00:00Z\n");
    assert!(newer.stderr.contains("added 1 answer "), "{}", newer.stderr);
    let older = rows(
        "older.csv",
        "7,clump,Jose\u{301},2025-11-20T00:00:00Z\n8,clump,Jose\u{301},2025-11-20T00:00:00Z\n",
    );
    assert!(
        older.stderr.contains("left out: 1 row to which") && older.stderr.contains("added 1 answer "),
        "{}",
        older.stderr
    );
    assert_eq!((class(7), class(8)), ("ring".into(), "clump".into()));
    let again = rows("older.csv", "7,clump,Jos\u{e9},2025-11-20T00:00:00Z\n");
    assert!(
        again.code == Some(0) && again.stderr.contains("added 0 answers"),
        "{}",
        again.stderr
    );
    let newest = rows("newest.csv", "7,wall,Jos\u{e9},2025-11-22T00:00:00Z\n");
    assert_eq!((newest.code, class(7)), (Some(0), "wall".into()));
}

#[test]
fn what_labels_writes_every_command_reads() {
    let (folder, murmuration) = campaign();
    let labelled = murmuration.run(&["label", "latest", "--synthetic", "12"]);
    assert_eq!(labelled.code, Some(0), "{}", labelled.stderr);
    assert!(
        labelled.stdout.is_empty() && labelled.stderr.contains("added 12 answers to campaign"),
        "{}{}",
        labelled.stdout,
        labelled.stderr
    );
    let file = folder.path().join("my.csv").display().to_string();
    assert_eq!(
        murmuration.run(&["labels", "latest", "--csv", &file]).code,
        Some(0)
    );
    // The motion depends on the campaign's horizon, which is not the paper's, so the file needs the world.
    let columns = fs::read_to_string(&file).unwrap();
    let columns = columns.lines().next().unwrap();
    assert!(
        columns.starts_with("index,class,annotator,time,seed,left_0,right_0,left_1,right_1,average_speed,")
            && columns.ends_with(",world"),
        "{columns}"
    );

    // Commands refuse synthetic answers as a reference for the judge or an embedder, and in files of labels.
    for arguments in [
        vec!["lab", "judge", "--labels", &file],
        vec!["lab", "accuracy", "--features", "--labels", &file],
    ] {
        let refused = murmuration.run(&arguments);
        let expected = "no row has a class by an annotator other than `synthetic`, which gave 12 classes";
        assert!(
            refused.code == Some(2) && refused.stderr.contains(expected),
            "{}",
            refused.stderr
        );
    }
    let refused = murmuration.run(&["label", "small-1", "--csv", &file]);
    assert!(
        refused.code == Some(2) && refused.stderr.contains("line 2: annotator = \"synthetic\""),
        "{}",
        refused.stderr
    );
    // After a person has reviewed the answers, the answers count as this person's.
    let machines = fs::read_to_string(&file).unwrap();
    fs::write(&file, machines.replace(",synthetic,", ",ana,")).unwrap();

    // The judge gives the same motions the same classes as before.
    let judged = murmuration
        .run(&["lab", "judge", "--labels", &file, "--json"])
        .last_line();
    assert_eq!(
        (&judged["behaviours"], &judged["agreed"]),
        (&12.into(), &12.into())
    );
    for embedding in [["--features"].as_slice(), &["--untrained", "1"]] {
        let accuracy = [&["lab", "accuracy", "--labels", &file, "--json"], embedding].concat();
        assert_eq!(murmuration.run(&accuracy).last_line()["behaviours"], 12);
    }
    // The command refuses to label another archive with the file.
    let spec = folder.path().join("small.toml").display().to_string();
    assert_eq!(murmuration.run(&["run", &spec, "--seed", "9"]).code, Some(0));
    let refused = murmuration.run(&["label", "small-2", "--csv", &file]);
    assert!(
        refused.code == Some(2) && refused.stderr.contains("my.csv, line 2: index = "),
        "{}",
        refused.stderr
    );
    let again = murmuration
        .run(&["label", "small-1", "--csv", &file, "--json"])
        .last_line();
    assert_eq!(again["added"], 12);
}

#[test]
fn a_column_that_a_command_needs_is_named_with_those_there_are() {
    let (folder, murmuration) = campaign();
    let file = write(
        folder.path(),
        "bare.csv",
        "index,class,annotator\n3,ring,ana\n4,wall,ana\n",
    );
    for (arguments, column) in [
        (vec!["lab", "judge", "--labels", &file], "left_0"),
        (
            vec!["lab", "accuracy", "--features", "--labels", &file],
            "average_speed",
        ),
    ] {
        let refused = murmuration.run(&arguments);
        let expected = format!(
            "bare.csv, line 1: there is no column \"{column}\"; its columns are index, class, annotator"
        );
        assert!(
            refused.code == Some(2) && refused.stderr.contains(&expected),
            "{}\nnot {expected}",
            refused.stderr
        );
    }
}

#[test]
fn spellings_of_a_class_are_one_and_near_names_are_warned_of() {
    let (folder, murmuration) = campaign();
    let rows = "index,class,annotator\n1,Wall following,ana\n2,wall_following,ana\n3,Dispersal,ana\n4,dispersal,ana\n";
    let file = write(folder.path(), "spelled.csv", rows);
    let added = murmuration.run(&["label", "latest", "--csv", &file]);
    assert!(!added.stderr.contains("warning"), "{}", added.stderr);
    let classes = murmuration.run(&["classes", "latest", "--json"]).lines();
    let classes: Vec<_> = classes
        .iter()
        .map(|class| (class["name"].as_str().unwrap(), class["labels"].as_u64().unwrap()))
        .collect();
    assert_eq!(classes, [("wall_following", 2), ("dispersal", 2)]);

    let file = write(
        folder.path(),
        "typed.csv",
        "index,class,annotator\n5,dispresal,ana\n",
    );
    let warned = "warning: classes \"dispersal\" and \"dispresal\" have nearly the same name";
    for arguments in [vec!["label", "latest", "--csv", &file], vec!["classes", "latest"]] {
        let message = murmuration.run(&arguments).stderr;
        assert!(message.contains(warned), "{message}");
    }
    // The merge that the warning suggests removes the warning.
    let mended = murmuration.run(&["classes", "latest", "--merge", "dispresal", "dispersal"]);
    assert!(
        mended.code == Some(0) && !mended.stderr.contains("warning"),
        "{}",
        mended.stderr
    );
}

#[test]
fn a_class_that_no_answer_names_is_in_no_report() {
    let (folder, murmuration) = campaign();
    for rows in ["1,ring,ana\n2,clump,ana\n", "1,clump,ana\n"] {
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
    let made = murmuration
        .run(&["classes", "latest", "--create", "wall", "--json"])
        .lines();
    let listed: Vec<_> = made.iter().map(|class| class["name"].as_str().unwrap()).collect();
    assert_eq!(listed, ["clump", "wall"]);
    let out = folder.path().join("report");
    let report = murmuration.run(&["report", "latest", "--out", &out.display().to_string()]);
    assert_eq!(report.code, Some(0), "{}", report.stderr);
    let classes = fs::read_to_string(out.join("classes.csv")).unwrap();
    let named: Vec<_> = classes
        .lines()
        .skip(1)
        .map(|row| row.split(',').next().unwrap())
        .collect();
    assert_eq!(named, ["clump"]);
}

#[test]
fn annotators_that_nobody_knows_are_named() {
    let (folder, murmuration) = campaign();
    let agreement = |one, other| murmuration.run(&["agreement", "latest", "--annotators", one, other]);
    let nobody = agreement("ana", "ben");
    assert!(
        nobody.code == Some(2) && nobody.stderr.contains("annotator \"ana\" is unknown"),
        "{}",
        nobody.stderr
    );
    let rows = "index,class,annotator\n1,ring,ana\n2,ring,ben\n";
    let file = write(folder.path(), "two.csv", rows);
    assert_eq!(
        murmuration.run(&["label", "latest", "--csv", &file]).code,
        Some(0)
    );
    let unknown = agreement("ana", "bne");
    assert!(
        unknown.code == Some(2)
            && unknown.stderr.contains("annotator \"bne\" has given no labels")
            && unknown.stderr.contains("ana, ben"),
        "{}",
        unknown.stderr
    );
    let apart = agreement("ana", "ben");
    assert_eq!(
        apart.stdout,
        "ana and ben have no individual in common that has a class from both\n"
    );
}

#[test]
fn no_label_in_a_file_is_a_formula() {
    let (folder, murmuration) = campaign();
    let text = "index,class,annotator,time\n3,'=HYPERLINK(1),'@ana,2023-11-14T22:13:20Z\n4,''tis,ana,2023-11-14T22:13:20.001Z\n";
    // The test reads the file as a person can write it, and as an export writes it.
    let plain = text.replace("'=", "=").replace("'@", "@").replace("''", "'");
    for (name, text) in [("plain.csv", plain.as_str()), ("marked.csv", text)] {
        let file = write(folder.path(), name, text);
        let added = murmuration.run(&["label", "latest", "--csv", &file]);
        assert_eq!(added.code, Some(0), "{}", added.stderr);
        let out = folder.path().join("out.csv").display().to_string();
        let labels = murmuration
            .run(&["labels", "latest", "--csv", &out, "--force", "--json"])
            .lines();
        let message = |place: usize, what: &str| labels[place]["answer"][what].as_str().unwrap().to_owned();
        assert_eq!(
            (message(0, "answer"), message(0, "annotator")),
            ("=HYPERLINK(1)".into(), "@ana".into())
        );
        assert_eq!(message(1, "answer"), "'tis");
    }
    let out = fs::read_to_string(folder.path().join("out.csv")).unwrap();
    for (written, given) in out.lines().zip(text.lines()) {
        assert!(written.starts_with(given), "{written}");
    }
}

#[test]
fn a_file_with_a_bad_row_is_refused_whole_and_its_line_named() {
    let (folder, murmuration) = campaign();
    for (rows, expected) in [
        ("1,ring,ana,\n2,ring,ana,soon\n", "line 3: time"),
        (
            "1,ring,ana,\n\n100,ring,ana,\n",
            "line 4: index = 100: must be the index of one of the 100",
        ),
        ("1,ring,,\n", "line 2: annotator is missing"),
    ] {
        let file = write(
            folder.path(),
            "bad.csv",
            &format!("index,class,annotator,time\n{rows}"),
        );
        let refused = murmuration.run(&["label", "latest", "--csv", &file]);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(expected),
            "{}",
            refused.stderr
        );
    }
    let listed = murmuration.run(&["labels", "latest", "--json"]);
    assert_eq!(listed.lines(), [] as [Value; 0]);
}

#[test]
fn classes_and_agreement_on_the_command_line() {
    let (folder, murmuration) = campaign();
    let label = |annotator: &str, rows: &str| {
        let file = write(folder.path(), "classes.csv", &format!("index,class\n{rows}"));
        let arguments = [
            "label",
            "latest",
            "--json",
            "--csv",
            &file,
            "--annotator",
            annotator,
        ];
        assert_eq!(murmuration.run(&arguments).lines().len(), 1);
    };
    label("ana", "1,ring\n2,ring\n3,clump\n4,clump\n");
    label("ben", "1,ring\n2,clump\n3,clump\n4,blob\n5,ring\n");

    let classes = |arguments: &[&str]| -> Vec<(String, u64)> {
        let command = [&["classes", "latest", "--json"], arguments].concat();
        let classes = murmuration.run(&command).lines().into_iter();
        let read = |class: Value| {
            let name = class["name"].as_str().unwrap().to_owned();
            (name, class["labels"].as_u64().unwrap())
        };
        classes.map(read).collect()
    };
    let named = |classes: &[(&str, u64)]| -> Vec<(String, u64)> {
        let owned = |(name, labels): &(&str, u64)| ((*name).to_owned(), *labels);
        classes.iter().map(owned).collect()
    };
    assert_eq!(classes(&[]), named(&[("ring", 4), ("clump", 4), ("blob", 1)]));
    assert_eq!(
        classes(&["--merge", "blob", "clump"]),
        named(&[("ring", 4), ("clump", 5)])
    );
    assert_eq!(
        classes(&["--rename", "ring", "milling"]),
        named(&[("milling", 4), ("clump", 5)])
    );
    classes(&["--colour", "milling", "#010203"]);
    let table = murmuration.run(&["classes", "latest"]).stdout;
    assert!(table.contains("#010203"), "{table}");

    // Answers of ana: milling, milling, clump, clump. Answers of ben: milling, clump, clump, clump. The observed agreement is
    // 3/4, and 1/2 by chance.
    let agreement = ["agreement", "latest", "--annotators", "ana", "ben", "--json"];
    let agreement = &murmuration.run(&agreement).lines()[0];
    assert_eq!(
        (&agreement["both"], &agreement["kappa"]),
        (&4.into(), &0.5.into())
    );
    assert_eq!(agreement["disagreements"][0]["index"], 2);

    let wrong = [
        (
            vec!["classes", "latest", "--rename", "ring", "x"],
            "there is no class \"ring\"",
        ),
        (
            vec!["classes", "latest", "--colour", "clump", "blue"],
            "six hexadecimal digits",
        ),
        (
            vec!["classes", "latest", "--rename", "a", "b", "--merge", "a", "b"],
            "cannot be used with",
        ),
        (vec!["labels", "nobody-1"], "there is no campaign"),
    ];
    for (arguments, expected) in wrong {
        let refused = murmuration.run(&arguments);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(expected),
            "{}",
            refused.stderr
        );
    }
}

#[test]
fn a_table_that_is_not_separated_by_commas_or_has_an_open_quote_is_refused() {
    let (folder, murmuration) = campaign();
    for (text, expected) in [
        (
            "id;class;annotator\n1;ring;ana\n",
            "line 1: the columns are separated by semicolons; save the file with commas",
        ),
        (
            "index,class,annotator\n1,ring,ana\n2,ring,\"ana\n",
            "line 3: a cell begins with a quote but does not end with one",
        ),
    ] {
        let file = write(folder.path(), "bad.csv", text);
        for arguments in [
            vec!["label", "latest", "--csv", &file],
            vec!["lab", "judge", "--labels", &file],
        ] {
            let refused = murmuration.run(&arguments);
            assert!(
                refused.code == Some(2) && refused.stderr.contains(expected),
                "{}",
                refused.stderr
            );
        }
    }
}

#[test]
fn a_link_that_leads_nowhere_is_not_taken_for_nothing() {
    let (folder, murmuration) = campaign();
    let file = write(
        folder.path(),
        "mine.csv",
        "index,class,seed,v1,v2,v3,v4\n0,ring,1,0.6,1,0.4,0.5\n1,clump,2,0.6,1,0.4,0.5\n",
    );
    let unmounted = folder.path().join("unmounted");
    symlink(&unmounted, folder.path().join("images")).unwrap();
    let refused = murmuration.run(&["lab", "accuracy", "--untrained", "1", "--labels", &file]);
    let expected = format!("is a link to {}, which does not exist", unmounted.display());
    assert!(
        refused.code == Some(2) && refused.stderr.contains(&expected),
        "{}",
        refused.stderr
    );
}
