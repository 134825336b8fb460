//! A conversation with one ESC: finds it, asks, and asks again if an answer is lost.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType,
};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, Message as _, MessageData};
use siskin_control::mavlink::{Address, Frame, Receiver};

use crate::error::Error;
use crate::interrupt::Interrupt;
use crate::link::Link;
use crate::message::{Incoming, Message, Texts, name_of};
use crate::signing::{self, Key, Signer};

/// This program on the network: a ground station with its customary ids.
const OWN: MavHeader = MavHeader {
    system_id: 255,
    component_id: 190,
    sequence: 0,
};

/// How long to wait for a heartbeat, which comes once a second.
const FIND_TIMEOUT: Duration = Duration::from_secs(3);

/// How often a question is asked before the ESC counts as silent. With one packet in five lost in either
/// direction, 64 % of the attempts succeed, and one question in 3500 fails.
pub(crate) const ATTEMPTS: u32 = 8;

/// How long to wait for an answer. 40 ms is enough for a question and an answer at 57600 baud; with telemetry
/// queued ahead, or a radio, it takes several times that.
pub(crate) const ANSWER_TIMEOUT: Duration = Duration::from_millis(400);

/// How often the receiver is called when nothing arrives, so that it drops a frame whose rest was lost.
const RECEIVER_PERIOD: Duration = Duration::from_millis(20);

/// Texts that are remembered: an identification has at most seven.
const TOLD: usize = 16;

/// A link on which one ESC has been chosen.
pub(crate) struct Session {
    link: Link,
    receiver: Receiver,
    started: Instant,
    sequence: u8,
    arrived: VecDeque<Incoming>,
    texts: Texts,
    /// The latest whole texts, which may have come while something else was waited for.
    told: VecDeque<(Address, String)>,
    target: Address,
    /// What a signal has to end first.
    interrupt: Option<Interrupt>,
    /// Signs what is sent, and judges what is heard.
    signer: Option<Signer>,
    /// The ESC's latest frame, for who has signed it.
    latest: Vec<u8>,
}

impl Session {
    /// Waits for the heartbeat of the wanted component, or of the first that may be an ESC. With a signer, it must be
    /// signed with its key.
    ///
    /// # Errors
    /// [`Error::NoComponent`] with what was heard instead, [`Error::Refused`] if the ESC has another key or none.
    pub(crate) fn find(
        link: Link,
        (system, component): (Option<u8>, Option<u8>),
        signer: Option<Signer>,
    ) -> Result<Self, Error> {
        let mut session = Self {
            link,
            receiver: Receiver::new(),
            started: Instant::now(),
            sequence: 0,
            arrived: VecDeque::new(),
            texts: Texts::default(),
            told: VecDeque::new(),
            target: Address {
                system: 0,
                component: 0,
            },
            interrupt: None,
            // Not before the ESC is known to have the key.
            signer: None,
            latest: Vec::new(),
        };
        session.greet()?;
        let named = system.is_some() || component.is_some();
        let mut others = Vec::new();
        let deadline = Instant::now() + FIND_TIMEOUT;
        while let Some(incoming) = session.next(deadline)? {
            let Message::Heartbeat(heartbeat) = incoming.message else {
                continue;
            };
            let from = incoming.from;
            let wanted = system.is_none_or(|n| n == from.system)
                && component.is_none_or(|n| n == from.component);
            if wanted && (named || heartbeat.may_be_esc()) {
                session.target = from;
                session.latest = incoming.raw;
                session.begin_signing(signer)?;
                // A UDP vehicle that waits to be spoken to has heard the first greeting; one that speaks first
                // is known only now.
                session.greet()?;
                return Ok(session);
            }
            if !others.contains(&from) {
                others.push(from);
            }
        }
        Err(Error::NoComponent {
            endpoint: session.link.endpoint().to_string(),
            heard: explain_silence(&others, named),
        })
    }

    /// Signs from now on, if the ESC has the same key.
    fn begin_signing(&mut self, signer: Option<Signer>) -> Result<(), Error> {
        let Some(signer) = signer else {
            return Ok(());
        };
        let reason = match (self.is_signed(), self.is_signed_with(signer.key())) {
            (_, true) => {
                self.sign(Some(signer));
                return Ok(());
            }
            (false, _) => {
                "it has no key; leave --sign-key out, or give it this one: siskin key set FILE"
            }
            (true, _) => "it is signed with another key; name its file with --sign-key",
        };
        Err(Error::Refused {
            what: name_of(self.target),
            reason: reason.into(),
        })
    }

    /// Signs from now on, or no longer; only what is signed with the same key is believed.
    pub(crate) fn sign(&mut self, signer: Option<Signer>) {
        self.signer = signer;
    }

    /// Returns a timestamp for a new key, if what is sent is signed.
    pub(crate) fn stamp(&mut self) -> Option<u64> {
        self.signer.as_mut().map(Signer::stamp)
    }

    /// Returns true if the ESC signs.
    pub(crate) fn is_signed(&self) -> bool {
        signing::is_signed(&self.latest)
    }

    /// Returns true if the ESC signs with this key.
    pub(crate) fn is_signed_with(&self, key: &Key) -> bool {
        signing::fits(key, &self.latest)
    }

    /// Returns true if the ESC has a key, and this program has not: it may only read.
    pub(crate) fn lacks_key(&self) -> bool {
        self.is_signed() && self.signer.is_none()
    }

    /// Returns the ESC being talked to.
    pub(crate) fn target(&self) -> Address {
        self.target
    }

    /// From now on a signal is an [`Error::Interrupted`] of what waits for the ESC, in place of the program's end.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn watch_interrupt(&mut self) -> Result<(), Error> {
        if self.interrupt.is_none() {
            self.interrupt = Some(Interrupt::watch()?);
        }
        Ok(())
    }

    /// Tells the other side that a ground station is here: it replies to the address that it hears.
    ///
    /// # Errors
    /// As [`Link::send`].
    pub(crate) fn greet(&mut self) -> Result<(), Error> {
        self.send(&HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_GCS,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        })
    }

    /// Sends one message.
    ///
    /// # Errors
    /// As [`Link::send`].
    pub(crate) fn send(&mut self, message: &impl MessageData) -> Result<(), Error> {
        let mut frame = MAVLinkV2MessageRaw::new();
        frame.serialize_message_data(
            MavHeader {
                sequence: self.sequence,
                ..OWN
            },
            message,
        );
        self.sequence = self.sequence.wrapping_add(1);
        self.send_frame(frame.raw_bytes(), extra(message))
    }

    fn send_frame(&mut self, frame: &[u8], extra: u8) -> Result<(), Error> {
        match &mut self.signer {
            Some(signer) => self.link.send(&signer.sign(frame, extra)),
            None => self.link.send(frame),
        }
    }

    /// Waits at most `wait` for bytes, and passes on the frames that they complete: whole frames of the ESC's
    /// system, as sent.
    ///
    /// # Errors
    /// As [`Link::receive`].
    pub(crate) fn relay(
        &mut self,
        wait: Duration,
        mut hand_on: impl FnMut(&[u8]),
    ) -> Result<(), Error> {
        let mut buffer = [0; 2048];
        let length = self.link.receive(&mut buffer, wait)?;
        let (now_us, system) = (self.now_us(), self.target.system);
        let signer = &mut self.signer;
        self.receiver.push(now_us, &buffer[..length], |frame| {
            if frame.from.system == system && believes(signer, frame) {
                hand_on(frame.raw);
            }
        });
        Ok(())
    }

    /// Sends another client's bytes; where frames are signed, its whole frames.
    ///
    /// # Errors
    /// As [`Link::send`].
    pub(crate) fn pass(&mut self, bytes: &[u8]) -> Result<(), Error> {
        if self.signer.is_none() {
            return self.link.send(bytes);
        }
        let mut frames = Vec::new();
        Receiver::new().push(0, bytes, |frame| {
            if !signing::is_signed(frame.raw) {
                frames.push((frame.id, frame.raw.to_vec()));
            }
        });
        for (id, frame) in frames {
            self.send_frame(&frame, MavMessage::extra_crc(id))?;
        }
        Ok(())
    }

    /// Returns the time since the start, µs.
    fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// Returns the next message from anyone; `None` at the deadline.
    ///
    /// # Errors
    /// As [`Link::receive`].
    pub(crate) fn next(&mut self, deadline: Instant) -> Result<Option<Incoming>, Error> {
        loop {
            if let Some(incoming) = self.arrived.pop_front() {
                return Ok(Some(incoming));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.fill(left)?;
        }
    }

    /// Waits for bytes of the ESC, for a moment at most; false after the deadline.
    ///
    /// # Errors
    /// As [`Link::receive`].
    pub(crate) fn hear(&mut self, deadline: Instant) -> Result<bool, Error> {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(false);
        }
        self.arrived.clear();
        self.fill(left)?;
        Ok(true)
    }

    /// Waits for bytes, but no longer than the receiver may go without a call.
    fn fill(&mut self, wait: Duration) -> Result<(), Error> {
        if let Some(signal) = self.interrupt.as_ref().and_then(Interrupt::take) {
            return Err(Error::Interrupted {
                what: name_of(self.target),
                ended: "nothing is left to be ended",
                signal,
            });
        }
        let mut buffer = [0; 2048];
        let length = self.link.receive(&mut buffer, wait.min(RECEIVER_PERIOD))?;
        let now_us = self.now_us();
        let (arrived, texts, told) = (&mut self.arrived, &mut self.texts, &mut self.told);
        let (signer, latest, target) = (&mut self.signer, &mut self.latest, self.target);
        self.receiver.push(now_us, &buffer[..length], |frame| {
            let from = frame.from;
            if from == target {
                // Whatever key it is signed with: a new one shows here.
                frame.raw.clone_into(latest);
                if !believes(signer, frame) {
                    return;
                }
            }
            let raw = if frame.id == HEARTBEAT_DATA::ID {
                frame.raw.to_vec()
            } else {
                Vec::new()
            };
            let message = match Message::read(frame.id, frame.payload) {
                Some(Message::StatusText(piece)) => {
                    let whole = texts.join(from, piece);
                    told.extend(whole.iter().map(|whole| (from, whole.text.clone())));
                    whole.map(Message::StatusText)
                }
                other => other,
            };
            arrived.extend(message.map(|message| Incoming { from, message, raw }));
        });
        let excess = self.told.len().saturating_sub(TOLD);
        self.told.drain(..excess);
        Ok(())
    }

    /// Returns the next message from the selected ESC; `None` at the deadline.
    ///
    /// # Errors
    /// As [`Link::receive`].
    pub(crate) fn next_of_target(&mut self, deadline: Instant) -> Result<Option<Message>, Error> {
        while let Some(incoming) = self.next(deadline)? {
            if incoming.from == self.target {
                return Ok(Some(incoming.message));
            }
        }
        Ok(None)
    }

    /// Forgets the texts that have come so far.
    pub(crate) fn forget_texts(&mut self) {
        self.told.clear();
    }

    /// Returns the ESC's latest texts with one of these beginnings, whatever was waited for when they came.
    pub(crate) fn texts(&self, beginnings: &[&str]) -> Vec<String> {
        let of_target = self.told.iter().filter(|(from, _)| *from == self.target);
        let begins = |text: &&String| beginnings.iter().any(|of| text.starts_with(of));
        of_target
            .map(|(_, text)| text)
            .filter(begins)
            .cloned()
            .collect()
    }

    /// Repeats a question until `accept` finds the answer among the ESC's messages.
    ///
    /// # Errors
    /// [`Error::NoAnswer`] about `what` after [`ATTEMPTS`].
    pub(crate) fn ask<Q: MessageData, A>(
        &mut self,
        what: &str,
        mut question: impl FnMut() -> Q,
        mut accept: impl FnMut(Message) -> Option<A>,
    ) -> Result<A, Error> {
        for _ in 0..ATTEMPTS {
            self.send(&question())?;
            let deadline = Instant::now() + ANSWER_TIMEOUT;
            while let Some(message) = self.next_of_target(deadline)? {
                if let Some(answer) = accept(message) {
                    return Ok(answer);
                }
            }
        }
        Err(Error::NoAnswer {
            what: what.into(),
            attempts: ATTEMPTS,
        })
    }
}

fn believes(signer: &mut Option<Signer>, frame: &Frame) -> bool {
    signer
        .as_mut()
        .is_none_or(|signer| signer.believes(frame.raw))
}

/// Returns the byte of a message's check that its fields make.
fn extra<D: MessageData>(_: &D) -> u8 {
    D::EXTRA_CRC
}

fn explain_silence(others: &[Address], named: bool) -> String {
    let seconds = FIND_TIMEOUT.as_secs();
    if others.is_empty() {
        return format!(
            "no heartbeat within {seconds} s; is the ESC powered and this its endpoint \
             (--connect)?"
        );
    }
    let heard: Vec<String> = others.iter().copied().map(name_of).collect();
    let heard = heard.join(", ");
    if named {
        format!(
            "heard {heard} within {seconds} s, but not the one that --system and --component name"
        )
    } else {
        format!(
            "heard {heard} within {seconds} s, but no ESC; name it with --system and --component"
        )
    }
}
