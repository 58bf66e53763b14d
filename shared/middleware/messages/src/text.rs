//! Short texts in fixed arrays: UTF-8, filled up with zeros.

/// `text` in an array of `N` bytes, cut at a character boundary where it is longer.
#[must_use]
pub fn from_str<const N: usize>(text: &str) -> [u8; N] {
    let mut end = text.len().min(N);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut bytes = [0; N];
    bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
    bytes
}

/// The text up to the first zero; what is not UTF-8 (a hostile sample) is cut off.
#[must_use]
pub fn as_str(bytes: &[u8]) -> &str {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    match core::str::from_utf8(&bytes[..end]) {
        Ok(text) => text,
        Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_come_back_and_are_cut_between_characters() {
        assert_eq!(as_str(&from_str::<8>("tracker")), "tracker");
        assert_eq!(as_str(&from_str::<4>("aaaé")), "aaa");
        assert_eq!(as_str(&[b'o', b'k', 0xff, b'x']), "ok");
    }
}
