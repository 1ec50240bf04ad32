//! Meshes of plants and stones, made by code. In metres, with the foot at the origin, and coloured by vertex. Shared by
//! examples, benchmarks and tests, which include this file by path.
#![allow(dead_code, reason = "each includer uses its own part")]

use std::f32::consts::TAU;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;

/// A mesh under construction.
#[derive(Default)]
pub struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    colors: Vec<[f32; 4]>,
    indices: Vec<u32>,
}

/// A number from 0 to 1 that looks random.
fn random(seed: u32) -> f32 {
    let mixed = seed.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x2C1B_3C6D);
    (mixed ^ mixed >> 12) as f32 / u32::MAX as f32
}

impl Builder {
    fn vertex(&mut self, position: Vec3, normal: Vec3, color: Vec3) -> u32 {
        self.positions.push(position);
        self.normals.push(normal.normalize_or(Vec3::Y));
        self.colors.push(color.extend(1.0).to_array());
        self.positions.len() as u32 - 1
    }

    /// A blade of grass that leans outwards: three triangles, lit like the ground.
    pub fn blade(mut self, foot: Vec3, lean: Vec2, height: f32, width: f32, colors: (Vec3, Vec3)) -> Self {
        let side = Vec3::new(-lean.y, 0.0, lean.x).normalize_or(Vec3::X) * width / 2.0;
        let at = |t: f32| foot + Vec3::new(lean.x, 0.0, lean.y) * t * t + Vec3::Y * height * t;
        let color = |t: f32| colors.0.lerp(colors.1, t);
        let first = self.positions.len() as u32;
        for (t, wide) in [(0.0, 1.0), (0.55, 0.7)] {
            self.vertex(at(t) - side * wide, Vec3::Y, color(t));
            self.vertex(at(t) + side * wide, Vec3::Y, color(t));
        }
        self.vertex(at(1.0), Vec3::Y, color(1.0));
        self.indices.extend([0, 1, 2, 2, 1, 3, 2, 3, 4].map(|index| first + index));
        self
    }

    /// A cone or a part of one, open at its ends.
    pub fn cone(
        mut self,
        foot: Vec3,
        height: f32,
        radii: (f32, f32),
        sides: u32,
        colors: (Vec3, Vec3),
    ) -> Self {
        let first = self.positions.len() as u32;
        for side in 0..=sides {
            let (sin, cos) = (side as f32 / sides as f32 * TAU).sin_cos();
            let out = Vec3::new(cos, 0.0, sin);
            let normal = out * height + Vec3::Y * (radii.0 - radii.1);
            self.vertex(foot + out * radii.0, normal, colors.0);
            self.vertex(foot + out * radii.1 + Vec3::Y * height, normal, colors.1);
        }
        for side in 0..sides {
            let a = first + 2 * side;
            self.indices.extend([a, a + 1, a + 2, a + 2, a + 1, a + 3]);
        }
        self
    }

    /// Branches all round: a cone whose rim is a star of hanging tips, dark inside and light at the tips.
    pub fn branches(mut self, foot: Vec3, height: f32, radius: f32, tips: u32, colors: (Vec3, Vec3)) -> Self {
        let first = self.positions.len() as u32;
        self.vertex(foot + Vec3::Y * height, Vec3::Y, colors.0);
        for at in 0..2 * tips {
            let chance = random(first + at);
            let out = Vec2::from_angle((at as f32 + 0.5 * chance) / (2 * tips) as f32 * TAU);
            let is_tip = at % 2 == 0;
            let (far, up) = if is_tip { (1.0 - 0.2 * chance, -0.15 * chance) } else { (0.6, 0.2) };
            let place = foot + Vec3::new(out.x * far * radius, up * height, out.y * far * radius);
            let normal = Vec3::new(out.x, 0.6, out.y);
            let color = colors.0.lerp(colors.1, if is_tip { 0.75 + 0.25 * chance } else { 0.3 });
            self.vertex(place, normal, color);
        }
        for at in 0..2 * tips {
            self.indices.extend([first, first + 1 + (at + 1) % (2 * tips), first + 1 + at]);
        }
        self
    }

    /// A dented ball.
    pub fn blob(
        mut self,
        middle: Vec3,
        radii: Vec3,
        (rings, sides): (u32, u32),
        dents: f32,
        colors: (Vec3, Vec3),
    ) -> Self {
        let first = self.positions.len() as u32;
        for ring in 0..=rings {
            let (sin, cos) = (ring as f32 / rings as f32 * TAU / 2.0).sin_cos();
            for side in 0..=sides {
                let (z, x) = (side as f32 / sides as f32 * TAU).sin_cos();
                let out = Vec3::new(x * sin, -cos, z * sin);
                let is_pole = ring == 0 || ring == rings;
                let seed = first + if is_pole { ring } else { ring * sides + side % sides };
                let dent = 1.0 - dents * random(seed);
                let share = (0.5 - 0.5 * cos + 0.6 * (random(seed + 7) - 0.5)).clamp(0.0, 1.0);
                let bent = Vec3::new(random(seed + 11), random(seed + 13), random(seed + 17)) - 0.5;
                let normal = out / radii * radii.min_element() + 2.0 * dents * bent;
                self.vertex(middle + out * radii * dent, normal, colors.0.lerp(colors.1, share));
            }
        }
        for (ring, side) in (0..rings).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
            let a = first + ring * (sides + 1) + side;
            let b = a + sides + 1;
            self.indices.extend([a, b, a + 1, a + 1, b, b + 1]);
        }
        self
    }

    pub fn build(self) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals)
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, self.colors)
            .with_inserted_indices(Indices::U32(self.indices))
    }
}

const LEAF: (Vec3, Vec3) = (Vec3::new(0.03, 0.09, 0.02), Vec3::new(0.14, 0.27, 0.05));
const NEEDLE: (Vec3, Vec3) = (Vec3::new(0.015, 0.06, 0.025), Vec3::new(0.05, 0.15, 0.05));
const BARK: (Vec3, Vec3) = (Vec3::new(0.09, 0.05, 0.03), Vec3::new(0.15, 0.09, 0.05));
const ROCK: (Vec3, Vec3) = (Vec3::new(0.13, 0.12, 0.11), Vec3::new(0.3, 0.29, 0.27));
const BLADE: (Vec3, Vec3) = (Vec3::new(0.03, 0.07, 0.015), Vec3::new(0.2, 0.34, 0.08));

/// The blades of a tuft of grass.
pub const BLADES: u32 = 8;

/// A tuft of grass.
pub fn grass() -> Mesh {
    let blades = (0..BLADES).fold(Builder::default(), |all, blade| {
        let angle = (blade as f32 + random(blade)) / BLADES as f32 * TAU;
        let out = Vec2::from_angle(angle);
        let foot = out * 0.28 * random(blade + 20);
        let height = 0.32 + 0.3 * random(blade + 40);
        all.blade(Vec3::new(foot.x, -0.05, foot.y), out * 0.2, height, 0.05, BLADE)
    });
    blades.build()
}

/// A tuft of grass for farther away: few blades, each a wider triangle.
pub fn far_grass() -> Mesh {
    let blades = (0..4).fold(Builder::default(), |mut all, blade| {
        let out = Vec2::from_angle((blade as f32 + 0.3) / 4.0 * TAU);
        let side = Vec3::new(-out.y, 0.0, out.x) * 0.07;
        let foot = Vec3::new(out.x, 0.0, out.y) * 0.16 - Vec3::Y * 0.05;
        let tip = Vec3::new(out.x, 0.0, out.y) * 0.3 + Vec3::Y * (0.36 + 0.05 * blade as f32);
        let low = BLADE.0.lerp(BLADE.1, 0.2);
        let corners = [(foot - side, low), (foot + side, low), (tip, BLADE.0.lerp(BLADE.1, 0.85))];
        let corners = corners.map(|(at, color)| all.vertex(at, Vec3::Y, color));
        all.indices.extend(corners);
        all
    });
    blades.build()
}

/// A flower with a yellow middle.
pub fn flower() -> Mesh {
    let petal = (Vec3::new(0.75, 0.72, 0.8), Vec3::new(0.55, 0.25, 0.7));
    let stem = Builder::default().cone(Vec3::NEG_Y * 0.05, 0.42, (0.012, 0.01), 3, BLADE);
    let petals = (0..5).fold(stem, |all, petal_at| {
        let out = Vec2::from_angle(petal_at as f32 / 5.0 * TAU);
        all.blade(Vec3::Y * 0.36, out * 0.13, 0.05, 0.11, petal)
    });
    let yellow = Vec3::new(0.8, 0.55, 0.05);
    petals.blob(Vec3::Y * 0.38, Vec3::new(0.035, 0.02, 0.035), (3, 5), 0.0, (yellow, yellow)).build()
}

/// A stone, half in the ground.
pub fn stone() -> Mesh {
    Builder::default().blob(Vec3::Y * 0.1, Vec3::new(0.42, 0.3, 0.34), (5, 8), 0.35, ROCK).build()
}

/// A bush.
pub fn bush() -> Mesh {
    let clumps = [
        (Vec3::new(0.0, 0.55, 0.0), 0.62),
        (Vec3::new(0.5, 0.4, 0.15), 0.42),
        (Vec3::new(-0.35, 0.38, -0.4), 0.45),
    ];
    let all = clumps
        .into_iter()
        .fold(Builder::default(), |all, (at, radius)| all.blob(at, Vec3::splat(radius), (5, 8), 0.35, LEAF));
    all.build()
}

/// A fir, 9 m high.
pub fn fir() -> Mesh {
    let trunk = Builder::default().cone(Vec3::NEG_Y * 0.4, 3.0, (0.28, 0.18), 7, BARK);
    let layers = (0..6).fold(trunk, |all, layer| {
        let at = layer as f32 / 6.0;
        let radius = 1.9 * (1.0 - at) + 0.35;
        all.branches(Vec3::Y * (1.3 + 6.4 * at), 2.2, radius, 7, NEEDLE)
    });
    layers.build()
}

/// A fir far away.
pub fn far_fir() -> Mesh {
    let trunk = Builder::default().cone(Vec3::NEG_Y * 0.4, 2.0, (0.28, 0.24), 3, BARK);
    let low = trunk.branches(Vec3::Y * 1.3, 4.6, 2.2, 3, NEEDLE);
    low.branches(Vec3::Y * 4.6, 4.4, 1.3, 3, NEEDLE).build()
}

/// An oak, 7 m high.
pub fn oak() -> Mesh {
    let trunk = Builder::default().cone(Vec3::NEG_Y * 0.4, 3.6, (0.36, 0.22), 7, BARK);
    let crown = [
        (Vec3::new(0.0, 4.9, 0.0), Vec3::new(2.2, 1.9, 2.2)),
        (Vec3::new(1.4, 4.0, 0.6), Vec3::new(1.5, 1.2, 1.4)),
        (Vec3::new(-1.2, 4.2, -0.9), Vec3::new(1.5, 1.3, 1.5)),
        (Vec3::new(-0.4, 3.8, 1.4), Vec3::new(1.3, 1.0, 1.2)),
    ];
    let all = crown.into_iter().fold(trunk, |all, (at, radii)| all.blob(at, radii, (6, 9), 0.28, LEAF));
    all.build()
}

/// An oak far away.
pub fn far_oak() -> Mesh {
    let trunk = Builder::default().cone(Vec3::ZERO, 3.5, (0.36, 0.3), 3, BARK);
    trunk.blob(Vec3::Y * 4.6, Vec3::new(2.5, 2.1, 2.5), (3, 5), 0.1, LEAF).build()
}
