//! Small integers in few bits: Rice codes that adapt to earlier values.
//!
//! A number u is written as `u >> k` ones, a zero, and the low k bits of u. Each [`Context`](super::predict::Context)
//! has its own k, which follows the mean of its last numbers. R. F. Rice, *Some Practical Universal Noiseless Coding
//! Techniques*, 1979.

use super::error::FormatError;
use super::predict::Context;

/// This number of ones means that all 16 bits follow.
const ESCAPE: u32 = 20;

/// Means of last numbers, times 8.
#[derive(Clone, Debug)]
struct Means([u32; Context::COUNT]);

impl Means {
    fn new() -> Self {
        Self([8 * 32; Context::COUNT])
    }

    /// The k of a context.
    fn bits(&self, context: Context) -> u32 {
        (self.0[context as usize] / 8).checked_ilog2().unwrap_or(0)
    }

    fn enter(&mut self, context: Context, number: u16) {
        let mean = &mut self.0[context as usize];
        *mean = *mean - *mean / 8 + u32::from(number);
    }
}

/// From signed to unsigned: numbers near 0 stay small.
fn fold(number: i16) -> u16 {
    (number << 1 ^ number >> 15).cast_unsigned()
}

fn unfold(folded: u16) -> i16 {
    (folded >> 1).cast_signed() ^ -(folded & 1).cast_signed()
}

/// Writes numbers, lowest bits first.
pub struct ResidualWriter {
    bytes: Vec<u8>,
    word: u64,
    filled: u32,
    means: Means,
}

impl ResidualWriter {
    pub fn new() -> Self {
        Self { bytes: Vec::new(), word: 0, filled: 0, means: Means::new() }
    }

    /// Appends a number.
    pub fn put(&mut self, context: Context, number: i16) {
        let (folded, k) = (fold(number), self.means.bits(context));
        let ones = u32::from(folded) >> k;
        if ones < ESCAPE {
            self.put_bits((1 << ones) - 1, ones + 1);
            self.put_bits(u64::from(folded) & ((1 << k) - 1), k);
        } else {
            self.put_bits((1 << ESCAPE) - 1, ESCAPE);
            self.put_bits(folded.into(), 16);
        }
        self.means.enter(context, folded);
    }

    /// Appends at most 32 bits.
    fn put_bits(&mut self, bits: u64, count: u32) {
        self.word |= bits << self.filled;
        self.filled += count;
        while self.filled >= 8 {
            self.bytes.push(self.word as u8);
            self.word >>= 8;
            self.filled -= 8;
        }
    }

    /// The bytes.
    pub fn end(mut self) -> Vec<u8> {
        if self.filled > 0 {
            self.bytes.push(self.word as u8);
        }
        self.bytes
    }
}

/// Reads what [`ResidualWriter`] wrote.
pub struct ResidualReader<'a> {
    bytes: &'a [u8],
    word: u64,
    filled: u32,
    means: Means,
}

impl<'a> ResidualReader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, word: 0, filled: 0, means: Means::new() }
    }

    /// The next number.
    pub fn next(&mut self, context: Context) -> Result<i16, FormatError> {
        while let (true, Some((&byte, rest))) = (self.filled <= 56, self.bytes.split_first()) {
            self.word |= u64::from(byte) << self.filled;
            self.filled += 8;
            self.bytes = rest;
        }
        let (ones, k) = (self.word.trailing_ones(), self.means.bits(context));
        let folded = if ones < ESCAPE {
            self.skip(ones + 1)?;
            (ones << k) as u64 | self.take(k)?
        } else {
            self.skip(ESCAPE)?;
            self.take(16)?
        };
        let folded = u16::try_from(folded).map_err(|_| FormatError::Invalid("density"))?;
        self.means.enter(context, folded);
        Ok(unfold(folded))
    }

    fn take(&mut self, count: u32) -> Result<u64, FormatError> {
        let bits = self.word & ((1 << count) - 1);
        self.skip(count)?;
        Ok(bits)
    }

    fn skip(&mut self, count: u32) -> Result<(), FormatError> {
        self.filled = self.filled.checked_sub(count).ok_or(FormatError::Truncated)?;
        self.word >>= count;
        Ok(())
    }

    /// Checks that everything except zero bits of the last byte has been read.
    pub fn end(self) -> Result<(), FormatError> {
        let is_end = self.bytes.is_empty() && self.filled < 8 && self.word == 0;
        if is_end { Ok(()) } else { Err(FormatError::Invalid("end of densities")) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_of_any_size_come_back(numbers: Vec<(u8, i16, u32)>) {
            let context = |number: u8| Context::ALL[usize::from(number) % Context::COUNT];
            let mut writer = ResidualWriter::new();
            numbers.iter().for_each(|&(at, number, few)| writer.put(context(at), number >> (few % 16)));
            let bytes = writer.end();
            let mut reader = ResidualReader::new(&bytes);
            for &(at, number, few) in &numbers {
                prop_assert_eq!(reader.next(context(at)), Ok(number >> (few % 16)));
            }
            prop_assert_eq!(reader.end(), Ok(()));
        }
    }
}
