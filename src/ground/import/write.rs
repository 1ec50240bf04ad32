//! Writing heights to files, for terrain tools and surveys.

use super::error::ImportError;
use super::grid::ElevationGrid;
use super::kind::HeightFormat;

/// The void value of ASCII grids and TIFF files that are written.
const VOID: f32 = -9999.0;

fn failed(format: HeightFormat, reason: impl ToString) -> ImportError {
    ImportError::Encode { format, reason: reason.to_string() }
}

impl ElevationGrid {
    /// A PNG of 16 bits whose black and white are the least and greatest value, which are returned; values are rounded
    /// to 1/65535 of that range, and voids become black.
    ///
    /// # Errors
    /// [`ImportError::AllVoid`]; [`ImportError::Encode`] if the encoder refuses.
    pub fn encode_png(&self) -> Result<(Vec<u8>, [f32; 2]), ImportError> {
        let (image, range) = self.to_grey_image()?;
        let bytes: Vec<u8> = image.samples().iter().flat_map(|sample| sample.to_be_bytes()).collect();
        let mut file = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut file, self.width(), self.height());
        encoder.set_color(::png::ColorType::Grayscale);
        encoder.set_depth(::png::BitDepth::Sixteen);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes));
        written.map_err(|error| failed(HeightFormat::Png, error))?;
        Ok((file, range))
    }

    /// A RAW file of 32-bit floats, low byte first, top row first. Values are exact, and voids NaN.
    pub fn encode_raw(&self) -> Vec<u8> {
        self.samples().iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    /// An Esri ASCII grid whose samples are `cell_size` apart. Values are exact; voids are -9999.
    ///
    /// `cell_size` has the unit of the values. Those of [`World::elevation`](crate::world::World::elevation) are in
    /// voxels, and its samples are 1 voxel apart.
    pub fn encode_ascii(&self, cell_size: f64) -> String {
        let (width, height) = (self.width(), self.height());
        let mut text = format!(
            "ncols {width}\nnrows {height}\nxllcorner 0\nyllcorner 0\ncellsize {cell_size}\nNODATA_value {VOID}\n"
        );
        for row in self.samples().chunks_exact(width as usize) {
            let mut words = row.iter().map(|&value| if value.is_nan() { VOID } else { value }).peekable();
            while let Some(value) = words.next() {
                text += &value.to_string();
                text.push(if words.peek().is_some() { ' ' } else { '\n' });
            }
        }
        text
    }

    /// A TIFF of 32-bit floats. Values are exact, and voids NaN. It has no tags of GeoTIFF: neither the distance between
    /// samples nor their place.
    ///
    /// # Errors
    /// [`ImportError::Encode`] if the encoder refuses.
    #[cfg(feature = "import")]
    pub fn encode_tiff(&self) -> Result<Vec<u8>, ImportError> {
        use ::tiff::encoder::{TiffEncoder, colortype::Gray32Float};
        let refused = |error| failed(HeightFormat::Tiff, error);
        let mut file = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).map_err(refused)?;
        let written = encoder.write_image::<Gray32Float>(self.width(), self.height(), self.samples());
        written.map_err(refused)?;
        Ok(file.into_inner())
    }

    /// An OpenEXR file with the channel `Y` of 32-bit floats. Values are exact, and voids NaN.
    ///
    /// # Errors
    /// [`ImportError::Encode`] if the encoder refuses.
    #[cfg(feature = "import")]
    pub fn encode_exr(&self) -> Result<Vec<u8>, ImportError> {
        use ::exr::prelude::*;
        let pixel = |at: Vec2<usize>| (self.value(at.0 as u32, at.1 as u32),);
        let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(pixel);
        let image = Image::from_channels((self.width() as usize, self.height() as usize), channels);
        let mut file = std::io::Cursor::new(Vec::new());
        let written = image.write().non_parallel().to_buffered(&mut file);
        written.map_err(|error| failed(HeightFormat::Exr, error))?;
        Ok(file.into_inner())
    }
}
