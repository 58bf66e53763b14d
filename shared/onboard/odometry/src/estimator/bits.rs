//! Flags of wheels and rows as the bits of a number, the first the lowest.

/// The number.
pub(crate) fn bits<const N: usize>(flags: [bool; N]) -> u8 {
    flags.iter().rev().fold(0, |bits, flag| (bits << 1) | u8::from(*flag))
}

/// The flags.
pub(crate) fn of_bits<const N: usize>(bits: u8) -> [bool; N] {
    core::array::from_fn(|index| bits.checked_shr(index as u32).unwrap_or(0) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_come_back() {
        for number in 0..64 {
            assert_eq!(bits(of_bits::<6>(number)), number);
        }
        assert_eq!(bits([true, false, false, true]), 0b1001);
    }
}
