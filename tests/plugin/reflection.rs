//! Messages are reflected, so that editors and Bevy's remote protocol can dig.

use bevy::ecs::reflect::ReflectMessage;
use bevy::prelude::*;
use bevy::reflect::TypeRegistration;
use bevy::reflect::serde::TypedReflectDeserializer;
use bevy_burrow::prelude::*;
use serde::de::DeserializeSeed;

use crate::stage::{Stage, dig, level};

/// Does what Bevy's remote protocol does for `world.write_message`.
fn write(stage: &mut Stage, message: &str, value: serde_json::Value) {
    let registry = stage.app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let registration: &TypeRegistration = registry.get_with_type_path(message).expect("it is registered");
    let reflected: &ReflectMessage = registration.data().expect("it is a message");
    let value =
        TypedReflectDeserializer::new(registration, &registry).deserialize(value).expect("it is valid");
    reflected.write_message(stage.app.world_mut(), value.as_ref(), &registry);
}

#[test]
fn brushes_undos_and_redos_can_be_written_by_their_names() {
    let mut stage = Stage::server().recording::<HistoryMoved>();
    let terrain = stage.show(level(1.0));
    let mut model = level(1.0);
    let before = model.world().hash();
    model.apply([dig(30.0, 8.0, 20.0, 4.0)]);
    let brush = serde_json::json!(
        {"shape": "sphere", "center": [30, 8, 20], "radius": 4, "op": "dig", "tag": 7}
    );
    write(&mut stage, "bevy_burrow::brush::request::Brush", brush.clone());
    stage.settle();
    assert_eq!((stage.hash(terrain), stage.tags()), (model.world().hash(), vec![7]));
    let undo = serde_json::json!({ "terrain": null });
    write(&mut stage, "bevy_burrow::plugin::messages::Undo", undo.clone());
    stage.settle();
    assert_eq!(stage.hash(terrain), before);
    write(&mut stage, "bevy_burrow::plugin::messages::Redo", undo);
    stage.settle();
    assert_eq!(stage.hash(terrain), model.world().hash());
    let targeted = serde_json::json!({ "terrain": terrain.to_bits(), "brush": brush });
    write(&mut stage, "bevy_burrow::plugin::messages::TargetedBrush", targeted);
    stage.settle();
    assert_eq!(stage.tags(), [7, 7]);
}

#[test]
fn all_messages_are_registered_as_messages() {
    let stage = Stage::server();
    let registry = stage.app.world().resource::<AppTypeRegistry>().read();
    let is_message = |registration: Option<&TypeRegistration>| {
        registration.is_some_and(|registration| registration.data::<ReflectMessage>().is_some())
    };
    macro_rules! check {
        ($($message:ty)*) => {
            $(assert!(
                is_message(registry.get(std::any::TypeId::of::<$message>())),
                stringify!($message)
            );)*
        };
    }
    check!(Brush TargetedBrush BrushApplied Undo Redo HistoryMoved LoosePieceFound);
}
