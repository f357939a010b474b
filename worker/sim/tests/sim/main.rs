//! Tests of whole swarms: their bits on every instruction set, their features and pictures, and properties of their motion.
#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

mod bounds;
mod case;
mod case_species;
mod evaluate;
mod observed;
mod proptest_cases;
mod rasterise;
mod replay;
mod simulate;
