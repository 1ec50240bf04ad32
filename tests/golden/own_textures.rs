//! The ground is drawn with a game's own textures, and the crate's own ones can be restored.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_burrow::prelude::*;

use crate::album::{Album, flip};
use crate::landscape::hills;
use crate::studio::Studio;

/// The number of layers that the default look names.
const LAYERS: usize = 16;

/// Textures of a single colour, with all mip levels.
fn plain(studio: &mut Studio, texel: [u8; 4]) -> GroundTextures {
    let size = Extent3d { width: 16, height: 16, ..default() };
    let (format, usage) = (TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::default());
    let albedo = Image::new_fill(size, TextureDimension::D2, &texel, format, usage);
    let layers = vec![GroundLayerImages { albedo, ..default() }; LAYERS];
    let arrays = GroundArrays::pack(layers).expect("plain pictures fit");
    arrays.add_to(&mut studio.app.world_mut().resource_mut::<Assets<Image>>())
}

/// Draws the ground with these textures from now on.
pub fn set_textures(studio: &mut Studio, textures: GroundTextures) {
    studio.app.world_mut().insert_resource(textures);
    studio.app.update();
    studio.until("textures", |app| app.world().resource::<GroundLoading>().is_ready());
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    studio.terrain(hills(64), GroundLook::default());
    let middle = Vec3::new(32.0, studio.height(32.0, 32.0), 32.0);
    studio.apply([Brush::dig(Shape::sphere(middle, 5.0))]);
    studio.look(middle + Vec3::new(4.0, 12.0, 6.0), middle);
    let own = studio.app.world().resource::<GroundTextures>().clone();
    let before = studio.picture();
    let textures = plain(studio, [200, 20, 200, 128]);
    set_textures(studio, textures);
    let mauve = studio.picture();
    let is_mauve = |texel: &&image::Rgb<u8>| {
        let [red, green, blue] = texel.0.map(u32::from);
        red.min(blue) > green + 8 && red.abs_diff(blue) < 100
    };
    let share = mauve.pixels().filter(is_mauve).count() as f32 / mauve.pixels().len() as f32;
    println!("a game's own textures: {:.1} % of the picture has their colour", 100.0 * share);
    album.check(share > 0.99, || {
        format!("only {share} of the picture has the colour of the game's own textures")
    });
    set_textures(studio, own);
    let (apart, _) = flip(&before, &studio.picture());
    album.check(apart < 1e-4, || format!("the crate's own textures were not restored: FLIP {apart:.5}"));
}
