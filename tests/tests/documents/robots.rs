//! Checks the drawings of the page on robots.

use murmuration_tests::binary;
use murmuration_tests::pages::{page, root};
use std::{fs, process::Command};

/// Checks that each drawing is the output of `murmuration robot` for the file above the drawing.
pub fn every_drawing_is_of_the_description_above_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = page("docs/robots.md");
    let mut drawn = 0;
    for part in text.split("```toml\n").skip(1) {
        let (file, rest) = part.split_once("```").unwrap();
        let Some((name, _)) = rest
            .trim_start()
            .strip_prefix("![")
            .and_then(|rest| rest.split_once("](robots/")?.1.split_once(')'))
        else {
            continue;
        };
        let [described, svg] = ["robot.toml", "robot.svg"].map(|name| folder.path().join(name));
        fs::write(&described, file).unwrap();
        let status = Command::new(binary("murmuration"))
            .arg("robot")
            .arg(&described)
            .args(["--force", "--svg"])
            .arg(&svg)
            .output();
        assert!(status.unwrap().status.success(), "{file}");
        let expected = fs::read_to_string(root().join("docs/robots").join(name)).unwrap();
        assert!(
            fs::read_to_string(&svg).unwrap() == expected,
            "{name} is not of\n{file}"
        );
        drawn += 1;
    }
    assert_eq!(drawn, fs::read_dir(root().join("docs/robots")).unwrap().count());
}
