//! Tests of a whole cluster on this machine, in one process or as the real programs. These tests need only this repository and
//! ONNX Runtime (`make runtime`).

mod accuracy;
mod atlas;
mod channels;
mod command_line;
mod evaluations;
mod feedback;
mod fuzz_targets;
mod golden;
mod golden_robots;
mod integrity;
mod interruption;
mod judge;
mod labels;
mod latent;
mod nodes;
mod observability;
mod playing;
mod recall;
mod recognise;
mod search;
mod security;
mod stages;
mod studies;
mod teaching;
mod transfers;
mod trials;
mod web;
mod wire;
