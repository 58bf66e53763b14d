//! Lines from a stream, in bounded memory.

/// Collects bytes into lines that end with a newline.
#[derive(Debug)]
pub struct Lines {
    bytes: Vec<u8>,
    /// Bytes before it hold no newline.
    searched: usize,
    longest: usize,
}

/// Bytes without an end: the line is longer than it may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found} bytes without a newline, allowed are gateway.line_length = {longest}")]
pub struct TooLong {
    /// So many came.
    pub found: usize,
    /// So many may come.
    pub longest: usize,
}

impl Lines {
    /// Lines of at most `longest` bytes, the newline not counted.
    #[must_use]
    pub fn new(longest: usize) -> Self {
        Self { bytes: Vec::new(), searched: 0, longest }
    }

    /// Room for more bytes: never more than complete the longest line.
    #[must_use]
    pub fn room(&self) -> usize {
        (self.longest + 1).saturating_sub(self.bytes.len())
    }

    /// Takes bytes in; those beyond [`Lines::room`] would be held all the same, so read no more than that.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Whether a whole line is there.
    pub fn has_line(&mut self) -> bool {
        self.end().is_some()
    }

    fn end(&mut self) -> Option<usize> {
        let found = self.bytes[self.searched..].iter().position(|byte| *byte == b'\n');
        match found {
            Some(at) => Some(self.searched + at),
            None => {
                self.searched = self.bytes.len();
                None
            }
        }
    }

    /// The next line, without its newline; none before it is whole.
    ///
    /// # Errors
    /// [`TooLong`] where it will not end within what is allowed.
    pub fn take(&mut self) -> Result<Option<Vec<u8>>, TooLong> {
        let Some(end) = self.end() else {
            let found = self.bytes.len();
            return if found > self.longest {
                Err(TooLong { found, longest: self.longest })
            } else {
                Ok(None)
            };
        };
        let rest = self.bytes.split_off(end + 1);
        let mut line = core::mem::replace(&mut self.bytes, rest);
        self.searched = 0;
        line.truncate(end);
        Ok(Some(line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All lines of `bytes`, handed over in pieces of `piece` bytes as a reader with that buffer would.
    fn read(bytes: &[u8], piece: usize, longest: usize) -> (Vec<Vec<u8>>, Result<(), TooLong>) {
        let mut lines = Lines::new(longest);
        let (mut found, mut rest) = (Vec::new(), bytes);
        loop {
            match lines.take() {
                Ok(Some(line)) => found.push(line),
                Ok(None) if rest.is_empty() => return (found, Ok(())),
                Ok(None) => {
                    let (next, after) = rest.split_at(piece.min(lines.room()).min(rest.len()));
                    lines.push(next);
                    rest = after;
                }
                Err(error) => return (found, Err(error)),
            }
            assert!(lines.bytes.len() <= longest + 1);
        }
    }

    #[test]
    fn lines_do_not_depend_on_the_pieces_they_come_in() {
        let text = b"one\n\ntwo\nthree";
        for piece in 1..text.len() + 1 {
            let (lines, end) = read(text, piece, 8);
            assert_eq!(lines, [&b"one"[..], b"", b"two"], "{piece}");
            assert_eq!(end, Ok(()));
        }
    }

    #[test]
    fn a_line_may_be_as_long_as_allowed_and_no_longer() {
        assert_eq!(read(b"12345678\n", 3, 8), (vec![b"12345678".to_vec()], Ok(())));
        let (lines, end) = read(b"a\n123456789\nb\n", 3, 8);
        assert_eq!(lines, [b"a"]);
        assert_eq!(end, Err(TooLong { found: 9, longest: 8 }));
        // One that never ends takes no more memory than that.
        assert!(read(&[0; 100_000], 4096, 1024).1.is_err());
    }
}
