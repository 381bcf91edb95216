//! Fuzzes the reader of OBJ.
#![no_main]

#[path = "../../tests/readers/mod.rs"]
#[expect(dead_code, reason = "one target calls one of them")]
mod readers;

libfuzzer_sys::fuzz_target!(|data: &[u8]| readers::obj(data));
