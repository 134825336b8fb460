//! The parts that every board has alike, by its timers, pins and channels.

/// The throttle wire, the interrupt in which its task runs, and the list of the parts.
macro_rules! parts {
    (
        throttle: $pin:ident at $capture:ident $channel:ident,
        executor: $executor:ident,
        edges: $rising:ident $falling:ident,
        replies: $pace:ident $reply:ident $(,)?
    ) => {
        static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

        /// Starts the executor of the throttle's task, in an interrupt whose unit is not used.
        pub(crate) fn start_executor() -> SendSpawner {
            EXECUTOR.start(interrupt::$executor)
        }

        #[interrupt]
        fn $executor() {
            // SAFETY: it is the interrupt in which the executor is started.
            unsafe { EXECUTOR.on_interrupt() }
        }

        /// The timer that captures the edges.
        #[interrupt]
        fn $capture() {
            capture::attend(wire::CAPTURE);
        }

        type Edges = ([dma::Channel<'static>; 2], [dma::Request; 2]);
        type Replies = (dma::Channel<'static>, dma::Request);

        /// The throttle wire.
        pub struct Throttle {
            pin: Peri<'static, $pin>,
            _timers: (Peri<'static, $capture>, Peri<'static, $pace>),
            rising: Peri<'static, $rising>,
            falling: Peri<'static, $falling>,
            reply: Peri<'static, $reply>,
        }

        impl Throttle {
            /// Its edges' channels, those of the rising ones first, and that of its replies, each with what
            /// asks for a transfer.
            pub(crate) fn open(self) -> (Edges, Replies) {
                // A wire that is not connected is at rest. A dropped pin would be given back.
                mem::forget(CapturePin::<$capture, $channel>::new(self.pin, Pull::Up));
                let requests = [
                    Dma::<$capture, Ch1>::request(&*self.rising),
                    Dma::<$capture, Ch2>::request(&*self.falling),
                ];
                let channels = [
                    dma::Channel::new(self.rising, Interrupts),
                    dma::Channel::new(self.falling, Interrupts),
                ];
                let update = UpDma::<$pace>::request(&*self.reply);
                let reply = dma::Channel::new(self.reply, Interrupts);
                ((channels, requests), (reply, update))
            }
        }

        /// The parts of the board, set up.
        pub struct Hardware {
            /// Gate signals.
            pub bridge: Bridge,
            /// Currents, voltages and Hall sensors.
            pub converters: Converters,
            /// The LED.
            pub light: Output<'static>,
            /// The throttle wire.
            pub throttle: Throttle,
            /// MAVLink's serial line.
            pub mavlink: Mavlink,
            /// The KISS telemetry.
            pub kiss: Kiss,
            /// The flash that keeps the parameters.
            pub flash: Storage,
            /// The watchdog, which does not run yet.
            pub watchdog: Peri<'static, IWDG>,
            /// The thermistor.
            pub temperature: Temperature,
        }
    };
}
pub(super) use parts;
