#![no_main]
//! Fuzzes `fuzz_targets::checkpoint`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::checkpoint(bytes));
