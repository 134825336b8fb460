//! The bytes of the files, at every offset.

use std::format;
use std::string::String;
use std::vec::Vec;

use siskin_params::checksum::checksum;
use siskin_params::{Board, LeastDeadTime, ParamId, Params, TABLE};

use super::files::{Entry, File};
use super::sink::Sink;
use super::*;
use crate::check::Report;
use crate::identify;
use crate::mavlink::tests::TELEMETRY;

static CHECK: Report = Report::new(40.0, 0.02);
static IDENTIFICATION: identify::Report = identify::Report {
    r_mohm: figure(107.96, 0.001),
    l_uh: figure(30.6, 0.002),
    flux_mwb: figure(1.3, 0.0125),
    j_gcm2: figure(1430.5, 0.0),
    l_axes_uh: [figure(30.55, 0.0), figure(30.65, 0.0)],
    dead_time_ns: figure(498.0, 0.01),
};

const fn figure(value: f32, spread: f32) -> identify::Figure {
    identify::Figure { value, spread }
}

fn view(params: &Params) -> View<'_> {
    View {
        params,
        board: &Board::BENCH,
        telemetry: &TELEMETRY,
        check: &CHECK,
        identification: &IDENTIFICATION,
        record: None,
        warning: "",
    }
}

fn whole(path: &str, params: &Params) -> Option<Vec<u8>> {
    let file = File::find(path.as_bytes())?;
    let measure = file.measure(&view(params));
    let mut whole = std::vec![0; measure.len as usize];
    file.write(&view(params), &mut Sink::new(0, &mut whole));
    assert_eq!(measure.checksum, checksum(0, &whole));
    Some(whole)
}

/// Builds `param.pck` from its description, without the code under test.
fn packed(params: &Params, chosen: &[ParamId], defaults: bool) -> Vec<u8> {
    let mut file = Vec::new();
    let magic = if defaults { 0x671C_u16 } else { 0x671B };
    for word in [magic, chosen.len() as u16, TABLE.len() as u16] {
        file.extend_from_slice(&word.to_le_bytes());
    }
    let mut before = String::new();
    for id in chosen {
        let (name, default) = (id.entry().name, id.entry().default);
        let value = params.get(*id);
        let mut alike = 0;
        while name[..=alike] == *before.get(..=alike).unwrap_or("") {
            alike += 1;
        }
        let differs = defaults && value != default;
        file.push(if differs { 0x14 } else { 0x04 });
        file.push((alike + 16 * (name.len() - alike - 1)) as u8);
        file.extend_from_slice(&name.as_bytes()[alike..]);
        file.extend_from_slice(&value.to_le_bytes());
        if differs {
            file.extend_from_slice(&default.to_le_bytes());
        }
        before = name.into();
    }
    file
}

#[test]
fn a_motor_s_figures_are_lines_of_name_value_unit_and_spread() {
    let whole = whole("@SYS/identify.txt", &Params::default()).expect("a file");
    let text = String::from_utf8(whole).expect("ASCII");
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines.len(), 7, "{text}");
    assert_eq!(lines[0], "MOT_R_MOHM 107.960 mOhm 0.100 %");
    assert_eq!(lines[2], "MOT_FLUX_MWB 1.300 mWb 1.250 %");
    assert_eq!(lines[6], "dead_time 498.000 ns 1.000 %");
}

#[test]
fn the_checksum_is_that_of_nuttx() {
    // From Python: zlib.crc32(b"123456789", 0xFFFFFFFF) ^ 0xFFFFFFFF.
    assert_eq!(checksum(0, b"123456789"), 0x2DFD_2D88);
    assert_eq!(checksum(checksum(0, b"1234"), b"56789"), 0x2DFD_2D88);
    assert_eq!(checksum(0, b""), 0);
}

#[test]
fn parameters_are_packed_as_they_should_be() {
    let mut params = Params::default();
    params.set(ParamId::MotLUh, 12.5).expect("in range");
    params.set(ParamId::LimTempC, 77.0).expect("in range");
    let all = &ParamId::ALL;
    for (path, chosen, defaults) in [
        ("@PARAM/param.pck", &all[..], false),
        ("/@PARAM/param.pck\0", &all[..], false),
        ("@PARAM/param.pck?withdefaults=1", &all[..], true),
        ("@PARAM/param.pck?withdefaults=0", &all[..], false),
        ("@PARAM/param.pck?start=7&count=5", &all[7..12], false),
        ("@PARAM/param.pck?withdefaults=1&count=9", &all[..9], true),
        ("@PARAM/param.pck?start=3&count=0", &all[3..], false),
        ("@PARAM/param.pck?start=40&count=65535", &all[40..], false),
    ] {
        let file = whole(path, &params).expect(path);
        assert_eq!(file, packed(&params, chosen, defaults), "{path}");
    }
}

#[test]
fn the_default_of_a_dead_time_is_the_boards() {
    let board = Board {
        least_dead_time: LeastDeadTime {
            ns: 750.0,
            refusal: "",
        },
        ..Board::BENCH
    };
    let mut params = Params::default();
    params.fit(&board);
    let id = ParamId::PwmDeadtimeNs;
    let place = id as usize;
    let path = format!("@PARAM/param.pck?withdefaults=1&start={place}&count=1");
    let file = File::find(path.as_bytes()).expect("a file");
    let read = |params: &Params| {
        let view = View {
            board: &board,
            ..view(params)
        };
        let mut whole = std::vec![0; file.measure(&view).len as usize];
        file.write(&view, &mut Sink::new(0, &mut whole));
        whole
    };
    // No separate default follows the value.
    assert!(read(&params).ends_with(&750.0_f32.to_le_bytes()));
    assert_eq!(read(&params)[6], 0x04);
    params.set(id, 900.0).expect("in range");
    assert!(read(&params).ends_with(&750.0_f32.to_le_bytes()));
    assert_eq!(read(&params)[6], 0x14);
}

#[test]
fn there_are_no_other_files() {
    let params = Params::default();
    let beyond_the_end = format!("@PARAM/param.pck?start={}&count=1", TABLE.len());
    for path in [
        "",
        "/",
        "@PARAM",
        "param.pck",
        "@SYS/param.pck",
        "@PARAM/param.pckx",
        "@PARAM/param.pck/x",
        "@PARAM//param.pck",
        "@PARAM/param.pc",
        "@PARAM/param.pck?",
        "@PARAM/param.pck?start=",
        "@PARAM/param.pck?start=x",
        "@PARAM/param.pck?start=-1",
        &beyond_the_end,
        "@PARAM/param.pck?start=300",
        "@PARAM/param.pck?withdefaults=2",
        "@PARAM/param.pck?what=1",
        "@SYS/faults.txt?start=1",
        "general.json",
        "etc/general.json.xz",
    ] {
        assert!(whole(path, &params).is_none(), "{path}");
    }
}

#[test]
fn what_is_asked_for_by_its_place_is_what_is_there() {
    let params = Params::default();
    for path in ["@PARAM/param.pck?withdefaults=1", "@SYS/faults.txt"] {
        let whole = whole(path, &params).expect(path);
        let file = File::find(path.as_bytes()).expect(path);
        for offset in 0..whole.len() {
            for len in [1, 2, 7, 80, 239] {
                let mut room = [0xEE; 239];
                let mut sink = Sink::new(offset, &mut room[..len]);
                file.write(&view(&params), &mut sink);
                assert_eq!(
                    (sink.len, sink.checksum),
                    (whole.len(), checksum(0, &whole))
                );
                let wanted = &whole[offset..whole.len().min(offset + len)];
                assert_eq!(&room[..wanted.len()], wanted, "{path} at {offset}");
                assert!(room[wanted.len()..].iter().all(|byte| *byte == 0xEE));
            }
        }
    }
}

#[test]
fn folders_list_what_is_in_them() {
    let params = Params::default();
    let list = |path: &str, first| {
        let mut room = [0; 239];
        let mut sink = Sink::new(0, &mut room);
        if let Ok(entry) = Entry::find(path.as_bytes(), first) {
            entry.write_rest(&view(&params), &mut sink);
        }
        let len = sink.len;
        // Else its end would be cut off.
        assert!(len <= 239);
        String::from_utf8(room[..len].to_vec()).expect("ASCII")
    };
    let size = |path| whole(path, &params).expect("there").len();
    let general = size("general.json.xz");
    let parameter = size("parameter.json.xz");
    let files = std::format!("Fgeneral.json.xz\t{general}\0Fparameter.json.xz\t{parameter}\0");
    for path in ["", "/", "/\0"] {
        assert_eq!(list(path, 0), std::format!("{files}D@PARAM\0D@SYS\0"));
        assert_eq!(list(path, 2), "D@PARAM\0D@SYS\0");
        assert_eq!(list(path, 3), "D@SYS\0");
        assert_eq!(list(path, 4), "");
    }
    let pack = size("@PARAM/param.pck");
    for path in ["@PARAM", "/@PARAM/"] {
        assert_eq!(list(path, 0), std::format!("Fparam.pck\t{pack}\0"));
        assert_eq!(list(path, 1), "");
    }
    for path in ["@ROMFS", "@PAR", "@PARAM/param.pck"] {
        assert_eq!(list(path, 0), "");
    }
}

#[test]
fn numbers_are_as_the_core_library_writes_them() {
    for number in [0, 7, 10, 99, 1_000_000, 4_294_967_295] {
        let mut room = [0; 12];
        let mut sink = Sink::new(0, &mut room);
        text::decimal(number, &mut sink);
        let len = sink.len;
        assert_eq!(room[..len], *std::format!("{number}").as_bytes());
    }
}
