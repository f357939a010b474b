#![no_main]
//! Fuzzes `edges::labels_csv`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::edges::labels_csv(bytes));
