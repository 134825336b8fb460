use super::*;

/// 115200 baud at 170 MHz, as the HAL rounds it, in cycles per bit.
const DIVIDER: u32 = 1476;
const BYTE: Cycles = 14_760;

const FIFO_ON: u32 = 1 << 29;
/// UE, RE, TE.
const ON: u32 = 1 | 1 << 2 | 1 << 3;
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

/// A USART with its time.
struct Bench {
    usart: Usart,
    now: Cycles,
    heard: Vec<(Cycles, Signal)>,
}

impl Bench {
    /// Creates one that is on, with its preamble over.
    fn new(control: u32, transfers: u32) -> Self {
        let mut bench = Self {
            usart: Usart::second(),
            now: 0,
            heard: Vec::new(),
        };
        bench.write(BRR, DIVIDER);
        bench.write(PRESC, 0);
        bench.write(CR2, 0);
        bench.write(CR1, control);
        bench.run_to(BYTE);
        bench.write(CR3, transfers);
        bench
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut Usart, &mut Context) -> T) -> T {
        let mut signals = Vec::new();
        let now = self.now;
        let mut context = Context {
            now,
            signals: &mut signals,
        };
        let result = act(&mut self.usart, &mut context);
        self.heard
            .extend(signals.into_iter().map(|signal| (now, signal)));
        result
    }

    fn read(&mut self, offset: u32) -> u32 {
        self.with(|part, context| part.read(offset, context))
            .expect("modelled")
    }

    fn try_write(&mut self, offset: u32, value: u32) -> Result<(), Unmodelled> {
        self.with(|part, context| part.write(offset, value, context))
    }

    fn write(&mut self, offset: u32, value: u32) {
        self.try_write(offset, value).expect("modelled");
    }

    fn flags(&mut self) -> Isr {
        Isr(self.read(ISR))
    }

    fn run_to(&mut self, end: Cycles) {
        while self.usart.due() <= end {
            self.now = self.usart.due();
            self.with(Part::act);
        }
        self.now = end;
    }

    fn sent(&self) -> Vec<(Cycles, u8)> {
        let sent = |&(at, signal): &_| match signal {
            Signal::Sent { usart: 2, byte } => Some((at, byte)),
            _ => None,
        };
        self.heard.iter().filter_map(sent).collect()
    }

    fn count(&self, signal: Signal) -> usize {
        self.heard.iter().filter(|heard| heard.1 == signal).count()
    }
}

#[test]
fn bytes_leave_one_after_the_other_and_the_last_completes() {
    let mut bench = Bench::new(ON | FIFO_ON, 0);
    let start = bench.now;
    assert!(bench.flags().tc());
    for byte in *b"abc" {
        bench.write(TDR, byte.into());
    }
    assert!(!bench.flags().tc());
    bench.run_to(start + 3 * BYTE - 1);
    assert!(!bench.flags().tc());
    bench.run_to(start + 3 * BYTE);
    assert!(bench.flags().tc());
    let at = |bytes| start + bytes * BYTE;
    assert_eq!(bench.sent(), [(at(1), b'a'), (at(2), b'b'), (at(3), b'c')]);
}

#[test]
fn the_first_byte_waits_for_the_preamble() {
    let mut bench = Bench::new(0, 0);
    bench.write(CR1, ON);
    let start = bench.now;
    bench.run_to(start + 100);
    bench.write(TDR, 1);
    bench.run_to(start + 10 * BYTE);
    assert_eq!(bench.sent(), [(start + 2 * BYTE, 1)]);
}

#[test]
fn completion_interrupts_until_it_is_cleared() {
    let mut bench = Bench::new(ON, 0);
    let start = bench.now;
    bench.write(TDR, 1);
    bench.write(CR1, ON | 1 << 6);
    assert_eq!(bench.count(Signal::Interrupt(38, true)), 0);
    bench.run_to(start + BYTE);
    let last = bench.heard.last().copied();
    assert_eq!(last, Some((start + BYTE, Signal::Interrupt(38, true))));
    bench.write(ICR, 1 << 6);
    assert_eq!(bench.count(Signal::Interrupt(38, false)), 1);
    assert!(!bench.flags().tc());
}

#[test]
fn without_fifo_two_bytes_are_taken_and_with_it_nine() {
    for (control, bytes) in [(ON, 2), (ON | FIFO_ON, 9)] {
        let mut bench = Bench::new(control, 0);
        for _ in 0..bytes {
            assert!(bench.flags().txe());
            bench.write(TDR, 0);
        }
        assert!(!bench.flags().txe());
        assert_eq!(bench.try_write(TDR, 0), Err(Unmodelled));
        bench.run_to(bench.now + BYTE);
        assert!(bench.flags().txe());
    }
}

#[test]
fn the_transmitter_asks_for_a_transfer_a_byte() {
    let mut bench = Bench::new(ON, DMAT);
    let request = Signal::Request(27);
    assert_eq!(bench.count(request), 1);
    assert_eq!(bench.usart.requests().last(), Some(27));
    // The first moves to the line, so the register is free again; the second stays in it.
    bench.write(TDR, 1);
    assert_eq!(bench.count(request), 2);
    bench.write(TDR, 2);
    assert_eq!(bench.count(request), 2);
    assert_eq!(bench.usart.requests().last(), None);
    bench.run_to(bench.now + BYTE);
    assert_eq!(bench.count(request), 3);
    bench.write(CR3, 0);
    assert_eq!(bench.usart.requests().last(), None);
}

#[test]
fn bytes_come_at_the_rate_and_each_asks_for_a_transfer() {
    let mut bench = Bench::new(ON | FIFO_ON, DMAR);
    let start = bench.now;
    bench.usart.queue(b"xy", start);
    bench.run_to(start + BYTE - 1);
    assert!(!bench.flags().rxne());
    bench.run_to(start + BYTE);
    assert!(bench.flags().rxne());
    assert_eq!(bench.count(Signal::Request(26)), 1);
    assert_eq!(bench.read(RDR), u32::from(b'x'));
    assert!(!bench.flags().rxne());
    bench.run_to(start + 2 * BYTE);
    assert_eq!(bench.count(Signal::Request(26)), 2);
    assert_eq!(bench.read(RDR), u32::from(b'y'));
    assert_eq!(bench.count(Signal::Request(26)), 2);
}

#[test]
fn a_quiet_frame_after_the_last_byte_is_idle_once() {
    let mut bench = Bench::new(ON | FIFO_ON | 1 << 4, 0);
    let start = bench.now;
    bench.usart.queue(b"xy", start);
    bench.run_to(start + 3 * BYTE - 1);
    assert!(!bench.flags().idle());
    bench.run_to(start + 3 * BYTE);
    assert!(bench.flags().idle());
    let last = bench.heard.last().copied();
    assert_eq!(last, Some((start + 3 * BYTE, Signal::Interrupt(38, true))));
    bench.write(ICR, 1 << 4);
    assert_eq!(bench.count(Signal::Interrupt(38, false)), 1);
    bench.run_to(start + 20 * BYTE);
    assert!(!bench.flags().idle());
}

#[test]
fn a_byte_within_the_quiet_frame_puts_idle_off() {
    let mut bench = Bench::new(ON, 0);
    let start = bench.now;
    bench.usart.queue(b"x", start);
    bench.run_to(start + BYTE + BYTE / 2);
    bench.read(RDR);
    bench.usart.queue(b"y", bench.now);
    bench.run_to(start + 3 * BYTE);
    assert!(!bench.flags().idle());
    bench.run_to(start + 3 * BYTE + BYTE / 2);
    assert!(bench.flags().idle());
}

#[test]
fn bytes_that_nobody_fetches_overrun() {
    for (control, room) in [(ON, 1), (ON | FIFO_ON, 9)] {
        let mut bench = Bench::new(control, 1);
        let start = bench.now;
        bench.usart.queue(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], start);
        bench.run_to(start + room * BYTE);
        assert!(!bench.flags().ore());
        bench.run_to(start + (room + 1) * BYTE);
        assert!(bench.flags().ore());
        assert_eq!(bench.count(Signal::Interrupt(38, true)), 1);
        bench.run_to(start + 10 * BYTE);
        for byte in 1..=room {
            assert_eq!(Cycles::from(bench.read(RDR)), byte);
        }
        assert!(!bench.flags().rxne());
    }
}

#[test]
fn what_comes_to_a_receiver_that_is_off_is_lost() {
    let mut bench = Bench::new(1 | 1 << 3, 0);
    bench.usart.queue(b"x", bench.now);
    assert_eq!(bench.usart.due(), NEVER);
    // Switched off in the middle of a byte.
    let mut bench = Bench::new(ON, 0);
    bench.usart.queue(b"xy", bench.now);
    bench.write(CR1, 0);
    assert_eq!(bench.usart.due(), NEVER);
    bench.write(CR1, ON);
    bench.run_to(10 * BYTE);
    assert!(!bench.flags().rxne());
}

#[test]
fn the_rate_is_the_clock_over_the_divider() {
    let mut bench = Bench::new(ON, 0);
    let baud = bench.usart.baud().expect("it is on");
    assert!((baud - 115_176.15).abs() < 0.01);
    bench.write(CR1, 0);
    assert_eq!(bench.usart.baud(), None);
}

#[test]
fn what_is_not_modelled_is_refused() {
    let mut bench = Bench::new(ON, 0);
    for (offset, value) in [
        // Oversampling by 8, a FIFO while it is on, two stop bits, half duplex, a prescaler, a rate while
        // it is on, a break, the time-out.
        (CR1, ON | 1 << 15),
        (CR1, ON | FIFO_ON),
        (CR2, 2 << 12),
        (CR3, 1 << 3),
        (PRESC, 1),
        (BRR, 100),
        (RQR, 1 << 1),
        (0x14, 0),
    ] {
        assert_eq!(bench.try_write(offset, value), Err(Unmodelled), "{offset}");
    }
    bench.write(CR1, 0);
    bench.write(BRR, 15);
    assert_eq!(bench.try_write(CR1, ON), Err(Unmodelled));
}

#[test]
fn a_reset_takes_the_interrupt_back() {
    let mut bench = Bench::new(ON | 1 << 7, 0);
    assert_eq!(bench.count(Signal::Interrupt(38, true)), 1);
    bench.with(Usart::reset);
    assert_eq!(bench.count(Signal::Interrupt(38, false)), 1);
    assert_eq!(bench.read(CR1), 0);
    assert_eq!(bench.read(ISR), 0xc0);
}
