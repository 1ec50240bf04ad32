//! The numbers a dense grid may hold, and how to read several of them at once.

use wide::{f32x4, f32x8, i8x16, i16x8, i16x16, i32x4};

/// A density: negative is solid, anything else is air, NaN and -0.0 included.
///
/// Implemented for `f32` and `i16`, and closed: the mesher is tuned to these two.
pub trait Density: sealed::Wide {}

impl Density for f32 {}
impl Density for i16 {}

pub(super) mod sealed {
    use super::f32x4;

    /// The operations on a density that the mesher needs.
    pub trait Wide: Copy {
        /// Returns `true` if this sample is solid.
        fn is_solid(self) -> bool;
        /// Bit `i` is set when sample `i` is solid.
        fn signs(samples: &[Self; 16]) -> u64;
        /// The sample as the number that all arithmetic is done in.
        fn number(self) -> f32;
        /// [`number`](Wide::number) of four samples.
        fn numbers(samples: [Self; 4]) -> f32x4;
    }
}

impl sealed::Wide for f32 {
    #[inline(always)]
    fn is_solid(self) -> bool {
        self < 0.0
    }

    #[inline(always)]
    fn signs(samples: &[Self; 16]) -> u64 {
        // Every comparison gives all ones or all zeros, so narrowing keeps it, and one instruction gathers 16 answers.
        let [low, high]: [f32x8; 2] = bytemuck::cast(*samples);
        let solid =
            [low, high].map(|eight| i16x8::from_i32x8_saturate(bytemuck::cast(eight.simd_lt(f32x8::ZERO))));
        u64::from(i8x16::from_i16x16_saturate(bytemuck::cast(solid)).to_bitmask())
    }

    #[inline(always)]
    fn number(self) -> f32 {
        self
    }

    #[inline(always)]
    fn numbers(samples: [Self; 4]) -> f32x4 {
        f32x4::new(samples)
    }
}

impl sealed::Wide for i16 {
    #[inline(always)]
    fn is_solid(self) -> bool {
        self < 0
    }

    #[inline(always)]
    fn signs(samples: &[Self; 16]) -> u64 {
        // Narrowing saturates, so it keeps the sign, and the bit mask is made of sign bits.
        let samples: i16x16 = bytemuck::cast(*samples);
        u64::from(i8x16::from_i16x16_saturate(samples).to_bitmask())
    }

    #[inline(always)]
    fn number(self) -> f32 {
        f32::from(self)
    }

    #[inline(always)]
    fn numbers([a, b, c, d]: [Self; 4]) -> f32x4 {
        f32x4::from_i32x4(i32x4::new([a.into(), b.into(), c.into(), d.into()]))
    }
}
