#![no_main]
//! Fuzzes `fuzz_targets::messages`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::messages(bytes));
