//! Compares a replica with a world that applies the log entry by entry, with the pending edits on top.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use fastrand::Rng;
use glam::{Vec2, Vec3};

use super::*;
use crate::brush::{Brush, BrushPath, Corridor, Shape, Stamp};
use crate::ground::{GreyImage, MaterialId};
use crate::net::ClientId;
use crate::terrain::{LooseSettings, Order, OrderKind};
use crate::volume::DiggingRules;

const SIDE: u32 = 72;
const OWN: ClientId = ClientId(1);

/// Where edits are: the least and the greatest x, and y.
type EditPlaces = [(f32, f32); 2];

/// Heights around the surface.
const SURFACE: (f32, f32) = (12.0, 26.0);

/// Places of edits that meet each other.
const NEAR: EditPlaces = [(8.0, 48.0), SURFACE];

fn ground() -> Arc<Ground> {
    let height = |x: i32, z: i32| 20.0 + 3.0 * (f64::from(x) * 0.2).sin() + (f64::from(z) * 0.3).cos();
    Arc::new(Ground::from_fn(SIDE, SIDE, height).expect("valid heights"))
}

fn settings() -> TerrainSettings {
    TerrainSettings { chunk_size: 16, ..TerrainSettings::default() }
}

fn terrain(ground: &Arc<Ground>) -> Terrain {
    let mut terrain = Terrain::new(Arc::clone(ground), &settings()).expect("valid settings");
    never_shown(&mut terrain);
    terrain
}

/// An edit of any operation, at these places.
fn edit(rng: &mut Rng, image: &Arc<GreyImage>, [x, y]: EditPlaces) -> Edit {
    let mut within = |(low, high): (f32, f32)| low + rng.f32() * (high - low);
    let at = Vec3::new(within(x), within(y), within((8.0, 48.0)));
    let size = within((1.0, 6.0));
    let shape = match rng.u32(0..3) {
        0 => Shape::cuboid(at, Vec3::new(size, 1.5, size)),
        _ => Shape::sphere(at, size),
    };
    let material = MaterialId(rng.u8(0..4));
    let end = at + Vec3::new(6.0, rng.f32() * 4.0 - 2.0, 5.0);
    let path = BrushPath::polyline([(at, 1.5), (end, 2.0)]);
    let brush = match rng.u32(0..18) {
        0 | 1 => Brush::add(shape, material),
        2 => Brush::paint(shape, material),
        3 => Brush::smooth(shape, 0.7),
        4 => Brush::sharpen(shape, 0.7),
        5 => Brush::flatten(shape, at, Vec3::new(0.1, 1.0, 0.2)),
        6 => Brush::level(shape, at.y),
        7 => Brush::raise(shape, 1.5),
        8 => Brush::lower(shape, 1.5),
        9 => Brush::terrace(shape, 3.0),
        10 => Brush::stamp(shape, Stamp::new(Arc::clone(image), at, Vec2::splat(8.0), 3.0)),
        11 => Brush::fill(shape, 1.0),
        12 => Brush::fill(path, 1.0).with_material(material),
        13 => Brush::carve(shape, 2.0),
        14 => Brush::road(Corridor::new(path, 4.0, 4.0), 2.0),
        15 => Brush::reset(shape),
        _ => Brush::dig(shape),
    };
    Edit::quantize(&brush.with_power(rng.u8(100..=255))).expect("a valid brush")
}

/// An entry that is not a client's edit.
fn turn(rng: &mut Rng, reference: &Terrain) -> Entry {
    match rng.u32(0..4) {
        0 => {
            let rules = DiggingRules::default().with_unbreakable(MaterialId(rng.u8(0..4)));
            let rules = rules.with_hardness(MaterialId(2), 180);
            Entry::of_server(Order::Rules(rng.bool().then(|| Arc::new(rules))))
        }
        1 => {
            let loose = LooseSettings { largest: 2000, crumbs: rng.u32(0..40), debris: rng.u32(0..400) };
            Entry::of_server(Order::Loose(rng.bool().then_some(loose)))
        }
        2 => Entry::HashCheck,
        _ => {
            let world = reference.world();
            let mut bricks: Vec<BrickPos> = world.bricks().map(|(pos, _)| pos).collect();
            rng.shuffle(&mut bricks);
            bricks.truncate(4);
            bricks.sort_unstable();
            let fields = world.fields().take(1).map(|(chunk, _)| (chunk, Fields::default())).collect();
            let bricks = bricks.into_iter().map(|pos| (pos, None)).collect();
            let change = Patch { bricks, fields, next_field: world.next_field() };
            Entry::of_server(Order::parts(change, None))
        }
    }
}

fn obey(terrain: &mut Terrain, entry: &Entry) {
    let receipts = terrain.apply(entry.order());
    assert!(receipts.iter().all(|receipt| receipt.kind == OrderKind::Edit || receipt.outcome.is_ok()));
}

fn own_number(entry: &Entry) -> Option<u64> {
    entry.edit().and_then(|_| entry.number_of(Some(OWN)))
}

fn fields(world: &World) -> BTreeMap<ChunkPos, Fields> {
    let fields = world.fields().filter(|(_, fields)| !fields.is_empty());
    fields.map(|(chunk, fields)| (chunk, fields.clone())).collect()
}

struct Play {
    replica: Replica,
    /// Only put.
    shown: Terrain,
    /// Obeys the log one entry at a time.
    reference: Terrain,
    /// How much of the log it has obeyed.
    obeyed: usize,
    order: Vec<Entry>,
    /// How much of the log the replica has.
    given: usize,
    /// Own edits that the server has not answered.
    sent: VecDeque<(u64, Edit)>,
    /// Updates where nothing was to be done.
    quiet: usize,
    /// Updates where others had changed what no pending edit read.
    apart: usize,
    /// Updates that worked out the last pending edits alone.
    alone: usize,
    shared: usize,
}

impl Play {
    fn new() -> Self {
        let ground = ground();
        let replica = Replica::new(Arc::clone(&ground), &settings()).expect("valid settings");
        let (shown, reference) = (terrain(&ground), terrain(&ground));
        let (order, sent) = Default::default();
        Self {
            replica,
            shown,
            reference,
            obeyed: 0,
            order,
            given: 0,
            sent,
            quiet: 0,
            apart: 0,
            alone: 0,
            shared: 0,
        }
    }

    /// Gives the replica some entries, and checks whether it has to do anything.
    fn give(&mut self, count: usize) {
        let was_outdated =
            self.replica.is_outdated || self.replica.changes_are_independent || self.replica.appended > 0;
        let batch = &self.order[self.given..self.order.len().min(self.given + count)];
        let mut pending: VecDeque<u64> = self.replica.pending().map(|(own, _)| own).collect();
        let is_echo = |entry: &Entry| match own_number(entry) {
            Some(own) => pending.pop_front() == Some(own),
            None => matches!(entry, Entry::HashCheck),
        };
        let is_quiet = batch.iter().all(is_echo);
        let applied = self.replica.apply(batch, own_number);
        self.given += batch.len();
        let edits = batch.iter().filter(|entry| entry.edit().is_some()).count();
        let parts = batch.iter().filter(|entry| entry.parts().is_some()).count();
        assert_eq!(applied.receipts.len(), edits + parts);
        assert!(!applied.failed_locally);
        if is_quiet && !was_outdated && applied.receipts.iter().all(|receipt| receipt.outcome.is_ok()) {
            let (change, receipts) = self.replica.update();
            assert!(change.is_none() && receipts.is_none(), "what was predicted came");
            self.quiet += usize::from(edits > 0);
        }
    }

    fn check(&mut self) {
        let (was_outdated, has_pending) = (self.replica.is_outdated, self.replica.pending().count() > 0);
        self.alone += usize::from(self.replica.can_append());
        if let (Some(order), _) = self.replica.update() {
            self.apart += usize::from(!was_outdated && has_pending);
            self.shown.apply_one(order).outcome.expect("it fits");
        }
        while self.obeyed < self.given {
            obey(&mut self.reference, &self.order[self.obeyed]);
            self.obeyed += 1;
        }
        let pending: Vec<Edit> = self.replica.pending().map(|(_, edit)| edit.clone()).collect();
        let draft = self.reference.draft(&pending);
        assert_eq!(self.replica.world().hash(), self.reference.world().hash(), "of what is confirmed");
        assert_eq!(fields(self.replica.world()), fields(self.reference.world()), "of what is confirmed");
        assert_eq!(self.replica.shown_hash(), draft.hash);
        assert_eq!(self.shown.world().hash(), draft.hash, "of what is shown");
        let mut expected = fields(self.reference.world());
        expected.extend(draft.change.fields);
        expected.retain(|_, fields| !fields.is_empty());
        assert_eq!(fields(self.shown.world()), expected, "of what is shown");
        self.check_sharing();
    }

    fn check_sharing(&mut self) {
        let (confirmed, shown) = (self.replica.world(), self.shown.world());
        for (pos, _) in confirmed.bricks() {
            let (own, other) = (confirmed.brick(pos), shown.brick(pos));
            let Some((own, other)) = own.zip(other) else { continue };
            // Each world has one brick of each uniform kind.
            if own.uniform().is_none() && Brick::is_same(Some(own), Some(other)) {
                assert!(Arc::ptr_eq(own, other), "{pos:?} is held twice");
                self.shared += 1;
            }
        }
    }
}

#[test]
fn what_is_shown_is_the_order_with_the_pending_edits() {
    let rounds = std::env::var("BURROW_ROUNDS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(12);
    let image =
        Arc::new(GreyImage::from_samples(4, 4, (0..16).map(|at| at * 4000).collect()).expect("an image"));
    let (mut quiet, mut apart, mut alone, mut shared) = (0, 0, 0, 0);
    for round in 0..rounds {
        let mut rng = Rng::with_seed(round);
        let mut play = Play::new();
        // In every other round the others are mostly too far away to meet what own edits read: to the side of them, or
        // below.
        let (near, others) = match round % 4 {
            1 => ([(8.0, 22.0), SURFACE], [(34.0, 66.0), SURFACE]),
            3 => ([(8.0, 48.0), (34.0, 90.0)], NEAR),
            _ => (NEAR, NEAR),
        };
        for own in 1..=40 {
            if rng.u32(0..3) > 0 {
                let edit = edit(&mut rng, &image, near);
                play.replica.predict(own, edit.clone());
                play.sent.push_back((own, edit));
            }
            if rng.u32(0..3) == 0 {
                play.check();
            }
            // In some rounds others dig much, in some nobody does.
            if rng.u64(0..6) < round % 4 {
                let edit = edit(&mut rng, &image, others);
                play.order.push(Entry::of(ClientId(2), own, Order::Edit(edit)));
            }
            if round % 3 > 0 && rng.u32(0..6) == 0 {
                let turn = turn(&mut rng, &play.reference);
                play.order.push(turn);
            }
            // In some rounds nothing is answered for long.
            let answers = match round % 4 {
                2 if own < 32 => 0,
                2 => rng.usize(0..=8),
                _ => rng.usize(0..=2),
            };
            for _ in 0..answers {
                let Some((own, edit)) = play.sent.pop_front() else { break };
                if rng.u32(0..8) == 0 {
                    assert_eq!(play.replica.take_back(own), Some(edit));
                } else {
                    play.order.push(Entry::of(OWN, own, Order::Edit(edit)));
                }
            }
            if round % 2 == 1 {
                play.check();
                for _ in 0..rng.usize(0..4) {
                    play.give(1);
                    if rng.bool() {
                        play.check();
                    }
                }
            } else if rng.bool() {
                play.give(rng.usize(1..6));
            }
            if rng.bool() {
                play.check();
            }
        }
        play.check();
        let mut other = terrain(&ground());
        obey(&mut other, &Entry::of(OWN, 0, Order::Edit(edit(&mut rng, &image, NEAR))));
        other.apply_one(play.replica.whole(other.world())).outcome.expect("it fits");
        assert_eq!([play.replica.shown_hash(), other.world().hash()], [play.shown.world().hash(); 2]);
        assert_eq!(fields(other.world()), fields(play.shown.world()));
        (quiet, apart) = (quiet + play.quiet, apart + play.apart);
        (alone, shared) = (alone + play.alone, shared + play.shared);
    }
    assert!(quiet >= 10, "{quiet} predictions came as they were");
    assert!(alone >= 5, "{alone} updates went on from what was shown");
    assert!(apart >= 10, "{apart} updates drafted nothing");
    assert!(shared >= 1000, "{shared} bricks are shared");
}

#[test]
fn a_pending_edit_is_worked_out_again_where_others_change_the_ground_that_its_material_comes_from() {
    let at = |y: f32| Vec3::new(30.0, y, 30.0);
    let edit = |brush: &Brush| Edit::quantize(brush).expect("a valid brush");
    let path = BrushPath::polyline([(at(50.0), 2.0), (at(50.0) + Vec3::X * 9.0, 2.0)]);
    for (own, y) in [
        (Brush::fill(Shape::sphere(at(40.0), 3.0), 0.0), 40),
        (Brush::fill(Shape::sphere(at(50.0), 3.0), 1.0), 50),
        (Brush::fill(path, 1.0), 50),
        (Brush::fill(Shape::sphere(at(70.0), 3.0), 0.0), 70),
    ] {
        let mut play = Play::new();
        // A field that later edits of others change, so that no names of fields differ.
        play.order.push(Entry::of(
            ClientId(2),
            1,
            Order::Edit(edit(&Brush::dig(Shape::sphere(at(20.0), 6.0)))),
        ));
        play.give(1);
        play.check();
        play.replica.predict(1, edit(&own));
        play.check();
        for (number, material) in (2..).zip([3, 1]) {
            let paint = Brush::paint(Shape::sphere(at(14.0), 5.0), MaterialId(material));
            play.order.push(Entry::of(ClientId(2), number, Order::Edit(edit(&paint))));
            play.give(1);
            play.check();
            let place = IVec3::new(30, y, 30);
            assert!(play.shown.world().samples().is_solid(place), "{own:?}");
            assert_eq!(play.shown.world().samples().material(place), MaterialId(material), "{own:?}");
        }
    }
}
