//! The collision shape of a tile or chunk.

use std::sync::OnceLock;

use avian3d::parry::bounding_volume::{Aabb, BoundingSphere};
use avian3d::parry::mass_properties::MassProperties;
use avian3d::parry::math::{Pose, Real, Vector};
use avian3d::parry::partitioning::Bvh;
use avian3d::parry::query::details::NormalConstraints;
use avian3d::parry::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use avian3d::parry::shape::{
    CompositeShape, CompositeShapeRef, FeatureId, Shape, ShapeType, TriMesh, Triangle, TypedCompositeShape,
    TypedShape,
};
use glam::Vec3;
use rustc_hash::FxHashMap;

use super::cone::NormalCone;
use super::ordered_bvh::ordered_bvh;
use super::welded::{BORDER, Welded};
use crate::lattice::SNAP;
use crate::surface::SurfaceMesh;

/// A triangle mesh whose triangles know their neighbours, including those in other tiles and chunks.
///
/// The triangles are exactly those that are drawn, in metres from the part's origin. Within the mesh, neighbours are
/// looked up. Across its border, their normals are derived from the vertex normals, which are bit-equal on both sides.
/// So bodies do not feel the border, and no mesh has to be rebuilt because another one changed.
///
/// Below a parent with a scale, avian 0.7 replaces the shape by a plain triangle mesh, so such ground has bumps and two
/// sides.
#[derive(Clone, Debug)]
pub struct GroundShape {
    vertices: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    tree: Bvh,
    /// The triangle of each leaf of the tree.
    leaves: Vec<u32>,
    /// For each triangle, the neighbours across its sides: a triangle's number, or [`BORDER`] plus an index of
    /// `beyond`.
    neighbours: Vec<[u32; 3]>,
    /// Normals of the ground across the border.
    beyond: Vec<Vector>,
    /// A plain triangle mesh, once it was asked for: to draw the shape, or to scale it.
    plain: OnceLock<Option<Box<TriMesh>>>,
}

/// How many triangles after two different ones are searched for their equals.
const LOOK_AHEAD: usize = 64;

impl GroundShape {
    /// The shape of a surface, in metres; `None` if it has no triangles with an area.
    pub fn new(surface: &SurfaceMesh, voxel_size: f32) -> Option<Self> {
        let welded = Welded::new(surface);
        if welded.triangles.is_empty() {
            return None;
        }
        let vertices = welded.vertices(voxel_size / SNAP as f32);
        let (neighbours, beyond) = welded.neighbours(&vertices);
        let triangles = welded.triangles;
        let bounds = triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| vertices[corner as usize]);
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        });
        let (tree, leaves) = ordered_bvh(&bounds.collect::<Vec<_>>(), welded.is_heightmap);
        Some(Self { vertices, triangles, tree, leaves, neighbours, beyond, plain: OnceLock::new() })
    }

    #[inline]
    fn triangle(&self, number: u32) -> Triangle {
        let [a, b, c] = self.triangles[number as usize];
        let corner = |vertex: u32| self.vertices[vertex as usize];
        Triangle { a: corner(a), b: corner(b), c: corner(c) }
    }

    /// The shape as a plain triangle mesh.
    fn plain(&self) -> Option<&TriMesh> {
        let build = || TriMesh::new(self.vertices.clone(), self.triangles.clone()).ok().map(Box::new);
        self.plain.get_or_init(build).as_deref()
    }

    /// The number of triangles.
    pub fn triangles(&self) -> usize {
        self.neighbours.len()
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> usize {
        self.tree.heap_memory_size()
            + size_of_val(self.vertices.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.leaves.as_slice())
            + size_of_val(self.neighbours.as_slice())
            + size_of_val(self.beyond.as_slice())
            + self.plain.get().and_then(Option::as_ref).map_or(0, |plain| plain.total_memory_size())
    }

    /// The box around all triangles that only one of two shapes has, in metres from the origin; `None` if they are
    /// equal.
    pub(super) fn difference(old: Option<&Self>, new: Option<&Self>) -> Option<(Vec3, Vec3)> {
        type Corners = [[u32; 3]; 3];
        let corners = |shape: &Self, triangle: usize| -> Corners {
            let Triangle { a, b, c } = shape.triangle(triangle as u32);
            [a, b, c].map(|corner| corner.to_array().map(f32::to_bits))
        };
        let sorted = |shape: &Self, triangle| {
            let mut corners = corners(shape, triangle);
            corners.sort_unstable();
            corners
        };
        let counts = [old, new].map(|shape| shape.map_or(0, Self::triangles));
        // Both come in the same order, and most edits change few triangles of a part: so they are walked through side
        // by side, and what does not fit is set aside.
        let (mut gone, mut fresh): (Vec<Corners>, Vec<Corners>) = Default::default();
        let (mut before, mut after, mut ends) = (0, 0, counts);
        if let (Some(old), Some(new)) = (old, new) {
            let is_same = |before, after| corners(old, before) == corners(new, after);
            while ends[0] > 0 && ends[1] > 0 && is_same(ends[0] - 1, ends[1] - 1) {
                ends = ends.map(|end| end - 1);
            }
            // Where all is different, ever fewer triangles are searched for.
            let (mut pause, mut next_pause) = (0, 1);
            while before < ends[0] && after < ends[1] {
                if is_same(before, after) {
                    (before, after, pause, next_pause) = (before + 1, after + 1, 0, 1);
                    continue;
                }
                let (mut skipped, mut added) = (1, 1);
                if pause > 0 {
                    pause -= 1;
                } else if let Some(by) =
                    (1..LOOK_AHEAD).find(|by| before + by < ends[0] && is_same(before + by, after))
                {
                    (skipped, added) = (by, 0);
                } else if let Some(by) =
                    (1..LOOK_AHEAD).find(|by| after + by < ends[1] && is_same(before, after + by))
                {
                    (skipped, added) = (0, by);
                } else {
                    (pause, next_pause) = (next_pause, 2 * next_pause);
                }
                gone.extend((before..before + skipped).map(|triangle| sorted(old, triangle)));
                fresh.extend((after..after + added).map(|triangle| sorted(new, triangle)));
                (before, after) = (before + skipped, after + added);
            }
        }
        let rest = |shape: Option<&Self>, from, to| -> Vec<Corners> {
            shape.map_or_else(Vec::new, |shape| (from..to).map(|triangle| sorted(shape, triangle)).collect())
        };
        gone.extend(rest(old, before, ends[0]));
        fresh.extend(rest(new, after, ends[1]));
        let mut seen: FxHashMap<Corners, bool> = FxHashMap::default();
        seen.extend(gone.into_iter().map(|corners| (corners, false)));
        let mut found: Option<(Vec3, Vec3)> = None;
        let mut include = |corners: &Corners| {
            for corner in corners.map(|corner| Vec3::from(corner.map(f32::from_bits))) {
                let (low, high) = found.unwrap_or((corner, corner));
                found = Some((low.min(corner), high.max(corner)));
            }
        };
        for corners in fresh {
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
                None => self.triangle(neighbour).normal(),
            };
            ((to - from).cross(face).normalize_or_zero(), beyond.unwrap_or(face))
        };
        Some(NormalCone { face, sides: [side(0), side(1), side(2)] })
    }
}

impl CompositeShape for GroundShape {
    fn map_part_at(
        &self,
        number: u32,
        f: &mut dyn FnMut(Option<&Pose>, &dyn Shape, Option<&dyn NormalConstraints>),
    ) {
        let number = self.leaves[number as usize];
        let triangle = self.triangle(number);
        // Triangles too thin for a normal are skipped.
        if let Some(cone) = self.cone(number, &triangle) {
            f(None, &triangle, Some(&cone));
        }
    }

    fn bvh(&self) -> &Bvh {
        &self.tree
    }
}

/// For rays and points, which take each triangle alone.
impl TypedCompositeShape for GroundShape {
    type PartShape = Triangle;
    type PartNormalConstraints = ();

    fn map_typed_part_at<T>(
        &self,
        number: u32,
        mut f: impl FnMut(Option<&Pose>, &Triangle, Option<&()>) -> T,
    ) -> Option<T> {
        Some(f(None, &self.triangle(self.leaves[number as usize]), None))
    }

    fn map_untyped_part_at<T>(
        &self,
        number: u32,
        mut f: impl FnMut(Option<&Pose>, &dyn Shape, Option<&dyn NormalConstraints>) -> T,
    ) -> Option<T> {
        Some(f(None, &self.triangle(self.leaves[number as usize]), None))
    }
}

impl RayCast for GroundShape {
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        longest: Real,
        solid: bool,
    ) -> Option<RayIntersection> {
        let (triangle, mut hit) =
            CompositeShapeRef(self).cast_local_ray_and_get_normal(ray, longest, solid)?;
        // As parry numbers the faces of a mesh: back faces follow after front faces.
        let is_back = hit.feature == FeatureId::Face(1);
        hit.feature = FeatureId::Face(
            self.leaves[triangle as usize] + if is_back { self.triangles() as u32 } else { 0 },
        );
        Some(hit)
    }
}

impl PointQuery for GroundShape {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        CompositeShapeRef(self).project_local_point(point, solid).1
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        let (triangle, projection) = CompositeShapeRef(self).project_local_point(point, false);
        (projection, FeatureId::Face(self.leaves[triangle as usize]))
    }
}

impl Shape for GroundShape {
    fn compute_local_aabb(&self) -> Aabb {
        self.tree.root_aabb()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.tree.root_aabb().bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, _: u32) -> Option<Box<dyn Shape>> {
        // Normals scale inversely.
        let across = Vector::new(scale.y * scale.z, scale.z * scale.x, scale.x * scale.y);
        let mut scaled = Self { plain: OnceLock::new(), ..self.clone() };
        scaled.vertices.iter_mut().for_each(|vertex| *vertex *= scale);
        scaled.beyond.iter_mut().for_each(|normal| *normal = (*normal * across).normalize_or_zero());
        // Its parts keep their numbers.
        scaled.tree.scale(scale);
        Some(Box::new(scaled))
    }

    fn mass_properties(&self, _: Real) -> MassProperties {
        MassProperties::new(Vector::ZERO, 0.0, Vector::ZERO)
    }

    /// Not `TriMesh`, for which collisions would use parry's own neighbour rules.
    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    /// A mesh, for debug drawing, and for avian where the ground has a scale.
    fn as_typed_shape(&self) -> TypedShape<'_> {
        self.plain().map_or(TypedShape::Custom(self), TypedShape::TriMesh)
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
    use crate::terrain::{MeshKey, Terrain, TerrainSettings};

    /// How steep the roof's slopes are: rise over run.
    const PITCH: f64 = 0.5;

    /// For each triangle at the ridge of a roof along x = `ridge`: its normal, and the one it assumes for its neighbour
    /// across the ridge. Chunks are 16 cells wide.
    fn over_ridge(ridge: i32) -> Vec<(Vector, Vector)> {
        let height = |x: i32, _| 30.0 - PITCH * f64::from((x - ridge).abs());
        let ground = Ground::from_fn(32, 32, height).expect("valid");
        let settings = TerrainSettings { chunk_size: 16, voxel_size: 1.0 };
        let terrain = Terrain::new(ground, &settings).expect("valid");
        let world = terrain.world();
        let mut found = Vec::new();
        for tile in world.grid().tiles() {
            let shape = GroundShape::new(&world.tile_mesh(tile), 1.0).expect("it has triangles");
            let ridge = (ridge - world.origin(MeshKey::Tile(tile)).x) as f32;
            for number in 0..shape.triangles() as u32 {
                let triangle = shape.triangle(number);
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
            assert!(face.abs_diff_eq(slope, 1e-5), "{face} is not a slope of the roof");
            let other = Vector::new(-slope.x, slope.y, 0.0);
            assert!(beyond.abs_diff_eq(other, 1e-5), "{beyond} next to {face}");
        }
    }

    /// The box around all triangles that only one of two shapes has, by comparing each with each.
    fn naive_difference(old: Option<&GroundShape>, new: Option<&GroundShape>) -> Option<(Vec3, Vec3)> {
        let all = |shape: Option<&GroundShape>| -> Vec<Vec<[u32; 3]>> {
            let triangles = shape.into_iter().flat_map(|shape| {
                (0..shape.triangles() as u32).map(|number| {
                    let Triangle { a, b, c } = shape.triangle(number);
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
        let shapes = |terrain: &Terrain| -> Vec<(MeshKey, GroundShape)> {
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
            let find =
                |all: &[(MeshKey, GroundShape)], drawn: MeshKey| all.iter().position(|own| own.0 == drawn);
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
