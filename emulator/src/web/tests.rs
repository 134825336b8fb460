use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{ClientRequestBuilder, Message as Socket, WebSocket};

use super::*;
use crate::device::{Device, Start};
use crate::rig::{Period, Rig};

/// An ESC with its page, roughly in real time: a millisecond per turn.
struct Desk {
    web: Web,
    links: Links,
    device: Device,
    rpm: f64,
}

fn names() -> [String; 2] {
    ["a motor", "a load"].map(str::to_owned)
}

impl Desk {
    fn new() -> Self {
        let address = "127.0.0.1:0".parse().unwrap();
        let (web, line) = Web::open(&address, (&names(), 1), &[]).unwrap();
        assert_eq!(line, None);
        Self {
            web: web.unwrap(),
            links: Links::open(&[]).unwrap(),
            device: Device::start(Start::default()).unwrap().0,
            rpm: 0.0,
        }
    }

    /// Runs for this many milliseconds of both times.
    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            let turn = Instant::now();
            let rpm = &mut self.rpm;
            let mut look = |_: f64, period: &Period, _: &Rig| *rpm = period.rpm();
            self.web
                .receive(&mut self.links, &mut self.device, &mut look);
            let mut frames = Vec::new();
            let until_ns = self.device.now_ns() + 1_000_000;
            let mut look = Web::tapped(Some(&mut self.web), &mut look);
            let send = &mut |frame: &[u8]| frames.extend_from_slice(frame);
            Machine::advance(&mut self.device, until_ns, &mut look, send).unwrap();
            self.web.send(&frames);
            std::thread::sleep(Duration::from_millis(1).saturating_sub(turn.elapsed()));
        }
    }

    /// Opens a page's socket.
    fn page(&self) -> WebSocket<TcpStream> {
        let at = self.web.place().0;
        let request = ClientRequestBuilder::new(format!("ws://{at}/socket").parse().unwrap())
            .with_header("Origin", format!("http://{at}"));
        let stream = TcpStream::connect(at).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        tungstenite::client(request, stream).unwrap().0
    }

    /// Runs until the page receives something under this key: a request may arrive after any one run.
    fn answer(&mut self, page: &mut WebSocket<TcpStream>, key: &str) -> Value {
        page.get_ref()
            .set_read_timeout(Some(Duration::from_millis(10)))
            .unwrap();
        loop {
            self.run(10);
            if let Ok(Socket::Text(text)) = page.read() {
                let told = serde_json::from_str::<Value>(&text).unwrap()[key].take();
                if !told.is_null() {
                    return told;
                }
            }
        }
    }

    /// Returns the status line and the rest of an answer.
    fn get(&self, path: &str, lines: &str) -> String {
        let mut stream = TcpStream::connect(self.web.place().0).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\n{lines}\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }
}

fn ask(page: &mut WebSocket<TcpStream>, what: &Value) {
    page.send(Socket::text(what.to_string())).unwrap();
}

fn throttle(page: &mut WebSocket<TcpStream>, value: f64) {
    ask(
        page,
        &json!({ "throttle": { "esc": 0, "value": value, "signal": 0 } }),
    );
}

#[test]
fn the_page_and_its_files_are_served_to_itself_alone() {
    let desk = Desk::new();
    let port = desk.web.place().0.port();
    let host = format!("Host: localhost:{port}\r\n");
    for path in [
        "/",
        "/scope.js",
        "/uplot/uPlot.iife.min.js",
        "/uplot/LICENSE",
        "/parameters.json",
    ] {
        let answer = desk.get(path, &host);
        assert!(
            answer.starts_with("HTTP/1.1 200 OK\r\n"),
            "{path}: {answer}"
        );
        assert!(answer.contains("Content-Security-Policy: default-src 'none'; script-src 'self'"));
    }
    for (path, lines, status) in [
        ("/", "Host: rebound.example\r\n".to_owned(), "403"),
        ("/", format!("{host}Origin: http://evil.example\r\n"), "403"),
        ("/socket", format!("{host}Sec-WebSocket-Key: a\r\n"), "403"),
        ("/socket", host.clone(), "400"),
        ("/../Cargo.toml", host.clone(), "404"),
    ] {
        let answer = desk.get(path, &lines);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status} ")),
            "{path}: {answer}"
        );
    }
}

#[test]
fn a_page_sees_the_traces_spins_the_motor_and_stops_it_by_going() {
    let mut desk = Desk::new();
    let mut page = desk.page();
    let hello = page.read().unwrap().into_text().unwrap();
    let hello: Value = serde_json::from_str(&hello).unwrap();
    let channels = hello["hello"]["channels"].as_array().unwrap();
    assert_eq!(channels.len(), channel::COUNT);
    let rpm = channels.iter().position(|name| name == "rpm").unwrap();
    // The board tests itself, then zero throttle arms it.
    for _ in 0..150 {
        throttle(&mut page, 0.0);
        desk.run(10);
    }
    // Until it has had the speed for 0.2 s, the view's span.
    let (mut turns, mut settled) = (0, 0);
    while settled < 20 {
        assert!(turns < 500, "{} rpm after {turns} turns", desk.rpm);
        turns += 1;
        throttle(&mut page, 0.5);
        desk.run(10);
        let is_there = (desk.rpm - 3150.0).abs() < 30.0;
        settled = if is_there { settled + 1 } else { 0 };
    }

    let view = json!({ "id": 3, "esc": 0, "to_s": null, "span_s": 0.2, "columns": 500, "channels": [rpm], "trigger": null, "hold": false });
    ask(&mut page, &json!({ "view": view }));
    let (mut traced, mut mavlink) = (0.0, 0);
    while traced == 0.0 {
        throttle(&mut page, 0.5);
        desk.run(10);
        let bytes = page.read().unwrap().into_data();
        match bytes[0] {
            siskin_scope::MAVLINK => mavlink += bytes.len(),
            _ => traced = f32::from_le_bytes(bytes[bytes.len() - 4..].try_into().unwrap()),
        }
    }
    assert!((traced - 3150.0).abs() < 30.0, "{traced}");
    assert!(mavlink > 1000, "{mavlink} bytes of MAVLink");

    drop(page);
    desk.run(30);
    let at_once = desk.rpm;
    assert!(at_once < 3100.0, "{at_once}");
    desk.run(700);
    assert!(desk.rpm < 1000.0, "{}", desk.rpm);
    assert!(desk.web.site.viewers() == 0);
}

#[test]
fn a_page_breaks_and_mends_and_is_told_what_it_cannot() {
    let mut desk = Desk::new();
    let mut page = desk.page();
    page.read().unwrap();
    ask(
        &mut page,
        &json!({ "fault": { "esc": 0, "keys": "kind = \"bus_sag\", value = 5.0" } }),
    );
    desk.run(100);
    assert!((desk.device.rig().bus_v() - 19.0).abs() < 0.5);
    ask(&mut page, &json!({ "mend": { "esc": 0 } }));
    desk.run(100);
    assert!((desk.device.rig().bus_v() - 24.0).abs() < 0.5);
    for wrong in [
        json!({ "fault": { "esc": 0, "keys": "kind = \"mosfet_short\"" } }),
        json!({ "fault": { "esc": 1, "keys": "kind = \"reset\"" } }),
    ] {
        ask(&mut page, &wrong);
        assert!(desk.answer(&mut page, "refused").is_string());
    }
}

#[test]
fn who_does_not_read_is_dropped_and_costs_the_others_nothing() {
    let mut desk = Desk::new();
    let (stuck, mut page) = (desk.page(), desk.page());
    page.read().unwrap();
    desk.run(20);
    let begun = Instant::now();
    let frames = vec![0xFD; 60_000];
    while desk.web.site.viewers() == 2 {
        assert!(
            begun.elapsed() < Duration::from_secs(20),
            "it is still there"
        );
        let sent = Instant::now();
        desk.web.send(&frames);
        assert!(
            sent.elapsed() < Duration::from_millis(100),
            "the simulation waits"
        );
        let read = page.read().unwrap().into_data();
        assert!(!read.is_empty());
    }
    drop(stuck);
    desk.run(20);
    assert_eq!(desk.web.site.viewers(), 1);
}

#[test]
fn a_taken_port_is_an_error_only_where_it_was_named() {
    let desk = Desk::new();
    let taken = WebAddress::At(desk.web.place().0.into());
    let line = Web::open(&taken, (&names(), 1), &[])
        .err()
        .unwrap()
        .to_string();
    assert!(line.contains("is taken; give another port"), "{line}");
    assert!(matches!(
        Web::open(&WebAddress::None, (&names(), 1), &[]),
        Ok((None, None))
    ));
}

#[test]
fn a_scenario_plays_until_its_page_is_gone() {
    let mut desk = Desk::new();
    let mut page = desk.page();
    page.read().unwrap();
    let text = "bench.duration_s = 60.0
        signal = [{ at_s = 0.0, throttle = 0.0 }, { at_s = 2.0, throttle = 0.5 }]";
    ask(
        &mut page,
        &json!({ "scenario": { "esc": 0, "text": text } }),
    );
    let mut turns = 0;
    while (desk.rpm - 3150.0).abs() > 30.0 {
        assert!(turns < 800, "{} rpm after {turns} turns", desk.rpm);
        turns += 1;
        desk.run(10);
    }
    drop(page);
    desk.run(1500);
    assert!(desk.rpm < 1000.0, "{}", desk.rpm);
}

#[test]
fn a_motor_is_one_of_the_library_and_no_file() {
    let mut desk = Desk::new();
    let mut page = desk.page();
    page.read().unwrap();
    // The board tests itself, and plays its tune.
    desk.run(1500);
    for (bench, key) in [("/etc/hostname", "refused"), ("bare", "fitted")] {
        ask(&mut page, &json!({ "fit": { "esc": 0, "bench": bench } }));
        desk.answer(&mut page, key);
    }
}

#[test]
fn a_scenario_ends_with_what_held_of_its_expectations() {
    let mut desk = Desk::new();
    let mut page = desk.page();
    page.read().unwrap();
    let text = "bench.duration_s = 0.3
        signal = [{ at_s = 0.0, throttle = 0.0 }]
        window = [{ name = \"rest\", t0_s = 0.1, t1_s = 0.2 }]
        expect = [
            { window = \"rest\", key = \"rpm_max\", below = 1.0 },
            { window = \"rest\", key = \"bus_v_mean\", above = 30.0 },
            { window = \"run\", key = \"faults\", equals = 0 },
        ]";
    ask(
        &mut page,
        &json!({ "scenario": { "esc": 0, "text": text } }),
    );
    let ending = desk.answer(&mut page, "scenario");
    assert_eq!(ending["faults"], json!([]));
    let held: Vec<_> = (0..3)
        .map(|i| ending["expectations"][i][1].clone())
        .collect();
    assert_eq!(held, [true, false, true], "{ending}");
}
