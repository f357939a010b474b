#![no_main]
//! Fuzzes `edges::checkpoint`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::edges::checkpoint(bytes));
