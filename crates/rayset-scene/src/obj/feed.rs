//! What tobj reads instead of a file: the statements that it reads rightly, written anew.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::statements::{Statement, Statements};
use crate::SceneError;
use crate::lines::LineError;

/// How many bytes are written before tobj reads on.
const CHUNK_BYTES: usize = 1 << 14;

/// Why reading ends early.
#[derive(Debug)]
pub(super) enum Fault {
    /// The statement cannot be understood or trusted.
    Here(String),
    /// Something is wrong with another file.
    Elsewhere(SceneError),
}

impl From<String> for Fault {
    fn from(message: String) -> Self {
        Self::Here(message)
    }
}

/// The rules of a format: writes for tobj what a statement means.
pub(super) trait Rules {
    /// Appends whole lines of ASCII to `out`, or nothing.
    fn translate(&mut self, statement: Statement, out: &mut Vec<u8>) -> Result<(), Fault>;
}

/// A reader of what its rules make of the statements of a file; nothing of the file is held but one statement.
#[derive(Debug)]
pub(super) struct Feed<'a, R, L> {
    statements: Statements<R>,
    path: &'a Path,
    rules: L,
    buffer: Vec<u8>,
    consumed: usize,
    limit: usize,
    error: Option<SceneError>,
}

impl<'a, R: BufRead, L: Rules> Feed<'a, R, L> {
    /// `path` is the name of the file in messages, `limit` the length of the longest statement in bytes.
    pub(super) fn new(inner: R, path: &'a Path, limit: usize, rules: L) -> Self {
        let statements = Statements::new(inner, limit);
        Self { statements, path, rules, buffer: Vec::new(), consumed: 0, limit, error: None }
    }

    /// The line that is read, counted from 1.
    pub(super) fn line(&self) -> usize {
        self.statements.line().max(1)
    }

    /// What the rules have gathered, once tobj has read all of it: `parsed` is what tobj says.
    pub(super) fn finish<T>(self, parsed: Result<T, tobj::LoadError>) -> Result<(T, L), SceneError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let line = self.line();
        match parsed {
            Ok(parsed) => Ok((parsed, self.rules)),
            Err(error) => Err(SceneError::Parse { path: self.path.into(), line, message: error.to_string() }),
        }
    }

    fn refill(&mut self) -> Result<(), SceneError> {
        self.buffer.clear();
        self.consumed = 0;
        while self.buffer.len() < CHUNK_BYTES {
            let (line, fault) = match self.statements.next() {
                Ok(None) => return Ok(()),
                Ok(Some(statement)) => match self.rules.translate(statement, &mut self.buffer) {
                    Ok(()) => continue,
                    Err(fault) => (statement.line, fault),
                },
                Err(LineError::Read(source)) => {
                    return Err(SceneError::Read { path: self.path.into(), source });
                }
                Err(LineError::TooLong) => {
                    let message = format!("the line is longer than {} bytes", self.limit);
                    (self.statements.line(), Fault::Here(message))
                }
            };
            return Err(match fault {
                Fault::Here(message) => SceneError::Parse { path: self.path.into(), line, message },
                Fault::Elsewhere(error) => error,
            });
        }
        Ok(())
    }
}

impl<R: BufRead, L: Rules> Read for Feed<'_, R, L> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(out)?;
        self.consume(read);
        Ok(read)
    }
}

impl<R: BufRead, L: Rules> BufRead for Feed<'_, R, L> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.consumed == self.buffer.len()
            && let Err(error) = self.refill()
        {
            // What tobj is told only makes it stop.
            self.buffer.clear();
            self.consumed = 0;
            self.error.get_or_insert(error);
            return Err(io::Error::from(io::ErrorKind::InvalidData));
        }
        Ok(&self.buffer[self.consumed..])
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount;
    }
}
