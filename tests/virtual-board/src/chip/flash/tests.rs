use super::*;

const KEY: u32 = 0x08;
const STATUS: u32 = 0x10;
const CONTROL: u32 = 0x14;
const TORN: u32 = 0x18;

const PG: u32 = 1;
const PER: u32 = 1 << 1;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const LOCK: u32 = 1 << 31;

const EOP: u32 = 1;
const PROGERR: u32 = 1 << 3;
const WRPERR: u32 = 1 << 4;
const PGAERR: u32 = 1 << 5;
const SIZERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;

const STORE: u32 = 0x0801_f000;
/// The store's first page in the flash.
const PAGE: u32 = 62;

/// The flash with what its owner knows.
struct Bench {
    flash: Flash,
    now: Cycles,
    signals: Vec<Signal>,
}

impl Bench {
    fn new() -> Self {
        let memory = Memory::new(ORIGIN, 128 * 1024, 0xff);
        Self {
            flash: Flash::new(memory, STORE..ORIGIN + 128 * 1024),
            now: 0,
            signals: Vec::new(),
        }
    }

    fn open() -> Self {
        let mut bench = Self::new();
        bench.set(KEY, KEYS[0]);
        bench.set(KEY, KEYS[1]);
        bench
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut Flash, &mut Context) -> T) -> T {
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        act(&mut self.flash, &mut context)
    }

    fn try_set(&mut self, offset: u32, value: u32) -> Result<(), Unmodelled> {
        self.with(|flash, context| flash.write(offset, value, context))
    }

    fn set(&mut self, offset: u32, value: u32) {
        self.try_set(offset, value).unwrap();
    }

    fn get(&mut self, offset: u32) -> u32 {
        self.with(|flash, context| flash.read(offset, context).unwrap())
    }

    fn put(&mut self, address: u32, width: Width, value: u32) {
        self.with(|flash, context| flash.array_write(address, width, value, context).unwrap());
    }

    fn word(&mut self, address: u32) -> u64 {
        let mut half = |address| {
            let read = self.with(|flash, context| flash.array_read(address, Width::Word, context));
            u64::from(read.unwrap())
        };
        half(address) | half(address + 4) << 32
    }

    /// Programs without waiting for completion.
    fn program(&mut self, address: u32, word: u64) {
        self.set(CONTROL, PG);
        self.put(address, Width::Word, word as u32);
        self.put(address + 4, Width::Word, (word >> 32) as u32);
    }

    fn wait(&mut self) {
        self.now = self.flash.due();
        self.with(Part::act);
    }
}

#[test]
fn keys_open_the_control_register_and_a_wrong_one_shuts_it() {
    let mut bench = Bench::new();
    assert_eq!(bench.get(CONTROL), LOCK | 1 << 30);
    bench.set(CONTROL, PG);
    assert_eq!(bench.get(CONTROL), LOCK | 1 << 30, "locked");
    bench.set(KEY, KEYS[0]);
    bench.set(KEY, KEYS[1]);
    bench.set(CONTROL, PG);
    assert_eq!(bench.get(CONTROL), PG | 1 << 30);
    bench.set(CONTROL, LOCK);
    assert_eq!(bench.get(CONTROL), LOCK | 1 << 30);

    bench.set(KEY, KEYS[1]);
    for key in KEYS {
        bench.set(KEY, key);
    }
    assert_eq!(bench.get(CONTROL), LOCK | 1 << 30, "shut");
    bench.with(|flash, context| flash.reset(0, context));
    for key in KEYS {
        bench.set(KEY, key);
    }
    assert_eq!(bench.get(CONTROL), 1 << 30);
}

#[test]
fn a_double_word_is_programmed_by_its_second_half_in_82_us() {
    let mut bench = Bench::open();
    bench.set(CONTROL, PG);
    bench.put(STORE + 8, Width::Word, 0x3322_1100);
    assert_eq!(bench.get(STATUS), 0);
    assert_eq!(bench.flash.due(), NEVER);
    bench.now = 1000;
    bench.put(STORE + 12, Width::Word, 0x7766_5544);
    let ends = 1000 + 13_889;
    assert_eq!((bench.flash.due(), bench.flash.busy_until()), (ends, ends));
    bench.now = ends - 1;
    assert_eq!(bench.get(STATUS), BSY);
    assert_eq!(bench.try_set(CONTROL, 0), Err(Unmodelled));
    let read = bench.with(|flash, context| flash.array_read(STORE, Width::Byte, context));
    assert_eq!(read, Err(Unmodelled));
    bench.now = ends;
    // No end of operation without its interrupt.
    assert_eq!(bench.get(STATUS), 0);
    assert_eq!(bench.word(STORE + 8), 0x7766_5544_3322_1100);
    assert_eq!(bench.word(STORE), ERASED);
    assert_eq!(bench.word(STORE + 16), ERASED);
    let change = Change::Programmed {
        offset: 8,
        bytes: [0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77],
    };
    assert_eq!(bench.flash.take_changes(), [change]);
    assert_eq!(bench.flash.take_changes(), []);
    assert_eq!(bench.signals, []);
}

const ERASED: u64 = u64::MAX;

#[test]
fn a_word_is_programmed_once_but_for_zeros() {
    let mut bench = Bench::open();
    bench.program(STORE, 0x1234);
    bench.wait();
    bench.program(STORE, 0x1230);
    assert_eq!(bench.get(STATUS), PROGERR);
    // The error must be cleared first.
    bench.program(STORE + 8, 1);
    assert_eq!(bench.get(STATUS), PROGERR | PGSERR);
    bench.set(STATUS, PROGERR | PGSERR);
    assert_eq!(bench.get(STATUS), 0);
    assert_eq!(bench.word(STORE), 0x1234);
    assert_eq!(bench.word(STORE + 8), ERASED);
    bench.program(STORE, 0);
    bench.wait();
    assert_eq!(bench.get(STATUS), 0);
    assert_eq!(bench.word(STORE), 0);
}

#[test]
fn wrong_writes_have_their_errors() {
    let mut bench = Bench::open();
    bench.put(STORE, Width::Word, 1);
    assert_eq!(bench.get(STATUS), PGSERR);

    let mut bench = Bench::open();
    bench.set(CONTROL, PG);
    bench.put(STORE, Width::Byte, 1);
    assert_eq!(bench.get(STATUS), SIZERR);

    let mut bench = Bench::open();
    bench.set(CONTROL, PG);
    bench.put(STORE, Width::Word, 1);
    bench.put(STORE + 12, Width::Word, 1);
    assert_eq!(bench.get(STATUS), PGAERR);

    let mut bench = Bench::open();
    bench.set(CONTROL, PG | PER);
    assert_eq!(bench.get(STATUS), PGSERR);

    let mut bench = Bench::open();
    bench.flash.fail(true);
    bench.program(STORE, 1);
    assert_eq!(bench.get(STATUS), WRPERR);
    bench.set(STATUS, WRPERR);
    bench.set(CONTROL, PER | PAGE << 3 | STRT);
    assert_eq!(bench.get(STATUS), WRPERR);
    assert_eq!(bench.word(STORE), ERASED);
}

#[test]
fn a_page_is_erased_in_22_ms_and_no_other() {
    let mut bench = Bench::open();
    for address in [STORE, STORE + 2048] {
        bench.program(address, 7);
        bench.wait();
    }
    bench.flash.take_changes();
    let started = bench.now;
    bench.set(CONTROL, PER | (PAGE + 1) << 3);
    bench.set(CONTROL, PER | (PAGE + 1) << 3 | STRT | EOPIE);
    assert_eq!(bench.get(STATUS), BSY);
    assert_eq!(bench.get(CONTROL) & STRT, STRT);
    assert_eq!(bench.flash.due() - started, 3_743_400);
    bench.wait();
    assert_eq!(bench.get(CONTROL) & STRT, 0);
    assert_eq!(bench.get(STATUS), EOP);
    assert_eq!(bench.signals, [Signal::Interrupt(4, true)]);
    bench.set(STATUS, EOP);
    assert_eq!(bench.signals[1..], [Signal::Interrupt(4, false)]);
    let words = [0, 2048].map(|offset| bench.word(STORE + offset));
    assert_eq!(words, [7, ERASED]);
    let change = Change::Erased { offset: 2048 };
    assert_eq!(bench.flash.take_changes(), [change]);
    // The program's pages, and a mass erase.
    for control in [PER | (PAGE - 1) << 3 | STRT, 1 << 2 | STRT] {
        assert_eq!(bench.try_set(CONTROL, control), Err(Unmodelled));
    }
}

#[test]
fn a_torn_word_raises_the_non_maskable_interrupt_until_it_is_acknowledged() {
    let mut bench = Bench::open();
    let word = 0x0123_4567_89ab_cdef;
    bench.program(STORE + 16, word);
    bench.now += 100;
    bench.with(|flash, context| flash.reset(1, context));
    bench.now += 100_000;
    assert_eq!(bench.get(STATUS), 0);
    let torn = bench.word(STORE + 16);
    assert!(torn != word && torn != ERASED);
    assert_eq!(torn & word, word, "no bit is cleared that was not to be");
    // Both halves were read, but it is reported once.
    assert_eq!(bench.signals, [Signal::NonMaskable(true)]);
    let status = bench.get(TORN);
    assert_eq!(status, 1 << 31 | 0x1_f010);
    bench.set(TORN, status);
    assert_eq!(bench.signals[1..], [Signal::NonMaskable(false)]);
    assert_eq!(bench.get(TORN) >> 31, 0);
    bench.word(STORE + 8);
    bench.word(STORE + 24);
    assert_eq!(bench.signals.len(), 2, "its neighbours are whole");
    bench.word(STORE + 16);
    assert_eq!(bench.signals[2..], [Signal::NonMaskable(true)]);
    bench.with(|flash, context| flash.reset(1, context));
    assert_eq!(bench.signals[3..], [Signal::NonMaskable(false)]);

    // An erase makes it whole again.
    for key in KEYS {
        bench.set(KEY, key);
    }
    bench.set(CONTROL, PER | PAGE << 3 | STRT);
    bench.wait();
    assert_eq!(bench.word(STORE + 16), ERASED);
    assert_eq!(bench.signals.len(), 4);
}

#[test]
fn what_has_ended_before_the_power_fails_is_whole() {
    let mut bench = Bench::open();
    bench.program(STORE, 5);
    bench.now = bench.flash.due();
    bench.with(|flash, context| flash.reset(1, context));
    assert_eq!(bench.word(STORE), 5);
    assert_eq!(bench.signals, []);
}

#[test]
fn an_erase_that_is_cut_off_leaves_a_mixture() {
    let mut bench = Bench::open();
    for word in 0..256 {
        bench.program(STORE + 8 * word, 0);
        bench.wait();
    }
    bench.flash.take_changes();
    bench.set(CONTROL, PER | PAGE << 3 | STRT);
    bench.now += 1000;
    bench.with(|flash, context| flash.reset(3, context));
    let words: Vec<_> = (0..256).map(|word| bench.word(STORE + 8 * word)).collect();
    let ones: u32 = words.iter().map(|word| word.count_ones()).sum();
    assert!((6_000..10_000).contains(&ones), "{ones} of 16384");
    assert_eq!(bench.signals, [Signal::NonMaskable(true)]);
    // A copy kept elsewhere gets the same from the changes.
    let mut kept = vec![0; 2048];
    for change in bench.flash.take_changes() {
        match change {
            Change::Erased { offset } => {
                kept[offset as usize..][..2048].fill(0xff);
            }
            Change::Programmed { offset, bytes } => {
                kept[offset as usize..][..8].copy_from_slice(&bytes);
            }
        }
    }
    let wanted: Vec<_> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    assert_eq!(kept, wanted);
}

#[test]
fn the_seed_decides_what_is_torn() {
    let torn = |seed| {
        let mut bench = Bench::open();
        bench.program(STORE, 0x5555_0000_ffff_1234);
        bench.with(|flash, context| flash.reset(seed, context));
        bench.word(STORE)
    };
    assert_eq!(torn(1), torn(1));
    assert_ne!(torn(1), torn(2));
}

#[test]
fn caches_are_emptied_while_they_are_off() {
    let mut bench = Bench::new();
    assert_eq!(bench.get(0x00), 0x0004_0600);
    assert_eq!(bench.try_set(0x00, 0x0004_1604), Err(Unmodelled));
    for access in [0x0004_0204, 0x0004_1204, 0x0004_0204, 0x0004_0604] {
        bench.set(0x00, access);
    }
    assert_eq!(bench.flash.wait_states(), 4);
}
