//! The statements of OBJ.
//!
//! What tobj gets to see is `v`, `vn`, `f` and `g`: vectors of three numbers, faces whose indices are positive and in
//! range, and groups that are called by the number of their run. A run is cut into groups of some thousand corners,
//! which keeps the tables that tobj makes of a group small.

use super::feed::{Fault, Rules};
use super::libraries::Libraries;
use super::runs::Runs;
use super::statements::{Statement, Words, excerpt, finite, is_modest};
use crate::{MAX_COORDINATE, Part};

/// After so many corners a run is cut.
const CUT_CORNERS: usize = 1 << 12;

/// Memory for a vertex or a normal, while tobj holds it; roughly, as all of these.
const VECTOR_BYTES: u64 = 48;

/// Memory for a corner of a face: its indices, and its position and normal in its group.
const CORNER_BYTES: u64 = 64;

/// Memory for a triangle: a part, and what the scene makes of it.
const TRIANGLE_BYTES: u64 = size_of::<Part>() as u64 + 256;

/// What tobj counts up to.
const MAX_VECTORS: u64 = u32::MAX as u64 - 1;

/// Statements of OBJ that are not read.
const UNREAD: [&str; 36] = [
    "bevel",
    "bmat",
    "bsp",
    "bzp",
    "c_interp",
    "call",
    "cdc",
    "cdp",
    "con",
    "csh",
    "cstype",
    "ctech",
    "curv",
    "curv2",
    "d_interp",
    "deg",
    "end",
    "hole",
    "l",
    "lod",
    "maplib",
    "mg",
    "p",
    "parm",
    "res",
    "scrv",
    "shadow_obj",
    "sp",
    "stech",
    "step",
    "surf",
    "trace_obj",
    "trim",
    "usemap",
    "vp",
    "vt",
];

/// The rules of OBJ, and what they gather beside the geometry.
#[derive(Debug)]
pub(super) struct ObjRules<'a> {
    pub(super) libraries: Libraries<'a>,
    pub(super) runs: Runs,
    /// The line of the first statement.
    pub(super) first_line: Option<usize>,
    /// Whether any statement was one of OBJ.
    pub(super) is_obj: bool,
    n_vertices: u64,
    n_texture_coordinates: u64,
    n_normals: u64,
    n_faces: u64,
    /// Whether the run is to be cut before the next face.
    is_cut: bool,
    /// Corners since the last cut.
    corners_since: usize,
    /// The vertex and the normal of every corner of a face.
    corners: Vec<(u64, Option<u64>)>,
}

impl<'a> ObjRules<'a> {
    pub(super) fn new(libraries: Libraries<'a>) -> Self {
        Self {
            libraries,
            runs: Runs::default(),
            first_line: None,
            is_obj: false,
            n_vertices: 0,
            n_texture_coordinates: 0,
            n_normals: 0,
            n_faces: 0,
            is_cut: false,
            corners_since: 0,
            corners: Vec::new(),
        }
    }

    fn warn(&mut self, line: usize, message: impl Into<String>) {
        let Libraries { path, context, .. } = &mut self.libraries;
        context.warn(path, line, message);
    }

    fn take(&mut self, bytes: u64) -> Result<(), String> {
        self.libraries.context.take(bytes)
    }

    fn vertex(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault> {
        self.n_vertices += 1;
        if self.n_vertices > MAX_VECTORS {
            return Err(format!("more than {MAX_VECTORS} vertices").into());
        }
        self.take(VECTOR_BYTES)?;
        let mut words = statement.words();
        vector("v", &mut words, out)?;
        // A weight or a colour may follow.
        if let Some(word) = words.find(|word| finite(word).is_none()) {
            self.warn(statement.line, format!("`{}` ignored after the coordinates", excerpt(word)));
        }
        Ok(())
    }

    fn normal(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault> {
        if self.n_normals == 0 {
            // For corners without one: tobj would shift the normals of a group where some are missing.
            out.extend_from_slice(b"vn 0 0 0\n");
            self.is_cut = true;
        }
        self.n_normals += 1;
        if self.n_normals > MAX_VECTORS {
            return Err(format!("more than {MAX_VECTORS} normals").into());
        }
        self.take(VECTOR_BYTES)?;
        let start = out.len();
        if let Err(problem) = vector("vn", &mut statement.words(), out) {
            out.truncate(start);
            out.extend_from_slice(b"vn 0 0 0\n");
            self.warn(statement.line, format!("{problem}: the normal is ignored"));
        }
        Ok(())
    }

    /// A face with a normal a corner, or none as long as there are none in the file.
    fn face(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault> {
        let limits = self.libraries.context.limits;
        self.corners.clear();
        for word in statement.words() {
            if self.corners.len() >= limits.corners as usize {
                return Err(format!("a face has more than {} corners", limits.corners).into());
            }
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        let n_corners = self.corners.len();
        if n_corners < 3 {
            return Err("a face needs 3 corners".to_owned().into());
        }
        self.n_faces += 1;
        if self.n_faces > limits.faces {
            return Err(format!("more than {} faces", limits.faces).into());
        }
        self.take(CORNER_BYTES * n_corners as u64 + TRIANGLE_BYTES * (n_corners as u64 - 2))?;
        let n_normals = self.corners.iter().filter(|(_, normal)| normal.is_some()).count();
        if n_normals > 0 && n_normals < n_corners {
            self.warn(statement.line, "normals ignored: not every corner of the face has one");
        }
        let is_new = self.runs.begin(&mut self.libraries.context)?;
        if is_new || self.is_cut || self.corners_since >= CUT_CORNERS {
            self.is_cut = false;
            self.corners_since = 0;
            out.extend_from_slice(b"g ");
            push_decimal(self.runs.current() as u64, out);
            out.push(b'\n');
        }
        self.runs.add_triangles(n_corners - 2);
        self.corners_since += n_corners;
        out.push(b'f');
        for &(vertex, normal) in &self.corners {
            out.push(b' ');
            push_decimal(vertex, out);
            if self.n_normals > 0 {
                out.extend_from_slice(b"//");
                // Normal 1 is the one that stands for none.
                push_decimal(if n_normals == n_corners { normal.unwrap_or(0) + 1 } else { 1 }, out);
            }
        }
        out.push(b'\n');
        Ok(())
    }

    /// The vertex and the normal of a corner, counted from 1; its texture coordinate is only looked at.
    #[inline]
    fn corner(&self, word: &[u8]) -> Result<(u64, Option<u64>), String> {
        let [vertex, texture_coordinate, normal] =
            indices(word).ok_or_else(|| format!("`{}` is no corner of a face", excerpt(word)))?;
        let resolved = |index: Option<i64>, what: &str, count: u64| match index {
            Some(index) => resolve(index, what, count).map(Some),
            None => Ok(None),
        };
        resolved(texture_coordinate, "texture coordinate", self.n_texture_coordinates)?;
        let normal = resolved(normal, "normal", self.n_normals)?;
        match vertex {
            Some(vertex) => Ok((resolve(vertex, "vertex", self.n_vertices)?, normal)),
            None => Err(format!("`{}` is no corner of a face", excerpt(word))),
        }
    }
}

impl Rules for ObjRules<'_> {
    fn translate(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault> {
        let Statement { line, keyword, rest } = statement;
        let is_first = self.first_line.is_none();
        if is_first {
            self.first_line = Some(line);
        }
        match keyword {
            b"v" => self.vertex(statement, out)?,
            b"vn" => self.normal(statement, out)?,
            // They are never read, but indices into them must be in range.
            b"vt" => self.n_texture_coordinates += 1,
            b"f" | b"fo" => self.face(statement, out)?,
            b"o" | b"g" => self.runs.name(rest),
            b"usemtl" => {
                if !self.runs.material(statement, &mut self.libraries.context)? {
                    self.warn(line, "`usemtl` needs a name: the default is used");
                }
            }
            b"mtllib" => self.libraries.read(statement)?,
            // Without normals there is nothing to smooth.
            b"s" => {}
            b"l" | b"p" => self.warn(line, format!("`{}` ignored: only faces are read", excerpt(keyword))),
            _ => {
                self.warn(line, format!("`{}` ignored", excerpt(keyword)));
                if !UNREAD.iter().any(|unread| unread.as_bytes() == keyword) {
                    return Ok(());
                }
            }
        }
        self.is_obj = true;
        Ok(())
    }
}

/// Writes a statement of three numbers, none of which exceeds what a scene may have.
fn vector(keyword: &str, words: &mut Words, out: &mut Vec<u8>) -> Result<(), String> {
    out.extend_from_slice(keyword.as_bytes());
    for _ in 0..3 {
        let word = words.next().ok_or_else(|| format!("`{keyword}` needs 3 numbers"))?;
        if !is_modest(word) {
            let value = finite(word).ok_or_else(|| format!("`{}` is not a finite number", excerpt(word)))?;
            if value.abs() > MAX_COORDINATE {
                return Err(format!("`{}` exceeds {MAX_COORDINATE:e}", excerpt(word)));
            }
        }
        out.push(b' ');
        out.extend_from_slice(word);
    }
    out.push(b'\n');
    Ok(())
}

/// The index counted from 1, of one that may be counted backwards from -1.
#[inline]
fn resolve(index: i64, what: &str, count: u64) -> Result<u64, String> {
    let forwards = if index < 0 {
        count.checked_sub(index.unsigned_abs()).map(|before| before + 1)
    } else {
        u64::try_from(index).ok()
    };
    match forwards.filter(|&index| index <= count) {
        Some(0) => Err(format!("{what} 0 is out of range: indices begin at 1")),
        Some(index) => Ok(index),
        None => Err(format!("{what} {index} is out of range: there are {count} so far")),
    }
}

/// The up to three integers between slashes; an index that would not fit is out of range in any case.
#[inline]
fn indices(word: &[u8]) -> Option<[Option<i64>; 3]> {
    let mut indices = [None; 3];
    let mut rest = word;
    for index in &mut indices {
        let (is_negative, digits) = match rest {
            [b'-', digits @ ..] => (true, digits),
            [b'+', digits @ ..] => (false, digits),
            digits => (false, digits),
        };
        let mut value = 0_i64;
        let mut n_digits = 0;
        for &byte in digits {
            let digit = byte.wrapping_sub(b'0');
            if digit > 9 {
                break;
            }
            // Eighteen digits fit.
            value = match n_digits < 18 {
                true => value * 10 + i64::from(digit),
                false => value.saturating_mul(10).saturating_add(i64::from(digit)),
            };
            n_digits += 1;
        }
        if n_digits > 0 {
            *index = Some(if is_negative { -value } else { value });
        } else if digits.len() < rest.len() {
            return None;
        }
        match &digits[n_digits..] {
            [] => return Some(indices),
            [b'/', after @ ..] => rest = after,
            _ => return None,
        }
    }
    None
}

/// Appends a number in decimal.
fn push_decimal(mut number: u64, out: &mut Vec<u8>) {
    let mut digits = [0; 20];
    let mut start = digits.len();
    loop {
        start -= 1;
        digits[start] = b'0' + (number % 10) as u8;
        number /= 10;
        if number == 0 {
            break;
        }
    }
    out.extend_from_slice(&digits[start..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_resolved_or_refused() {
        for (index, resolved) in [(1, 1), (4, 4), (-1, 4), (-4, 1)] {
            assert_eq!(resolve(index, "vertex", 4), Ok(resolved));
        }
        for index in [0, 5, -5, i64::MAX, -i64::MAX] {
            assert!(resolve(index, "vertex", 4).unwrap_err().contains("out of range"), "{index}");
        }
    }

    #[test]
    fn corners_have_up_to_three_indices() {
        for (word, expected) in [
            ("1", [Some(1), None, None]),
            ("+7/", [Some(7), None, None]),
            ("007//", [Some(7), None, None]),
            ("1//-3", [Some(1), None, Some(-3)]),
            ("1/2/3", [Some(1), Some(2), Some(3)]),
            ("/1", [None, Some(1), None]),
            ("99999999999999999999", [Some(i64::MAX), None, None]),
        ] {
            assert_eq!(indices(word.as_bytes()), Some(expected), "{word}");
        }
        for word in ["1/2/3/", "1/2/3/4", "-", "+", "1/-", "1.0", "1e0", "0x1", "--1", "x", "1x", "1\\2"] {
            assert_eq!(indices(word.as_bytes()), None, "{word}");
        }
    }

    #[test]
    fn numbers_are_written_in_decimal() {
        for number in [0, 1, 9, 10, 1234567890, u64::MAX] {
            let mut out = Vec::new();
            push_decimal(number, &mut out);
            assert_eq!(String::from_utf8(out).unwrap(), number.to_string());
        }
    }
}
