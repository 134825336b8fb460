//! A piece of the traces for display: exact if there is a column per control period, else the least and greatest value
//! of each column, so that no peak is lost.

use std::ops::Range;
use std::sync::Arc;

use super::channel::COUNT;
use super::message::{TRACE, Trigger, View};
use super::ring::{CHUNK, Chunk, bounds};

/// Most columns of a view: those of a wide screen.
const MAX_COLUMNS: usize = 4096;

/// Indices into chunks, control periods counted from the oldest.
struct Places<'a>(&'a [Arc<Chunk>]);

impl Places<'_> {
    /// Returns their number: all chunks are full.
    fn count(&self) -> usize {
        self.0.len() * CHUNK
    }

    fn t_s(&self, place: usize) -> f64 {
        self.0[place / CHUNK].t_s(place % CHUNK)
    }

    /// Returns the first index whose time is this or later.
    fn at(&self, t_s: f64) -> usize {
        let chunk = self.0.partition_point(|chunk| chunk.t_s(CHUNK - 1) < t_s);
        let within = self.0.get(chunk);
        chunk * CHUNK + within.map_or(0, |chunk| chunk.at(t_s))
    }

    /// Returns the bounds of a channel over a range.
    fn bounds(&self, channel: usize, places: &Range<usize>) -> [f32; 2] {
        let mut at = places.start;
        let mut least_greatest = [f32::NAN; 2];
        while at < places.end {
            let (chunk, begin) = (&self.0[at / CHUNK], at % CHUNK);
            let end = CHUNK.min(begin + places.end - at);
            let part = if end - begin == CHUNK {
                chunk.bounds(channel)
            } else {
                bounds(&chunk.values(channel)[begin..end])
            };
            least_greatest = [
                least_greatest[0].min(part[0]),
                least_greatest[1].max(part[1]),
            ];
            at += end - begin;
        }
        least_greatest
    }

    /// Returns the latest index before `end` where a channel crosses a level, if that is after a time.
    fn crossing(&self, trigger: &Trigger, end: usize) -> Option<usize> {
        let Trigger {
            channel,
            level,
            rising,
            after_s,
            ..
        } = *trigger;
        let value = |place: usize| self.0[place / CHUNK].values(channel)[place % CHUNK];
        let is_over = |value: f32| {
            if rising {
                value >= level
            } else {
                value <= level
            }
        };
        let first = self.at(after_s).max(1);
        for chunk in (first / CHUNK..end.div_ceil(CHUNK)).rev() {
            let [least, greatest] = self.0[chunk].bounds(channel);
            let begin = (chunk * CHUNK).max(first);
            // Nothing crosses within a chunk that is all on one side, but maybe on the way into it.
            let crosses = is_over(least) != is_over(greatest);
            let places = if crosses {
                begin..end.min((chunk + 1) * CHUNK)
            } else {
                begin..begin + 1
            };
            let found = places
                .rev()
                .find(|place| is_over(value(*place)) && !is_over(value(place - 1)));
            if found.is_some() {
                return found;
            }
        }
        None
    }
}

/// Encodes the answer to a view: [`TRACE`], whether a trigger was found, whether the values are the least and greatest
/// of each column in turn, a zero byte, and as u32 the id, the ESC, the number of points and that of channels; then as
/// f64 the time of the crossing, the time of each point, and as f32 each channel's values. All is little-endian; unknown
/// values are NaN.
pub(super) fn answer(view: &View, chunks: &[Arc<Chunk>]) -> Vec<u8> {
    let places = Places(chunks);
    let channels: Vec<_> = view
        .channels
        .iter()
        .copied()
        .filter(|channel| *channel < COUNT)
        .take(COUNT)
        .collect();
    let columns = view.columns.clamp(2, MAX_COLUMNS);
    let span_s = if view.span_s.is_finite() {
        view.span_s.max(0.0)
    } else {
        0.0
    };
    let latest_s = places
        .count()
        .checked_sub(1)
        .map_or(0.0, |last| places.t_s(last));
    let mut to_s = view.to_s.unwrap_or(latest_s);
    let trigger = view.trigger.filter(|trigger| trigger.channel < COUNT);
    let crossing = trigger.and_then(|trigger| {
        // What follows the crossing must be there too.
        let after_s = span_s * (1.0 - trigger.before.clamp(0.0, 1.0));
        let place = places.crossing(&trigger, places.at(latest_s - after_s))?;
        to_s = places.t_s(place) + after_s;
        Some(places.t_s(place))
    });
    let shown = places.at(to_s - span_s)..places.at(to_s.next_up());
    let a_column = shown.len().div_ceil(columns);
    let parts: Vec<_> = shown.clone().step_by(a_column.max(1)).collect();
    let parts: Vec<_> = parts
        .into_iter()
        .map(|at| at..shown.end.min(at + a_column))
        .collect();
    let is_exact = a_column <= 2;
    let points = if is_exact {
        shown.len()
    } else {
        2 * parts.len()
    };

    let mut bytes = vec![TRACE, u8::from(crossing.is_some()), u8::from(!is_exact), 0];
    for number in [
        view.id,
        view.esc as u32,
        points as u32,
        channels.len() as u32,
    ] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes.extend(crossing.unwrap_or(f64::NAN).to_le_bytes());
    if is_exact {
        shown
            .clone()
            .for_each(|place| bytes.extend(places.t_s(place).to_le_bytes()));
    } else {
        for part in &parts {
            let middle = part.start + part.len() / 2;
            bytes.extend(places.t_s(part.start).to_le_bytes());
            bytes.extend(places.t_s(middle).to_le_bytes());
        }
    }
    for channel in channels {
        if is_exact {
            let value = |place: usize| chunks[place / CHUNK].values(channel)[place % CHUNK];
            shown
                .clone()
                .for_each(|place| bytes.extend(value(place).to_le_bytes()));
        } else {
            for part in &parts {
                let bounds = places.bounds(channel, part);
                bounds
                    .iter()
                    .for_each(|bound| bytes.extend(bound.to_le_bytes()));
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::channel::Point;
    use super::*;
    use crate::plant::Flow;
    use crate::surroundings::Motion;

    fn t_s(place: usize) -> f64 {
        place as f64 * 1e-3
    }

    /// Phase current a counts the periods, of a millisecond each, b is 1 in period 700 alone, and the control's phase
    /// is unknown.
    const CHANNELS: [usize; 3] = [8, 9, 0];

    fn chunks() -> Vec<Arc<Chunk>> {
        let chunk = |number: usize| {
            let mut chunk = Chunk::new();
            for place in number * CHUNK..(number + 1) * CHUNK {
                let pulse = f64::from(u8::from(place == 700));
                chunk.push(Point {
                    t_s: t_s(place),
                    motion: Motion {
                        angle_turns: 0.0,
                        speed_rad_s: 0.0,
                        currents_a: [place as f64, pulse, 0.0],
                        bus_v: 24.0,
                        bus_a: 0.0,
                        flow: Flow::default(),
                    },
                    throttle: 0.0,
                    control: None,
                });
            }
            Arc::new(chunk)
        };
        (0..8).map(chunk).collect()
    }

    fn view(span_s: f64, columns: usize) -> View {
        View {
            id: 7,
            esc: 0,
            to_s: None,
            span_s,
            columns,
            channels: CHANNELS.to_vec(),
            trigger: None,
            hold: false,
        }
    }

    /// Returns crossing, times and channels of an answer.
    fn read(bytes: &[u8]) -> (Option<f64>, Vec<f64>, Vec<Vec<f32>>) {
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((bytes[0], number(4), number(16)), (TRACE, 7, 3));
        let points = number(12);
        let double = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let values = 32 + 8 * points;
        assert_eq!(bytes.len(), values + 3 * 4 * points);
        (
            (bytes[1] == 1).then(|| double(24)),
            (0..points).map(|point| double(32 + 8 * point)).collect(),
            (0..3)
                .map(|c| {
                    (0..points)
                        .map(|p| float(values + 4 * (c * points + p)))
                        .collect()
                })
                .collect(),
        )
    }

    #[test]
    fn a_short_piece_is_exact_and_a_long_one_keeps_its_peaks() {
        let chunks = chunks();
        let exact = answer(&view(0.1, 400), &chunks);
        assert_eq!(exact[2], 0);
        let (_, times, values) = read(&exact);
        assert_eq!((times.len(), times[0], times[100]), (101, 1.947, 2.047));
        assert_eq!(values[0][3], 1950.0);
        assert!(values[2].iter().all(|value| value.is_nan()));

        let bounds = answer(&view(10.0, 100), &chunks);
        assert_eq!(bounds[2], 1);
        let (_, times, values) = read(&bounds);
        assert_eq!(times.len(), 2 * 98, "21 in a column");
        assert!(times.is_sorted());
        assert_eq!(values[0][..4], [0.0, 20.0, 21.0, 41.0]);
        let peaks = values[1].iter().filter(|value| **value == 1.0).count();
        assert_eq!(peaks, 1);
        assert!(values[2].iter().all(|value| value.is_nan()));
        // Columns longer than a chunk.
        let (_, _, values) = read(&answer(&view(10.0, 4), &chunks));
        assert_eq!(
            values[0],
            [0.0, 511.0, 512.0, 1023.0, 1024.0, 1535.0, 1536.0, 2047.0]
        );
        assert_eq!(values[1], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_piece_stands_around_the_latest_crossing_that_is_wanted() {
        let chunks = chunks();
        let trigger = |channel, level, rising, after_s| {
            let before = 0.25;
            Some(Trigger {
                channel: CHANNELS[channel],
                level,
                rising,
                before,
                after_s,
            })
        };
        let seen = |trigger| {
            read(&answer(
                &View {
                    trigger,
                    ..view(0.4, 4000)
                },
                &chunks,
            ))
        };
        let (crossing, times, values) = seen(trigger(1, 0.5, true, 0.0));
        assert_eq!((crossing, values[1][100]), (Some(t_s(700)), 1.0));
        assert!((times[0] - 0.6).abs() < 1e-9 && (times[400] - 1.0).abs() < 1e-9);
        assert_eq!(seen(trigger(1, 0.5, false, 0.0)).0, Some(t_s(701)));
        // Across a chunk boundary, and at the end of what could follow.
        assert_eq!(seen(trigger(0, 511.5, true, 0.0)).0, Some(t_s(512)));
        for never in [
            trigger(1, 0.5, true, 0.7005),
            trigger(1, 2.0, true, 0.0),
            trigger(2, 0.0, true, 0.0),
            trigger(0, 1900.0, true, 0.0),
        ] {
            assert_eq!(seen(never).0, None);
        }
    }

    #[test]
    fn whatever_is_asked_for_there_is_an_answer() {
        for chunks in [Vec::new(), chunks()] {
            for span_s in [0.0, -1.0, f64::NAN, 1e300, f64::INFINITY] {
                for to_s in [None, Some(-5.0), Some(1e9), Some(f64::NAN)] {
                    let columns = usize::MAX;
                    let view = View {
                        to_s,
                        columns,
                        channels: vec![0, 99, usize::MAX],
                        ..view(span_s, 1)
                    };
                    assert!(answer(&view, &chunks).len() >= 32);
                }
            }
        }
    }
}
