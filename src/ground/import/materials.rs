//! Materials from pictures: splat maps, whose channels are weights, and id maps, whose samples are materials.

use std::fmt;
use std::path::Path;

use ::png::ColorType;

use super::decoded::damaged;
use super::error::ImportError;
use super::kind::HeightFormat;
use super::open::read_file;
use crate::ground::png::{Png, SIGNATURE};
use crate::ground::{ColumnMaterial, ImageLimits, MaterialId, MaterialMap};

/// The maximum number of layers of splat maps.
pub const MAX_LAYERS: usize = 16;

/// The layers of splat maps.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SplatOptions {
    /// The material of each channel of all files, one after the other: red, green, blue and alpha, or the grey of a
    /// file with one channel. `None` ignores a channel. At most [`MAX_LAYERS`] have a material.
    pub layers: Vec<Option<MaterialId>>,
    /// The material below the surface. `None`: the strongest layer goes all the way down, and blends with the second
    /// strongest on the surface.
    pub deep: Option<MaterialId>,
    /// The largest files that are read.
    pub limits: ImageLimits,
}

impl SplatOptions {
    /// Options with these materials, one for each channel.
    pub fn of(layers: impl IntoIterator<Item = MaterialId>) -> Self {
        Self { layers: layers.into_iter().map(Some).collect(), ..Self::default() }
    }

    /// The material of a channel, counted over all files.
    fn layer(&self, channel: usize) -> Option<MaterialId> {
        self.layers.get(channel).copied().flatten()
    }

    /// What was ignored or looks wrong in files. `channels` are the files of all channels, and their numbers there;
    /// `weighted` are the samples in which each has weight.
    fn notes(&self, maps: &[Weights], channels: &[(usize, usize)], weighted: &[u64]) -> Vec<MaterialNote> {
        let mut notes = Vec::new();
        for (file, map) in maps.iter().enumerate() {
            match map.pixels.color {
                ColorType::GrayscaleAlpha => notes.push(MaterialNote::AlphaIgnored { file }),
                ColorType::Rgba => {
                    let channel = channels.iter().position(|own| *own == (file, 3)).unwrap_or_default();
                    let pixels = map.pixels.width as usize * map.pixels.height as usize;
                    let is_full = || (0..pixels).all(|pixel| map.weight(pixel, 3) == u16::MAX);
                    if self.layer(channel).is_some() && is_full() {
                        notes.push(MaterialNote::LooksOpaque { file });
                    }
                }
                _ => {}
            }
        }
        for (channel, &count) in weighted.iter().enumerate() {
            // The alpha channel of a picture without layers in it is full.
            let is_alpha = channels[channel].1 == 3;
            match self.layer(channel) {
                Some(_) if count == 0 => notes.push(MaterialNote::LayerEmpty { channel }),
                None if count > 0 && !is_alpha => notes.push(MaterialNote::LayerMissing { channel, count }),
                _ => {}
            }
        }
        notes
    }
}

/// The meaning of the samples of an id map.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdOptions {
    /// The material of each id. An id is the grey of a sample, or the entry of a palette, as the file has it. Without
    /// any, the id is the material itself.
    pub ids: Vec<(u16, MaterialId)>,
    /// The material of each colour, for files with colours; exactly these.
    pub colours: Vec<([u8; 3], MaterialId)>,
    /// The material below the surface. `None`: that of the sample.
    pub deep: Option<MaterialId>,
    /// The largest file that is read.
    pub limits: ImageLimits,
}

/// What was read from material maps. [`Display`](fmt::Display) gives it as text, a line for each note.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct MaterialReport {
    /// Samples in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channels and bits of each file.
    pub files: Vec<(usize, u8)>,
    /// The samples that show each material, without those that none shows; by material.
    pub samples: Vec<(MaterialId, u64)>,
    /// What was ignored or looks wrong.
    pub notes: Vec<MaterialNote>,
}

/// Something that was ignored or looks wrong in material maps.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MaterialNote {
    /// An alpha channel was ignored.
    AlphaIgnored {
        /// The file's place in the list.
        file: usize,
    },
    /// The alpha channel of a file is full everywhere, and outweighs every other layer.
    LooksOpaque {
        /// The file's place in the list.
        file: usize,
    },
    /// Samples without any weight got the first layer.
    NoWeight {
        /// Number of such samples.
        count: u64,
        /// Column of the first one.
        x: u32,
        /// Row of the first one.
        z: u32,
    },
    /// A channel without a layer has weight.
    LayerMissing {
        /// Number of the channel, from 0, over all files.
        channel: usize,
        /// Samples with weight in it.
        count: u64,
    },
    /// A layer has weight nowhere.
    LayerEmpty {
        /// Number of the channel, from 0, over all files.
        channel: usize,
    },
}

impl fmt::Display for MaterialNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlphaIgnored { file } => write!(f, "the alpha channel of file {file} was ignored"),
            Self::LooksOpaque { file } => write!(
                f,
                "the alpha channel of file {file} is full everywhere: if it is not a layer, name `None` for it"
            ),
            Self::NoWeight { count, x, z } => {
                write!(f, "{count} samples have no weight, first ({x}, {z}): they got the first layer")
            }
            Self::LayerMissing { channel, count } => {
                write!(f, "channel {channel} has weight in {count} samples, but no layer: it was ignored")
            }
            Self::LayerEmpty { channel } => {
                write!(f, "the layer of channel {channel} has no weight anywhere")
            }
        }
    }
}

impl fmt::Display for MaterialReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {} samples", self.width, self.height)?;
        for (channels, bits) in &self.files {
            write!(f, "; {channels} channels of {bits} bits")?;
        }
        self.samples.iter().try_for_each(|(MaterialId(id), count)| write!(f, "; material {id}: {count}"))?;
        self.notes.iter().try_for_each(|note| write!(f, "\n- {note}"))
    }
}

/// A decoded PNG with samples as the file has them.
struct Pixels {
    width: u32,
    height: u32,
    color: ColorType,
    bits: u8,
    palette: Vec<[u8; 3]>,
    /// All channels of a pixel, then those of the next one.
    samples: Vec<u16>,
}

impl Pixels {
    fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Self, ImportError> {
        limits.check_file(bytes)?;
        if bytes.is_empty() {
            return Err(ImportError::Empty);
        }
        if !bytes.starts_with(SIGNATURE) {
            return Err(ImportError::MapFormat);
        }
        // Up to four channels of 16 bits.
        let mut png = Png::open(bytes, limits, 8)?;
        let (width, height, color, bits) = (png.width, png.height, png.color, png.bits);
        let (palette, mut samples) = (std::mem::take(&mut png.palette), Vec::new());
        let count = width as usize * height as usize * color.samples();
        samples.try_reserve_exact(count).map_err(|_| ImportError::Memory { bytes: count as u64 * 2 })?;
        png.read(|_, row| {
            samples.extend_from_slice(row);
            Ok::<_, ImportError>(())
        })?;
        Ok(Self { width, height, color, bits, palette, samples })
    }

    /// The place of a pixel.
    fn place(&self, index: usize) -> (u32, u32) {
        let index = index as u32;
        (index % self.width, index / self.width)
    }
}

/// The weights of a file: its channels without those that are not weights.
struct Weights {
    pixels: Pixels,
    channels: usize,
}

impl Weights {
    fn of(pixels: Pixels) -> Result<Self, ImportError> {
        let channels = match pixels.color {
            ColorType::Grayscale | ColorType::GrayscaleAlpha => 1,
            ColorType::Rgb => 3,
            ColorType::Rgba => 4,
            ColorType::Indexed => return Err(ImportError::MapPalette),
        };
        Ok(Self { pixels, channels })
    }

    /// The weight of a channel of a pixel, 0 to 65535.
    fn weight(&self, pixel: usize, channel: usize) -> u16 {
        let most = (1 << self.pixels.bits) - 1;
        let sample = u32::from(self.pixels.samples[pixel * self.pixels.color.samples() + channel]);
        (sample * (65_535 / most)) as u16
    }
}

fn check(materials: impl IntoIterator<Item = MaterialId>) -> Result<(), ImportError> {
    if materials.into_iter().any(|material| material == MaterialId::GROUND) {
        let allowed = "0 to 254, as 255 means whatever the ground has";
        return Err(ImportError::Option { name: "material", value: 255.0, allowed });
    }
    Ok(())
}

/// Decodes the weights of files, which must have one size.
fn decode_weights<B: AsRef<[u8]>>(files: &[B], options: &SplatOptions) -> Result<Vec<Weights>, ImportError> {
    let mut maps: Vec<Weights> = Vec::with_capacity(files.len());
    for (file, bytes) in files.iter().enumerate() {
        let map = Weights::of(Pixels::decode(bytes.as_ref(), &options.limits)?)?;
        let (width, height) = (map.pixels.width, map.pixels.height);
        let first = maps.first().map_or((width, height), |map| (map.pixels.width, map.pixels.height));
        if (width, height) != first {
            return Err(ImportError::MapSize { file, width, height, first });
        }
        maps.push(map);
    }
    Ok(maps)
}

/// The column of a sample with these two strongest layers, over the material below the surface if one is named.
fn blend(
    [(most, strongest), (next, second)]: [(u16, MaterialId); 2],
    deep: Option<MaterialId>,
) -> ColumnMaterial {
    match deep {
        Some(base) => ColumnMaterial { base, overlay: strongest, blend: 255 },
        None if next == 0 => ColumnMaterial::solid(strongest),
        None => {
            // At most 127, so the strongest remains the one that the ground is made of.
            let blend = u32::from(next) * 255 / (u32::from(most) + u32::from(next));
            ColumnMaterial { base: strongest, overlay: second, blend: blend as u8 }
        }
    }
}

/// How many samples show each material.
fn count(columns: &[ColumnMaterial]) -> Vec<(MaterialId, u64)> {
    let mut counts = [0_u64; 256];
    columns.iter().for_each(|column| counts[usize::from(column.skin().0)] += 1);
    let all = counts.into_iter().enumerate().filter(|(_, count)| *count > 0);
    all.map(|(id, count)| (MaterialId(id as u8), count)).collect()
}

impl MaterialMap {
    /// Reads splat maps from PNG files: see [`Self::decode_splats`].
    ///
    /// # Errors
    /// [`ImportError`]
    pub fn open_splats<P: AsRef<Path>>(
        paths: impl IntoIterator<Item = P>,
        options: &SplatOptions,
    ) -> Result<(Self, MaterialReport), ImportError> {
        let read = |path: P| read_file(path.as_ref(), &options.limits);
        let files = paths.into_iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Self::decode_splats(&files, options)
    }

    /// Decodes splat maps: PNG files of one size, whose channels are the weights of layers, up to 16 of them. Files
    /// with one channel are masks of one layer, and an alpha channel next to grey is ignored.
    ///
    /// Each sample shows the layer with the greatest weight, of equal ones the first. Weights need not sum up to
    /// anything, and files may have 8 and 16 bits; all of it is computed in integers.
    ///
    /// # Errors
    /// [`ImportError`]: damaged files, files of several sizes, layers that are more than the channels.
    pub fn decode_splats<B: AsRef<[u8]>>(
        files: &[B],
        options: &SplatOptions,
    ) -> Result<(Self, MaterialReport), ImportError> {
        check(options.layers.iter().flatten().copied().chain(options.deep))?;
        Self::of_weights(&decode_weights(files, options)?, options)
    }

    /// The map of the strongest layers, from the weights of all files.
    fn of_weights(maps: &[Weights], options: &SplatOptions) -> Result<(Self, MaterialReport), ImportError> {
        let Some((width, height)) = maps.first().map(|map| (map.pixels.width, map.pixels.height)) else {
            return Err(ImportError::Empty);
        };
        let channels: Vec<(usize, usize)> = maps
            .iter()
            .enumerate()
            .flat_map(|(file, map)| (0..map.channels).map(move |own| (file, own)))
            .collect();
        let layers = options.layers.iter().flatten().count();
        if layers == 0 || layers > MAX_LAYERS || options.layers.len() > channels.len() {
            let (named, channels) = (options.layers.len(), channels.len());
            return Err(ImportError::Layers { named, layers, channels, most: MAX_LAYERS });
        }
        let pixels = width as usize * height as usize;
        let mut columns = Vec::new();
        columns.try_reserve_exact(pixels).map_err(|_| ImportError::Memory { bytes: pixels as u64 * 3 })?;
        let (mut weighted, mut unweighted) = (vec![0_u64; channels.len()], (0_u64, 0));
        let fallback = options.layers.iter().flatten().next().copied().unwrap_or_default();
        for pixel in 0..pixels {
            // The two strongest.
            let mut best: [(u16, MaterialId); 2] = [(0, fallback); 2];
            for (channel, &(file, own)) in channels.iter().enumerate() {
                let weight = maps[file].weight(pixel, own);
                weighted[channel] += u64::from(weight > 0);
                match options.layer(channel) {
                    Some(layer) if weight > best[0].0 => best = [(weight, layer), best[0]],
                    Some(layer) if weight > best[1].0 => best[1] = (weight, layer),
                    _ => {}
                }
            }
            if best[0].0 == 0 {
                unweighted = (unweighted.0 + 1, if unweighted.0 == 0 { pixel } else { unweighted.1 });
            }
            columns.push(blend(best, options.deep));
        }
        let mut notes = options.notes(maps, &channels, &weighted);
        if let (count @ 1.., first) = unweighted {
            let (x, z) = maps[0].pixels.place(first);
            notes.push(MaterialNote::NoWeight { count, x, z });
        }
        let files = maps.iter().map(|map| (map.channels, map.pixels.bits)).collect();
        let report = MaterialReport { width, height, files, samples: count(&columns), notes };
        Ok((Self::from_columns(width, height, columns)?, report))
    }

    /// Reads an id map from a PNG file: see [`Self::decode_ids`].
    ///
    /// # Errors
    /// [`ImportError`]
    pub fn open_ids(
        path: impl AsRef<Path>,
        options: &IdOptions,
    ) -> Result<(Self, MaterialReport), ImportError> {
        Self::decode_ids(&read_file(path.as_ref(), &options.limits)?, options)
    }

    /// Decodes an id map: a PNG of grey or with a palette, whose samples are ids, or of colours that
    /// [`IdOptions::colours`] lists.
    ///
    /// # Errors
    /// [`ImportError`]: a damaged file, and an id or a colour without a material, with its place.
    pub fn decode_ids(bytes: &[u8], options: &IdOptions) -> Result<(Self, MaterialReport), ImportError> {
        let named = options.ids.iter().map(|own| own.1).chain(options.colours.iter().map(|own| own.1));
        check(named.chain(options.deep))?;
        let pixels = Pixels::decode(bytes, &options.limits)?;
        let channels = pixels.color.samples();
        let is_coloured = matches!(pixels.color, ColorType::Rgb | ColorType::Rgba);
        let by_colour = is_coloured || pixels.color == ColorType::Indexed && !options.colours.is_empty();
        let of_id = |id: u16| match options.ids.is_empty() {
            true => u8::try_from(id).ok().map(MaterialId).filter(|material| *material != MaterialId::GROUND),
            false => options.ids.iter().find(|own| own.0 == id).map(|own| own.1),
        };
        let mut columns = Vec::with_capacity(pixels.samples.len() / channels);
        for (index, pixel) in pixels.samples.chunks_exact(channels).enumerate() {
            let found = |found: String| {
                let (x, z) = pixels.place(index);
                ImportError::UnknownId { found, x, z }
            };
            let material = match pixel {
                &[r, g, b, ..] if is_coloured => {
                    let byte = |part: u16| if pixels.bits == 16 { (part / 257) as u8 } else { part as u8 };
                    of_colour(options, [r, g, b].map(byte)).map_err(found)?
                }
                &[id, ..] if by_colour => {
                    let colour = pixels.palette.get(usize::from(id)).copied();
                    let colour = colour
                        .ok_or_else(|| damaged(HeightFormat::Png, "a pixel lies outside of the palette"))?;
                    of_colour(options, colour).map_err(found)?
                }
                &[id, ..] => of_id(id).ok_or_else(|| found(format!("the id {id}")))?,
                [] => continue,
            };
            columns.push(match options.deep {
                Some(base) => ColumnMaterial { base, overlay: material, blend: 255 },
                None => ColumnMaterial::solid(material),
            });
        }
        let (width, height) = (pixels.width, pixels.height);
        let has_alpha = matches!(pixels.color, ColorType::GrayscaleAlpha | ColorType::Rgba);
        let notes = if has_alpha { vec![MaterialNote::AlphaIgnored { file: 0 }] } else { Vec::new() };
        let files = vec![(channels, pixels.bits)];
        let report = MaterialReport { width, height, files, samples: count(&columns), notes };
        Ok((Self::from_columns(width, height, columns)?, report))
    }
}

/// The material of a colour, or the colour's name.
fn of_colour(options: &IdOptions, colour: [u8; 3]) -> Result<MaterialId, String> {
    let found = options.colours.iter().find(|own| own.0 == colour);
    let [r, g, b] = colour;
    found.map(|own| own.1).ok_or_else(|| format!("the colour ({r}, {g}, {b})"))
}
