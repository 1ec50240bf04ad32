//! GeoTIFF's and GDAL's tags: where samples lie, and what their values mean.

use std::io::{Read, Seek};

use ::tiff::decoder::Decoder;
use ::tiff::tags::Tag;

use super::report::ImportNote;

/// GDAL's metadata, in XML.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// The key that says whether a sample is an area or a point.
const RASTER_TYPE: u16 = 1025;

/// The value of [`RASTER_TYPE`] for points.
const POINTS: u16 = 2;

/// What a file says about its place and values.
#[derive(Default)]
pub(super) struct Georeference {
    pub no_data: Option<f64>,
    pub spacing: Option<[f64; 2]>,
    pub origin: Option<[f64; 2]>,
    pub value_scale: Option<[f64; 2]>,
    pub note: Option<ImportNote>,
}

impl Georeference {
    /// Reads the tags of a decoder's image; those that are damaged count as missing.
    pub fn read<R: Read + Seek>(decoder: &mut Decoder<R>) -> Self {
        let no_data = decoder.get_tag_ascii_string(Tag::GdalNodata).ok();
        let metadata = decoder.get_tag_ascii_string(GDAL_METADATA).ok();
        let mut found = Self {
            no_data: no_data.and_then(|text| text.trim_matches(['\0', ' ']).parse().ok()),
            value_scale: metadata.as_deref().and_then(value_scale),
            ..Self::default()
        };
        let scale = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).ok();
        let ties = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).ok();
        let matrix = decoder.get_tag_f64_vec(Tag::ModelTransformationTag).ok();
        // East and north of a place of the raster are `start + column * across + row * down`.
        let (across, down, start) = match (scale.as_deref(), ties.as_deref(), matrix.as_deref()) {
            // Rows go south whatever the sign, as in GDAL.
            (Some(&[x, z, ..]), ties, _) if x != 0.0 && z != 0.0 => {
                let start = match ties {
                    Some(&[i, j, _, east, north, ..]) => Some([east - i * x, north + j * z.abs()]),
                    _ => None,
                };
                ([x, 0.0], [0.0, -z.abs()], start)
            }
            (_, _, Some(&[a, b, _, c, d, e, _, f, ..])) => ([a, d], [b, e], Some([c, f])),
            (_, Some(_), _) => {
                found.note = Some(ImportNote::PlaceIgnored);
                return found;
            }
            _ => return found,
        };
        let spacing = [across, down].map(|[east, north]| east.hypot(north));
        if !spacing.iter().all(|spacing| *spacing > 0.0 && spacing.is_finite()) {
            found.note = Some(ImportNote::PlaceIgnored);
            return found;
        }
        // Samples are areas unless the file says otherwise: the raster's corner is half a sample from the first middle.
        let half = if are_points(decoder) { 0.0 } else { 0.5 };
        let middle = |axis: usize, start: f64| start + half * across[axis] + half * down[axis];
        found.spacing = Some(spacing);
        found.origin = start.map(|[east, north]| [middle(0, east), middle(1, north)]);
        if !matches!((across, down), ([east, 0.0], [0.0, north]) if east > 0.0 && north < 0.0) {
            found.note = Some(ImportNote::NotNorthUp);
        }
        found
    }
}

/// Whether the file says that its samples are points.
fn are_points<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    let keys = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap_or_default();
    // Four words of a header, then four for each key: its id, where its value lies (0: here), the count, the value.
    keys.chunks_exact(4).skip(1).any(|key| matches!(*key, [RASTER_TYPE, 0, _, POINTS]))
}

/// The scale and the offset of the first channel, as GDAL writes them:
/// `<Item name="SCALE" sample="0" role="scale">0.1</Item>`.
fn value_scale(metadata: &str) -> Option<[f64; 2]> {
    let item = |role: &str| {
        metadata.split("<Item").skip(1).find_map(|item| {
            let (attributes, rest) = item.split_once('>')?;
            let is_first = !attributes.contains("sample=") || attributes.contains("sample=\"0\"");
            let has_role = attributes.contains(&format!("role=\"{role}\""));
            let value = rest.split('<').next()?.trim().parse::<f64>().ok()?;
            (is_first && has_role && value.is_finite()).then_some(value)
        })
    };
    let scale = [item("scale").filter(|scale| *scale != 0.0).unwrap_or(1.0), item("offset").unwrap_or(0.0)];
    (scale != [1.0, 0.0]).then_some(scale)
}
