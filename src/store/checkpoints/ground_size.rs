//! The size of a world's ground, which is saved among the game's data: older versions of the crate treat it as such.

use std::fmt;

use crate::ground::Ground;

/// The key of the size among the game's data. Games have no such keys.
const KEY: &str = "burrow/ground-size";

/// Cells along x and along z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) struct GroundSize {
    pub width: u32,
    pub depth: u32,
}

impl GroundSize {
    /// The size of a ground.
    pub fn of(ground: &Ground) -> Self {
        let [width, depth] = [ground.width(), ground.depth()].map(|cells| u32::try_from(cells).unwrap_or(0));
        Self { width, depth }
    }

    /// Whether a ground of another size has all of its columns.
    pub fn fits_in(self, other: Self) -> bool {
        self.width <= other.width && self.depth <= other.depth
    }

    /// Puts it among the game's data.
    pub fn put(self, game: &mut Vec<(String, Vec<u8>)>) {
        let bytes = [self.width.to_le_bytes(), self.depth.to_le_bytes()].concat();
        game.retain(|(key, _)| key != KEY);
        game.push((KEY.into(), bytes));
    }

    /// Takes it out of the game's data, if it is there.
    pub fn take(game: &mut Vec<(String, Vec<u8>)>) -> Option<Self> {
        let at = game.iter().position(|(key, _)| key == KEY)?;
        let (_, bytes) = game.remove(at);
        let (width, depth) = bytes.split_first_chunk::<4>()?;
        let (width, depth) = (u32::from_le_bytes(*width), u32::from_le_bytes(depth.try_into().ok()?));
        Some(Self { width, depth })
    }
}

impl fmt::Display for GroundSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {} cells", self.width, self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_comes_back_and_leaves_no_trace() {
        let size = GroundSize { width: 128, depth: 70_000 };
        let mut game = vec![("a".to_owned(), vec![1]), ("z".to_owned(), vec![])];
        let before = game.clone();
        assert_eq!(GroundSize::take(&mut game), None);
        size.put(&mut game);
        size.put(&mut game);
        assert_eq!(GroundSize::take(&mut game), Some(size));
        assert_eq!(game, before);
        game.push((KEY.into(), vec![1, 2]));
        assert_eq!(GroundSize::take(&mut game), None);
    }
}
