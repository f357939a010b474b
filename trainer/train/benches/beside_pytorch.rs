//! Compares a training step of the default recipe and network (256 anchors and as many positives, pictures of 50 x 50) with
//! PyTorch's step of the same network and loss. Steps alternate, so that other load on the machine affects all steps alike. Each
//! figure is the best of its rounds.
//!
//! Our step includes augmentation; PyTorch's step starts from finished pictures. `PYTHON` names a Python interpreter that has
//! torch. Without torch, only our figures are printed. `ROUNDS` is the number of rounds.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]
#![expect(clippy::print_stdout, reason = "what it prints is what it is for")]

use murmuration_train::bench::Steps;
use rustix::time::{ClockId, clock_gettime};
use serde_json::from_str;
use std::{
    env,
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

/// Seconds of wall time and of CPU time.
type Times = [f64; 2];

fn main() {
    let rounds: u32 = env::var("ROUNDS").map_or(15, |rounds| rounds.parse().unwrap());
    println!(
        "{:<10} {:<32} {:>9} {:>9} | x ours: {:>5} {:>5}",
        "THREADS", "STEP", "WALL, MS", "CPU, MS", "WALL", "CPU"
    );
    for threads in [1, 2] {
        let rows = measured(threads, rounds);
        let ours = rows[0].1;
        for (name, [wall, cpu]) in &rows {
            println!(
                "{threads:<10} {name:<32} {:>9.1} {:>9.1} |         {:>5.2} {:>5.2}",
                wall * 1e3,
                cpu * 1e3,
                wall / ours[0],
                cpu / ours[1]
            );
        }
    }
}

/// Least wall time and least CPU time of our step and of each of PyTorch's steps, over the rounds.
fn measured(threads: usize, rounds: u32) -> Vec<(String, Times)> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let pool = pool.build().unwrap();
    let mut ours = Steps::new(256).unwrap();
    let mut pytorch = PyTorch::start(threads);
    let mut rows = vec![("murmuration".to_owned(), [f64::INFINITY; 2])];
    let ways = pytorch.iter().flat_map(|pytorch| &pytorch.ways);
    rows.extend(ways.map(|way| (way.clone(), [f64::INFINITY; 2])));
    for _ in 0..rounds {
        let mut took = vec![timed(|| pool.install(|| ours.step()))];
        took.extend(pytorch.iter_mut().flat_map(PyTorch::round));
        for ((_, best), took) in rows.iter_mut().zip(took) {
            *best = [best[0].min(took[0]), best[1].min(took[1])];
        }
    }
    rows
}

/// The CPU time includes all threads of this process.
fn timed(work: impl FnOnce()) -> Times {
    let now = |clock| {
        let now = clock_gettime(clock);
        now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
    };
    let clocks = [ClockId::Monotonic, ClockId::ProcessCPUTime];
    let begun = clocks.map(now);
    work();
    let ended = clocks.map(now);
    [ended[0] - begun[0], ended[1] - begun[1]]
}

/// A Python process that runs PyTorch's training steps.
struct PyTorch {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    ways: Vec<String>,
}

impl PyTorch {
    /// Starts the Python process; `None` if PyTorch is not installed.
    fn start(threads: usize) -> Option<Self> {
        let python = env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/pytorch_step.py");
        let mut process = Command::new(python)
            .args([script, &threads.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (to, from) = (process.stdin.take()?, BufReader::new(process.stdout.take()?));
        let mut pytorch = Self {
            process,
            to,
            from,
            ways: Vec::new(),
        };
        let (version, ways): (String, Vec<String>) = from_str(&pytorch.line()?).ok()?;
        pytorch.ways = ways
            .iter()
            .map(|way| format!("PyTorch {version}, {way}"))
            .collect();
        Some(pytorch)
    }

    fn line(&mut self) -> Option<String> {
        let mut line = String::new();
        let read = self.from.read_line(&mut line).ok()?;
        (read > 0).then_some(line)
    }

    fn round(&mut self) -> Vec<Times> {
        writeln!(self.to).unwrap();
        from_str(&self.line().unwrap()).unwrap()
    }
}

impl Drop for PyTorch {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
