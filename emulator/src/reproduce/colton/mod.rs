//! The second paper's figures.

mod acceleration;
mod bench;
mod climb;
mod estimator;
mod filters;
mod sheet;
mod table_1;
mod waveforms;

use rayon::prelude::*;

use super::item::Reproduction;

/// Measures the second paper's figures and Table 1, in its order.
pub fn colton() -> Reproduction {
    let by_drive: [fn() -> Reproduction; 4] = [
        filters::filters,
        waveforms::waveforms,
        climb::climb,
        climb::flux_map,
    ];
    let (by_drive, accelerating) = rayon::join(
        || {
            by_drive
                .into_par_iter()
                .map(|part| part())
                .collect::<Vec<_>>()
        },
        || {
            let runs = acceleration::Runs::new();
            [
                acceleration::over_speed(&runs),
                table_1::table_1(&runs),
                acceleration::over_k(&runs),
            ]
        },
    );
    let mut by_drive = by_drive.into_iter();
    let filters = by_drive.next();
    let [over_speed, table_1, over_k] = accelerating;
    let parts = filters
        .into_iter()
        .chain([over_speed, table_1])
        .chain(by_drive)
        .chain([over_k]);
    let (items, figures): (Vec<_>, Vec<_>) = parts.map(|part| (part.items, part.figures)).unzip();
    Reproduction {
        items: items.concat(),
        figures: figures.concat(),
    }
}

#[cfg(test)]
mod tests;
