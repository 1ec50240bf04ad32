//! A colour map tints distant ground as the picture has it, but neither near ground nor dug faces.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_burrow::prelude::*;
use bevy_burrow::view::ColorMap;
use image::RgbImage;

use crate::album::{Album, flip};
use crate::studio::Studio;

const SIDE: u32 = 64;

/// A picture whose half towards x = 0 is red, and whose other half is blue.
fn halves(studio: &mut Studio) -> Handle<Image> {
    let texels = (0..SIDE * SIDE)
        .flat_map(|at| if at % SIDE < SIDE / 2 { [220, 0, 0, 255] } else { [0, 0, 220, 255] });
    let size = Extent3d { width: SIDE, height: SIDE, ..default() };
    let (format, usage) = (TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::default());
    let image = Image::new(size, TextureDimension::D2, texels.collect(), format, usage);
    studio.app.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// The shares of red and blue in a part of a picture.
fn shares(picture: &RgbImage, left: f32, right: f32) -> [f32; 2] {
    let width = picture.width() as f32;
    let part: Vec<&image::Rgb<u8>> = picture
        .enumerate_pixels()
        .filter(|(x, y, _)| (left..right).contains(&(*x as f32 / width)) && *y > picture.height() / 4)
        .map(|(.., texel)| texel)
        .collect();
    let share = |is: fn(i32, i32) -> bool| {
        let count = part.iter().filter(|texel| is(i32::from(texel.0[0]), i32::from(texel.0[2]))).count();
        count as f32 / part.len() as f32
    };
    [share(|red, blue| red > blue + 30), share(|red, blue| blue > red + 30)]
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let ground = Ground::flat(SIDE, SIDE, 10.0).expect("valid ground");
    studio.terrain(ground, GroundLook::default());
    let middle = Vec3::new(32.0, 10.0, 32.0);
    // Looking along z: x runs to the left.
    studio.look(middle + Vec3::new(0.0, 45.0, -20.0), middle);
    let before = studio.picture();
    let image = halves(studio);
    let show = |studio: &mut Studio, distance| {
        let map = ColorMap { distance, ..ColorMap::new(image.clone()) };
        studio.one::<GroundLook>().color_map = Some(map);
        studio.picture()
    };
    let far = show(studio, (0.0, 1.0));
    let (right, left) = (shares(&far, 0.1, 0.45), shares(&far, 0.55, 0.9));
    println!("colour map: red and blue on the right {left:?}, on the left {right:?}");
    album.check(left[0] > 0.95 && right[1] > 0.95, || format!("the map lies elsewhere: {left:?}, {right:?}"));
    let near = show(studio, (500.0, 600.0));
    let (apart, _) = flip(&before, &near);
    album.check(apart < 0.002, || format!("near ground has the colours of the map: FLIP {apart:.5}"));

    // A wide pit shows what it was dug in.
    studio.apply([Brush::dig(Shape::cuboid(middle, Vec3::new(24.0, 5.0, 24.0)))]);
    let pit = show(studio, (0.0, 1.0));
    let inside = [shares(&pit, 0.35, 0.48), shares(&pit, 0.52, 0.65)];
    let most = inside.iter().flatten().fold(0.0f32, |most, share| most.max(*share));
    println!("colour map: in a pit {inside:?}");
    album.check(most < 0.25, || format!("dug ground has the colours of the map: {inside:?}"));
    studio.one::<GroundLook>().color_map = None;
}
