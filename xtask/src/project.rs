//! Where things are, and how to call cargo.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Outcome;

/// The root of the workspace.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask stands in the workspace")
}

/// The folder of fixtures.
pub(crate) fn fixtures() -> PathBuf {
    root().join("fixtures")
}

/// The cargo that runs this, in the root of the workspace.
pub(crate) fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(arguments).current_dir(root());
    command
}

/// Runs a command; a status other than success is an error that names it.
pub(crate) fn run(command: &mut Command) -> Outcome {
    let status = command.status().map_err(|error| format!("cannot run {command:?}: {error}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?} failed with {status}").into()) }
}

/// Builds the command `rayset` and returns where it is.
pub(crate) fn rayset() -> Result<PathBuf, Box<dyn std::error::Error>> {
    let target = root().join("target");
    let mut build = cargo(&["build", "--release", "--quiet", "--package", "rayset-cli"]);
    run(build.env("CARGO_TARGET_DIR", &target))?;
    Ok(target.join("release").join(format!("rayset{}", std::env::consts::EXE_SUFFIX)))
}
