//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use siskin_scope::HostPort;

use crate::decode;
use crate::endpoint::Endpoint;
use crate::image::{Board, Parts};

/// Self-test, parameters and live telemetry of a Siskin ESC over MAVLink, images for its boards, captures of a
/// throttle wire, and the settings and limits of a motor.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// tcp:HOST:PORT, udpin:HOST:PORT (wait for a vehicle, usually on 14550), udpout:HOST:PORT or
    /// serial:PATH:BAUD.
    #[arg(
        long,
        global = true,
        value_name = "ENDPOINT",
        default_value = "tcp:127.0.0.1:5760"
    )]
    pub(crate) connect: Endpoint,

    /// System id to talk to, instead of the first ESC heard.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) system: Option<u8>,

    /// Component id to talk to, instead of the first ESC heard.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) component: Option<u8>,

    /// File with the ESC's signing key, as 'siskin key new' makes it: signs what is sent, and believes only what is
    /// signed.
    #[arg(id = "sign-key", long, global = true, value_name = "FILE")]
    pub(crate) sign_key: Option<PathBuf>,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Have the ESC test itself at rest: supply, sensors and switches, each with its bounds.
    ///
    /// The motor does not turn; a fifth of LIM_PHASE_A flows through it for a few milliseconds. The exit status
    /// is 1 if anything is out of bounds.
    Check {
        /// One JSON object: items, a list of name, value, unit, low, high and ok.
        #[arg(long)]
        json: bool,
    },
    /// Have the ESC identify its motor: resistance, inductance, flux and inertia.
    ///
    /// The motor turns for a few seconds, at up to four tenths of its full speed and at most half of
    /// LIM_PHASE_A. Throttle, disarming or a fault ends it. Nothing is set without --keep.
    Identify {
        /// Keep the results: MOT_R_MOHM, MOT_L_UH, MOT_FLUX_MWB and MOT_J_GCM2, stored once the shaft stands.
        #[arg(long)]
        keep: bool,
        /// One JSON object: items, a list of name, value, unit, confidence (1 where all measurements agree, less
        /// by the largest deviation from their mean) and kept.
        #[arg(long)]
        json: bool,
    },
    /// Make a signing key, give it to the ESC, or take it away.
    ///
    /// An ESC with a key lets anyone read, but is changed and turned only by frames that are signed with it.
    #[command(subcommand)]
    Key(KeyCommand),
    /// Show the last faults, and what the control did just before one; kept across a reset, not across a
    /// power-down.
    ///
    /// The exit status is 1 if a fault is on record.
    Faults(FaultsArgs),
    /// Read, change, save and load parameters.
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Show speed, voltage, current and faults as they come.
    Monitor(MonitorArgs),
    /// Serve a browser page that shows the ESC: traces, parameters, tests, faults on record.
    ///
    /// It turns the motor for identification, and for a motor test while its button is held: for at most three
    /// seconds, with at most a fifth of LIM_PHASE_A. Both end when the page is closed, and with the program, by
    /// Ctrl-C.
    Scope(ScopeArgs),
    /// Show what a logic analyser has captured on a throttle wire: frames, commands, replies, errors and
    /// timing.
    ///
    /// Reads VCD, and CSV as exported by PulseView, sigrok-cli and Saleae Logic. Successive equal frames share
    /// a line. Throttle is shown for one direction and the factory pulse ends.
    Decode(DecodeArgs),
    /// Compute the speed range in which the flux crossings (CTL_OBSERVER 1) hold the rotor's angle, and what limits
    /// it.
    ///
    /// The worst case of Colton 2014, Table 1, from the ESC's parameters; options given here override them. N
    /// and A_e from the parameters apply from the speeds at which the drive begins to use them; given here they
    /// apply at every speed, as in the paper. The drive compensates for the lead and delay that it knows of, so
    /// its errors stay below these.
    Budget(BudgetArgs),
    /// Compute the start and control-loop settings that follow from the motor, and what each follows from.
    ///
    /// From resistance, flux, pole pairs and inertia (MOT_...), LIM_PHASE_A, LIM_BUS_V_MAX, CTL_RPM_MAX,
    /// PWM_FREQ_HZ and PWM_DEADTIME_NS, by the rules that start motors from 3-inch propellers to 3 kW lift
    /// motors in simulation.
    Tune(TuneArgs),
    /// Make the files that go onto a board: BOARD.elf, BOARD.bin and BOARD.hex.
    ///
    /// Prints their board, version and commit (followed by + if files differed from it), how much of the flash
    /// they take, and what the PWM interrupt reaches. An image whose interrupt needs the flash while it is
    /// being written is refused. The files hold a checksum, by which 'siskin flash' and the ESC at each start
    /// detect damage.
    Image(ImageArgs),
    /// Write an image into a board's flash, after checking that it is intact and for that board.
    ///
    /// Uses probe-rs through a debug probe (the B-G431B-ESC1 has one on it), or dfu-util over USB with BOOT0 at
    /// 3.3 V. Stored parameters and option bytes stay.
    Flash(FlashArgs),
}

/// What to do with a signing key.
#[derive(Debug, Subcommand)]
pub(crate) enum KeyCommand {
    /// Make a file with a new random key.
    New {
        /// The key that MAVProxy and other ground stations make of a passphrase, which is read from standard input.
        #[arg(long)]
        passphrase: bool,
        /// File to make; it must not exist.
        file: PathBuf,
    },
    /// Give the ESC the key in a file, and store it. Over a link that others hear, they have it too.
    ///
    /// If the ESC has another key, name that one's file with --sign-key.
    Set {
        /// File with the key.
        file: PathBuf,
    },
    /// Take the key that --sign-key names away from the ESC, and store that.
    Remove,
}

/// What to do with parameters.
#[derive(Debug, Subcommand)]
pub(crate) enum ParamsCommand {
    /// Print every parameter in the ESC's order.
    List {
        /// One JSON object, name to value.
        #[arg(long)]
        json: bool,
    },
    /// Print the named parameters.
    Get {
        /// One JSON object, name to value.
        #[arg(long)]
        json: bool,
        /// Names in any case, for example MOT_POLE_PAIRS.
        #[arg(required = true, value_name = "NAME")]
        names: Vec<String>,
    },
    /// Print what parameters mean: unit, range, factory value.
    Describe {
        /// Names in any case; all if none is given.
        #[arg(value_name = "NAME")]
        names: Vec<String>,
    },
    /// Show which parameters differ from the factory values, or from a file.
    Diff {
        /// File to compare with, as 'siskin params load' reads it.
        file: Option<PathBuf>,
    },
    /// Return parameters to their factory values; the ESC stores that by itself within seconds.
    Reset {
        /// Store that now, and wait until it would survive a loss of power.
        #[arg(long)]
        store: bool,
        /// Reset all of them, and erase everything else that is stored except the statistics: the signing key
        /// too. Stored at once.
        #[arg(long, conflicts_with_all = ["store", "names"])]
        all: bool,
        /// Names in any case.
        #[arg(required_unless_present = "all", value_name = "NAME")]
        names: Vec<String>,
    },
    /// Change parameters; the ESC stores them by itself within seconds.
    Set {
        /// Store them now, and wait until they would survive a loss of power.
        #[arg(long)]
        store: bool,
        /// Alternating names, in any case, and values, for example LIM_PHASE_A 15 MOT_STOP 0.
        #[arg(required = true, value_names = ["NAME", "VALUE"], num_args = 2.., allow_negative_numbers = true)]
        pairs: Vec<String>,
    },
    /// Write every parameter to a file that MAVProxy and Mission Planner read too.
    Save {
        /// File to write, usually NAME.param.
        file: PathBuf,
    },
    /// Set the parameters in a file; the ESC stores them by itself within seconds. Reads MAVProxy's, Mission Planner's
    /// and QGroundControl's files.
    Load {
        /// Store them now, if none was refused, and wait until they would survive a loss of power.
        #[arg(long)]
        store: bool,
        /// File to read.
        file: PathBuf,
    },
}

/// How to show telemetry.
#[derive(Debug, Args)]
pub(crate) struct MonitorArgs {
    /// One JSON object a line: a sample of one ESC, or a message.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after N samples.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
}

/// Where to serve the page.
#[derive(Debug, Args)]
pub(crate) struct ScopeArgs {
    /// HOST:PORT to serve the page at; if other machines can reach it, as at 0.0.0.0:PORT, its address holds a
    /// token.
    // The emulator's own page is at 8080.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:8081")]
    pub(crate) web: HostPort,
}

/// What to do with the fault record.
#[derive(Debug, Args)]
pub(crate) struct FaultsArgs {
    /// One JSON object: items, a list of the faults, and periods, what the control did before one.
    #[arg(long)]
    pub(crate) json: bool,
    /// Also write the record to a file for siskin-emulator plot; its name ends in .bin.
    #[arg(long, value_name = "FILE.bin")]
    pub(crate) save: Option<PathBuf>,
}

/// What to decode.
#[derive(Debug, Args)]
pub(crate) struct DecodeArgs {
    /// File to read.
    pub(crate) capture: PathBuf,
    #[command(flatten)]
    pub(crate) options: decode::Options,
}

/// What to make an image from.
#[derive(Debug, Args)]
pub(crate) struct ImageArgs {
    /// Image as linked; without it, one is built for --board.
    pub(crate) elf: Option<PathBuf>,
    /// Board to make it for.
    #[arg(long)]
    pub(crate) board: Option<Board>,
    /// Parts of the drive, where the board has no room for all: 'flight' (without it), 'papers', or a list such as
    /// 'identification,record,hall'.
    #[arg(long, value_name = "LIST", requires = "board", conflicts_with = "elf")]
    pub(crate) parts: Option<Parts>,
    /// Folder for the files.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

/// What to flash, and how.
#[derive(Debug, Args)]
pub(crate) struct FlashArgs {
    /// Image, as made by 'siskin image' or as linked.
    pub(crate) elf: PathBuf,
    /// Connected board; an image for another is refused.
    #[arg(long)]
    pub(crate) board: Option<Board>,
    /// Debug probe if several are connected: VID:PID or VID:PID:SERIAL.
    #[arg(long, value_name = "SELECTOR", conflicts_with = "dfu")]
    pub(crate) probe: Option<String>,
    /// Use the chip's own bootloader, over USB.
    #[arg(long)]
    pub(crate) dfu: bool,
}

/// Parameters without an ESC.
#[derive(Debug, Args)]
pub(crate) struct GivenArgs {
    /// Parameters as 'siskin params save' writes them; without it, the factory values. --component selects one
    /// of several components in the file.
    pub(crate) file: Option<PathBuf>,
    /// A parameter that overrides the file's, for example PWM_FREQ_HZ=48000.
    #[arg(long = "param", value_name = "NAME=VALUE")]
    pub(crate) params: Vec<String>,
}

/// What to compute settings from.
#[derive(Debug, Args)]
pub(crate) struct TuneArgs {
    #[command(flatten)]
    pub(crate) given: GivenArgs,
    /// KV as on the motor's label, rpm/V, for MOT_FLUX_MWB.
    #[arg(long, value_name = "RPM_V", value_parser = positive)]
    pub(crate) kv: Option<f64>,
    /// Poles of the motor, twice MOT_POLE_PAIRS.
    #[arg(long, value_name = "N", value_parser = even)]
    pub(crate) poles: Option<u32>,
    /// Voltage of the supply for the top speed, LIM_BUS_V_MIN to LIM_BUS_V_MAX; without it, LIM_BUS_V_MAX.
    #[arg(long, value_name = "V", value_parser = positive)]
    pub(crate) supply: Option<f64>,
    /// Write the motor's parameters and the settings to a file for 'siskin params load'.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// One JSON object: each setting by its name.
    #[arg(long)]
    pub(crate) json: bool,
    /// With --json, add the top speed and what bounds it as `top_speed`: null if the parameters make no drive.
    #[arg(long, requires = "json")]
    pub(crate) top_speed: bool,
}

/// What to compute a budget from.
#[derive(Debug, Args)]
pub(crate) struct BudgetArgs {
    #[command(flatten)]
    pub(crate) given: GivenArgs,
    /// Largest angle error, electrical degrees.
    #[arg(long, value_name = "DEG", default_value_t = 20.0, value_parser = positive)]
    pub(crate) error: f64,
    /// Poles of the motor, twice MOT_POLE_PAIRS.
    #[arg(long, value_name = "N", conflicts_with = "pole_pairs", value_parser = even)]
    pub(crate) poles: Option<u32>,
    /// Pole pairs of the motor, for MOT_POLE_PAIRS.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) pole_pairs: Option<u32>,
    /// Largest acceleration, rpm/s, for CTL_SLEW_RPM_S.
    #[arg(long, value_name = "RPM_S", value_parser = not_negative)]
    pub(crate) acceleration: Option<f64>,
    /// Largest deceleration, rpm/s; without it, the acceleration.
    #[arg(long, value_name = "RPM_S", value_parser = not_negative)]
    pub(crate) braking: Option<f64>,
    /// PWM and sampling frequency, Hz, for PWM_FREQ_HZ.
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(crate) pwm: Option<f64>,
    /// N, electrical turns over which the speed is measured once, as in the paper; without it, CTL_POS_N turns
    /// at every crossing, as in the drive.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) turns: Option<f64>,
    /// A_e, share of the extrapolated angle that a crossing leaves, for CTL_AE.
    #[arg(long, value_name = "A_E", value_parser = share)]
    pub(crate) a_e: Option<f64>,
    /// Time constant of the flux integrator, s, or inf; without it, what follows from CTL_RPM_MIN and
    /// STA_RUN_RPM. Acts alone unless --tau-hpfs is given.
    #[arg(long, value_name = "S", value_parser = time_constant)]
    pub(crate) tau_int: Option<f64>,
    /// Time constant of the second-order form's high-pass, s.
    #[arg(long, value_name = "S", value_parser = time_constant)]
    pub(crate) tau_hpfs: Option<f64>,
    /// Hold-off after a crossing, us; without it, the drive's 5 % of the time between two.
    #[arg(long, value_name = "US", value_parser = not_negative)]
    pub(crate) hold_off: Option<f64>,
    /// One JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

fn number(text: &str, fits: impl Fn(f64) -> bool, wanted: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| fits(*number));
    number.ok_or_else(|| format!("give {wanted}"))
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0 && x.is_finite(), "a number above 0")
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0 && x.is_finite(), "a number of 0 or more")
}

fn share(text: &str) -> Result<f64, String> {
    number(
        text,
        |x| (0.0..1.0).contains(&x),
        "a number from 0 to below 1",
    )
}

fn time_constant(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "seconds above 0, or inf")
}

fn even(text: &str) -> Result<u32, String> {
    let poles = text.parse::<u32>().ok();
    let poles = poles.filter(|poles| *poles >= 2 && poles % 2 == 0);
    poles.ok_or_else(|| "give an even number of 2 or more".to_owned())
}
