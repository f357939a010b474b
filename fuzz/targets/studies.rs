#![no_main]
//! Fuzzes `fuzz_targets::studies`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::studies(bytes));
