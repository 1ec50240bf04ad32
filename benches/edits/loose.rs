//! What it costs to look for loose pieces, and to undo: digs of some 100 voxels, a transaction each.

use bevy_burrow::prelude::*;
use glam::Vec3;

use crate::landscape::{Places, dig, landscape, one_thread};
use crate::stages::{self, Played};

/// A ball of this radius has 100 voxels.
const RADIUS: f32 = 2.88;

/// A pillar with a ball on it, over a place: 2 voxels thick, and 100 voxels large.
fn mushroom(at: Vec3) -> [Brush; 2] {
    let (foot, head) = (at - Vec3::Y * 3.0, at + Vec3::Y * 9.0);
    let pillar = Shape::capsule(foot, head, 1.2);
    [Brush::add(pillar, MaterialId(1)), Brush::add(Shape::sphere(head, RADIUS), MaterialId(2))]
}

/// Digs into ground, under what then falls, and into the roof of a hall.
pub fn section() {
    type Scene = (&'static str, fn(&mut Terrain), fn(Vec3) -> Brush);
    let scenes: [Scene; 3] = [
        ("into the ground", |_| {}, |at| dig(at, RADIUS)),
        (
            "cuts off 150 voxels",
            |terrain| drop(terrain.apply(Places::new(200).iter().flat_map(mushroom))),
            |at| dig(at + Vec3::Y * 3.0, RADIUS),
        ),
        (
            "into the roof of a hall of 30 x 9 x 30",
            |terrain| {
                let hall =
                    |at: Vec3| Brush::dig(Shape::cuboid(at - Vec3::Y * 24.0, Vec3::new(15.0, 4.5, 15.0)));
                terrain.apply(Places::new(200).iter().map(hall));
            },
            |at| dig(at - Vec3::Y * 20.0, RADIUS),
        ),
    ];
    let looks: [(&str, Option<LooseSettings>); 3] = [
        ("nobody looks", None),
        ("reported", Some(LooseSettings::default())),
        ("taken out, with meshes", Some(LooseSettings { debris: 4096, ..Default::default() })),
    ];
    stages::header("a dig of 100 voxels");
    for (scene, build, brush) in scenes {
        for (look, settings) in looks {
            one_thread(|| {
                let mut terrain = landscape(32);
                build(&mut terrain);
                terrain.set_loose(settings);
                let played = stages::play(&mut terrain, Places::new(200).iter().map(brush));
                stages::row(&format!("{scene}: {look}"), &played);
            });
        }
    }
    one_thread(|| {
        let mut terrain = landscape(32);
        let _ = stages::play(&mut terrain, Places::new(200).iter().map(|at| dig(at, RADIUS)));
        for (name, submit) in
            [("undone", Terrain::submit_undo as fn(&mut Terrain)), ("redone", Terrain::submit_redo)]
        {
            let mut played = Played::default();
            for _ in 0..200 {
                submit(&mut terrain);
                let commit = terrain.begin().expect("there is a step").run();
                played.stages.push(commit.stages);
                let start = std::time::Instant::now();
                terrain.commit(commit).expect("nothing else commits");
                played.commits.push(start.elapsed().as_secs_f64());
            }
            stages::row(&format!("into the ground: {name}"), &played);
        }
        println!("  history of 200 digs: {:?}", terrain.history());
    });
}
