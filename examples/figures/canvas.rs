//! An SVG drawing in voxels, with y up.

use std::fmt::Write;

use glam::Vec2;

/// Pixels of margin around the drawing.
const MARGIN: f32 = 8.0;

/// A drawing of a rectangle of the world.
pub struct Canvas {
    min: Vec2,
    max: Vec2,
    /// Pixels of a voxel.
    scale: f32,
    body: String,
}

impl Canvas {
    pub fn new(min: Vec2, max: Vec2, scale: f32) -> Self {
        Self { min, max, scale, body: String::new() }
    }

    fn place(&self, at: Vec2) -> Vec2 {
        Vec2::new(at.x - self.min.x, self.max.y - at.y) * self.scale + MARGIN
    }

    fn points(&self, points: &[Vec2]) -> String {
        let mut text = String::new();
        for point in points.iter().map(|&point| self.place(point)) {
            let _ = write!(text, "{:.1},{:.1} ", point.x, point.y);
        }
        text.trim_end().into()
    }

    /// A line through points, `width` pixels wide.
    pub fn line(&mut self, points: &[Vec2], color: &str, width: f32) {
        let points = self.points(points);
        let _ = writeln!(
            self.body,
            r#"<polyline points="{points}" fill="none" stroke="{color}" stroke-width="{width}"/>"#
        );
    }

    /// A dashed rectangle.
    pub fn frame(&mut self, min: Vec2, max: Vec2, color: &str) {
        let points = self.points(&[min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)]);
        let _ = writeln!(
            self.body,
            r#"<polygon points="{points}" fill="none" stroke="{color}" stroke-width="2" stroke-dasharray="7 5"/>"#
        );
    }

    /// A filled polygon with a thin border.
    pub fn polygon(&mut self, points: &[Vec2], fill: &str, border: &str) {
        let points = self.points(points);
        let _ = writeln!(
            self.body,
            r#"<polygon points="{points}" fill="{fill}" stroke="{border}" stroke-width="0.6" stroke-linejoin="round"/>"#
        );
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, min: Vec2, max: Vec2, fill: &str) {
        let (low, size) = (self.place(Vec2::new(min.x, max.y)), (max - min) * self.scale);
        let _ = writeln!(
            self.body,
            r#"<rect x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}" fill="{fill}"/>"#,
            low.x, low.y, size.x, size.y
        );
    }

    /// A dot of `radius` pixels.
    pub fn dot(&mut self, at: Vec2, radius: f32, fill: &str, border: &str) {
        let at = self.place(at);
        let _ = writeln!(
            self.body,
            r#"<circle cx="{:.1}" cy="{:.1}" r="{radius}" fill="{fill}" stroke="{border}"/>"#,
            at.x, at.y
        );
    }

    /// A label whose left end is at a place.
    pub fn label(&mut self, at: Vec2, text: &str, color: &str) {
        let at = self.place(at);
        let _ = writeln!(self.body, r#"<text x="{:.1}" y="{:.1}" fill="{color}">{text}</text>"#, at.x, at.y);
    }

    /// The whole file.
    pub fn finish(self) -> String {
        let size = (self.max - self.min) * self.scale + 2.0 * MARGIN;
        let (width, height) = (size.x.round(), size.y.round());
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fbfaf7\"/>\n{}</svg>\n",
            self.body
        )
    }
}
