//! Formatted text in fixed arrays: the supervisor speaks without allocating.

use core::fmt::{Arguments, Write};

struct Line<const N: usize> {
    bytes: [u8; N],
    used: usize,
}

impl<const N: usize> Write for Line<N> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let mut end = text.len().min(N - self.used);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.bytes[self.used..self.used + end].copy_from_slice(&text.as_bytes()[..end]);
        self.used += end;
        if end == text.len() { Ok(()) } else { Err(core::fmt::Error) }
    }
}

/// The formatted text, UTF-8, filled up with zeros, cut where it is longer than `N` bytes.
pub(crate) fn line<const N: usize>(text: Arguments<'_>) -> [u8; N] {
    let mut line = Line { bytes: [0; N], used: 0 };
    // An error means that the text is full: what fits stays.
    let _ = line.write_fmt(text);
    line.bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::text::as_str;

    #[test]
    fn texts_are_cut_between_characters() {
        assert_eq!(as_str(&line::<16>(format_args!("{} {}", "arm", 3))), "arm 3");
        assert_eq!(as_str(&line::<4>(format_args!("{}{}", "aaa", "é"))), "aaa");
        assert_eq!(as_str(&line::<4>(format_args!("{}{}", "aaaa", "b"))), "aaaa");
    }
}
