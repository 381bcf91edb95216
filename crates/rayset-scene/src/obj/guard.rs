//! Reads a file line by line ahead of tobj, and passes on only what tobj reads rightly.
//!
//! One line at a time is held; its number is known when tobj asks for it, so every error has its place.

use std::cell::RefCell;
use std::collections::HashSet;
use std::io::{self, BufRead, Read};
use std::path::{Component, Path, PathBuf};
use std::str::SplitWhitespace;

use crate::{MAX_COORDINATE, SceneError, Warning};

/// At most this many warnings are kept.
const MAX_WARNINGS: usize = 100;

/// A longer line is refused.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// What the guards of one model have found.
#[derive(Default)]
pub(super) struct Report {
    /// The first error.
    pub(super) error: Option<SceneError>,
    pub(super) warnings: Vec<Warning>,
    /// The names of all materials.
    materials: HashSet<String>,
}

impl Report {
    pub(super) fn fail(&mut self, error: SceneError) {
        self.error.get_or_insert(error);
    }
}

/// What to do with a line.
pub(super) enum Verdict {
    /// Pass it on.
    Keep,
    /// Pass this on instead.
    Replace(String),
    /// Leave it out.
    Drop,
    /// Leave it out, with a warning.
    Warn(String),
    /// Pass this on instead, with a warning.
    ReplaceAndWarn(String, String),
}

/// The rules of a format: judges one line of it.
pub(super) trait Rules {
    /// Lines to pass on before the first of the file.
    const PROLOGUE: &'static str = "";

    fn judge(&mut self, line: &str, report: &mut Report) -> Result<Verdict, String>;
}

/// A reader of the lines that its rules let through.
pub(super) struct Guard<'r, R, L> {
    inner: R,
    path: PathBuf,
    report: &'r RefCell<Report>,
    rules: L,
    buffer: Vec<u8>,
    consumed: usize,
    line: usize,
}

impl<'r, R: BufRead, L: Rules> Guard<'r, R, L> {
    pub(super) fn new(inner: R, path: &Path, report: &'r RefCell<Report>, rules: L) -> Self {
        Self { inner, path: path.into(), report, rules, buffer: L::PROLOGUE.into(), consumed: 0, line: 0 }
    }

    /// The number of the line passed on last, counted from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Fills the buffer with the next line that is kept; leaves it empty at the end.
    fn next_line(&mut self) -> io::Result<()> {
        loop {
            self.buffer.clear();
            self.consumed = 0;
            let mut raw = Vec::new();
            let read = (&mut self.inner).take(MAX_LINE_BYTES).read_until(b'\n', &mut raw);
            let read = read.map_err(|source| {
                let error = SceneError::Read { path: self.path.clone(), source };
                self.fail(error)
            })?;
            if read == 0 {
                return Ok(());
            }
            self.line += 1;
            if raw.len() as u64 == MAX_LINE_BYTES {
                return Err(self.refuse(format!("the line is longer than {MAX_LINE_BYTES} bytes")));
            }
            let text = String::from_utf8_lossy(&raw);
            let text = text.trim();
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            let verdict = self.rules.judge(text, &mut self.report.borrow_mut());
            match verdict {
                Ok(Verdict::Keep) => self.buffer.extend_from_slice(text.as_bytes()),
                Ok(Verdict::Replace(other)) => self.buffer.extend_from_slice(other.as_bytes()),
                Ok(Verdict::Drop) => continue,
                Ok(Verdict::Warn(message)) => {
                    self.warn(message);
                    continue;
                }
                Ok(Verdict::ReplaceAndWarn(other, message)) => {
                    self.warn(message);
                    self.buffer.extend_from_slice(other.as_bytes());
                }
                Err(message) => return Err(self.refuse(message)),
            }
            self.buffer.push(b'\n');
            return Ok(());
        }
    }

    fn warn(&self, message: String) {
        let warnings = &mut self.report.borrow_mut().warnings;
        if warnings.len() < MAX_WARNINGS {
            warnings.push(Warning { path: self.path.clone(), line: self.line, message });
        }
    }

    fn refuse(&self, message: String) -> io::Error {
        self.fail(SceneError::Parse { path: self.path.clone(), line: self.line, message })
    }

    /// Notes an error; what is returned only makes tobj stop.
    fn fail(&self, error: SceneError) -> io::Error {
        self.report.borrow_mut().fail(error);
        io::Error::from(io::ErrorKind::InvalidData)
    }
}

impl<R: BufRead, L: Rules> Read for Guard<'_, R, L> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(out)?;
        self.consume(read);
        Ok(read)
    }
}

impl<R: BufRead, L: Rules> BufRead for Guard<'_, R, L> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.consumed == self.buffer.len() {
            self.next_line()?;
        }
        Ok(&self.buffer[self.consumed..])
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount;
    }
}

/// The rules of OBJ.
#[derive(Default)]
pub(super) struct ObjRules {
    n_vertices: u64,
    n_texture_coordinates: u64,
    n_normals: u64,
}

impl Rules for ObjRules {
    /// A normal of its own for the corners that have none: tobj shifts the normals of a group where some are missing.
    const PROLOGUE: &'static str = "vn 0 0 0\n";

    fn judge(&mut self, line: &str, report: &mut Report) -> Result<Verdict, String> {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        match keyword {
            "v" => {
                self.n_vertices += 1;
                let numbers = finite_numbers(keyword, words, 3)?;
                if let Some(large) = numbers.iter().find(|(_, value)| value.abs() > MAX_COORDINATE) {
                    return Err(format!("`{}` exceeds 1e60", large.0));
                }
                // Colours and weights after the position are left out: tobj would divide by the weight.
                let [x, y, z] = [0, 1, 2].map(|i| numbers[i].0);
                Ok(Verdict::Replace(format!("v {x} {y} {z}")))
            }
            "vn" => {
                self.n_normals += 1;
                finite_numbers(keyword, words, 3)?;
                Ok(Verdict::Keep)
            }
            "vt" => {
                // They are never read, but indices into them must be in range.
                self.n_texture_coordinates += 1;
                Ok(Verdict::Drop)
            }
            "f" => self.face(words).map(Verdict::Replace),
            "o" | "g" => Ok(Verdict::Keep),
            "usemtl" => {
                let name = line[keyword.len()..].trim();
                match name {
                    "" => Err("`usemtl` needs a name".to_owned()),
                    _ if report.materials.contains(name) => Ok(Verdict::Replace(format!("usemtl {name}"))),
                    // Passed on, since it ends the run of the material before.
                    _ => Ok(Verdict::ReplaceAndWarn(
                        format!("usemtl {name}"),
                        format!("no material `{name}`: the default is used"),
                    )),
                }
            }
            "mtllib" => {
                let library = line[keyword.len()..].trim();
                let inside = Path::new(library).components().all(|part| matches!(part, Component::Normal(_)));
                if inside && !library.is_empty() {
                    Ok(Verdict::Replace(format!("mtllib {library}")))
                } else {
                    Ok(Verdict::Warn(format!("`{library}` ignored: it lies outside the folder of the scene")))
                }
            }
            "s" => Ok(Verdict::Drop),
            "l" | "p" => Ok(Verdict::Warn(format!("`{keyword}` ignored: only faces are read"))),
            _ => Ok(Verdict::Warn(format!("`{}` ignored", excerpt(keyword)))),
        }
    }
}

impl ObjRules {
    /// A face with every index checked and made positive, without texture coordinates, with a normal a corner.
    fn face(&self, words: SplitWhitespace) -> Result<String, String> {
        let mut face = String::from("f");
        let mut n_corners = 0;
        let mut all_have_normals = true;
        let mut normals = Vec::new();
        let mut vertices = Vec::new();
        for corner in words.take_while(|word| !word.starts_with('#')) {
            let mut indices = corner.splitn(3, '/');
            let mut index = |what: &str, count: u64| match indices.next() {
                None | Some("") => Ok(None),
                Some(text) => resolve(text, what, count).map(Some),
            };
            let vertex = index("vertex", self.n_vertices)?;
            index("texture coordinate", self.n_texture_coordinates)?;
            let normal = index("normal", self.n_normals)?;
            vertices.push(vertex.ok_or_else(|| format!("`{}` is not an index", excerpt(corner)))?);
            all_have_normals &= normal.is_some();
            normals.push(normal.unwrap_or(0));
            n_corners += 1;
        }
        if n_corners < 3 {
            return Err("a face needs 3 corners".to_owned());
        }
        for (vertex, normal) in vertices.iter().zip(&normals) {
            // The first normal is the one of the prologue.
            let normal = if all_have_normals { normal + 1 } else { 1 };
            face += &format!(" {vertex}//{normal}");
        }
        Ok(face)
    }
}

/// The index counted from 1, of one that may be counted backwards from -1.
fn resolve(text: &str, what: &str, count: u64) -> Result<u64, String> {
    let index: i64 = text.parse().map_err(|_| format!("`{}` is not an index", excerpt(text)))?;
    let forwards = match u64::try_from(index) {
        Ok(index) => Some(index),
        Err(_) => count.checked_sub(index.unsigned_abs()).map(|i| i + 1),
    };
    forwards
        .filter(|index| (1..=count).contains(index))
        .ok_or_else(|| format!("{what} {index} is out of range: there are {count}"))
}

/// The rules of MTL.
#[derive(Default)]
pub(super) struct MtlRules {
    has_material: bool,
}

impl Rules for MtlRules {
    fn judge(&mut self, line: &str, report: &mut Report) -> Result<Verdict, String> {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        if keyword == "newmtl" {
            let name = line[keyword.len()..].trim();
            if name.is_empty() {
                return Err("`newmtl` needs a name".to_owned());
            }
            self.has_material = true;
            report.materials.insert(name.to_owned());
            return Ok(Verdict::Replace(format!("newmtl {name}")));
        }
        if !self.has_material {
            return Ok(Verdict::Warn(format!("`{}` ignored: no material has begun", excerpt(keyword))));
        }
        match keyword {
            "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => {
                let numbers = finite_numbers(keyword, words, 1)?;
                // One number is a grey; green and blue default to red.
                let [r, g, b] = [0, 1, 2].map(|i| numbers.get(i).unwrap_or(&numbers[0]).0);
                Ok(Verdict::Replace(format!("{keyword} {r} {g} {b}")))
            }
            "Ns" | "Ni" | "d" | "Tr" => {
                let numbers = finite_numbers(keyword, words, 1)?;
                Ok(Verdict::Replace(format!("{keyword} {}", numbers[0].0)))
            }
            "illum" => {
                let model = words.next().unwrap_or_default();
                match model.parse::<u8>() {
                    Ok(number) if number <= 10 => Ok(Verdict::Replace(format!("illum {number}"))),
                    _ => Err(format!("`{}` is not an illumination model", excerpt(model))),
                }
            }
            _ if is_map(keyword) => {
                Ok(Verdict::Warn(format!("`{}` ignored: textures are not supported", excerpt(keyword))))
            }
            _ => Ok(Verdict::Drop),
        }
    }
}

fn is_map(keyword: &str) -> bool {
    let keyword = keyword.to_ascii_lowercase();
    keyword.starts_with("map_") || ["bump", "disp", "decal", "refl", "norm"].contains(&keyword.as_str())
}

/// The leading numbers of a statement, at least `least` of them, with the text they were read from.
fn finite_numbers<'a>(
    keyword: &str,
    words: SplitWhitespace<'a>,
    least: usize,
) -> Result<Vec<(&'a str, f64)>, String> {
    let mut numbers = Vec::with_capacity(4);
    for word in words.take_while(|word| !word.starts_with('#')) {
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => numbers.push((word, value)),
            // What follows the numbers that are read is of no interest.
            _ if numbers.len() >= 3 => break,
            _ => return Err(format!("`{}` is not a finite number", excerpt(word))),
        }
    }
    match (numbers.len() < least, least) {
        (false, _) => Ok(numbers),
        (true, 1) => Err(format!("`{keyword}` needs a number")),
        (true, _) => Err(format!("`{keyword}` needs {least} numbers")),
    }
}

/// The beginning of a word of a file, short enough for a message.
fn excerpt(word: &str) -> String {
    word.chars().filter(|c| !c.is_control()).take(40).collect()
}
