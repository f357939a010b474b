//! Tests with Python programs: one program runs checkpoints, the other is a coordinator's client. `make test` fetches the
//! packages that these programs need; without the packages, the tests are ignored.

mod checkpoints;
mod client;

use murmuration_tests::{Requirement, Test, test};

pub fn tests() -> Vec<Test> {
    vec![
        test!(checkpoints::python_runs_the_compact_network).needs(Requirement::Python("onnxruntime")),
        test!(checkpoints::python_runs_the_papers_network).needs(Requirement::Python("onnxruntime")),
        test!(client::python_submits_and_watches_a_campaign_over_tls_with_a_token)
            .needs(Requirement::Python("grpc, grpc_tools")),
    ]
}
