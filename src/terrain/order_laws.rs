//! The law of order: the result depends only on the order of submissions, and not on frames, threads, or when
//! transactions begin, are abandoned or are split.
//!
//! A random script is played twice with irregular transactions, and once by a simple model that applies one edit after
//! the other, undoes single edits, and groups them itself. `BURROW_WORLDS` is the number of scripts.

use std::collections::BTreeMap;
use std::sync::Arc;

use fastrand::Rng;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::queue::Together;
use super::run::PANICS;
use super::{
    LooseSettings, Order, OrderKind, Receipt, Rejection, Request, Terrain, TerrainSettings, Transaction,
    WorkLimits, unique,
};
use crate::brush::{Brush, Edit};
use crate::ground::Ground;
use crate::volume::DiggingRules;
use crate::worlds;

/// A request to a terrain.
#[derive(Clone, Debug)]
enum Ask {
    /// A brush, sent in a frame.
    Brush(Brush, usize),
    Step(OrderKind),
    Rules(DiggingRules),
    Loose(Option<LooseSettings>),
}

fn script(rng: &mut Rng, ground: &Ground) -> Vec<Ask> {
    let (mut frame, mut stroke) = (0, 0);
    let count = rng.u64(4..24);
    let ask = |tag: u64| match rng.u32(0..20) {
        0..=2 => Ask::Step(OrderKind::Undo),
        3 => Ask::Step(OrderKind::Redo),
        4 => Ask::Rules(if rng.bool() { worlds::random_rules(rng, ground) } else { DiggingRules::default() }),
        5 => {
            let settings = LooseSettings { largest: 3000, crumbs: 6, debris: 400 };
            Ask::Loose(rng.bool().then_some(settings))
        }
        _ => {
            frame += usize::from(rng.u32(0..3) == 0);
            stroke += u64::from(rng.u32(0..4) == 0);
            let tag = tag | if rng.u32(0..12) == 0 { PANICS } else { 0 };
            let mut brush = worlds::any_random_brush(rng, ground).with_tag(tag).with_power(rng.u8(..) | 127);
            if rng.bool() {
                brush = brush.with_stroke(stroke);
            }
            if rng.u32(0..20) == 0 {
                brush.blend.strength = f32::NAN;
                // The shape is refused first: NaN equals nothing, also in a receipt.
                brush.shape = crate::brush::Shape::sphere(glam::Vec3::ZERO, -1.0);
                brush.custom = None;
            }
            Ask::Brush(brush, frame)
        }
    };
    (1..=count).map(ask).collect()
}

fn order_of(step: OrderKind) -> Order {
    if step == OrderKind::Undo { Order::Undo } else { Order::Redo }
}

/// A script in short: what was sent in which frame, of which stroke.
fn in_short(script: &[Ask]) -> String {
    let word = |ask: &Ask| match ask {
        Ask::Brush(brush, frame) => {
            let stroke = brush.stroke.map(|stroke| format!(" of stroke {stroke}")).unwrap_or_default();
            format!("brush {:#x} in frame {frame}{stroke}", brush.tag)
        }
        Ask::Step(step) => format!("{step:?}"),
        Ask::Rules(rules) => format!("{} rules", if rules.is_empty() { "no" } else { "other" }),
        Ask::Loose(settings) => format!("loose {}", settings.is_some()),
    };
    script.iter().map(word).collect::<Vec<_>>().join(", ")
}

/// All results of a terrain.
#[derive(Debug, Default, PartialEq)]
struct Said {
    /// By tag.
    receipts: BTreeMap<u64, Receipt>,
    steps: Vec<Receipt>,
    hash: u64,
    history: super::History,
}

impl Said {
    fn hear(&mut self, receipts: Vec<Receipt>) {
        for receipt in receipts {
            if receipt.kind != OrderKind::Edit {
                self.steps.push(receipt);
                continue;
            }
            let tag = receipt.tag;
            assert!(self.receipts.insert(tag, receipt).is_none(), "two receipts for {tag:#x}");
        }
    }
}

/// Plays a script with irregular transactions. Returns which requests were accepted, and the results.
fn play(mut terrain: Terrain, script: &[Ask], pools: &[ThreadPool], rng: &mut Rng) -> (Vec<Ask>, Said) {
    let (mut taken, mut said) = (Vec::new(), Said::default());
    terrain.keep_log(Some(1 << 30));
    let mut frames: BTreeMap<usize, Together> = BTreeMap::new();
    let mut under_way: Option<Transaction> = None;
    let run = |transaction: Transaction, rng: &mut Rng| {
        pools[rng.usize(..pools.len())].install(|| transaction.run())
    };
    for ask in script {
        let before = terrain.queued();
        match ask {
            Ask::Brush(brush, frame) => {
                let together = *frames.entry(*frame).or_insert_with(|| Together::Batch(unique()));
                let request = Request::from(brush);
                match terrain.admit(&request) {
                    Ok(work) => terrain.queue_order(request, work, together).expect("no rules"),
                    Err(rejection) => said.hear(vec![Receipt::of_edit(brush.tag, Err(rejection))]),
                }
            }
            Ask::Step(step) => terrain.submit(order_of(*step)),
            Ask::Rules(rules) => terrain.set_rules(rules.clone()).expect("valid rules"),
            Ask::Loose(settings) => terrain.set_loose(*settings),
        }
        if terrain.queued() > before || matches!(ask, Ask::Rules(_) | Ask::Loose(_)) {
            taken.push(ask.clone());
        }
        for _ in 0..rng.u32(0..3) {
            match (under_way.take(), rng.u32(0..8)) {
                (None, 0..5) => {
                    under_way = terrain.begin();
                    // Of steps that found nothing, in turn.
                    said.hear(terrain.take_receipts());
                }
                (Some(transaction), 0..4) => {
                    let commit = run(transaction, rng);
                    said.hear(terrain.commit(commit).expect("it is waited for"));
                }
                (Some(transaction), 4) => {
                    terrain.abandon();
                    assert!(terrain.commit(run(transaction, rng)).is_err(), "it was given up");
                }
                (_, 5) if rng.u32(0..4) == 0 => {
                    let none: [&Brush; 0] = [];
                    assert!(terrain.apply(none).is_empty());
                    said.hear(terrain.take_receipts());
                }
                (other, _) => under_way = other,
            }
        }
    }
    if let Some(transaction) = under_way {
        let commit = run(transaction, rng);
        said.hear(terrain.commit(commit).expect("it is waited for"));
    }
    loop {
        let transaction = terrain.begin();
        said.hear(terrain.take_receipts());
        let Some(transaction) = transaction else { break };
        let commit = run(transaction, rng);
        said.hear(terrain.commit(commit).expect("it is waited for"));
    }
    assert_eq!((terrain.queued(), terrain.waiting_work()), (0, 0));
    said.hear(terrain.take_receipts());
    (said.hash, said.history) = (terrain.world().hash(), terrain.history());
    check_log(&mut terrain);
    (taken, said)
}

/// Checks that what a terrain logged since it was new leads to its world. Edits that panicked are not part of that.
fn check_log(terrain: &mut Terrain) {
    let settings = TerrainSettings { chunk_size: terrain.world.grid.size() as u32, ..Default::default() };
    let mut replayed = Terrain::new(Arc::clone(&terrain.world.ground), &settings).expect("valid settings");
    for record in terrain.take_log() {
        replayed.replay(&record).expect("its own record");
    }
    let now = |terrain: &Terrain| {
        let parts = terrain.parts();
        (terrain.world().hash(), parts.revision, parts.change.fields, parts.edit_settings)
    };
    assert_eq!(now(&replayed), now(terrain));
}

/// Plays a script with the simple model: one edit after the other, each its own step. A group is a list of
/// edits that changed something.
fn by_the_book(mut terrain: Terrain, script: &[Ask]) -> (BTreeMap<u64, Receipt>, Vec<Option<Vec<u64>>>, u64) {
    #[derive(PartialEq, Clone, Copy)]
    enum Key {
        Stroke(u64),
        Frame(usize),
    }
    let (mut receipts, mut steps) = (BTreeMap::new(), Vec::new());
    let (mut past, mut future): (Vec<Vec<u64>>, Vec<Vec<u64>>) = Default::default();
    // The group of the latest edit, and whether it is the last of the past.
    let mut open: Option<(Key, bool)> = None;
    for ask in script {
        match ask {
            Ask::Brush(brush, frame) => {
                let key = brush.stroke.map_or(Key::Frame(*frame), Key::Stroke);
                let is_open = open.is_some_and(|(open, is_last)| open == key && is_last);
                let is_same = open.is_some_and(|(open, _)| open == key);
                let receipt = if brush.tag & PANICS != 0 && Edit::quantize(brush).is_ok() {
                    Receipt::of_edit(brush.tag, Err(Rejection::Panicked))
                } else {
                    // Each edit is its own step.
                    terrain.apply([Brush { stroke: None, ..brush.clone() }]).remove(0)
                };
                let is_changed = receipt.outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some());
                if is_changed {
                    future.clear();
                    match past.last_mut().filter(|_| is_open) {
                        Some(group) => group.push(brush.tag),
                        None => past.push(vec![brush.tag]),
                    }
                }
                open = Some((key, is_changed || is_same && is_open));
                receipts.insert(brush.tag, receipt);
            }
            Ask::Step(step) => {
                open = None;
                let (from, to) = match step {
                    OrderKind::Undo => (&mut past, &mut future),
                    _ => (&mut future, &mut past),
                };
                let group = from.pop();
                for _ in group.iter().flatten() {
                    assert!(terrain.apply_one(order_of(*step)).outcome.is_ok());
                }
                to.extend(group.clone());
                steps.push(group);
            }
            Ask::Rules(rules) => terrain.set_rules(rules.clone()).expect("valid rules"),
            Ask::Loose(settings) => terrain.set_loose(*settings),
        }
    }
    (receipts, steps, terrain.world().hash())
}

#[test]
fn nothing_depends_on_when_transactions_begin() {
    let pools = [1, 2, 3].map(|count| ThreadPoolBuilder::new().num_threads(count).build().expect("threads"));
    let (mut undone, mut panicked, mut overloaded, mut longest) = (0, 0, 0, 0);
    for index in 0..worlds::world_count(150) {
        let mut rng = Rng::with_seed(9100 + index);
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        let (script, ground) = (script(&mut rng, &ground), Arc::new(ground));
        let budget = if index % 4 == 0 { rng.usize(5_000..100_000) } else { 1 << 30 };
        let terrain = |limits: WorkLimits| {
            let settings = TerrainSettings { chunk_size, ..Default::default() };
            let mut terrain = Terrain::new(Arc::clone(&ground), &settings).expect("valid settings");
            terrain.set_undo_budget(budget);
            terrain.set_work_limits(limits);
            terrain
        };
        let waiting = if rng.u32(0..4) == 0 { rng.u64(20..2000) } else { u64::MAX };
        let limits = WorkLimits { transaction: rng.u64(1..4000), waiting };
        let (taken, said) = play(terrain(limits), &script, &pools, &mut rng);
        let is_taken = |receipt: &Receipt| receipt.outcome != Err(Rejection::Overloaded);
        let answered = |receipts: BTreeMap<u64, Receipt>| {
            receipts.into_iter().filter(|(_, receipt)| is_taken(receipt)).collect::<BTreeMap<_, _>>()
        };
        let asked = script.iter().filter(|ask| matches!(ask, Ask::Brush(..))).count();
        assert_eq!(said.receipts.len(), asked, "script {index}: each brush is answered once");
        overloaded += asked - said.receipts.values().filter(|receipt| is_taken(receipt)).count();
        let was_overloaded = |receipt: &Receipt| receipt.outcome == Err(Rejection::Overloaded);
        let steps =
            |said: Said| said.steps.into_iter().filter(|step| !was_overloaded(step)).collect::<Vec<_>>();

        let (hash, history) = (said.hash, said.history);
        let unbounded = WorkLimits { transaction: rng.u64(1..1_000_000), waiting: u64::MAX };
        let (again, other) = play(terrain(unbounded), &taken, &pools, &mut rng);
        assert_eq!(again.len(), taken.len());
        assert_eq!((other.hash, other.history), (hash, history), "script {index}: {}", in_short(&taken));
        let receipts = answered(said.receipts.clone());
        assert_eq!(other.receipts, receipts, "script {index}");
        let (said, other) = (steps(said), steps(other));
        assert_eq!(said, other, "script {index}");

        if budget == 1 << 30 {
            let (expected, groups, hash_by_the_book) = by_the_book(terrain(unbounded), &taken);
            let tags: Vec<Option<Vec<u64>>> = said
                .iter()
                .map(|step| step.outcome.as_ref().ok().map(|restored| restored.tags.clone()))
                .collect();
            assert_eq!(tags, groups, "script {index}: {}", in_short(&taken));
            assert_eq!(receipts, expected, "script {index}");
            assert_eq!(hash, hash_by_the_book, "script {index}: {}", in_short(&taken));
            undone += groups.iter().flatten().count();
            longest = longest.max(groups.iter().flatten().map(Vec::len).max().unwrap_or(0));
        }
        panicked += receipts.values().filter(|own| own.outcome == Err(Rejection::Panicked)).count();
    }
    println!("{undone} steps, {panicked} panics, {overloaded} refused, {longest} edits in the longest step");
    assert!(undone > 20 && panicked > 20 && overloaded > 5 && longest > 2);
}
