//! A message between delimiters: COBS and check sum.

use core::ops::Deref;

use crate::errors::FrameError;

/// Longest type and fields: a READING with four wide counts, four speeds, steering and yaw rate.
pub(crate) const MAX_FIELDS: usize = 23 + 4 * 8 + 4 * 4 + 4 + 4;

/// Bytes of the check sum.
const CHECK_SUM: usize = 4;

/// Longest content of a frame: type, fields and check sum.
pub(crate) const MAX_CONTENT: usize = MAX_FIELDS + CHECK_SUM;

/// Longest run between two delimiters. COBS adds one byte to up to 254.
pub(crate) const MAX_ENCODED: usize = MAX_CONTENT + 1;

/// Longest frame on the wire, with the delimiters on both sides \[bytes\].
pub const MAX_FRAME: usize = MAX_ENCODED + 2;

const _: () = assert!(MAX_CONTENT <= 254 && MAX_FRAME == 86);

/// A frame ready to be written to the line; it is a slice of bytes.
#[derive(Clone, Copy)]
pub struct Frame {
    bytes: [u8; MAX_FRAME],
    length: usize,
}

impl Frame {
    /// The frame of a message of at most [`MAX_FIELDS`] bytes.
    pub(crate) fn seal(message: &[u8]) -> Self {
        let end = message.len();
        let mut content = [0; MAX_CONTENT];
        content[..end].copy_from_slice(message);
        content[end..end + CHECK_SUM].copy_from_slice(&crc32fast::hash(message).to_le_bytes());
        let mut bytes = [0; MAX_FRAME];
        let length = cobs::encode_including_sentinels(&content[..end + CHECK_SUM], &mut bytes);
        Self { bytes, length }
    }
}

impl Deref for Frame {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl core::fmt::Debug for Frame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Frame({:02x?})", &**self)
    }
}

/// The message in what stood between two delimiters, unpacked into `content`.
pub(crate) fn open<'a>(
    encoded: &[u8],
    content: &'a mut [u8; MAX_CONTENT],
) -> Result<&'a [u8], FrameError> {
    let length = cobs::decode(encoded, content)
        .map_err(|error| match error {
            cobs::DecodeError::TargetBufTooSmall => FrameError::Overlong,
            _ => FrameError::Malformed,
        })?
        .frame_size();
    let (message, sum) =
        content[..length].split_last_chunk::<CHECK_SUM>().ok_or(FrameError::Length)?;
    if crc32fast::hash(message) == u32::from_le_bytes(*sum) {
        Ok(message)
    } else {
        Err(FrameError::CheckSum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_sum_is_the_common_crc_32() {
        assert_eq!(crc32fast::hash(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn a_frame_has_zeros_only_at_its_ends_and_opens_to_its_message() {
        for length in 0..=MAX_FIELDS {
            let message = [0; MAX_FIELDS];
            let frame = Frame::seal(&message[..length]);
            let (inside, [first, last]) =
                (&frame[1..frame.len() - 1], [frame[0], frame[frame.len() - 1]]);
            assert!(first == 0 && last == 0 && !inside.contains(&0));
            assert_eq!(open(inside, &mut [0; MAX_CONTENT]), Ok(&message[..length]));
        }
    }

    #[test]
    fn what_is_shorter_than_a_check_sum_is_refused() {
        assert_eq!(open(&[4, 1, 2, 3], &mut [0; MAX_CONTENT]), Err(FrameError::Length));
        assert_eq!(open(&[9, 1, 2, 3], &mut [0; MAX_CONTENT]), Err(FrameError::Malformed));
    }
}
