//! Text compressed with gzip.

use std::io::{self, BufRead};
use std::path::Path;

/// Whether a file is gzip, by its first bytes or its name.
pub(super) fn is_compressed(reader: &mut impl BufRead, path: &Path) -> io::Result<bool> {
    let named = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    loop {
        match reader.fill_buf() {
            Ok(start) => return Ok(named || start.starts_with(&[0x1f, 0x8b])),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The text, of which no more than `limit` bytes are read.
#[cfg(feature = "gzip")]
#[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
pub(super) fn decompress(reader: impl BufRead, limit: u64) -> io::Result<impl BufRead> {
    let text = Limited { inner: flate2::bufread::MultiGzDecoder::new(reader), left: limit };
    Ok(io::BufReader::with_capacity(1 << 16, text))
}

/// Fails: there is no decoder.
#[cfg(not(feature = "gzip"))]
pub(super) fn decompress(_reader: impl BufRead, _limit: u64) -> io::Result<io::Empty> {
    let message = "it is compressed, and this build reads no gzip: its feature `gzip` is off";
    Err(io::Error::new(io::ErrorKind::Unsupported, message))
}

/// Reads at most so many bytes, and fails when there are more.
#[cfg(feature = "gzip")]
struct Limited<R> {
    inner: R,
    left: u64,
}

#[cfg(feature = "gzip")]
impl<R: io::Read> io::Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer).map_err(|error| match error.kind() {
            io::ErrorKind::Interrupted => error,
            kind => io::Error::new(kind, format!("the gzip data are damaged or end early: {error}")),
        })?;
        let too_large =
            || io::Error::new(io::ErrorKind::FileTooLarge, "it grows too large when decompressed");
        self.left = self.left.checked_sub(read as u64).ok_or_else(too_large)?;
        Ok(read)
    }
}
