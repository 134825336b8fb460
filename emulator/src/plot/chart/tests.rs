use super::scale::Scale;
use super::{Axis, Curve, CurveLook, Figure, Map, PANEL, Panel, draw, prepare};

fn logarithmic(label: &str) -> Axis {
    Axis {
        logarithmic: true,
        ..Axis::new(label)
    }
}

fn lines() -> Panel {
    let x = || (0..100_000).map(|k| f64::from(k) / 100.0);
    Panel::new(
        "Four lines, of which one is noise, with their bounds",
        Axis::new("time (s)"),
        Axis::new("speed (rpm)"),
        vec![
            Curve::line("sine", x().map(|x| (x, 3000.0 * (x / 90.0).sin()))),
            Curve::line("noise", x().map(|x| (x, 1000.0 + (x * 7919.0) % 500.0))),
            Curve::dashed(
                "bound of the sine",
                x().map(|x| (x, 3000.0 * (x / 90.0).sin() + 30.0)),
            ),
            Curve::dashed("bound of the noise", [(0.0, 1500.0), (1000.0, 1500.0)]),
        ],
    )
}

fn dots() -> Panel {
    let x = || (1..60).map(|k| 10_f64.powf(f64::from(k) / 12.0));
    Panel::new(
        "Logarithmic both",
        logarithmic("frequency (Hz)"),
        logarithmic("error (el. °)"),
        vec![
            Curve::line("measured", x().map(|x| (x, 300.0 / x))),
            Curve::dots("paper", x().step_by(5).map(|x| (x, 310.0 / x))),
            Curve::dashed("bound", x().map(|x| (x, 500.0 / x))),
        ],
    )
}

fn map() -> Panel {
    let x: Vec<_> = (0..40).map(|k| 500.0 + 150.0 * f64::from(k)).collect();
    let y: Vec<_> = (0..30).map(|k| 0.005 * f64::from(k + 1)).collect();
    let row = |y: &f64| {
        let value = |x: &f64| {
            if x * y < 700.0 {
                x * y / (x * y + 40.0 + 3000.0 * y * y)
            } else {
                f64::NAN
            }
        };
        x.iter().map(value).collect()
    };
    let rows = y.iter().map(row).collect();
    Panel {
        map: Some(Map {
            label: "efficiency (%)".to_owned(),
            x: x.clone(),
            y,
            rows,
            range: None,
        }),
        ..Panel::new(
            "A map with a load's curve, and a title that is so long that it does not fit on one line",
            Axis::new("speed (rpm)"),
            Axis::new("torque (Nm)"),
            vec![
                Curve::line("propeller", x.iter().map(|x| (*x, 4.8e-9 * x * x))),
                Curve::dots("operating points", [(3000.0, 0.0432), (4500.0, 0.0972)]),
            ],
        )
    }
}

#[test]
fn maps_that_are_compared_have_one_scale() {
    let map = |rows: Vec<Vec<f64>>| Map {
        label: "ripple (%)".to_owned(),
        x: vec![1.0, 2.0],
        y: vec![1.0],
        rows,
        range: None,
    };
    let (small, great) = (vec![vec![2.0, f64::NAN]], vec![vec![3.0, 90.0]]);
    for map in map(small).alike(map(great)) {
        let scale = map.scale();
        assert_eq!((scale.low, scale.high), (2.0, 90.0));
    }
}

fn clipped() -> Panel {
    let x = || (0..2000).map(|k| f64::from(k) / 2000.0);
    Panel::new(
        "Beyond the axes",
        Axis {
            range: Some((0.2, 0.8)),
            ..Axis::new("share")
        },
        Axis {
            range: Some((-1e-6, 1e-6)),
            ..Axis::new("flux (Wb)")
        },
        vec![
            Curve::line("clipped", x().map(|x| (x, 2e-6 * (20.0 * x).sin()))),
            Curve::line(
                "gap",
                x().map(|x| {
                    (
                        x,
                        if (0.4..0.5).contains(&x) {
                            f64::NAN
                        } else {
                            1e-6 * x
                        },
                    )
                }),
            ),
            Curve::dots("cloud", x().map(|x| (x, 1e-6 * ((x * 7919.0) % 1.0 - 1.0)))),
        ],
    )
}

fn figure(name: &str, columns: usize, panels: Vec<Panel>) -> Figure {
    Figure {
        name: name.to_owned(),
        title: "A sheet whose title says at length what its panels show, so that it has to be broken into lines that fit the width".to_owned(),
        columns,
        panel: PANEL,
        panels,
    }
}

/// Returns the text of a figure's SVG and the pixels of its PNG.
fn drawn(figure: Figure) -> (String, Vec<[u8; 3]>) {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let [svg, png] = ["svg", "png"].map(|kind| made.join(format!("{}.{kind}", figure.name)));
    prepare(&made).unwrap();
    draw(&[figure], &made).unwrap();
    let file = std::io::BufReader::new(std::fs::File::open(png).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let pixels = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]);
    (std::fs::read_to_string(svg).unwrap(), pixels.collect())
}

fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let texts = document
        .descendants()
        .filter(|node| node.has_tag_name("text"));
    let texts = texts.map(|node| node.text().unwrap_or_default().trim().to_owned());
    texts.collect()
}

#[test]
fn a_sheet_says_what_it_shows_and_stays_small() {
    let panels = vec![lines(), dots(), map(), clipped()];
    let (svg, pixels) = drawn(figure("sheet", 2, panels));
    let texts = texts(&svg);
    for expected in [
        "Four lines, of which one is noise, with their bounds",
        "time (s)",
        "speed (rpm)",
        "error (el. °)",
        "efficiency (%)",
        "bound of the noise",
        "paper",
        "-3000",
        "0.01",
        "100000",
        "0.08",
        "-5e-7",
    ] {
        assert!(
            texts.iter().any(|text| text == expected),
            "no {expected} in {texts:?}"
        );
    }
    assert!(svg.len() < 300_000, "{} bytes", svg.len());
    for (colour, what) in [
        ([0x00, 0x72, 0xb2], "line"),
        ([0x22, 0x22, 0x22], "text"),
        ([0x44, 0x04, 0x57], "low end of the map"),
    ] {
        let near = |pixel: &[u8; 3]| (0..3).all(|k| pixel[k].abs_diff(colour[k]) <= 6);
        assert!(pixels.iter().any(near), "no {what}");
    }
}

#[test]
fn nothing_leaves_its_panel() {
    let (svg, _) = drawn(figure("clipped", 1, vec![clipped()]));
    let titles = texts(&svg)
        .into_iter()
        .take_while(|text| text != "Beyond the axes");
    assert_eq!(
        titles.count(),
        2,
        "the title is broken where the sheet ends"
    );
    let document = roxmltree::Document::parse(&svg).unwrap();
    let lines = document
        .descendants()
        .filter(|node| node.has_tag_name("polyline"));
    let points: Vec<(i32, i32)> = lines
        .filter(|line| line.attribute("stroke-width") == Some("5"))
        .flat_map(|line| line.attribute("points").unwrap().split_whitespace())
        .map(|point| {
            let (x, y) = point.split_once(',').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        })
        .collect();
    let [x, y] = [|p: &(i32, i32)| p.0, |p: &(i32, i32)| p.1].map(|of| {
        let values = || points.iter().map(of);
        values().min().unwrap()..=values().max().unwrap()
    });
    // The curves cross the whole of the axes, which are 1360 by about 700 pixels.
    assert!(*x.start() >= 180 && *x.end() <= 1540, "{x:?}");
    assert!(*y.start() >= 240 && *y.end() <= 930, "{y:?}");
    assert!(x.end() - x.start() > 1300 && y.end() - y.start() > 600);
}

#[test]
fn a_gap_is_not_bridged() {
    let gap = clipped().curves.remove(1);
    let (svg, _) = drawn(figure(
        "gap",
        1,
        vec![Panel {
            curves: vec![gap],
            ..clipped()
        }],
    ));
    let document = roxmltree::Document::parse(&svg).unwrap();
    let lines = document.descendants().filter(|node| {
        node.has_tag_name("polyline") && node.attribute("stroke-width") == Some("5")
    });
    assert_eq!(lines.count(), 2);
}

#[test]
fn little_or_nothing_to_show_is_drawn_too() {
    let curves = [
        vec![],
        vec![(1.0, 2.0)],
        vec![(f64::NAN, 1.0), (2.0, f64::INFINITY)],
        vec![(1.0, 5.0), (2.0, 5.0)],
        vec![(-1.0, 0.0), (0.0, -3.0)],
    ];
    let panels = curves.into_iter().flat_map(|points| {
        [CurveLook::Line, CurveLook::Dots, CurveLook::Dashed].map(|look| {
            let x = if look == CurveLook::Dots {
                logarithmic("x")
            } else {
                Axis::new("x")
            };
            Panel::new(
                "little",
                x.clone(),
                x,
                vec![Curve::new("c", look, points.iter().copied())],
            )
        })
    });
    drawn(figure("little", 3, panels.collect()));
    drawn(figure("nothing", 0, vec![]));
}

#[test]
fn numbers_are_round_and_few() {
    let numbers = |axis: &Axis, values: [f64; 2]| {
        let scale = Scale::new(axis, values.into_iter(), 0.0);
        let ticks = scale.ticks(|numbers| numbers.len() <= 6);
        let numbers = ticks.numbers.into_iter().map(|(_, number)| number);
        numbers.collect::<Vec<_>>().join(" ")
    };
    let linear = Axis::new("");
    assert_eq!(numbers(&linear, [0.0, 1.0]), "0.0 0.2 0.4 0.6 0.8 1.0");
    assert_eq!(numbers(&linear, [-0.3, 0.3]), "-0.2 0.0 0.2");
    assert_eq!(numbers(&linear, [97.0, 103.5]), "98 100 102");
    assert_eq!(numbers(&linear, [0.0, 4e7]), "0 1e7 2e7 3e7 4e7");
    assert_eq!(numbers(&linear, [0.0, 3e-6]), "0 1e-6 2e-6 3e-6");
    assert_eq!(numbers(&linear, [7.0, 7.0]), "6.5 7.0 7.5");
    let logarithmic = logarithmic("");
    assert_eq!(numbers(&logarithmic, [0.1, 12.0]), "0.1 0.3 1 3 10");
    assert_eq!(
        numbers(&logarithmic, [1e-7, 1e5]),
        "1e-6 0.0001 0.01 1 100 10000"
    );
    assert_eq!(
        numbers(&logarithmic, [300.0, 800.0]),
        "300 400 500 600 700 800"
    );
    assert_eq!(numbers(&logarithmic, [520.0, 560.0]), "520 530 540 550 560");
}

#[test]
fn a_folder_that_cannot_be_made_is_one_line() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let text = prepare(&file.path().join("folder"))
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("cannot write") && !text.contains('\n'),
        "{text}"
    );
}
