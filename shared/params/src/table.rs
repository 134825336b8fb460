//! The table of parameters.

use core::fmt;

use crate::parts::Part;

/// The kind of a parameter: its values, and where they come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Any value in range.
    Real,
    /// Whole numbers in range.
    Whole,
    /// Any value in range, or 0 for the one that [follows from the motor](super::FromMotor).
    FromMotor,
    /// Any value in range, or 0 if not known.
    OfMotor,
    /// Computed from other parameters; cannot be set and is not stored.
    Derived,
    /// Whole numbers in range, each of which triggers an action when written. It reads 0 again when that is over, and
    /// is not stored.
    Order,
}

/// One parameter's entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Key under which the value is stored; never reused for another parameter.
    pub key: u16,
    /// Name on MAVLink, at most 16 characters.
    pub name: &'static str,
    /// Kind of its values.
    pub kind: Kind,
    /// Least accepted value, besides a 0 that has a [meaning](Kind::zero).
    pub min: f32,
    /// Greatest accepted value.
    pub max: f32,
    /// Factory value: the motor is unknown, and limits are those of the first paper's bench at 24 V.
    pub default: f32,
    /// True if it may change while the motor turns. All others describe the motor, the bridge, the wire or the way it
    /// is driven, and wait for standstill.
    pub live: bool,
}

impl Kind {
    /// Returns true if the value survives a loss of power.
    pub fn is_kept(self) -> bool {
        !matches!(self, Self::Derived | Self::Order)
    }

    /// Returns what 0 means, where it is accepted outside the range.
    pub fn zero(self) -> Option<&'static str> {
        match self {
            Self::FromMotor => Some("from the motor"),
            Self::OfMotor => Some("not known"),
            Self::Real | Self::Whole | Self::Derived | Self::Order => None,
        }
    }
}

impl Parameter {
    /// Returns true for a value in range.
    pub fn allows(&self, value: f32) -> bool {
        (self.min..=self.max).contains(&value) || (self.kind.zero().is_some() && value == 0.0)
    }

    /// Returns the range in words, without its unit.
    pub fn range(&self) -> impl fmt::Display + '_ {
        fmt::from_fn(|f| {
            if let Some(meaning) = self.kind.zero() {
                write!(f, "0 ({meaning}), or ")?;
            }
            write!(f, "{} to {}", self.min, self.max)
        })
    }
}

/// A parameter's texts for people. Kept out of the table so that a chip need not hold them: it serves them in a
/// compressed file that `build.rs` makes.
#[derive(Clone, Copy, Debug)]
pub struct Text {
    /// Unit, empty for a number or a choice.
    pub unit: &'static str,
    /// One sentence for a ground station.
    pub description: &'static str,
    /// For a choice, its values and their meanings.
    pub choices: &'static [(u8, &'static str)],
    /// True if a change takes effect at the next start.
    pub restart: bool,
    /// The parts that use it, if only some do.
    pub parts: &'static [Part],
}

impl Text {
    /// Returns true unless this build lacks all parts that use the parameter.
    pub fn is_used(&self) -> bool {
        self.parts.is_empty() || self.parts.iter().any(|part| part.is_here())
    }
}

/// A parameter that is one of a few choices.
pub trait Choice: Copy {
    /// The parameter.
    const PARAM: ParamId;

    /// Returns the choice with this number; in place of one whose part this build lacks, the one that is then in force.
    fn of(number: u8) -> Self;

    /// Returns its number.
    fn number(self) -> u8;
}

/// A row's optional words; any other does not compile.
macro_rules! is_live {
    () => {
        false
    };
    (live $($word:ident)*) => {
        true
    };
    (restart) => {
        false
    };
}
macro_rules! is_at_restart {
    () => {
        false
    };
    (live $($word:ident)*) => {
        is_at_restart!($($word)*)
    };
    (restart) => {
        true
    };
}

macro_rules! is_here {
    () => {
        true
    };
    ($part:ident) => {
        Part::$part.is_here()
    };
}

macro_rules! parameters {
    ($($key:literal $id:ident $name:literal $unit:literal $kind:ident
       $min:literal .. $max:literal = $default:literal $($word:ident)* $description:literal
       $(in $($user:ident)|+)?
       $($value:literal $choice:literal)*
       $(one of $($number:literal $variant:ident $meaning:literal $(in $part:ident)?)+)?;)*) => {
        /// Names a row of [`TABLE`]; its order is the order on MAVLink.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum ParamId {
            $(
                #[doc = concat!(
                    $description
                    $(, "; ", $value, " ", $choice)*
                    $($(, "; ", $number, " ", $meaning)+)?
                )]
                $id,
            )*
        }

        /// Every parameter that there is. MAVLink, storage, the documentation and the build of the control's
        /// configuration read it.
        pub const TABLE: &[Parameter; [$(ParamId::$id),*].len()] = &[$(
            Parameter {
                key: $key,
                name: $name,
                kind: Kind::$kind,
                min: $min,
                max: $max,
                default: $default,
                live: is_live!($($word)*),
            },
        )*];

        const TEXTS: &[Text; TABLE.len()] = &[$(
            Text {
                unit: $unit,
                description: $description,
                choices: &[$(($value, $choice),)* $($(($number, $meaning)),+)?],
                restart: is_at_restart!($($word)*),
                parts: &[$($(Part::$user),+)?],
            },
        )*];

        /// The choices that need a part: parameter, number and part.
        const PARTED: &[(ParamId, u8, Part)] = &[
            $($($($((ParamId::$id, $number, Part::$part),)?)+)?)*
        ];

        /// The parameters that are a choice of few, each by its own name.
        pub mod choice {
            use super::{Choice, ParamId, Part};

            $($(
                #[doc = $description]
                #[derive(Clone, Copy, Debug, PartialEq, Eq)]
                #[repr(u8)]
                pub enum $id {
                    $(
                        #[doc = $meaning]
                        $variant = $number,
                    )+
                }

                impl $id {
                    /// In force in place of a choice that this build lacks: the default, or else the first one.
                    const SUBSTITUTE: Self = {
                        let choices = [$((Self::$variant, is_here!($($part)?))),+];
                        let (mut found, mut i) = (choices[0].0, choices.len());
                        while i > 0 {
                            i -= 1;
                            if choices[i].1 {
                                found = choices[i].0;
                            }
                        }
                        i = 0;
                        while i < choices.len() {
                            if choices[i].1 && choices[i].0 as u8 == $default as u8 {
                                found = choices[i].0;
                            }
                            i += 1;
                        }
                        found
                    };

                    /// The parameter and the value that choose this.
                    pub const fn setting(self) -> (ParamId, f32) {
                        (ParamId::$id, self as u8 as f32)
                    }
                }

                impl Choice for $id {
                    const PARAM: ParamId = ParamId::$id;

                    fn of(number: u8) -> Self {
                        match number {
                            $($number if is_here!($($part)?) => Self::$variant,)+
                            _ => Self::SUBSTITUTE,
                        }
                    }

                    fn number(self) -> u8 {
                        self as u8
                    }
                }
            )?)*
        }

        impl ParamId {
            /// All parameters in the order of the table.
            pub const ALL: [Self; TABLE.len()] = [$(Self::$id),*];

            /// This parameter's words for a person.
            pub const fn text(self) -> &'static Text {
                &TEXTS[self as usize]
            }

            /// Returns the part that a choice needs, if any.
            pub fn part(self, number: u8) -> Option<Part> {
                let mut parted = PARTED.iter();
                parted.find(|(id, choice, _)| (*id, *choice) == (self, number)).map(|found| found.2)
            }

            /// Returns true for a choice whose part this build lacks.
            pub fn lacks(self, value: f32) -> bool {
                self.part(value as u8).is_some_and(|part| !part.is_here())
            }
        }
    };
}

parameters! {
    1 MavSysId "MAV_SYS_ID" "" Whole 1.0..255.0 = 1.0 live restart
        "MAVLink system id";
    2 MavCompId "MAV_COMP_ID" "" Whole 1.0..250.0 = 140.0 live restart
        "MAVLink component id as a peripheral; standalone it is 1";
    3 MavRole "MAV_ROLE" "" Whole 0.0..1.0 = 0.0 live restart
        "What it is to a ground station" one of
            0 Standalone "standalone, a vehicle of its own"
            1 Peripheral "peripheral beside an autopilot";
    10 MotPolePairs "MOT_POLE_PAIRS" "" Whole 0.0..64.0 = 0.0
        "Pole pairs of the motor: half the number of its magnets; 0 is not known, and 7 are assumed";
    11 MotRMohm "MOT_R_MOHM" "mOhm" OfMotor 1.0..10000.0 = 0.0
        "Resistance of one phase (star); 0 is not known";
    12 MotLUh "MOT_L_UH" "uH" OfMotor 0.5..10000.0 = 0.0
        "Inductance of one phase (star); 0 is not known";
    13 MotFluxMwb "MOT_FLUX_MWB" "mWb" OfMotor 0.01..1000.0 = 0.0
        "Peak flux linkage of one phase; 0 is not known";
    14 MotJGcm2 "MOT_J_GCM2" "g.cm^2" OfMotor 0.1..10000000.0 = 0.0
        "Moment of inertia of motor and load; 0 is not known, and one is assumed";
    15 MotDir "MOT_DIR" "" Whole 0.0..1.0 = 0.0
        "Direction of rotation" one of
            0 Normal "normal"
            1 Reversed "reversed";
    16 MotKv "MOT_KV" "rpm/V" Derived 0.0..1000000.0 = 0.0
        "Speed per peak line-to-line volt, 60/(2 pi sqrt(3) p flux); computed, read-only; 0 is not known";
    17 MotStop "MOT_STOP" "" Whole 0.0..1.0 = 1.0
        "At zero throttle and at loss of signal" one of
            0 Coast "coast"
            1 Brake "brake";
    18 MotToneA "MOT_TONE_A" "A" Real 0.0..10.0 = 1.5 live
        "Bound of tones' phase current, peak; up to a quarter more with R or L stated wrongly; 0 is silent";
    19 MotIdentify "MOT_IDENTIFY" "" Order 0.0..2.0 = 0.0 live
        "Identification of the motor; 0 again when it is over" in Identification
            0 "end it"
            1 "begin it: the motor turns"
            2 "keep what it has found";
    20 CtlMode "CTL_MODE" "" Whole 0.0..2.0 = 0.0
        "What throttle commands" one of
            0 Speed "speed"
            1 Torque "torque"
            2 Voltage "voltage";
    21 CtlDrive "CTL_DRIVE" "" Whole 0.0..2.0 = 2.0
        "Drive" one of
            0 FieldOriented "field-oriented"
            1 SixStep "six-step"
            2 Automatic "field-oriented, or six-step in voltage mode while R, L or flux is not known";
    22 CtlObserver "CTL_OBSERVER" "" Whole 0.0..3.0 = 3.0
        "Position observer" one of
            0 BackEmf "adaptive back-EMF" in BackEmf
            1 FluxCrossings "flux crossings" in FluxCrossings
            2 Hall "Hall" in Hall
            3 Compensated "compensated flux with PLL";
    23 CtlRegulator "CTL_REGULATOR" "" Whole 0.0..2.0 = 1.0
        "Current regulator" one of
            0 ObserverBased "observer-based" in BackEmf
            1 Synchronous "synchronous"
            2 Modified "modified synchronous" in Modified;
    24 CtlModulation "CTL_MODULATION" "" Whole 0.0..1.0 = 0.0
        "Modulation" one of
            0 SpaceVector "space vector"
            1 Sine "sine" in Sine;
    25 CtlObsCure "CTL_OBS_CURE" "" Whole 0.0..1.0 = 0.0
        "Form of the adaptive back-EMF observer" in BackEmf one of
            0 Published "as published"
            1 Cured "cured of its sensitivity to R, L";
    26 CtlAdaptL "CTL_ADAPT_L" "" Whole 0.0..1.0 = 0.0
        "Adaptation of the inductance by a square wave of i_d" in AdaptL one of
            0 Off "off"
            1 On "on" in AdaptL;
    27 CtlRpmMax "CTL_RPM_MAX" "rpm" Real 100.0..200000.0 = 6000.0
        "Mechanical speed at full throttle in speed mode";
    28 CtlRpmMin "CTL_RPM_MIN" "rpm" FromMotor 100.0..200000.0 = 300.0
        "Mechanical speed at the least throttle above zero in speed mode; 0 follows from the motor";
    29 CtlSlewRpmS "CTL_SLEW_RPM_S" "rpm/s" FromMotor 10.0..10000000.0 = 0.0 live
        "Greatest change of the speed reference; 0 follows from the motor";
    30 CtlBwCurHz "CTL_BW_CUR_HZ" "Hz" FromMotor 10.0..5000.0 = 0.0
        "Bandwidth of the current loop and of the back-EMF observer; 0 follows from the motor";
    31 CtlBwSpdHz "CTL_BW_SPD_HZ" "Hz" FromMotor 0.1..200.0 = 0.0 live
        "Bandwidth of the speed loop; 0 follows from the motor";
    32 CtlAe "CTL_AE" "" Real 0.0..0.95 = 0.5
        "Observers 1 and 2: share of the extrapolated angle that a crossing leaves, at high speed"
        in FluxCrossings | Hall;
    33 CtlPosN "CTL_POS_N" "" Whole 1.0..4.0 = 1.0
        "Observers 1 and 2: electrical turns over which the speed is measured"
        in FluxCrossings | Hall;
    34 CtlFluxForm "CTL_FLUX_FORM" "" Whole 0.0..3.0 = 1.0
        "Flux integrators" in FluxCrossings | Hall one of
            0 FirstOrder "first order, limits as measured"
            1 SecondOrder "second order, limits as measured"
            2 FirstOrderStated "first order, limits as stated"
            3 SecondOrderStated "second order, limits as stated";
    35 CtlHall "CTL_HALL" "" Whole 0.0..1.0 = 1.0
        "Hall observer" in Hall one of
            0 Alone "sensors alone"
            1 Merged "merged with the flux crossings" in FluxCrossings;
    36 CtlSpeed "CTL_SPEED" "" Whole 0.0..2.0 = 0.0
        "Speed loop" one of
            0 Inertia "with feed-forward of the inertia"
            1 Propeller "PI with feed-forward of CTL_FF_A" in Propeller
            2 Pi "PI";
    37 CtlFfA "CTL_FF_A" "A" Real 0.0..200.0 = 8.4 live
        "Steady current at CTL_RPM_MAX, fed forward with the square of the speed if CTL_SPEED is 1"
        in Propeller;
    38 CtlWeaken "CTL_WEAKEN" "%" Real 0.0..100.0 = 80.0
        "Share of the flux that i_d may take away where the supply is used up; 0 is none";
    40 PwmFreqHz "PWM_FREQ_HZ" "Hz" FromMotor 8000.0..60000.0 = 0.0 restart
        "PWM frequency; the control runs once a period";
    41 PwmDeadtimeNs "PWM_DEADTIME_NS" "ns" Real 0.0..3000.0 = 500.0 restart
        "Time for which both switches of a phase stay off at each change; a board has its least";
    50 InpProto "INP_PROTO" "" Whole 0.0..23.0 = 0.0
        "Throttle protocol"
            0 "automatic"
            1 "servo"
            2 "OneShot125"
            3 "OneShot42"
            4 "Multishot"
            10 "DShot150"
            11 "DShot300"
            12 "DShot600"
            13 "DShot1200"
            20 "bidirectional DShot150"
            21 "bidirectional DShot300"
            22 "bidirectional DShot600"
            23 "bidirectional DShot1200";
    51 Inp3d "INP_3D" "" Whole 0.0..1.0 = 0.0
        "Both directions by one throttle" one of
            0 Off "off"
            1 On "on";
    52 InpArmMs "INP_ARM_MS" "ms" Real 10.0..5000.0 = 300.0
        "Time for which zero throttle must be received before the motor may turn";
    53 InpLossMs "INP_LOSS_MS" "ms" Real 5.0..2000.0 = 100.0
        "Time without a valid frame after which the motor stops and must be armed again; above the time between two";
    54 InpPulseMinUs "INP_PULSE_MIN_US" "us" Whole 800.0..1400.0 = 1000.0
        "Servo pulse of zero throttle, in 3D of full reverse; other pulses are scaled";
    55 InpPulseMaxUs "INP_PULSE_MAX_US" "us" Whole 1500.0..2200.0 = 2000.0
        "Servo pulse of full throttle; other pulses are scaled";
    60 LimPhaseA "LIM_PHASE_A" "A" Real 0.5..200.0 = 20.0 live
        "Bound of the phase current's vector, peak; the software trips at 1.4 times this";
    61 LimBusA "LIM_BUS_A" "A" Real 0.5..200.0 = 30.0 live
        "Bound of the current drawn from the supply";
    62 LimRegenA "LIM_REGEN_A" "A" Real 0.0..200.0 = 10.0 live
        "Bound of the current returned to the supply while braking";
    63 LimBusVMin "LIM_BUS_V_MIN" "V" Real 0.0..60.0 = 9.0
        "Supply voltage below which the bridge is turned off";
    64 LimBusVMax "LIM_BUS_V_MAX" "V" Real 5.0..60.0 = 30.0
        "Supply voltage above which the bridge is turned off";
    65 LimTempC "LIM_TEMP_C" "degC" Real 40.0..150.0 = 100.0
        "Temperature of the board above which the bridge is turned off";
    66 LimPolicy "LIM_POLICY" "" Whole 0.0..1.0 = 1.0
        "After a fault of a drive that has proven itself" one of
            0 Bench "bench: the bridge stays off until zero throttle"
            1 Flight "flight: if the fault can pass, the motor is tried again up to three times";
    70 StaParkAs "STA_PARK_AS" "A.s" FromMotor 0.01..100.0 = 0.0
        "Current times time for which the rotor is aligned before a field-oriented ramp; 0 follows from the motor";
    71 StaRampA "STA_RAMP_A" "A" FromMotor 0.1..100.0 = 0.0
        "Current of alignment and ramp, peak; 0 follows from the motor";
    72 StaRampRpmS "STA_RAMP_RPM_S" "rpm/s" FromMotor 10.0..1000000.0 = 0.0
        "Acceleration of a field-oriented ramp at full ramp current; 0 follows from the motor";
    73 StaRunRpm "STA_RUN_RPM" "rpm" FromMotor 50.0..50000.0 = 0.0
        "Mechanical speed at which the observer takes over from the ramp; 0 follows from the motor";
    74 StaMode "STA_MODE" "" Whole 0.0..1.0 = 0.0
        "First attempt of a field-oriented start" one of
            0 AtOnce "at once: four times STA_RAMP_A, alignment and ramp as short as its torque allows"
            1 Stated "as stated: STA_PARK_AS, STA_RAMP_A and STA_RAMP_RPM_S";
    80 TelRateHz "TEL_RATE_HZ" "Hz" Real 1.0..100.0 = 10.0 live
        "Rate of ESC_STATUS and ESC_TELEMETRY_1_TO_4";
    81 TelBaud "TEL_BAUD" "bit/s" Whole 115200.0..921600.0 = 115200.0 restart
        "Speed of the board's serial MAVLink port";
    82 TelSignals "TEL_SIGNALS" "" Whole 0.0..2047.0 = 0.0 live
        "Signals streamed for tuning, a sum: 1 rpm, 2 rpm_ref, 4 i_d, 8 i_q, 16 v_d, 32 v_q, 64 duty, 128 bus_v, 256 bus_a, 512 r_mohm, 1024 flux_mwb";
    83 TelSigHz "TEL_SIG_HZ" "Hz" Real 1.0..500.0 = 50.0 live
        "Rate of the signals streamed for tuning; a link too slow for them carries what it can";
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::Params;

    #[test]
    fn the_table_is_sound() {
        for (i, p) in TABLE.iter().enumerate() {
            assert!(p.name.len() <= 16 && p.name.is_ascii(), "{}", p.name);
            assert!(p.allows(p.default), "{}", p.name);
            assert!(!TEXTS[i].description.is_empty(), "{}", p.name);
            let choices = TEXTS[i].choices;
            for (value, meaning) in choices {
                let value = f32::from(*value);
                assert!(p.min <= value && value <= p.max, "{}", p.name);
                assert!(!meaning.is_empty(), "{}", p.name);
            }
            let is_default = |choice: &(u8, _)| f32::from(choice.0) == p.default;
            assert!(
                choices.is_empty() || choices.iter().any(is_default),
                "{}",
                p.name
            );
            let whole = matches!(p.kind, Kind::Whole | Kind::Order);
            assert!(whole || choices.is_empty(), "{}", p.name);
            for other in &TABLE[i + 1..] {
                assert_ne!(p.name, other.name);
                assert_ne!(p.key, other.key, "{} and {}", p.name, other.name);
            }
        }
    }

    #[test]
    fn what_may_change_while_the_motor_turns_is_this_and_nothing_else() {
        let live: Vec<_> = TABLE.iter().filter(|p| p.live).map(|p| p.name).collect();
        let expected = [
            "MAV_SYS_ID",
            "MAV_COMP_ID",
            "MAV_ROLE",
            "MOT_TONE_A",
            "MOT_IDENTIFY",
            "CTL_SLEW_RPM_S",
            "CTL_BW_SPD_HZ",
            "CTL_FF_A",
            "LIM_PHASE_A",
            "LIM_BUS_A",
            "LIM_REGEN_A",
            "TEL_RATE_HZ",
            "TEL_SIGNALS",
            "TEL_SIG_HZ",
        ];
        assert_eq!(live, expected);
    }

    #[test]
    fn the_default_of_what_is_derived_is_what_the_other_defaults_make_of_it() {
        let params = Params::default();
        for id in ParamId::ALL {
            let (entry, value) = (id.entry(), params.get(id));
            assert!(
                (value - entry.default).abs() < 0.1,
                "{}: {value}",
                entry.name
            );
        }
    }
}
