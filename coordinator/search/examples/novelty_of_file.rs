//! Computes the novelty of points in a file, and measures the time, for `benches/novelty_against_scikit_learn.py`.
//!
//! Arguments: a file of points (numbers of 8 bytes, little-endian, point after point), the number of dimensions, the number of
//! last points whose novelty is computed, k, and the output file for the novelty in the same format. Prints the seconds for
//! the index and for the queries.

#![expect(clippy::print_stdout, reason = "what it prints is its result")]

use murmuration_search::{
    interrupt::Interrupt,
    novelty::{Behaviours, Index},
};
use std::{env, error::Error, fs, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [points, dims, queries, k, novelty] = arguments.as_slice() else {
        return Err("usage: novelty_of_file POINTS DIMENSIONS QUERIES K NOVELTY".into());
    };
    let (dims, queries, k): (usize, usize, usize) = (dims.parse()?, queries.parse()?, k.parse()?);
    let bytes = fs::read(points)?;
    let values: Vec<f64> = bytes
        .as_chunks()
        .0
        .iter()
        .map(|&value| f64::from_le_bytes(value))
        .collect();
    let mut behaviours = Behaviours::new(dims);
    for point in values.chunks_exact(dims) {
        behaviours.push(point)?;
    }
    let begun = Instant::now();
    let mut index = Index::new();
    index.extend(&behaviours);
    let built = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let newest = behaviours.len().saturating_sub(queries)..behaviours.len();
    let found = index.novelty(&behaviours, newest, k, &Interrupt::default())?;
    println!("{built} {}", begun.elapsed().as_secs_f64());
    let bytes: Vec<u8> = found.iter().flat_map(|value| value.to_le_bytes()).collect();
    fs::write(novelty, bytes)?;
    Ok(())
}
