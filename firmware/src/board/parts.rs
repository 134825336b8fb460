//! Parts that all boards have in common, given their timers, pins and channels.

/// Declares the throttle wire, the interrupt its task runs in, and the list of parts.
macro_rules! parts {
    (
        throttle: $pin:ident at $capture:ident $channel:ident,
        executor: $executor:ident,
        edges: $rising:ident $falling:ident,
        replies: $pace:ident $reply:ident $(,)?
    ) => {
        static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

        /// Starts the throttle task's executor, in the interrupt of an unused peripheral.
        pub(crate) fn start_executor() -> SendSpawner {
            EXECUTOR.start(interrupt::$executor)
        }

        #[interrupt]
        fn $executor() {
            // SAFETY: this is the interrupt in which the executor was started.
            unsafe { EXECUTOR.on_interrupt() }
        }

        /// Interrupt of the edge capture timer.
        #[interrupt]
        fn $capture() {
            capture::attend(wire::CAPTURE);
        }

        type Edges = ([dma::Channel<'static>; 2], [dma::Request; 2]);
        type Replies = (dma::Channel<'static>, dma::Request);

        /// Throttle wire.
        pub struct Throttle {
            pin: Peri<'static, $pin>,
            _timers: (Peri<'static, $capture>, Peri<'static, $pace>),
            rising: Peri<'static, $rising>,
            falling: Peri<'static, $falling>,
            reply: Peri<'static, $reply>,
        }

        impl Throttle {
            /// Returns the DMA channels of its edges, rising first, and that of its replies, each with its
            /// transfer request.
            pub(crate) fn open(self) -> (Edges, Replies) {
                // An unconnected wire is at rest. Dropping the pin would release it.
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

        /// The board's parts, set up.
        pub struct Hardware {
            /// Gate signals.
            pub bridge: Bridge,
            /// Currents, voltages and Hall sensors.
            pub converters: Converters,
            /// LED.
            pub light: Output<'static>,
            /// Throttle wire.
            pub throttle: Throttle,
            /// MAVLink's serial line.
            pub mavlink: Mavlink,
            /// KISS telemetry.
            pub kiss: Kiss,
            /// Flash that keeps the parameters.
            pub flash: Storage,
            /// Watchdog, not started yet.
            pub watchdog: Peri<'static, IWDG>,
            /// Thermistor.
            pub temperature: Temperature,
        }
    };
}
pub(super) use parts;
