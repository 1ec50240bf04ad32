//! Latency under overload: ten thousand large brushes in one frame, and a player who keeps digging.
//!
//! ```text
//! cargo bench --features examples --bench flood
//! ```

use std::collections::HashMap;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::prelude::*;

/// Number and radius of the brushes sent at once.
const FLOOD: u64 = 10_000;
const RADIUS: f32 = 60.0;
/// How many digs the player makes, and the pause between them.
const DIGS: u64 = 80;
const PAUSE: Duration = Duration::from_millis(100);
const FRAME: Duration = Duration::from_micros(16_667);

/// When brushes were sent, by tag, and their outcomes.
#[derive(Resource, Default)]
struct Latencies {
    sent: HashMap<u64, Instant>,
    /// Seconds until the receipt came.
    answered: Vec<(u64, f64)>,
    refused: u64,
}

fn record_receipts(mut receipts: MessageReader<BrushApplied>, mut latencies: ResMut<Latencies>) {
    for BrushApplied { receipt, .. } in receipts.read() {
        let took = latencies.sent.remove(&receipt.tag).map_or(0.0, |sent| sent.elapsed().as_secs_f64());
        match receipt.outcome {
            Ok(_) => latencies.answered.push((receipt.tag, took)),
            Err(_) => latencies.refused += 1,
        }
    }
}

/// Resident memory of the process in MiB, where the system reports it.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse().unwrap_or(0.0) / 1024.0
}

fn send(app: &mut App, tag: u64, brush: Brush) {
    app.world_mut().resource_mut::<Latencies>().sent.insert(tag, Instant::now());
    app.world_mut().write_message(brush.with_tag(tag));
}

fn percentile(times: &mut [f64], percent: usize) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get((times.len() * percent / 100).min(times.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

fn main() {
    let noise = NoiseHeights { seed: 4, amplitude: 40.0, scale: 180.0, octaves: 5, ..default() };
    let ground = Ground::from_noise(1024, 1024, &noise).expect("valid hills");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let limits = terrain.work_limits();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins))
        .init_resource::<Latencies>()
        .add_systems(Last, record_receipts);
    app.world_mut().spawn(terrain);
    (0..3).for_each(|_| app.update());
    let place = |number: u64, spread: u64| {
        let at = |step: u64| ((number * step % spread) as f32) + 512.0 - spread as f32 / 2.0;
        Vec3::new(at(37), 10.0, at(61))
    };
    let before = resident();
    for tag in 0..FLOOD {
        send(&mut app, tag, Brush::dig(Shape::sphere(place(tag, 800), RADIUS)));
    }
    let start = Instant::now();
    app.update();
    let frame = start.elapsed();
    let refused = app.world().resource::<Latencies>().refused;
    println!("{FLOOD} brushes of radius {RADIUS}: {refused} refused in their frame, which took {frame:.1?}");

    let (mut frames, mut most, mut next, mut dug) = (Vec::new(), before, Instant::now(), 0);
    while dug < DIGS || !app.world().resource::<Latencies>().sent.is_empty() {
        let start = Instant::now();
        if dug < DIGS && start >= next {
            send(&mut app, FLOOD + dug, Brush::dig(Shape::sphere(place(dug, 40), 4.0)));
            (dug, next) = (dug + 1, next + PAUSE);
        }
        app.update();
        frames.push(app.world().resource::<BurrowFigures>().main_thread.as_secs_f64() * 1e6);
        most = most.max(resident());
        std::thread::sleep(FRAME.saturating_sub(start.elapsed()));
    }
    let latencies = app.world().resource::<Latencies>();
    let flood = latencies.answered.iter().filter(|(tag, _)| *tag < FLOOD);
    let last = flood.map(|(_, took)| *took).fold(0.0, f64::max);
    let mut player: Vec<f64> =
        latencies.answered.iter().filter(|(tag, _)| *tag >= FLOOD).map(|(_, took)| *took).collect();
    println!("work that may wait: {} bricks, which took {last:.2} s", limits.waiting);
    println!(
        "{DIGS} digs of radius 4, ten a second: {} done, {} refused; answered after p50 {:.2}, p99 {:.2} s",
        player.len(),
        latencies.refused - refused,
        percentile(&mut player, 50),
        percentile(&mut player, 99)
    );
    println!(
        "the plugin on the main thread: p50 {:.0}, p99 {:.0} us a frame",
        percentile(&mut frames, 50),
        percentile(&mut frames, 99)
    );
    println!("resident: {before:.0} MiB before, {most:.0} at most");
}
