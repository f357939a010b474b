#![no_main]
//! Fuzzes `edges::case_json`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::edges::case_json(bytes));
