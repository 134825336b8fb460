//! The first paper's figures: section III with the exact angle, Tables II and III, and section V without a position
//! sensor.
//!
//! Nothing is fitted to the paper's figures but the real motor's iron loss, which is that of figure 7(d) at 4500 rpm:
//! its offset there is no result. Where the paper is silent the assumption is given with the result.

mod counts;
mod course;
mod dynamics;
mod figure_7;
mod foc;
mod gains;
mod ideal;
mod maps;
mod means;
mod sensorless;
mod setting;
mod six_step;

use super::item::Reproduction;

/// Measures the first paper's figures.
pub fn bosso() -> Reproduction {
    let ((ideal, maps), (figure_7, figures_8_and_9)) = rayon::join(
        || rayon::join(ideal::items, maps::figures),
        || rayon::join(figure_7::figure_7, dynamics::figures_8_and_9),
    );
    let mut items = ideal;
    items.extend(counts::items());
    items.extend(gains::items());
    items.extend(figure_7.0);
    items.extend(figures_8_and_9.0);
    let mut figures = maps;
    figures.push(figure_7.1);
    figures.extend(figures_8_and_9.1);
    Reproduction { items, figures }
}
