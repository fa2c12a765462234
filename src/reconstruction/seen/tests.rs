use super::*;
use crate::field::{Complex32, relative_error};
use crate::light_field::{EyeGrid, Layer};
use crate::propagation::{Propagator, Settings};
use crate::reconstruction::{ExposureLight, ViewSettings};
use glam::DVec3;
use std::f64::consts::TAU;

const LAMBDA: f64 = 532e-9;
const ONE: Colour = Colour::One { wavelength: LAMBDA, channel: Channel::Luminance };

fn panel() -> Grid {
    Grid::new(481, 300, 8e-6, 8e-6).expect("panel")
}

fn viewer(eye: DVec3, pupil: f64) -> Viewer {
    Viewer { pupil: Pupil::Diameter(pupil), ..Viewer::at(eye) }
}

fn field(grid: Grid, wavelength: f64, value: impl Fn(DVec2) -> Complex64) -> Field {
    let sample = |i: usize| {
        let u = value(DVec2::new(grid.x(i % grid.width), grid.y(i / grid.width)));
        Complex32::new(u.re as f32, u.im as f32)
    };
    Field::new(grid, wavelength, (0..grid.len()).map(sample).collect()).expect("field")
}

/// A wave of this intensity on the panel that converges on a point.
fn converging(grid: Grid, wavelength: f64, eye: DVec3, intensity: impl Fn(DVec2) -> f64) -> Field {
    field(grid, wavelength, |q| {
        let r = (q - eye.truncate()).extend(eye.z).length();
        Complex64::cis(-TAU * (r / wavelength).fract()) * intensity(q).sqrt()
    })
}

/// A wall on a plane over a panel's window.
fn wall(z: f64, eye: DVec3, pupil: f64, light: impl Fn(DVec2) -> f32 + Sync) -> LightField {
    let eyes = EyeGrid::covering(&viewer(eye, pupil), 0.5e-3).expect("eyes");
    let window = Grid::new(241, 150, 16e-6, 16e-6).expect("window");
    LightField::of_layers(&[Layer::new(z, light, |_| 1.0)], eyes, window).expect("light field")
}

fn judge(light_field: &LightField, eye: DVec3, pupil: f64, looks: Vec<Look>) -> Judge {
    Judge::new(light_field, &viewer(eye, pupil), ONE, looks, &Progress::new()).expect("judge")
}

fn seen(judge: &Judge, fields: &[&Field]) -> Seen {
    let mut seen = judge.begin();
    for field in fields {
        seen.add(judge, field, None, 0, &Progress::new()).expect("seen");
    }
    seen
}

/// Middle of light [m], and its standard deviation along x and y [m].
fn spread(grid: &Grid, values: &[f32]) -> (DVec2, DVec2) {
    let at = |i: usize| DVec2::new(grid.x(i % grid.width), grid.y(i / grid.width));
    let lit = || values.iter().map(|v| f64::from(*v)).enumerate();
    let sum: f64 = lit().map(|(_, v)| v).sum();
    let middle = lit().map(|(i, v)| at(i) * v).sum::<DVec2>() / sum;
    let square = lit().map(|(i, v)| (at(i) - middle).powf(2.0) * v).sum::<DVec2>() / sum;
    (middle, square.powf(0.5))
}

#[test]
fn the_eyes_plane_is_that_of_the_exact_angular_spectrum() {
    let grid = Grid::new(120, 90, 8e-6, 8e-6).expect("grid");
    let beam = |q: DVec2| {
        let at = q - DVec2::new(1e-4, -5e-5);
        Complex64::cis(TAU * (4e3 * q.x + 9e3 * q.y)) * (-at.length_squared() / 1.5e-4f64.powi(2)).exp()
    };
    let field = field(grid, LAMBDA, beam);
    // The beam goes to the right and upwards, by λ·f·Z.
    let distance = 0.12;
    let lattice = Grid::new(110, 130, 8e-6, 8e-6).expect("grid").centered_at([3e-4, 5.2e-4]);
    let paraxial = EyePlane::at(&field, distance, lattice, &Progress::new()).expect("plane").samples();
    let exact = Propagator::new(grid, lattice, Settings::default()).expect("propagator");
    let exact = exact.propagate(&field, distance, &Progress::new()).expect("exact").samples;
    let exact: Vec<Complex64> = exact.iter().map(|u| Complex64::new(u.re.into(), u.im.into())).collect();
    let turn: Complex64 = paraxial.iter().zip(&exact).map(|(a, b)| a.conj() * b).sum();
    let turned: Vec<Complex64> = paraxial.iter().map(|u| u * (turn / turn.norm())).collect();
    let error = relative_error(&turned, &exact);
    // kρ⁴/(8Z³) is 0.003 at ρ = 1.4 mm; rounding of the angular spectrum in single precision comes on top.
    assert!(error < 5e-3, "{error}");
    // Without a free factor the energy is the same, too.
    let ratio = paraxial.iter().map(|u| u.norm_sqr()).sum::<f64>() / exact.iter().map(|u| u.norm_sqr()).sum::<f64>();
    assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
}

#[test]
fn a_point_is_seen_at_its_place_and_focus_upright_from_any_side() {
    let point = DVec3::new(0.4e-3, -0.3e-3, -0.1);
    let wave = field(panel(), LAMBDA, |q| {
        let r = (q.extend(0.0) - point).length();
        Complex64::cis(TAU * (r / LAMBDA).fract()) * (0.1 / r)
    });
    for eye in [DVec3::new(0.0, 0.0, 0.3), DVec3::new(2.5e-3, -1.5e-3, 0.3)] {
        let pupil = 3e-3;
        let light_field = wall(-0.1, eye, pupil, |_| 0.5);
        let p = eye.truncate();
        let look = |focus| Look { pupil: p, focus };
        let judge = judge(&light_field, eye, pupil, vec![look(point.z), look(-0.3), look(0.0)]);
        let seen = seen(&judge, &[&wave]);
        let place = p + (point.truncate() - p) * (eye.z / (eye.z - point.z));
        let retina = *judge.retina();
        let picture = |look: usize| {
            let mut values = seen.of(0, look);
            // The panel's own diffraction is no light of the point.
            let greatest = values.iter().fold(0.0f32, |a, b| a.max(*b));
            values.iter_mut().for_each(|v| *v = if *v > 0.05 * greatest { *v } else { 0.0 });
            spread(&retina, &values)
        };
        let (middle, sharp) = picture(0);
        assert!((middle - place).length() < 8e-6, "{eye}: {middle} is not {place}");
        // Half of what the pupil resolves.
        assert!(sharp.max_element() < 0.5 * LAMBDA * eye.z / pupil, "{sharp}");
        for (index, focus) in [(1, -0.3), (2, 0.0)] {
            let (middle, blurred) = picture(index);
            assert!((middle - place).length() < 20e-6, "{eye}, {focus}: {middle}");
            // The pupil, seen through the panel from the point and from the focus; a disc's deviation is a quarter of its width.
            let wanted = pupil * (eye.z / (eye.z - point.z) - eye.z / (eye.z - focus)).abs();
            let found = 2.0 * (blurred.x + blurred.y);
            assert!((found / wanted - 1.0).abs() < 0.1, "{eye}, {focus}: {found} is not {wanted}");
        }
    }
}

#[test]
fn a_smooth_wave_is_judged_as_its_own_light_field_whatever_its_gain() {
    let eye = DVec3::new(1e-3, -2e-3, 0.3);
    let light = |q: DVec2| 0.5 + 0.3 * (q.x / 0.5e-3).sin() * (q.y / 0.4e-3 + 0.5).cos() - 0.1 * q.y / 1.2e-3;
    // On the panel's plane it is the same from everywhere; an eye that is not quite where the wave converges sees it, too.
    let light_field = wall(0.0, eye, 3e-3, |q| light(q) as f32);
    let looks = vec![Look { pupil: eye.truncate(), focus: 0.0 }; 2];
    let judge = judge(&light_field, eye, 3e-3, looks);
    let wave = converging(panel(), LAMBDA, eye, light);
    let figures = judge.figures(&seen(&judge, &[&wave]));
    let all = figures.all;
    assert!(all.psnr > 40.0 && all.psnr_coded > 40.0 && all.ssim > 0.96, "{figures:?}");
    assert!(all.contrast < 0.03 && all.brightness_spread < 1e-9, "{figures:?}");
    assert!((0.9..1.0).contains(&all.efficiency) && all.box_efficiency >= all.efficiency - 1e-2, "{figures:?}");
    assert_eq!(figures.judge, format!("eye: Fresnel, f64, light field of {} views", light_field.eyes.count()));
    let mut brighter = wave.clone();
    brighter.samples.iter_mut().for_each(|u| *u *= 7.0);
    let again = judge.figures(&seen(&judge, &[&brighter, &brighter])).all;
    assert!((again.psnr - all.psnr).abs() < 1e-4 && (again.ssim - all.ssim).abs() < 1e-6, "{again:?}");
    assert!((again.efficiency - all.efficiency).abs() < 1e-6, "{again:?}");
    // The wrong picture is not like it.
    let wrong = converging(panel(), LAMBDA, eye, |q| light(-q));
    assert!(judge.figures(&seen(&judge, &[&wrong])).all.psnr < 25.0);
}

#[test]
fn the_picture_of_a_wave_stands_upright_and_keeps_its_light() {
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let light = |q: DVec2| if q.x > 0.3e-3 && q.y > 0.2e-3 { 0.9 } else { 0.1 };
    let light_field = wall(0.0, eye, 4e-3, |q| light(q) as f32);
    let judge = judge(&light_field, eye, 4e-3, vec![Look { pupil: DVec2::ZERO, focus: 0.0 }]);
    let wave = converging(panel(), LAMBDA, eye, light);
    let seen = seen(&judge, &[&wave]);
    let retina = judge.retina();
    let at = |values: &[f32], q: [f64; 2]| {
        f64::from(values[retina.row(q[1]).round() as usize * retina.width + retina.column(q[0]).round() as usize])
    };
    let intensity = seen.of(0, 0);
    for q in [[1e-3, 0.7e-3], [-1e-3, 0.7e-3], [1e-3, -0.7e-3], [-1e-3, -0.7e-3]] {
        let wanted = light(DVec2::from_array(q));
        // A coherent edge rings far.
        assert!((at(&intensity, q) / wanted - 1.0).abs() < 0.15, "{q:?}: {}", at(&intensity, q));
        assert!((at(&judge.wanted[0][0], q) / wanted - 1.0).abs() < 0.05, "{q:?}");
    }
    let on_retina = intensity.iter().map(|v| f64::from(*v)).sum::<f64>() * retina.pitch_x * retina.pitch_y;
    let account = &seen.light[0];
    assert!(on_retina < account.pupil * 1.001 && on_retina > 0.97 * account.pupil, "{on_retina} {account:?}");
}

#[test]
fn wanted_pictures_are_sharp_at_their_depth_and_blur_as_the_pupil_says() {
    let (eye, pupil, z) = (DVec3::new(-1.5e-3, 1e-3, 0.3), 3e-3, -0.1);
    // A slanted edge on the wall, in front of the eye.
    let edge = |p: DVec2| (p - DVec2::new(-0.5e-3, 0.4e-3)).dot(DVec2::new(0.8, 0.6));
    let light_field = wall(z, eye, pupil, move |p| if edge(p) > 0.0 { 1.0 } else { 0.0 });
    let p = eye.truncate();
    let looks = vec![Look { pupil: p, focus: z }, Look { pupil: p, focus: -0.2 }];
    let judge = judge(&light_field, eye, pupil, looks);
    let retina = judge.retina();
    // Where along the edge's normal the values pass 10 % and 90 %, through the middle of the edge.
    let width = |values: &[f32]| {
        let passes = |level: f64| {
            let along = |t: f64| DVec2::new(0.0, 0.1e-3) + t * DVec2::new(0.8, 0.6);
            let value = |t: f64| {
                let (c, r) = (retina.column(along(t).x), retina.row(along(t).y));
                let (c0, r0) = (c.floor() as usize, r.floor() as usize);
                let at = |c: usize, r: usize| f64::from(values[r * retina.width + c]);
                let line = |r: usize| at(c0, r) * (1.0 - c.fract()) + at(c0 + 1, r) * c.fract();
                line(r0) * (1.0 - r.fract()) + line(r0 + 1) * r.fract()
            };
            (-900..900).map(|k| 1e-6 * f64::from(k)).find(|t| value(*t) > level).expect("the edge")
        };
        (passes(0.5), passes(0.9) - passes(0.1))
    };
    let (place, sharp) = width(&judge.wanted[0][0]);
    let on_wall = p + (DVec2::new(0.0, 0.1e-3) + place * DVec2::new(0.8, 0.6) - p) * ((eye.z - z) / eye.z);
    assert!(edge(on_wall).abs() < 10e-6, "{}", edge(on_wall));
    // What a round pupil's diffraction alone does, in incoherent light: the Airy pattern's rings reach far.
    assert!((1.2..1.7).contains(&(sharp * pupil / (LAMBDA * eye.z))), "{sharp}");
    // A disc's edge goes from 10 % to 90 % over 0.687 of its half width, twice.
    let disc = pupil * (eye.z / (eye.z - z) - eye.z / (eye.z + 0.2)).abs();
    let (_, blurred) = width(&judge.wanted[0][1]);
    let wanted = (0.687 * disc).hypot(sharp);
    assert!((blurred / wanted - 1.0).abs() < 0.07, "{blurred} is not {wanted}");
}

#[test]
fn three_lasers_show_one_picture_and_each_its_own() {
    let lasers = Lasers::new([638e-9, 532e-9, 450e-9]).expect("lasers");
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let viewer = viewer(eye, 3e-3);
    let tint = [0.9f32, 0.6, 0.35];
    let light = |q: DVec2| 0.5 + 0.3 * (q.x / 0.6e-3).sin();
    let layer = Layer::new(0.0, move |q| light(q) as f32, |_| 1.0).tinted(tint);
    let eyes = EyeGrid::covering(&viewer, 0.5e-3).expect("eyes");
    let window = Grid::new(160, 100, 24e-6, 24e-6).expect("window");
    let light_field = LightField::of_layers(&[layer], eyes, window).expect("light field");
    let looks = vec![Look { pupil: DVec2::ZERO, focus: 0.0 }];
    let judge = Judge::new(&light_field, &viewer, Colour::Three(lasers), looks, &Progress::new()).expect("judge");
    let drive = lasers.drive(tint).values;
    let show = |order: [usize; 3]| {
        let mut seen = judge.begin();
        for (laser, of) in order.into_iter().enumerate() {
            let wave = converging(panel(), lasers.wavelengths()[laser], eye, |q| f64::from(drive[of]) * light(q));
            seen.add(&judge, &wave, None, laser, &Progress::new()).expect("seen");
        }
        seen
    };
    let seen = show([0, 1, 2]);
    let right = judge.figures(&seen);
    assert!(right.all.psnr > 40.0 && right.all.psnr_coded > 37.0 && right.all.ssim > 0.97, "{right:?}");
    assert!(right.lasers.len() == 3 && right.lasers.iter().all(|laser| laser.psnr > 37.0), "{right:?}");
    // Lasers in the wrong colours are right each alone, wrong together.
    let wrong = judge.figures(&show([2, 1, 0]));
    assert!(wrong.all.psnr < 25.0 && wrong.lasers.iter().all(|laser| laser.psnr > 37.0), "{wrong:?}");
    // The middle of the picture has the wall's colour.
    let Reconstruction::Color(picture) = judge.seen(&seen, 0) else { panic!("in colour") };
    let middle = picture.rgb[picture.height / 2 * picture.width + picture.width / 2];
    assert!(middle.iter().zip(tint).all(|(seen, tint)| (seen / (0.5 * tint) - 1.0).abs() < 0.1), "{middle:?}");
    let mut other = judge.begin();
    let red = converging(panel(), 638e-9, eye, |_| 1.0);
    assert!(other.add(&judge, &red, None, 1, &Progress::new()).is_err(), "red light of the green laser");
    assert!(other.add(&judge, &red, None, 3, &Progress::new()).is_err(), "a fourth laser");
}

#[test]
fn looks_fill_the_eye_box_and_the_depths() {
    let eye = DVec3::new(1e-3, 2e-3, 0.6);
    let viewer = Viewer { eye_box: DVec2::new(10e-3, 4e-3), ..Viewer::at(eye) };
    let looks = looks(&viewer, [-0.1, -0.15], 400, 5).expect("looks");
    let inside = |look: &Look| ((look.pupil - eye.truncate()).abs() * 2.0).cmple(viewer.eye_box).all();
    assert!(looks.iter().all(|look| inside(look) && look.focus <= -0.1 + 1e-12 && look.focus >= -0.15 - 1e-12));
    let mean = looks.iter().map(|look| look.pupil).sum::<DVec2>() / 400.0 - eye.truncate();
    // Five standard deviations of a mean of 400: box/√12/20.
    assert!((mean.abs() * 20.0 * 12f64.sqrt() / 5.0).cmple(viewer.eye_box).all(), "{mean}");
    let middle = 0.6 - 2.0 / (1.0 / 0.7 + 1.0 / 0.75);
    for (index, wanted) in [(0, -0.1), (4, middle), (8, -0.15), (12, -0.1)] {
        assert!((looks[index].focus - wanted).abs() < 1e-12, "{index}");
    }
    let known = super::looks(&Viewer::at(eye), [-0.1, -0.1], 5, 5).expect("looks");
    assert!(known.iter().all(|look| look.pupil == eye.truncate() && (look.focus + 0.1).abs() < 1e-12));
    assert!(super::looks(&viewer, [0.6, -0.1], 5, 5).is_err());
}

#[test]
fn what_cannot_be_judged_is_refused_with_the_reason() {
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let light_field = wall(-0.1, eye, 3e-3, |_| 0.5);
    let look = Look { pupil: DVec2::ZERO, focus: -0.1 };
    let refused = |viewer: &Viewer, looks: Vec<Look>| {
        Judge::new(&light_field, viewer, ONE, looks, &Progress::new()).expect_err("refused").to_string()
    };
    let good = viewer(eye, 3e-3);
    assert!(refused(&good, vec![]).contains("looks"));
    assert!(refused(&good, vec![Look { focus: 0.3, ..look }]).contains("focus"));
    let outside = refused(&good, vec![Look { pupil: DVec2::new(2e-3, 0.0), ..look }]);
    assert!(outside.contains("outside of the light field's views"), "{outside}");
    assert!(refused(&viewer(DVec3::new(0.0, 0.0, 0.5), 3e-3), vec![look]).contains("not the light field's"));
    assert!(refused(&Viewer { pupil: Pupil::All, ..good }, vec![]).contains("looks"));
}

#[test]
fn a_relays_stop_takes_out_what_it_should_and_the_light_is_lost() {
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let light_field = wall(0.0, eye, 3e-3, |_| 0.5);
    let judge = judge(&light_field, eye, 3e-3, vec![Look { pupil: DVec2::ZERO, focus: 0.0 }]);
    // The wave's steepest part has 2 mm / (λ·0.3 m) = 12e3 cycles/m; a second wave goes far aside.
    let wave = converging(panel(), LAMBDA, eye, |_| 1.0);
    let mut both = wave.clone();
    for (i, u) in both.samples.iter_mut().enumerate() {
        *u += Complex32::new(((-1.0f32).powi(i as i32 % 481)) * 0.5, 0.0);
    }
    let look = |field: &Field, stop: Option<&Aperture>| {
        let mut seen = judge.begin();
        seen.add(&judge, field, stop, 0, &Progress::new()).expect("seen");
        (seen.of(0, 0), judge.figures(&seen).all.efficiency)
    };
    let stop = Aperture::centered(40e3, 40e3);
    let (alone, share) = look(&wave, None);
    let (stopped, less) = look(&both, Some(&stop));
    let error = alone.iter().zip(&stopped).map(|(a, b)| (a - b).abs()).sum::<f32>() / alone.iter().sum::<f32>();
    assert!(error < 0.03, "{error}");
    assert!((less / share - 1.0 / 1.25).abs() < 0.02, "{less} of {share}");
}

#[test]
fn the_judge_says_the_same_on_any_number_of_threads_and_stops_when_asked() {
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| {
            let light_field = wall(-0.1, eye, 2e-3, |p| if p.x > 0.0 { 0.8 } else { 0.2 });
            let looks = vec![Look { pupil: DVec2::ZERO, focus: -0.2 }];
            let judge = judge(&light_field, eye, 2e-3, looks);
            let wave = converging(panel(), LAMBDA, eye, |q| if q.x > 0.0 { 0.8 } else { 0.2 });
            let seen = seen(&judge, &[&wave]);
            (judge.figures(&seen), seen.of(0, 0), judge.wanted)
        })
    };
    assert_eq!(run(1), run(3));
    let light_field = wall(-0.1, eye, 2e-3, |_| 0.5);
    let progress = Progress::new();
    progress.stop();
    let look = vec![Look { pupil: DVec2::ZERO, focus: -0.1 }];
    let stopped = Judge::new(&light_field, &viewer(eye, 2e-3), ONE, look.clone(), &progress);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    let judge = judge(&light_field, eye, 2e-3, look);
    let wave = converging(panel(), LAMBDA, eye, |_| 0.5);
    assert!(matches!(judge.begin().add(&judge, &wave, None, 0, &progress), Err(Error::Interrupted)));
}

#[test]
fn the_gallery_has_each_depth_and_place_with_figures_and_files() {
    let eye = DVec3::new(0.0, 0.0, 0.3);
    let viewer = Viewer { eye_box: DVec2::new(2e-3, 0.0), ..viewer(eye, 2e-3) };
    let light = |q: DVec2| 0.5 + 0.3 * (q.x / 0.5e-3).sin();
    let eyes = EyeGrid::covering(&viewer, 0.5e-3).expect("eyes");
    let window = Grid::new(96, 60, 40e-6, 40e-6).expect("window");
    let layer = Layer::new(0.0, move |q| light(q) as f32, |_| 1.0);
    let light_field = LightField::of_layers(&[layer], eyes, window).expect("light field");
    let focus = [("wall".to_owned(), 0.0), ("mirror-ball".to_owned(), -0.1)];
    let wave = converging(panel(), LAMBDA, eye, light);
    let half = converging(panel(), LAMBDA, eye, |_| 0.5);
    let exposure =
        |field: &Field| Ok(ExposureLight { field: field.clone(), settings: ViewSettings::default(), laser: 0 });
    let seeing = Seeing { held_out: 3, sweeps: true, ..Seeing::new(&light_field, &viewer, ONE, &focus) };
    let gallery = SeenGallery::of([exposure(&wave)], &seeing, &Progress::new()).expect("gallery");
    let names = |shots: &[SeenShot]| shots.iter().map(|shot| shot.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&gallery.focus), ["wall", "mirror-ball"]);
    assert_eq!(names(&gallery.eyes), ["eye-left", "eye-middle", "eye-right"]);
    assert_eq!((gallery.figures.looks, gallery.focus_sweep.len(), gallery.eye_sweep.len()), (3, 13, 24));
    assert_eq!(gallery.eyes[2].look, Look { pupil: DVec2::new(1e-3, 0.0), focus: 0.0 });
    // One wave to the middle: nothing is seen from the box's ends.
    let [left, middle, _] = gallery.eyes.as_slice() else { panic!("three places") };
    assert!(left.figures.brightness < 0.6 * middle.figures.brightness, "{left:?}");
    assert!(middle.figures.ssim > left.figures.ssim);
    // Every second exposure is even: half of the picture's contrast is lost.
    let both = SeenGallery::of([exposure(&wave), exposure(&half)], &seeing, &Progress::new()).expect("gallery");
    assert!(both.focus[0].figures.ssim < gallery.focus[0].figures.ssim);
    let none = std::iter::empty();
    assert!(SeenGallery::of(none, &seeing, &Progress::new()).is_err());

    let folder = tempfile::tempdir().expect("folder");
    gallery.write(folder.path()).expect("written");
    let mut files: Vec<String> = std::fs::read_dir(folder.path())
        .expect("folder")
        .map(|entry| entry.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut wanted: Vec<String> =
        ["overview", "sweep-eye", "sweep-focus", "traced"].map(|name| format!("{name}.png")).to_vec();
    for name in ["eye-left", "eye-middle", "eye-right", "mirror-ball", "wall"] {
        wanted.extend([format!("seen-{name}.png"), format!("wanted-{name}.png")]);
    }
    wanted.sort();
    assert_eq!(files, wanted);
    let (width, height, _) = crate::reconstruction::read_gray(&folder.path().join("overview.png")).expect("sheet");
    let sheet = gallery.overview();
    assert_eq!((width, height), (sheet.width, sheet.height));
    // What is seen of the wall stands below what should be seen of it, in the same code.
    let (_, _, seen) = crate::reconstruction::read_gray(&folder.path().join("seen-wall.png")).expect("picture");
    let retina = gallery.focus[0].seen.size();
    assert_eq!(seen.len(), retina.0 * retina.1);
    let middle = seen[retina.1 / 2 * retina.0 + retina.0 / 2];
    // sRGB of half of white, where the wall is as bright.
    assert!((middle - 0.735).abs() < 0.05, "{middle}");
}

#[test]
fn a_pupil_that_takes_all_sees_a_plane_in_focus_where_it_stands_and_is_judged_there() {
    let eye = DVec3::new(0.3e-3, -0.2e-3, 0.3);
    let viewer = Viewer { pupil: Pupil::All, ..Viewer::at(eye) };
    let z = -0.05;
    let spots = [(DVec2::new(0.7e-3, 0.3e-3), 0.8), (DVec2::new(-0.8e-3, -0.2e-3), 0.4)];
    let light = move |p: DVec2| -> f64 {
        spots.iter().map(|(middle, light)| light * (-(p - *middle).length_squared() / 0.4e-3f64.powi(2)).exp()).sum()
    };
    // As wide as 532 nm leave pixels of 8 µm: 20 mm.
    let eyes = EyeGrid::over(eye, DVec2::splat(20e-3), 1e-3).expect("eyes");
    let window = Grid::new(96, 60, 40e-6, 40e-6).expect("window");
    let layer = Layer::new(z, move |p| light(p) as f32, |_| 1.0);
    let light_field = LightField::of_layers(&[layer], eyes, window).expect("light field");
    let looks = [z, -0.02].map(|focus| Look { pupil: eye.truncate(), focus }).to_vec();
    let judge = Judge::new(&light_field, &viewer, ONE, looks, &Progress::new()).expect("judge").counting(1);
    // The spots in step, from their plane to the panel.
    let spot = field(panel(), LAMBDA, |p| Complex64::new(light(p).sqrt(), 0.0));
    let plan = Propagator::new(panel(), panel(), Settings::default()).expect("propagator");
    let wave = plan.propagate(&spot, -z, &Progress::new()).expect("wave");
    let seen = seen(&judge, &[&wave]);
    let figures = judge.figures(&seen);
    let (sharp, ssim) = figures.each[0].in_focus.expect("depths are known");
    assert!(sharp > 35.0 && ssim > 0.97 && figures.all.efficiency > 0.999, "{figures:?}");
    // All of it is in focus, or none.
    assert!((sharp - figures.all.psnr).abs() < 1e-9 && figures.all.psnr_in_focus == Some(sharp), "{figures:?}");
    assert_eq!(figures.each[1].in_focus, None);
    for (middle, wanted) in spots {
        let q = eye.truncate() + (middle - eye.truncate()) * (eye.z / (eye.z - z));
        let at = window.row(q.y).round() as usize * window.width + window.column(q.x).round() as usize;
        assert!((f64::from(seen.of(0, 0)[at]) / wanted - 1.0).abs() < 0.1, "{middle}: {}", seen.of(0, 0)[at]);
    }
}
