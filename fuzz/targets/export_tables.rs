#![no_main]
//! Fuzzes `fuzz_targets::export_tables`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::export_tables(bytes));
