//! Memory that the processor and the chip's DMA share.

use std::cell::Cell;
use std::ops::Range;
use std::rc::Rc;

/// A stretch of memory; clones share it.
#[derive(Clone, Debug)]
pub struct Memory {
    origin: u32,
    cells: Rc<[Cell<u8>]>,
}

impl Memory {
    /// Creates `bytes` bytes from this address, all of one value.
    pub fn new(origin: u32, bytes: usize, fill: u8) -> Self {
        Self {
            origin,
            cells: vec![Cell::new(fill); bytes].into(),
        }
    }

    /// Returns its addresses.
    pub fn range(&self) -> Range<u32> {
        self.origin..self.origin + self.cells.len() as u32
    }

    /// Returns the bytes themselves, for an engine that executes from them.
    pub fn cells(&self) -> &[Cell<u8>] {
        &self.cells
    }

    /// Returns whether this many bytes from this address lie within.
    pub fn holds(&self, address: u32, bytes: u32) -> bool {
        let offset = address.wrapping_sub(self.origin) as usize;
        offset < self.cells.len() && self.cells.len() - offset >= bytes as usize
    }

    /// Reads up to four bytes, little-endian; they must lie within.
    pub fn read(&self, address: u32, bytes: u32) -> u32 {
        let cells = self.part(address, bytes as usize);
        let fold = |value, cell: &Cell<u8>| value << 8 | u32::from(cell.get());
        cells.iter().rev().fold(0, fold)
    }

    /// Writes up to four bytes, little-endian; they must lie within.
    pub fn write(&self, address: u32, bytes: u32, value: u32) {
        let cells = self.part(address, bytes as usize);
        for (cell, byte) in cells.iter().zip(value.to_le_bytes()) {
            cell.set(byte);
        }
    }

    /// Copies bytes in; they must lie within.
    pub fn load(&self, address: u32, bytes: &[u8]) {
        let cells = self.part(address, bytes.len());
        for (cell, byte) in cells.iter().zip(bytes) {
            cell.set(*byte);
        }
    }

    /// Copies bytes out; they must lie within.
    pub fn bytes(&self, address: u32, count: usize) -> Vec<u8> {
        self.part(address, count).iter().map(Cell::get).collect()
    }

    fn part(&self, address: u32, bytes: usize) -> &[Cell<u8>] {
        let offset = (address - self.origin) as usize;
        &self.cells[offset..offset + bytes]
    }
}
