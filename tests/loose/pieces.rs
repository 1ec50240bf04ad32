//! Which pieces edits cut off, compared with a flood fill, and how they are drawn.

use std::collections::HashMap;

use bevy_burrow::lattice::{BrickPos, SNAP};
use bevy_burrow::surface::vertex::crossing;
use bevy_burrow::surface::{MaterialMix, cases};
use bevy_burrow::volume::MaterialCounts;
use glam::DVec3;

use super::*;

#[test]
fn pieces_equal_those_of_brute_force() {
    let (mut found, mut bounded) = (0, 0);
    for index in 0..world_count(1000) {
        let mut rng = Rng::with_seed(51_000 + index);
        let (ground, chunk_size) = small_world(&mut rng, index);
        let brushes: Vec<Brush> =
            (0..rng.usize(1..9)).map(|_| crumbling_brush(&mut rng, &ground, chunk_size)).collect();
        let mut terrain = terrain(ground, chunk_size);
        terrain.apply(&brushes);
        let world = terrain.world();
        let around = world.bricks().map(|(pos, _)| pos.samples().grown(1)).reduce(LatticeBox::union);
        let around = around.unwrap_or(LatticeBox::point(IVec3::ZERO));
        let expected = by_brute_force(world);
        for largest in [u32::MAX, 40, 1] {
            let settings = LooseSettings { largest, crumbs: 5, debris: 90 };
            let pieces = world.loose_pieces(around, &settings);
            let own: BTreeSet<Piece> = pieces.iter().map(samples_of).collect();
            let small = |piece: &&Piece| piece.len() as u64 <= largest.into();
            assert_eq!(own, expected.iter().filter(small).cloned().collect(), "world {index}, {largest}");
            assert_eq!(own.len(), pieces.len(), "world {index}: each is found once");
            for piece in &pieces {
                check_piece(world, piece, &format!("world {index}"));
                let fate = match piece.voxels {
                    0..=5 => PieceFate::Removed,
                    6..=90 => PieceFate::BrokeOff,
                    _ => PieceFate::Left,
                };
                assert_eq!(piece.fate, fate);
            }
            found += pieces.len();
            bounded += usize::from(own.len() < expected.len());
        }
    }
    println!("{found} pieces, {bounded} bounded searches");
    assert!(found > 500 && bounded > 100, "{found} pieces, {bounded} bounded searches");
}

/// Every edge is used equally often in both directions: the mesh is closed.
fn assert_closed(piece: &LoosePiece, what: &str) {
    let mesh = piece.mesh.as_ref().expect("a piece that broke off has a mesh");
    let mut edges: HashMap<([i32; 3], [i32; 3]), i32> = HashMap::new();
    let mut volume = 0.0;
    for triangle in mesh.triangles() {
        let corners = triangle.map(|vertex| vertex.position.to_array());
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            *edges.entry((corners[a], corners[b])).or_default() += 1;
        }
        let [a, b, c] = triangle.map(|vertex| vertex.position.as_dvec3() / 4096.0);
        volume += a.dot(b.cross(c)) / 6.0;
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(edges.get(&(b, a)), Some(&count), "{what}: {a:?} to {b:?}");
    }
    assert!(volume > 0.0 && volume < piece.voxels as f64 * 4.0, "{what}: {volume} of {}", piece.voxels);
    let reach = LatticeBox { min: IVec3::ZERO, max: piece.bounds.size() - 1 }.grown(1);
    for vertex in &mesh.vertices {
        assert!(reach.contains(vertex.position.div_euclid(IVec3::splat(4096))), "{what}");
    }
}

/// The materials of the drawn vertices, by position in 1/4096 voxel.
fn drawn_materials(world: &World) -> HashMap<IVec3, MaterialMix> {
    let mut all = HashMap::new();
    for (drawn, mesh) in world.drawn() {
        let origin = world.origin(drawn) * SNAP;
        let vertices = mesh.triangles().flatten();
        all.extend(vertices.map(|vertex| (origin + vertex.position, vertex.materials)));
    }
    all
}

/// Counts of the pieces' vertices: those that the world had drawn, those of built or painted material, those at the
/// rim of the world, and the normals compared.
#[derive(Debug, Default)]
struct PieceVertices {
    drawn: usize,
    built: usize,
    sides: usize,
    normals: usize,
}

impl PieceVertices {
    /// Checks that a piece looks as it did in its world, as if the ground next to it were not there.
    fn check(&mut self, world: &World, drawn: &HashMap<IVec3, MaterialMix>, piece: &LoosePiece, what: &str) {
        let (own, samples, grid) = (samples_of(piece), world.samples(), world.grid());
        let is_own = |point: IVec3| own.contains(&point.to_array());
        let is_inside =
            |point: IVec3| (0..=grid.width()).contains(&point.x) && (0..=grid.depth()).contains(&point.z);
        let density = |point: IVec3| match samples.distance(point) {
            _ if !is_inside(point) => f64::from(i32::MAX / 4),
            solid if solid < 0 && !is_own(point) => 256.0,
            own => f64::from(own),
        };
        let gradient = |point: IVec3| {
            let along = |step: IVec3| density(point + step) - density(point - step);
            DVec3::new(along(IVec3::X), along(IVec3::Y), along(IVec3::Z))
        };
        let mesh = piece.mesh.as_ref().expect("a piece that broke off has a mesh");
        for vertex in &mesh.vertices {
            let place = vertex.position + piece.bounds.min * SNAP;
            let (cube, rest) = (place.div_euclid(IVec3::splat(SNAP)), place.rem_euclid(IVec3::splat(SNAP)));
            // A vertex on a lattice point lies at the upper end of an unedited edge.
            let axis = (0..3).find(|&axis| rest[axis] > 0).unwrap_or(1);
            let from = if rest == IVec3::ZERO { cube - IVec3::Y } else { cube };
            let way = [IVec3::X, IVec3::Y, IVec3::Z][axis];
            let to = from + way;
            assert!(is_own(from) != is_own(to), "{what}: {place} is not between the piece and air");
            let (solid, out) = if is_own(from) { (from, way) } else { (to, -way) };

            let stencil = || [from, to].into_iter().flat_map(|end| STEPS.map(|step| end + step));
            let is_pristine = |point: IVec3| is_inside(point) && !samples.is_edited(point);
            let is_sheet = is_pristine(from) && is_pristine(to) && stencil().all(is_pristine);
            let stored = samples.stored_material(solid);
            if stored != MaterialId::GROUND && !is_sheet {
                assert_eq!(vertex.materials, MaterialMix::pure(stored), "{what}: {place}");
                self.built += 1;
            }
            if !is_inside(solid + out) {
                // At the rim the piece ends at its last sample.
                assert_eq!(place, solid * SNAP + out, "{what}: {place}");
                assert!(vertex.normal.dot(out.as_vec3()) > 0.5, "{what}: {place}: {}", vertex.normal);
                self.sides += 1;
            } else {
                let step = crossing(&world.view(), from, axis);
                assert_eq!(place, from * SNAP + way * step, "{what}: {place}");
                // Where the heightmap is drawn, cubes have vertices that the heightmap does not have.
                if let Some(materials) = drawn.get(&place) {
                    assert_eq!(vertex.materials, *materials, "{what}: {place}");
                    self.drawn += 1;
                }
            }
            let along = f64::from((place - from * SNAP).element_sum()) / f64::from(SNAP);
            let expected = gradient(from).lerp(gradient(to), along);
            if !is_sheet && expected.length() > 8.0 {
                let apart = expected.normalize().distance(vertex.normal.as_dvec3());
                assert!(apart < 5e-3, "{what}: {place}: {} instead of {expected}", vertex.normal);
                self.normals += 1;
            }
        }
    }
}

/// The pieces that an edit cut off: those with a sample next to one that turned to air.
fn cut_off(before: &World, after: &World) -> Vec<Piece> {
    let turned = |point: IVec3| before.samples().is_solid(point) && !after.samples().is_solid(point);
    let is_inside = |p: &IVec3| {
        let grid = after.grid();
        (0..=grid.width()).contains(&p.x) && (0..=grid.depth()).contains(&p.z)
    };
    let beside = |point: &Point| {
        STEPS.map(|step| IVec3::from_array(*point) + step).iter().any(|p| is_inside(p) && turned(*p))
    };
    by_brute_force(after).into_iter().filter(|piece| piece.iter().any(beside)).collect()
}

#[test]
fn edits_take_out_what_they_cut_off_and_nothing_else() {
    let (mut removed, mut broken, mut left, mut sculpted, mut pasted, mut long) = (0, 0, 0, 0, 0, 0);
    let mut looks = PieceVertices::default();
    for index in 0..world_count(150) {
        let mut rng = Rng::with_seed(52_000 + index);
        let (ground, chunk_size) = small_world(&mut rng, index);
        let mut terrain = terrain(ground, chunk_size);
        let settings = LooseSettings { largest: 3000, crumbs: rng.u32(0..6), debris: rng.u32(6..400) };
        for turn in 0..6 {
            let what = format!("world {index}, turn {turn}");
            let ground = terrain.snapshot();
            let brush = crumbling_brush(&mut rng, ground.ground(), chunk_size);
            let before = terrain.snapshot();
            terrain.set_loose(None);
            terrain.apply([&brush]);
            let plain = terrain.snapshot();
            if plain.hash() == before.hash() {
                continue;
            }
            assert!(terrain.undo().outcome.is_ok());
            terrain.set_loose(Some(settings));
            let applied = terrain.apply([&brush]).remove(0).outcome.expect("it changed something before");
            // Ground that loses its support by a reset does not fall.
            let cut = match brush.operation {
                Operation::Reset => Vec::new(),
                _ => cut_off(&before, &plain),
            };
            let expected: BTreeSet<Piece> = cut.into_iter().filter(|piece| piece.len() <= 3000).collect();
            let own: BTreeSet<Piece> = applied.loose.iter().map(samples_of).collect();
            assert_eq!(own, expected, "{what}");
            sculpted += if brush.operation.is_sculpting() { own.len() } else { 0 };
            pasted += if matches!(brush.operation, Operation::Paste { .. }) { own.len() } else { 0 };
            long += if brush.custom.is_some() { own.len() } else { 0 };

            let mut gone = Piece::new();
            let is_broken = applied.loose.iter().any(|piece| piece.mesh.is_some());
            let drawn = if is_broken { drawn_materials(&plain) } else { HashMap::new() };
            for piece in &applied.loose {
                check_piece(&plain, piece, &what);
                match piece.fate {
                    PieceFate::Left => left += 1,
                    PieceFate::Removed => removed += 1,
                    PieceFate::BrokeOff => {
                        assert_closed(piece, &what);
                        looks.check(&plain, &drawn, piece, &what);
                        broken += 1;
                    }
                }
                assert_eq!(piece.mesh.is_some(), piece.fate == PieceFate::BrokeOff);
                if piece.fate != PieceFate::Left {
                    gone.append(&mut samples_of(piece));
                }
            }
            // Which samples are solid, their materials, and the position of the surface.
            let (world, mut counts) = (terrain.world(), MaterialCounts::default());
            let columns = everything(world);
            // A reset takes bricks away.
            let bricks: BTreeSet<[i32; 3]> = [world, &*before]
                .into_iter()
                .flat_map(|own| own.bricks())
                .map(|(pos, _)| pos.0.to_array())
                .collect();
            let bricks = bricks.into_iter().map(|pos| BrickPos(IVec3::from_array(pos)).samples());
            let bricks: Vec<LatticeBox> = bricks.filter_map(|own| own.intersection(columns)).collect();
            let mut bounds = None;
            for point in bricks.iter().flat_map(|brick| brick.points()) {
                let (old, new) = (plain.samples(), world.samples());
                let is_gone = gone.contains(&point.to_array());
                assert_eq!(new.is_solid(point), old.is_solid(point) && !is_gone, "{what}: {point}");
                let sample =
                    |world: &World| (world.samples().sample(point), world.samples().stored_material(point));
                if sample(&before) != sample(world) {
                    LatticeBox::include(&mut bounds, LatticeBox::point(point));
                }
                if !new.is_solid(point) {
                    continue;
                }
                assert_eq!(new.material(point), old.material(point), "{what}: {point}");
                for step in STEPS.map(|step| point + step) {
                    let axis = (0..3).find(|&axis| step[axis] != point[axis]).expect("a step");
                    let low = point.min(step);
                    if columns.contains(step) && !new.is_solid(step) && !old.is_solid(step) {
                        let at = |world: &World| crossing(&world.view(), low, axis);
                        assert_eq!(at(world), at(&plain), "{what}: {point} to {step}");
                    }
                }
            }
            assert_eq!(applied.bounds, bounds, "{what}");
            applied.loose.iter().for_each(|piece| counts.add(&piece.materials));
            assert!(world.check_seams().is_flawless(), "{what}: {}", world.check_seams());
            if gone.is_empty() {
                assert_eq!(world.hash(), plain.hash(), "{what}");
            }
            let after = world.hash();
            assert!(terrain.undo().outcome.is_ok());
            assert_eq!(terrain.world().hash(), before.hash(), "{what}: undone");
            assert!(terrain.redo().outcome.is_ok());
            assert_eq!(terrain.world().hash(), after, "{what}: redone");
        }
    }
    println!(
        "{removed} removed, {broken} broken off, {left} left; {sculpted} by sculpting, {pasted} by pastes, {long} by paths and grids; {looks:?}"
    );
    assert!(removed > 50 && broken > 50 && left > 5, "{removed} removed, {broken} broken off, {left} left");
    assert!(sculpted > 10, "{sculpted} pieces were cut off by sculpting");
    assert!(pasted > 0 && long > 0, "{pasted} by pastes, {long} by paths and grids");
    let PieceVertices { drawn, built, sides, normals } = looks;
    assert!(drawn.min(normals) > 300 && built.min(sides) > 20, "{looks:?}");
}

#[test]
fn loose_pieces_do_not_depend_on_how_edits_are_batched() {
    let mut fallen = 0;
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(53_000 + index);
        let brushes = |rng: &mut Rng, ground: &Ground, chunk_size| -> Vec<Brush> {
            (0..14).map(|tag| crumbling_brush(rng, ground, chunk_size).with_tag(tag)).collect()
        };
        let settings = LooseSettings { largest: 2000, crumbs: 10, debris: 300 };
        let (seed, mut results) = (rng.u64(..), Vec::new());
        for batch in [1, 3, 14] {
            // An equal world each time, with another chunk size.
            let mut rng = Rng::with_seed(seed);
            let (ground, _) = small_world(&mut rng, index);
            let brushes = brushes(&mut rng, &ground, 16);
            let rules =
                if index % 2 == 1 { random_rules(&mut rng, &ground) } else { DiggingRules::default() };
            let mut terrain = terrain(ground, [8, 16, 61][batch % 3]);
            terrain.set_loose(Some(settings));
            terrain.set_rules(rules).expect("valid rules");
            let receipts: Vec<Receipt> =
                brushes.chunks(batch).flat_map(|batch| terrain.apply(batch)).collect();
            let loose: Vec<Vec<LoosePiece>> = receipts
                .into_iter()
                .map(|receipt| receipt.outcome.map(|own| own.loose).unwrap_or_default())
                .collect();
            fallen += loose.iter().map(Vec::len).sum::<usize>();
            assert!(terrain.world().check_seams().is_flawless(), "world {index}");
            results.push((terrain.world().hash(), loose));
        }
        assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "world {index}");
    }
    assert!(fallen > 100, "{fallen} pieces");
}

#[test]
fn dependent_adds_keep_the_digs_before_them() {
    let at = |x: f32, y: f32| Vec3::new(x, y, 20.0);
    let brushes = [
        Brush::dig(Shape::sphere(at(20.0, 10.0), 4.0)),
        Brush::add(Shape::sphere(at(44.0, 10.0), 3.0), MaterialId(1)),
        // The add reads samples that the dig may change, and lies in a brick that the dig changed.
        Brush::add(Shape::capsule(at(24.0, 12.0), at(42.0, 12.0), 1.5), MaterialId(2)),
    ];
    let hash = |batch: usize| {
        let mut terrain = terrain(Ground::flat(64, 64, 10.0).expect("valid"), 32);
        terrain.set_rules(DiggingRules::default().with_unbreakable(MaterialId(9))).expect("valid rules");
        terrain.set_loose(Some(LooseSettings::default()));
        brushes.chunks(batch).for_each(|batch| drop(terrain.apply(batch)));
        assert!(!terrain.world().samples().is_solid(IVec3::new(18, 9, 20)), "in batches of {batch}");
        terrain.world().hash()
    };
    assert_eq!(hash(3), hash(1));
}

#[test]
fn a_slab_falls_when_its_pillar_is_sawn_through() {
    let mut terrain = table();
    let settings = LooseSettings { largest: 10_000, crumbs: 0, debris: 10_000 };
    terrain.set_loose(Some(settings));
    let half = Brush::dig(Shape::cuboid(Vec3::new(29.0, 14.0, 32.0), Vec3::new(2.2, 1.2, 4.0)));
    let receipt = terrain.apply([half]).remove(0).outcome.expect("it reaches the pillar");
    assert!(
        receipt.removed.total() > 0 && receipt.loose.is_empty(),
        "half of the pillar still carries the slab"
    );
    let receipt = terrain.apply([saw()]).remove(0).outcome.expect("it reaches the pillar");
    let [piece] = &receipt.loose[..] else { panic!("one piece: {:?}", receipt.loose) };
    assert_eq!(piece.fate, PieceFate::BrokeOff);
    // 17 x 5 x 17 samples, and two layers of the pillar inside them.
    assert_eq!(piece.materials.of(MaterialId(3)), 17 * 5 * 17 - 3 * 3 * 2);
    assert!(piece.materials.of(MaterialId(2)) > 3 * 3 * 2);
    assert_closed(piece, "slab");
    assert_eq!(terrain.world().height(36.0, 36.0), Some(8.0), "nothing hangs over the ground");
    assert!(terrain.world().check_seams().is_flawless());
}

#[test]
fn paint_and_add_cut_nothing_off_and_large_pieces_stay() {
    let mut terrain = table();
    terrain.set_loose(Some(LooseSettings { largest: 1000, crumbs: 1000, debris: 0 }));
    let hash = |terrain: &Terrain| terrain.world().hash();
    let receipt = terrain.apply([saw()]).remove(0).outcome.expect("it reaches the pillar");
    assert!(receipt.loose.is_empty(), "the slab has more than 1000 voxels");
    let before = hash(&terrain);
    terrain.set_loose(Some(LooseSettings { largest: 10_000, crumbs: 10_000, debris: 0 }));
    let slab = Vec3::new(32.0, 24.0, 32.0);
    let painted = terrain.apply([Brush::paint(Shape::sphere(slab, 3.0), MaterialId(7))]);
    assert!(painted[0].outcome.as_ref().is_ok_and(|applied| applied.loose.is_empty()));
    assert_ne!(hash(&terrain), before);
    // The first dig at the slab finds that it is loose.
    let receipt = terrain.apply([Brush::dig(Shape::sphere(slab, 2.0))]).remove(0).outcome.expect("a hit");
    assert_eq!(receipt.loose.iter().map(|piece| piece.fate).collect::<Vec<_>>(), [PieceFate::Removed]);
    assert!(receipt.loose[0].materials.of(MaterialId(7)) > 0);
    assert_eq!(terrain.world().height(36.0, 36.0), Some(8.0));
}

#[test]
fn every_triangle_lies_within_one_component_of_its_cube() {
    // All corners that a triangle touches are connected within its cube by steps along solid corners.
    for (case, drawn) in cases::table().iter().enumerate() {
        let part = |corner: usize| {
            let mut reached = 1 << corner;
            loop {
                let beside = (0..8).filter(|at| (0..3).any(|axis| reached >> (at ^ 1 << axis) & 1 == 1));
                let next = beside.fold(reached, |all, at| all | 1 << at) & (case | 1 << corner);
                if next == reached {
                    break reached;
                }
                reached = next;
            }
        };
        for triangle in drawn.triangles() {
            let parts = triangle.map(|edge| {
                let (low, axis) = cases::edge_corners(edge);
                let ends = [low, low | 1 << axis].map(|corner| case >> corner & 1 == 1);
                assert_ne!(ends[0], ends[1], "case {case}: a vertex between two solid corners");
                part(if ends[0] { low } else { low | 1 << axis })
            });
            assert!(parts[0] == parts[1] && parts[1] == parts[2], "case {case} joins two components");
        }
    }
}

#[test]
fn corners_and_edges_connect_nothing() {
    // Two balls above ground whose boxes meet only at a corner.
    let mut terrain = terrain(Ground::flat(64, 64, 8.0).expect("flat ground"), 32);
    let cube = |low: Vec3| Brush::add(Shape::cuboid(low + 1.5, Vec3::splat(1.6)), MaterialId(1));
    terrain.apply([cube(Vec3::new(20.0, 20.0, 20.0)), cube(Vec3::new(24.0, 24.0, 20.0))]);
    let world = terrain.world();
    let pieces = world.loose_pieces(
        everything(world)
            .intersection(LatticeBox { min: IVec3::splat(15), max: IVec3::splat(35) })
            .expect("not empty"),
        &LooseSettings::default(),
    );
    assert_eq!(pieces.iter().map(|piece| piece.voxels).collect::<Vec<_>>(), [64, 64]);
    assert!(pieces.iter().all(|piece| piece.runs.len() == 16 && piece.fate == PieceFate::Left));
}
