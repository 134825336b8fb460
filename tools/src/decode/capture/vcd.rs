//! Value change dumps from sigrok-cli, PulseView, simulators, and the emulator's `--record`.

use std::collections::HashMap;
use std::io::{self, BufRead};

use vcd::{Command, IdCode, Parser, TimescaleUnit, Value};

use super::{Change, Reason, later, shown};

/// A dump being read.
pub(super) struct Vcd<R> {
    parser: Parser<R>,
    names: Vec<String>,
    places: HashMap<IdCode, usize>,
    tick: Tick,
    now_ns: i64,
}

/// The dump's time unit: `numerator / denominator` ns.
#[derive(Clone, Copy, Debug)]
struct Tick {
    numerator: u64,
    denominator: u64,
}

impl<R: BufRead> Vcd<R> {
    /// Reads the definitions. The channels are the one-bit variables.
    pub(super) fn open(input: R) -> Result<Self, Reason> {
        let mut parser = Parser::new(input);
        let mut names = Vec::new();
        let mut places = HashMap::new();
        let mut tick = None;
        let mut scopes = Vec::new();
        loop {
            match parser.next().transpose().map_err(reason)? {
                Some(Command::Timescale(count, unit)) => tick = Some(Tick::new(count, unit)),
                Some(Command::ScopeDef(_, name)) => scopes.push(shown(name.as_bytes())),
                Some(Command::Upscope) => {
                    scopes.pop();
                }
                Some(Command::VarDef(_, 1, code, name, _)) => {
                    // A second name for the same variable is not another channel.
                    places.entry(code).or_insert_with(|| {
                        names.push(full_name(&scopes, &name));
                        names.len() - 1
                    });
                }
                Some(Command::Enddefinitions) => break,
                Some(_) => {}
                None => return Err("it ends within its definitions; export it again".to_owned()),
            }
        }
        let tick = tick.ok_or("it has no $timescale; export it again")?;
        Ok(Self {
            parser,
            names,
            places,
            tick,
            now_ns: 0,
        })
    }

    pub(super) fn channels(&self) -> &[String] {
        &self.names
    }

    pub(super) fn now_ns(&self) -> i64 {
        self.now_ns
    }

    /// Returns the next level in the dump, changed or not.
    pub(super) fn next(&mut self) -> Result<Option<Change>, Reason> {
        loop {
            let command = match self.parser.next().transpose() {
                Ok(Some(command)) => command,
                // A dump cut off while being written is good up to there.
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
                Ok(None) => return Ok(None),
                Err(error) => return Err(reason(error)),
            };
            match command {
                Command::Timestamp(ticks) => {
                    let at_ns = self.tick.ns(ticks);
                    self.now_ns = later(Some(self.now_ns), at_ns, self.parser.line())?;
                }
                Command::ChangeScalar(code, level @ (Value::V0 | Value::V1)) => {
                    if let Some(&channel) = self.places.get(&code) {
                        return Ok(Some(Change {
                            at_ns: self.now_ns,
                            channel,
                            level: level == Value::V1,
                        }));
                    }
                }
                _ => {}
            }
        }
    }
}

impl Tick {
    fn new(count: u32, unit: TimescaleUnit) -> Self {
        let (numerator, denominator) = match unit {
            TimescaleUnit::S => (1_000_000_000, 1),
            TimescaleUnit::MS => (1_000_000, 1),
            TimescaleUnit::US => (1000, 1),
            TimescaleUnit::NS => (1, 1),
            TimescaleUnit::PS => (1, 1000),
            TimescaleUnit::FS => (1, 1_000_000),
        };
        Self {
            numerator: numerator * u64::from(count),
            denominator,
        }
    }

    /// Converts to the nearest nanosecond, saturating.
    fn ns(self, ticks: u64) -> i64 {
        let numerator = u128::from(ticks) * u128::from(self.numerator);
        let denominator = u128::from(self.denominator);
        i64::try_from((numerator + denominator / 2) / denominator).unwrap_or(i64::MAX)
    }
}

/// Returns a variable's name with its scopes, outermost first, as in `siskin.throttle.signal`.
fn full_name(scopes: &[String], name: &str) -> String {
    let mut full: String = scopes
        .iter()
        .flat_map(|scope| [scope.as_str(), "."])
        .collect();
    full += &shown(name.as_bytes());
    full
}

/// The parser's content errors name their line.
fn reason(error: io::Error) -> Reason {
    format!("{error}; export the capture again")
}
