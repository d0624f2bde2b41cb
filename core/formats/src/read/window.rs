//! Buffered reading that keeps its buffer over small seeks and stops when the caller cancels.

use std::io::{self, Read, Seek, SeekFrom};

/// Number of bytes read from the system at once.
const WINDOW: usize = 1 << 18;

/// A reader behind a buffer.
///
/// Readers of E57 pages seek before every page, where `BufReader` would discard its buffer. `alive` is called before
/// every refill: on a slow share that is the only place where a cancelled job can be noticed.
pub(super) struct Window<'a, R> {
    file: R,
    alive: &'a (dyn Fn() -> bool + Sync),
    held: Vec<u8>,
    /// Offset in the file of the first byte in the buffer.
    start: u64,
    /// Offset in the file of the next byte to return.
    position: u64,
}

impl<'a, R: Read + Seek> Window<'a, R> {
    /// Starts at the beginning of `file`.
    pub(super) fn new(file: R, alive: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { file, alive, held: Vec::new(), start: 0, position: 0 }
    }

    fn refill(&mut self) -> io::Result<()> {
        if !(self.alive)() {
            return Err(io::Error::other("the job was cancelled"));
        }
        self.file.seek(SeekFrom::Start(self.position))?;
        self.start = self.position;
        self.held.clear();
        self.file.by_ref().take(WINDOW as u64).read_to_end(&mut self.held)?;
        Ok(())
    }

    /// Returns the buffered bytes from the position on.
    fn rest(&self) -> &[u8] {
        let behind = self.position.checked_sub(self.start).and_then(|n| usize::try_from(n).ok());
        behind.and_then(|n| self.held.get(n..)).unwrap_or(&[])
    }
}

impl<R: Read + Seek> Read for Window<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.rest().is_empty() && !out.is_empty() {
            self.refill()?;
        }
        let rest = self.rest();
        let n = rest.len().min(out.len());
        out[..n].copy_from_slice(&rest[..n]);
        self.position += n as u64;
        Ok(n)
    }
}

impl<R: Read + Seek> Seek for Window<'_, R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = match to {
            SeekFrom::Start(position) => position,
            SeekFrom::Current(by) => self
                .position
                .checked_add_signed(by)
                .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "seek before the start"))?,
            SeekFrom::End(_) => self.file.seek(to)?,
        };
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_what_lies_there_wherever_one_seeks() {
        let bytes: Vec<u8> = (0..3 * WINDOW + 17).map(|i| (i / 7 * 31 + i) as u8).collect();
        let alive = || true;
        let mut window = Window::new(io::Cursor::new(&bytes), &alive);
        for place in [0, 5, WINDOW - 3, 2 * WINDOW + 1, 1, 3 * WINDOW, 3 * WINDOW + 10] {
            window.seek(SeekFrom::Start(place as u64)).unwrap();
            let mut read = vec![0; 7];
            window.read_exact(&mut read).unwrap();
            assert_eq!(read, bytes[place..place + 7], "at {place}");
        }
        assert_eq!(window.seek(SeekFrom::Current(-7)).unwrap(), 3 * WINDOW as u64 + 10);
        assert_eq!(window.seek(SeekFrom::End(-2)).unwrap(), bytes.len() as u64 - 2);
        let mut rest = Vec::new();
        assert_eq!(window.read_to_end(&mut rest).unwrap(), 2);
        window.seek(SeekFrom::Start(1 << 40)).unwrap();
        assert_eq!(window.read(&mut [0; 4]).unwrap(), 0);
    }

    #[test]
    fn a_cancelled_job_reads_no_further() {
        let alive = || false;
        let mut window = Window::new(io::Cursor::new([1_u8; 100]), &alive);
        assert!(window.read(&mut [0; 4]).is_err());
    }
}
