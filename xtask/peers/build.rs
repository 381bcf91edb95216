//! Links Embree 3 as the system has it.

fn main() {
    println!("cargo::rustc-link-lib=embree3");
    println!("cargo::rerun-if-changed=build.rs");
}
