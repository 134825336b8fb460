//! Compares each period of the chip's control word for word.
//!
//! At the interrupt's entry the test takes what it is going to read; at its return, what it has left: the
//! timer's compare values and main output, and the memory that it owns. The mirror runs the same period
//! here. Compare values and output must be equal at once; for each word of
//! [`State::trace`](siskin_control::drive::State::trace) there must be a place in that memory that has held
//! it after every period ([`places`](crate::places)).

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use siskin_emulator::fault::InForce;
use siskin_emulator::rig::{Period, Rig};
use siskin_vboard::image::Image;
use siskin_vboard::machine::VirtualBoard;
use siskin_vboard::world::{Moment, Probed};

use super::mirror::{Inputs, Mirror, Outputs};
use super::places::Places;
use super::scenario::{STEPS, Step, board, play, start};
use crate::common::papers;

/// The mirror, and how it agrees.
struct Check {
    mirror: Mirror,
    /// Addresses of the set-point word and of the flag that the flash is being written.
    setpoint_at: u32,
    writing_at: u32,
    /// Address and size of what the interrupt owns.
    owned: (u32, u32),
    inputs: Option<Inputs>,
    places: Places,
    words: Vec<u32>,
    /// Periods in each phase of the drive.
    phases: BTreeMap<String, u64>,
    /// The first period whose outputs differ: the inputs, what there was and what there should be.
    differs: Option<(u64, Inputs, Outputs, Outputs)>,
}

impl Check {
    fn new(image: &Image) -> Self {
        let address = |parts: &[&str]| image.symbol(parts).expect("the image has its symbols");
        Self {
            mirror: Mirror::new(),
            setpoint_at: address(&["exchange", "ends", "SETPOINT"]).0,
            writing_at: address(&["chip", "flash", "WRITING"]).0,
            owned: address(&["interrupt", "start", "INTERRUPT"]),
            inputs: None,
            places: Places::default(),
            words: Vec::new(),
            phases: BTreeMap::new(),
            differs: None,
        }
    }

    fn look(&mut self, moment: Moment, probed: &Probed) {
        match moment {
            Moment::Entered => self.inputs = Some(self.read(probed)),
            Moment::Left => {
                if let Some(inputs) = self.inputs.take() {
                    self.compare(&inputs, probed);
                }
            }
        }
    }

    fn read(&self, probed: &Probed) -> Inputs {
        let byte = |address: u32| probed.bytes(address, 1).map_or(0, |bytes| bytes[0]);
        let word = [0, 1, 2, 3].map(|at| byte(self.setpoint_at + at));
        Inputs {
            injected: probed.injected(),
            port_b: probed.port_b(),
            word: u32::from_le_bytes(word),
            broken: probed.broken_and_on().0,
            writing: byte(self.writing_at) != 0,
        }
    }

    fn compare(&mut self, inputs: &Inputs, probed: &Probed) {
        let wanted = self.mirror.period(inputs);
        let seen = Outputs {
            compares: probed.compares(),
            on: probed.broken_and_on().1,
        };
        if seen != wanted && self.differs.is_none() {
            self.differs = Some((self.places.periods, *inputs, seen, wanted));
        }
        *self.phases.entry(self.mirror.phase()).or_default() += 1;
        self.mirror.words(&mut self.words);
        let (address, bytes) = self.owned;
        let owned = probed.bytes(address, bytes).unwrap_or_default();
        self.places.look(&self.words, &owned);
    }
}

/// Speed of a rotor that turns backwards when the chip starts, rad/s: it is caught.
const TURNS_RAD_S: f64 = -600.0;

/// What a broken sensor shows, A: more than the drive's trip.
const STUCK_A: f64 = 38.0;

/// With this many values, a word is only found at its own place.
const TELLING: usize = 16;

/// Words that need not be there while traced as 0: angle and speed of a rotor that turns, which
/// [`State::trace`](siskin_control::drive::State::trace) reports as 0 otherwise, and which the memory keeps
/// from when it last turned.
const PAYLOAD: usize = 2;

/// Words that the memory holds as other numbers: the order of the phases, traced as whether it is swapped.
const CODED: usize = 1;

/// The second run: the shaft turns at first; full throttle; silence, and a rotor still turning is caught; a
/// sensor breaks; the shaft is held while running, and at a start.
fn trouble() -> [(InForce, Vec<Step>); 5] {
    let sound = InForce::default;
    let broken_sensor = InForce {
        stuck_a: [None, Some(STUCK_A), None],
        ..sound()
    };
    let held = InForce {
        blocked: true,
        ..sound()
    };
    let turns = vec![
        Step::command(350, 0),
        Step::throttle(900, 0.4),
        Step::throttle(1300, 1.0),
        Step::silence(1400),
        Step::command(1900, 0),
        Step::throttle(2700, 0.3),
    ];
    let again = vec![Step::command(3600, 0), Step::throttle(4600, 0.25)];
    let in_vain = vec![
        Step::throttle(4900, 0.25),
        Step::command(5500, 0),
        Step::throttle(7200, 0.25),
    ];
    [
        (sound(), turns),
        (broken_sensor, vec![Step::throttle(2800, 0.3)]),
        (sound(), again),
        (held, in_vain),
        (sound(), vec![Step::command(7400, 0)]),
    ]
}

#[test]
fn the_chip_s_control_state_is_the_shared_code_s_word_for_word() {
    // The image for flying changes its configuration as R and flux drift, which the mirror does not see.
    let image = papers();
    let check = Rc::new(RefCell::new(Check::new(&image)));
    let mut nobody = |_: f64, _: &Period, _: &Rig| {};

    let mut chip = board(&image, start());
    look_on(&mut chip, &check);
    play(&mut chip, &STEPS, &mut nobody);

    let mut turning = start();
    turning.bench.initial_rad_s = TURNS_RAD_S;
    let mut chip = board(&image, turning);
    look_on(&mut chip, &check);
    let mut before = InForce::default();
    for (now, steps) in trouble() {
        // The comparators are the chip's.
        let bench = chip.world().bench();
        bench.disturb(&before, &now);
        play(&mut chip, &steps, &mut nobody);
        before = now;
    }

    judge(&check.borrow());
}

/// Makes the mirror follow this chip, from power-up on.
fn look_on(chip: &mut VirtualBoard, check: &Rc<RefCell<Check>>) {
    check.borrow_mut().mirror = Mirror::new();
    let check = Rc::clone(check);
    chip.world()
        .probe(move |moment, probed| check.borrow_mut().look(moment, probed));
}

fn judge(check: &Check) {
    let places = &check.places;
    let words = || places.words.iter().enumerate();
    let with = |values: usize| words().filter(|(_, word)| word.values() >= values).count();
    println!(
        "{} periods; {} words, of which {} have changed, {} of them had {TELLING} values or more; {:?}",
        places.periods,
        places.words.len(),
        with(2),
        with(TELLING),
        check.phases
    );
    let still: Vec<_> = words()
        .filter_map(|(number, word)| (word.values() < 2).then_some(number))
        .collect();
    println!("words that have not changed: {still:?}");
    if let Some((period, inputs, seen, wanted)) = &check.differs {
        panic!("period {period}: {seen:x?} for {wanted:x?}, with {inputs:x?}");
    }
    let (mut payload, mut coded) = (0, 0);
    for (number, word) in words().filter(|(_, word)| word.places.is_empty()) {
        if word.codes.is_empty() {
            let (last, told) = (word.last_found, word.own_while_told());
            println!("word {number}: in all until period {last:?}; while it is told: {told:?}");
            assert!(!told.is_empty(), "word {number} is nowhere");
            payload += 1;
        } else {
            println!("word {number}: by other numbers, at {:?}", word.coded());
            coded += 1;
        }
    }
    assert!(payload <= PAYLOAD, "more words than a payload's");
    assert!(coded <= CODED, "more words than have other numbers");
    for (number, word) in words() {
        let found = word.own();
        if word.values() >= TELLING && !found.is_empty() {
            assert_eq!(
                found.len(),
                places.alike(word),
                "word {number} is at {found:?}"
            );
        }
    }
    for phase in [
        "Sense", "Charge", "Park", "Ramp", "Run", "Stopping", "Brake",
    ] {
        assert!(check.phases.contains_key(phase), "no period of {phase}");
    }
}
