//! A line on standard output for whatever happened: what was done can be followed, and checked by a script.

use bevy::prelude::*;
use bevy_burrow::panel::BrushTool;
use bevy_burrow::prelude::*;

pub struct JournalPlugin;

impl Plugin for JournalPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(|ready: On<TerrainReady>, terrains: Query<&Terrain>| {
            if let Ok(terrain) = terrains.get(ready.entity) {
                println!("ready hash={:016x}", terrain.world().hash());
            }
        })
        .add_systems(Update, (tell_receipts, tell_tool).after(BurrowSystems::Commit));
    }
}

fn tell_receipts(mut receipts: MessageReader<BrushApplied>, terrains: Query<&Terrain>) {
    for BrushApplied { terrain, receipt } in receipts.read() {
        let hash = terrain
            .and_then(|terrain| terrains.get(terrain).ok())
            .map_or(0, |terrain| terrain.world().hash());
        match &receipt.outcome {
            Ok(applied) => println!(
                "stroke tag={} removed={} added={} painted={} hash={hash:016x}",
                receipt.tag,
                applied.removed.total(),
                applied.added.total(),
                applied.painted.total()
            ),
            Err(rejection) => println!("stroke tag={} rejected: {rejection}", receipt.tag),
        }
    }
}

fn tell_tool(tool: Res<BrushTool>) {
    if tool.is_changed() {
        println!(
            "tool operation={:?} shape={:?} radius={:.2} material={}",
            tool.operation, tool.shape, tool.radius, tool.material
        );
    }
}
