//! A scene file; what it refers to is not there.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use rayset_scene::{LoadOptions, read_toml};

fuzz_target!(|text: &str| {
    let mut options = LoadOptions::default();
    options.limits.memory_bytes = 16 << 20;
    options.limits.faces = 10_000;
    let _ = read_toml(text, Path::new("/nonexistent/fuzz.toml"), &options);
});
