use super::*;
use crate::panel::{Packing, SignalLayout};

/// The generic panel with 5 × 3 pixels, that packing and as many bits.
fn panel(packing: Packing, bits: u8) -> PanelProfile {
    let mut profile = PanelProfile::generic().expect("generic");
    (profile.width, profile.height, profile.bits) = (5, 3, bits);
    profile.signal = SignalLayout::plain(5, 3, packing);
    profile
}

fn levels(shown: Option<Result<Shown>>) -> Vec<Vec<u16>> {
    let frames = shown.expect("a frame").expect("readable").levels().expect("levels");
    frames.into_iter().map(|frame| frame.levels).collect()
}

fn raw(
    bytes: &[u8],
    size: (usize, usize),
    format: RawFormat,
    profile: &PanelProfile,
) -> (Result<Prepared>, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("frames.raw");
    std::fs::write(&path, bytes).expect("write");
    let source = Source::Raw { path: Some(path), width: size.0, height: size.1, format };
    (Prepared::open(source, profile, true, None, &Arc::default()), folder)
}

#[test]
fn raw_frames_are_exact_and_a_cut_one_is_told() {
    let profile = panel(Packing::Gray, 8);
    let bytes: Vec<u8> = (0..37).collect();
    let (sequence, _folder) = raw(&bytes, (5, 3), RawFormat::Gray, &profile);
    let mut sequence = sequence.expect("opens");
    assert_eq!(levels(sequence.next()), [(0..15).collect::<Vec<u16>>()]);
    assert_eq!(levels(sequence.next()), [(15..30).collect::<Vec<u16>>()]);
    assert!(sequence.next().is_none() && sequence.next().is_none());
    let notes = sequence.notes();
    let notes = notes.lock().expect("notes");
    assert!(notes.len() == 1 && notes[0].contains("frame 2 is cut short, 7 of 15 bytes"), "{notes:?}");
    drop(notes);
    // Two bytes a level, the low one first, and a level that the panel does not have.
    let ten = panel(Packing::Santec60, 10);
    let words: Vec<u8> = (0..15u16).flat_map(|n| (n * 70).to_le_bytes()).collect();
    let (sequence, _folder) = raw(&words, (5, 3), RawFormat::Gray16, &ten);
    assert_eq!(levels(sequence.expect("opens").next()), [(0..15).map(|n| n * 70).collect::<Vec<u16>>()]);
    let (sequence, _folder) = raw(&[255; 30], (5, 3), RawFormat::Gray16, &ten);
    let refused = sequence.expect("opens").next().expect("frame").expect_err("level").to_string();
    assert!(refused.contains("frame 0") && refused.contains("65535") && !refused.contains('\n'), "{refused}");
    // Another size is refused at once.
    let (refused, _folder) = raw(&[], (3, 5), RawFormat::Gray, &profile);
    assert!(refused.err().is_some_and(|e| e.to_string().contains("3×5")));
}

#[test]
fn one_bit_planes_are_packed_as_the_panel_carries_them() {
    let profile = panel(Packing::Planes24, 1);
    // 25 planes: plane n has only pixel n % 15 on. Rows of 5 pixels take a byte each.
    let plane = |n: usize| (0..3).map(move |row| if n % 15 / 5 == row { 0x80u8 >> (n % 15 % 5) } else { 0 });
    let bytes: Vec<u8> = (0..25).flat_map(plane).collect();
    let (sequence, _folder) = raw(&bytes, (5, 3), RawFormat::Mono, &profile);
    let mut sequence = sequence.expect("opens");
    let first = sequence.next().expect("frame").expect("readable");
    let Shown::Levels(planes) = &first else { panic!("levels") };
    assert_eq!(planes.len(), 24);
    for (n, plane) in planes.iter().enumerate() {
        let on: Vec<usize> = (0..15).filter(|&i| plane.levels[i] == 1).collect();
        assert_eq!(on, [n % 15], "plane {n}");
    }
    // Green carries planes 0 … 7: pixel 3 has planes 3 and 18.
    let signal = first.signal().expect("signal");
    assert_eq!(signal.rgb[9..12], [0, 1 << 3, 1 << 2]);
    let last = sequence.next().expect("frame").expect("readable");
    assert!(matches!(&last, Shown::Levels(frames) if frames.len() == 1));
    assert!(sequence.next().is_none());
    let notes = sequence.notes();
    assert!(notes.lock().expect("notes")[0].contains("1 of the 24 frames"));
    // Black and white pictures of other programs count as 0 and 1 on a plain one-bit panel.
    let dmd = panel(Packing::Gray1, 1);
    let (sequence, _folder) = raw(&[0, 255, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255], (5, 3), RawFormat::Gray, &dmd);
    assert_eq!(levels(sequence.expect("opens").next()), [[0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]]);
}

#[test]
fn pictures_come_in_natural_order_and_packed_ones_as_they_are() {
    let folder = tempfile::tempdir().expect("folder");
    let profile = panel(Packing::Gray, 8);
    for n in [10u16, 2, 1, 33] {
        let frame = Frame::new(&profile, 633e-9, vec![n; 15]).expect("frame");
        frame.write(&folder.path().join(format!("f{n}.png"))).expect("write");
    }
    std::fs::write(folder.path().join("report.json"), "{}").expect("write");
    let pictures = pictures_in(folder.path()).expect("pictures");
    // The panel is what the pictures say, though the default is another.
    let default = PanelProfile::generic().expect("generic");
    let sequence = Prepared::open(Source::Pictures(pictures), &default, false, None, &Arc::default()).expect("opens");
    let seen: Vec<u16> =
        sequence.map(|shown| shown.expect("readable").levels().expect("levels")[0].levels[7]).collect();
    assert_eq!(seen, [1, 2, 10, 33]);
    assert!(pictures_in(&folder.path().join("nowhere")).is_err());
    let empty = tempfile::tempdir().expect("folder");
    assert!(pictures_in(empty.path()).is_err_and(|e| e.to_string().contains("no frames")));
    let mut names = ["a10.png", "a9.png", "b.png", "a09.png", "A1.png", "a.png", "a9b2.png", "a9b10.png"];
    names.sort_by_cached_key(|name| natural(name));
    assert_eq!(names, ["a.png", "A1.png", "a09.png", "a9.png", "a9b2.png", "a9b10.png", "a10.png", "b.png"]);

    let planes = panel(Packing::Planes24, 1);
    let frames: Vec<Frame> = (0..24)
        .map(|n| Frame::new(&planes, 633e-9, (0..15).map(|i| (i * n / 7) as u16 & 1).collect()).expect("f"))
        .collect();
    let video = planes.signal.pack(&frames.iter().collect::<Vec<_>>()).expect("packed");
    let path = folder.path().join("video.png");
    video.write(&path).expect("write");
    for named in [true, false] {
        let given = if named { &planes } else { &default };
        let source = Source::Pictures(vec![path.clone()]);
        let mut sequence = Prepared::open(source, given, named, None, &Arc::default()).expect("opens");
        let shown = sequence.next().expect("frame").expect("readable");
        assert_eq!(shown.clone().signal().expect("signal").rgb, video.rgb);
        let unpacked = shown.levels().expect("levels");
        assert!(unpacked.iter().zip(&frames).all(|(a, b)| a.levels == b.levels) && unpacked.len() == 24);
    }
}

#[test]
fn the_wait_for_a_pipe_that_gives_nothing_can_be_stopped() {
    let profile = panel(Packing::Gray, 8);
    // One whole frame, and then silence for as long as the other end is held.
    let (reader, mut writer) = std::io::pipe().expect("pipe");
    std::io::Write::write_all(&mut writer, &[7; 20]).expect("write");
    let stop = Arc::new(Progress::new());
    let input = Piped::new(Box::new(reader), Arc::clone(&stop));
    let raw = Reader::Raw { name: "pipe".into(), input, size: (5, 3), format: RawFormat::Gray, number: 0 };
    let mut sequence =
        Prepared { reader: raw, profile, named: true, wavelength: None, notes: Arc::default(), over: false };
    assert_eq!(levels(sequence.next()), [vec![7; 15]]);
    let begin = std::time::Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(30));
            stop.stop();
        });
        assert!(matches!(sequence.next(), Some(Err(Error::Interrupted))));
    });
    assert!(begin.elapsed().as_secs_f64() < 5.0 && sequence.next().is_none());
    drop(writer);
}
