//! The collision shape of a tile or chunk.

use avian3d::parry::bounding_volume::{Aabb, BoundingSphere};
use avian3d::parry::mass_properties::MassProperties;
use avian3d::parry::math::{Pose, Real, Vector};
use avian3d::parry::partitioning::Bvh;
use avian3d::parry::query::details::NormalConstraints;
use avian3d::parry::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use avian3d::parry::shape::{CompositeShape, FeatureId, Shape, ShapeType, TriMesh, Triangle, TypedShape};
use glam::{IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::cone::NormalCone;
use crate::lattice::SNAP;
use crate::surface::SurfaceMesh;

/// A triangle mesh whose triangles know their neighbours, including those in other tiles and chunks.
///
/// The triangles are exactly those that are drawn, in metres from the part's origin. Within the mesh, neighbours are looked
/// up. Across its border, their normals are derived from the vertex normals, which are bit-equal on both sides. So bodies do
/// not feel the border, and no mesh has to be rebuilt because another one changed.
///
/// Below a parent with a scale, avian 0.7 replaces the shape by a plain triangle mesh, so such ground has bumps and two
/// sides.
#[derive(Clone, Debug)]
pub struct GroundShape {
    mesh: TriMesh,
    /// For each triangle, the neighbours across its sides: a triangle's number, or [`BORDER`] plus an index of `beyond`.
    neighbours: Vec<[u32; 3]>,
    /// Normals of the ground across the border.
    beyond: Vec<Vector>,
}

/// Neighbours from here on are indices of [`GroundShape::beyond`].
const BORDER: u32 = 1 << 31;

impl GroundShape {
    /// The shape of a surface, in metres; `None` if it has no triangles with an area.
    pub fn new(surface: &SurfaceMesh, voxel_size: f32) -> Option<Self> {
        let welded = Welded::new(surface);
        let scale = voxel_size / SNAP as f32;
        let vertices: Vec<Vector> = welded.places.iter().map(|place| place.as_vec3() * scale).collect();
        let (neighbours, beyond) = welded.neighbours(&vertices);
        let mesh = TriMesh::new(vertices, welded.triangles).ok()?;
        Some(Self { mesh, neighbours, beyond })
    }

    /// The number of triangles.
    pub fn triangles(&self) -> usize {
        self.neighbours.len()
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> usize {
        self.mesh.heap_memory_size()
            + size_of_val(self.neighbours.as_slice())
            + size_of_val(self.beyond.as_slice())
    }

    /// The box around all triangles that only one of two shapes has, in metres from the origin; `None` if they are equal.
    pub(super) fn difference(old: Option<&Self>, new: Option<&Self>) -> Option<(Vec3, Vec3)> {
        type Corners = [[u32; 3]; 3];
        let corners = |shape: &Self, triangle: usize| -> Corners {
            let Triangle { a, b, c } = shape.mesh.triangle(triangle as u32);
            [a, b, c].map(|corner| corner.to_array().map(f32::to_bits))
        };
        let counts = [old, new].map(|shape| shape.map_or(0, Self::triangles));
        // Both come in the same order, and most edits change few triangles of a part: those before and behind are equal.
        let (mut front, mut back) = (0, 0);
        if let (Some(old), Some(new)) = (old, new) {
            let shorter = counts[0].min(counts[1]);
            let is_same = |before: usize, after: usize| corners(old, before) == corners(new, after);
            front = (0..shorter).take_while(|&at| is_same(at, at)).count();
            let from_end = 1..=shorter - front;
            back = from_end.take_while(|at| is_same(counts[0] - at, counts[1] - at)).count();
        }
        let rest = |shape: Option<&'_ Self>, count: usize| -> Vec<Corners> {
            let sorted = |shape: &Self, triangle| {
                let mut corners = corners(shape, triangle);
                corners.sort_unstable();
                corners
            };
            shape.map_or_else(Vec::new, |shape| (front..count - back).map(|t| sorted(shape, t)).collect())
        };
        let mut seen: FxHashMap<Corners, bool> = FxHashMap::default();
        seen.extend(rest(old, counts[0]).into_iter().map(|corners| (corners, false)));
        let mut found: Option<(Vec3, Vec3)> = None;
        let mut include = |corners: &Corners| {
            for corner in corners.map(|corner| Vec3::from(corner.map(f32::from_bits))) {
                let (low, high) = found.unwrap_or((corner, corner));
                found = Some((low.min(corner), high.max(corner)));
            }
        };
        for corners in rest(new, counts[1]) {
            match seen.get_mut(&corners) {
                Some(is_kept) => *is_kept = true,
                None => include(&corners),
            }
        }
        seen.iter().filter(|(_, is_kept)| !**is_kept).for_each(|(corners, _)| include(corners));
        found
    }

    fn cone(&self, triangle: u32, corners: &Triangle) -> Option<NormalCone> {
        let face = corners.normal()?;
        let sides = [(corners.a, corners.b), (corners.b, corners.c), (corners.c, corners.a)];
        let neighbours = *self.neighbours.get(triangle as usize)?;
        let side = |number: usize| {
            let ((from, to), neighbour) = (sides[number], neighbours[number]);
            let beyond = match neighbour.checked_sub(BORDER) {
                Some(border) => self.beyond.get(border as usize).copied(),
                None => self.mesh.triangle(neighbour).normal(),
            };
            ((to - from).cross(face).normalize_or_zero(), beyond.unwrap_or(face))
        };
        Some(NormalCone { face, sides: [side(0), side(1), side(2)] })
    }
}

/// A surface without repeated vertices and without triangles that have no area.
struct Welded {
    places: Vec<IVec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Welded {
    fn new(surface: &SurfaceMesh) -> Self {
        let mut numbers: FxHashMap<IVec3, u32> = FxHashMap::default();
        numbers.reserve(surface.vertices.len());
        let (mut places, mut normals) = (Vec::new(), Vec::new());
        let welded: Vec<u32> = surface
            .vertices
            .iter()
            .map(|vertex| {
                *numbers.entry(vertex.position).or_insert_with(|| {
                    places.push(vertex.position);
                    normals.push(vertex.normal);
                    places.len() as u32 - 1
                })
            })
            .collect();
        let corner = |index: u32| welded.get(index as usize).copied();
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|corner| places[corner as usize].as_i64vec3());
            (b - a).cross(c - a) != glam::I64Vec3::ZERO
        };
        let triangles =
            surface.indices.triangles().filter_map(|t| Some([corner(t[0])?, corner(t[1])?, corner(t[2])?]));
        let triangles = triangles.filter(has_area).collect();
        Self { places, normals, triangles }
    }

    /// The neighbours across each triangle's sides, and the normals across the border.
    fn neighbours(&self, vertices: &[Vector]) -> (Vec<[u32; 3]>, Vec<Vector>) {
        let sides = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
        // All sides, sorted by the vertex they start from, with their triangles. Few start from the same one.
        let mut first = vec![0; vertices.len() + 1];
        self.triangles.iter().flatten().for_each(|&corner| first[corner as usize + 1] += 1);
        first.iter_mut().fold(0, |sum, first| {
            *first += sum;
            *first
        });
        let mut next = first.clone();
        let mut starting = vec![(0, 0); 3 * self.triangles.len()];
        for (number, triangle) in self.triangles.iter().enumerate() {
            for (from, to) in sides(triangle) {
                starting[next[from as usize]] = (to, number as u32);
                next[from as usize] += 1;
            }
        }
        let owner = |(from, to): (u32, u32)| {
            let of_vertex = &starting[first[from as usize]..first[from as usize + 1]];
            of_vertex.iter().rev().find(|side| side.0 == to).map(|side| side.1)
        };
        let mut beyond = Vec::new();
        let neighbours = self.triangles.iter().map(|triangle| {
            sides(triangle).map(|(from, to)| {
                owner((to, from)).unwrap_or_else(|| {
                    beyond.push(self.across(vertices, triangle, from, to));
                    BORDER + (beyond.len() as u32 - 1)
                })
            })
        });
        (neighbours.collect(), beyond)
    }

    /// The normal across a border: the triangle's own, mirrored at the edge's normal as given by its vertices.
    fn across(&self, vertices: &[Vector], triangle: &[u32; 3], from: u32, to: u32) -> Vector {
        let [a, b, c] = triangle.map(|corner| vertices[corner as usize]);
        let face = (b - a).cross(c - a).normalize_or_zero();
        let along = (vertices[to as usize] - vertices[from as usize]).normalize_or_zero();
        let middle = self.normals[from as usize] + self.normals[to as usize];
        // Across an edge, normals only rotate about the edge.
        let middle = (middle - along * middle.dot(along)).normalize_or(face);
        middle * (2.0 * middle.dot(face)) - face
    }
}

impl CompositeShape for GroundShape {
    fn map_part_at(
        &self,
        number: u32,
        f: &mut dyn FnMut(Option<&Pose>, &dyn Shape, Option<&dyn NormalConstraints>),
    ) {
        let triangle = self.mesh.triangle(number);
        // Triangles too thin for a normal are skipped.
        if let Some(cone) = self.cone(number, &triangle) {
            f(None, &triangle, Some(&cone));
        }
    }

    fn bvh(&self) -> &Bvh {
        self.mesh.bvh()
    }
}

impl RayCast for GroundShape {
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        longest: Real,
        solid: bool,
    ) -> Option<RayIntersection> {
        self.mesh.cast_local_ray_and_get_normal(ray, longest, solid)
    }
}

impl PointQuery for GroundShape {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.mesh.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        self.mesh.project_local_point_and_get_feature(point)
    }
}

impl Shape for GroundShape {
    fn compute_local_aabb(&self) -> Aabb {
        self.mesh.local_aabb()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.mesh.compute_local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, _: u32) -> Option<Box<dyn Shape>> {
        // Normals scale inversely.
        let across = Vector::new(scale.y * scale.z, scale.z * scale.x, scale.x * scale.y);
        let beyond = self.beyond.iter().map(|normal| (normal * across).normalize_or_zero()).collect();
        let (mesh, neighbours) = (self.mesh.clone().scaled(scale), self.neighbours.clone());
        Some(Box::new(Self { mesh, neighbours, beyond }))
    }

    fn mass_properties(&self, _: Real) -> MassProperties {
        MassProperties::new(Vector::ZERO, 0.0, Vector::ZERO)
    }

    /// Not `TriMesh`, for which collisions would use parry's own neighbour rules.
    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    /// A mesh, for debug drawing.
    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::TriMesh(&self.mesh)
    }

    fn ccd_thickness(&self) -> Real {
        0.0
    }

    fn ccd_angular_thickness(&self) -> Real {
        std::f32::consts::FRAC_PI_4
    }

    fn as_composite_shape(&self) -> Option<&dyn CompositeShape> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Shape as BrushShape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{Drawn, Terrain, TerrainSettings};

    /// How steep the roof's slopes are: rise over run.
    const PITCH: f64 = 0.5;

    /// For each triangle at the ridge of a roof along x = `ridge`: its normal, and the one it assumes for its neighbour across
    /// the ridge. Chunks are 16 cells wide.
    fn over_ridge(ridge: i32) -> Vec<(Vector, Vector)> {
        let height = |x: i32, _| 30.0 - PITCH * f64::from((x - ridge).abs());
        let ground = Ground::from_fn(32, 32, height).expect("valid");
        let settings = TerrainSettings { chunk_size: 16, voxel_size: 1.0 };
        let terrain = Terrain::new(ground, &settings).expect("valid");
        let world = terrain.world();
        let mut found = Vec::new();
        for tile in world.grid().tiles() {
            let shape = GroundShape::new(&world.tile_mesh(tile), 1.0).expect("it has triangles");
            let ridge = (ridge - world.origin(Drawn::Tile(tile)).x) as f32;
            for number in 0..shape.triangles() as u32 {
                let triangle = shape.mesh.triangle(number);
                let cone = shape.cone(number, &triangle).expect("it has a normal");
                let Triangle { a, b, c } = triangle;
                let sides = [(a, b), (b, c), (c, a)].into_iter().zip(cone.sides);
                let on_ridge = sides.filter(|((from, to), _)| from.x == ridge && to.x == ridge);
                found.extend(on_ridge.map(|(_, (_, beyond))| (cone.face, beyond)));
            }
        }
        found
    }

    #[test]
    fn normals_across_a_border_equal_those_within_a_chunk() {
        let [within, border] = [8, 16].map(over_ridge);
        // Two triangles for each cell along the ridge.
        assert_eq!((within.len(), border.len()), (64, 64));
        for (face, beyond) in within.into_iter().chain(border) {
            let slope = Vector::new(PITCH as f32 * face.x.signum(), 1.0, 0.0).normalize();
            assert!(face.abs_diff_eq(slope, 1e-5), "{face} is no slope of the roof");
            let other = Vector::new(-slope.x, slope.y, 0.0);
            assert!(beyond.abs_diff_eq(other, 1e-5), "{beyond} next to {face}");
        }
    }

    /// The box around all triangles that only one of two shapes has, by comparing each with each.
    fn naive_difference(old: Option<&GroundShape>, new: Option<&GroundShape>) -> Option<(Vec3, Vec3)> {
        let all = |shape: Option<&GroundShape>| -> Vec<Vec<[u32; 3]>> {
            let triangles = shape.into_iter().flat_map(|shape| {
                (0..shape.triangles() as u32).map(|number| {
                    let Triangle { a, b, c } = shape.mesh.triangle(number);
                    let mut corners = [a, b, c].map(|corner| corner.to_array().map(f32::to_bits)).to_vec();
                    corners.sort_unstable();
                    corners
                })
            });
            triangles.collect()
        };
        let (old, new) = (all(old), all(new));
        let only_one =
            old.iter().filter(|own| !new.contains(own)).chain(new.iter().filter(|own| !old.contains(own)));
        let corners = only_one.flatten().map(|corner| Vec3::from(corner.map(f32::from_bits)));
        corners.map(|corner| (corner, corner)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    #[test]
    fn the_difference_of_two_shapes_bounds_the_triangles_that_only_one_has() {
        let mut rng = fastrand::Rng::with_seed(3);
        let ground = Ground::from_fn(32, 32, |x, z| 10.0 + f64::from((x * 7 + z * 3) % 5)).expect("valid");
        let settings = TerrainSettings { chunk_size: 16, voxel_size: 1.0 };
        let mut terrain = Terrain::new(ground, &settings).expect("valid");
        let shapes = |terrain: &Terrain| -> Vec<(Drawn, GroundShape)> {
            let world = terrain.world();
            let meshes =
                world.drawn().filter_map(|(drawn, mesh)| Some((drawn, GroundShape::new(&mesh, 1.0)?)));
            meshes.collect()
        };
        let (mut before, mut changed) = (shapes(&terrain), 0);
        for _ in 0..12 {
            let place = Vec3::new(rng.f32() * 32.0, 8.0 + rng.f32() * 6.0, rng.f32() * 32.0);
            let ball = BrushShape::sphere(place, 1.0 + rng.f32() * 4.0);
            let dig = if rng.bool() { Brush::dig(ball) } else { Brush::add(ball, MaterialId(1)) };
            terrain.apply([dig]);
            let after = shapes(&terrain);
            let find = |all: &[(Drawn, GroundShape)], drawn: Drawn| all.iter().position(|own| own.0 == drawn);
            for &(drawn, _) in before.iter().chain(&after) {
                let old = find(&before, drawn).map(|at| &before[at].1);
                let new = find(&after, drawn).map(|at| &after[at].1);
                let found = GroundShape::difference(old, new);
                assert_eq!(found, naive_difference(old, new), "{drawn:?}");
                changed += usize::from(found.is_some());
            }
            before = after;
        }
        assert!(changed > 20, "{changed}");
    }
}
