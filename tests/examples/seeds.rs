//! Writes the seed inputs of the fuzz targets (scripts/fuzz): `seeds FOLDER` writes a folder for each target.

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
