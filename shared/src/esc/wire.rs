//! What the throttle wire or a command makes the ESC do besides turning the motor: DShot commands, stick
//! calibration, news.

use siskin_params::ParamId;
use siskin_throttle::News;
use siskin_throttle::calibration::Step;
use siskin_throttle::command::{Beacon, Order};
use siskin_throttle::endpoints::EndPoints;

use super::Esc;
use super::storage::Unstored;
use crate::build::BuildError;
use crate::mavlink::Act;
use crate::throttle::LockThrottle;
use crate::tune::Tune;

impl Esc {
    /// Returns true if a command has turned the light on.
    pub fn light(&self) -> bool {
        self.light
    }

    /// Does the tasks' part of the wire's work.
    pub(super) fn follow_wire(&mut self, throttle: &mut impl LockThrottle, now_us: u64) {
        while let Some(news) = throttle.lock(|throttle| throttle.news(now_us)) {
            self.hear(now_us, news);
            if news == News::Calibration(Step::Identify) {
                self.identify_by_stick(throttle, now_us);
            }
        }
        // The motor may have been asked to turn since the order came.
        let stopped = self.drive().stopped;
        while let Some(order) = throttle.lock(|throttle| throttle.next_order(stopped)) {
            self.obey(throttle, now_us, order);
        }
    }

    /// Carries out a MAVLink command.
    pub(super) fn act(&mut self, throttle: &mut impl LockThrottle, now_us: u64, act: Act) {
        match act {
            Act::Beep => self.tunes.play(now_us, Tune::Beacon(Beacon::One)),
            Act::Calibrate => throttle.lock(|throttle| throttle.calibrate(now_us, true)),
            Act::Check => self.check.begin(),
            Act::Identify => self.identify(now_us, false),
            Act::EndIdentification => self.end_identification("cancelled"),
            Act::SayWhyOff => self.tells_us = now_us,
            Act::AbandonIdentification => self.end_identification("its client is gone"),
            Act::KeepIdentified => {
                let kept = self.keep_identified();
                self.component.identification_done(kept);
            }
            Act::EndCalibration => throttle.lock(|throttle| throttle.calibrate(now_us, false)),
        }
    }

    pub(super) fn hear(&mut self, now_us: u64, news: News) {
        let news = match news {
            News::Calibration(Step::Done(ends)) if !self.calibrate(ends) => {
                News::Calibration(Step::Cancelled)
            }
            // Lowering it would not arm it.
            News::OpenThrottle if self.unfit.is_some() => {
                self.tells_us = now_us;
                return;
            }
            news => news,
        };
        self.component.report_news(news);
        let tune = match news {
            News::Armed => Tune::Armed,
            News::Lost { armed: true } => Tune::Lost,
            News::OpenThrottle => Tune::OpenThrottle,
            News::Calibration(Step::Full | Step::Again) => Tune::Calibrating,
            News::Calibration(Step::Done(_)) => Tune::Calibrated,
            News::Identified(_)
            | News::Unknown
            | News::Lost { armed: false }
            | News::Calibration(Step::Cancelled | Step::Identify) => return,
        };
        self.tunes.play(now_us, tune);
    }

    fn obey(&mut self, throttle: &mut impl LockThrottle, now_us: u64, order: Order) {
        let number = |on| f32::from(u8::from(on));
        match order {
            Order::Beacon(beacon) => self.tunes.play(now_us, Tune::Beacon(beacon)),
            Order::Direction { reversed } => {
                self.change_for_now(ParamId::MotDir, number(reversed));
            }
            Order::TwoDirections(on) => {
                self.change_for_now(ParamId::Inp3d, number(on));
            }
            Order::Save => self.storage.save(),
            Order::Spin { opposite } => {
                self.overrides.opposite = opposite;
                // No value changes, but the configuration does.
                self.component.changed(&[]);
            }
            Order::Light(on) => {
                self.light = on;
                self.update_info(throttle);
            }
            Order::Silent => self.tunes.toggle_silent(),
            Order::Info | Order::Extended(_) => {}
        }
    }

    /// Sets a parameter until the next restart, or until the wire asks for it to be stored.
    fn change_for_now(&mut self, id: ParamId, value: f32) {
        let before = self.params.get(id);
        if self.change(&[(id, value)]).is_err() {
            return;
        }
        let known = self.unstored.iter_mut().find(|known| known.id == id);
        match known {
            // Values set by other means since then are stored.
            Some(known) if before == known.value => known.value = value,
            Some(known) => (known.value, known.stored) = (value, before),
            None => {
                // There is room for both.
                let _ = self.unstored.push(Unstored {
                    id,
                    value,
                    stored: before,
                });
            }
        }
    }

    /// Applies the stick's end points and has them stored. Returns true if they fit. After a loss of settings
    /// it refuses, since the defaults would be stored with them.
    fn calibrate(&mut self, ends: EndPoints) -> bool {
        let fit = !self.storage.is_lost()
            && self
                .change(&[
                    (ParamId::InpPulseMinUs, f32::from(ends.min_us)),
                    (ParamId::InpPulseMaxUs, f32::from(ends.max_us)),
                ])
                .is_ok();
        if fit {
            self.storage.save();
        }
        fit
    }

    /// Sets parameters as MAVLink does: all of them, or none if they do not fit.
    ///
    /// # Errors
    /// The parameter that does not fit.
    pub(super) fn change(&mut self, values: &[(ParamId, f32)]) -> Result<(), BuildError> {
        let mut params = self.params.clone();
        for (id, value) in values {
            params.set(*id, *value).map_err(|_| BuildError {
                param: *id,
                reason: "out of range",
            })?;
        }
        self.overrides.check(&params, &self.board)?;
        self.params = params;
        for (id, _) in values {
            self.component.changed(&[*id]);
        }
        Ok(())
    }
}
