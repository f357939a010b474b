//! Tests files that commands write to a path of the user's choice: on a full disk, in a read-only folder, over other files.

use crate::data_directory::MODEL;
use murmuration_tests::{Finished, Murmuration, Requirement, SmallDisk, Test, small_spec, test};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

pub fn tests() -> Vec<Test> {
    vec![
        test!(on_a_full_disk_the_former_file_stays).needs(Requirement::Mount),
        test!(on_a_full_disk_a_folder_stays_as_it_was).needs(Requirement::Mount),
        test!(what_cannot_be_written_is_named),
        test!(a_file_that_exists_is_replaced_only_when_asked),
        test!(a_folder_keeps_the_files_of_its_owner),
        test!(what_is_read_is_not_written),
    ]
}

const CONTROLLER: &str = "--controller=0.2,0.7,-0.5,-0.1";
/// The commands that write one file, without the file's name, and the file's extension.
const FILES: [(&[&str], &str); 10] = [
    (&["simulate", CONTROLLER, "--gif"], "gif"),
    (&["simulate", CONTROLLER, "--png"], "png"),
    (&["simulate", CONTROLLER, "--svg"], "svg"),
    (&["simulate", CONTROLLER, "--image"], "png"),
    (&["simulate", CONTROLLER, "--tracks"], "csv"),
    (&["controller", "export", CONTROLLER, "--header"], "h"),
    (&["robot", "--model", "single-sensor", "--svg"], "svg"),
    (&["labels", "latest", "--csv"], "csv"),
    (&["checkpoints", "export", "CHECKPOINT"], "onnx"),
    (&["evaluate", "SPEC", "CONTROLLERS", "--out"], "csv"),
];
/// The commands that write a folder, without the folder's name, and one file of the folder.
const FOLDERS: [(&[&str], &str); 3] = [
    (&["report", "latest", "--out"], "report.html"),
    (&["lab", "atlas", "ATLAS", "--out"], "atlas.csv"),
    (&["export", "latest"], "README.md"),
];

/// A campaign, a checkpoint, and the files that commands read.
struct Given {
    murmuration: Murmuration,
    spec: String,
    atlas: String,
    controllers: String,
    checkpoint: String,
}

impl Given {
    fn in_folder(folder: &Path) -> Self {
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            fs::write(&path, text).unwrap();
            path.display().to_string()
        };
        let murmuration = Murmuration::with_campaign(folder);
        let imported = murmuration.run(&["checkpoints", "import", MODEL, "--json"]);
        let atlas = "model = \"single-sensor\"\nmethod = \"exhaustive\"\nworld = { horizon = 200 }\ncontrollers = { step = 1.0 }\n";
        Self {
            spec: folder.join("small.toml").display().to_string(),
            atlas: write("atlas.toml", atlas),
            controllers: write("controllers.csv", &"0.2,0.7,-0.5,-0.1\n".repeat(300)),
            checkpoint: imported.last_line()["digest"].as_str().unwrap().to_owned(),
            murmuration,
        }
    }

    /// Runs a command as [`Given::run`] does, with permission to replace the file.
    fn replace(&self, command: &[&str], path: &Path) -> Finished {
        let [command @ .., option] = command else {
            panic!("a command has words");
        };
        self.run(&[command, &["--force", option]].concat(), path)
    }

    fn run(&self, command: &[&str], path: &Path) -> Finished {
        let path = path.display().to_string();
        let argument = |argument: &&str| match *argument {
            "SPEC" => self.spec.clone(),
            "ATLAS" => self.atlas.clone(),
            "CONTROLLERS" => self.controllers.clone(),
            "CHECKPOINT" => self.checkpoint.clone(),
            other => other.to_owned(),
        };
        let arguments: Vec<String> = command.iter().map(argument).chain([path]).collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        self.murmuration.run(&arguments)
    }
}

/// The names in a folder with the content of the files; subfolders only by name.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let content = |path: PathBuf| {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        (name, fs::read(&path).unwrap_or_default())
    };
    entries.map(content).collect()
}

#[track_caller]
fn names_file(failed: &Finished, command: &[&str], path: &Path) {
    let message = &failed.stderr;
    assert!(matches!(failed.code, Some(1 | 2)), "{command:?}: {message}");
    assert!(
        message.contains(&path.display().to_string()),
        "{command:?}: {message}"
    );
    assert!(
        !message.contains("Os {") && !message.contains("panicked"),
        "{command:?}: {message}"
    );
}

fn on_a_full_disk_the_former_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    let at = folder.path().join("disk");
    let disk = SmallDisk::new(&at, "64k");
    for (_, ending) in FILES {
        fs::write(at.join("file").with_extension(ending), "former").unwrap();
    }
    let _filler = disk.fill();
    let before = contents(&at);
    for (command, ending) in FILES {
        let path = at.join("file").with_extension(ending);
        let failed = given.replace(command, &path);
        names_file(&failed, command, &path);
        assert!(failed.stderr.contains("No space left"), "{}", failed.stderr);
        assert!(contents(&at) == before, "{command:?} changed the folder");
    }
}

fn a_file_that_exists_is_replaced_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    for (command, ending) in FILES {
        let path = folder.path().join("mine").with_extension(ending);
        fs::write(&path, "mine").unwrap();
        let refused = given.run(command, &path);
        names_file(&refused, command, &path);
        assert!(
            refused.stderr.contains("--force"),
            "{command:?}: {}",
            refused.stderr
        );
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine", "{command:?}");
        let replaced = given.replace(command, &path);
        assert_eq!(replaced.code, Some(0), "{command:?}: {}", replaced.stderr);
        assert_ne!(fs::read(&path).unwrap(), b"mine", "{command:?}");
        // Even with permission, a command does not replace a coordinator's own files.
        let data = folder.path().join("data");
        let (own, before) = (data.join("own").with_extension(ending), contents(&data));
        let refused = given.replace(command, &own);
        assert_eq!(refused.code, Some(2), "{command:?}: {}", refused.stderr);
        assert!(
            refused.stderr.contains("is in the data directory"),
            "{}",
            refused.stderr
        );
        assert!(contents(&data).keys().eq(before.keys()), "{command:?}");
    }
}

fn on_a_full_disk_a_folder_stays_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    let at = folder.path().join("disk");
    for (command, _) in FOLDERS {
        let disk = SmallDisk::new(&at, "96k");
        let path = at.join("folder");
        fs::create_dir(&path).unwrap();
        let failed = given.run(command, &path);
        names_file(&failed, command, &path);
        assert!(failed.stderr.contains("No space left"), "{}", failed.stderr);
        assert!(contents(&path).is_empty(), "{command:?} left files");
        drop(disk);
    }
    // Certificates are small, so this disk has room for only two certificates.
    let _disk = SmallDisk::new(&at, "8k");
    let failed = given.run(&["certs"], &at);
    names_file(&failed, &["certs"], &at);
    assert!(failed.stderr.contains("No space left"), "{}", failed.stderr);
    assert!(contents(&at).is_empty(), "certs left files");
}

fn what_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    for (command, ending) in FILES {
        // The test puts a folder in place of the file, and a file in place of the file's folder.
        let taken = folder.path().join("taken").with_extension(ending);
        fs::create_dir_all(&taken).unwrap();
        names_file(&given.run(command, &taken), command, &taken);
        let within = file.join("new").with_extension(ending);
        names_file(&given.run(command, &within), command, &within);
    }
    for (command, _) in FOLDERS {
        let failed = given.run(command, &file);
        assert_ne!(failed.code, Some(0));
        assert!(
            failed.stderr.contains(&file.display().to_string()),
            "{}",
            failed.stderr
        );
    }
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
}

fn a_folder_keeps_the_files_of_its_owner() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    for (command, name) in FOLDERS {
        let path = folder.path().join("notes");
        fs::create_dir(&path).unwrap();
        for (name, text) in [(name, "mine"), ("recall.csv", "mine"), ("richness.csv", "mine")] {
            fs::write(path.join(name), text).unwrap();
        }
        let before = contents(&path);
        let failed = given.run(command, &path);
        names_file(&failed, command, &path);
        assert!(contents(&path) == before, "{command:?} changed the folder");
        fs::remove_dir_all(&path).unwrap();
    }
    // A command replaces a report that its owner changed only on request.
    let path = folder.path().join("report");
    let report = |force: &[&str]| given.run(&[&["report", "latest"], force, &["--out"]].concat(), &path);
    assert_eq!(report(&[]).code, Some(0));
    assert_eq!(report(&[]).code, Some(0));
    fs::write(path.join("report.html"), "notes").unwrap();
    fs::write(path.join("recall.csv"), "mine").unwrap();
    let refused = report(&[]);
    assert!(
        refused.stderr.contains("report.html changed since"),
        "{}",
        refused.stderr
    );
    assert_eq!(fs::read_to_string(path.join("report.html")).unwrap(), "notes");
    assert_eq!(report(&["--force"]).code, Some(0));
    assert_eq!(fs::read_to_string(path.join("recall.csv")).unwrap(), "mine");
    // Another campaign's report replaces the first report completely.
    let spec = folder.path().join("trials.toml");
    fs::write(&spec, small_spec("[evaluation]\nstarts = 2").to_toml()).unwrap();
    assert_eq!(
        given.murmuration.run(&["run", &spec.display().to_string()]).code,
        Some(0)
    );
    assert_eq!(report(&[]).code, Some(0));
    assert!(path.join("trials.csv").is_file());
    let first = given.run(&["report", "small-1", "--out"], &path);
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    assert!(!path.join("trials.csv").exists());
    assert_eq!(fs::read_to_string(path.join("recall.csv")).unwrap(), "mine");
}

fn what_is_read_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let given = Given::in_folder(folder.path());
    let spec = folder.path().join("spec");
    fs::copy(&given.spec, &spec).unwrap();
    let before = fs::read(&spec).unwrap();
    let named = spec.display().to_string();
    for command in [
        &["simulate", CONTROLLER, "--spec", &named, "--png"][..],
        &["controller", "export", CONTROLLER, "--spec", &named, "--header"],
        &["robot", &named, "--svg"],
        &["evaluate", &named, "CONTROLLERS", "--out"],
        &["lab", "judge", "--labels", &named, "--measures"],
    ] {
        let refused = given.run(command, &spec);
        assert_eq!(refused.code, Some(2), "{command:?}: {}", refused.stderr);
        assert!(
            refused.stderr.contains("is a file that is read"),
            "{}",
            refused.stderr
        );
        assert!(
            fs::read(&spec).unwrap() == before,
            "{command:?} changed its input"
        );
    }
    // The command reads the file of starts beside the labels, although no argument names this file.
    let labels = folder.path().join("labels.csv").display().to_string();
    let starts = folder.path().join("starts.csv");
    fs::write(&starts, "mine").unwrap();
    let refused = given.run(&["lab", "judge", "--labels", &labels, "--measures"], &starts);
    assert!(
        refused.stderr.contains("is a file that is read"),
        "{}",
        refused.stderr
    );
    assert_eq!(fs::read_to_string(&starts).unwrap(), "mine");
    let twice = folder.path().join("twice");
    let png = twice.display().to_string();
    let refused = given.run(&["simulate", CONTROLLER, "--png", &png, "--gif"], &twice);
    assert!(
        refused.stderr.contains("is the file of another option"),
        "{}",
        refused.stderr
    );
    // Other processes may write to the same standard output.
    let shared = folder.path().join("shared");
    let program = murmuration_tests::binary("murmuration").display().to_string();
    let script = format!(
        "echo first >{0}; {program} simulate {CONTROLLER} --tracks /dev/stdout >>{0}; echo last >>{0}",
        shared.display()
    );
    let status = std::process::Command::new("sh").args(["-c", &script]).status();
    assert!(status.unwrap().success());
    let text = fs::read_to_string(&shared).unwrap();
    assert!(text.starts_with("first\n") && text.ends_with("last\n"), "{text}");
}
