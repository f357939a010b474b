#![no_main]
//! Fuzzes `fuzz_targets::case_json`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::case_json(bytes));
