//! From a stream of bytes to messages.

use crate::errors::FrameError;
use crate::frame::{MAX_CONTENT, MAX_ENCODED, open};

/// Collects bytes up to a delimiter. Whatever comes, the next delimiter begins anew.
#[derive(Clone, Debug)]
pub(crate) struct Receiver {
    buffer: [u8; MAX_ENCODED],
    length: usize,
    overlong: bool,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self { buffer: [0; MAX_ENCODED], length: 0, overlong: false }
    }

    /// Forgets a frame begun.
    pub(crate) fn clear(&mut self) {
        (self.length, self.overlong) = (0, false);
    }

    /// Calls `sink` with each message that `bytes` complete, or with why there is none.
    pub(crate) fn receive(
        &mut self,
        bytes: &[u8],
        mut sink: impl FnMut(Result<&[u8], FrameError>),
    ) {
        let mut content = [0; MAX_CONTENT];
        let mut rest = bytes;
        while let Some(end) = rest.iter().position(|byte| *byte == 0) {
            let part = &rest[..end];
            rest = &rest[end + 1..];
            // A frame that arrives in one piece, the usual case, is opened where it lies.
            if self.length == 0 && !self.overlong {
                pass(part, &mut content, &mut sink);
            } else {
                self.collect(part);
                self.complete(&mut content, &mut sink);
            }
        }
        self.collect(rest);
    }

    fn collect(&mut self, part: &[u8]) {
        let end = self.length + part.len();
        if self.overlong || end > MAX_ENCODED {
            self.overlong = true;
        } else {
            self.buffer[self.length..end].copy_from_slice(part);
            self.length = end;
        }
    }

    fn complete(
        &mut self,
        content: &mut [u8; MAX_CONTENT],
        sink: &mut impl FnMut(Result<&[u8], FrameError>),
    ) {
        if self.overlong {
            sink(Err(FrameError::Overlong));
        } else {
            pass(&self.buffer[..self.length], content, sink);
        }
        self.clear();
    }
}

/// Nothing between two delimiters is no error: every frame brings both of its own.
fn pass(
    encoded: &[u8],
    content: &mut [u8; MAX_CONTENT],
    sink: &mut impl FnMut(Result<&[u8], FrameError>),
) {
    match encoded.len() {
        0 => {}
        1..=MAX_ENCODED => sink(open(encoded, content)),
        _ => sink(Err(FrameError::Overlong)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Frame;

    fn heard(chunks: &[&[u8]]) -> Vec<Result<Vec<u8>, FrameError>> {
        let mut receiver = Receiver::new();
        let mut heard = Vec::new();
        for chunk in chunks {
            receiver.receive(chunk, |message| heard.push(message.map(<[u8]>::to_vec)));
        }
        heard
    }

    #[test]
    fn a_frame_split_anywhere_is_heard_once() {
        let frame = Frame::seal(b"a\0bc\0\0d");
        for first in 0..=frame.len() {
            for second in first..=frame.len() {
                let chunks = [&frame[..first], &frame[first..second], &frame[second..]];
                assert_eq!(heard(&chunks), [Ok(b"a\0bc\0\0d".to_vec())], "{first} {second}");
            }
        }
    }

    #[test]
    fn overlong_runs_are_one_error_however_they_arrive() {
        let mut run = vec![7; 1000];
        run.push(0);
        let frame = Frame::seal(b"next");
        let expected = [Err(FrameError::Overlong), Ok(b"next".to_vec())];
        assert_eq!(heard(&[&run, &frame]), expected);
        let bytes: Vec<&[u8]> = run.chunks(1).collect();
        assert_eq!(heard(&[&bytes[..], &[&frame]].concat()), expected);
    }

    #[test]
    fn clearing_forgets_the_frame_begun() {
        let frame = Frame::seal(b"message");
        let mut receiver = Receiver::new();
        let mut count = 0;
        receiver.receive(&frame[..5], |_| count += 1);
        receiver.clear();
        receiver.receive(&[0], |_| count += 1);
        assert_eq!(count, 0);
    }
}
