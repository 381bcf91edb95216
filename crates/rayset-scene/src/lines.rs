//! The lines of a text file, one at a time and never longer than agreed.

use std::io::{self, BufRead};

/// Why there is no next line.
#[derive(Debug)]
pub(crate) enum LineError {
    /// The file could not be read.
    Read(io::Error),
    /// The line is longer than the limit.
    TooLong,
}

/// Reads lines that end with LF, CR LF or CR; a byte order mark at the beginning is left out.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    inner: R,
    buffer: Vec<u8>,
    limit: usize,
    number: usize,
    /// Whether the last line ended with CR, so that an LF would belong to its end.
    after_cr: bool,
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(inner: R, limit: usize) -> Self {
        Self { inner, buffer: Vec::new(), limit, number: 0, after_cr: false }
    }

    /// The number of the line read last, counted from 1.
    pub(crate) fn number(&self) -> usize {
        self.number
    }

    /// The line read last, without its end.
    pub(crate) fn current(&self) -> &[u8] {
        &self.buffer
    }

    /// Reads the next line; `false` at the end of the file.
    pub(crate) fn advance(&mut self) -> Result<bool, LineError> {
        self.buffer.clear();
        let mut has_begun = false;
        loop {
            let available = match self.inner.fill_buf() {
                Ok(available) => available,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(LineError::Read(error)),
            };
            if available.is_empty() {
                break;
            }
            if self.after_cr {
                self.after_cr = false;
                if available[0] == b'\n' {
                    self.inner.consume(1);
                    continue;
                }
            }
            has_begun = true;
            let end = available.iter().position(|&byte| byte == b'\n' || byte == b'\r');
            let text = &available[..end.unwrap_or(available.len())];
            if self.buffer.len() + text.len() > self.limit {
                self.number += 1;
                return Err(LineError::TooLong);
            }
            self.buffer.extend_from_slice(text);
            let consumed = text.len() + usize::from(end.is_some());
            self.after_cr = end.is_some_and(|end| available[end] == b'\r');
            self.inner.consume(consumed);
            if end.is_some() {
                break;
            }
        }
        if !has_begun {
            return Ok(false);
        }
        self.number += 1;
        if self.number == 1 && self.buffer.starts_with(b"\xef\xbb\xbf") {
            self.buffer.drain(..3);
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn lines(text: &[u8], capacity: usize) -> Vec<String> {
        let mut lines = Lines::new(BufReader::with_capacity(capacity, text), 10);
        let mut all = Vec::new();
        while lines.advance().unwrap() {
            all.push(String::from_utf8_lossy(lines.current()).into_owned());
            assert_eq!(lines.number(), all.len());
        }
        all
    }

    #[test]
    fn every_kind_of_line_end_is_one_end() {
        for capacity in [1, 2, 3, 64] {
            assert_eq!(lines(b"a\nb\r\nc\rd\n\n\r\re", capacity), ["a", "b", "c", "d", "", "", "", "e"]);
            assert_eq!(lines(b"\xef\xbb\xbfa\r", capacity), ["a"]);
            assert_eq!(lines(b"", capacity), [""; 0]);
        }
    }

    #[test]
    fn long_line_is_refused_before_it_is_held() {
        let text = [b'x'; 1000];
        let mut lines = Lines::new(BufReader::with_capacity(4, &text[..]), 10);
        assert!(matches!(lines.advance(), Err(LineError::TooLong)));
        assert_eq!(lines.number(), 1);
        assert!(lines.current().len() <= 10);
    }
}
