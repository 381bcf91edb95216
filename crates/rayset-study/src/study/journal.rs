//! A journal of finished experiments, one JSON object a line.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::StudyError;

/// What tells an experiment from all others: the program's version, and its parameters by name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Key {
    /// The version of the program, as far as it bears on the result.
    pub version: String,
    /// The parameters by name; text, so that a key read back is the key that was written.
    pub experiment: BTreeMap<String, String>,
}

/// A line of the journal.
#[derive(Serialize, Deserialize)]
struct Line<K, R> {
    #[serde(flatten)]
    key: K,
    result: R,
}

/// The experiments that are finished, in memory and in a file that only grows.
///
/// A line is written at once when its experiment is finished, so a run that is killed loses no more than the experiments
/// in hand. A last line without its end is dropped when the journal is opened; of two lines with one key the first counts.
#[derive(Debug)]
pub struct Journal<R> {
    path: PathBuf,
    file: Option<File>,
    records: BTreeMap<Key, R>,
}

impl<R: Serialize + DeserializeOwned> Journal<R> {
    /// Opens a journal to go on with it, or begins one; no other process can open it meanwhile.
    ///
    /// # Errors
    ///
    /// [`StudyError::Write`] if the file cannot be read, written or locked, or a line before the last is no record.
    pub fn open(path: &Path) -> Result<Self, StudyError> {
        let refuse = |source: Box<dyn std::error::Error + Send + Sync>| StudyError::Write {
            path: path.into(),
            source,
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|error| refuse(error.into()))?;
        }
        let open = File::options().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = open.map_err(|error| refuse(error.into()))?;
        file.try_lock().map_err(|error| refuse(format!("another run has it open ({error})").into()))?;
        let text = fs::read(path).map_err(|error| refuse(error.into()))?;
        let (records, length) = parse(&text).map_err(|message| refuse(message.into()))?;
        let seek = file.set_len(length as u64).and_then(|()| file.seek(SeekFrom::End(0)));
        seek.map_err(|error| refuse(error.into()))?;
        Ok(Self { path: path.into(), file: Some(file), records })
    }

    /// Reads a journal without changing it; one that does not exist is empty.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open).
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let refuse = |source: Box<dyn std::error::Error + Send + Sync>| StudyError::Write {
            path: path.into(),
            source,
        };
        let text = match fs::read(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            text => text.map_err(|error| refuse(error.into()))?,
        };
        let (records, _) = parse(&text).map_err(|message| refuse(message.into()))?;
        Ok(Self { path: path.into(), file: None, records })
    }

    /// The result of an experiment, if it is finished.
    #[must_use]
    pub fn get(&self, key: &Key) -> Option<&R> {
        self.records.get(key)
    }

    /// How many experiments are finished.
    #[must_use]
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether none is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Notes a finished experiment; one that is noted already stays as it is.
    ///
    /// # Errors
    ///
    /// [`StudyError::Write`] if the line cannot be written; a journal that was only read keeps it in memory.
    pub fn append(&mut self, key: Key, result: R) -> Result<(), StudyError> {
        if self.records.contains_key(&key) {
            return Ok(());
        }
        if let Some(file) = &mut self.file {
            let refuse = |source| StudyError::Write { path: self.path.clone(), source };
            let mut line =
                serde_json::to_string(&Line { key: &key, result: &result }).map_err(|e| refuse(e.into()))?;
            line.push('\n');
            file.write_all(line.as_bytes()).map_err(|error| refuse(error.into()))?;
        }
        self.records.insert(key, result);
        Ok(())
    }
}

/// The records of a journal's text, and the length of the part that holds them.
fn parse<R: DeserializeOwned>(text: &[u8]) -> Result<(BTreeMap<Key, R>, usize), String> {
    let mut records = BTreeMap::new();
    let mut length = 0;
    let lines: Vec<&[u8]> = text.split_inclusive(|&byte| byte == b'\n').collect();
    for (i, line) in lines.iter().enumerate() {
        let is_last = i + 1 == lines.len();
        match serde_json::from_slice::<Line<Key, R>>(line) {
            Ok(Line { key, result }) if line.ends_with(b"\n") => {
                records.entry(key).or_insert(result);
                length += line.len();
            }
            _ if is_last => break,
            Ok(_) => unreachable!("only the last line can lack its end"),
            Err(error) => return Err(format!("line {} is no record: {error}", i + 1)),
        }
    }
    Ok((records, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(name: &str) -> Key {
        Key { version: "1".to_owned(), experiment: BTreeMap::from([("name".to_owned(), name.to_owned())]) }
    }

    /// A journal in a folder of its own, which is removed first.
    fn place(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("rayset-journal-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        folder.join("deep/journal.jsonl")
    }

    #[test]
    fn a_journal_goes_on_where_it_stopped() {
        let path = place("resume");
        let mut journal = Journal::<u64>::open(&path).unwrap();
        journal.append(key("a"), 1).unwrap();
        drop(journal);
        let mut journal = Journal::<u64>::open(&path).unwrap();
        assert_eq!(journal.get(&key("a")), Some(&1));
        journal.append(key("b"), 2).unwrap();
        drop(journal);
        let journal = Journal::<u64>::read(&path).unwrap();
        assert_eq!((journal.len(), journal.get(&key("b"))), (2, Some(&2)));
        let text = fs::read_to_string(&path).unwrap();
        let first = r#"{"version":"1","experiment":{"name":"a"},"result":1}"#;
        assert_eq!(text.lines().next(), Some(first));
    }

    #[test]
    fn a_torn_last_line_is_dropped_wherever_it_is_torn() {
        let path = place("torn");
        let mut journal = Journal::<u64>::open(&path).unwrap();
        journal.append(key("a"), 1).unwrap();
        let whole = fs::read(&path).unwrap().len();
        journal.append(key("b"), 22).unwrap();
        drop(journal);
        let text = fs::read(&path).unwrap();
        for length in whole..text.len() {
            fs::write(&path, &text[..length]).unwrap();
            let mut journal = Journal::<u64>::open(&path).unwrap();
            assert_eq!((journal.len(), journal.get(&key("b"))), (1, None), "{length}");
            journal.append(key("b"), 22).unwrap();
            drop(journal);
            assert_eq!(fs::read(&path).unwrap(), text, "{length}");
        }
    }

    #[test]
    fn nothing_counts_twice() {
        let path = place("twice");
        let mut journal = Journal::<u64>::open(&path).unwrap();
        journal.append(key("a"), 1).unwrap();
        journal.append(key("a"), 2).unwrap();
        drop(journal);
        let line = fs::read_to_string(&path).unwrap();
        assert_eq!(line.lines().count(), 1);
        fs::write(&path, format!("{line}{}", line.replace(":1}", ":3}"))).unwrap();
        let journal = Journal::<u64>::open(&path).unwrap();
        assert_eq!((journal.len(), journal.get(&key("a"))), (1, Some(&1)));
    }

    #[test]
    fn damage_before_the_last_line_is_an_error_that_names_the_line() {
        let path = place("damage");
        let mut journal = Journal::<u64>::open(&path).unwrap();
        journal.append(key("a"), 1).unwrap();
        drop(journal);
        let line = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{line}nonsense\n{line}")).unwrap();
        let StudyError::Write { source, .. } = Journal::<u64>::open(&path).unwrap_err() else { panic!() };
        assert!(source.to_string().starts_with("line 2 is no record"), "{source}");
    }

    #[test]
    fn only_one_run_at_a_time_writes() {
        let path = place("lock");
        let journal = Journal::<u64>::open(&path).unwrap();
        assert!(Journal::<u64>::open(&path).is_err());
        drop(journal);
        assert!(Journal::<u64>::open(&path).is_ok());
    }

    #[test]
    fn other_versions_are_other_experiments() {
        let path = place("version");
        let mut journal = Journal::<u64>::open(&path).unwrap();
        journal.append(key("a"), 1).unwrap();
        assert_eq!(journal.get(&Key { version: "2".to_owned(), ..key("a") }), None);
    }
}
