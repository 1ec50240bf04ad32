//! One brush (edit and meshing) against `fast-surface-nets` meshing one chunk of 32x32x32 cells of the same ground, in
//! turns.

use std::time::Instant;

use fast_surface_nets::ndshape::{ConstShape, ConstShape3u32};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::{IVec3, Vec3};

use crate::landscape::{Places, dig, landscape, one_thread};
use crate::statistics::Sample;

/// The chunk with one more sample on each side, as that crate requires.
type Chunk = ConstShape3u32<34, 34, 34>;

pub fn section() {
    one_thread(|| {
        let mut terrain = landscape(32);
        for at in Places::new(600).iter() {
            terrain.apply([dig(at, 4.0)]);
        }
        let (mut own, mut peer, mut ratio) = (Sample::default(), Sample::default(), Sample::default());
        let (mut buffer, mut samples) = (SurfaceNetsBuffer::default(), vec![0.0; Chunk::USIZE]);
        for at in Places::new(600).iter() {
            terrain.submit(dig(at + Vec3::splat(3.0), 4.0));
            let commit = terrain.begin().expect("a queued brush").run();
            let ours = (commit.stages.edit + commit.stages.meshing).as_secs_f64();
            terrain.commit(commit).expect("no other commit");

            let low = at.as_ivec3() - 17;
            let world = terrain.world().samples();
            for (i, sample) in (0..).zip(&mut samples) {
                let point = IVec3::from_array(Chunk::delinearize(i).map(|v| v as i32));
                *sample = world.distance(low + point) as f32 / 256.0;
            }
            let start = Instant::now();
            surface_nets(&samples, &Chunk {}, [0; 3], [33; 3], &mut buffer);
            let theirs = start.elapsed().as_secs_f64();
            assert!(!buffer.indices.is_empty());
            own.push(ours);
            peer.push(theirs);
            ratio.push(ours / theirs);
        }
        println!("  radius 4 on dug ground, edit and meshing     {:8.1} us", own.median() * 1e6);
        println!("  fast-surface-nets, one chunk of 32^3 cells   {:8.1} us", peer.median() * 1e6);
        let met = if ratio.median() <= 0.5 { "met" } else { "missed" };
        println!(
            "  ratio, median of pairs                       {:8.2}     target 0.5: {met}",
            ratio.median()
        );
    });
}
