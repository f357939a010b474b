//! Connects many workers, each from an address of its own, and keeps them connected. Measures how long they take to connect.
//!
//! The workers send heartbeats and take no work. `docs/scale.md` has the figures. Usage: many_machines URL WORKERS SECONDS

use murmuration_proto::v1::{self, worker_message::Message};
use murmuration_tests::FakeWorker;
use std::{
    env,
    time::{Duration, Instant},
};
use tokio::task::JoinSet;

/// Number of workers that connect at once.
const AT_ONCE: usize = 64;

/// Time between two heartbeats of a worker.
const INTERVAL: Duration = Duration::from_secs(1);

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [url, workers, seconds] = arguments.as_slice() else {
        return Err("usage: many_machines URL WORKERS SECONDS".into());
    };
    let (workers, seconds): (usize, u64) = (workers.parse()?, seconds.parse()?);
    let begun = Instant::now();
    let mut connecting = JoinSet::new();
    let mut connected = JoinSet::new();
    for _ in 0..workers {
        if connecting.len() == AT_ONCE
            && let Some(worker) = connecting.join_next().await
        {
            connected.spawn(beat(worker?));
        }
        let url = url.clone();
        connecting.spawn(async move { FakeWorker::connect(&url).await });
    }
    while let Some(worker) = connecting.join_next().await {
        connected.spawn(beat(worker?));
    }
    println!(
        "{} workers connected in {:.1} s",
        connected.len(),
        begun.elapsed().as_secs_f64()
    );
    tokio::time::sleep(Duration::from_secs(seconds)).await;
    let mut lost = 0;
    while let Some(ended) = connected.try_join_next() {
        ended?;
        lost += 1;
    }
    println!("{lost} of them were lost within {seconds} s");
    Ok(())
}

/// Sends heartbeats until the coordinator ends the stream.
async fn beat(mut worker: FakeWorker) {
    let mut beat = tokio::time::interval(INTERVAL);
    loop {
        tokio::select! {
            message = worker.receive() => {
                if !matches!(message, Ok(Some(_))) {
                    return;
                }
            }
            _ = beat.tick() => worker.send(Message::Heartbeat(v1::Heartbeat {})).await,
        }
    }
}
