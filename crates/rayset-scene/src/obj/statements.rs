//! The statements of OBJ and MTL text: lines without comments, joined where they are continued.

use std::io::BufRead;

use crate::lines::{LineError, Lines};

/// A keyword and what follows it, as bytes: names may be in any encoding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Statement<'a> {
    /// The number of its first line, counted from 1.
    pub(super) line: usize,
    pub(super) keyword: &'a [u8],
    /// What follows, without blanks round it; a comment at the end is still there, since names may hold `#`.
    pub(super) rest: &'a [u8],
}

impl<'a> Statement<'a> {
    fn new(line: usize, text: &'a [u8]) -> Self {
        let end = text.iter().position(is_blank).unwrap_or(text.len());
        Self { line, keyword: &text[..end], rest: trimmed(&text[end..]) }
    }

    /// The words that follow the keyword.
    pub(super) fn words(&self) -> Words<'a> {
        Words(self.rest)
    }
}

/// Reads statements one at a time; blank lines and lines of comment are none.
///
/// A line that ends with `\` is continued by the next one, unless the `\` stands in a comment: a path there would
/// otherwise swallow a statement.
#[derive(Debug)]
pub(super) struct Statements<R> {
    lines: Lines<R>,
    limit: usize,
    line: usize,
    joined: Vec<u8>,
}

impl<R: BufRead> Statements<R> {
    /// Statements of at most `limit` bytes.
    pub(super) fn new(inner: R, limit: usize) -> Self {
        Self { lines: Lines::new(inner, limit), limit, line: 0, joined: Vec::new() }
    }

    /// The line where the statement read last begins, or where reading failed.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Reads the next statement; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<Statement<'_>>, LineError> {
        loop {
            let is_line = self.lines.advance();
            self.line = self.lines.number();
            if !is_line? {
                return Ok(None);
            }
            let text = trimmed(self.lines.current());
            if text.is_empty() || text[0] == b'#' {
                continue;
            }
            if !is_continued(text) {
                break;
            }
            self.join()?;
            if !trimmed(&self.joined).is_empty() {
                return Ok(Some(Statement::new(self.line, trimmed(&self.joined))));
            }
        }
        Ok(Some(Statement::new(self.line, trimmed(self.lines.current()))))
    }

    /// Joins the current line and those that continue it, a blank between them.
    fn join(&mut self) -> Result<(), LineError> {
        self.joined.clear();
        loop {
            let text = trimmed(self.lines.current());
            let is_continued = is_continued(text);
            let text = if is_continued { &text[..text.len() - 1] } else { text };
            if self.joined.len() + text.len() >= self.limit {
                return Err(LineError::TooLong);
            }
            self.joined.extend_from_slice(text);
            self.joined.push(b' ');
            if !is_continued || !self.lines.advance()? {
                return Ok(());
            }
        }
    }
}

fn is_continued(text: &[u8]) -> bool {
    text.last() == Some(&b'\\') && without_comment(text).len() == text.len()
}

/// The words of a statement, up to its comment.
#[derive(Clone, Debug)]
pub(super) struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self(text)
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.0.iter().position(|byte| !is_blank(byte))?;
        let text = &self.0[start..];
        if text[0] == b'#' {
            return None;
        }
        let end = text.iter().position(is_blank).unwrap_or(text.len());
        self.0 = &text[end..];
        Some(&text[..end])
    }
}

/// A name up to the first word that begins with `#`; the first word of it stays in any case.
pub(super) fn without_comment(name: &[u8]) -> &[u8] {
    let is_comment = |pair: &[u8]| is_blank(&pair[0]) && pair[1] == b'#';
    let end = name.windows(2).position(is_comment).unwrap_or(name.len());
    trimmed(&name[..end])
}

/// The finite number that a word is, if it is one.
pub(super) fn finite(word: &[u8]) -> Option<f64> {
    let value: f64 = str::from_utf8(word).ok()?.parse().ok()?;
    value.is_finite().then_some(value)
}

/// Whether a word is plainly a number below 1e40: digits, a sign, a point. Other numbers need a closer look.
pub(super) fn is_modest(word: &[u8]) -> bool {
    let unsigned = match word {
        [b'-' | b'+', rest @ ..] => rest,
        word => word,
    };
    let mut n_points = 0;
    let mut n_others = 0;
    for byte in unsigned {
        n_points += usize::from(*byte == b'.');
        n_others += usize::from(!(byte.is_ascii_digit() || *byte == b'.'));
    }
    n_others == 0 && n_points <= 1 && (n_points + 1..=40).contains(&unsigned.len())
}

/// The beginning of something from a file, short enough for a message, control characters escaped.
pub(super) fn excerpt(text: &[u8]) -> String {
    let text = &text[..text.len().min(200)];
    let escaped = |c: char| if c.is_control() { c.escape_debug().collect() } else { c.to_string() };
    let text: String = String::from_utf8_lossy(text).chars().map(escaped).collect();
    text.chars().take(40).collect()
}

pub(super) fn trimmed(text: &[u8]) -> &[u8] {
    let start = text.iter().position(|byte| !is_blank(byte)).unwrap_or(text.len());
    let end = text.iter().rposition(|byte| !is_blank(byte)).map_or(start, |last| last + 1);
    &text[start..end]
}

/// Blanks are those of ASCII, and the vertical tab.
fn is_blank(byte: &u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

#[cfg(test)]
mod tests {
    use super::*;

    type Owned = (usize, String, Vec<String>);

    /// Line, keyword and words of each statement, or the line where reading failed.
    fn statements(text: &str, limit: usize) -> Result<Vec<Owned>, (usize, LineError)> {
        let mut statements = Statements::new(text.as_bytes(), limit);
        let string = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        let mut all = Vec::new();
        loop {
            match statements.next() {
                Ok(Some(s)) => all.push((s.line, string(s.keyword), s.words().map(string).collect())),
                Ok(None) => return Ok(all),
                Err(error) => return Err((statements.line(), error)),
            }
        }
    }

    #[test]
    fn continued_lines_are_one_statement_with_the_number_of_the_first() {
        let text = "\n# c \\\nf 1 \\\n2\t\\ \n3 # d \\\n\\\n\\\n\ng\x0ba\x0c\\";
        let words = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
        assert_eq!(
            statements(text, 100).unwrap(),
            [(3, "f".to_owned(), words(&["1", "2", "3"])), (9, "g".to_owned(), words(&["a"]))]
        );
    }

    #[test]
    fn continued_statement_is_limited_as_a_line_is() {
        assert!(statements("f 1 \\\n2 \\\n3", 20).is_ok());
        let long = "\nf 1 \\\n".to_owned() + &"2 \\\n".repeat(10);
        assert!(matches!(statements(&long, 20), Err((2, LineError::TooLong))));
        assert!(matches!(statements("\n\nf 0123456789", 8), Err((3, LineError::TooLong))));
    }

    #[test]
    fn numbers_are_finite_or_none() {
        for word in [
            "nan",
            "inf",
            "-infinity",
            "1e999",
            "1d0",
            "0x10",
            "1,5",
            "",
            "+",
            ".",
            "-.",
            "1..2",
            "1-1",
            "1.#INF",
            "\u{b2}",
        ] {
            assert_eq!(finite(word.as_bytes()), None, "{word}");
            assert!(!is_modest(word.as_bytes()), "{word}");
        }
        for (word, value) in [(".5", 0.5), ("1.", 1.0), ("+1", 1.0), ("1e-400", 0.0), ("-2E3", -2000.0)] {
            assert!(finite(word.as_bytes()).is_some_and(|number| number.total_cmp(&value).is_eq()), "{word}");
        }
    }

    #[test]
    fn modest_numbers_are_numbers() {
        let digits = *b"-+.09ex";
        for n in 0..7_usize.pow(4) {
            let word = [n % 7, n / 7 % 7, n / 49 % 7, n / 343].map(|i| digits[i]);
            for length in 0..=4 {
                let word = &word[..length];
                assert!(!is_modest(word) || finite(word).is_some(), "{word:?}");
            }
        }
        assert!(is_modest(b"-0.25") && is_modest(b".5") && is_modest(b"1."));
        assert!(!is_modest(&[b'9'; 41]));
    }

    #[test]
    fn comment_begins_with_a_word() {
        assert_eq!(without_comment(b"red # the one"), b"red");
        assert_eq!(without_comment(b"a#b \t#c"), b"a#b");
        assert_eq!(without_comment(b"#1 a"), b"#1 a");
        assert_eq!(Words::new(b" 1 2#3 #4 5").collect::<Vec<_>>(), [&b"1"[..], b"2#3"]);
    }
}
