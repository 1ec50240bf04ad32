//! The cost of searching for loose pieces, and of undo: digs of some 100 voxels, one transaction each.
//!
//! Every setting does equal digs in turns, each undone before the next, so that all find equal worlds.
//! The cost of a search is the time of a dig minus that of the same dig without a search, pair by pair.
//!
//! A search ends at [`LooseSettings::largest`] voxels. A body just below that bound is searched completely, found and
//! described. One just above costs as much as any search can, and larger bodies of the same shape cost no more. The
//! shape matters because a search goes from brick to brick: for a given volume, a ball has the fewest bricks, a sheet
//! one voxel thick has more than four times as many, and a tangle of threads would have more still. The bound applies
//! to each piece: a dig that cuts several necks at once pays for each.

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use glam::Vec3;

use crate::landscape::{Places, dig, ground, landscape, one_thread};
use crate::stages::{self, Played};
use crate::statistics::Sample;

/// A ball of this radius has 100 voxels.
const RADIUS: f32 = 2.88;

/// A neck of this radius loses some 100 voxels to a ball of radius [`CUT`].
const NECK: f32 = 2.6;
const CUT: f32 = 3.0;

/// The height of bodies above the ground under their necks.
const LIFT: f32 = 26.0;

/// The index in [`searches`] of the setting that reports pieces, and leaves them where they are.
const REPORTED: usize = 1;

/// The search settings that are compared, from no search on.
fn searches() -> [(&'static str, Option<LooseSettings>); 3] {
    [
        ("no search", None),
        ("reported", Some(LooseSettings::default())),
        ("taken out, with meshes", Some(LooseSettings { debris: 1 << 15, ..Default::default() })),
    ]
}

/// Digs of some 100 voxels, and the ground that is built there.
struct Scene {
    name: &'static str,
    build: fn(Vec3) -> Vec<Brush>,
    dig: fn(Vec3) -> Brush,
}

/// A pillar, 2 voxels thick, with a ball of 100 voxels on it.
fn mushroom(at: Vec3) -> Vec<Brush> {
    let (foot, head) = (at - Vec3::Y * 3.0, at + Vec3::Y * 9.0);
    let pillar = Shape::capsule(foot, head, 1.2);
    vec![Brush::add(pillar, MaterialId(1)), Brush::add(Shape::sphere(head, RADIUS), MaterialId(2))]
}

fn hall(at: Vec3) -> Vec<Brush> {
    vec![Brush::dig(Shape::cuboid(at - Vec3::Y * 24.0, Vec3::new(15.0, 4.5, 15.0)))]
}

/// A body that only its neck connects to the ground.
fn on_a_neck(at: Vec3, body: Shape) -> Vec<Brush> {
    let neck = Shape::capsule(at - Vec3::Y * 3.0, at + Vec3::Y * (LIFT + 4.0), NECK);
    vec![Brush::add(neck, MaterialId(1)), Brush::add(body, MaterialId(2))]
}

fn ball(at: Vec3, radius: f32) -> Vec<Brush> {
    on_a_neck(at, Shape::sphere(at + Vec3::Y * (LIFT + radius), radius))
}

/// A sheet one voxel thick and 512 high.
fn sheet(at: Vec3, half_width: f32) -> Vec<Brush> {
    let half = Vec3::new(half_width, 256.0, 0.6);
    on_a_neck(at, Shape::cuboid(at + Vec3::Y * (LIFT + half.y), half))
}

/// How far the ground rises above a place, within `reach` columns to each side.
fn rise(at: Vec3, reach: i32) -> f32 {
    let (ground, x, z) = (ground(), at.x as i32, at.z as i32);
    let columns = (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dz| Column::new(x + dx, z + dz)));
    let top = columns.map(|column| ground.height(column)).max().expect("there are columns");
    top as f32 / 256.0 - at.y
}

/// Places where bodies on necks touch neither the ground nor each other.
fn open_places(count: usize) -> Vec<Vec3> {
    let mut open: Vec<Vec3> = Vec::new();
    for at in Places::new(600).iter() {
        let is_apart = |other: &Vec3| (other.x - at.x).abs().max((other.z - at.z).abs()) >= 80.0;
        if open.len() < count && open.iter().all(is_apart) && rise(at, 6) < 3.0 && rise(at, 32) < 16.0 {
            open.push(at);
        }
    }
    assert_eq!(open.len(), count, "too few open places");
    open
}

fn voxels(pieces: &[LoosePiece]) -> f64 {
    pieces.iter().map(|piece| piece.voxels).sum::<u64>() as f64
}

/// Voxels that digs cut off, and those that were reported.
struct Loose {
    cut_off: Sample,
    found: Sample,
}

/// Undoes a dig.
fn undo_dig(terrain: &mut Terrain, hash: u64) {
    assert!(terrain.undo().outcome.is_ok(), "a dig can be undone");
    assert_eq!(terrain.world().hash(), hash, "an undone dig leaves no trace");
}

/// Makes the same digs with every setting in turns, and prints the time of each and the cost of the search.
fn compare(name: &str, terrain: &mut Terrain, digs: &[Brush]) -> Loose {
    let (searches, before) = (searches(), terrain.world().hash());
    let mut played = searches.map(|_| Played::default());
    let (mut dug, mut found) = (Sample::default(), Sample::default());
    // Each setting digs at other places within a turn, so that none profits from caches that another has just warmed.
    let first = |look: usize| look * digs.len() / searches.len();
    for turn in 0..digs.len() {
        for (look, (_, settings)) in searches.iter().enumerate() {
            terrain.set_loose(*settings);
            let applied = played[look].play(terrain, &digs[(turn + first(look)) % digs.len()]);
            dug.push(applied.removed.total() as f64);
            if look == REPORTED {
                found.push(voxels(&applied.loose));
            }
            undo_dig(terrain, before);
        }
    }
    // All loose voxels of any size, untimed.
    terrain.set_loose(None);
    let everything = LooseSettings { largest: u32::MAX, ..Default::default() };
    let mut cut_off = Sample::default();
    for dig in digs {
        let around = Played::default().play(terrain, dig).bounds.expect("a dig changes the ground");
        cut_off.push(voxels(&terrain.world().loose_pieces(around.grown(1), &everything)));
        undo_dig(terrain, before);
    }

    for ((look, _), played) in searches.iter().zip(&played) {
        stages::row(&format!("{name}: {look}"), played);
    }
    // In the order of the digs.
    let times = |look: usize| {
        let mut times: Vec<f64> =
            played[look].stages.iter().map(|stages| stages.whole.as_secs_f64()).collect();
        times.rotate_right(first(look));
        times
    };
    let alone = times(0);
    for (look, (what, _)) in searches.iter().enumerate().skip(1) {
        let own = times(look);
        let pairs = || own.iter().zip(&alone);
        let more: Sample = pairs().map(|(with, without)| (with - without) * 1e6).collect();
        let ratio: Sample = pairs().map(|(with, without)| with / without).collect();
        println!(
            "    {what}: {:.1} us more, p99 {:.1}; {:.2} times as long, p99 {:.2}; medians of {} pairs",
            more.median(),
            more.percentile(0.99),
            ratio.median(),
            ratio.percentile(0.99),
            more.len()
        );
    }
    println!(
        "    voxels, medians: {} dug, {} cut off, {} of them found",
        dug.median(),
        cut_off.median(),
        found.median()
    );
    Loose { cut_off, found }
}

/// Digs into ground, under things that then fall, into the roof of a hall, and through the necks of bodies with about
/// as many voxels as the bound.
pub fn section() {
    let scenes = [
        Scene { name: "into the ground", build: |_| Vec::new(), dig: |at| dig(at, RADIUS) },
        Scene { name: "cuts off 150 voxels", build: mushroom, dig: |at| dig(at + Vec3::Y * 3.0, RADIUS) },
        Scene {
            name: "into the roof of a hall of 30 x 9 x 30",
            build: hall,
            dig: |at| dig(at - Vec3::Y * 20.0, RADIUS),
        },
    ];
    let through_the_neck: fn(Vec3) -> Brush = |at| dig(at + Vec3::Y * 7.0, CUT);
    let bodies = [
        Scene { name: "a ball below the bound", build: |at| ball(at, 19.5), dig: through_the_neck },
        Scene { name: "a ball above the bound", build: |at| ball(at, 20.0), dig: through_the_neck },
        Scene { name: "a sheet below the bound", build: |at| sheet(at, 30.4), dig: through_the_neck },
        Scene { name: "a sheet above the bound", build: |at| sheet(at, 32.4), dig: through_the_neck },
    ];
    stages::header("a dig of 100 voxels");
    for Scene { name, build, dig } in scenes {
        one_thread(|| {
            let mut terrain = landscape(32);
            terrain.apply(Places::new(200).iter().flat_map(build));
            let digs: Vec<Brush> = Places::new(200).iter().map(dig).collect();
            compare(name, &mut terrain, &digs);
        });
    }
    let bound = f64::from(LooseSettings::default().largest);
    for Scene { name, build, dig } in bodies {
        one_thread(|| {
            let (mut terrain, places) = (landscape(32), open_places(15));
            terrain.apply(places.iter().copied().flat_map(build));
            let digs: Vec<Brush> = (0..14).flat_map(|_| places.iter().copied().map(dig)).collect();
            let Loose { cut_off, found } = compare(name, &mut terrain, &digs);
            let [least, most] = [0.0, 1.0].map(|share| cut_off.percentile(share));
            assert!(most < 1.1 * bound && least > 0.9 * bound, "{name}: {least} to {most} voxels");
            if most <= bound {
                assert_eq!([0.0, 1.0].map(|share| found.percentile(share)), [least, most], "{name}");
            } else {
                assert!(least > bound && found.percentile(1.0) == 0.0, "{name}: {least} to {most} voxels");
            }
        });
    }
    one_thread(|| {
        let mut terrain = landscape(32);
        Places::new(200).iter().for_each(|at| drop(terrain.apply([dig(at, RADIUS)])));
        for (name, order) in [("undone", Order::Undo), ("redone", Order::Redo)] {
            let mut played = Played::default();
            for _ in 0..200 {
                terrain.submit(&order);
                let commit = terrain.begin().expect("there is a step").run();
                played.stages.push(commit.stages);
                let start = std::time::Instant::now();
                terrain.commit(commit).expect("no other commit");
                played.commits.push(start.elapsed().as_secs_f64());
            }
            stages::row(&format!("into the ground: {name}"), &played);
        }
        println!("  history of 200 digs: {:?}", terrain.history());
    });
}
