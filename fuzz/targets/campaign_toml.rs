#![no_main]
//! Fuzzes `edges::campaign_toml`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| murmuration_tests::edges::campaign_toml(bytes));
