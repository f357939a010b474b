//! Writes the inputs that fuzzing begins with (scripts/fuzz): `seeds FOLDER` makes a folder for each target there.

use std::{env, fs, path::PathBuf};

fn main() {
    let folder = PathBuf::from(env::args_os().nth(1).expect("usage: seeds FOLDER"));
    for edge in murmuration_tests::fuzz_targets::EDGES {
        let folder = folder.join(edge.name);
        fs::create_dir_all(&folder).expect("the folder can be made");
        for (number, seed) in (edge.seeds)().iter().enumerate() {
            fs::write(folder.join(format!("seed-{number}")), seed).expect("the folder can be written");
        }
    }
}
