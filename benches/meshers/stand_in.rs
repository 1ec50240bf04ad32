//! A slow mesher with the interface of the dense one, until that is there.
#![allow(unused)]
use bevy_burrow::surface::cases;
use std::collections::HashMap;
pub trait Density: Copy {
    fn f(self) -> f32;
}
impl Density for f32 {
    fn f(self) -> f32 {
        self
    }
}
impl Density for i16 {
    fn f(self) -> f32 {
        self as f32
    }
}
#[derive(Clone, Copy)]
pub struct DenseGrid<'a, S> {
    s: &'a [S],
    n: [usize; 3],
    apron: usize,
}
impl<'a, S: Density> DenseGrid<'a, S> {
    pub fn new(s: &'a [S], n: [usize; 3]) -> Result<Self, String> {
        Ok(Self { s, n, apron: 0 })
    }
    pub fn with_apron(s: &'a [S], n: [usize; 3]) -> Result<Self, String> {
        Ok(Self { s, n, apron: 1 })
    }
    fn at(&self, p: [usize; 3]) -> f32 {
        self.s[(p[2] * self.n[1] + p[1]) * self.n[0] + p[0]].f()
    }
}
#[derive(Default)]
pub struct DenseMesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub indices: Vec<u32>,
}
#[derive(Clone, Copy)]
pub enum Normals {
    None,
    Gradient,
}
pub struct DenseMesher(HashMap<(usize, [usize; 3]), u32>);
impl DenseMesher {
    pub fn new() -> Self {
        static SAID: std::sync::Once = std::sync::Once::new();
        SAID.call_once(|| {
            eprintln!("a slow stand-in meshes for us: figures named burrow are not those of the dense mesher")
        });
        Self(HashMap::new())
    }
    pub fn mesh<S: Density>(&mut self, g: DenseGrid<S>, n: Normals, out: &mut DenseMesh) {
        self.0.clear();
        out.positions.clear();
        out.normals.clear();
        out.indices.clear();
        let a = g.apron;
        for z in a..g.n[2] - 1 - a {
            for y in a..g.n[1] - 1 - a {
                for x in a..g.n[0] - 1 - a {
                    let c = |i: usize| {
                        let o = cases::corner(i);
                        [x + o[0] as usize, y + o[1] as usize, z + o[2] as usize]
                    };
                    let case = (0..8).filter(|&i| g.at(c(i)) < 0.0).fold(0, |m, i| m | 1 << i);
                    for t in cases::table()[case].triangles() {
                        for e in t {
                            let (low, axis) = cases::edge_corners(e);
                            let p = c(low);
                            let mut q = p;
                            q[axis] += 1;
                            let v = *self.0.entry((axis, p)).or_insert_with(|| {
                                let (d0, d1) = (g.at(p), g.at(q));
                                let mut pos = p.map(|v| v as f32);
                                pos[axis] += d0 / (d0 - d1);
                                out.positions.push(pos);
                                if matches!(n, Normals::Gradient) {
                                    out.normals.push([0.0, 1.0, 0.0]);
                                }
                                out.positions.len() as u32 - 1
                            });
                            out.indices.push(v);
                        }
                    }
                }
            }
        }
    }
}
