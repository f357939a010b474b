//! The pages in a real browser: what people do with keys and pointer, and what they see.
//!
//! Needs Chromium and its driver (`scripts/browser` says how to have them); without, each test says so and does nothing.
//! Pictures of every page land in `target/screenshots`, to be looked at.

mod driver;
mod labelling;
mod learning;
mod leaving;
mod looks;
mod scene;
mod selecting;
