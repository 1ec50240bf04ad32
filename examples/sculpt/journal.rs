//! Prints a line to standard output for every event, so that a script can follow and check the example.

#[path = "../shared/tell.rs"]
mod told;

use bevy::prelude::*;
use bevy_burrow::panel::{BrushTool, PanelPlaces};
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;

pub struct JournalPlugin;

impl Plugin for JournalPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(|ready: On<TerrainReady>, terrains: Query<&Terrain>| {
            if let Ok(terrain) = terrains.get(ready.entity) {
                println!("ready hash={:016x}", terrain.world().hash());
            }
        })
        .add_systems(
            Update,
            (print_look, print_receipts, print_steps, print_tool, print_places).after(BurrowSystems::Commit),
        )
        .add_systems(Last, told::tell_frame.run_if(prints_all));
        if app.world().get_resource::<PrintAll>().is_some_and(|print_all| print_all.0) {
            told::tell_pipelines(app);
        }
    }
}

fn prints_all(print_all: Res<PrintAll>) -> bool {
    print_all.0
}

/// Reports when the ground's textures have loaded, and it is visible.
fn print_look(
    shown: Query<(), (With<Tile>, With<MeshMaterial3d<GroundMaterial>>)>,
    textures: Res<GroundLoading>,
    mut is_printed: Local<bool>,
) {
    if !*is_printed && !shown.is_empty() && textures.is_ready() {
        *is_printed = true;
        println!("dressed");
    }
}

fn print_receipts(mut receipts: MessageReader<BrushApplied>, terrains: Query<&Terrain>) {
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

fn print_steps(mut moves: MessageReader<HistoryMoved>, terrains: Query<&Terrain>) {
    for HistoryMoved { terrain, receipt } in moves.read() {
        let name = receipt.kind;
        let terrain = terrain.and_then(|terrain| terrains.get(terrain).ok());
        let hash = terrain.map_or(0, |terrain| terrain.world().hash());
        match &receipt.outcome {
            Ok(restored) => {
                let (removed, added) = (restored.removed.total(), restored.added.total());
                println!("{name} removed={removed} added={added} hash={hash:016x}");
            }
            Err(why) => println!("{name} rejected: {why}"),
        }
    }
}

fn print_tool(tool: Res<BrushTool>) {
    if tool.is_changed() {
        println!(
            "tool operation={:?} shape={:?} radius={:.2} material={} stamp={:?} placed={}",
            tool.operation,
            tool.shape,
            tool.radius,
            tool.material,
            tool.stamp.name.as_deref().unwrap_or_default(),
            tool.placed.map_or("no".into(), |hit| format!("{:.2}", hit.position))
        );
    }
}

/// Prints the positions of the panel's widgets whenever they change; `tools/drive.py` clicks on them.
fn print_places(places: Res<PanelPlaces>, print_all: Res<PrintAll>) {
    if !print_all.0 || !places.is_changed() {
        return;
    }
    for (name, place) in &places.0 {
        println!(
            "place {name:?} {:.0} {:.0} {:.0} {:.0}",
            place.min.x, place.min.y, place.max.x, place.max.y
        );
    }
}

/// Whether frames, pipelines and positions are printed. Must be inserted before [`JournalPlugin`].
#[derive(Resource, Default)]
pub struct PrintAll(pub bool);
