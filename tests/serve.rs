//! The server before its clients: what is right gets through whole, what is wrong is answered, and nothing that one
//! client does is felt by another.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use holodrive::panel::Modulation;
use holodrive::serve::{Flip, FrameRequest, SentFrame, ServeSettings, ServedPanel, Server};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;

fn panel() -> ServedPanel {
    ServedPanel {
        name: "panel".into(),
        width: WIDTH,
        height: HEIGHT,
        bits: 8,
        modulation: Modulation::Phase,
        pixel_pitch: [8e-6; 2],
        wavelength: 532e-9,
        design_wavelength: 532e-9,
        settle_time: 0.0,
        curve: vec![0.0; 256],
    }
}

fn settings(patience: Duration) -> ServeSettings {
    let free = Some("127.0.0.1:0".parse().expect("address"));
    ServeSettings { slmsuite: free, slmpy: free, connections: 16, patience, ..ServeSettings::default() }
}

/// Takes every frame as a panel would, and keeps them.
struct Panel {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<(Server, Vec<SentFrame>)>,
}

impl Panel {
    fn run(server: Server) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut shown = Vec::new();
            while !stopped.load(Ordering::SeqCst) {
                if let Some(request) = server.next(Duration::from_millis(5)) {
                    shown.push(request.frame().clone());
                    request.shown(flip(shown.len() as u64));
                }
            }
            (server, shown)
        });
        Self { stop, thread }
    }

    fn end(self) -> (Server, Vec<SentFrame>) {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.join().expect("panel")
    }
}

fn flip(number: u64) -> Flip {
    Flip { at: Instant::now(), number, missed: 0 }
}

/// Levels as they are handed on.
fn levels(bytes: &[u8]) -> SentFrame {
    SentFrame::Levels(bytes.iter().copied().map(u16::from).collect())
}

/// A frame that differs in every level from its neighbours in time.
fn frame(number: u32) -> Vec<u8> {
    (0..WIDTH * HEIGHT)
        .map(|i| (i.wrapping_mul(2_654_435_761).wrapping_add(number.wrapping_mul(97)) >> 7) as u8)
        .collect()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let value = three.iter().fold(0u32, |value, &byte| value << 8 | u32::from(byte)) << (8 * (3 - three.len()));
        for letter in 0..4 {
            let index = (value >> (18 - 6 * letter) & 63) as usize;
            text.push(if letter <= three.len() { char::from(LETTERS[index]) } else { '=' });
        }
    }
    text
}

/// `quote_plus` as far as JSON and base64 need it.
fn quoted(text: &str) -> Vec<u8> {
    text.bytes()
        .flat_map(|b| if b.is_ascii_alphanumeric() { vec![b] } else { format!("%{b:02X}").into_bytes() })
        .collect()
}

fn request(levels: &[u8], height: u32) -> Vec<u8> {
    let display = format!(
        r#"{{"__zlib__": "{}", "__shape__": [{height}, {WIDTH}], "__dtype__": "uint8"}}"#,
        base64(&zlib(levels))
    );
    let json =
        format!(r#"{{"name": "panel", "command": "_set_phase_hw", "args": [], "kwargs": {{"display": {display}}}}}"#);
    let mut line = quoted(&json);
    line.push(b'\n');
    line
}

fn ask(address: SocketAddr, line: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).expect("connect");
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("timeout");
    // A server that refuses may close before it has read all.
    let _ = stream.write_all(line);
    let mut answer = String::new();
    match stream.read_to_string(&mut answer) {
        Ok(_) => answer,
        Err(error) if error.kind() == ErrorKind::ConnectionReset => answer,
        Err(error) => panic!("no answer: {error}"),
    }
}

const SHOWN: &str = "%5Btrue%2Cnull%5D\n";

#[test]
fn a_client_is_answered_only_when_its_frame_is_shown() {
    let server = Server::start(panel(), &settings(Duration::from_secs(20))).expect("server");
    let address = server.slmsuite().expect("address");
    let client = std::thread::spawn(move || {
        let answer = ask(address, &request(&frame(3), HEIGHT));
        (answer, Instant::now())
    });
    let waiting: FrameRequest = server.next(Duration::from_secs(20)).expect("frame");
    assert_eq!(*waiting.frame(), levels(&frame(3)));
    std::thread::sleep(Duration::from_millis(200));
    let shown = Instant::now();
    waiting.shown(flip(1));
    let (answer, answered) = client.join().expect("client");
    assert_eq!(answer, SHOWN);
    assert!(answered > shown);
}

#[test]
fn a_refusal_and_a_panel_that_does_not_answer_are_told() {
    let server = Server::start(panel(), &settings(Duration::from_millis(300))).expect("server");
    let address = server.slmsuite().expect("address");
    let client = std::thread::spawn(move || [1, 2].map(|number| ask(address, &request(&frame(number), HEIGHT))));
    server.next(Duration::from_secs(20)).expect("frame").refused("the monitor is gone");
    // The second frame is left lying until its client has been told; it must not come late.
    std::thread::sleep(Duration::from_millis(900));
    let [refused, late] = client.join().expect("client");
    assert!(refused.contains("false") && refused.contains("monitor"), "{refused}");
    assert!(late.contains("false") && late.contains("time"), "{late}");
    assert!(server.next(Duration::from_millis(50)).is_none());
}

#[test]
fn slmpy_sends_frame_after_frame_in_one_connection() {
    let server = Server::start(panel(), &settings(Duration::from_secs(20))).expect("server");
    let mut stream = TcpStream::connect(server.slmpy().expect("address")).expect("connect");
    let running = Panel::run(server);
    let mut send = |bytes: &[u8]| {
        stream.write_all(&(bytes.len() as i32).to_le_bytes()).expect("length");
        stream.write_all(bytes).expect("frame");
        let mut answer = [0; 4];
        let read = stream.read(&mut answer).expect("answer");
        String::from_utf8_lossy(&answer[..read]).into_owned()
    };
    assert_eq!(send(&zlib(&frame(1))), "done");
    assert_eq!(send(&frame(2)), "done");
    assert_eq!(send(&zlib(&frame(3)[1..])), "err");
    assert_eq!(send(&zlib(&frame(4))), "done");
    // A length that no frame has leaves no way to find the next one: the connection ends.
    stream.write_all(&(-1i32).to_le_bytes()).expect("length");
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert_eq!(rest, b"err");
    let (server, shown) = running.end();
    assert_eq!(shown, [1, 2, 4].map(|number| levels(&frame(number))));
    assert_eq!(server.counts().refused, 2);
}

#[test]
fn each_request_is_a_line_of_the_log() {
    let folder = tempfile::tempdir().expect("folder");
    let log = folder.path().join("clients.log");
    let settings = ServeSettings { log: Some(log.clone()), ..settings(Duration::from_secs(20)) };
    let server = Server::start(panel(), &settings).expect("server");
    let (slmsuite, slmpy) = (server.slmsuite().expect("port"), server.slmpy().expect("port"));
    let panel = Panel::run(server);
    ask(slmsuite, &request(&frame(1), HEIGHT));
    ask(slmsuite, &request(&frame(1), HEIGHT + 1));
    let mut stream = TcpStream::connect(slmpy).expect("connect");
    let mut said = [0; 3];
    for bytes in [zlib(&[0; 7]), zlib(&[3; 3 * (WIDTH * HEIGHT) as usize])] {
        stream.write_all(&(bytes.len() as u32).to_le_bytes()).expect("length");
        stream.write_all(&bytes).expect("frame");
        stream.read_exact(&mut said).expect("answer");
    }
    // `done`: the frame of three equal colours.
    assert_eq!(&said, b"don");
    let own = stream.local_addr().expect("address").to_string();
    drop(stream);
    let (server, shown) = panel.end();
    assert_eq!((shown.len(), server.counts().refused), (2, 2));
    let text = std::fs::read_to_string(&log).expect("log");
    let lines: Vec<&str> = text.lines().collect();
    let found = |words: &[&str]| lines.iter().any(|line| words.iter().all(|word| line.contains(word)));
    assert!(found(&["Z 127.0.0.1:", " slmsuite frame: shown as frame 1"]), "{text}");
    assert!(found(&[" slmsuite: refused: ", "shape [25, 32]"]), "{text}");
    assert!(found(&[&own, " slmpy frame: refused: the frame does not unfold"]), "{text}");
    assert!(found(&[&own, " slmpy frame: shown as frame 2"]), "{text}");
}

#[test]
fn silent_clients_do_not_keep_others_out() {
    let server = Server::start(panel(), &settings(Duration::from_secs(10))).expect("server");
    let (slmsuite, slmpy) = (server.slmsuite().expect("address"), server.slmpy().expect("address"));
    let running = Panel::run(server);
    // Three times as many as may be connected, each with the beginning of a request.
    let mut silent: Vec<TcpStream> = (0..48)
        .map(|i| {
            let mut stream = TcpStream::connect(if i % 2 == 0 { slmsuite } else { slmpy }).expect("connect");
            let _ = stream.write_all(&request(&frame(0), HEIGHT)[..3]);
            stream
        })
        .collect();
    let start = Instant::now();
    for number in 0..20 {
        assert_eq!(ask(slmsuite, &request(&frame(number), HEIGHT)), SHOWN);
    }
    assert!(start.elapsed() < Duration::from_secs(8), "served only after the silent ones were given up");
    silent.clear();
    let (_, shown) = running.end();
    assert_eq!(shown.len(), 20);
}

/// Resident memory of this process [bytes], where the system tells.
fn resident() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    pages.split_whitespace().nth(1)?.parse::<u64>().ok().map(|pages| pages * 4096)
}

#[test]
fn ten_thousand_requests_a_tenth_of_them_garbage() {
    let server = Server::start(panel(), &settings(Duration::from_secs(10))).expect("server");
    let (slmsuite, slmpy) = (server.slmsuite().expect("address"), server.slmpy().expect("address"));
    let running = Panel::run(server);
    let garbage = |number: u32| {
        let whole = request(&frame(number), HEIGHT);
        match number / 10 % 7 {
            // Truncated, and the client goes.
            0 => drop(TcpStream::connect(slmsuite).expect("connect").write_all(&whole[..whole.len() / 2])),
            // Another shape.
            1 => assert!(ask(slmsuite, &request(&frame(number)[WIDTH as usize..], HEIGHT - 1)).contains("shape")),
            // Longer than any frame.
            2 => assert!(ask(slmsuite, &vec![b'A'; 400_000]).contains("longer")),
            // Not this protocol.
            3 => assert!(ask(slmsuite, b"GET / HTTP/1.1\r\n\r\n").contains("false")),
            // A length beyond all bounds.
            4 => drop(TcpStream::connect(slmpy).expect("connect").write_all(&[0xFF, 0xFF, 0xFF, 0x7F])),
            // A promised frame that does not come; the client stays silent and then goes.
            5 => drop(TcpStream::connect(slmpy).expect("connect").write_all(&[0, 1, 0, 0, 1, 2, 3])),
            // Nothing at all.
            _ => drop(TcpStream::connect(slmsuite).expect("connect")),
        }
    };
    let mut early = None;
    let mut wanted = Vec::new();
    for number in 0..10_000u32 {
        if number % 10 == 9 {
            garbage(number);
        } else {
            assert_eq!(ask(slmsuite, &request(&frame(number), HEIGHT)), SHOWN, "request {number}");
            wanted.push(number);
        }
        if number == 2_000 {
            early = resident();
        }
    }
    let late = resident();
    let (server, shown) = running.end();
    assert_eq!(shown.len(), wanted.len(), "frames were lost or made up");
    for (sent, number) in shown.iter().zip(wanted) {
        assert!(*sent == levels(&frame(number)), "frame {number}");
    }
    assert_eq!(server.counts().frames, 9_000);
    if let (Some(early), Some(late)) = (early, late) {
        // The test itself keeps 7,200 frames of 1.5 kB from there on: 11 MB; ten more for the allocator.
        assert!(late < early + 21_000_000, "memory grew by {} bytes", late - early);
    }
}

#[test]
fn an_answer_waits_until_the_panel_has_settled() {
    let settings = ServeSettings { settle: Duration::from_millis(300), ..settings(Duration::from_secs(20)) };
    let server = Server::start(panel(), &settings).expect("server");
    let address = server.slmsuite().expect("address");
    let running = Panel::run(server);
    let start = Instant::now();
    assert_eq!(ask(address, &request(&frame(1), HEIGHT)), SHOWN);
    assert!(start.elapsed() >= Duration::from_millis(300));
    running.end();
}

#[test]
fn half_requests_and_empty_connections_do_not_keep_a_lawful_client_from_the_panel() {
    let server = Server::start(panel(), &settings(Duration::from_secs(5))).expect("server");
    let (slmsuite, slmpy) = (server.slmsuite().expect("slmsuite"), server.slmpy().expect("slmpy"));
    let running = Panel::run(server);
    let mut lawful = TcpStream::connect(slmpy).expect("connect");
    lawful.set_read_timeout(Some(Duration::from_secs(10))).expect("timeout");
    let mut show = |level: u8| {
        lawful.write_all(&(WIDTH * HEIGHT).to_le_bytes()).expect("length");
        lawful.write_all(&vec![level; (WIDTH * HEIGHT) as usize]).expect("levels");
        let mut answer = [0; 4];
        lawful.read_exact(&mut answer).expect("an answer");
        assert_eq!(&answer, b"done", "frame {level}");
    };
    show(0);
    let stop = Arc::new(AtomicBool::new(false));
    let attackers: Vec<JoinHandle<()>> = (0..10)
        .map(|_| {
            let stop = Arc::clone(&stop);
            // Nearly as long as the longest request, which then never ends.
            let half = vec![b'A'; 64 * 1024 + 2 * (WIDTH * HEIGHT) as usize * 101 / 100 * 4 - 200];
            std::thread::spawn(move || {
                while !stop.load(Ordering::SeqCst) {
                    let Ok(mut stream) = TcpStream::connect(slmsuite) else { continue };
                    let idle: Vec<_> = (0..2).map(|_| TcpStream::connect(slmsuite)).collect();
                    let _ = stream.set_write_timeout(Some(Duration::from_millis(300)));
                    let _ = stream.write_all(&half);
                    for _ in 0..20 {
                        if stop.load(Ordering::SeqCst) || stream.write_all(b"A").is_err() {
                            break;
                        }
                        std::thread::sleep(Duration::from_millis(50));
                    }
                    drop(idle);
                }
            })
        })
        .collect();
    std::thread::sleep(Duration::from_millis(300));
    let start = Instant::now();
    for level in 1..=40 {
        show(level);
    }
    let took = start.elapsed();
    stop.store(true, Ordering::SeqCst);
    attackers.into_iter().for_each(|attacker| attacker.join().expect("no panic"));
    let (_, shown) = running.end();
    assert_eq!(shown.len(), 41);
    assert!(took < Duration::from_secs(8), "{took:?}");
}

#[cfg(unix)]
mod local {
    use super::*;
    use std::fs::{File, OpenOptions};
    use std::io::{BufRead, BufReader};
    use std::os::unix::fs::FileExt;
    use std::os::unix::net::UnixStream;
    use std::path::Path;

    /// A client of the local protocol.
    struct Client {
        stream: BufReader<UnixStream>,
        buffer: File,
    }

    impl Client {
        fn connect(socket: &Path) -> Self {
            let stream = UnixStream::connect(socket).expect("connect");
            stream.set_read_timeout(Some(Duration::from_secs(30))).expect("timeout");
            let mut client = Self { stream: BufReader::new(stream), buffer: File::open("/dev/null").expect("null") };
            let about: serde_json::Value = serde_json::from_str(&client.line()).expect("greeting");
            assert_eq!((&about["width"], &about["height"]), (&WIDTH.into(), &HEIGHT.into()), "{about}");
            assert_eq!(about["bytes"], 8 * WIDTH * HEIGHT);
            let path = about["buffer"].as_str().expect("path");
            client.buffer = OpenOptions::new().write(true).open(path).expect("buffer");
            assert_eq!(client.ask("{\"mapped\": true}"), "{}\n");
            assert!(!Path::new(path).exists(), "the buffer keeps a name");
            client
        }

        fn line(&mut self) -> String {
            let mut line = String::new();
            self.stream.read_line(&mut line).expect("answer");
            line
        }

        fn ask(&mut self, request: &str) -> String {
            writeln!(self.stream.get_mut(), "{request}").expect("request");
            self.line()
        }

        fn show(&mut self, bytes: &[u8], kind: &str) -> serde_json::Value {
            self.buffer.write_all_at(bytes, 0).expect("buffer");
            serde_json::from_str(&self.ask(kind)).expect("answer")
        }
    }

    const LEVELS: &str = r#"{"show": "levels", "dtype": "uint8"}"#;
    const PHASE: &str = r#"{"show": "phase", "dtype": "float32"}"#;

    fn start(folder: &Path, connections: usize) -> (Panel, std::path::PathBuf) {
        let socket = folder.join("panel.sock");
        let settings = ServeSettings {
            slmsuite: None,
            slmpy: None,
            local: Some(socket.clone()),
            connections,
            patience: Duration::from_secs(2),
            ..ServeSettings::default()
        };
        (Panel::run(Server::start(panel(), &settings).expect("server")), socket)
    }

    #[test]
    fn frames_cross_in_shared_memory_and_are_answered_with_their_time() {
        let folder = tempfile::tempdir().expect("folder");
        let (running, socket) = start(folder.path(), 8);
        let mut client = Client::connect(&socket);
        let before = holodrive::serve::monotonic_seconds(Instant::now()).expect("clock");
        let told = client.show(&frame(1), LEVELS);
        let after = holodrive::serve::monotonic_seconds(Instant::now()).expect("clock");
        assert_eq!((&told["number"], &told["missed"]), (&1.into(), &0.into()), "{told}");
        assert!(told["time"].as_f64().is_some_and(|time| (before..=after).contains(&time)), "{told}");
        let phases: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| i as f32 * 0.01).collect();
        assert_eq!(client.show(bytemuck::cast_slice(&phases), PHASE)["number"], 2);
        drop(client);
        let (server, shown) = running.end();
        assert_eq!(shown, [levels(&frame(1)), SentFrame::Values(phases)]);
        drop(server);
        assert_eq!(std::fs::read_dir(folder.path()).expect("list").count(), 0, "something was left behind");
    }

    #[test]
    fn what_one_client_does_is_not_felt_by_another() {
        let folder = tempfile::tempdir().expect("folder");
        let (running, socket) = start(folder.path(), 8);
        let mut good = Client::connect(&socket);
        let mut number = 0;
        let mut still = |good: &mut Client| {
            number += 1;
            assert_eq!(good.show(&frame(number), LEVELS)["number"], number);
        };
        still(&mut good);
        // Answered, and the connection goes on.
        let mut bad = Client::connect(&socket);
        for wrong in ["{}", "[1]", "\u{7f}\u{0}", r#"{"show": "levels", "dtype": "float32"}"#, "", r#"{"show": 1}"#] {
            assert!(bad.ask(wrong).contains("error"), "{wrong}");
            still(&mut good);
        }
        assert!(bad.show(&frame(0), r#"{"show": "amplitude", "dtype": "float32"}"#)["error"].is_string());
        // A file cut short under the server's hands.
        bad.buffer.set_len(10).expect("cut");
        assert!(bad.ask(LEVELS).contains("shared file"));
        still(&mut good);
        // A line without end.
        writeln!(bad.stream.get_mut(), "{}", "x".repeat(600_000)).ok();
        assert!(bad.line().contains("longer"));
        still(&mut good);
        // One that goes in the middle of a line, and one that goes before it has read anything.
        let mut gone = Client::connect(&socket);
        gone.stream.get_mut().write_all(b"{\"show").expect("half");
        drop(gone);
        drop(UnixStream::connect(&socket).expect("connect"));
        // Silent in the middle of a line: cut off after its patience.
        let mut slow = Client::connect(&socket);
        slow.stream.get_mut().write_all(b"{\"show").expect("half");
        assert!(slow.line().contains("in time"));
        still(&mut good);
        // More than may be connected: the silent ones go, the busy one stays.
        let crowd: Vec<Client> = (0..20)
            .map(|_| {
                let guest = Client::connect(&socket);
                still(&mut good);
                guest
            })
            .collect();
        still(&mut good);
        drop(crowd);
        let (_, shown) = running.end();
        assert_eq!(shown, (1..=number).map(|number| levels(&frame(number))).collect::<Vec<_>>());
        // Clients that were cut off may still be leaving; their files go with them.
        let start = Instant::now();
        while std::fs::read_dir(folder.path()).expect("list").count() > 0 {
            assert!(start.elapsed() < Duration::from_secs(10), "something was left behind");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    #[test]
    fn three_thousand_local_requests_a_tenth_of_them_garbage() {
        let folder = tempfile::tempdir().expect("folder");
        let (running, socket) = start(folder.path(), 8);
        let mut client = Client::connect(&socket);
        let (mut wanted, mut early) = (Vec::new(), None);
        for number in 0..3_000u32 {
            if number % 10 != 9 {
                client.show(&frame(number), LEVELS);
                wanted.push(levels(&frame(number)));
            } else if number % 20 == 9 {
                assert!(client.ask("{\"show\": \"levels\"").contains("error"));
            } else {
                // One that goes in the middle of its request.
                let mut gone = Client::connect(&socket);
                gone.stream.get_mut().write_all(b"{\"show\": ").expect("half");
            }
            if number == 600 {
                early = resident();
            }
        }
        let late = resident();
        let (server, shown) = running.end();
        assert!(shown == wanted, "frames were lost or made up");
        assert_eq!(server.counts().frames, 2_700);
        if let (Some(early), Some(late)) = (early, late) {
            // The test itself keeps 2,160 frames twice, 1.5 kB each; other tests of this process are at work beside it.
            assert!(late < early + 40_000_000, "memory grew by {} bytes", late - early);
        }
    }

    #[test]
    fn a_client_that_has_gone_is_known() {
        let folder = tempfile::tempdir().expect("folder");
        let socket = folder.path().join("panel.sock");
        let free = Some("127.0.0.1:0".parse().expect("address"));
        let settings = ServeSettings {
            slmsuite: free,
            slmpy: None,
            local: Some(socket.clone()),
            ..settings(Duration::from_secs(5))
        };
        let server = Server::start(panel(), &settings).expect("server");
        let address = server.slmsuite().expect("address");
        let (say, said) = std::sync::mpsc::channel();
        let client = std::thread::spawn(move || {
            let mut client = Client::connect(&socket);
            client.show(&frame(1), LEVELS);
            said.recv().expect("word");
            drop(client);
            ask(address, &request(&frame(2), HEIGHT))
        });
        let shown = server.next(Duration::from_secs(20)).expect("frame");
        let number = shown.client().expect("a lasting client");
        shown.shown(flip(1));
        assert!(server.is_connected(number));
        say.send(()).expect("client");
        let next = server.next(Duration::from_secs(20)).expect("frame");
        assert_eq!(next.client(), None, "slmsuite's clients do not last");
        next.shown(flip(2));
        client.join().expect("client");
        let start = Instant::now();
        while server.is_connected(number) {
            assert!(start.elapsed() < Duration::from_secs(10), "it has gone");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// The local protocol by a port: on every system.
mod port {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::path::Path;

    struct Client(BufReader<TcpStream>);

    impl Client {
        /// Says the key of the file, or another.
        fn connect(path: &Path, key: Option<&str>) -> (Self, String) {
            let text = std::fs::read_to_string(path).expect("file");
            let told: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let stream = TcpStream::connect(told["address"].as_str().expect("address")).expect("connect");
            stream.set_read_timeout(Some(Duration::from_secs(30))).expect("timeout");
            let mut client = Self(BufReader::new(stream));
            let key = key.map_or_else(|| serde_json::json!({ "key": told["key"] }).to_string(), str::to_owned);
            let greeting = client.ask(&key);
            (client, greeting)
        }

        fn ask(&mut self, request: &str) -> String {
            writeln!(self.0.get_mut(), "{request}").expect("request");
            self.line()
        }

        fn line(&mut self) -> String {
            let mut line = String::new();
            // One that is cut off while it still sends may be told so by an error.
            let _ = self.0.read_line(&mut line);
            line
        }

        fn show(&mut self, bytes: &[u8], kind: &str) -> serde_json::Value {
            let ready: serde_json::Value = serde_json::from_str(&self.ask(kind)).expect("answer");
            assert_eq!(ready["send"], bytes.len(), "{ready}");
            self.0.get_mut().write_all(bytes).expect("array");
            serde_json::from_str(&self.line()).expect("answer")
        }
    }

    const LEVELS: &str = r#"{"show": "levels", "dtype": "uint8"}"#;

    #[test]
    fn arrays_follow_the_answer_that_asks_for_them_and_without_the_key_nothing_is_told() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("panel.port");
        let settings = ServeSettings {
            slmsuite: None,
            slmpy: None,
            local: Some(path.clone()),
            connections: 8,
            patience: Duration::from_secs(2),
            ..ServeSettings::default()
        };
        let server = Server::start(panel(), &settings).expect("server");
        assert_eq!(server.local(), Some(path.as_path()));
        let why = Server::start(panel(), &settings).err().expect("taken").to_string();
        assert!(why.contains("another server"), "{why}");
        let running = Panel::run(server);
        let (mut good, greeting) = Client::connect(&path, None);
        assert!(greeting.contains("\"width\":32") && !greeting.contains("buffer"), "{greeting}");
        let phases: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| i as f32 * 0.01).collect();
        let mut wanted = Vec::new();
        let mut still = |good: &mut Client| {
            let number = wanted.len() as u32 + 1;
            assert_eq!(good.show(&frame(number), LEVELS)["number"], number);
            wanted.push(levels(&frame(number)));
        };
        still(&mut good);
        for key in ["", "{}", "{\"key\": \"00000000000000000000000000000000\"}", &"x".repeat(5000)] {
            let (mut wrong, answer) = Client::connect(&path, Some(key));
            assert!(!answer.contains("width") && wrong.line().is_empty(), "{key}: {answer}");
            still(&mut good);
        }
        // What is no request is answered, and the connection goes on; half an array ends it.
        assert!(good.ask("{\"show\": \"amplitude\", \"dtype\": \"float32\"}").contains("modulates phase"));
        assert!(good.ask("{\"show\": \"levels\"").contains("not understood"));
        still(&mut good);
        let (mut half, _) = Client::connect(&path, None);
        assert!(half.ask(LEVELS).contains("send"));
        half.0.get_mut().write_all(&[1; 100]).expect("half");
        assert!(half.line().is_empty(), "cut off after its patience");
        let (mut gone, _) = Client::connect(&path, None);
        assert!(gone.ask(LEVELS).contains("send"));
        drop(gone);
        still(&mut good);
        let phase = r#"{"show": "phase", "dtype": "float32"}"#;
        assert_eq!(good.show(bytemuck::cast_slice(&phases), phase)["number"], wanted.len() + 1);
        drop(good);
        let (server, shown) = running.end();
        wanted.push(SentFrame::Values(phases));
        assert_eq!(shown, wanted);
        drop(server);
        assert_eq!(std::fs::read_dir(folder.path()).expect("list").count(), 0, "something was left behind");
    }
}

#[test]
fn the_server_ends_at_once_whoever_is_connected() {
    let server = Server::start(panel(), &settings(Duration::from_secs(60))).expect("server");
    let mut waiting = TcpStream::connect(server.slmpy().expect("address")).expect("connect");
    std::thread::sleep(Duration::from_millis(100));
    let start = Instant::now();
    drop(server);
    assert!(start.elapsed() < Duration::from_secs(5));
    waiting.set_read_timeout(Some(Duration::from_secs(5))).expect("timeout");
    assert!(matches!(waiting.read(&mut [0; 4]), Ok(0) | Err(_)));
}

#[test]
fn a_taken_port_or_an_impossible_panel_is_refused() {
    let first = Server::start(panel(), &settings(Duration::from_secs(1))).expect("server");
    let taken = ServeSettings { slmsuite: first.slmsuite(), slmpy: None, ..ServeSettings::default() };
    let message = Server::start(panel(), &taken).err().expect("taken").to_string();
    assert!(message.contains("cannot listen"), "{message}");
    assert!(Server::start(ServedPanel { bits: 17, ..panel() }, &settings(Duration::from_secs(1))).is_err());
    let mute = ServeSettings { slmsuite: None, slmpy: None, ..ServeSettings::default() };
    assert!(Server::start(panel(), &mute).is_err());
}
