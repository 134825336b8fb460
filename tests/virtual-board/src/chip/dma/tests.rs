use super::*;

const STATUS: u32 = 0x00;
const CLEAR: u32 = 0x04;
/// Registers of the second channel.
const CONTROL: u32 = 0x1c;
const COUNT: u32 = 0x20;
const PART: u32 = 0x24;
const MEMORY: u32 = 0x28;

const EN: u32 = 1;
const TCIE: u32 = 1 << 1;
const HTIE: u32 = 1 << 2;
const FROM_MEMORY: u32 = 1 << 4;
const CIRC: u32 = 1 << 5;
const MINC: u32 = 1 << 7;
const WORDS: u32 = 2 << 8 | 2 << 10;

fn with<T>(act: impl FnOnce(&mut Context) -> T) -> (T, Vec<Signal>) {
    let mut signals = Vec::new();
    let mut context = Context {
        now: 0,
        signals: &mut signals,
    };
    let result = act(&mut context);
    (result, signals)
}

fn write(dma: &mut Dma, offset: u32, value: u32) -> Result<Vec<Signal>, Unmodelled> {
    let (result, signals) = with(|context| dma.write(offset, value, context));
    result.map(|()| signals)
}

fn read(dma: &mut Dma, offset: u32) -> u32 {
    with(|context| dma.read(offset, context)).0.unwrap()
}

/// The second channel with `count` data, as embassy-stm32 sets it up.
fn set_up(count: u32, control: u32) -> Dma {
    let mut dma = Dma::new();
    for (offset, value) in [
        (PART, 0x4000_0034),
        (MEMORY, 0x2000_0100),
        (COUNT, count),
        (CONTROL, control),
    ] {
        assert_eq!(write(&mut dma, offset, value).unwrap(), []);
    }
    assert_eq!(dma.request(1), None, "it is not on yet");
    assert_eq!(write(&mut dma, CONTROL, control | EN).unwrap(), []);
    dma
}

/// Moves a datum; returns its destination and the signals.
fn step(dma: &mut Dma) -> (u32, Vec<Signal>) {
    let transfer = dma.request(1).unwrap();
    let ((), signals) = with(|context| dma.done(transfer.channel, context));
    (transfer.to, signals)
}

const UP: Signal = Signal::Interrupt(12, true);
const DOWN: Signal = Signal::Interrupt(12, false);

#[test]
fn a_ring_tells_at_its_half_and_its_end_and_goes_on() {
    let mut dma = set_up(4, CIRC | MINC | WORDS | HTIE | TCIE);
    let half = 1 << 6 | 1 << 4;
    let end = 1 << 5 | 1 << 4;
    for _ in 0..2 {
        assert_eq!(step(&mut dma), (0x2000_0100, vec![]));
        assert_eq!(read(&mut dma, STATUS), 0);
        assert_eq!(step(&mut dma), (0x2000_0104, vec![UP]));
        assert_eq!(read(&mut dma, STATUS), half);
        assert_eq!(read(&mut dma, COUNT), 2);
        assert_eq!(write(&mut dma, CLEAR, 1 << 6).unwrap(), [DOWN]);
        assert_eq!(step(&mut dma), (0x2000_0108, vec![]));
        assert_eq!(step(&mut dma), (0x2000_010c, vec![UP]));
        assert_eq!(read(&mut dma, STATUS), end);
        assert_eq!(read(&mut dma, COUNT), 4);
        assert_eq!(write(&mut dma, CLEAR, 1 << 4).unwrap(), [DOWN]);
    }
}

#[test]
fn what_goes_once_stops_until_it_is_set_up_anew() {
    let control = FROM_MEMORY | MINC | TCIE;
    let mut dma = set_up(2, control);
    let wanted = Transfer {
        channel: 1,
        from: 0x2000_0100,
        to: 0x4000_0034,
        from_width: Width::Byte,
        to_width: Width::Byte,
    };
    assert_eq!(dma.request(1), Some(wanted));
    // The half-transfer flag raises no interrupt.
    assert_eq!(step(&mut dma), (0x4000_0034, vec![]));
    let second = Transfer {
        from: 0x2000_0101,
        ..wanted
    };
    assert_eq!(dma.request(1), Some(second));
    assert_eq!(step(&mut dma).1, [UP]);
    assert_eq!(dma.request(1), None);
    assert_eq!(read(&mut dma, COUNT), 0);
    assert_eq!(read(&mut dma, STATUS), 0b0111 << 4);
    assert_eq!(write(&mut dma, CONTROL, control).unwrap(), []);
    assert_eq!(write(&mut dma, CLEAR, 0b1110 << 4).unwrap(), [DOWN]);
    write(&mut dma, COUNT, 1).unwrap();
    write(&mut dma, CONTROL, control | EN).unwrap();
    assert_eq!(dma.request(1), Some(wanted));
}

#[test]
fn registers_stand_while_a_channel_is_on_and_memory_to_memory_is_refused() {
    let control = CIRC | MINC | WORDS;
    let mut dma = set_up(4, control);
    for (offset, value) in [
        (PART, 0),
        (MEMORY, 0),
        (COUNT, 1),
        (CONTROL, control & !MINC | EN),
        // The first and the seventh channel's control registers.
        (0x08, 1 << 14),
        (0x80, 0),
    ] {
        let written = write(&mut dma, offset, value);
        assert_eq!(written, Err(Unmodelled), "{offset:#x}");
    }
    // Leaving circular mode lets it run to its end.
    write(&mut dma, CONTROL, control & !CIRC | EN).unwrap();
    step(&mut dma);
    write(&mut dma, CONTROL, control).unwrap();
    assert_eq!(dma.request(1), None);
    let again = write(&mut dma, CONTROL, control | EN);
    assert_eq!(again, Err(Unmodelled), "amidst");
}
