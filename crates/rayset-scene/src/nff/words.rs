//! The words of NFF text, one at a time.

use std::io::BufRead;
use std::ops::Range;
use std::path::Path;

use rayset_geometry::glam::DVec3;

use crate::lines::{LineError, Lines};
use crate::{MAX_COORDINATE, SceneError};

/// Words between blanks, over the ends of lines; `#` and what follows it in a line is left out.
pub(super) struct Words<'p, R> {
    lines: Lines<R>,
    path: &'p Path,
    line_bytes: usize,
    /// The next word of the current line, if it has been looked at.
    next: Option<Range<usize>>,
    /// Where in the current line to look for the next word.
    position: usize,
}

impl<'p, R: BufRead> Words<'p, R> {
    pub(super) fn new(reader: R, path: &'p Path, line_bytes: usize) -> Self {
        Self { lines: Lines::new(reader, line_bytes), path, line_bytes, next: None, position: 0 }
    }

    /// The file.
    pub(super) fn path(&self) -> &'p Path {
        self.path
    }

    /// The line of the word looked at or taken last, counted from 1.
    pub(super) fn line(&self) -> usize {
        self.lines.number().max(1)
    }

    /// An error at the current line.
    pub(super) fn error(&self, message: impl Into<String>) -> SceneError {
        SceneError::Parse { path: self.path.into(), line: self.line(), message: message.into() }
    }

    /// The next word, without taking it; `None` at the end of the text.
    pub(super) fn peek(&mut self) -> Result<Option<&[u8]>, SceneError> {
        while self.next.is_none() {
            let line = self.lines.current();
            let blank = |byte: &u8| byte.is_ascii_whitespace();
            let start = line[self.position..].iter().position(|byte| !blank(byte));
            match start.map(|start| self.position + start).filter(|&start| line[start] != b'#') {
                Some(start) => {
                    let length = line[start..].iter().position(|byte| blank(byte) || *byte == b'#');
                    let end = length.map_or(line.len(), |length| start + length);
                    self.next = Some(start..end);
                    self.position = end;
                }
                None => {
                    if !self.next_line()? {
                        return Ok(None);
                    }
                }
            }
        }
        Ok(self.next.clone().map(|range| &self.lines.current()[range]))
    }

    fn next_line(&mut self) -> Result<bool, SceneError> {
        self.position = 0;
        match self.lines.advance() {
            Ok(more) => Ok(more),
            Err(LineError::Read(source)) => Err(SceneError::Read { path: self.path.into(), source }),
            Err(LineError::TooLong) => {
                Err(self.error(format!("the line is longer than {} bytes", self.line_bytes)))
            }
        }
    }

    /// Takes the next word; `None` at the end of the text.
    pub(super) fn take(&mut self) -> Result<Option<&[u8]>, SceneError> {
        self.peek()?;
        Ok(self.next.take().map(|range| &self.lines.current()[range]))
    }

    /// Whether the next word begins as a number does.
    pub(super) fn number_follows(&mut self) -> Result<bool, SceneError> {
        let word = self.peek()?;
        Ok(word.is_some_and(|word| word[0].is_ascii_digit() || b"+-.".contains(&word[0])))
    }

    /// Takes a finite number, which belongs to `entity`.
    pub(super) fn number(&mut self, entity: &str) -> Result<f64, SceneError> {
        let Some(word) = self.take()? else {
            return Err(self.error(format!("the text ends inside of `{entity}`")));
        };
        let number = std::str::from_utf8(word).ok().and_then(|word| word.parse::<f64>().ok());
        match number {
            Some(number) if number.is_finite() => Ok(number),
            _ => {
                let word = excerpt(word);
                Err(self.error(format!("`{entity}`: `{word}` is not a finite number")))
            }
        }
    }

    /// Takes three finite numbers.
    pub(super) fn vector(&mut self, entity: &str) -> Result<DVec3, SceneError> {
        Ok(DVec3::new(self.number(entity)?, self.number(entity)?, self.number(entity)?))
    }

    /// Takes a coordinate or radius.
    pub(super) fn coordinate(&mut self, entity: &str) -> Result<f64, SceneError> {
        let number = self.number(entity)?;
        if number.abs() > MAX_COORDINATE {
            return Err(self.error(format!("`{entity}`: `{number:e}` exceeds {MAX_COORDINATE:e}")));
        }
        Ok(number)
    }

    /// Takes the coordinates of a point.
    pub(super) fn point(&mut self, entity: &str) -> Result<DVec3, SceneError> {
        Ok(DVec3::new(self.coordinate(entity)?, self.coordinate(entity)?, self.coordinate(entity)?))
    }

    /// Takes three coefficients of a colour, none of them negative.
    pub(super) fn color(&mut self, entity: &str) -> Result<DVec3, SceneError> {
        let color = self.vector(entity)?;
        if color.min_element() < 0.0 {
            return Err(self.error(format!("`{entity}`: a colour is negative")));
        }
        Ok(color)
    }

    /// Takes a count.
    pub(super) fn count(&mut self, entity: &str) -> Result<u64, SceneError> {
        let Some(word) = self.take()? else {
            return Err(self.error(format!("the text ends inside of `{entity}`")));
        };
        let count = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        let word = excerpt(word);
        count.ok_or_else(|| self.error(format!("`{entity}`: `{word}` is not a count")))
    }
}

/// The beginning of a word, fit for a message.
pub(super) fn excerpt(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(word);
    let mut excerpt: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        excerpt.push_str("...");
    }
    excerpt
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<(String, usize)> {
        let mut words = Words::new(text.as_bytes(), Path::new("a.nff"), 100);
        let mut all = Vec::new();
        while let Some(word) = words.take().unwrap().map(excerpt) {
            all.push((word, words.line()));
        }
        assert_eq!(words.take().unwrap(), None, "the end stays the end");
        all
    }

    #[test]
    fn words_stand_between_blanks_ends_of_lines_and_comments() {
        let text = "# one\np 3#two\n\n \t1e5  -2 # three # four\r\n#\n7";
        let expected = [("p", 2), ("3", 2), ("1e5", 4), ("-2", 4), ("7", 6)];
        assert_eq!(words(text), expected.map(|(word, line)| (word.to_owned(), line)));
        assert_eq!(words(""), []);
        assert_eq!(words("# only"), []);
    }

    #[test]
    fn numbers_are_finite_and_errors_name_their_line() {
        let refused = |text: &str| {
            Words::new(text.as_bytes(), Path::new("a.nff"), 20).coordinate("s").unwrap_err().to_string()
        };
        assert_eq!(refused("\nnan"), "a.nff:2: `s`: `nan` is not a finite number");
        assert_eq!(refused("1e999"), "a.nff:1: `s`: `1e999` is not a finite number");
        assert_eq!(refused("1,5"), "a.nff:1: `s`: `1,5` is not a finite number");
        assert_eq!(refused("-2e60"), "a.nff:1: `s`: `-2e60` exceeds 1e60");
        assert_eq!(refused("\n\n"), "a.nff:2: the text ends inside of `s`");
        assert_eq!(refused(""), "a.nff:1: the text ends inside of `s`");
        assert_eq!(refused("\n1                     "), "a.nff:2: the line is longer than 20 bytes");
    }
}
