//! `--display`: pictures sent to a viewer that speaks tev's protocol, here a listener of the test.

use std::io::Read;
use std::net::TcpListener;

use crate::common::{BALL, FLOOR, Folder, LIGHTS, head};

/// A packet: its kind, its name, and what follows.
struct Packet {
    kind: u8,
    name: String,
    rest: Vec<u8>,
}

/// Splits a stream into packets: length (u32, with itself), kind, one byte, name with a zero, the rest.
fn packets(mut bytes: &[u8]) -> Vec<Packet> {
    let mut list = Vec::new();
    while !bytes.is_empty() {
        let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        assert!(length <= bytes.len(), "a packet is cut off");
        let body = &bytes[6..length];
        let end = body.iter().position(|&b| b == 0).expect("a name");
        let name = String::from_utf8(body[..end].to_vec()).expect("text");
        list.push(Packet { kind: bytes[4], name, rest: body[end + 1..].to_vec() });
        bytes = &bytes[length..];
    }
    list
}

fn word(b: &[u8], i: usize) -> u32 {
    u32::from_le_bytes(b[4 * i..4 * i + 4].try_into().expect("four bytes"))
}

#[test]
fn a_viewer_gets_the_picture_and_its_updates() {
    let f = Folder::with_scene(&[&head([40, 30], 16), LIGHTS, FLOOR, BALL]);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    let viewer = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        listener.accept().expect("a connection").0.read_to_end(&mut bytes).expect("read");
        bytes
    });
    f.succeed(&format!("render scene.pbrt --time 1.6s --crop 2,34,0,30 --display {address} -o a.exr"));
    let list = packets(&viewer.join().expect("joined"));
    // Create once (4), then updates (6): early, after a second, at the end.
    assert_eq!(list[0].kind, 4);
    assert!(list.len() >= 4 && list[1..].iter().all(|p| p.kind == 6), "{}", list.len());
    assert!(list.iter().all(|p| p.name == "a.exr"));
    assert_eq!([word(&list[0].rest, 0), word(&list[0].rest, 1), word(&list[0].rest, 2)], [32, 30, 3]);
    // The last update holds the finished picture: 3 channels, R G B, x y w h, offsets and strides (u64), then data.
    let last = &list.last().expect("packets").rest;
    let data = &last[4 + 6 + 16 + 48..];
    let values: Vec<f32> = data.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().expect("four"))).collect();
    let p = f.picture("a.exr");
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let sent: Vec<f32> = values.iter().skip(c).step_by(3).copied().collect();
        assert_eq!(sent, crate::common::channel(&p, name), "{name}");
    }
}

#[test]
fn without_a_viewer_rendering_goes_on() {
    let f = Folder::with_scene(&[&head([8, 8], 4), LIGHTS]);
    // A port that was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address");
    for (i, bad) in [address.to_string(), "no-port".into(), "127.0.0.1:99999".into()].into_iter().enumerate() {
        let ended = f.succeed(&format!("render scene.pbrt --display {bad} -o {i}.exr"));
        assert!(ended.stderr.contains("no tev viewer") && f.exists(&format!("{i}.exr")), "{ended:?}");
    }
}

#[test]
fn a_viewer_that_leaves_does_not_end_the_render() {
    let f = Folder::with_scene(&[&head([200, 150], 16), LIGHTS, FLOOR]);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    let viewer = std::thread::spawn(move || drop(listener.accept().expect("a connection")));
    let ended = f.succeed(&format!("render scene.pbrt --time 1.5s --display {address} -o a.exr"));
    viewer.join().expect("joined");
    assert!(ended.stderr.contains("went away") && f.exists("a.exr"), "{ended:?}");
}
