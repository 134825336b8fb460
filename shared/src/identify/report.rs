//! The results of an identification.

use siskin_params::ParamId;

/// A motor's figures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Motor {
    /// R of a phase with its switches, Ω.
    pub(super) r_ohm: f32,
    /// L of a phase, H.
    pub(super) l_h: f32,
    /// Flux linkage, Wb.
    pub(super) flux_wb: f32,
}

/// A figure: the mean of several measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figure {
    /// The mean.
    pub value: f32,
    /// The greatest deviation of a measurement from it, as a share of it.
    pub spread: f32,
}

impl Figure {
    // Out of line: seven calls.
    #[inline(never)]
    pub(super) fn of(values: &[f32], factor: f32) -> Self {
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let differences = values.iter().map(|value| (value - mean).abs());
        Self {
            value: factor * mean,
            spread: differences.fold(0.0, f32::max) / mean.abs(),
        }
    }
}

/// A line of the report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The parameter that it is for, or what else it is.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The figure, in this unit.
    pub figure: Figure,
}

/// The figures' names and units: four parameters, and three for the user alone.
const ROWS: [(&str, &str); 7] = [
    ("MOT_R_MOHM", "mOhm"),
    ("MOT_L_UH", "uH"),
    ("MOT_FLUX_MWB", "mWb"),
    ("MOT_J_GCM2", "g.cm^2"),
    ("along_the_flux", "uH"),
    ("across_the_flux", "uH"),
    ("dead_time", "ns"),
];

/// What an identification has found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// R, mΩ.
    pub r_mohm: Figure,
    /// L, µH: the mean of both axes.
    pub l_uh: Figure,
    /// Flux linkage, mWb.
    pub flux_mwb: Figure,
    /// Inertia including what is on the shaft, g·cm²; scaled by the stated pole pairs.
    pub j_gcm2: Figure,
    /// L along the rotor's flux and across it, µH.
    pub l_axes_uh: [Figure; 2],
    /// The dead time of the bridge, ns.
    pub dead_time_ns: Figure,
}

impl Report {
    /// Passes each line to `act`; none before an identification has completed.
    pub fn for_each_line(&self, mut act: impl FnMut(&Line)) {
        if self.settings().is_none() {
            return;
        }
        let [along, across] = self.l_axes_uh;
        let figures = [
            self.r_mohm,
            self.l_uh,
            self.flux_mwb,
            self.j_gcm2,
            along,
            across,
            self.dead_time_ns,
        ];
        for ((name, unit), figure) in ROWS.into_iter().zip(figures) {
            act(&Line { name, unit, figure });
        }
    }

    /// Returns the parameters found by a completed identification.
    pub fn settings(&self) -> Option<[(ParamId, f32); 4]> {
        (self.j_gcm2.value > 0.0).then_some([
            (ParamId::MotRMohm, self.r_mohm.value),
            (ParamId::MotLUh, self.l_uh.value),
            (ParamId::MotFluxMwb, self.flux_mwb.value),
            (ParamId::MotJGcm2, self.j_gcm2.value),
        ])
    }
}
