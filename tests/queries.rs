//! Rays and columns answer what is drawn: checked against every drawn triangle, one by one.
//!
//! Brute force knows nothing of cells, cubes or masks. It takes the triangles as a renderer gets them and tests all that
//! lie anywhere near the ray. Where a ray runs exactly through an edge or a vertex, arithmetic decides which of the
//! triangles around it is hit, so there any answer counts that the ray, moved by a millionth of a voxel, could give.

mod worlds;

use bevy_burrow::ground::{Ground, MaterialControl};
use bevy_burrow::lattice::{Column, LatticeBox, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{Drawn, RayHit, World};
use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};
use worlds::{random_brush, random_world, real_ground, world_count};

/// How far answers may be from the drawn triangles, in voxels.
const TOLERANCE: f64 = 1.0 / 256.0;

/// How far a ray is moved to ask whether it runs close by an edge, in voxels.
const NUDGE: f64 = 1e-6;

/// Everything drawn, sorted into squares of `SIDE` x `SIDE` voxels by the triangles' own bounds.
struct Soup {
    triangles: Vec<[DVec3; 3]>,
    /// How many triangles belong to tiles; they come first.
    tiles: usize,
    squares: Vec<Vec<u32>>,
    width: i32,
    depth: i32,
}

const SIDE: i32 = 4;

impl Soup {
    fn of(world: &World) -> Self {
        let count = |cells: i32| cells / SIDE + 1;
        let (width, depth) = (count(world.grid().width()), count(world.grid().depth()));
        let squares = vec![Vec::new(); (width * depth) as usize];
        let mut soup = Self { triangles: Vec::new(), tiles: 0, squares, width, depth };
        for (drawn, mesh) in world.drawn() {
            let origin = world.origin(drawn).as_dvec3();
            if matches!(drawn, Drawn::Tile(_)) {
                soup.tiles += mesh.indices.len() / 3;
            }
            for triangle in mesh.triangles() {
                soup.add(triangle.map(|vertex| origin + vertex.position.as_dvec3() / f64::from(SNAP)));
            }
        }
        soup
    }

    fn add(&mut self, triangle: [DVec3; 3]) {
        let number = self.triangles.len() as u32;
        self.triangles.push(triangle);
        let [a, b, c] = triangle;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for z in self.square(low.z, self.depth)..=self.square(high.z, self.depth) {
            for x in self.square(low.x, self.width)..=self.square(high.x, self.width) {
                self.squares[(z * self.width + x) as usize].push(number);
            }
        }
    }

    fn square(&self, at: f64, end: i32) -> i32 {
        ((at / f64::from(SIDE)).floor() as i32).clamp(0, end - 1)
    }

    /// The triangles of all squares that the ray runs over, with half a voxel to spare on all sides; some twice.
    fn near(&self, origin: DVec3, direction: DVec3) -> Vec<u32> {
        let mut found = Vec::new();
        for z in 0..self.depth {
            let (low, high) = (f64::from(z * SIDE) - 0.5, f64::from((z + 1) * SIDE) + 0.5);
            // Where along the ray it is over this row of squares.
            let (from, to) = match direction.z {
                dz if dz.abs() < 1e-9 => match (low - 0.5..=high + 0.5).contains(&origin.z) {
                    true => (0.0, 1e7),
                    false => continue,
                },
                dz => {
                    let (a, b) = ((low - origin.z) / dz, (high - origin.z) / dz);
                    (a.min(b).max(0.0), a.max(b).min(1e7))
                }
            };
            if from > to {
                continue;
            }
            let (a, b) = (origin.x + direction.x * from, origin.x + direction.x * to);
            let (left, right) = (a.min(b) - 0.5, a.max(b) + 0.5);
            for x in self.square(left, self.width)..=self.square(right, self.width) {
                found.extend_from_slice(&self.squares[(z * self.width + x) as usize]);
            }
        }
        found
    }

    /// The nearest triangle that a ray meets, and the distance to it.
    fn raycast(&self, origin: DVec3, direction: DVec3, max_distance: f64) -> Option<(f64, u32)> {
        let near = self.near(origin, direction).into_iter();
        let hits = near.filter_map(|number| {
            Some((meet(origin, direction, &self.triangles[number as usize], 1e-12)?, number))
        });
        hits.filter(|(t, _)| (0.0..=max_distance).contains(t)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Heights at which the vertical through (x, z) crosses triangles, whether they face up, and which they are; lowest
    /// first.
    fn crossings(&self, x: f64, z: f64) -> Vec<(f64, bool, u32)> {
        let square = self.square(z, self.depth) * self.width + self.square(x, self.width);
        let mut found = Vec::new();
        for &number in &self.squares[square as usize] {
            let [a, b, c] = self.triangles[number as usize];
            let side = |p: DVec3, q: DVec3| (p.x - x) * (q.z - z) - (p.z - z) * (q.x - x);
            let (wa, wb, wc) = (side(b, c), side(c, a), side(a, b));
            let area = wa + wb + wc;
            if area != 0.0 && (wa / area).min(wb / area).min(wc / area) >= 0.0 {
                found.push(((wa * a.y + wb * b.y + wc * c.y) / area, area < 0.0, number));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    }

    fn column(&self, x: f64, z: f64) -> Vec<(f64, bool)> {
        self.crossings(x, z).into_iter().map(|(y, is_floor, _)| (y, is_floor)).collect()
    }

    fn normal(&self, number: u32) -> DVec3 {
        let [a, b, c] = self.triangles[number as usize];
        (b - a).cross(c - a).normalize()
    }
}

/// Distance along a ray to a triangle (Moeller and Trumbore), measured from the ray's nearest point to the triangle so
/// that far origins lose no digits. The triangle is taken larger by the share `hair` of itself.
fn meet(origin: DVec3, direction: DVec3, [a, b, c]: &[DVec3; 3], hair: f64) -> Option<f64> {
    let shift = (*a - origin).dot(direction);
    let origin = origin + direction * shift;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(p) / determinant;
    let q = from.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= -hair && v >= -hair && u + v <= 1.0 + hair).then(|| ac.dot(q) / determinant + shift)
}

/// Two directions across a ray.
fn across(direction: DVec3) -> [DVec3; 2] {
    let (a, b) = direction.any_orthonormal_pair();
    [a, b]
}

/// What the checks of many rays found.
#[derive(Default, Debug)]
struct Figures {
    rays: usize,
    hits: usize,
    from_inside: usize,
    close_calls: usize,
    worst: f64,
}

/// Compares one ray with brute force.
fn check_ray(
    world: &World,
    soup: &Soup,
    origin: DVec3,
    direction: DVec3,
    max: f64,
    figures: &mut Figures,
    what: &str,
) {
    let what = || format!("{what}: ray from {origin:?} along {direction:?}, at most {max}");
    let answer = world.raycast(origin, direction, max);
    let unit = direction.normalize();
    let expected = soup.raycast(origin, unit, max);
    figures.rays += 1;
    let agree = |t: Option<f64>| match (answer, t) {
        (Some(hit), Some(t)) => (hit.distance - t).abs() <= TOLERANCE,
        (None, None) => true,
        _ => false,
    };
    if !agree(expected.map(|hit| hit.0)) {
        // Perhaps the ray brushes an edge: then rays beside it disagree with each other, too.
        figures.close_calls += 1;
        let [a, b] = across(unit);
        let beside = [a, -a, b, -b, a + b, a - b, b - a, -a - b];
        let mut answers: Vec<Option<f64>> =
            beside.iter().map(|&d| soup.raycast(origin + d * NUDGE, unit, max).map(|hit| hit.0)).collect();
        // Or it starts or ends on the surface.
        for reach in [-NUDGE, NUDGE] {
            answers.push(soup.raycast(origin + unit * reach, unit, max).map(|hit| hit.0 + reach));
            answers.push(soup.raycast(origin, unit, max + reach).map(|hit| hit.0));
        }
        // Or it runs along a triangle, and may count as hitting it anywhere.
        let range =
            answers.iter().flatten().fold((f64::MAX, f64::MIN), |(low, high), &t| (low.min(t), high.max(t)));
        let between =
            answer.is_some_and(|hit| (range.0 - TOLERANCE..=range.1 + TOLERANCE).contains(&hit.distance));
        // Or it grazes edges, of which some count and some don't: before it meets anything for certain, or where rays
        // beside it disagree whether there is anything at all.
        let is_early = |hit: RayHit| expected.is_none_or(|(t, _)| hit.distance < t);
        let is_unsure = answers.iter().any(Option::is_none) && answers.iter().any(Option::is_some);
        let touches = |hit: RayHit| {
            soup.near(origin, unit).into_iter().any(|number| {
                let [a, b, c] = soup.triangles[number as usize];
                let on_edge = [(a, b), (b, c), (c, a)].into_iter().any(|(p, q)| {
                    let along = ((hit.position - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
                    hit.position.distance(p.lerp(q, along)) <= NUDGE
                });
                // A ray in the plane of a triangle meets it anywhere.
                let normal = soup.normal(number);
                let is_around = |p: DVec3| {
                    (p + NUDGE).cmpge(a.min(b).min(c)).all() && (p - NUDGE).cmple(a.max(b).max(c)).all()
                };
                let in_plane = normal.dot(unit).abs() <= 1e-9 && normal.dot(hit.position - a).abs() <= NUDGE;
                on_edge || (in_plane && is_around(hit.position))
            })
        };
        assert!(
            between
                || answers.iter().any(|&t| agree(t))
                || answer.is_some_and(|hit| (is_early(hit) || is_unsure) && touches(hit)),
            "{}: {answer:?}, but brute force {expected:?}, and beside the ray {answers:?}",
            what()
        );
        return;
    }
    let (Some(hit), Some((t, number))) = (answer, expected) else { return };
    figures.hits += 1;
    figures.from_inside += usize::from(hit.from_inside);
    figures.worst = figures.worst.max((hit.distance - t).abs());
    assert!(
        (hit.position - (origin + unit * hit.distance)).length() <= 1e-6 * (1.0 + origin.length()),
        "{}",
        what()
    );
    assert!((hit.normal.length() - 1.0).abs() < 1e-5, "{}: {hit:?}", what());
    assert_eq!(hit.from_inside, hit.normal.as_dvec3().dot(unit) > 0.0, "{}: {hit:?}", what());

    // The normal is that of a triangle there; more than one is there only on edges.
    let near = soup.near(origin, unit).into_iter();
    let same_place = near.filter(|&other| {
        meet(origin, unit, &soup.triangles[other as usize], 1e-6)
            .is_some_and(|other| (other - hit.distance).abs() < 1e-4)
    });
    let normals: Vec<DVec3> = same_place.chain([number]).map(|number| soup.normal(number)).collect();
    let alike = |normal: &DVec3| normal.dot(hit.normal.as_dvec3()) > 1.0 - 1e-6;
    assert!(normals.iter().any(alike), "{}: {hit:?}, but the triangles' normals are {normals:?}", what());
    check_material(world, &hit, &what());
}

/// The material of a hit is that of the solid sample nearest to it, or nearest among the corners of its cube.
fn check_material(world: &World, hit: &RayHit, what: &str) {
    let samples = world.samples();
    // On a lattice plane, rounding decides on which side of it the place is.
    let (low, high) =
        ((hit.position - 1e-6).floor().as_ivec3(), (hit.position + 1e-6).floor().as_ivec3() + 1);
    let cube = LatticeBox::new(low, high).expect("low is below high");
    let materials_nearest = |around: LatticeBox| {
        let apart = |point: IVec3| point.as_dvec3().distance(hit.position);
        let solid: Vec<IVec3> = around.points().filter(|&point| samples.is_solid(point)).collect();
        let nearest = solid.iter().map(|&point| apart(point)).fold(f64::INFINITY, f64::min);
        let nearest = solid.into_iter().filter(move |&point| apart(point) < nearest + 1e-5);
        nearest.map(|point| samples.material(point)).collect::<Vec<_>>()
    };
    let candidates = [materials_nearest(cube), materials_nearest(cube.grown(1))].concat();
    assert!(candidates.contains(&hit.material), "{what}: {hit:?}, but the samples there are {candidates:?}");
}

/// A direction of any kind, unit or not.
fn random_direction(rng: &mut Rng) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let component = |rng: &mut Rng| rng.f64() * 2.0 - 1.0;
    match rng.u32(0..8) {
        0 | 1 => axes[rng.usize(0..6)],
        2 => axes[rng.usize(0..6)] + axes[rng.usize(0..6)] * 0.5,
        3 => DVec3::new(component(rng), 0.0, component(rng)),
        4 => DVec3::new(component(rng), -3.0, component(rng)) * 100.0,
        5 => IVec3::new(rng.i32(-2..=2), rng.i32(-2..=2), rng.i32(-2..=2)).as_dvec3(),
        _ => DVec3::new(component(rng), component(rng), component(rng)),
    }
    .try_normalize()
    .map_or(DVec3::NEG_Y, |unit| unit * (1.0 + rng.f64()))
}

/// A lattice point near the surface of a world.
fn point_near_surface(rng: &mut Rng, world: &World) -> IVec3 {
    let column = Column::new(rng.i32(0..=world.grid().width()), rng.i32(0..=world.grid().depth()));
    column.at(world.ground().height(column) / 256 + rng.i32(-8..=6))
}

/// A ray from anywhere: sky, side, inside the ground, caves; free or exactly on lattice lines, edges and vertices.
fn random_ray(rng: &mut Rng, world: &World, soup: &Soup) -> (DVec3, DVec3) {
    let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
    let free = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5);
    let target = point_near_surface(rng, world).as_dvec3();
    match rng.u32(0..9) {
        // From the sky.
        0 => {
            let above = DVec3::new(rng.f64() * width, target.y + 5.0 + rng.f64() * 60.0, rng.f64() * depth);
            (above, if rng.bool() { DVec3::NEG_Y } else { target + free - above })
        }
        // From beside the world.
        1 => {
            let angle = rng.f64() * 6.3;
            let away = DVec3::new(angle.cos(), rng.f64() - 0.3, angle.sin()) * (width + depth);
            let from = DVec3::new(width / 2.0, target.y, depth / 2.0) + away;
            (from, target + free - from)
        }
        // Very far away.
        2 => {
            let from = target + random_direction(rng) * [1e3, 1e4, 1e5][rng.usize(0..3)];
            (from, target + free - from)
        }
        // Around the surface: inside the ground, in caves, just above.
        3 => (target + free * 4.0, random_direction(rng)),
        // From lattice points, along lattice lines.
        4 => (target, random_direction(rng)),
        5 => (target - DVec3::new(0.0, free.y, free.z) * 3.0, random_direction(rng)),
        // From edited samples: caves and buildings.
        6 => {
            let fields: Vec<LatticeBox> = world
                .fields()
                .flat_map(|(_, fields)| fields.iter().map(|f| f.bounds).collect::<Vec<_>>())
                .collect();
            let Some(bounds) = (!fields.is_empty()).then(|| fields[rng.usize(0..fields.len())]) else {
                return (target + free, random_direction(rng));
            };
            let at = bounds.min.as_dvec3() + (bounds.size().as_dvec3()) * (free + 0.5);
            (if rng.bool() { at } else { at.round() }, random_direction(rng))
        }
        // Exactly at a vertex, the middle of an edge or a place on an edge of what is drawn.
        7 => {
            let [a, b, _] = soup.triangles[rng.usize(0..soup.triangles.len())];
            let place = [a, (a + b) / 2.0, a.lerp(b, rng.f64())][rng.usize(0..3)];
            let direction = random_direction(rng);
            (place - direction * f64::from(rng.u32(1..40)), direction)
        }
        // At small triangles, and at large ones close to their edge.
        _ => {
            let [a, b, c] = soup.triangles[rng.usize(0..soup.triangles.len())];
            let (u, v) = (rng.f64() * 0.5, rng.f64() * [1e-9, 1e-3, 0.5][rng.usize(0..3)]);
            let place = a + (b - a) * u + (c - a) * v;
            let from = place + random_direction(rng) * 30.0;
            (from, place - from)
        }
    }
}

/// The worlds that are asked.
fn dug_worlds() -> impl Iterator<Item = (String, Terrain)> {
    (0..world_count(24)).map(|index| {
        let mut rng = Rng::with_seed(31_000 + index);
        (format!("world {index}"), random_world(&mut rng, index))
    })
}

/// A corner of the real landscape with a hillside of tunnels, its materials by height and slope.
fn dug_landscape() -> Terrain {
    let whole = real_ground();
    let height = |x: i32, z: i32| f64::from(whole.height(Column::new(400 + x, 300 + z))) / 256.0;
    let ground = Ground::from_fn(160, 144, height).expect("finite heights");
    let (low, high) = ground.height_range();
    let middle = f64::from(low + high) / 512.0;
    let rules = vec![
        MaterialRule { overlay: MaterialId(11), slope: (0.5, f64::INFINITY), ..Default::default() },
        MaterialRule { overlay: MaterialId(12), height: (middle, f64::INFINITY), ..Default::default() },
    ];
    let ground =
        ground.with_materials(&MaterialControl::Rules { base: MaterialId(10), rules }).expect("valid rules");
    let mut rng = Rng::with_seed(5);
    let mut brushes = Vec::new();
    for _ in 0..25 {
        brushes.push(random_brush(&mut rng, &ground));
        let column = Column::new(rng.i32(0..=160), rng.i32(0..=144));
        let from = Vec3::new(column.x as f32, ground.height(column) as f32 / 256.0 + 1.0, column.z as f32);
        let to = from + Vec3::new(rng.f32() * 60.0 - 30.0, -rng.f32() * 12.0, rng.f32() * 60.0 - 30.0);
        brushes.push(Brush::dig(Shape::capsule(from, to, 3.0)));
        brushes.push(Brush::dig(Shape::sphere(to, 6.0)).with_roughness(Roughness::new(
            1.5,
            4.0,
            rng.u32(..),
        )));
    }
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply(&brushes);
    terrain
}

#[test]
fn rays_hit_what_is_drawn() {
    let mut figures = Figures::default();
    for (name, terrain) in dug_worlds().chain([("the landscape".to_string(), dug_landscape())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(77));
        let soup = Soup::of(world);
        let rays = if name == "the landscape" { 4000 } else { 500 };
        for _ in 0..rays {
            let (origin, direction) = random_ray(&mut rng, world, &soup);
            if direction.length() < 1e-9 {
                continue;
            }
            let max = [f64::INFINITY, 1e6, 20.0, 3.0][rng.usize(0..4)];
            check_ray(world, &soup, origin, direction, max, &mut figures, &name);
        }
    }
    println!("{figures:?}");
    assert!(figures.rays > 10_000 && figures.hits > 5_000 && figures.from_inside > 500, "{figures:?}");
    assert!(figures.close_calls * 20 < figures.rays, "{figures:?}");
}
/// A vertical line anywhere: free, on lattice lines and points, on the rim, through vertices and edges.
fn random_column(rng: &mut Rng, world: &World, soup: &Soup) -> (f64, f64) {
    let (width, depth) = (world.grid().width(), world.grid().depth());
    let free = (rng.f64() * f64::from(width), rng.f64() * f64::from(depth));
    let lattice = (f64::from(rng.i32(0..=width)), f64::from(rng.i32(0..=depth)));
    match rng.u32(0..8) {
        0 | 1 => free,
        2 => lattice,
        3 => (lattice.0, free.1),
        4 => ([0.0, f64::from(width)][rng.usize(0..2)], [free.1, lattice.1][rng.usize(0..2)]),
        5 => ([free.0, lattice.0, 0.0][rng.usize(0..3)], [0.0, f64::from(depth)][rng.usize(0..2)]),
        _ => {
            // Through what was dug; tiles come first in the soup.
            let count = soup.triangles.len();
            let [a, b, c] = soup.triangles[rng.usize(soup.tiles.min(count - 1)..count)];
            let place = [a, (a + b) / 2.0, a.lerp(b, rng.f64()), (a + b + c) / 3.0][rng.usize(0..4)];
            (place.x, place.z)
        }
    }
}

/// The crossings that spans stand for, lowest first: height and whether it is a floor.
fn as_crossings(spans: &[Span]) -> Vec<(f64, bool)> {
    spans
        .iter()
        .flat_map(|span| [Some((span.floor, true)), span.ceiling.map(|y| (y, false))])
        .flatten()
        .collect()
}

/// Small steps off a vertical line, none of them along a lattice line: far from all and close to each, and all that
/// again much smaller.
fn steps() -> impl Iterator<Item = (f64, f64)> {
    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let shapes = [(1.0, 0.99999), (0.99999, 1.0), (1.0, 0.3), (0.3, 1.0), (1.0, 1e-5), (1e-5, 1.0)];
    let around = move |by: f64| {
        signs.into_iter().flat_map(move |(sx, sz)| shapes.map(|(dx, dz)| (by * sx * dx, by * sz * dz)))
    };
    around(NUDGE).chain(around(NUDGE * 1e-3))
}

/// A coordinate a little inside the world.
fn inside(at: f64, end: f64) -> f64 {
    at.clamp(NUDGE * 1e-6, end - NUDGE / 10.0)
}

#[test]
fn columns_cross_what_is_drawn() {
    let (mut columns, mut close_calls, mut caves, mut worst) = (0, 0, 0, 0.0f64);
    for (name, terrain) in dug_worlds().chain([("the landscape".to_string(), dug_landscape())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(78));
        let soup = Soup::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        let count = if name == "the landscape" { 4000 } else { 500 };
        for _ in 0..count {
            let (x, z) = random_column(&mut rng, world, &soup);
            let what = format!("{name}: column ({x:?}, {z:?})");
            let spans = world.spans(x, z);
            columns += 1;
            caves += usize::from(spans.len() > 1);

            // Air and ground take turns, and the sky is open.
            for (i, span) in spans.iter().enumerate() {
                // Along an edge a span may be a gap of no height, up to rounding.
                assert!(span.ceiling.is_none_or(|top| top >= span.floor - 1e-9), "{what}: {spans:?}");
                assert_eq!(span.ceiling.is_none(), i + 1 == spans.len(), "{what}: {spans:?}");
                assert!(
                    i == 0 || spans[i - 1].ceiling.is_some_and(|top| top <= span.floor + 1e-9),
                    "{what}: {spans:?}"
                );
            }
            assert_eq!(world.height(x, z), spans.last().map(|span| span.floor), "{what}");

            let answer = as_crossings(&spans);
            let difference = |expected: &[(f64, bool)]| {
                let pairs = || answer.iter().zip(expected);
                (answer.len() == expected.len() && pairs().all(|(a, b)| a.1 == b.1))
                    .then(|| pairs().map(|(a, b)| (a.0 - b.0).abs()).fold(0.0, f64::max))
            };
            let agrees =
                |expected: &[(f64, bool)]| difference(expected).is_some_and(|apart| apart <= TOLERANCE);
            let expected = soup.column(x, z);
            if agrees(&expected) {
                worst = worst.max(difference(&expected).unwrap_or(0.0));
                continue;
            }
            close_calls += 1;
            let beside: Vec<Vec<(f64, bool)>> =
                steps().map(|(dx, dz)| soup.column(inside(x + dx, width), inside(z + dz, depth))).collect();
            assert!(
                beside.iter().any(|expected| agrees(expected)),
                "{what}: {answer:?}, but brute force {expected:?}, and beside the column {beside:?}"
            );
        }
    }
    println!("{columns} columns, {caves} through caves, {close_calls} along edges; worst {worst:e} voxels");
    assert!(columns >= 10_000 && caves > 1000);
}

#[test]
fn what_is_solid_is_what_the_samples_say() {
    let (mut points, mut solid) = (0, 0);
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(79));
        let samples = world.samples();
        for _ in 0..1500 {
            let point = point_near_surface(&mut rng, world);
            // On the far rim, answers are those of 2^-20 voxel inside, which may be higher or lower.
            let on_rim = point.x == world.grid().width() || point.z == world.grid().depth();
            if on_rim && samples.distance(point).abs() < 16 {
                continue;
            }
            let is_solid = world.is_solid(point.as_dvec3());
            assert_eq!(
                is_solid,
                samples.is_solid(point),
                "{name}: {point}, sample {:?}",
                samples.sample(point)
            );
            points += 1;
            solid += usize::from(is_solid);
        }
    }
    println!("{points} lattice points, {solid} of them solid");
    assert!(points > 30_000 && solid * 4 > points && solid * 4 < points * 3);
}

#[test]
fn places_between_the_samples_are_solid_below_the_surface() {
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(80));
        let soup = Soup::of(world);
        for _ in 0..500 {
            let place =
                point_near_surface(&mut rng, world).as_dvec3() + DVec3::new(rng.f64(), rng.f64(), rng.f64());
            let crossings = soup.column(place.x, place.z);
            if crossings.iter().any(|crossing| (crossing.0 - place.y).abs() < TOLERANCE)
                || crossings.is_empty()
            {
                continue;
            }
            let above = crossings.iter().filter(|crossing| crossing.0 > place.y).count();
            assert_eq!(world.is_solid(place), above % 2 == 1, "{name}: {place:?} between {crossings:?}");
        }
    }
}

#[test]
fn the_normal_of_a_place_is_that_of_the_triangle_over_or_below_it() {
    let mut asked = 0;
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(81));
        let soup = Soup::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        for _ in 0..400 {
            let (x, z) = random_column(&mut rng, world, &soup);
            let crossings = soup.crossings(x, z);
            let Some(&(y, ..)) = crossings.get(rng.usize(0..crossings.len().max(1))) else { continue };
            let place = DVec3::new(x, y + (rng.f64() - 0.5) * 0.01, z);
            let mut candidates = Vec::new();
            for (dx, dz) in steps() {
                // Small steps around the place that the query takes the nearest 2^-20 voxel to be.
                let fine =
                    |at: f64, step: f64| (at * f64::from(1 << 20)).round() / f64::from(1 << 20) + step / 1e4;
                for (x, z) in [(x + dx, z + dz), (fine(x, dx), fine(z, dz))] {
                    let crossings = soup.crossings(inside(x, width), inside(z, depth));
                    let apart = |crossing: &(f64, bool, u32)| (crossing.0 - place.y).abs();
                    let nearest = crossings.iter().map(apart).fold(f64::INFINITY, f64::min);
                    // A step of a millionth is a long way down a steep triangle.
                    let nearest = crossings.iter().filter(|crossing| apart(crossing) < nearest + 0.02);
                    candidates.extend(nearest.map(|crossing| soup.normal(crossing.2)));
                }
            }
            let normal = world.normal(place).map(|normal| normal.as_dvec3());
            let alike = |candidate: &DVec3| normal.is_some_and(|normal| normal.dot(*candidate) > 1.0 - 1e-6);
            assert!(
                candidates.iter().any(alike),
                "{name}: at {place:?} {normal:?}, but the triangles there have {candidates:?}"
            );
            asked += 1;
        }
    }
    assert!(asked > 5000, "{asked}");
}

/// Level ground with hills, a tunnel and a bridge.
fn small_terrain() -> Terrain {
    let height = |x: i32, z: i32| 10.0 + f64::from((x * 5 + z * 3) % 7) / 2.0;
    let ground = Ground::from_fn(40, 30, height).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply([
        Brush::dig(Shape::capsule(Vec3::new(5.0, 5.0, 15.0), Vec3::new(35.0, 5.0, 15.0), 2.5)),
        Brush::add(
            Shape::capsule(Vec3::new(5.0, 20.0, 5.0), Vec3::new(35.0, 20.0, 25.0), 2.0),
            MaterialId(4),
        ),
    ]);
    terrain
}

#[test]
fn numbers_that_mean_nothing_have_no_answer() {
    let terrain = small_terrain();
    let world = terrain.world();
    let (place, down) = (DVec3::new(20.5, 40.0, 15.2), DVec3::NEG_Y);
    assert!(world.raycast(place, down, 100.0).is_some());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for broken in [
            DVec3::new(bad, 1.0, 1.0),
            DVec3::new(1.0, bad, 1.0),
            DVec3::new(1.0, 1.0, bad),
            DVec3::splat(bad),
        ] {
            assert_eq!(world.raycast(broken, down, 100.0), None, "{broken}");
            assert_eq!(world.raycast(place, broken, 100.0), None, "{broken}");
            // Only x and z matter to columns.
            if !broken.x.is_finite() || !broken.z.is_finite() {
                assert_eq!(world.normal(broken), None, "{broken}");
                assert!(!world.is_solid(broken), "{broken}");
            } else {
                let _ = (world.normal(broken), world.is_solid(broken));
            }
            let _ = world.material_under(broken);
        }
        for (x, z) in [(bad, 3.0), (3.0, bad), (bad, bad)] {
            assert_eq!(world.spans(x, z), [], "{x}, {z}");
            assert_eq!(world.height(x, z), None, "{x}, {z}");
        }
    }
    assert_eq!(world.raycast(place, DVec3::ZERO, 100.0), None);
    assert_eq!(world.raycast(place, down, f64::NAN), None);
    assert_eq!(world.raycast(place, down, -1.0), None);
    assert_eq!(world.raycast(place, down, f64::NEG_INFINITY), None);
    assert_eq!(world.raycast(place, down, 0.0), None);
}

#[test]
fn outside_the_world_there_is_nothing() {
    let terrain = small_terrain();
    let world = terrain.world();
    for (x, z) in [
        (-0.001, 5.0),
        (40.001, 5.0),
        (5.0, -0.001),
        (5.0, 30.001),
        (-1e300, 5.0),
        (5.0, 1e300),
        (f64::MAX, f64::MIN),
    ] {
        assert_eq!(world.spans(x, z), [], "{x}, {z}");
        assert_eq!(world.height(x, z), None, "{x}, {z}");
        assert_eq!(world.normal(DVec3::new(x, 10.0, z)), None, "{x}, {z}");
        assert!(!world.is_solid(DVec3::new(x, -50.0, z)), "{x}, {z}");
        assert_eq!(world.raycast(DVec3::new(x, 50.0, z), DVec3::NEG_Y, f64::INFINITY), None, "{x}, {z}");
    }
    // The rim belongs to the world.
    for (x, z) in [(0.0, 0.0), (40.0, 0.0), (0.0, 30.0), (40.0, 30.0), (-0.0, 12.5)] {
        assert!(world.height(x, z).is_some(), "{x}, {z}");
        assert!(world.is_solid(DVec3::new(x, 0.0, z)), "{x}, {z}");
        assert!(world.raycast(DVec3::new(x, 50.0, z), DVec3::NEG_Y, f64::INFINITY).is_some(), "{x}, {z}");
    }
}

#[test]
fn numbers_of_any_size_end_in_an_answer() {
    let terrain = small_terrain();
    let world = terrain.world();
    let tiny = f64::from_bits(1);
    let sizes = [
        0.0,
        -0.0,
        tiny,
        -tiny,
        1e-300,
        1e-160,
        -1e-9,
        1.0,
        -1.0,
        15.0,
        1e9,
        -1e15,
        1e160,
        1e300,
        -1e300,
        f64::MAX,
    ];
    let mut rng = Rng::with_seed(6);
    for _ in 0..4000 {
        let mut pick = || sizes[rng.usize(0..sizes.len())];
        let (origin, direction) = (DVec3::new(pick(), pick(), pick()), DVec3::new(pick(), pick(), pick()));
        let max = [0.0, 1.0, 1e9, f64::MAX, f64::INFINITY, tiny][rng.usize(0..6)];
        if let Some(hit) = world.raycast(origin, direction, max) {
            assert!(hit.distance >= 0.0 && hit.distance <= max, "{origin} {direction} {max}: {hit:?}");
            assert!(
                hit.position.is_finite() && hit.normal.is_finite(),
                "{origin} {direction} {max}: {hit:?}"
            );
        }
        let _ = (
            world.spans(origin.x, origin.z),
            world.is_solid(origin),
            world.normal(origin),
            world.material_under(origin),
        );
    }
}

#[test]
fn only_the_direction_of_a_direction_counts() {
    let terrain = small_terrain();
    let world = terrain.world();
    let mut rng = Rng::with_seed(9);
    for _ in 0..300 {
        let origin = DVec3::new(rng.f64() * 40.0, 12.0 + rng.f64() * 20.0, rng.f64() * 30.0);
        let direction = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.8, rng.f64() - 0.5).normalize();
        let expected = world.raycast(origin, direction, 1e3).map(|hit| hit.distance);
        for length in [1e-300, 1e-160, 1e-30, 1e30, 1e160, 1e300] {
            let found = world.raycast(origin, direction * length, 1e3).map(|hit| hit.distance);
            let agree = match (expected, found) {
                (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE,
                (a, b) => a == b,
            };
            assert!(
                agree,
                "from {origin:?} along {direction:?} {expected:?}, but {found:?} at length {length:e}"
            );
        }
    }
}

#[test]
fn rays_slip_through_no_edge() {
    let mut rays = 0;
    for (name, terrain) in dug_worlds().chain([("small".to_string(), small_terrain())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(12));
        let soup = Soup::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        let heights = || soup.triangles.iter().flatten().map(|place| place.y);
        let (low, high) =
            (heights().fold(f64::MAX, f64::min) - 1.0, heights().fold(f64::MIN, f64::max) + 1.0);
        for _ in 0..1500 {
            let first = if rng.bool() { soup.tiles.min(soup.triangles.len() - 1) } else { 0 };
            let [a, b, _] = soup.triangles[rng.usize(first..soup.triangles.len())];
            let target = [a, (a + b) / 2.0, a.lerp(b, rng.f64()), a.lerp(b, 0.25)][rng.usize(0..4)];
            let slant = [0.0, 1e-9, 1e-3, 0.125, 1.0][rng.usize(0..5)];
            let direction = match rng.bool() {
                true => DVec3::new((rng.f64() - 0.5) * slant, -1.0, (rng.f64() - 0.5) * slant),
                false => {
                    DVec3::new(f64::from(rng.i32(-2..=2)) * slant, -1.0, f64::from(rng.i32(-2..=2)) * slant)
                }
            };
            // All is ground below `low`: a ray that comes down from the sky to there, over the world all the way from
            // the highest ground on, has met some.
            let at = |y: f64| target + direction * (target.y - y);
            let is_over =
                |p: DVec3| (0.01..width - 0.01).contains(&p.x) && (0.01..depth - 0.01).contains(&p.z);
            if !is_over(at(low)) || !is_over(at(high)) {
                continue;
            }
            let origin = target - direction * (high - target.y + [1.0, 1e3, 1e5, 1e7, 1e9][rng.usize(0..5)]);
            let hit = world.raycast(origin, target - origin, f64::INFINITY);
            assert!(
                hit.is_some_and(|hit| hit.position.y > low),
                "{name}: from {origin:?} to {target:?}: {hit:?}"
            );
            rays += 1;
        }
    }
    assert!(rays > 10_000, "{rays}");
}

/// How far a place is from a triangle.
fn distance_to(place: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let sides = [(a, b), (b, c), (c, a)];
    if sides.into_iter().all(|(p, q)| (q - p).cross(place - p).dot(normal) >= 0.0) {
        return (place - a).dot(normal).abs();
    }
    let to_side = |(p, q): (DVec3, DVec3)| {
        let along = ((place - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        place.distance(p.lerp(q, along))
    };
    sides.into_iter().map(to_side).fold(f64::INFINITY, f64::min)
}

#[test]
fn rays_in_the_plane_of_a_triangle_end_on_the_surface() {
    // Stairs of level and slanting ground: rays in the plane of one triangle run on over others.
    let height = |x: i32, z: i32| if (x / 3 + z / 3) % 2 == 0 { 0.0 } else { f64::from((x * 7 + z * 5) % 4) };
    let ground = Ground::from_fn(40, 40, height).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let mut rng = Rng::with_seed(3);
    for _ in 0..20 {
        let place = Vec3::new(rng.f32() * 40.0, 1.0, rng.f32() * 40.0);
        terrain.apply([Brush::dig(Shape::sphere(place, 2.0))]);
    }
    let world = terrain.world();
    let soup = Soup::of(world);
    for _ in 0..20_000 {
        let [a, b, c] = soup.triangles[rng.usize(0..soup.triangles.len())];
        let (p, q) = (a.lerp(b, rng.f64()), b.lerp(c, rng.f64()));
        let Some(direction) = (q - p).try_normalize() else { continue };
        let origin = p - direction * rng.f64() * 50.0;
        let Some(hit) = world.raycast(origin, direction, 1e3) else { continue };
        let near = soup.near(hit.position, DVec3::Y).into_iter();
        let apart = near.map(|number| distance_to(hit.position, soup.triangles[number as usize]));
        let apart = apart.fold(f64::INFINITY, f64::min);
        assert!(apart <= TOLERANCE, "ray from {origin:?} along {direction:?}: {hit:?} is {apart} voxels off");
    }
}

#[test]
fn a_place_is_ready_unless_an_edit_is_on_its_way_to_it() {
    let mut terrain = small_terrain();
    let around = |x: i32, y: i32, z: i32, by: i32| LatticeBox::point(IVec3::new(x, y, z)).grown(by);
    let (here, there) = (around(10, 10, 10, 3), around(35, 10, 25, 3));
    let dig = Brush::dig(Shape::sphere(Vec3::new(10.0, 10.0, 10.0), 2.0));
    assert!(terrain.is_ready(here) && terrain.is_ready(there));

    // Queued.
    terrain.submit(&dig);
    assert!(!terrain.is_ready(here) && terrain.is_ready(there));
    // The reach is 4 voxels: the radius and two more.
    assert!(!terrain.is_ready(around(14, 10, 10, 0)) && terrain.is_ready(around(15, 10, 10, 0)));
    assert!(!terrain.is_ready(around(15, 10, 10, 1)));

    // Under way, with another one queued elsewhere.
    let transaction = terrain.begin().expect("an edit waits");
    assert!(!terrain.is_ready(here) && terrain.is_ready(there));
    terrain.submit(&Brush::dig(Shape::sphere(Vec3::new(35.0, 10.0, 25.0), 2.0)));
    assert!(!terrain.is_ready(here) && !terrain.is_ready(there));
    let commit = transaction.run();
    assert!(!terrain.is_ready(here), "computed, but not committed");
    terrain.commit(commit).expect("nothing came in between");
    assert!(terrain.is_ready(here) && !terrain.is_ready(there));

    // Given up, and so queued again.
    let lost = terrain.begin().expect("an edit waits");
    drop(lost);
    terrain.abandon();
    assert!(terrain.is_ready(here) && !terrain.is_ready(there));
    terrain.apply(std::iter::empty::<Brush>());
    assert!(terrain.is_ready(here) && terrain.is_ready(there));

    // A brush that will be rejected is no edit.
    terrain.submit(&Brush::dig(Shape::sphere(Vec3::new(10.0, f32::NAN, 10.0), 2.0)));
    assert!(terrain.is_ready(here));
}
