//! The quantities that formulas are made of.

/// A quantity used in formulas, in SI units unless its name states another.
#[derive(Clone, Copy)]
pub(super) struct Quantity(pub(super) u8);

/// Names the quantities: those that persist, and those of the blocks, which share one set of
/// places.
macro_rules! quantities {
    (
        stay { $($(#[$attribute:meta])* $name:ident,)* }
        $(own { $($own:ident),* $(,)? })*
    ) => {
        const STAY: usize = [$(stringify!($name)),*].len();

        const _: () = {
            #[repr(u8)]
            enum Place {
                $($name),*
            }

            #[allow(non_upper_case_globals, reason = "they are told apart as variants are")]
            impl Quantity {
                $($(#[$attribute])* pub(super) const $name: Self = Self(Place::$name as u8);)*
            }
        };

        $(const _: () = {
            #[repr(u8)]
            enum Place {
                $($own),*
            }

            #[allow(non_upper_case_globals, reason = "they are told apart as variants are")]
            impl Quantity {
                $(pub(super) const $own: Self = Self(STAY as u8 + Place::$own as u8);)*
            }

            assert!([$(stringify!($own)),*].len() <= OWN);
        };)*
    };
}

/// Most quantities that a block has of its own.
const OWN: usize = 14;

impl Quantity {
    /// The number of places they take.
    pub(super) const COUNT: usize = STAY + OWN;
}

quantities! {
    stay {
        /// A whole turn, 2π.
        Tau,
        // From the parameters.
        PwmHz,
        DeadTime,
        PolePairs,
        R,
        L,
        Flux,
        J,
        /// `LIM_PHASE_A`.
        LimitA,
        RegenA,
        SupplyA,
        SupplyMinV,
        SupplyMaxV,
        FastestRpm,
        PropellerA,
        ToneA,
        // Derived from the motor.
        LeastRpm,
        SlewRpmS,
        CurrentHz,
        SpeedHz,
        ParkAs,
        RampA,
        RampRpmS,
        RunRpm,
        /// What the dead time takes of a phase's voltage.
        DeadV,
        /// And of its duty, including the diodes.
        DeadShare,
        DiodesV,
        // From the board.
        APerCount,
        BusVPerCount,
        TerminalVPerCount,
        RangeA,
        // The control's units.
        /// The control period T_s.
        T,
        UnitA,
        UnitV,
        UnitWb,
        UnitPerWb,
        UnitNm,
        UnitAs,
        TurnsPerRpm,
        RadPerUnit,
        VoltagePerCurrent,
        CurrentPerVoltage,
        FluxPerCurrent,
        TorquePerSpeed,
        /// The period in which the shaft turns as far as the field does in one control period.
        MechanicalT,
        /// Unit of mechanical speed.
        UnitRadS,
        // Of the motor and its loops.
        /// Period of the outer loops.
        OuterT,
        ROverL,
        /// Bandwidth of the current loop, 1/s: 1/ε of (20), (21).
        CurrentRadS,
        /// Bandwidth of the speed loop, 1/s: k_pω/J.
        SpeedRadS,
        /// The electrical speed at which (22) is linearised.
        LinearisedRadS,
        /// The electrical speed at `CTL_RPM_MAX`.
        FastestRadS,
        /// The same in turns per period.
        FastestTurns,
        SlowestRpm,
        /// Speed below which Run ends and the flux is not followed.
        SlowRpm,
        /// The start's current, within `LIM_PHASE_A`.
        StartA,
        // Intermediates shared by several blocks.
        KP,
        PoleRadS,
        Share,
        BoundA,
    }
    // Of low speed and the limits.
    own { WindingA, BrakingA, DrivingA, SlowV, RippleA, HiddenA, BiasA, DeadEndV, ReturnV, EndV, EndRadS }
}
