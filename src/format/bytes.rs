//! The encoding of numbers: integers of variable length, and a reader that never reads beyond its end.

use super::error::FormatError;

/// Appends an integer, 7 bits a byte from the lowest up; the last byte is below 128.
pub fn put_number(to: &mut Vec<u8>, mut number: u64) {
    while number >= 128 {
        to.push(number as u8 | 128);
        number >>= 7;
    }
    to.push(number as u8);
}

/// Appends an integer of either sign: small ones of both are short.
pub fn put_signed(to: &mut Vec<u8>, number: i64) {
    put_number(to, (number << 1 ^ number >> 63).cast_unsigned());
}

/// Appends the number of bytes, then the bytes.
pub fn put_bytes(to: &mut Vec<u8>, bytes: &[u8]) {
    put_number(to, bytes.len() as u64);
    to.extend_from_slice(bytes);
}

/// Bytes that are read from the front.
#[derive(Clone, Debug)]
pub struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    /// The next bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(FormatError::Truncated)?;
        self.0 = rest;
        Ok(taken)
    }

    /// The next bytes, as many as an array has.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], FormatError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(FormatError::Truncated)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub fn byte(&mut self) -> Result<u8, FormatError> {
        self.array().map(|[byte]| byte)
    }

    /// Reads an integer that [`put_number`] wrote.
    pub fn number(&mut self) -> Result<u64, FormatError> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 127);
            if bits << shift >> shift != bits {
                break;
            }
            number |= bits << shift;
            if byte < 128 {
                return Ok(number);
            }
        }
        Err(FormatError::Invalid("number"))
    }

    /// What [`put_signed`] appended.
    pub fn signed(&mut self) -> Result<i64, FormatError> {
        let number = self.number()?;
        Ok((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }

    /// A number of things that take at least a byte each: never more than bytes are left.
    pub fn count(&mut self) -> Result<usize, FormatError> {
        let count = self.number()?;
        usize::try_from(count).ok().filter(|&count| count <= self.0.len()).ok_or(FormatError::Truncated)
    }

    /// What [`put_bytes`] appended.
    pub fn bytes(&mut self) -> Result<&'a [u8], FormatError> {
        let count = self.count()?;
        self.take(count)
    }

    /// Checks that everything has been read.
    pub fn end(self) -> Result<(), FormatError> {
        if self.0.is_empty() { Ok(()) } else { Err(FormatError::Invalid("end: more follows")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_come_back(numbers: Vec<(u64, i64)>, few in 0..64u32) {
            let mut bytes = Vec::new();
            for &(number, signed) in &numbers {
                put_number(&mut bytes, number >> few);
                put_signed(&mut bytes, signed >> few);
            }
            let mut reader = Reader(&bytes);
            for &(number, signed) in &numbers {
                prop_assert_eq!(reader.number(), Ok(number >> few));
                prop_assert_eq!(reader.signed(), Ok(signed >> few));
            }
            prop_assert_eq!(reader.end(), Ok(()));
        }
    }

    #[test]
    fn numbers_of_more_than_64_bits_are_none() {
        for bytes in [&[255; 10][..], &[255, 255, 255, 255, 255, 255, 255, 255, 255, 2], &[128; 11]] {
            assert_eq!(Reader(bytes).number(), Err(FormatError::Invalid("number")));
        }
        assert_eq!(Reader(&[255; 9]).number(), Err(FormatError::Truncated));
    }
}
