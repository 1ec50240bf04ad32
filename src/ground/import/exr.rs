//! Heights from OpenEXR files of one channel.

use std::io::Cursor;

use ::exr::meta::MetaData;
use ::exr::prelude::*;

use super::decoded::{Decoded, damaged, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;

const FORMAT: HeightFormat = HeightFormat::Exr;

/// Names that programs give to the channel of heights next to others, best first.
const NAMED: [&str; 3] = ["height", "Height", "Z"];

/// Decodes the first layer of an EXR file.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> std::result::Result<Decoded, ImportError> {
    let failed = |error: ::exr::error::Error| damaged(FORMAT, error);
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(failed)?;
    check(&meta, limits)?;
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = reader.all_attributes().non_parallel().from_buffered(Cursor::new(bytes)).map_err(failed)?;
    let layer = image.layer_data;
    let (width, height) = (side(layer.size.0), side(layer.size.1));
    limits.check_image(width, height, 4)?;
    let mut channels = layer.channel_data.list;
    let (chosen, mut notes) = choose_channel(&channels, width)?;
    let data = channels.swap_remove(chosen).sample_data;
    drop(channels);
    let sample = match &data {
        FlatSamples::F16(_) => SampleKind::Float(16),
        FlatSamples::F32(_) => SampleKind::Float(32),
        FlatSamples::U32(_) => SampleKind::Unsigned(32),
    };
    let samples = floats(data, &mut notes)?;
    if samples.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(damaged(FORMAT, "it ends too early"));
    }
    if meta.headers.len() > 1 {
        notes.push(ImportNote::FirstOfSeveral);
    }
    Ok(Decoded { notes, ..Decoded::new(FORMAT, sample, (width, height), samples) })
}

/// A side of an image; the greatest number if it is longer.
fn side(side: usize) -> u32 {
    u32::try_from(side).unwrap_or(u32::MAX)
}

/// Checks that the file can be decoded within the limits. All layers are checked, as the decoder reserves memory for
/// them.
fn check(meta: &MetaData, limits: &ImageLimits) -> std::result::Result<(), ImportError> {
    let header = meta.headers.first().ok_or(ImportError::Empty)?;
    if meta.headers.iter().any(|header| header.deep) {
        return Err(damaged(FORMAT, "it holds deep data"));
    }
    for header in &meta.headers {
        let channels = header.channels.list.len().max(1) as u64;
        limits.check_image(side(header.layer_size.0), side(header.layer_size.1), 4 + 4 * channels)?;
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(damaged(FORMAT, "its channels are subsampled"));
    }
    Ok(())
}

/// Chooses the channel of heights, and notes what is ignored. `width` is that of the image.
fn choose_channel(
    channels: &[AnyChannel<FlatSamples>],
    width: u32,
) -> std::result::Result<(usize, Vec<ImportNote>), ImportError> {
    let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
    let mut notes = Vec::new();
    let find = |name: &str| names.iter().position(|own| own == name);
    // Colours do not matter next to a channel that is named as one of heights.
    let named = NAMED.iter().find_map(|name| find(name));
    if named.is_none()
        && let (Some(r), Some(g), Some(b)) = (find("R"), find("G"), find("B"))
    {
        let differs = |index: &usize| {
            let value = |channel: usize| value(&channels[channel].sample_data, *index).to_bits();
            value(r) != value(g) || value(r) != value(b)
        };
        if let Some(index) = (0..channels[r].sample_data.len()).find(differs) {
            let index = u32::try_from(index).unwrap_or(u32::MAX);
            let (x, z) = (index % width, index / width);
            return Err(ImportError::Colour { format: FORMAT, x, z });
        }
        notes.push(ImportNote::GreyAsColour);
    }
    let without_alpha = || (0..names.len()).filter(|&index| names[index] != "A");
    let chosen = match without_alpha().count() {
        0 => return Err(channel_error(&names)),
        1 => without_alpha().next(),
        3 if !notes.is_empty() => find("R"),
        _ => named,
    };
    let chosen = chosen.ok_or_else(|| channel_error(&names))?;
    if find("A").is_some_and(|alpha| alpha != chosen) {
        notes.push(ImportNote::AlphaIgnored);
    }
    let others: Vec<&str> = without_alpha().filter(|&o| o != chosen).map(|o| names[o].as_str()).collect();
    if named.is_some() && !others.is_empty() {
        notes.push(ImportNote::ChannelsIgnored { names: others.join(", "), read: names[chosen].clone() });
    }
    Ok((chosen, notes))
}

/// The samples as floats, with a note if some were rounded.
fn floats(data: FlatSamples, notes: &mut Vec<ImportNote>) -> std::result::Result<Vec<f32>, ImportError> {
    match data {
        FlatSamples::F32(samples) => Ok(samples),
        FlatSamples::F16(half) => {
            let mut samples = reserve(half.len() as u64)?;
            samples.extend(half.iter().map(|value| value.to_f32()));
            Ok(samples)
        }
        FlatSamples::U32(integers) => {
            if integers.iter().any(|&value| f64::from(value as f32) != f64::from(value)) {
                notes.push(ImportNote::Rounded);
            }
            let mut samples = reserve(integers.len() as u64)?;
            samples.extend(integers.iter().map(|&value| value as f32));
            Ok(samples)
        }
    }
}

fn channel_error(names: &[String]) -> ImportError {
    ImportError::Channels { format: FORMAT, found: names.join(", ") }
}

fn value(data: &FlatSamples, index: usize) -> f32 {
    match data {
        FlatSamples::F16(values) => values[index].to_f32(),
        FlatSamples::F32(values) => values[index],
        FlatSamples::U32(values) => values[index] as f32,
    }
}
