//! The roads from the mesh kernel to a picture, timed in turns.

use std::error::Error;
use std::time::Instant;

use bevy_burrow::backend::interop::{InteropError, SharedBuffer, SharedCard, Surfaces};

use super::Arguments;
use super::painter::{Painter, SIDES};
use super::scene::{Reference, scenes};
use super::statistics::Sample;

/// How surfaces get to a picture.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Road {
    /// To the host, and up again.
    Host,
    /// Copied by CUDA into a buffer that is drawn.
    Shared,
    /// The same, and copied by Vulkan from there into a buffer that is drawn: the way without `unsafe`.
    Copied,
}

impl Road {
    const ALL: [Self; 3] = [Self::Host, Self::Shared, Self::Copied];

    fn name(self) -> &'static str {
        match self {
            Self::Host => "through the host",
            Self::Shared => "shared buffer",
            Self::Copied => "shared, copied once more",
        }
    }
}

/// What the parts of a road are called.
const PARTS: [&str; 5] = ["download", "upload", "CUDA copy", "Vulkan copy", "draw"];

/// Times of one road: its parts, and all of it.
#[derive(Default)]
struct Times {
    parts: [Sample; PARTS.len()],
    whole: Sample,
}

/// Rounds that warm everything up.
const WARM_UP: u16 = 4;

/// Buffers that are drawn from: one for each road, so that none draws what another one brought.
struct Buffers {
    host: wgpu::Buffer,
    shared: SharedBuffer,
    between: SharedBuffer,
    copied: wgpu::Buffer,
}

pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let scenes = scenes();
    let blocks = scenes.iter().map(|scene| scene.blocks.len()).max().unwrap_or(0);
    let bytes = scenes.iter().map(|scene| scene.surfaces.layout().bytes()).max().unwrap_or(0);
    let mut painter = Painter::new(blocks)?;
    let host = painter.surface_buffer(bytes);

    let mut references = Vec::new();
    for scene in &scenes {
        let Reference { positions, normals, indices, ranges } = &scene.surfaces;
        let layout = scene.surfaces.layout();
        painter.list(&scene.blocks, ranges.iter().copied(), &layout);
        painter.upload(&host, &layout, positions, normals, indices);
        painter.draw(&host, &layout)?;
        references.push(painter.pixels()?);
    }
    if arguments.reference {
        save(arguments, &references[0])?;
        println!("{}: the processor's surfaces, drawn", painter.name);
        return Ok(());
    }

    let mut card = SharedCard::open(&painter.device, &painter.queue).map_err(|error| match error {
        InteropError::NoCard(_) => format!("{}: {error}", painter.name),
        error => error.to_string(),
    })?;
    println!("{} in Vulkan, {} in CUDA", painter.name, card.name());
    let mut buffers = Buffers {
        shared: card.share(bytes)?,
        between: card.share(bytes)?,
        copied: painter.surface_buffer(bytes),
        host,
    };

    let mut times = Road::ALL.map(|_| Times::default());
    let [mut meshing, mut listing] = [(); 2].map(|()| Sample::default());
    let mut discarded = Times::default();
    let mut pixels = Vec::new();
    for round in 0..WARM_UP + arguments.rounds {
        // What a buffer holds from the round before is another world's.
        let number = usize::from(round) % scenes.len();
        let scene = &scenes[number];
        let is_timed = round >= WARM_UP;
        let start = Instant::now();
        let mut surfaces = card.mesh(&scene.world.view(), &scene.blocks)?;
        let meshed = Instant::now();
        painter.list(&scene.blocks, surfaces.ranges(), &surfaces.layout());
        painter.settle()?;
        if is_timed {
            meshing.push((meshed - start).as_secs_f64());
            listing.push(meshed.elapsed().as_secs_f64());
        } else {
            compare(&mut surfaces, &scene.surfaces)?;
        }
        for turn in 0..Road::ALL.len() {
            let at = (turn + usize::from(round)) % Road::ALL.len();
            let kept = if is_timed { &mut times[at] } else { &mut discarded };
            go(Road::ALL[at], &mut surfaces, &painter, &mut buffers, kept)?;
            pixels = painter.pixels()?;
            if pixels != references[number] {
                return Err(format!("{}, round {round}: another picture", Road::ALL[at].name()).into());
            }
        }
    }
    save(arguments, &pixels)?;

    let surfaces = &scenes[1].surfaces;
    println!(
        "{} blocks, {} vertices, {} indices, {:.1} MB",
        blocks,
        surfaces.positions.len(),
        surfaces.indices.len(),
        bytes as f64 / 1e6
    );
    println!("all surfaces are the processor's, bit by bit, and all pictures, pixel by pixel");
    println!("us, medians of {} rounds, after", arguments.rounds);
    println!("  meshing, with counts on the host {:>9.0}", meshing.median() * 1e6);
    println!("  the list of draws                {:>9.0}", listing.median() * 1e6);
    let names = PARTS.map(|part| format!("{part:>13}")).concat();
    println!("  {:<26}{names}{:>13}{:>13}", "", "whole", "before draw");
    for (road, times) in Road::ALL.iter().zip(&times) {
        let part = |sample: &Sample| match sample.len() {
            0 => format!("{:>13}", "-"),
            _ => format!("{:>13.0}", sample.median() * 1e6),
        };
        let (whole, draw) = (times.whole.median() * 1e6, times.parts[4].median() * 1e6);
        let parts = times.parts.each_ref().map(part).concat();
        println!("  {:<26}{parts}{whole:>13.0}{:>13.0}", road.name(), whole - draw);
    }
    Ok(())
}

/// Brings surfaces to where they are drawn from, and draws them.
fn go(
    road: Road,
    surfaces: &mut Surfaces,
    painter: &Painter,
    buffers: &mut Buffers,
    times: &mut Times,
) -> Result<(), Box<dyn Error>> {
    let (start, layout) = (Instant::now(), surfaces.layout());
    let mut last = start;
    let mut lap = |part: usize| {
        let now = Instant::now();
        times.parts[part].push((now - last).as_secs_f64());
        last = now;
    };
    let target = match road {
        Road::Host => {
            let lists = surfaces.download()?;
            lap(0);
            painter.upload(&buffers.host, &layout, lists.positions, lists.normals, lists.indices);
            painter.settle()?;
            lap(1);
            &buffers.host
        }
        Road::Shared => {
            surfaces.write(&mut buffers.shared)?;
            lap(2);
            // SAFETY: there is no other thread, and nothing is submitted while the buffer is written.
            unsafe { buffers.shared.buffer() }
        }
        Road::Copied => {
            surfaces.write(&mut buffers.between)?;
            lap(2);
            buffers.between.copy_to(0..layout.bytes(), &buffers.copied, 0);
            painter.settle()?;
            lap(3);
            &buffers.copied
        }
    };
    painter.draw(target, &layout)?;
    lap(4);
    times.whole.push((last - start).as_secs_f64());
    Ok(())
}

/// Are the surfaces of all blocks those that the processor made? Where they stand in the lists may differ.
fn compare(surfaces: &mut Surfaces, expected: &Reference) -> Result<(), Box<dyn Error>> {
    let ranges: Vec<_> = surfaces.ranges().collect();
    let lists = surfaces.download()?;
    let range = |first: u32, count: u32| first as usize..(first + count) as usize;
    for (number, (own, other)) in ranges.iter().zip(&expected.ranges).enumerate() {
        if (own.vertices, own.indices) != (other.vertices, other.indices) {
            return Err(format!("block {number} has another size").into());
        }
        let [a, b] = [own, other].map(|block| range(block.vertex, block.vertices));
        let [i, j] = [own, other].map(|block| range(block.index, block.indices));
        let is_same = lists.positions[a.clone()] == expected.positions[b.clone()]
            && bytemuck::cast_slice::<_, u32>(&lists.normals[a])
                == bytemuck::cast_slice::<_, u32>(&expected.normals[b])
            && lists.indices[i] == expected.indices[j];
        if !is_same {
            return Err(format!("block {number} differs").into());
        }
    }
    Ok(())
}

fn save(arguments: &Arguments, pixels: &[u8]) -> Result<(), Box<dyn Error>> {
    let ([width, height], picture) = (SIDES, &arguments.picture);
    if let Some(folder) = picture.parent() {
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    Ok(image::save_buffer(picture, pixels, width, height, image::ColorType::Rgba8)?)
}
