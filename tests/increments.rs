//! After every commit, what was kept up to date is what would be made from scratch: samples, bits, hash, receipts, mask,
//! meshes, shared bricks. Everything here is counted again, one sample and one cell at a time.

mod worlds;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use bevy_burrow::brush::{BAND, Evaluator};
use bevy_burrow::ground::{Ground, MaterialControl, MaterialRule};
use bevy_burrow::lattice::{BrickPos, ChunkPos, Column, LatticeBox, ONE, TilePos};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::surface::mask::cell_sheet;
use bevy_burrow::surface::{SurfaceMesh, Vertex, plain};
use bevy_burrow::terrain::{FieldNews, MeshUpdates, World};
use bevy_burrow::volume::{Brick, FieldId};
use fastrand::Rng;
use glam::{IVec3, Quat, Vec3};

/// A vertex as bits: 0.0 is not -0.0.
type Bits = ([i32; 3], [u32; 3], [u8; 4], [u8; 4]);
/// A mesh as bits.
type MeshBits = (Vec<Bits>, Vec<u32>);

fn bits(vertex: &Vertex) -> Bits {
    let normal = vertex.normal.to_array().map(f32::to_bits);
    (vertex.position.to_array(), normal, vertex.materials.ids, vertex.materials.weights)
}

fn mesh_bits(mesh: &SurfaceMesh) -> MeshBits {
    (mesh.vertices.iter().map(bits).collect(), mesh.indices.clone())
}

fn sorted(vertices: &[Vertex], indices: impl Iterator<Item = usize>) -> Vec<[Bits; 3]> {
    let corners: Vec<Bits> = indices.map(|index| bits(&vertices[index])).collect();
    let mut triangles: Vec<[Bits; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.sort_unstable();
    triangles
}

/// SplitMix64, as the hash of samples is documented to be made of.
fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Every edited sample: density and stored material.
type Samples = HashMap<IVec3, (i32, MaterialId)>;

/// What an edit did, by the naive count.
#[derive(Debug, Default, PartialEq)]
struct Effect {
    chunks: BTreeSet<ChunkPos>,
    bounds: Option<LatticeBox>,
    removed: BTreeMap<MaterialId, u64>,
    added: BTreeMap<MaterialId, u64>,
    painted: BTreeMap<MaterialId, u64>,
}

/// A world that is edited sample by sample, and whatever else has to be true of the one under test.
struct Witness {
    terrain: Terrain,
    samples: Samples,
    /// Meshes as a game has them that only ever hears of updates.
    tiles: HashMap<TilePos, MeshBits>,
    chunks: HashMap<ChunkPos, MeshBits>,
    /// Kinds of bricks that were all alike at some commit.
    kinds: HashSet<(i32, MaterialId)>,
    fields: BTreeSet<(ChunkPos, FieldId)>,
    mesher: Mesher,
    /// A tall cliff's sheets have too many blocks to be meshed twice each time.
    is_meshed_again: bool,
}

impl Witness {
    fn new(ground: Ground, chunk_size: u32) -> Self {
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let terrain = Terrain::new(ground, &settings).expect("valid settings");
        let world = terrain.world();
        let tiles = world.grid().tiles().map(|tile| (tile, mesh_bits(&world.tile_mesh(tile)))).collect();
        Self {
            terrain,
            samples: Samples::default(),
            tiles,
            chunks: HashMap::new(),
            kinds: HashSet::new(),
            fields: BTreeSet::new(),
            mesher: Mesher::default(),
            is_meshed_again: true,
        }
    }

    /// One transaction of these brushes, and every check there is.
    fn apply(&mut self, brushes: &[Brush], what: &str) {
        for brush in brushes {
            self.terrain.submit(brush);
        }
        let transaction = self.terrain.begin().expect("brushes wait");
        let mut commit = transaction.run();
        let news = commit.field_news().to_vec();
        // Whoever swaps meshes may take them away; the world keeps its own.
        let meshes = std::mem::take(&mut commit.meshes);
        let receipts = self.terrain.commit(commit).expect("nothing else commits");
        assert_eq!(receipts.len(), brushes.len(), "{what}");
        for (receipt, brush) in receipts.iter().zip(brushes) {
            self.check_receipt(receipt, brush, what);
        }
        self.check_samples(what);
        self.check_bricks(what);
        self.check_fields(&news, what);
        self.check_mask(what);
        self.check_updates(&meshes, what);
        if self.is_meshed_again {
            self.check_meshes(what);
        }
    }

    fn material(&self, point: IVec3) -> MaterialId {
        match self.samples.get(&point) {
            Some(&(_, material)) if material != MaterialId::GROUND => material,
            _ => self.terrain.world().ground().material(point),
        }
    }

    fn distance(&self, point: IVec3) -> i32 {
        let stored = self.samples.get(&point);
        stored.map_or_else(|| self.terrain.world().ground().distance(point), |&(distance, _)| distance)
    }

    /// What an operation that sculpts makes of a sample, straight from what the crate's documentation says.
    fn sculpted(&self, brush: &Brush, point: IVec3, outside: i32) -> Option<i32> {
        let units = |voxels: f32| (voxels * 256.0).round_ties_even() as i32;
        let deepest = match brush.shape {
            Shape::Sphere { radius, .. } | Shape::Capsule { radius, .. } => units(radius),
            Shape::Cuboid { half, .. } => units(half.min_element()),
            _ => panic!("no such shape is sculpted here"),
        };
        let (strength, falloff) = (units(brush.blend.strength), units(brush.blend.falloff).min(deepest));
        let weight = match -outside {
            inside if inside < 0 || inside == 0 && falloff > 0 => return None,
            inside if inside >= falloff => strength,
            inside => {
                let t = inside * 256 / falloff;
                ((t * t * (768 - 2 * t) / 65_536) * strength + 128) / 256
            }
        };
        let (own, depth) = (self.distance(point), bevy_burrow::brush::DEPTH);
        let is_cut = |at: IVec3| self.samples.get(&at).is_some_and(|&(distance, _)| distance.abs() == depth);
        let away = |whole: i64| (whole.signum() * ((whole.abs() * i64::from(weight) + 255) / 256)) as i32;
        let to = |target: i32| own + away(i64::from(target) - i64::from(own));
        let faces = [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
        let faces: Vec<IVec3> = faces.map(|step| point + step).collect();
        if weight == 0 {
            return None;
        }
        if let Operation::Level { height } = brush.operation {
            return Some(to(point.y * 256 - units(height)));
        }
        // Of what was cut off, no more is known than that it is a voxel farther than what is not.
        let mut middle = own;
        if is_cut(point) {
            let sign = own.signum();
            let known = faces.iter().filter(|&&face| !is_cut(face));
            let nearest = known.map(|&face| self.distance(face) * sign).min()?;
            let others = faces.iter().filter(|&&face| is_cut(face)).map(|_| depth).min();
            middle = sign * (nearest.min(others.unwrap_or(i32::MAX)).max(0) + 256);
        }
        // 64 times the change that the average of 27 samples would be.
        let average = || {
            let mut sum = 0;
            let steps = (0..27).map(|i| IVec3::new(i % 3, i / 3 % 3, i / 9) - 1);
            for step in steps.filter(|&step| step != IVec3::ZERO) {
                let length = (256.0 * step.as_dvec3().length()).round() as i32;
                let weight = [8, 4, 2, 1][step.abs().element_sum() as usize];
                let is_known = |at: IVec3| !is_cut(at) || middle.abs() + length <= depth;
                if is_known(point + step) && is_known(point - step) {
                    sum += weight * (self.distance(point + step) - middle).clamp(-512, 512);
                }
            }
            sum
        };
        let attached = |after: i32| {
            let same = |at: &IVec3| (self.distance(*at) < 0) == (after < 0);
            if (own < 0) == (after < 0) || faces.iter().any(same) { after } else { -i32::from(own < 0) }
        };
        let shift = |voxels: f32| (units(voxels) * weight + 128) / 256;
        match brush.operation {
            Operation::Smooth => match average() * weight / (64 * 256) {
                0 => None,
                by => Some(attached(middle + by)),
            },
            Operation::Sharpen => match (average() * weight / (64 * 256)).clamp(-64, 64) {
                0 => None,
                by => {
                    let around = LatticeBox::point(point).grown(1);
                    let all: Vec<i32> = around.points().map(|at| self.distance(at)).collect();
                    let (low, high) = (all.iter().min()?, all.iter().max()?);
                    Some(attached((middle - by).clamp(*low, *high)))
                }
            },
            Operation::Raise { amount } => (shift(amount) != 0).then(|| middle - shift(amount)),
            Operation::Lower { amount } => (shift(amount) != 0).then(|| middle + shift(amount)),
            Operation::Terrace { step, base } => {
                let (step, base) = (units(step), units(base));
                let surface = point.y * 256 - middle;
                let tread = (surface - base).div_euclid(step) * step;
                let riser = ((surface - base - tread - step * 3 / 8) * 4).clamp(0, step);
                let by = away(i64::from(surface) - i64::from(base + tread + riser));
                (by != 0).then_some(middle + by)
            }
            _ => panic!("{brush:?}"),
        }
    }

    /// What a sample is made of that becomes solid.
    fn new_material(&self, brush: &Brush, point: IVec3) -> MaterialId {
        if let Some(material) = brush.blend.material {
            return material;
        }
        let column = (1..=64).map(|by| -by).chain(1..=64).map(|by| point + IVec3::Y * by);
        let beside = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].map(|step| point + step);
        let solid = column.chain(beside).find(|&at| self.distance(at) < 0);
        let stored = solid.and_then(|at| self.samples.get(&at));
        stored.map_or(MaterialId::GROUND, |&(_, material)| material)
    }

    /// Applies a brush to the naive samples.
    fn naive(&mut self, brush: &Brush, edit: &Edit) -> Effect {
        let (grid, ground) = (self.terrain.world().grid(), self.terrain.world().ground());
        let mut effect = Effect::default();
        let mut changes = Vec::new();
        let Some(reach) = edit.reach().intersection(grid.edit_bounds()) else { return effect };
        let evaluator: Evaluator = edit.evaluator();
        let mut row = vec![0; reach.size().x as usize];
        for (y, z) in
            (reach.min.y..=reach.max.y).flat_map(|y| (reach.min.z..=reach.max.z).map(move |z| (y, z)))
        {
            evaluator.row(IVec3::new(reach.min.x, y, z), &mut row);
            for (x, &outside) in (reach.min.x..).zip(&row) {
                let point = IVec3::new(x, y, z);
                let stored = self.samples.get(&point).copied();
                let before = stored.map_or_else(|| ground.distance(point), |(distance, _)| distance);
                let own = stored.map_or(MaterialId::GROUND, |(_, material)| material);
                let after = edit.operation().apply(before, outside);
                let number = after.clamp(-32767, 32767);
                match edit.operation() {
                    operation if operation.is_sculpting() => {
                        let after =
                            self.sculpted(brush, point, outside).map(|after| after.clamp(-32767, 32767));
                        let Some(after) = after.filter(|&after| after != before.clamp(-32767, 32767)) else {
                            continue;
                        };
                        let material = match (before < 0, after < 0) {
                            (true, false) => MaterialId::GROUND,
                            (false, true) => self.new_material(brush, point),
                            _ => own,
                        };
                        changes.push((point, before, (after, material)));
                    }
                    Operation::Paint { material } => {
                        if outside <= 0 && before < 0 && (stored.is_none() || own != material) {
                            changes.push((point, before, (number, material)));
                        }
                    }
                    operation => {
                        if outside <= BAND && after != before && stored.is_none_or(|(d, _)| d != number) {
                            let material = match (before < 0, after < 0) {
                                (true, false) => MaterialId::GROUND,
                                (false, true) => operation.material().unwrap_or(own),
                                _ => own,
                            };
                            changes.push((point, before, (number, material)));
                        }
                    }
                }
            }
        }
        for (point, before, (after, material)) in changes {
            let old = self.material(point);
            self.samples.insert(point, (after, material));
            let new = self.material(point);
            effect.chunks.insert(grid.chunk_of(point));
            LatticeBox::include(&mut effect.bounds, LatticeBox::point(point));
            match (before < 0, after < 0) {
                (true, false) => *effect.removed.entry(old).or_default() += 1,
                (false, true) => *effect.added.entry(new).or_default() += 1,
                (true, true) if old != new => *effect.painted.entry(new).or_default() += 1,
                _ => {}
            }
        }
        effect
    }

    fn check_receipt(&mut self, receipt: &Receipt, brush: &Brush, what: &str) {
        assert_eq!(receipt.tag, brush.tag, "{what}");
        let Ok(edit) = Edit::quantize(brush) else {
            assert!(matches!(receipt.outcome, Err(Rejection::Brush(_))), "{what}: {receipt:?}");
            return;
        };
        let expected = self.naive(brush, &edit);
        let Ok(applied) = &receipt.outcome else {
            assert_eq!(expected, Effect::default(), "{what}: {receipt:?}");
            return;
        };
        let tally = |tally: &bevy_burrow::volume::Tally| tally.iter().collect::<BTreeMap<_, _>>();
        let told = Effect {
            chunks: applied.chunks.iter().map(|part| part.chunk).collect(),
            bounds: applied.bounds,
            removed: tally(&applied.removed),
            added: tally(&applied.added),
            painted: tally(&applied.painted),
        };
        assert!(applied.chunks.is_sorted_by_key(|part| part.chunk), "{what}: chunks in order");
        assert!(told == expected, "{what}: {brush:?}\ntold {told:?}\nexpected {expected:?}");
    }

    /// Samples, solid and edited bits, hash.
    fn check_samples(&self, what: &str) {
        let world = self.terrain.world();
        let mut found = 0;
        let mut hash = 0u64;
        for (pos, brick) in world.bricks() {
            let mut is_any = false;
            for point in pos.samples().points() {
                let bit = (point.z & 7) * 8 + (point.x & 7);
                let layer = (point.y & 7) as usize;
                let is_set = |layers: &[u64; 8]| layers[layer] >> bit & 1 == 1;
                let stored = self.samples.get(&point);
                let ours = brick.sample(point).distance().map(|d| (d, brick.material(point)));
                assert_eq!(ours, stored.copied(), "{what}: sample at {point}");
                assert_eq!(is_set(brick.edited()), stored.is_some(), "{what}: edited bit at {point}");
                let distance = stored.map_or_else(|| world.ground().distance(point), |s| s.0);
                assert_eq!(is_set(brick.solid()), distance < 0, "{what}: solid bit at {point}");
                if let Some(&(distance, material)) = stored {
                    found += 1;
                    is_any = true;
                    let place = mix(u64::from(point.x as u32) | u64::from(point.z as u32) << 32);
                    let sample = u64::from(distance as u16) << 8 ^ u64::from(material.0);
                    hash = hash.wrapping_add(mix(place ^ u64::from(point.y as u32) << 32 ^ sample));
                }
            }
            assert!(is_any, "{what}: {pos:?} is stored without need");
        }
        assert_eq!(found, self.samples.len(), "{what}: edited samples");
        assert_eq!(world.hash(), mix(world.ground().hash() ^ mix(hash)), "{what}: hash");
    }

    /// Bricks all of whose samples are alike are one brick, and memory counts each once.
    fn check_bricks(&mut self, what: &str) {
        let world = self.terrain.world();
        let mut shared: HashMap<(i32, MaterialId), *const Brick> = HashMap::new();
        let (mut single, mut materials) = (0, 0);
        for (pos, brick) in world.bricks() {
            let of = |point| Some((brick.sample(point).distance()?, brick.material(point)));
            let first = of(pos.origin());
            match first.filter(|_| pos.samples().points().all(|point| of(point) == first)) {
                Some(kind) => {
                    let one = *shared.entry(kind).or_insert(brick);
                    assert!(std::ptr::eq(one, brick), "{what}: {pos:?} of {kind:?} is not shared");
                    self.kinds.insert(kind);
                }
                None => {
                    single += 1;
                    materials += brick.material_bytes();
                }
            }
        }
        let memory = world.memory();
        assert_eq!(memory.samples, Brick::BYTES * (single + self.kinds.len()), "{what}: memory of samples");
        assert!(memory.materials >= materials, "{what}: memory of materials");
    }

    /// Each edited sample lies in one field of its chunk, fields keep apart, and news tell how they came.
    fn check_fields(&mut self, news: &[(ChunkPos, FieldNews)], what: &str) {
        let world = self.terrain.world();
        for &(chunk, news) in news {
            match news {
                FieldNews::Created(id) => assert!(self.fields.insert((chunk, id)), "{what}: created twice"),
                FieldNews::Changed(id) => assert!(self.fields.contains(&(chunk, id)), "{what}: unknown"),
                FieldNews::Merged { gone, into } => {
                    assert!(self.fields.remove(&(chunk, gone)), "{what}: gone twice");
                    assert!(world.fields_of(chunk).is_some_and(|f| f.get(into).is_some()), "{what}: into");
                }
                FieldNews::Removed(id) => assert!(self.fields.remove(&(chunk, id)), "{what}: gone twice"),
            }
        }
        let all = world.fields().flat_map(|(chunk, fields)| fields.iter().map(move |f| (chunk, f.id)));
        assert_eq!(all.collect::<BTreeSet<_>>(), self.fields, "{what}: fields");
        for (chunk, fields) in world.fields() {
            for (i, a) in fields.iter().enumerate() {
                assert!(world.grid().chunk_samples(chunk).encloses(a.bounds), "{what}");
                assert!(fields.iter().skip(i + 1).all(|b| !a.bounds.meets(b.bounds)), "{what}: fields meet");
            }
        }
        for &point in self.samples.keys() {
            let fields = world.fields_of(world.grid().chunk_of(point)).expect("its chunk has a field");
            assert!(fields.iter().any(|field| field.bounds.contains(point)), "{what}: {point} in no field");
        }
    }

    /// Rule 2, cell by cell.
    fn check_mask(&self, what: &str) {
        let world = self.terrain.world();
        let mut edited: HashMap<Column, Vec<i32>> = HashMap::new();
        for point in self.samples.keys() {
            edited.entry(Column::of(*point)).or_default().push(point.y);
        }
        let (width, depth) = (world.grid().width(), world.grid().depth());
        let mut count = 0;
        for cell in (0..depth).flat_map(|z| (0..width).map(move |x| Column::new(x, z))) {
            let sheet = cell_sheet(world.ground(), cell);
            let is_in_sheet = |y: &i32| (sheet.start..=sheet.end).contains(y);
            let is_touched =
                |column| edited.get(column).is_some_and(|all: &Vec<i32>| all.iter().any(is_in_sheet));
            let expected = cell.corners().iter().any(is_touched);
            assert_eq!(world.mask().contains(cell), expected, "{what}: {cell:?}");
            count += usize::from(expected);
        }
        assert_eq!(world.mask().len(), count, "{what}: no cells beyond the rim");
    }

    /// Whoever only follows updates draws what the world draws.
    fn check_updates(&mut self, meshes: &MeshUpdates, what: &str) {
        let world = self.terrain.world();
        for (tile, update) in &meshes.tiles {
            self.tiles.insert(*tile, mesh_bits(&update.mesh()));
        }
        for (chunk, surface) in &meshes.chunks {
            let new = mesh_bits(surface.mesh());
            let old = if surface.is_empty() {
                self.chunks.remove(chunk)
            } else {
                self.chunks.insert(*chunk, new.clone())
            };
            assert!(old.is_none_or(|old| old != new), "{what}: {chunk:?} is sent without need");
        }
        assert_eq!(self.tiles.len(), world.grid().tiles().count(), "{what}");
        for (&tile, mesh) in &self.tiles {
            assert!(*mesh == mesh_bits(&world.tile_mesh(tile)), "{what}: {tile:?} is not up to date");
        }
        let drawn: BTreeSet<ChunkPos> = world.drawn_chunks().collect();
        assert_eq!(self.chunks.keys().copied().collect::<BTreeSet<_>>(), drawn, "{what}: drawn chunks");
        for (&chunk, mesh) in &self.chunks {
            assert!(*mesh == mesh_bits(&world.chunk_mesh(chunk)), "{what}: {chunk:?} is not up to date");
        }
    }

    /// Chunks hold what meshing all blocks now gives, and that is as by the book.
    fn check_meshes(&mut self, what: &str) {
        let world = self.terrain.world();
        let (view, grid) = (world.view(), world.grid());
        let blocks = blocks(world);
        let mut parts = Parts::default();
        self.mesher.mesh(&view, &blocks, &mut parts);
        let mut fresh: BTreeMap<ChunkPos, Vec<([i32; 3], &[Vertex], &[u16])>> = BTreeMap::new();
        for (block, vertices, indices) in parts.iter() {
            let cells = block.brick.samples().intersection(grid.chunk_cells(block.chunk)).expect("cells");
            let book = plain::mesh(&view, block.brick, cells, grid.origin(block.chunk));
            let ours = sorted(vertices, indices.iter().map(|&index| usize::from(index)));
            let theirs = sorted(&book.vertices, book.indices.iter().map(|&index| index as usize));
            assert!(ours == theirs, "{what}: {block:?} is not as by the book");
            assert_eq!(vertices.len(), book.vertices.len(), "{what}: {block:?}");
            if !indices.is_empty() {
                let key = [block.brick.0.y, block.brick.0.z, block.brick.0.x];
                fresh.entry(block.chunk).or_default().push((key, vertices, indices));
            }
        }
        assert_eq!(fresh.keys().copied().collect::<Vec<_>>(), {
            let mut drawn: Vec<ChunkPos> = world.drawn_chunks().collect();
            drawn.sort_unstable();
            drawn
        });
        for (chunk, mut parts) in fresh {
            parts.sort_unstable_by_key(|part| part.0);
            let mut mesh = SurfaceMesh::default();
            parts.iter().for_each(|(_, vertices, indices)| mesh.append(vertices, indices));
            let (ours, kept) = (mesh_bits(&mesh), mesh_bits(&world.chunk_mesh(chunk)));
            let differs = ours.0.iter().zip(&kept.0).find(|(a, b)| a != b);
            assert!(ours == kept, "{what}: {chunk:?} was not redrawn: {differs:?}");
        }
    }
}

/// Every block that could draw something: one brick further on all sides than any that is stored, and all sheets of the
/// mask.
fn blocks(world: &World) -> Vec<Block> {
    let (grid, mut bricks) = (world.grid(), BTreeSet::new());
    let end = IVec3::new(grid.width() - 1, i32::MAX, grid.depth() - 1);
    let inside = LatticeBox { min: IVec3::new(0, i32::MIN, 0), max: end };
    for (brick, _) in world.bricks() {
        bricks.extend((0..27).map(|i| (brick.0 + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1).to_array()));
    }
    for cell in world.mask().iter() {
        let sheet = cell_sheet(world.ground(), cell);
        bricks.extend((sheet.start >> 3..=(sheet.end - 1) >> 3).map(|y| [cell.x >> 3, y, cell.z >> 3]));
    }
    let mut bricks: Vec<[i32; 3]> = bricks.into_iter().collect();
    bricks.sort_unstable_by_key(|&[x, y, z]| (x, z, y));
    let of = |brick: [i32; 3]| {
        let brick = BrickPos(brick.into());
        let cells = brick.samples().intersection(inside);
        cells.into_iter().flat_map(move |c| grid.chunks_of(c).map(move |chunk| Block { brick, chunk }))
    };
    bricks.into_iter().flat_map(of).collect()
}

/// Any shape, any operation, rough or smooth, of about this radius, at about this place.
fn any_brush(rng: &mut Rng, place: Vec3, radius: f32) -> Brush {
    let mut vector = |scale: f32| Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 2.0 * scale;
    let (axis, jitter, turn) = (vector(2.0 * radius), vector(2.0), vector(3.0));
    let axis = if axis.length() < 0.5 { Vec3::Y } else { axis };
    let center = if rng.bool() { place.round() } else { place + jitter };
    let radius = if rng.bool() { radius.ceil() } else { radius };
    let shape = match rng.u32(0..7) {
        0 => Shape::cuboid(center, Vec3::new(radius, radius * 0.5 + 0.25, radius)),
        1 => Shape::turned_cuboid(
            center,
            Vec3::new(radius, radius * 0.4 + 0.25, radius),
            Quat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z),
        ),
        2 => Shape::cylinder(center, axis, radius),
        3 => Shape::cone(center, axis, radius),
        4 => Shape::capsule(center, center + axis, radius * 0.7 + 0.25),
        _ => Shape::sphere(center, radius),
    };
    let material = match rng.u32(0..4) {
        0 => MaterialId::GROUND,
        _ => MaterialId(rng.u8(0..4)),
    };
    let has_depth = matches!(shape, Shape::Sphere { .. } | Shape::Cuboid { .. } | Shape::Capsule { .. });
    let by = [0.1, 1.0, 3.5, 20.0][rng.usize(0..4)];
    let brush = match rng.u32(0..16) {
        0..=3 => Brush::paint(shape, material),
        4..=7 => Brush::dig(shape),
        8..=9 => Brush::add(shape, material),
        _ if !has_depth => Brush::add(shape, material),
        10 => Brush::smooth(shape, 1.0),
        11 => Brush::sharpen(shape, 0.7),
        12 => Brush::raise(shape, by),
        13 => Brush::lower(shape, by),
        14 => Brush::level(shape, place.y),
        _ => Brush::terrace(shape, by.max(1.0)),
    };
    let brush = match rng.u32(0..3) {
        0 if brush.operation.is_sculpting() => brush.with_falloff(rng.f32() * 3.0).with_material(material),
        1 => brush.with_strength(rng.f32()),
        _ => brush,
    };
    match rng.u32(0..4) {
        0 => brush.with_roughness(Roughness::new(rng.f32() * 8.0, 1.0 + rng.f32() * 9.0, rng.u32(..))),
        _ => brush,
    }
}

/// A place in or near the world, its rims and corners often; mostly near the surface.
fn any_place(rng: &mut Rng, ground: &Ground) -> Vec3 {
    let along = |rng: &mut Rng, end: i32| match rng.u32(0..6) {
        0 => 0.0,
        1 => end as f32,
        2 => end as f32 + 2.0,
        _ => rng.f32() * end as f32,
    };
    let (x, z) = (along(rng, ground.width()), along(rng, ground.depth()));
    let height = |dx: i32| ground.height(Column::new(x as i32 + dx, z as i32)) as f32 / ONE as f32;
    let (a, b) = (height(0), height(1));
    let y = match rng.u32(0..8) {
        0 => a - 30.0 * rng.f32(),
        1 => a + 20.0 * rng.f32(),
        2 => (a + b) * 0.5,
        _ => a + 4.0 * (rng.f32() - 0.5),
    };
    Vec3::new(x, y.clamp(-32_768.0, 32_768.0), z)
}

fn play(witness: &mut Witness, rng: &mut Rng, transactions: usize, most: f32, what: &str) {
    let mut held: Vec<(Arc<World>, u64, usize)> = Vec::new();
    for i in 0..transactions {
        let ground = witness.terrain.world();
        let count = if rng.u32(0..4) == 0 { rng.usize(2..6) } else { 1 };
        let brushes: Vec<Brush> = (0..count)
            .map(|tag| {
                let place = any_place(rng, ground.ground());
                let radius = 0.25 + rng.f32() * rng.f32() * most;
                any_brush(rng, place, radius).with_tag(tag as u64)
            })
            .collect();
        if rng.bool() {
            let world = witness.terrain.snapshot();
            let (hash, triangles) = fingerprint(&world);
            held.push((world, hash, triangles));
        }
        witness.apply(&brushes, &format!("{what}, transaction {i}"));
        for (world, hash, triangles) in &held {
            assert_eq!(fingerprint(world), (*hash, *triangles), "{what}: a snapshot changed");
        }
        if rng.bool() {
            held.clear();
        }
    }
}

fn fingerprint(world: &World) -> (u64, usize) {
    let drawn: usize = world.drawn_chunks().map(|chunk| world.chunk_mesh(chunk).indices.len()).sum();
    (world.hash() ^ world.mask().len() as u64, drawn)
}

/// Grounds of every kind, small enough to be looked at whole.
fn any_ground(rng: &mut Rng, seed: u64) -> (Ground, u32) {
    let chunk_size = [8, 9, 13, 16, 27, 100, 128][rng.usize(0..7)];
    let side = |rng: &mut Rng| match rng.u32(0..6) {
        0 => rng.u32(1..4),
        1 => chunk_size.min(48),
        2 => chunk_size.min(40) + 1,
        _ => rng.u32(8..34),
    };
    let (width, depth) = (side(rng), side(rng));
    let kind = seed % 6;
    let base = [0.0, 10.0, -7.5, 31.996][rng.usize(0..4)];
    let bumps: Vec<f64> = (0..(width + 1) * (depth + 1)).map(|_| rng.f64()).collect();
    let height = |x: i32, z: i32| {
        let bump = bumps[(z as u32 * (width + 1) + x as u32) as usize];
        match kind {
            0 => base,
            1 => base + bump * 3.0,
            2 => base + (bump * 20.0).round(),
            3 => base + 60.0 * bump,
            4 => base + if x > 5 { 40.0 } else { 0.0 },
            _ => base + 0.5 * f64::from(x) - 1.5 * f64::from(z),
        }
    };
    let ground = Ground::from_fn(width, depth, height).expect("finite heights");
    if !rng.bool() {
        return (ground, chunk_size);
    }
    let (low, high) = ground.height_range();
    let share = |part: f64| (f64::from(low) + f64::from(high - low) * part) / 256.0;
    let rule = MaterialRule {
        overlay: MaterialId(1),
        height: (share(0.3), share(0.8)),
        height_fade: 3.0,
        ..Default::default()
    };
    let control = MaterialControl::Rules { base: MaterialId(2), rules: vec![rule] };
    (ground.with_materials(&control).expect("valid rules"), chunk_size)
}

#[test]
fn after_every_commit_all_is_as_if_made_from_scratch() {
    for seed in 0..worlds::world_count(30) {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = any_ground(&mut rng, seed);
        let what = format!("world {seed}, {}x{} in chunks of {chunk_size}", ground.width(), ground.depth());
        let mut witness = Witness::new(ground, chunk_size);
        play(&mut witness, &mut rng, 10, 7.0, &what);
    }
}

#[test]
fn a_normal_that_only_changes_the_sign_of_its_zeros_is_redrawn() {
    // The tile's normal of flat ground and the gradient of its samples are both straight up, by other bits once.
    let ground = || Ground::flat(32, 32, 10.5).expect("valid ground");
    let paint = |from: f32, to: f32| {
        let (middle, half) = (Vec3::new((from + to) * 0.5, 9.0, 4.0), Vec3::new((to - from) * 0.5, 2.0, 2.0));
        Brush::paint(Shape::cuboid(middle, half), MaterialId::GROUND)
    };
    // Column 8, on the face of two bricks, is on the mask's border only until the second brush.
    let (first, second) = (paint(2.0, 7.0), paint(9.0, 14.0));
    let (mut once, mut twice) = (Witness::new(ground(), 32), Witness::new(ground(), 32));
    once.apply(&[first.clone(), second.clone()], "at once");
    twice.apply(&[first], "first");
    twice.apply(&[second], "second");
    assert!(once.chunks == twice.chunks, "batching shows");
}

#[test]
fn at_the_ends_of_the_lattice_all_is_as_if_made_from_scratch() {
    for (i, base) in [32_768.0, 32_767.5, 32_761.0, -32_768.0, -32_767.25, -32_760.0].into_iter().enumerate()
    {
        let mut rng = Rng::with_seed(i as u64);
        let bumps: Vec<f64> = (0..13 * 12).map(|_| rng.f64() * 6.0).collect();
        let height = |x: i32, z: i32| (base + bumps[(z * 13 + x) as usize] - 3.0).clamp(-32_768.0, 32_768.0);
        let ground = Ground::from_fn(12, 11, height).expect("heights in range");
        let mut witness = Witness::new(ground, [8, 13, 128][i % 3]);
        play(&mut witness, &mut rng, 8, 7.0, &format!("ground at {base}"));
    }
}

#[test]
fn on_a_cliff_of_sixty_thousand_voxels_all_is_as_if_made_from_scratch() {
    for seed in 0..2 {
        let mut rng = Rng::with_seed(seed);
        let height = |x: i32, z: i32| if x + z > 9 { 30_000.5 } else { -30_000.25 - f64::from(z) };
        let mut witness = Witness::new(Ground::from_fn(12, 9, height).expect("heights in range"), 100);
        witness.is_meshed_again = false;
        for i in 0..3 {
            let y = [30_000.0, -30_000.0, 0.0, 130.0, 29_000.0][rng.usize(0..5)];
            let place = Vec3::new(6.0 + rng.f32() * 3.0, y, rng.f32() * 5.0);
            let brush = any_brush(&mut rng, place, 3.0);
            witness.apply(&[brush], &format!("cliff {seed}, transaction {i}"));
        }
        witness.check_meshes(&format!("cliff {seed}"));
    }
}

#[test]
fn large_brushes_over_small_ones_are_as_if_made_from_scratch() {
    let mut rng = Rng::with_seed(7);
    let (ground, _) = any_ground(&mut rng, 2);
    let ground = Ground::from_fn(70, 60, |x, z| {
        f64::from(ground.height(Column::new(x % ground.width(), z % ground.depth()))) / 256.0
    });
    let mut witness = Witness::new(ground.expect("finite heights"), 27);
    play(&mut witness, &mut rng, 4, 6.0, "small");
    for (i, brush) in [
        Brush::dig(Shape::sphere(Vec3::new(35.0, 0.0, 30.0), 28.0)),
        Brush::add(Shape::cuboid(Vec3::new(30.0, 10.0, 30.0), Vec3::new(500.0, 9.0, 500.0)), MaterialId(3)),
        Brush::paint(Shape::cuboid(Vec3::new(30.0, 0.0, 30.0), Vec3::splat(24.0)), MaterialId(2)),
        Brush::paint(Shape::cuboid(Vec3::new(30.0, 0.0, 30.0), Vec3::splat(23.0)), MaterialId::GROUND),
        Brush::dig(Shape::cylinder(Vec3::new(35.0, -25.0, 30.0), Vec3::Y * 60.0, 21.0))
            .with_roughness(Roughness::new(8.0, 5.0, 1)),
    ]
    .into_iter()
    .enumerate()
    {
        witness.apply(&[brush], &format!("large brush {i}"));
    }
    play(&mut witness, &mut rng, 4, 6.0, "small again");
}

#[test]
fn batches_and_threads_do_not_show() {
    let pools = [1, 3].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    for seed in 0..worlds::world_count(30) / 3 {
        let run = |pool: &rayon::ThreadPool, batch: usize| {
            let mut rng = Rng::with_seed(seed);
            let (ground, chunk_size) = any_ground(&mut rng, seed);
            let brushes: Vec<Brush> = (0..12)
                .map(|i| {
                    let place = any_place(&mut rng, &ground);
                    any_brush(&mut rng, place, if i % 4 == 0 { 9.0 } else { 3.0 })
                })
                .collect();
            let settings = TerrainSettings { chunk_size, ..Default::default() };
            let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
            pool.install(|| brushes.chunks(batch).for_each(|brushes| drop(terrain.apply(brushes))));
            let world = terrain.world();
            let meshes: Vec<MeshBits> = world.drawn().map(|(_, mesh)| mesh_bits(&mesh)).collect();
            (world.hash(), meshes)
        };
        let first = run(&pools[0], 1);
        for (pool, batch) in [(0, 12), (1, 1), (1, 5)] {
            let other = run(&pools[pool], batch);
            assert_eq!(first.0, other.0, "world {seed}: hash of batches of {batch}");
            assert!(first.1 == other.1, "world {seed}: meshes of batches of {batch}");
        }
    }
}

#[test]
fn memory_is_what_the_world_gives_back() {
    for seed in 0..12 {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = worlds::random_ground(&mut rng, seed);
        let brushes: Vec<Brush> = (0..10).map(|_| worlds::random_brush(&mut rng, &ground)).collect();
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        brushes.iter().for_each(|brush| drop(terrain.apply([brush])));
        let told = terrain.memory();
        let blocks = told.samples / Brick::BYTES + terrain.world().drawn().count() + 2;
        let given_back = allocation_counter::measure(|| drop(terrain)).bytes_current.unsigned_abs() as usize;
        // Two counts of references stand before whatever is shared.
        let least = told.total();
        assert!((least..=least + blocks * 16 + 1024).contains(&given_back), "{given_back}, not {told:?}");
    }
}

#[test]
fn tiles_and_chunks_that_the_world_does_not_have_are_empty() {
    let terrain = Terrain::new(Ground::flat(40, 33, 0.0).expect("valid"), &TerrainSettings::default());
    let world = terrain.expect("valid settings");
    for (x, z) in [(2, 0), (0, 2), (-1, 0), (0, -3), (5, 5), (i32::MAX, i32::MIN), (i32::MIN, 0)] {
        assert_eq!(world.world().tile_mesh(TilePos { x, z }), SurfaceMesh::default());
        assert_eq!(world.world().chunk_mesh(ChunkPos { x, y: 0, z }), SurfaceMesh::default());
    }
}
