//! What is known of points of air under roofs.

use glam::IVec3;

/// Values of points of the lattice, at every second place along each axis, for which neighbours ask again and again. A
/// later one may replace an earlier one, which then has to be computed again.
pub(crate) struct AirMemory<T> {
    /// The values of points that lie this far apart along an axis replace each other: the binary logarithm.
    side_log: u32,
    /// Empty until something is kept.
    entries: Vec<Option<(IVec3, T)>>,
}

impl<T: Copy> AirMemory<T> {
    /// For places that lie within a cube of this side, as a binary logarithm, or ask for the same points soon.
    pub fn new(side_log: u32) -> Self {
        Self { side_log, entries: Vec::new() }
    }

    fn place(&self, point: IVec3) -> usize {
        let bits = self.side_log - 1;
        let IVec3 { x, y, z } = (point >> 1) & ((1 << bits) - 1);
        ((y << bits | z) << bits | x) as usize
    }

    /// The value that is kept for a point.
    pub fn get(&self, point: IVec3) -> Option<T> {
        let &(at, value) = self.entries.get(self.place(point))?.as_ref()?;
        (at == point).then_some(value)
    }

    /// Keeps a value of a point.
    pub fn keep(&mut self, point: IVec3, value: T) {
        if self.entries.is_empty() {
            self.entries.resize(1 << (3 * (self.side_log - 1)), None);
        }
        let place = self.place(point);
        if let Some(entry) = self.entries.get_mut(place) {
            *entry = Some((point, value));
        }
    }
}
