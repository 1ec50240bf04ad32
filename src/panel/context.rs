//! Keeps egui's primary context on a camera: reassigns it when its camera is gone.

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy_egui::input::WindowToEguiContextMap;
use bevy_egui::{
    EguiContext, EguiGlobalSettings, EguiPreUpdateSet, PrimaryEguiContext, setup_primary_egui_context_system,
};

/// Adds the system that reassigns the primary context, if bevy_egui may create it. It runs before bevy_egui handles
/// new contexts.
pub(super) fn add_reassignment(app: &mut App) {
    app.add_systems(
        PreUpdate,
        reassign_primary_context
            .run_if(|settings: Res<EguiGlobalSettings>| settings.auto_create_primary_context)
            .after(setup_primary_egui_context_system)
            .before(WindowToEguiContextMap::on_egui_context_added_system)
            .in_set(EguiPreUpdateSet::InitContexts),
    );
}

/// Gives the primary context to another camera when its camera is gone. The first assignment is left to bevy_egui,
/// which does it only once and does not support two primary contexts.
fn reassign_primary_context(
    mut commands: Commands,
    contexts: Query<(), With<PrimaryEguiContext>>,
    cameras: Query<(Entity, &Camera, &RenderTarget), Without<EguiContext>>,
    mut was_there: Local<bool>,
) {
    if !contexts.is_empty() {
        *was_there = true;
    } else if *was_there {
        let shown = |(_, camera, target): &(Entity, &Camera, &RenderTarget)| {
            camera.is_active && matches!(target, RenderTarget::Window(_))
        };
        let next = cameras.iter().filter(shown).min_by_key(|(entity, camera, _)| (camera.order, *entity));
        if let Some((camera, ..)) = next {
            commands.entity(camera).try_insert(PrimaryEguiContext);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An app with the part of bevy_egui that assigns the context.
    fn app() -> App {
        let mut app = App::new();
        app.init_resource::<EguiGlobalSettings>().add_systems(
            PreUpdate,
            setup_primary_egui_context_system
                .run_if(|settings: Res<EguiGlobalSettings>| settings.auto_create_primary_context),
        );
        add_reassignment(&mut app);
        app
    }

    fn spawn(app: &mut App, camera: Camera) -> Entity {
        app.world_mut().spawn(camera).id()
    }

    /// The cameras with the primary context after the next frame.
    fn owners(app: &mut App) -> Vec<Entity> {
        app.update();
        let world = app.world_mut();
        world.query_filtered::<Entity, With<PrimaryEguiContext>>().iter(world).collect()
    }

    #[test]
    fn another_camera_with_a_window_draws_the_panel_when_the_first_is_gone() {
        let mut app = app();
        assert!(owners(&mut app).is_empty());
        let menu = spawn(&mut app, Camera::default());
        assert_eq!(owners(&mut app), [menu]);
        let image = RenderTarget::Image(Handle::<Image>::default().into());
        app.world_mut().spawn((Camera::default(), image));
        spawn(&mut app, Camera { is_active: false, ..default() });
        let map = spawn(&mut app, Camera { order: 1, ..default() });
        let game = spawn(&mut app, Camera::default());
        assert_eq!(owners(&mut app), [menu]);
        for (gone, next) in [(menu, vec![game]), (game, vec![map]), (map, vec![])] {
            app.world_mut().despawn(gone);
            assert_eq!(owners(&mut app), next);
        }
        let late = spawn(&mut app, Camera::default());
        assert_eq!(owners(&mut app), [late]);
    }

    #[test]
    fn a_game_that_gives_contexts_itself_is_left_alone() {
        let mut app = app();
        let first = spawn(&mut app, Camera::default());
        assert_eq!(owners(&mut app), [first]);
        app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
        app.world_mut().despawn(first);
        let second = spawn(&mut app, Camera::default());
        assert!(owners(&mut app).is_empty());
        app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = true;
        assert_eq!(owners(&mut app), [second]);
    }
}
