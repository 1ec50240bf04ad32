//! The budget of mesh swaps per frame: commits wait for each other, and none is split.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

const SECOND: Vec3 = Vec3::new(100.0, 0.0, 0.0);

fn pair(swaps_per_frame: usize) -> (Stage, [Entity; 2]) {
    let mut stage =
        Stage::drawing().with_settings(BurrowSettings { swaps_per_frame, ..default() }).without_waiting();
    let terrains = [stage.spawn(level(1.0)), stage.spawn_at(level(1.0), SECOND)];
    stage.settle();
    (stage, terrains)
}

/// Digs both terrains over a corner of four chunks, so that each commit has several swaps, and checks every frame.
/// Returns the largest number of commits in one frame.
fn dig_both(stage: &mut Stage, terrains: [Entity; 2], x: f32) -> u64 {
    for offset in [Vec3::ZERO, SECOND] {
        stage.send(dig(x + offset.x, 8.0, 16.0, 4.0));
    }
    let mut before = stage.figures().commits;
    let end = before + 2;
    let mut most = 0;
    stage.frame();
    stage.rest();
    stage.frames_until("both are dug", |stage| {
        let commits = stage.figures().commits;
        most = most.max(commits - before);
        before = commits;
        for terrain in terrains {
            stage.assert_whole(terrain, "one of two commits");
        }
        commits == end
    });
    most
}

#[test]
fn commits_over_the_budget_are_shown_whole_in_different_frames() {
    let (mut stage, terrains) = pair(1);
    for round in 0..5 {
        assert_eq!(dig_both(&mut stage, terrains, 8.0 + 8.0 * round as f32), 1);
    }
    assert!(stage.figures().swaps > 2 * stage.figures().commits, "a commit has more swaps than the budget");
}

#[test]
fn commits_within_the_budget_are_shown_in_one_frame() {
    let (mut stage, terrains) = pair(256);
    // In most rounds both transactions finish in time.
    assert!((0..5).any(|round| dig_both(&mut stage, terrains, 8.0 + 8.0 * round as f32) == 2));
}

#[test]
fn meshes_of_a_large_commit_go_to_the_renderer_over_several_frames_and_are_shown_in_one() {
    let mut stage = Stage::drawing();
    let settings = TerrainSettings { chunk_size: 8, voxel_size: 1.0 };
    let ground = Ground::flat(128, 128, 8.0).expect("a valid ground");
    let terrain = stage.show(Terrain::new(ground, &settings).expect("valid settings"));
    for round in 0..3 {
        let (commits, before) = (stage.figures().commits, stage.meshes());
        let size = Vec3::new(60.0, 2.0 + round as f32, 60.0);
        stage.send(Brush::dig(Shape::cuboid(Vec3::new(64.0, 8.0, 64.0), size)));
        let (mut meshes, mut uploads) = (before, Vec::new());
        stage.frames_until("it is dug", |stage| {
            let new = stage.meshes().saturating_sub(meshes);
            meshes = stage.meshes();
            stage.assert_whole(terrain, "a large commit");
            let is_dug = stage.figures().commits > commits;
            if !is_dug && new > 0 {
                uploads.push(new);
            }
            is_dug
        });
        assert!(uploads.len() > 2 && uploads.iter().all(|&new| new <= 64), "{uploads:?}");
        stage.settle_shown();
        // Nothing is left of former meshes.
        stage.frames(3);
        assert_eq!(stage.meshes(), stage.count::<Mesh3d>());
    }
    // Terrains that are replaced or despawned while meshes are on their way leave none behind either.
    for is_despawned in [false, true] {
        let before = stage.meshes();
        stage.send(Brush::dig(Shape::cuboid(Vec3::new(64.0, 8.0, 64.0), Vec3::new(50.0, 6.0, 50.0))));
        stage.frames_until("meshes are on their way", |stage| stage.meshes() > before);
        let world = stage.app.world_mut();
        if is_despawned {
            assert!(world.despawn(terrain));
            stage.frames(5);
        } else {
            let another = Terrain::new(Ground::flat(64, 64, 8.0).expect("a valid ground"), &settings);
            world.entity_mut(terrain).insert(another.expect("valid settings"));
            stage.settle_shown();
            stage.frames(3);
        }
        assert_eq!(stage.meshes(), stage.count::<Mesh3d>());
    }
}

#[test]
fn constantly_dug_terrains_do_not_starve_another_one() {
    for waiting in 0..3 {
        let mut stage = Stage::drawing()
            .with_settings(BurrowSettings { swaps_per_frame: 1, ..default() })
            .without_waiting();
        let terrains = [0.0, 1.0, 2.0].map(|index| {
            let terrain = stage.spawn_at(level(1.0), SECOND * index);
            stage.settle();
            terrain
        });
        let at = |index: usize, x: f32| dig(x + SECOND.x * index as f32, 8.0, 30.0, 4.0);
        let before = stage.hash(terrains[waiting]);
        stage.send(at(waiting, 30.0));
        let (mut frames, commits) = (0, stage.figures().commits);
        while stage.hash(terrains[waiting]) == before {
            for busy in (0..3).filter(|&index| index != waiting) {
                stage.send(at(busy, 20.0 + 0.5 * frames as f32));
            }
            stage.frame();
            stage.rest();
            frames += 1;
            let others = stage.figures().commits - commits;
            assert!(others < 20, "terrain {waiting} starves while the others are dug");
            assert!(frames < 2000, "nothing is committed");
        }
    }
}
