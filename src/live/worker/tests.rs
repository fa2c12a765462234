use super::*;
use crate::encode::EncodeOptions;
use crate::names::Named;
use crate::panel::{Packing, PanelProfile, SignalLayout};
use std::time::Duration;

/// Longer than any step takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn panel() -> PanelProfile {
    let mut profile = PanelProfile::generic().expect("generic");
    (profile.width, profile.height) = (320, 256);
    profile.signal = SignalLayout::plain(320, 256, Packing::Gray);
    profile
}

fn request() -> Request {
    let encode =
        EncodeOptions { encoding: Some(Encoding::named("double-phase").expect("encoding")), ..Default::default() };
    Request { turn: [0.0; 2], shift: DVec3::ZERO, wavelength: 632.8e-9, eye: DVec3::new(0.0, 0.0, 0.6), encode }
}

fn start(path: &Path, rays: u32) -> (Worker, Vec<PathBuf>) {
    let trace = TraceSettings { width: rays, height: rays, ..TraceSettings::default() };
    let settings = Settings { scene: SceneSettings { trace, ..SceneSettings::default() }, ..Settings::default() };
    Worker::start(path, Setup::new(panel(), None).expect("setup"), settings, request()).expect("starts")
}

fn next(worker: &Worker) -> WorkerEvent {
    let begin = Instant::now();
    loop {
        if let Some(happened) = worker.poll().expect("the worker lives") {
            return happened;
        }
        assert!(begin.elapsed() < PATIENCE, "nothing happens");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Waits for that level of that request.
fn refined(worker: &Worker, version: u64, detail: Detail) -> LiveHologram {
    loop {
        match next(worker) {
            WorkerEvent::Ready(refined) if (refined.version, refined.detail) == (version, detail) => return *refined,
            WorkerEvent::Failed(why) => panic!("{why}"),
            _ => {}
        }
    }
}

fn own(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)).expect("scene")
}

fn middle(refined: &LiveHologram) -> DVec3 {
    let points = &refined.points.placed.cloud.points;
    points.iter().map(|point| point.position).sum::<DVec3>() / points.len() as f64
}

#[test]
fn levels_come_in_their_order_and_a_broken_file_leaves_the_last_good_scene() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, own("motion.gltf")).expect("write");
    let (worker, files) = start(&path, 96);
    assert_eq!(files, std::slice::from_ref(&path));
    // Half of 96 rays would be fewer than the coarse level's 56: there is no level between.
    let come = || match next(&worker) {
        WorkerEvent::Ready(refined) => *refined,
        other => panic!("{other:?}"),
    };
    let [coarse, fine] = [come(), come()];
    assert_eq!([coarse.detail, fine.detail], [Detail::Coarse, Detail::Full]);
    assert!(2 * coarse.points.placed.cloud.points.len() < fine.points.placed.cloud.points.len());
    assert!(coarse.seconds < fine.seconds);
    // The scene breaks: one line; the request is answered from the scene that is known.
    std::fs::write(&path, "{").expect("write");
    let version = worker.request(request(), true);
    let WorkerEvent::Failed(why) = next(&worker) else { panic!("a broken file was not told") };
    assert!(why.contains("scene.gltf") && !why.contains('\n'), "{why}");
    assert_eq!(refined(&worker, version, Detail::Full).frame, fine.frame);
    // It is mended, with the letter elsewhere.
    std::fs::write(&path, own("motion.gltf").replace("-0.55, 0.5, -2.0", "0.0, 0.5, -2.0")).expect("write");
    let version = worker.request(Request { shift: DVec3::new(0.0, 0.0, 1e-3), ..request() }, true);
    let WorkerEvent::Loaded(files) = next(&worker) else { panic!("the file was not read again") };
    assert_eq!(files, [path]);
    let other = refined(&worker, version, Detail::Full);
    assert!(other.frame != fine.frame);
}

#[test]
fn a_request_moves_the_hologram_as_it_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/motion.gltf");
    let (worker, _) = start(&path, 48);
    let at_rest = middle(&refined(&worker, 1, Detail::Full));
    let by = DVec3::new(2e-4, -1e-4, 5e-3);
    let version = worker.request(Request { shift: by, ..request() }, false);
    let moved = refined(&worker, version, Detail::Full);
    assert!((middle(&moved) - at_rest - by).length() < 1e-9);
    assert!((moved.points.view.focus[0].1 - (-0.1 + 5e-3)).abs() < 2e-3);
    // Turned to the right, what stood near before the middle goes to the right: the letter, which is nearest.
    let letter = |refined: &LiveHologram| {
        let points: Vec<DVec3> = refined.points.placed.cloud.points.iter().map(|p| p.position).collect();
        let upper: Vec<&DVec3> = points.iter().filter(|p| p.y > 0.3e-3).collect();
        upper.iter().map(|p| p.x).sum::<f64>() / upper.len() as f64
    };
    let version = worker.request(Request { turn: [0.3, 0.0], ..request() }, false);
    let turned = refined(&worker, version, Detail::Full);
    let version = worker.request(request(), false);
    let back = refined(&worker, version, Detail::Full);
    assert!(letter(&turned) > letter(&back) + 1e-4, "{} {}", letter(&turned), letter(&back));
    assert!((middle(&back) - at_rest).length() < 1e-12);
    // Another wavelength and encoding are in the frame's own words.
    let encode = EncodeOptions { encoding: Some(Encoding::named("kinoform").expect("encoding")), ..Default::default() };
    let version = worker.request(Request { wavelength: 520e-9, encode, ..request() }, false);
    let frame = refined(&worker, version, Detail::Full).frame;
    assert_eq!(frame.metadata.wavelength, 520e-9);
    assert_eq!(frame.metadata.encoding.expect("encoding").method, "kinoform");
}

/// Share of a frame's light that enters a pupil of 4 mm.
fn entering(frame: &Frame, eye: DVec3) -> f64 {
    use crate::light_field::{EyeGrid, Layer, LightField, Look, Viewer};
    use crate::reconstruction::seen::{Colour, Judge};
    let viewer = Viewer::at(eye);
    let eyes = EyeGrid::covering(&viewer, EyeGrid::SPACING).expect("eyes");
    let window = crate::field::Grid::new(20, 16, 128e-6, 128e-6).expect("window");
    let light = LightField::of_layers(&[Layer::new(-0.1, |_| 0.5, |_| 1.0)], eyes, window).expect("views");
    let colour = Colour::One { wavelength: frame.metadata.wavelength, channel: Default::default() };
    let look = Look { pupil: eye.truncate(), focus: -0.1 };
    let judge = Judge::new(&light, &viewer, colour, vec![look], &Progress::new()).expect("judge");
    let lit = pipeline::light(frame, &pipeline::Bench::default(), &Progress::new()).expect("light");
    let mut seen = judge.begin();
    seen.add(&judge, &lit.field, None, 0, &Progress::new()).expect("seen");
    judge.figures(&seen).all.efficiency
}

#[test]
fn frames_for_an_eye_go_where_it_goes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/motion.gltf");
    let (worker, _) = start(&path, 48);
    let encode = EncodeOptions { encoding: Some(Encoding::named("view").expect("encoding")), ..Default::default() };
    let at = |x: f64| Request { eye: DVec3::new(x, 0.0, 0.6), encode: encode.clone(), ..request() };
    let version = worker.request(at(0.0), false);
    let first = refined(&worker, version, Detail::Full);
    assert!(first.field.is_none() && first.frame.metadata.encoding.as_ref().is_some_and(|e| e.method == "view"));
    // Inside the box whose views are at hand: neither light nor views are made again.
    let version = worker.request(at(2.5e-3), false);
    let moved = refined(&worker, version, Detail::Coarse);
    assert!(moved.light_seconds < 0.2 * first.light_seconds, "{} {}", moved.light_seconds, first.light_seconds);
    // Far beyond it they are.
    let version = worker.request(at(12e-3), false);
    let beyond = refined(&worker, version, Detail::Coarse);
    let eyes = [0.0, 12e-3].map(|x| DVec3::new(x, 0.0, 0.6));
    let shares = [&first, &beyond].map(|hologram| eyes.map(|eye| entering(&hologram.frame, eye)));
    println!("light into the pupil here and there: {shares:.3?}");
    assert!(shares[0][0] > 3.0 * shares[0][1] && shares[1][1] > 3.0 * shares[1][0], "{shares:?}");
    // A scene in its window does not move aside.
    worker.request(Request { shift: DVec3::new(1e-3, 0.0, 0.0), ..at(0.0) }, false);
    let why = loop {
        match next(&worker) {
            WorkerEvent::Failed(why) => break why,
            WorkerEvent::Ready(_) | WorkerEvent::Cancelled(_) => {}
            other => panic!("{other:?}"),
        }
    };
    assert!(why.contains("window"), "{why}");
}

#[test]
fn a_new_request_stops_what_is_running() {
    // A room with indirect light and a mirror takes seconds at this size.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.gltf");
    let (worker, _) = start(&path, 700);
    refined(&worker, 1, Detail::Coarse);
    // While the second level is computed.
    std::thread::sleep(Duration::from_millis(100));
    let version = worker.request(Request { shift: DVec3::new(0.0, 0.0, 1e-3), ..request() }, false);
    let stopped = loop {
        match next(&worker) {
            WorkerEvent::Cancelled(after) => break after,
            WorkerEvent::Ready(refined) => assert!(refined.version < version, "nothing was stopped"),
            other => panic!("{other:?}"),
        }
    };
    println!("stopped {:.1} ms after the request", 1e3 * stopped);
    // The bound is 50 ms on a machine of one's own; this one may be busy.
    assert!(stopped < 0.5, "stopped only after {stopped} s");
    refined(&worker, version, Detail::Coarse);
    let begin = Instant::now();
    drop(worker);
    assert!(begin.elapsed().as_secs_f64() < 1.0, "the end waits for a computation");
}
