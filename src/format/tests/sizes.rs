//! The sizes of saved worlds in bytes.

use super::worlds;
use crate::format::Batch;
use crate::format::frame::{Kind, WorldId, seal};
use crate::format::region::{encode_region, region_key};
use crate::terrain::World;
use crate::volume::layers;

const WORLD: WorldId = WorldId(u128::MAX / 7);

/// Bytes that a world's regions take in all for each edited sample.
fn bytes_per_sample(world: &World) -> f64 {
    let (mut bytes, mut samples) = (0, 0);
    for region in world.regions() {
        let bricks: Vec<_> = world.bricks_in(region).collect();
        samples += bricks.iter().map(|(_, brick)| layers::count(brick.edited())).sum::<u64>();
        let payload = encode_region(bricks.iter().map(|(pos, brick)| (pos, *brick)), []);
        bytes += seal(Kind::Region, WORLD, &region_key(region), 1000, u64::MAX / 3, &payload).len();
    }
    bytes as f64 / samples as f64
}

#[test]
fn regions_take_few_bytes_for_each_edited_sample() {
    let ground = worlds::hills(256);
    for (name, brushes, most) in [
        ("scattered digs", worlds::scattered(&ground, 150, 1), 1.5),
        ("a tunnel", worlds::tunnel(&ground, 600, 2), 1.3),
        ("a crater", worlds::crater(&ground), 0.6),
        ("brushes of all kinds", worlds::mixed(&ground, 200, 1), 1.6),
    ] {
        let mut terrain = worlds::terrain(&ground);
        worlds::apply(&mut terrain, brushes);
        let bytes = bytes_per_sample(terrain.world());
        println!("{name}: {bytes:.3} bytes for an edited sample");
        assert!(bytes < most, "{name}: {bytes} bytes for an edited sample");
    }
}

#[test]
fn commits_of_a_tunnel_take_few_bytes() {
    let ground = worlds::hills(256);
    let mut terrain = worlds::terrain(&ground);
    worlds::apply(&mut terrain, worlds::tunnel(&ground, 600, 2));
    let log = terrain.take_log();
    for (commits, most) in [(5, 24.0), (10, 18.0), (20, 15.0)] {
        let frame = |(number, commits): (u64, &[_])| {
            let batch = Batch { commits: commits.to_vec(), game: Vec::new() };
            seal(Kind::Journal, WORLD, &number.to_be_bytes(), 100_000, 0, &batch.encode()).len()
        };
        let bytes: usize = (0..).zip(log.chunks_exact(commits)).map(frame).sum();
        let bytes = bytes as f64 / (log.len() / commits * commits) as f64;
        println!("{commits} commits a frame: {bytes:.2} bytes each");
        assert!(bytes < most, "{commits} commits a frame: {bytes} bytes each");
    }
}
