//! Novelty of successive generations while an archive grows, for callgrind; prints a digest of all novelty.
//!
//! Usage: `novelty_growth clumps|sheet DIMENSIONS POPULATION BEFORE AFTER TIMES`.

#![expect(clippy::print_stdout, reason = "the digest is printed")]

use murmuration_search::{
    interrupt::Interrupt,
    novelty::{Behaviours, Index},
};
use murmuration_swarm::{Purpose, RandomStream};
use rand::RngExt as _;
use std::{env, error::Error, hint::black_box};

type Failure = Box<dyn Error + Send + Sync>;

/// Default number of neighbours of a campaign.
const NEIGHBOURS: usize = 15;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [shape, numbers @ ..] = arguments.as_slice() else {
        return Err("usage: novelty_growth clumps|sheet DIMENSIONS POPULATION BEFORE AFTER TIMES".into());
    };
    let numbers: Vec<usize> = numbers
        .iter()
        .map(|number| number.parse())
        .collect::<Result<_, _>>()?;
    let [dims, population, before, after, times] = numbers[..] else {
        return Err("five numbers are needed after the shape".into());
    };
    let all = archive(shape, dims, after)?;
    // One thread, because waiting threads execute instructions too.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let digest = pool.install(|| grow(&all, before, population, times))?;
    println!("{digest:016x}");
    Ok(())
}

/// Twelve clumps of different widths that fill all dimensions, or a curved sheet of four dimensions.
fn archive(shape: &str, dims: usize, points: usize) -> Result<Behaviours, Failure> {
    let mut stream = RandomStream::derive(1, Purpose::Start, points as u64);
    let mut all = Behaviours::new(dims);
    for i in 0..points {
        let point = match shape {
            "clumps" => clumped((i % 12) as f64, dims, &mut stream),
            "sheet" => on_a_sheet(dims, &mut stream),
            _ => return Err(format!("{shape} is no shape").into()),
        };
        all.push(&point)?;
    }
    Ok(all)
}

fn clumped(clump: f64, dims: usize, stream: &mut RandomStream) -> Vec<f64> {
    let value = |d: usize| {
        let centre = (clump * (d + 1) as f64 * 0.37) % 1.0;
        centre + stream.random_range(-0.02..0.02) * (1.0 + clump)
    };
    (0..dims).map(value).collect()
}

fn on_a_sheet(dims: usize, stream: &mut RandomStream) -> Vec<f64> {
    let place: [f64; 4] = std::array::from_fn(|_| stream.random::<f64>() * 3.0);
    let value = |d: usize| {
        let phases = (0..4).map(|l| place[l] * ((d * 7 + l * 3) % 5) as f64 * 0.4);
        (phases.sum::<f64>() + d as f64).sin() + stream.random_range(-0.02..0.02)
    };
    (0..dims).map(value).collect()
}

/// Measures all generations from the individual `before` on, `times` times; a digest of their novelty.
fn grow(all: &Behaviours, before: usize, population: usize, times: usize) -> Result<u64, Failure> {
    let first = all.among(&(0..before).collect::<Vec<_>>());
    let mut begun = Index::new();
    begun.extend(&first);
    let mut digest = 0_u64;
    for _ in 0..times {
        let (mut grown, mut index) = (first.clone(), begun.clone());
        for start in (before..all.len()).step_by(population) {
            let newest = start..(start + population).min(all.len());
            for individual in newest.clone() {
                grown.push(all.point(individual).as_slice())?;
            }
            let novelty = index.novelty(&grown, newest, NEIGHBOURS, &Interrupt::default())?;
            for value in black_box(novelty) {
                digest = digest.rotate_left(5) ^ value.to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15);
            }
        }
    }
    Ok(digest)
}
