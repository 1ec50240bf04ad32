//! What a frame shows: the meshes of tiles and chunks in GPU precision, welded where all bits are equal.

use std::collections::HashMap;

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;

use crate::stage::Stage;

/// How well the triangles of a terrain close.
#[derive(Debug, Default, PartialEq)]
pub struct Shown {
    /// Triangles, including those that rounding makes degenerate.
    pub triangles: usize,
    /// Edges with one triangle only, except at the rim.
    pub open: usize,
    /// Edges used more often in one direction than in the other, except at the rim.
    pub unbalanced: usize,
    /// The first of these edges.
    pub first: Option<(Vec3, Vec3)>,
}

impl Shown {
    /// Whether something is shown and all of it is closed.
    pub fn is_closed(&self) -> bool {
        self.triangles > 0 && self.open == 0 && self.unbalanced == 0
    }
}

/// Triangles in world space.
#[derive(Default)]
struct TriangleSoup {
    numbers: HashMap<[u32; 3], u32>,
    places: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleSoup {
    fn add(&mut self, mesh: &Mesh, place: &GlobalTransform) {
        let Some(VertexAttributeValues::Float32x3(positions)) = mesh.attribute(Mesh::ATTRIBUTE_POSITION)
        else {
            panic!("a mesh has no positions");
        };
        let indices: Vec<usize> = mesh.indices().expect("a mesh has indices").iter().collect();
        let mut number = |index: usize| self.weld(place.transform_point(Vec3::from(positions[index])));
        let triangles: Vec<[u32; 3]> =
            indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(&mut number)).collect();
        self.triangles.extend(triangles);
    }

    fn weld(&mut self, place: Vec3) -> u32 {
        // Adding zero turns -0.0 into 0.0.
        let bits = (place + Vec3::ZERO).to_array().map(f32::to_bits);
        *self.numbers.entry(bits).or_insert_with(|| {
            self.places.push(place);
            self.places.len() as u32 - 1
        })
    }

    fn check(&self, low: Vec3, high: Vec3) -> Shown {
        let mut shown = Shown { triangles: self.triangles.len(), ..Shown::default() };
        // A triangle with a repeated corner covers nothing.
        let solid = self.triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a);
        let sides = solid.flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut sides: Vec<(u32, u32, bool)> = sides.map(|(u, v)| (u.min(v), u.max(v), u < v)).collect();
        sides.sort_unstable();
        for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (u, v) = (self.places[edge[0].0 as usize], self.places[edge[0].1 as usize]);
            let both = |at: f32, u: f32, v: f32| u == at && v == at;
            if both(low.x, u.x, v.x)
                || both(high.x, u.x, v.x)
                || both(low.z, u.z, v.z)
                || both(high.z, u.z, v.z)
            {
                continue;
            }
            let forward = edge.iter().filter(|side| side.2).count();
            shown.open += usize::from(edge.len() == 1);
            shown.unbalanced += usize::from(forward * 2 != edge.len());
            if edge.len() == 1 || forward * 2 != edge.len() {
                shown.first.get_or_insert((u, v));
            }
        }
        shown
    }
}

impl Stage {
    /// Checks what this frame shows of a terrain.
    pub fn shown(&mut self, terrain: Entity) -> Shown {
        let world = self.app.world_mut();
        let mut drawn = world.query_filtered::<(&Mesh3d, &GlobalTransform, &Visibility, &ChildOf), Or<(With<Tile>, With<Chunk>)>>();
        let meshes = world.resource::<Assets<Mesh>>();
        let mut soup = TriangleSoup::default();
        for (mesh, place, visibility, parent) in drawn.iter(world) {
            if parent.parent() == terrain && *visibility != Visibility::Hidden {
                soup.add(meshes.get(&mesh.0).expect("a shown mesh is there"), place);
            }
        }
        let ground = self.terrain(terrain).world().ground();
        let (width, depth) = (ground.width() as f32, ground.depth() as f32);
        let place: &GlobalTransform = self.app.world().get(terrain).expect("the terrain has a place");
        soup.check(place.transform_point(Vec3::ZERO), place.transform_point(Vec3::new(width, 0.0, depth)))
    }

    /// Checks that this frame shows all of a terrain's world, without a hole.
    pub fn assert_whole(&mut self, terrain: Entity, when: &str) {
        let shown = self.shown(terrain);
        assert!(shown.is_closed(), "{when}: {shown:?}");
        let world = self.terrain(terrain).world();
        let triangles = |mesh: SurfaceMesh| mesh.indices.len() / 3;
        let triangles: usize = match self.terrain(terrain).drawn_cut() {
            Some(drawn) => world.drawn_in(drawn.cut()).map(|(_, mesh)| triangles(mesh)).sum(),
            None => world.drawn().map(|(_, mesh)| triangles(mesh)).sum(),
        };
        assert_eq!(shown.triangles, triangles, "{when}: the frame does not show the committed world");
    }
}
