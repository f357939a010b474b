//! Dependencies: a crate depends only on crates of lower floors, and modules of a crate have no dependency cycles.

mod code;
mod rings;

use code::Crate;
use murmuration_tests::pages::root;
use rings::rings;
use std::{collections::BTreeMap, fs};

/// The floor of each crate, by its folder. A crate depends only on crates of lower floors; this rule includes tests, benchmarks
/// and build scripts.
pub const FLOORS: &[(&str, u8)] = &[
    ("proto", 0),
    ("worker/swarm", 1),
    ("worker/onnx", 2),
    ("worker/judge", 2),
    ("worker/embed", 3),
    ("worker/files", 3),
    ("worker/link", 4),
    ("worker/sim", 4),
    ("trainer/train", 4),
    ("coordinator/search", 4),
    ("worker", 5),
    ("trainer", 5),
    ("coordinator/tsne", 5),
    ("coordinator/model", 5),
    ("coordinator/accuracy", 6),
    ("coordinator/tracks", 6),
    ("coordinator/store", 6),
    ("coordinator/dispatch", 7),
    ("coordinator/report", 7),
    ("coordinator/export", 7),
    ("coordinator/access", 7),
    ("coordinator/engine", 8),
    ("coordinator/study", 8),
    ("coordinator/service", 9),
    ("coordinator/web", 10),
    ("coordinator", 11),
    ("coordinator/cli", 12),
    ("coordinator/lab", 13),
    ("coordinator/program", 14),
    ("tests", 15),
];

/// Dependency cycles that still exist: `CRATE[::PARENT]: MODULES`, in alphabetical order.
const RINGS: &[&str] = &[];

pub fn no_crate_knows_one_of_its_floor_or_above() {
    let floors: BTreeMap<String, u8> = FLOORS
        .iter()
        .map(|(folder, floor)| (name(folder), *floor))
        .collect();
    assert_eq!(floors.len(), FLOORS.len());
    assert_eq!(
        members(),
        FLOORS.iter().map(|(folder, _)| *folder).collect::<Vec<_>>(),
        "the members of the workspace, from the lowest floor up"
    );
    for (folder, floor) in FLOORS {
        for dependency in dependencies(folder) {
            if let Some(below) = floors.get(&dependency) {
                assert!(
                    below < floor,
                    "{folder} is on floor {floor} and depends on {dependency}, on floor {below}"
                );
            }
        }
    }
}

pub fn no_modules_know_each_other_in_a_ring() {
    let mut found = Vec::new();
    for (folder, _) in FLOORS {
        let code = Crate::read(&root().join(folder).join("src"));
        assert!(!code.modules.is_empty(), "{folder}");
        for (parent, ring) in rings(&code) {
            let path = [*folder, &parent].into_iter().filter(|part| !part.is_empty());
            let path: Vec<&str> = path.collect();
            found.push(format!("{}: {}", path.join("::"), ring.join(" ")));
        }
    }
    assert_eq!(found, RINGS, "rings found (left), rings that are allowed (right)");
}

/// Checks that the test finds cycles, also through re-exported names, and ignores test code.
pub fn rings_are_found() {
    let files = |files: &[(&str, &str)]| {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        rings(&Crate::read(folder.path()))
    };
    let ring = |parent: &str, modules: &[&str]| {
        (
            parent.to_owned(),
            modules.iter().map(|module| (*module).to_owned()).collect(),
        )
    };
    let lib = ("lib.rs", "mod a; mod b; mod c;");
    let straight = [
        lib,
        ("a.rs", "use crate::{b::B, c::{self, C}}; fn f() { c::g() }"),
        (
            "b.rs",
            "pub struct B; #[cfg(test)] mod tests { use crate::a::A; }",
        ),
        ("c.rs", "use super::b;"),
    ];
    assert_eq!(files(&straight), []);
    let plain = [
        lib,
        ("a.rs", "use crate::b::B; pub struct A;"),
        ("b.rs", "fn f() { crate::c::g() }"),
        ("c.rs", "use super::a;"),
    ];
    assert_eq!(files(&plain), [ring("", &["a", "b", "c"])]);
    let nested = [
        ("lib.rs", "mod inner;"),
        ("inner/mod.rs", "mod x; mod y; pub use x::X; use y::Y;"),
        ("inner/x.rs", "fn f(y: super::Y) {} pub struct X;"),
        ("inner/y.rs", "use crate::inner::X; pub struct Y;"),
    ];
    assert_eq!(files(&nested), [ring("inner", &["x", "y"])]);
}

fn name(folder: &str) -> String {
    let manifest = manifest(folder);
    manifest["package"]["name"].as_str().unwrap().to_owned()
}

/// All dependencies of the package in `folder`.
fn dependencies(folder: &str) -> Vec<String> {
    let manifest = manifest(folder);
    ["dependencies", "dev-dependencies", "build-dependencies"]
        .iter()
        .filter_map(|section| manifest.get(*section)?.as_table())
        .flat_map(|table| table.keys().cloned())
        .collect()
}

/// The members of the workspace, from the lowest floor up.
fn members() -> Vec<String> {
    let manifest = manifest("");
    let members = manifest["workspace"]["members"].as_array().unwrap();
    members
        .iter()
        .map(|member| member.as_str().unwrap().to_owned())
        .collect()
}

fn manifest(folder: &str) -> toml::Table {
    let path = root().join(folder).join("Cargo.toml");
    fs::read_to_string(path).unwrap().parse().unwrap()
}
