//! Reading a scene as the command line asks for it.

use std::error::Error;
use std::path::PathBuf;

use rayset::scene::{LoadOptions, LoadedScene, load_scene};

use crate::values::Limit;

/// The scene and how it is read.
#[derive(clap::Args)]
pub(crate) struct Source {
    /// The scene: a .toml, .nff, .nff.gz or .obj file.
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// Lets the scene name files outside its own folder.
    #[arg(long)]
    allow_outside: bool,
    /// Splits objects spatially, so that no bounding volume holds more than N primitives.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    split: Option<u32>,
    /// Takes all surfaces of an NFF file as two-sided, even opaque ones.
    #[arg(long)]
    two_sided: bool,
    /// Changes how much a file may ask for: line-bytes, faces, corners, library-bytes, memory-bytes or warnings.
    #[arg(long, value_name = "NAME=NUMBER")]
    limit: Vec<Limit>,
}

impl Source {
    /// Reads the scene and prints its warnings.
    pub(crate) fn load(&self) -> Result<LoadedScene, Box<dyn Error>> {
        let mut options = LoadOptions {
            allow_outside: self.allow_outside,
            max_volume_primitives: self.split,
            two_sided: self.two_sided,
            ..LoadOptions::default()
        };
        for limit in &self.limit {
            limit.apply(&mut options.limits);
        }
        let loaded = load_scene(&self.scene, &options)?;
        for warning in &loaded.warnings {
            eprintln!("warning: {warning}");
        }
        Ok(loaded)
    }
}
