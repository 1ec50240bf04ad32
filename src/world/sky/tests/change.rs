//! What a commit changes in the light, compared with light that is computed from scratch.

use super::*;
use crate::lattice::{ChunkGrid, ChunkPos, TilePos};
use crate::lod::{Cut, Node};
use crate::loose::LooseSettings;
use crate::redraw::{relit_nodes, relit_parts};
use crate::surface::SurfaceMesh;
use crate::terrain::{Order, Transaction};
use crate::world::MeshKey;

/// The light of all corners of triangles of a tile or chunk.
fn lights_of(world: &World, drawn: MeshKey) -> Vec<Light> {
    let mesh = match drawn {
        MeshKey::Tile(tile) => world.tile_mesh(tile),
        MeshKey::Chunk(chunk) => world.chunk_mesh(chunk),
    };
    let (low, high) = world.grid().tile_cells(drawn.tile());
    let mut lights = SkyColumns::new(SkyView::of(world), low, high);
    let origin = world.origin(drawn) * SNAP;
    mesh.triangles().flatten().map(|vertex| lights.light(origin + vertex.position)).collect()
}

#[test]
fn a_commit_lights_all_that_it_changes() {
    let mut relit_tiles = 0;
    for (seed, size) in [(1, 16), (2, 32), (3, 8)] {
        let mut rng = Rng::with_seed(seed);
        let mut terrain = terrain(hills(seed as u32), size);
        for _ in 0..25 {
            let before = World::clone(terrain.world());
            let brush = any_brush(&mut rng, before.ground());
            terrain.submit(brush);
            let commit = terrain.begin().expect("it waits").run();
            let lit = LitWorld::new(Arc::new(before.clone()), commit.change().bricks);
            let mut redrawn: Vec<MeshKey> =
                commit.meshes.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile)).collect();
            redrawn.extend(commit.meshes.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk)));
            let relit = relit_parts(&lit, |drawn| redrawn.contains(&drawn));
            terrain.commit(commit).expect("it is next");
            let world = terrain.world();
            // The running commit has the light of the committed one.
            for tile in world.grid().tiles() {
                let (low, high) = world.grid().tile_cells(tile);
                let [mut running, mut done] =
                    [lit.view(), SkyView::of(world)].map(|view| SkyColumns::new(view, low, high));
                assert_eq!(running.lights(), done.lights());
            }
            assert!(!relit.iter().any(|drawn| redrawn.contains(drawn)));
            relit_tiles += relit.iter().filter(|drawn| matches!(drawn, MeshKey::Tile(_))).count();
            let tiles = world.grid().tiles().map(MeshKey::Tile);
            for drawn in tiles.chain(before.drawn_chunks().map(MeshKey::Chunk)) {
                if !redrawn.contains(&drawn) && !relit.contains(&drawn) {
                    assert_eq!(lights_of(&before, drawn), lights_of(world, drawn), "{drawn:?}");
                }
            }
        }
    }
    assert!(relit_tiles > 20, "{relit_tiles}");
}

/// A ground, and what players do there.
struct Scene {
    name: &'static str,
    chunk_size: u32,
    ground: Ground,
    /// Whether ground that is cut off breaks off.
    is_loose: bool,
    brush: fn(&mut Rng, &Ground) -> Brush,
}

fn scenes(seed: u32) -> [Scene; 5] {
    fn at(rng: &mut Rng, low: [i32; 3], high: [i32; 3]) -> Vec3 {
        let along =
            |axis: usize, rng: &mut Rng| low[axis] as f32 + rng.f32() * (high[axis] - low[axis]) as f32;
        Vec3::new(along(0, rng), along(1, rng), along(2, rng))
    }
    let gully = |x: i32, z: i32| {
        let side = (f64::from(x) - 40.0 - 4.0 * (f64::from(z) / 12.0).sin()).abs();
        26.0 - 8.0 * (1.0 - (side - 2.0) / 4.0).clamp(0.0, 1.0)
    };
    let slope = |x: i32, z: i32| 20.0 + 0.4 * f64::from(x) + 0.2 * f64::from(z);
    let ground = |height: &(dyn Fn(i32, i32) -> f64 + Sync)| Ground::from_fn(79, 79, height).expect("valid");
    [
        Scene { name: "hills", chunk_size: 16, ground: hills(seed), is_loose: false, brush: any_brush },
        Scene {
            name: "tunnels and overhangs",
            chunk_size: 32,
            ground: cliff(),
            is_loose: false,
            brush: |rng, _| {
                let from = at(rng, [36, 22, 20], [56, 30, 60]);
                let to = from + at(rng, [-8, -3, -8], [8, 3, 8]);
                Brush::dig(Shape::capsule(from, to, 1.5 + rng.f32() * 2.0))
            },
        },
        Scene {
            name: "roofs and loose pieces",
            chunk_size: 16,
            ground: ground(&|_, _| 20.0),
            is_loose: true,
            brush: |rng, _| {
                let center = at(rng, [24, 20, 24], [56, 28, 56]);
                let size = at(rng, [1, 1, 1], [9, 4, 9]);
                match rng.u8(0..3) {
                    0 => Brush::add(Shape::cuboid(center, size), MaterialId(2)),
                    _ => Brush::dig(Shape::cuboid(center, size)),
                }
            },
        },
        Scene { name: "gully", chunk_size: 8, ground: ground(&gully), is_loose: false, brush: any_brush },
        Scene {
            name: "borders and rims",
            chunk_size: 32,
            ground: ground(&slope),
            is_loose: false,
            brush: |rng, ground| {
                let along = |rng: &mut Rng| [0, 0, 31, 32, 33, 64, 77, 79][rng.usize(0..8)];
                let (x, z) = (along(rng), along(rng));
                let y = ground.height(Column::new(x, z)) / ONE - rng.i32(-1..3);
                Brush::dig(Shape::sphere(IVec3::new(x, y, z).as_vec3(), 1.0 + rng.f32() * 3.0))
            },
        },
    ]
}

/// What is drawn whose light differs between two worlds that draw the same shapes there, without parts that are drawn
/// again.
fn otherwise_lit(before: &World, after: &World, is_drawn_anew: impl Fn(MeshKey) -> bool) -> Vec<MeshKey> {
    let tiles = before.grid().tiles().map(MeshKey::Tile);
    let all = tiles.chain(before.drawn_chunks().map(MeshKey::Chunk)).filter(|drawn| !is_drawn_anew(*drawn));
    all.filter(|&drawn| lights_of(before, drawn) != lights_of(after, drawn)).collect()
}

/// Nodes of a cut whose light differs, without those that are drawn again.
fn otherwise_lit_nodes(before: &World, after: &World, cut: &Cut, drawn_anew: &[Node]) -> Vec<Node> {
    let all = before.drawn_in(cut).filter(|(node, _)| node.level > 0 && !drawn_anew.contains(node));
    let differs = |(node, mesh): &(Node, SurfaceMesh)| {
        let (low, high) = cut.grid().columns(*node);
        let [mut old, mut new] = [before, after]
            .map(|world| SparseSky::new(SkyView::of(world)).with_grid(low, high, node.stride()));
        let places = mesh.vertices.iter().map(|vertex| low.at(0) * SNAP + vertex.position);
        { places }.any(|place| old.light(place) != new.light(place))
    };
    all.filter(differs).map(|(node, _)| node).collect()
}

#[test]
fn everything_whose_light_changes_is_lit_again_wherever_players_dig() {
    for seed in 0..2 {
        for Scene { name, chunk_size, ground, is_loose, brush } in scenes(seed) {
            let mut rng = Rng::with_seed(u64::from(seed) + 20);
            let mut terrain = terrain(ground, chunk_size);
            terrain.set_loose(is_loose.then(LooseSettings::default));
            let cut = Cut::random(terrain.world().lod_grid(2), u64::from(seed), 12);
            let drawn = Arc::new(terrain.world().draw_cut(cut.clone()).0);
            terrain.set_drawn_cut(Some(Arc::clone(&drawn)));
            // Without what is lit again, light would be wrong in this many places.
            let (mut parts, mut nodes, mut spare) = (0, 0, 0);
            for number in 0..24 {
                let before = World::clone(terrain.world());
                match number % 6 {
                    4 => terrain.submit(Order::Undo),
                    5 if rng.bool() => terrain.submit(Order::Redo),
                    _ => terrain.submit(brush(&mut rng, before.ground())),
                }
                let Some(commit) = terrain.begin().map(Transaction::run) else { continue };
                let lit = LitWorld::new(Arc::new(before.clone()), commit.change().bricks);
                let tiles = commit.meshes.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile));
                let chunks = commit.meshes.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk));
                let redrawn: Vec<MeshKey> = tiles.chain(chunks).collect();
                let relit = relit_parts(&lit, |drawn| redrawn.contains(&drawn));
                let mut new_nodes: Vec<Node> = commit.meshes.nodes.iter().map(|update| update.node).collect();
                let own_nodes = new_nodes.clone();
                let relit_nodes = relit_nodes(&lit, &drawn, |node| own_nodes.contains(&node));
                terrain.commit(commit).expect("it is next");
                let world = terrain.world();
                let needed = otherwise_lit(&before, world, |drawn| redrawn.contains(&drawn));
                let missing: Vec<_> = needed.iter().filter(|drawn| !relit.contains(drawn)).collect();
                assert!(missing.is_empty(), "{name}: {missing:?} after {number} of {seed}");
                parts += needed.len();
                spare += relit.len() - needed.len();
                let needed = otherwise_lit_nodes(&before, world, &cut, &new_nodes);
                nodes += needed.len();
                new_nodes.extend(relit_nodes.iter().map(|update| update.node));
                let missing = otherwise_lit_nodes(&before, world, &cut, &new_nodes);
                assert!(missing.is_empty(), "{name}: {missing:?} after {number} of {seed}");
                // Columns that are brought up to date have the light of new ones, and that of each column alone.
                for tile in world.grid().tiles() {
                    let (low, high) = world.grid().tile_cells(tile);
                    let mut updated = SkyColumns::new(lit.view_before(), low, high).after(&lit);
                    let mut lone = SparseSky::new(SkyView::of(world));
                    assert_eq!(updated.lights(), SkyColumns::new(SkyView::of(world), low, high).lights());
                    let columns =
                        (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
                    let ground = updated.ground_lights();
                    for (&light, column) in ground.iter().zip(columns).step_by(7) {
                        let height = world.ground().height(column) * (SNAP / ONE);
                        // Tiles draw no ground that was dug.
                        if lone.top(column) * (SNAP / ONE) < height {
                            continue;
                        }
                        let expected = lone.light((column.at(0) * SNAP).with_y(height));
                        assert_eq!(light, expected, "{name}: {column:?} after {number} of {seed}");
                    }
                }
            }
            assert!(parts > 4, "{name}: {parts} parts");
            println!("{name}: {parts} parts and {nodes} nodes are lit again, {spare} without need");
        }
    }
}

/// A hash of the light of all that is drawn of a world, by columns and by single places, which agree.
fn hash_of_lights(world: &World) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut lone = SparseSky::new(SkyView::of(world));
    for (drawn, mesh) in world.drawn() {
        let (low, high) = world.grid().tile_cells(drawn.tile());
        let mut lights = SkyColumns::new(SkyView::of(world), low, high);
        let origin = world.origin(drawn) * SNAP;
        for vertex in &mesh.vertices {
            let light = lights.light(origin + vertex.position);
            assert_eq!(light, lone.light(origin + vertex.position), "{drawn:?}");
            for byte in [light.sky, light.daylight] {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
    }
    hash
}

/// Light is part of what players see, on each machine the same: it must not change unnoticed. If the rules change on
/// purpose, put in the hashes that this test prints.
#[test]
fn light_stays_what_it_was() {
    let hashes = scenes(0).map(|Scene { name, chunk_size, ground, is_loose, brush }| {
        let mut rng = Rng::with_seed(31);
        let mut terrain = terrain(ground, chunk_size);
        terrain.set_loose(is_loose.then(LooseSettings::default));
        let mut hash = 0;
        for _ in 0..4 {
            for _ in 0..8 {
                let brush = brush(&mut rng, terrain.world().ground());
                dig(&mut terrain, &[brush]);
            }
            hash ^= hash_of_lights(terrain.world()).wrapping_add(hash << 6);
        }
        println!("{name}: {hash:#018x}");
        hash
    });
    let expected = [
        0xad16_17b5_0262_33ac,
        0x91d1_e148_b904_3d64,
        0xde05_0ee0_bfc9_78eb,
        0xd31d_8c55_ac06_b1df,
        0xbe5d_8d52_2f80_6a3a,
    ];
    assert_eq!(hashes, expected);
}

#[test]
fn a_dig_on_a_plain_redraws_nothing_for_its_light() {
    let mut terrain = terrain(Ground::flat(127, 127, 20.0).expect("valid"), 32);
    let before = terrain.snapshot();
    terrain.submit(Brush::dig(Shape::sphere(Vec3::new(60.0, 20.0, 62.0), 4.0)));
    let commit = terrain.begin().expect("it waits").run();
    let lit = LitWorld::new(before, commit.change().bricks);
    let redrawn: Vec<TilePos> = commit.meshes.tiles.iter().map(|(tile, _)| *tile).collect();
    let chunks: Vec<ChunkPos> = commit.meshes.chunks.iter().map(|(chunk, _)| *chunk).collect();
    let is_redrawn = |drawn| match drawn {
        MeshKey::Tile(tile) => redrawn.contains(&tile),
        MeshKey::Chunk(chunk) => chunks.contains(&chunk),
    };
    assert_eq!(relit_parts(&lit, is_redrawn), []);
}

/// Some place on an edge of the lattice, or over the diagonal of a cell, near a box.
fn any_place(rng: &mut Rng, changed: &ChangedBox, grid: ChunkGrid) -> IVec3 {
    let (low, high) = changed.lit();
    let column = Column::new(
        rng.i32(low.x..=high.x).clamp(0, grid.width() - 1),
        rng.i32(low.z..=high.z).clamp(0, grid.depth() - 1),
    );
    let y = rng.i32(changed.bottom / ONE - 18..=changed.top / ONE + 10);
    let part = rng.i32(0..SNAP);
    let along = [IVec3::ZERO, IVec3::X, IVec3::Y, IVec3::Z, IVec3::new(1, 0, 1)][rng.usize(0..5)];
    column.at(y) * SNAP + along * part
}

#[test]
fn light_is_said_to_change_exactly_where_it_does() {
    for seed in 0..2 {
        for Scene { name, chunk_size, ground, is_loose, brush } in scenes(seed) {
            let mut rng = Rng::with_seed(u64::from(seed) + 60);
            let mut terrain = terrain(ground, chunk_size);
            terrain.set_loose(is_loose.then(LooseSettings::default));
            // Places whose light changes, all of them and those under roofs.
            let (mut changes, mut under_roofs, mut places) = (0, 0, 0);
            for number in 0..20 {
                let before = terrain.snapshot();
                match number % 5 {
                    4 => terrain.submit(Order::Undo),
                    _ => terrain.submit(brush(&mut rng, before.ground())),
                }
                let Some(commit) = terrain.begin().map(Transaction::run) else { continue };
                let lit = LitWorld::new(Arc::clone(&before), commit.change().bricks);
                terrain.commit(commit).expect("it is next");
                let Some(changed) = lit.changes().into_iter().reduce(ChangedBox::union) else { continue };
                let world = terrain.world();
                let grid = world.grid();
                let (low, high) = changed.lit();
                let inside = |column: Column| {
                    Column::new(column.x.clamp(0, grid.width()), column.z.clamp(0, grid.depth()))
                };
                let mut change = LightChange::new(&lit, (inside(low), inside(high)), changed);
                let [mut old, mut new] = [&*before, world].map(|world| SparseSky::new(SkyView::of(world)));
                let drawn: Vec<IVec3> = vertices(world).into_iter().map(|(place, _)| place).collect();
                let some = (0..400).map(|_| any_place(&mut rng, &changed, grid)).collect::<Vec<_>>();
                for place in some.into_iter().chain(drawn.into_iter().skip(number).step_by(11)) {
                    let differs = old.light(place) != new.light(place);
                    assert_eq!(
                        change.shows_at(place),
                        differs,
                        "{name}: {:?} after {number} of {seed}",
                        place.as_vec3() / SNAP as f32
                    );
                    places += 1;
                    changes += usize::from(differs);
                    let top = old.top(Column::of(place.div_euclid(IVec3::splat(SNAP))));
                    under_roofs += usize::from(differs && place.y < top * (SNAP / ONE));
                }
            }
            println!("{name}: the light of {changes} of {places} places changes, {under_roofs} under roofs");
            assert!(changes > 200 && changes < places / 2 && under_roofs > 20, "{name}: {changes}");
        }
    }
}
