//! A bounded buffer of lines in a terrain's space.

use bevy::prelude::*;

/// Lines of one width.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    pub lines: Vec<(Vec3, Vec3, LinearRgba)>,
    pub width: f32,
}

/// Collects the lines of a view up to a limit.
#[derive(Clone, Debug)]
pub struct LineBuffer {
    layers: Vec<Layer>,
    room: usize,
}

impl LineBuffer {
    /// A buffer for at most `max_lines` lines.
    pub fn new(max_lines: usize) -> Self {
        Self { layers: Vec::new(), room: max_lines }
    }

    /// Sets the width of the following lines, in pixels.
    pub fn width(&mut self, width: f32) {
        self.layers.push(Layer { lines: Vec::new(), width });
    }

    /// Whether the limit is reached.
    pub fn is_full(&self) -> bool {
        self.room == 0
    }

    pub fn line(&mut self, from: Vec3, to: Vec3, color: LinearRgba) {
        let Some(room) = self.room.checked_sub(1) else { return };
        self.room = room;
        if self.layers.is_empty() {
            self.width(2.0);
        }
        if let Some(layer) = self.layers.last_mut() {
            layer.lines.push((from, to, color));
        }
    }

    /// The twelve edges of a box.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3, color: LinearRgba) {
        let corner = |bits: usize| {
            let part = |axis: usize| if bits >> axis & 1 == 1 { max[axis] } else { min[axis] };
            Vec3::new(part(0), part(1), part(2))
        };
        for from in 0..8 {
            for axis in (0..3).filter(|axis| from >> axis & 1 == 0) {
                self.line(corner(from), corner(from | 1 << axis), color);
            }
        }
    }

    pub fn triangle(&mut self, [a, b, c]: [Vec3; 3], color: LinearRgba) {
        self.line(a, b, color);
        self.line(b, c, color);
        self.line(c, a, color);
    }

    /// The lines by width; widths without lines are left out.
    pub fn finish(mut self) -> Vec<Layer> {
        self.layers.retain(|layer| !layer.lines.is_empty());
        self.layers
    }
}
