//! What is shared by an OBJ file and its libraries while they are read.

use std::collections::HashMap;
use std::path::Path;

use super::statements::without_comment;
use crate::warnings::Warnings;
use crate::{Limits, Material};

/// Memory for a material beside its name, while it is read; roughly.
const MATERIAL_BYTES: u64 = 1 << 10;

/// Warnings, materials, and what is left of the limits.
#[derive(Debug)]
pub(super) struct Context {
    pub(super) limits: Limits,
    pub(super) warnings: Warnings,
    pub(super) materials: Vec<(String, Material)>,
    memory: u64,
    /// By the bytes of their names.
    by_name: HashMap<Vec<u8>, Known>,
}

/// A name of a material.
#[derive(Clone, Copy, Debug)]
struct Known {
    index: usize,
    /// Whether it is a part of the name, which gives way to a whole one.
    is_part: bool,
}

impl Context {
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            warnings: Warnings::new(limits.warnings),
            materials: Vec::new(),
            memory: limits.memory_bytes,
            by_name: HashMap::new(),
        }
    }

    pub(super) fn warn(&mut self, path: &Path, line: usize, message: impl Into<String>) {
        self.warnings.push(path, line, message);
    }

    /// Takes memory from what the scene may have.
    pub(super) fn take(&mut self, bytes: u64) -> Result<(), String> {
        match self.memory.checked_sub(bytes) {
            Some(left) => {
                self.memory = left;
                Ok(())
            }
            None => {
                Err(format!("the scene would take more than {} bytes of memory", self.limits.memory_bytes))
            }
        }
    }

    /// Adds a material, which is the default until it is read; whether there was another of that name, which gives
    /// way.
    ///
    /// What looks like a comment may be part of the name: the material answers to both.
    pub(super) fn add_material(&mut self, name: &[u8]) -> Result<bool, String> {
        self.take(MATERIAL_BYTES + 4 * name.len() as u64)?;
        let index = self.materials.len();
        self.materials.push((String::from_utf8_lossy(name).into_owned(), Material::default()));
        let part = without_comment(name);
        if part.len() < name.len() {
            let known = self.by_name.entry(part.into()).or_insert(Known { index, is_part: true });
            if known.is_part {
                known.index = index;
            }
        }
        let before = self.by_name.insert(name.into(), Known { index, is_part: false });
        Ok(before.is_some_and(|known| !known.is_part))
    }

    /// The index of the material of a name; of the name without a comment if the whole is unknown.
    pub(super) fn material(&self, name: &[u8]) -> Option<usize> {
        let known = self.by_name.get(name).or_else(|| self.by_name.get(without_comment(name)))?;
        Some(known.index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn context(names: &[&str]) -> Context {
        let mut context = Context::new(Limits::default());
        for name in names {
            context.add_material(name.as_bytes()).unwrap();
        }
        context
    }

    #[test]
    fn names_are_matched_whole_and_then_without_comment() {
        let names =
            context(&["Material #25", "Material #26", "red # warm", "red", "blue", "green", "green # pale"]);
        for (name, index) in [
            ("Material #25", Some(0)),
            ("Material #26", Some(1)),
            ("Material", Some(1)),
            ("red", Some(3)),
            ("red # warm", Some(2)),
            ("red # cold", Some(3)),
            ("blue # cold", Some(4)),
            ("green", Some(5)),
            ("Red", None),
            ("", None),
        ] {
            assert_eq!(names.material(name.as_bytes()), index, "{name}");
        }
    }

    #[test]
    fn later_material_of_a_name_counts() {
        let mut names = context(&["a # 1"]);
        assert!(!names.add_material(b"a").unwrap());
        assert!(names.add_material(b"a").unwrap());
        assert_eq!(names.material(b"a"), Some(2));
    }

    #[test]
    fn memory_is_limited() {
        let mut context = Context::new(Limits { memory_bytes: 10, ..Limits::default() });
        assert_eq!(context.take(10), Ok(()));
        assert_eq!(context.take(1), Err("the scene would take more than 10 bytes of memory".to_owned()));
        assert!(context.add_material(b"a").is_err());
    }
}
