//! Pictures of recordings.

mod figure;
mod panel;
mod read;
mod reduce;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::drawing::IntoDrawingArea;
use plotters::style::{FontStyle, register_font};
use thiserror::Error;

use figure::{COLUMNS, HEIGHT, WIDTH};
use panel::Area;
use read::Recording;

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PlotError {
    /// No picture has this extension.
    #[error("cannot draw {}: the name must end in .svg or .png", .0.display())]
    Extension(PathBuf),
    /// The recording cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The recording.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is no recording that can be drawn: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is amiss.
        reason: String,
    },
    /// The drawing failed.
    #[error("cannot draw: {0}")]
    Draw(String),
    /// The picture cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The picture.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Draws the recording at `record` to `picture`, an `.svg` or a `.png`: speeds, currents, voltages
/// and the angle error over the time, with the phases of the drive behind them.
///
/// # Errors
/// An extension without a format, a recording that cannot be read, a picture that cannot be
/// written.
pub fn plot(record: &Path, picture: &Path) -> Result<(), PlotError> {
    let encode = match picture.extension().and_then(|extension| extension.to_str()) {
        Some("svg") => svg,
        Some("png") => png,
        _ => return Err(PlotError::Extension(picture.to_owned())),
    };
    let bytes = encode(&Recording::read(record, COLUMNS)?)?;
    std::fs::write(picture, bytes).map_err(|source| PlotError::Write {
        path: picture.to_owned(),
        source,
    })
}

fn svg(recording: &Recording) -> Result<Vec<u8>, PlotError> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, (WIDTH, HEIGHT)).into_drawing_area();
    draw(&root, recording)?;
    drop(root);
    // The library draws on whole pixels. Shown at half its size, the figure has half pixels.
    let drawn = format!(r#"width="{WIDTH}" height="{HEIGHT}""#);
    let shown = format!(r#"width="{}" height="{}""#, WIDTH / 2, HEIGHT / 2);
    Ok(text.replacen(&drawn, &shown, 1).into_bytes())
}

fn png(recording: &Recording) -> Result<Vec<u8>, PlotError> {
    let mut pixels = vec![0; 3 * WIDTH as usize * HEIGHT as usize];
    let root = BitMapBackend::with_buffer(&mut pixels, (WIDTH, HEIGHT)).into_drawing_area();
    draw(&root, recording)?;
    drop(root);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&pixels))
        .map_err(|error| PlotError::Draw(error.to_string()))?;
    Ok(bytes)
}

/// Draws the figure with a font that is the same on every machine; a viewer of the SVG takes its
/// own.
fn draw<B: DrawingBackend>(root: &Area<B>, recording: &Recording) -> Result<(), PlotError> {
    for (style, font) in [
        (FontStyle::Normal, dejavu::sans::regular()),
        (FontStyle::Bold, dejavu::sans::bold()),
    ] {
        register_font(figure::FONT, style, font)
            .map_err(|_| PlotError::Draw("the built-in font is damaged".to_owned()))?;
    }
    figure::draw(root, recording)
        .and_then(|()| root.present())
        .map_err(|error| PlotError::Draw(error.to_string()))
}
