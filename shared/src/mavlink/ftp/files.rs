//! The files, and the folders that they are in.

use siskin_params::ParamId;
use siskin_params::checksum::checksum;
use siskin_params::metadata::{GENERAL, PARAMETER};
use siskin_params::parts::Part;

use super::error::Error;
use super::packed::Selection;
use super::sink::Sink;
use super::text;
use super::view::View;
use crate::record::{self, Record};

/// Checksum of the general metadata.
pub(super) const GENERAL_CHECKSUM: u32 = checksum(0, GENERAL);

/// The kind of an entry.
#[derive(Debug)]
enum Content {
    Folder,
    /// A file whose bytes are in the image.
    Fixed(&'static [u8]),
    /// The parameters; a path can select some.
    Parameters,
    /// Present faults, in words.
    Faults,
    /// Statistics over the life of the ESC, in words.
    Statistics,
    /// The result of the last self-test.
    Check,
    /// The result of the last identification.
    Identification,
    /// The fault record.
    Record,
}

/// An entry of a folder.
#[derive(Debug)]
pub(super) struct Entry {
    /// The folder, as it precedes the name in a path.
    folder: &'static str,
    name: &'static str,
    content: Content,
}

/// The metadata first, and the fault record last: programs without the one or the other leave out these ends.
static ENTRIES: [Entry; 10] = [
    Entry {
        folder: "",
        name: "general.json.xz",
        content: fixed(GENERAL),
    },
    Entry {
        folder: "",
        name: "parameter.json.xz",
        content: fixed(PARAMETER),
    },
    Entry {
        folder: "",
        name: "@PARAM",
        content: Content::Folder,
    },
    Entry {
        folder: "",
        name: "@SYS",
        content: Content::Folder,
    },
    Entry {
        folder: "@PARAM/",
        name: "param.pck",
        content: Content::Parameters,
    },
    Entry {
        folder: "@SYS/",
        name: "faults.txt",
        content: Content::Faults,
    },
    Entry {
        folder: "@SYS/",
        name: "statistics.txt",
        content: Content::Statistics,
    },
    Entry {
        folder: "@SYS/",
        name: "check.txt",
        content: Content::Check,
    },
    Entry {
        folder: "@SYS/",
        name: "identify.txt",
        content: Content::Identification,
    },
    Entry {
        folder: "@SYS/",
        name: "faults.bin",
        content: Content::Record,
    },
];

/// Returns metadata's content; a program without it holds no bytes.
const fn fixed(bytes: &'static [u8]) -> Content {
    Content::Fixed(if Part::Metadata.is_here() { bytes } else { &[] })
}

/// Returns the entries of this program.
fn entries() -> &'static [Entry] {
    let first = if Part::Metadata.is_here() { 0 } else { 2 };
    let end = ENTRIES.len() - if record::KEPT { 0 } else { 1 };
    &ENTRIES[first..end]
}

/// Returns the fault record, if this program keeps one.
fn record<'a>(view: &View<'a>) -> Option<&'a Record> {
    view.record.filter(|_| record::KEPT)
}

/// One file.
#[derive(Clone, Copy, Debug)]
pub(super) struct File {
    entry: &'static Entry,
    selection: Selection,
}

impl File {
    /// Finds the file of a path, with or without the root's slash.
    pub(super) fn find(path: &[u8]) -> Option<Self> {
        let path = trim(path);
        let query_at = path.iter().position(|byte| *byte == b'?');
        let (path, query) = match query_at {
            Some(at) => (path.get(..at)?, path.get(at + 1..)),
            None => (path, None),
        };
        let entry = entries().iter().find(|entry| {
            path.strip_prefix(entry.folder.as_bytes()) == Some(entry.name.as_bytes())
        })?;
        let selection = match (&entry.content, query) {
            (Content::Parameters, Some(query)) => Selection::parse(query)?,
            (Content::Folder, _) | (_, Some(_)) => return None,
            (_, None) => Selection::ALL,
        };
        Some(Self { entry, selection })
    }

    pub(super) fn write(&self, view: &View, sink: &mut Sink) {
        match self.entry.content {
            Content::Folder => {}
            Content::Fixed(bytes) => sink.put(bytes),
            Content::Parameters => self.selection.write(view.params, view.board, sink),
            Content::Faults => text::faults(view, sink),
            Content::Statistics => text::statistics(view, sink),
            Content::Check => text::check(view, sink),
            Content::Identification => text::identification(view, sink),
            Content::Record => {
                if let Some(record) = record(view) {
                    let pole_pairs = view.params.get(ParamId::MotPolePairs);
                    record.for_each_word(view.board, pole_pairs, &mut |word| {
                        sink.put(&word.to_le_bytes());
                    });
                }
            }
        }
    }

    /// Notes that it has been read to the end.
    pub(super) fn read(&self, view: &View) {
        if let (Content::Record, Some(record)) = (&self.entry.content, record(view)) {
            record.taken();
        }
    }

    /// Returns its length and checksum.
    pub(super) fn measure(&self, view: &View) -> Measure {
        let mut sink = Sink::default();
        self.write(view, &mut sink);
        Measure {
            len: sink.len as u32,
            checksum: sink.checksum,
        }
    }
}

/// Size and checksum of a file's whole content.
pub(super) struct Measure {
    /// Its length in bytes.
    pub(super) len: u32,
    pub(super) checksum: u32,
}

impl Entry {
    /// Returns the entry with this number in a path's folder, with or without the root's slash.
    pub(super) fn find(path: &[u8], number: u32) -> Result<&'static Self, Error> {
        let path = trim(path);
        let mut before = 0;
        let mut error = Error::FileNotFound;
        for entry in entries() {
            if trim(entry.folder.as_bytes()) == path {
                if before == number {
                    return Ok(entry);
                }
                before += 1;
                error = Error::EndOfFile;
            }
        }
        Err(error)
    }

    /// Writes the entries of its folder from itself on: type, name, for a file its length, and a zero.
    pub(super) fn write_rest(&'static self, view: &View, sink: &mut Sink) {
        let mut begun = false;
        for entry in entries() {
            begun |= core::ptr::eq(entry, self);
            if !begun || entry.folder != self.folder {
                continue;
            }
            let is_folder = matches!(entry.content, Content::Folder);
            sink.put(if is_folder { b"D" } else { b"F" });
            sink.put(entry.name.as_bytes());
            if !is_folder {
                let selection = Selection::ALL;
                sink.put(b"\t");
                text::decimal(File { entry, selection }.measure(view).len, sink);
            }
            sink.put(b"\0");
        }
    }
}

/// Strips the slashes around a path and a terminating zero.
fn trim(mut path: &[u8]) -> &[u8] {
    while let [b'/', rest @ ..] | [rest @ .., b'/' | 0] = path {
        path = rest;
    }
    path
}
