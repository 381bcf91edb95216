//! Runs of faces between `o`, `g` and `usemtl`: each becomes a group.

use std::collections::HashMap;
use std::path::Path;

use super::context::Context;
use super::statements::{Statement, excerpt, without_comment};

/// Memory for a run, which becomes an object, beside its name; roughly.
const RUN_BYTES: u64 = 512;

/// Memory for a name that is looked up later, beside the name; roughly.
const NAME_BYTES: u64 = 128;

/// The name of a run without one.
const UNNAMED: &str = "unnamed_object";

/// A run with faces.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) name: String,
    pub(super) material: Used,
    pub(super) triangles: usize,
}

/// What the last `usemtl` said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Used {
    /// No name, or there was none.
    Nothing,
    /// The material of this index.
    Known(usize),
    /// The name of this index in [`Runs::unknown`].
    Unknown(usize),
}

/// All runs, and what the next one is to be.
#[derive(Debug)]
pub(super) struct Runs {
    pub(super) all: Vec<Run>,
    /// Names that no library had defined when they were used, and the lines where they first were.
    unknown: Vec<(Vec<u8>, usize)>,
    by_name: HashMap<Vec<u8>, usize>,
    name: String,
    material: Used,
    /// Whether the next face begins a run.
    is_new: bool,
}

impl Default for Runs {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            unknown: Vec::new(),
            by_name: HashMap::new(),
            name: UNNAMED.to_owned(),
            material: Used::Nothing,
            is_new: true,
        }
    }
}

impl Runs {
    /// Ends the run; what follows is called `name`.
    pub(super) fn name(&mut self, name: &[u8]) {
        let name = without_comment(name);
        let is_comment = name.is_empty() || name[0] == b'#';
        self.name = if is_comment { UNNAMED.into() } else { String::from_utf8_lossy(name).into() };
        self.is_new = true;
    }

    /// Ends the run unless its material is the one of a `usemtl`; whether that has a name.
    pub(super) fn material(&mut self, usemtl: Statement, context: &mut Context) -> Result<bool, String> {
        let name = usemtl.rest;
        let known = context.material(name);
        let has_name = known.is_some() || !(name.is_empty() || name[0] == b'#');
        let used = match known {
            Some(index) => Used::Known(index),
            None if !has_name => Used::Nothing,
            None => match self.by_name.get(name) {
                Some(&index) => Used::Unknown(index),
                None => {
                    context.take(2 * name.len() as u64 + NAME_BYTES)?;
                    let index = self.unknown.len();
                    self.unknown.push((name.into(), usemtl.line));
                    self.by_name.insert(name.into(), index);
                    Used::Unknown(index)
                }
            },
        };
        self.is_new |= used != self.material;
        self.material = used;
        Ok(has_name)
    }

    /// Begins a run if there must be a new one for the next face, and says whether.
    pub(super) fn begin(&mut self, context: &mut Context) -> Result<bool, String> {
        if !self.is_new {
            return Ok(false);
        }
        context.take(RUN_BYTES + self.name.len() as u64)?;
        self.all.push(Run { name: self.name.clone(), material: self.material, triangles: 0 });
        self.is_new = false;
        Ok(true)
    }

    /// The index of the run begun last.
    pub(super) fn current(&self) -> usize {
        self.all.len() - 1
    }

    pub(super) fn add_triangles(&mut self, count: usize) {
        let current = self.current();
        self.all[current].triangles += count;
    }

    /// The materials of the names that were unknown, now that all libraries are read; warns of those still unknown.
    pub(super) fn resolve(&self, path: &Path, context: &mut Context) -> Vec<Option<usize>> {
        let mut resolve = |(name, line): &(Vec<u8>, usize)| {
            let index = context.material(name);
            if index.is_none() {
                let name = excerpt(without_comment(name));
                context.warn(path, *line, format!("no material `{name}`: the default is used"));
            }
            index
        };
        self.unknown.iter().map(&mut resolve).collect()
    }
}
