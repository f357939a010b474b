#![no_main]
//! Fuzzes `edges::messages`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::edges::messages(bytes));
