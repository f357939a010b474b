//! The trainer's binary.

use clap::Parser;
use std::{net::SocketAddr, process::ExitCode};
use tonic::transport::Server;

/// Trains embedders for a Murmuration coordinator. This version has no training jobs yet: it answers health
/// checks (as not serving) until it is stopped.
#[derive(Debug, Parser)]
#[command(name = "murmuration-trainer", version)]
struct Arguments {
    /// Where to answer health checks
    #[arg(long, default_value = "127.0.0.1:7710")]
    listen: SocketAddr,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let Arguments { listen } = Arguments::parse();
    let (reporter, health) = tonic_health::server::health_reporter();
    reporter
        .set_service_status("", tonic_health::ServingStatus::NotServing)
        .await;
    let stopped = async {
        // Without a way to hear of Ctrl-C it runs until killed.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    match Server::builder()
        .add_service(health)
        .serve_with_shutdown(listen, stopped)
        .await
    {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: cannot serve on {listen}: {error}");
            ExitCode::FAILURE
        }
    }
}
