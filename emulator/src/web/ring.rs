//! The latest ten seconds of one ESC at its control rate.
//!
//! The simulation fills a chunk and hands it over whole; it does not change afterwards, so that viewers delay nobody.
//! Columns are computed when first viewed, and are stored together, since a page views few of them.

use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};

use super::channel::{self, COUNT, Point};

/// Control periods in a chunk: 11 ms at 24 kHz, the greatest age of a trace's latest point.
pub(super) const CHUNK: usize = 256;

/// Chunks in a ring: 10.7 s at 24 kHz, in some 90 MB.
const CHUNKS: usize = 1000;

/// Consecutive control periods.
pub(super) struct Chunk {
    points: Vec<Point>,
    columns: OnceLock<Columns>,
}

/// A chunk by channel.
struct Columns {
    values: Vec<[f32; CHUNK]>,
    /// The least and greatest value of each.
    bounds: Vec<[f32; 2]>,
}

impl Chunk {
    pub(super) fn new() -> Self {
        Self {
            points: Vec::with_capacity(CHUNK),
            columns: OnceLock::new(),
        }
    }

    fn emptied(mut self) -> Self {
        self.points.clear();
        self.columns.take();
        self
    }

    pub(super) fn push(&mut self, point: Point) {
        self.points.push(point);
    }

    pub(super) fn is_full(&self) -> bool {
        self.points.len() == CHUNK
    }

    /// Returns the start of a control period, s.
    pub(super) fn t_s(&self, place: usize) -> f64 {
        self.points[place].t_s
    }

    /// Returns the first index whose time is this or later.
    pub(super) fn at(&self, t_s: f64) -> usize {
        self.points.partition_point(|point| point.t_s < t_s)
    }

    /// Returns the values of a channel.
    pub(super) fn values(&self, channel: usize) -> &[f32; CHUNK] {
        &self.columns().values[channel]
    }

    /// Returns the least and greatest value of a channel; NaN if there are none.
    pub(super) fn bounds(&self, channel: usize) -> [f32; 2] {
        self.columns().bounds[channel]
    }

    fn columns(&self) -> &Columns {
        self.columns.get_or_init(|| {
            let mut values = vec![[f32::NAN; CHUNK]; COUNT];
            for (place, point) in self.points.iter().enumerate() {
                for (column, value) in values.iter_mut().zip(channel::values(point)) {
                    column[place] = value;
                }
            }
            let bounds = values.iter().map(|column| bounds(column)).collect();
            Columns { values, bounds }
        })
    }
}

/// Returns the least and greatest of some values; NaN if there are none.
pub(super) fn bounds(values: &[f32]) -> [f32; 2] {
    values
        .iter()
        .fold([f32::NAN; 2], |[least, greatest], value| {
            [least.min(*value), greatest.max(*value)]
        })
}

/// The chunks, oldest first.
#[derive(Default)]
pub(super) struct Ring(VecDeque<Arc<Chunk>>);

impl Ring {
    /// Adds a full chunk and returns an empty one: the oldest, unless it is still viewed. Memory that the program
    /// already has is free, where the system would have to clear new memory.
    pub(super) fn push(&mut self, chunk: Chunk) -> Chunk {
        let is_full = self.0.len() == CHUNKS;
        let oldest = if is_full { self.0.pop_front() } else { None };
        self.0.push_back(Arc::new(chunk));
        let unseen = oldest.and_then(|chunk| Arc::try_unwrap(chunk).ok());
        unseen.map_or_else(Chunk::new, Chunk::emptied)
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Returns all chunks.
    pub(super) fn chunks(&self) -> Vec<Arc<Chunk>> {
        self.0.iter().cloned().collect()
    }
}
