//! Renders a picture to the bytes of its file.

use std::path::Path;

use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::{FontStyle, register_font};

use super::error::PlotError;
use super::style;

pub(super) type Area<B> = DrawingArea<B, Shift>;
pub(super) type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Something to draw, in pixels of the PNG.
pub(super) trait Picture {
    /// Returns width and height.
    fn size(&self) -> (u32, u32);

    /// Draws it on an area of that size.
    fn draw<B: DrawingBackend>(&self, root: &Area<B>) -> Drawn<B>;
}

/// A file format.
#[derive(Clone, Copy, Debug)]
pub(super) enum Format {
    Svg,
    Png,
}

impl Format {
    /// Returns the format named by the path's extension.
    pub(super) fn of(path: &Path) -> Result<Self, PlotError> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(PlotError::Extension(path.to_owned())),
        }
    }

    /// Draws the picture to `path`.
    pub(super) fn write(self, picture: &impl Picture, path: &Path) -> Result<(), PlotError> {
        register_fonts()?;
        let bytes = match self {
            Self::Svg => svg(picture)?,
            Self::Png => png(picture)?,
        };
        std::fs::write(path, bytes).map_err(|source| PlotError::Write {
            path: path.to_owned(),
            source,
        })
    }
}

fn svg(picture: &impl Picture) -> Result<Vec<u8>, PlotError> {
    let (width, height) = picture.size();
    let mut text = String::new();
    draw(
        picture,
        SVGBackend::with_string(&mut text, (width, height)).into_drawing_area(),
    )?;
    // The library draws on whole pixels. Shown at half size, the figure has half pixels.
    let drawn = format!(r#"width="{width}" height="{height}""#);
    let shown = format!(r#"width="{}" height="{}""#, width / 2, height / 2);
    Ok(text.replacen(&drawn, &shown, 1).into_bytes())
}

fn png(picture: &impl Picture) -> Result<Vec<u8>, PlotError> {
    let (width, height) = picture.size();
    let mut pixels = vec![0; 3 * width as usize * height as usize];
    draw(
        picture,
        BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area(),
    )?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&pixels))
        .map_err(|error| PlotError::Draw(error.to_string()))?;
    Ok(bytes)
}

fn draw<B: DrawingBackend>(picture: &impl Picture, root: Area<B>) -> Result<(), PlotError> {
    picture
        .draw(&root)
        .and_then(|()| root.present())
        .map_err(|error| PlotError::Draw(error.to_string()))
}

/// Registers a font that is the same on every machine; a viewer of the SVG uses its own.
fn register_fonts() -> Result<(), PlotError> {
    for (style, font) in [
        (FontStyle::Normal, dejavu::sans::regular()),
        (FontStyle::Bold, dejavu::sans::bold()),
    ] {
        register_font(style::FONT, style, font)
            .map_err(|_| PlotError::Draw("the built-in font is damaged".to_owned()))?;
    }
    Ok(())
}
