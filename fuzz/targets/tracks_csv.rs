#![no_main]
//! Fuzzes `fuzz_targets::tracks_csv`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::tracks_csv(bytes));
