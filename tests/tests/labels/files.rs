//! Labels on the command line, and through files.

use crate::campaign;
use serde_json::Value;
use std::{fs, path::Path};

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn labels_go_through_files_unchanged() {
    let (folder, murmuration) = campaign();
    let text = "id,class,annotator,time\n3,ring,ana,1700000000000\n3,\"clump, loose\",ben,1700000000001\n\
                4,not sure,ana,1700000000002\n99,skip,ana,1700000000003\n";
    let file = write(folder.path(), "mine.csv", text);
    let added = murmuration
        .run(&["label", "latest", "--csv", &file, "--json"])
        .lines();
    assert_eq!(added[0]["added"], 4);
    let out = folder.path().join("out.csv").display().to_string();
    let exported = murmuration.run(&["labels", "latest", "--csv", &out, "--json"]);
    assert_eq!(fs::read_to_string(&out).unwrap(), text);
    let labels = exported.lines();
    assert_eq!(
        (&labels[1]["class"], &labels[1]["annotator"]),
        (&"clump, loose".into(), &"ben".into())
    );

    // In another campaign the same file comes to the same labels.
    let spec = folder.path().join("small.toml").display().to_string();
    assert_eq!(murmuration.run(&["run", &spec]).code, Some(0));
    let again = murmuration
        .run(&["label", "small-2", "--csv", &out, "--json"])
        .lines();
    assert_eq!(again[0]["label_digest"], added[0]["label_digest"]);
    let out = folder.path().join("again.csv").display().to_string();
    assert_eq!(
        murmuration.run(&["labels", "small-2", "--csv", &out]).code,
        Some(0)
    );
    assert_eq!(fs::read_to_string(&out).unwrap(), text);
}

#[test]
fn a_file_with_a_bad_row_is_refused_whole_and_its_line_named() {
    let (folder, murmuration) = campaign();
    for (rows, said) in [
        ("1,ring,ana,\n2,ring,ana,soon\n", "line 3: time"),
        (
            "1,ring,ana,\n\n100,ring,ana,\n",
            "line 4: id = 100: must be the index of one of the 100",
        ),
        ("1,ring,,\n", "line 2: annotator = nothing"),
    ] {
        let file = write(
            folder.path(),
            "bad.csv",
            &format!("id,class,annotator,time\n{rows}"),
        );
        let refused = murmuration.run(&["label", "latest", "--csv", &file]);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(said),
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
        let file = write(folder.path(), "classes.csv", &format!("id,class\n{rows}"));
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
            let name = class["class"].as_str().unwrap().to_owned();
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

    // ana: milling, milling, clump, clump; ben: milling, clump, clump, clump. 3/4 observed, 1/2 by chance.
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
    for (arguments, said) in wrong {
        let refused = murmuration.run(&arguments);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(said),
            "{}",
            refused.stderr
        );
    }
}
