//! The statements of MTL.

use std::io::BufRead;
use std::path::Path;

use super::context::Context;
use super::feed::{Fault, Feed, Rules};
use super::material::from_mtl;
use super::statements::{Statement, excerpt, finite};
use crate::SceneError;

/// Reads a library into the context.
pub(super) fn read(reader: impl BufRead, path: &Path, context: &mut Context) -> Result<(), SceneError> {
    let limit = context.limits.library_bytes;
    let line_limit = context.limits.line_bytes;
    let n_before = context.materials.len();
    // One byte more tells a library that is too large from one that just fits.
    let mut reader = reader.take(limit.saturating_add(1));
    let rules = MtlRules { path, context, place: Place::Before };
    let mut feed = Feed::new(&mut reader, path, line_limit, rules);
    let parsed = tobj::load_mtl_buf(&mut feed);
    let line = feed.line();
    let ((materials, _), MtlRules { context, .. }) = feed.finish(parsed)?;
    if reader.limit() == 0 {
        let message = format!("the library is longer than {limit} bytes");
        return Err(SceneError::Parse { path: path.into(), line, message });
    }
    for (material, (_, entry)) in materials.iter().zip(&mut context.materials[n_before..]) {
        *entry = from_mtl(material);
    }
    if context.materials.len() == n_before {
        context.warn(path, 0, "the library holds no material");
    }
    Ok(())
}

/// Where in a library a statement stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Before the first material, where it means nothing.
    Before,
    /// In a material.
    Inside,
    /// After a `newmtl` without a name, or after a warning that no material has begun.
    Nowhere,
}

/// The rules of MTL.
///
/// A material is called by its number when it is passed on: tobj knows no names.
#[derive(Debug)]
struct MtlRules<'a> {
    path: &'a Path,
    context: &'a mut Context,
    place: Place,
}

impl Rules for MtlRules<'_> {
    fn translate(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault> {
        let Statement { line, keyword, rest } = statement;
        if keyword == b"newmtl" {
            return self.new_material(line, rest, out);
        }
        match self.place {
            Place::Inside => {}
            Place::Nowhere => return Ok(()),
            Place::Before => {
                self.place = Place::Nowhere;
                self.warn(line, format!("`{}` ignored: no material has begun", excerpt(keyword)));
                return Ok(());
            }
        }
        let start = out.len();
        if let Err(problem) = self.value(statement, out) {
            out.truncate(start);
            self.warn(line, format!("`{}` ignored{problem}", excerpt(keyword)));
        }
        Ok(())
    }
}

impl MtlRules<'_> {
    fn warn(&mut self, line: usize, message: impl Into<String>) {
        self.context.warn(self.path, line, message);
    }

    fn new_material(&mut self, line: usize, name: &[u8], out: &mut Vec<u8>) -> Result<(), Fault> {
        if name.is_empty() {
            self.place = Place::Nowhere;
            self.warn(line, "`newmtl` needs a name: the material is ignored");
            return Ok(());
        }
        self.place = Place::Inside;
        out.extend_from_slice(format!("newmtl {}\n", self.context.materials.len()).as_bytes());
        if self.context.add_material(name)? {
            let name = excerpt(name);
            self.warn(line, format!("material `{name}` is defined again: from here on this one is meant"));
        }
        Ok(())
    }

    /// Writes a statement inside a material; if it cannot be read, the error says why.
    fn value(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), String> {
        let Statement { line, keyword, .. } = statement;
        match keyword {
            b"Kd" | b"Ks" | b"Ke" => self.color(statement, f64::INFINITY, out),
            b"Tf" => self.color(statement, 1.0, out),
            b"d" | b"Tr" => self.fraction(statement, out),
            b"Ns" | b"Ni" => {
                let number = number(statement.words().next())?;
                if number < 0.0 {
                    return Err(": it is negative".to_owned());
                }
                if keyword == b"Ni" && number <= 0.0 {
                    return Err(": an index of refraction is positive".to_owned());
                }
                self.write(statement, &[number], out);
                self.warn_of_rest(statement, 1);
                Ok(())
            }
            b"illum" => {
                let word = statement.words().next().ok_or(": it needs a number")?;
                let model = str::from_utf8(word).ok().and_then(|word| word.parse::<u8>().ok());
                let Some(model) = model.filter(|&model| model <= 10) else {
                    return Err(format!(": `{}` is no illumination model", excerpt(word)));
                };
                out.extend_from_slice(format!("illum {model}\n").as_bytes());
                self.warn_of_rest(statement, 1);
                Ok(())
            }
            // Ambient light is answered by the diffuse colour, and only maps of reflections are sharp or not.
            b"Ka" | b"sharpness" => Ok(()),
            _ if is_map(keyword) => {
                self.warn(line, format!("`{}` ignored: textures are not supported", excerpt(keyword)));
                Ok(())
            }
            _ => Err(String::new()),
        }
    }

    /// A colour of one to three numbers; green and blue default to red.
    fn color(&mut self, statement: Statement, max: f64, out: &mut Vec<u8>) -> Result<(), String> {
        let first = statement.words().next().unwrap_or_default();
        if matches!(first, b"spectral" | b"xyz") {
            return Err(format!(": only red, green and blue are read, not `{}`", excerpt(first)));
        }
        let mut color = [number(Some(first).filter(|word| !word.is_empty()))?; 3];
        for (i, word) in statement.words().take(3).enumerate() {
            color[i] = number(Some(word))?;
        }
        let clamped = color.map(|number| number.clamp(0.0, max));
        if color
            .iter()
            .zip(&clamped)
            .any(|(number, clamped)| number.total_cmp(clamped).is_ne() && *number != 0.0)
        {
            let keyword = excerpt(statement.keyword);
            let [r, g, b] = clamped;
            self.warn(statement.line, format!("`{keyword}` is out of range: {r} {g} {b} is used"));
        }
        self.write(statement, &clamped, out);
        self.warn_of_rest(statement, 3);
        Ok(())
    }

    /// A number from 0 to 1, of which the part of a halo is not read.
    fn fraction(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), String> {
        let is_halo = statement.words().next() == Some(b"-halo");
        let fraction = number(statement.words().nth(usize::from(is_halo)))?;
        let keyword = excerpt(statement.keyword);
        if is_halo {
            self.warn(statement.line, format!("`-halo` ignored: `{keyword}` is the same from everywhere"));
        }
        let clamped = fraction.clamp(0.0, 1.0);
        if !(0.0..=1.0).contains(&fraction) {
            self.warn(statement.line, format!("`{keyword}` is out of range: {clamped} is used"));
        }
        self.write(statement, &[clamped], out);
        self.warn_of_rest(statement, 1 + usize::from(is_halo));
        Ok(())
    }

    fn write(&self, statement: Statement, numbers: &[f64], out: &mut Vec<u8>) {
        out.extend_from_slice(statement.keyword);
        for number in numbers {
            out.extend_from_slice(format!(" {number:e}").as_bytes());
        }
        out.push(b'\n');
    }

    fn warn_of_rest(&mut self, statement: Statement, n_read: usize) {
        if let Some(word) = statement.words().nth(n_read) {
            let keyword = excerpt(statement.keyword);
            self.warn(statement.line, format!("`{}` ignored after the value of `{keyword}`", excerpt(word)));
        }
    }
}

fn number(word: Option<&[u8]>) -> Result<f64, String> {
    let word = word.ok_or(": it needs a number")?;
    finite(word).ok_or_else(|| format!(": `{}` is not a finite number", excerpt(word)))
}

fn is_map(keyword: &[u8]) -> bool {
    let keyword = keyword.to_ascii_lowercase();
    keyword.starts_with(b"map_")
        || [&b"bump"[..], b"disp", b"decal", b"refl", b"norm"].contains(&&keyword[..])
}
