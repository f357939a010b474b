#![no_main]
//! Fuzzes `fuzz_targets::campaign_database`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::fuzz_targets::campaign_database(bytes));
