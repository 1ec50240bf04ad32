//! Patches: what differs between two states of a world.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::state::World;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, RegionPos};
use crate::volume::{Brick, Fields, NO_FIELDS};

/// A brick by its position; `None` is a pristine one.
pub(crate) type ChangedBrick = (BrickPos, Option<Arc<Brick>>);

/// What differs between two states of a world: applied to one, it gives the other.
#[derive(Clone, Debug, Default)]
pub struct Patch {
    /// Bricks in order, each position once; `None` is a pristine one.
    pub bricks: Vec<(BrickPos, Option<Arc<Brick>>)>,
    /// All fields of each chunk whose fields change, by chunk.
    pub fields: Vec<(ChunkPos, Fields)>,
    /// The greatest name that any field has had.
    pub next_field: u64,
}

impl PartialEq for Patch {
    /// Equal samples at equal positions, and equal fields.
    fn eq(&self, other: &Self) -> bool {
        let is_same = |(own, other): (&ChangedBrick, &ChangedBrick)| {
            own.0 == other.0 && Brick::is_same(own.1.as_ref(), other.1.as_ref())
        };
        (self.next_field, &self.fields) == (other.next_field, &other.fields)
            && self.bricks.len() == other.bricks.len()
            && self.bricks.iter().zip(&other.bricks).all(is_same)
    }
}

/// Bricks and fields by position: those of a world, of a region, or of an [`Overlay`].
pub(crate) trait State {
    /// A stored brick; `None` where it is pristine.
    fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>>;
    /// The fields of a chunk.
    fn fields(&self, chunk: ChunkPos) -> &Fields;
}

impl State for World {
    fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>> {
        self.bricks.get(&pos)
    }

    fn fields(&self, chunk: ChunkPos) -> &Fields {
        self.fields.get(&chunk).unwrap_or(&NO_FIELDS)
    }
}

/// Positions at which states are compared.
#[derive(Clone, Debug, Default)]
pub(crate) struct Positions {
    /// Positions of bricks.
    pub bricks: BTreeSet<BrickPos>,
    /// Chunks whose fields are compared.
    pub chunks: BTreeSet<ChunkPos>,
}

impl Positions {
    /// All positions at which a world holds something.
    pub fn of(world: &World) -> Self {
        Self {
            bricks: world.bricks.keys().copied().collect(),
            chunks: world.fields.keys().copied().collect(),
        }
    }

    /// These positions and others.
    pub fn and(mut self, mut other: Self) -> Self {
        self.bricks.append(&mut other.bricks);
        self.chunks.append(&mut other.chunks);
        self
    }
}

impl Patch {
    /// Returns `true` if it holds neither bricks nor fields.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty() && self.fields.is_empty()
    }

    /// The positions at which it holds something.
    pub(crate) fn positions(&self) -> Positions {
        Positions {
            bricks: self.bricks.iter().map(|(pos, _)| *pos).collect(),
            chunks: self.fields.iter().map(|(chunk, _)| *chunk).collect(),
        }
    }

    /// What leads from one state to another, as far as they differ at these positions.
    pub(crate) fn between(from: &impl State, to: &impl State, positions: Positions, next_field: u64) -> Self {
        let bricks = positions.bricks.into_iter().filter_map(|pos| {
            let new = to.brick(pos);
            (!Brick::is_same(from.brick(pos), new)).then(|| (pos, new.cloned()))
        });
        let fields = positions.chunks.into_iter().filter_map(|chunk| {
            let new = to.fields(chunk);
            (from.fields(chunk) != new).then(|| (chunk, new.clone()))
        });
        Self { bricks: bricks.collect(), fields: fields.collect(), next_field }
    }

    /// Adds a patch that is applied after this one.
    pub(crate) fn then(&mut self, mut later: Self) {
        later.fill_in(std::mem::take(self));
        *self = later;
    }

    /// Adds what another patch holds at positions that this one lacks; returns the rest of the other one.
    pub(crate) fn fill_in(&mut self, other: Self) -> Self {
        self.next_field = self.next_field.max(other.next_field);
        Self {
            bricks: fill_in(&mut self.bricks, other.bricks),
            fields: fill_in(&mut self.fields, other.fields),
            next_field: other.next_field,
        }
    }

    /// The patch that undoes this one on a state.
    pub(crate) fn inverse(&self, of: &impl State) -> Self {
        Self {
            bricks: self.bricks.iter().map(|(pos, _)| (*pos, of.brick(*pos).cloned())).collect(),
            fields: self.fields.iter().map(|(chunk, _)| (*chunk, of.fields(*chunk).clone())).collect(),
            next_field: self.next_field,
        }
    }

    /// The parts of it in each region. Fields belong to the region of the lowest corner of their chunk.
    pub(crate) fn by_region(&self, grid: ChunkGrid) -> BTreeMap<RegionPos, Self> {
        let mut regions = BTreeMap::<RegionPos, Self>::new();
        let new = || Self { next_field: self.next_field, ..Self::default() };
        for (pos, brick) in &self.bricks {
            let region = regions.entry(RegionPos::of(*pos)).or_insert_with(new);
            region.bricks.push((*pos, brick.clone()));
        }
        for (chunk, fields) in &self.fields {
            let at = RegionPos::of(BrickPos::of(grid.origin(*chunk)));
            regions.entry(at).or_insert_with(new).fields.push((*chunk, fields.clone()));
        }
        regions
    }

    /// Swaps these bricks and fields with those of a world; a second swap restores it. Names of fields are never
    /// reused.
    pub(crate) fn swap(&mut self, world: &mut World) {
        for (pos, brick) in &mut self.bricks {
            let (key, y) = (pos.stack(), pos.0.y);
            let is_there = brick.is_some();
            let before = match brick.take() {
                Some(brick) => world.bricks.insert(*pos, brick),
                None => world.bricks.remove(pos),
            };
            if is_there != before.is_some() {
                let stack = world.stacks.entry(key).or_default();
                match (stack.binary_search(&y), is_there) {
                    (Err(at), true) => stack.insert(at, y),
                    (Ok(at), false) => drop(stack.remove(at)),
                    _ => {}
                }
                if stack.is_empty() {
                    world.stacks.remove(&key);
                    world.edited_nodes.remove(world.grid, key);
                } else if is_there && stack.len() == 1 {
                    world.edited_nodes.add(world.grid, key);
                }
            }
            *brick = before;
        }
        for (chunk, fields) in &mut self.fields {
            let now = std::mem::take(fields);
            let before =
                if now.is_empty() { world.fields.remove(chunk) } else { world.fields.insert(*chunk, now) };
            *fields = before.unwrap_or_default();
        }
        world.next_field = world.next_field.max(self.next_field);
    }

    /// Bytes of the lists; bricks and fields come on top.
    pub(super) fn list_bytes(&self) -> usize {
        size_of_val(&self.bricks[..]) + size_of_val(&self.fields[..])
    }

    /// Bytes of the fields in its list.
    pub(super) fn field_bytes(&self) -> usize {
        self.fields.iter().map(|(_, fields)| fields.bytes()).sum()
    }
}

/// Adds to a list that is sorted by its keys what another one has under other keys; returns the rest.
fn fill_in<K: Copy + Ord, V>(list: &mut Vec<(K, V)>, other: Vec<(K, V)>) -> Vec<(K, V)> {
    let is_new = |(key, _): &(K, V)| list.binary_search_by_key(key, |own| own.0).is_err();
    let (mut new, left): (Vec<_>, Vec<_>) = other.into_iter().partition(is_new);
    list.append(&mut new);
    list.sort_by_key(|own| own.0);
    left
}

/// Parts of a state by position, which can lie over another state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Overlay {
    /// Bricks; `None` is a pristine one.
    pub bricks: BTreeMap<BrickPos, Option<Arc<Brick>>>,
    /// All fields of a chunk.
    pub fields: BTreeMap<ChunkPos, Fields>,
}

impl Overlay {
    /// Returns `true` if it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty() && self.fields.is_empty()
    }

    /// Takes the content of a patch, in place of its own.
    pub fn lay(&mut self, patch: &Patch) {
        self.bricks.extend(patch.bricks.iter().cloned());
        self.fields.extend(patch.fields.iter().cloned());
    }

    /// Takes the content of a patch where it has none.
    pub fn keep(&mut self, patch: Patch) {
        for (pos, brick) in patch.bricks {
            self.bricks.entry(pos).or_insert(brick);
        }
        for (chunk, fields) in patch.fields {
            self.fields.entry(chunk).or_insert(fields);
        }
    }

    /// Removes entries that equal a state's.
    pub fn forget(&mut self, state: &impl State, at: &Positions) {
        for pos in &at.bricks {
            if self.bricks.get(pos).is_some_and(|own| Brick::is_same(own.as_ref(), state.brick(*pos))) {
                self.bricks.remove(pos);
            }
        }
        for chunk in &at.chunks {
            if self.fields.get(chunk).is_some_and(|own| own == state.fields(*chunk)) {
                self.fields.remove(chunk);
            }
        }
    }

    /// The positions at which it holds something.
    pub fn positions(&self) -> Positions {
        Positions {
            bricks: self.bricks.keys().copied().collect(),
            chunks: self.fields.keys().copied().collect(),
        }
    }

    /// This over another state.
    pub fn over<'a, S: State>(&'a self, below: &'a S) -> Over<'a, S> {
        Over { above: self, below }
    }

    /// The overlay's content as a patch.
    pub fn patch(&self, next_field: u64) -> Patch {
        let bricks = self.bricks.iter().map(|(pos, brick)| (*pos, brick.clone()));
        let fields = self.fields.iter().map(|(chunk, fields)| (*chunk, fields.clone()));
        Patch { bricks: bricks.collect(), fields: fields.collect(), next_field }
    }
}

/// An overlay, and the state below it.
#[derive(Clone, Copy)]
pub(crate) struct Over<'a, S> {
    above: &'a Overlay,
    below: &'a S,
}

impl<S: State> State for Over<'_, S> {
    fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>> {
        self.above.bricks.get(&pos).map_or_else(|| self.below.brick(pos), Option::as_ref)
    }

    fn fields(&self, chunk: ChunkPos) -> &Fields {
        self.above.fields.get(&chunk).unwrap_or_else(|| self.below.fields(chunk))
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{Terrain, TerrainSettings};

    /// A world, and worlds that each follow from the one before by a few edits, steps back and resets.
    fn states(seed: u64, count: usize) -> Vec<World> {
        let mut rng = Rng::with_seed(seed);
        let settings = TerrainSettings { chunk_size: 16, ..TerrainSettings::default() };
        let ground = Ground::flat(64, 64, 8.0).expect("valid ground");
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        let mut states = vec![World::clone(&terrain.snapshot())];
        while states.len() < count {
            for _ in 0..rng.usize(1..4) {
                let at = Vec3::new(rng.f32() * 60.0, 4.0 + rng.f32() * 10.0, rng.f32() * 60.0);
                let shape = Shape::sphere(at, 1.0 + rng.f32() * 6.0);
                match rng.u8(0..5) {
                    0 => drop(terrain.undo()),
                    1 => drop(terrain.apply([Brush::reset(shape)])),
                    2 => drop(terrain.apply([Brush::add(shape, MaterialId(3))])),
                    _ => drop(terrain.apply([Brush::dig(shape)])),
                }
            }
            states.push(World::clone(&terrain.snapshot()));
        }
        states
    }

    fn between(from: &World, to: &World) -> Patch {
        Patch::between(from, to, Positions::of(from).and(Positions::of(to)), to.next_field)
    }

    /// Whether two worlds hold the same bricks and fields, and the same bricks in their stacks.
    fn is_same(a: &World, b: &World) -> bool {
        let positions = |world: &World| {
            let mut own: Vec<_> = world.stacks.iter().map(|(key, ys)| (*key, ys.clone())).collect();
            own.sort_unstable();
            own
        };
        between(a, b).is_empty() && positions(a) == positions(b)
    }

    fn applied(world: &World, patch: &Patch) -> World {
        let mut world = world.clone();
        patch.clone().swap(&mut world);
        world
    }

    fn is_equal(a: &Patch, b: &Patch) -> bool {
        let same = |((a, x), (b, y)): (&ChangedBrick, &ChangedBrick)| {
            a == b && Brick::is_same(x.as_ref(), y.as_ref()) && x.is_some() == y.is_some()
        };
        a.bricks.len() == b.bricks.len()
            && a.bricks.iter().zip(&b.bricks).all(same)
            && (&a.fields, a.next_field) == (&b.fields, b.next_field)
    }

    #[test]
    fn what_is_between_two_states_leads_from_one_to_the_other_and_back() {
        for seed in 0..20 {
            let states = states(seed, 4);
            for (from, to) in states.iter().zip(&states[1..]).chain([(&states[3], &states[0])]) {
                let mut patch = between(from, to);
                assert!(patch.bricks.is_sorted_by(|a, b| a.0 < b.0));
                let inverse = patch.inverse(from);
                let mut world = from.clone();
                patch.swap(&mut world);
                assert!(is_same(&world, to));
                assert!(is_equal(&patch, &inverse), "swapping leaves the inverse");
                patch.swap(&mut world);
                assert!(is_same(&world, from));
                assert!(is_same(&applied(to, &inverse), from));
            }
        }
    }

    #[test]
    fn patches_one_after_the_other_are_one_and_associative() {
        for seed in 20..40 {
            let states = states(seed, 4);
            let [a, b, c] = [0, 1, 2].map(|at: usize| between(&states[at], &states[at + 1]));
            let joined = |first: &Patch, second: &Patch| {
                let mut first = first.clone();
                first.then(second.clone());
                first
            };
            let (left, right) = (joined(&joined(&a, &b), &c), joined(&a, &joined(&b, &c)));
            assert!(is_equal(&left, &right));
            assert!(is_same(&applied(&states[0], &left), &states[3]));
            // And back, in the opposite order.
            let back =
                joined(&c.inverse(&states[2]), &joined(&b.inverse(&states[1]), &a.inverse(&states[0])));
            assert!(is_same(&applied(&states[3], &back), &states[0]));
        }
    }

    #[test]
    fn regions_of_a_patch_are_all_of_it() {
        let states = states(50, 6);
        let (grid, patch) = (states[0].grid, between(&states[0], &states[5]));
        let mut joined = Patch::default();
        for (region, part) in patch.by_region(grid) {
            assert!(part.bricks.iter().all(|(pos, _)| RegionPos::of(*pos) == region));
            joined.then(part);
        }
        assert!(is_equal(&joined, &patch));
    }

    #[test]
    fn an_overlay_is_the_state_after_its_patches() {
        for seed in 60..70 {
            let states = states(seed, 4);
            let (mut overlay, mut before) = (Overlay::default(), Overlay::default());
            for (from, to) in states.iter().zip(&states[1..]) {
                let patch = between(from, to);
                before.keep(patch.inverse(from));
                overlay.lay(&patch);
            }
            let positions = Positions::of(&states[3]).and(overlay.positions());
            let none = Patch::between(&overlay.over(&states[0]), &states[3], positions.clone(), 0);
            assert!(none.is_empty());
            let none = Patch::between(&before.over(&states[3]), &states[0], positions, 0);
            assert!(none.is_empty());
            before.keep(overlay.patch(0));
            assert_eq!(before.bricks.len(), overlay.bricks.len());
            overlay.forget(&states[3], &overlay.positions());
            assert!(overlay.is_empty());
        }
    }
}
