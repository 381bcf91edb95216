//! A scene in the Neutral File Format.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use rayset_scene::{LoadOptions, read_nff};

fuzz_target!(|data: &[u8]| {
    let mut options = LoadOptions::default();
    options.limits.memory_bytes = 64 << 20;
    let _ = read_nff(data, Path::new("fuzz.nff"), &options);
});
