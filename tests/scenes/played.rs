//! Animated scenes as sequences of holograms: they move, upright and unmirrored, and what stands still stands still.

use holodrive::hologram::HologramSettings;
use holodrive::panel::{Packing, PanelProfile, Setup, SignalLayout};
use holodrive::pipeline::{self, Bench, Settings};
use holodrive::points::trace::TraceSettings;
use holodrive::points::{Channel, SceneSettings};
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, View};
use holodrive::scene::gltf::{Choice, Clip, File, LoadOptions};
use holodrive::sequence::{Animation, AnimationFrame};
use std::path::PathBuf;

fn scene(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// The generic panel with fewer pixels, not square.
fn panel() -> PanelProfile {
    let mut profile = PanelProfile::generic().expect("generic");
    (profile.width, profile.height) = (480, 400);
    profile.signal = SignalLayout::plain(480, 400, Packing::Gray);
    profile
}

fn settings(clip: &str) -> Settings {
    let load = LoadOptions { clip: Clip::Of(Choice::from(clip)), ..LoadOptions::default() };
    let trace = TraceSettings { width: 72, height: 60, ..TraceSettings::default() };
    let hologram = HologramSettings { error: 1e-2, ..HologramSettings::default() };
    Settings { scene: SceneSettings { load, trace, ..SceneSettings::default() }, hologram, ..Settings::default() }
}

fn made(animation: &Animation) -> Vec<AnimationFrame> {
    let mut all = Vec::new();
    let setup = Setup::new(panel(), None).expect("setup");
    let mut take = |made| {
        all.push(made);
        Ok(true)
    };
    animation.make(&setup, &Progress::new(), &mut take).expect("frames");
    all
}

/// Correlation of two pictures about their means, −1 … 1.
fn likeness(a: &[f32], b: &[f32]) -> f64 {
    let mean = |v: &[f32]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().zip(b).map(|(a, b)| f(f64::from(*a) - ma, f64::from(*b) - mb)).sum()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}

#[test]
fn the_letter_of_each_frame_is_seen_where_it_is_at_that_time() {
    let path = scene("motion.gltf");
    assert_eq!(File::open(&path).expect("file").clip_times(&Clip::First).expect("times"), Some([0.0, 2.0]));
    let mut animation = Animation::new(&path, &settings("motion"), 2.0, None, None).expect("animation");
    assert_eq!(animation.times, [0.0, 0.5, 1.0, 1.5]);
    animation.first_look(&panel().grid().expect("grid"), &Progress::new()).expect("first look");
    let frames = made(&animation);
    let (width, height) = (72, 60);
    // The letter is nearest: the upper half of the picture holds nothing else.
    let upper = |values: &[f32]| values[..width * height / 2].to_vec();
    let traced: Vec<Vec<f32>> = frames
        .iter()
        .map(|made| upper(&made.points.view.picture.iter().map(|rgb| Channel::Luminance.of(*rgb)).collect::<Vec<_>>()))
        .collect();
    let focus: Vec<f64> = frames.iter().map(|made| made.points.view.focus[0].1).collect();
    for (made, z) in frames.iter().zip(&focus) {
        // It stands still in depth: 2.0 m is the nearest depth of all frames but for the margin of the first look.
        assert!((z - focus[0]).abs() < 1e-9 && (-0.105..-0.1).contains(z), "{focus:?}");
        let light = pipeline::light(&made.encoded.frame, &Bench::default(), &Progress::new()).expect("light");
        let seen = |z: f64| {
            let half = made.points.view.placing.view_at(z);
            let (view, settings) = (View::Plane { z }, &light.settings);
            reconstruction::picture(&light.field, &view, half, (width, height), settings, &Progress::new())
                .expect("picture")
        };
        let sharp = upper(&seen(*z).values);
        let own = likeness(&sharp, &traced[made.number]);
        assert!(own > 0.8, "frame {}: {own}", made.number);
        let mirrored: Vec<f32> = sharp.chunks(width).flat_map(|row| row.iter().rev().copied()).collect();
        let flipped: Vec<f32> = sharp.chunks(width).rev().flatten().copied().collect();
        let far = upper(&seen(*z - 0.05).values);
        for (other, what) in [(mirrored, "mirrored"), (flipped, "upside down"), (far, "out of focus")] {
            let other = likeness(&other, &traced[made.number]);
            assert!(other < own - 0.15, "frame {} {what}: {other} against {own}", made.number);
        }
        for (time, picture) in traced.iter().enumerate() {
            // Half a second before the turn and half a second after it, the letter is at the same place.
            let same = time == made.number || (time + made.number == 4 && time % 2 == 1);
            let like = likeness(&sharp, picture);
            assert_eq!(like > own - 0.1, same, "frame {} as at frame {time}: {like} against {own}", made.number);
        }
    }
}

#[test]
fn a_pose_that_does_not_change_is_computed_once() {
    let mut animation =
        Animation::new(&scene("motion.gltf"), &settings("still"), 2.0, Some(0.5), None).expect("animation");
    animation.first_look(&panel().grid().expect("grid"), &Progress::new()).expect("first look");
    let frames = made(&animation);
    assert_eq!(frames.iter().map(|made| made.still).collect::<Vec<_>>(), [false, true, true]);
    assert_eq!(frames.iter().map(|made| made.time).collect::<Vec<_>>(), [0.5, 1.0, 1.5]);
    assert!(frames.iter().all(|made| made.encoded.frame == frames[0].encoded.frame));
}

#[test]
fn what_is_held_is_the_same_for_all_frames_of_a_file_without_a_camera() {
    // Without its camera the scene is framed: each pose alone would be framed in another way.
    let text = std::fs::read_to_string(scene("motion.gltf")).expect("scene");
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("bare.gltf");
    std::fs::write(&path, text.replace(r#""camera": 0, "#, "")).expect("write");
    assert!(!File::open(&path).expect("file").has_camera());
    let mut animation = Animation::new(&path, &settings("motion"), 2.0, None, None).expect("animation");
    animation.first_look(&panel().grid().expect("grid"), &Progress::new()).expect("first look");
    let frames = made(&animation);
    let cameras: Vec<_> = frames.iter().map(|made| made.points.view.placing.camera.clone()).collect();
    assert!(cameras.windows(2).all(|pair| pair[0] == pair[1]));
    // The clip's first and third pose: the plate's left lower corner stands still but for its own growth, and the mast's foot
    // is where it was.
    let lowest = |made: &AnimationFrame| {
        let points = &made.points.placed.cloud.points;
        points.iter().map(|p| p.position).min_by(|a, b| a.y.total_cmp(&b.y)).expect("points")
    };
    assert!(lowest(&frames[0]).distance(lowest(&frames[1])) < 2e-4, "{} {}", lowest(&frames[0]), lowest(&frames[1]));
}

#[test]
fn what_cannot_be_played_is_told() {
    let new = |name: &str, fps: f64, from: Option<f64>, to: Option<f64>| {
        let told = Animation::new(&scene(name), &Settings::default(), fps, from, to).err().map(|e| e.to_string());
        told.unwrap_or_default()
    };
    assert!(new("cornell.gltf", 12.0, None, None).contains("has no animation"));
    for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(new("motion.gltf", fps, None, None).contains("fps"), "{fps}");
    }
    assert!(new("motion.gltf", 1e9, None, None).contains("at most"));
    assert!(new("motion.gltf", 12.0, Some(2.0), Some(1.0)).contains("no extent"));
    assert!(new("motion.gltf", 12.0, Some(f64::NAN), None).contains("no extent"));
}
