//! View sequences as what a plate shows: a light field, or a folder of any program's pictures in their order.

use super::plate::Plate;
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files::pictures;
use crate::light_field::{EyeGrid, LightField};
use crate::segments::{Object, PlacedViews, Segments, lattice};
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Endings of pictures that views are read from.
const PICTURES: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff"];

/// How views are read, and from where they are seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ViewReading {
    /// Distance of neighbouring views [m]: of pictures that do not say it themselves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing: Option<f64>,
    /// Rows in which these stand, the highest first, each from left to right; one where `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<usize>,
    /// Height from which views in one row are seen [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Name of the folder or file.
    #[serde(default)]
    pub name: String,
}

/// Views in files.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewFiles {
    /// A light field (.npz, or a folder with its light-field.json), or a folder of pictures in the order of their names, numbers in them
    /// by their value: from left to right as the viewer looks at the plate.
    pub path: PathBuf,
    /// How they are read.
    pub reading: ViewReading,
}

impl ViewFiles {
    /// Views of a path.
    pub fn new(path: &Path, reading: ViewReading) -> Self {
        Self { path: path.into(), reading: ViewReading { name: name(path), ..reading } }
    }

    fn is_light_field(&self) -> bool {
        !self.path.is_dir() || LightField::is_folder(&self.path)
    }

    /// The files that are read.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a folder without pictures.
    pub(super) fn files(&self) -> Result<Vec<PathBuf>> {
        if !self.path.is_dir() {
            return Ok(vec![self.path.clone()]);
        }
        let all = std::fs::read_dir(&self.path).map_err(Error::io(&self.path))?;
        let mut found = Vec::new();
        for entry in all {
            let path = entry.map_err(Error::io(&self.path))?.path();
            let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
            let described = self.is_light_field() && ["json", "npy"].contains(&ending.as_str());
            if path.is_file() && (PICTURES.contains(&ending.as_str()) || described) {
                found.push(path);
            }
        }
        if found.is_empty() {
            return Err(Error::input(&self.path, "holds no pictures (.png, .jpg, .bmp, .tif)"));
        }
        found.sort_by_cached_key(|path| counted(&name(path)));
        self.check_sequence(found.len())?;
        Ok(found)
    }

    /// Refuses a folder in which a longer sequence stood before the one of its `sequence.json`: its last pictures are still there.
    fn check_sequence(&self, count: usize) -> Result<()> {
        #[derive(Deserialize)]
        struct Told {
            views: usize,
        }
        let told = self.path.join("sequence.json");
        // A file of this name that says something else is another program's.
        let text = std::fs::read(&told).unwrap_or_default();
        match serde_json::from_slice::<Told>(&text) {
            Ok(Told { views }) if views != count && !self.is_light_field() => {
                let what =
                    format!("says {views} views, and {count} pictures are there; take away those of another sequence");
                Err(Error::input(told, what))
            }
            _ => Ok(()),
        }
    }

    /// The views before a plate, a pixel of each for each of its segments.
    ///
    /// # Errors
    /// Those of the files; [`Error::Parameter`] for what is missing or too much; as [`PlacedViews::new`].
    pub(super) fn placed(&self, plate: &Plate, plane: &Segments) -> Result<PlacedViews> {
        let ViewReading { spacing, rows, height, .. } = self.reading;
        let light = if self.is_light_field() {
            for (name, given) in [("view-spacing", spacing.is_some()), ("view-rows", rows.is_some())] {
                if given {
                    let what = "is for a folder of pictures: a light field says itself where its views stand";
                    return Err(Error::parameter(name, what));
                }
            }
            LightField::read(&self.path)?.resampled(lattice(plane)?)?
        } else {
            self.pictures(plate, plane)?
        };
        PlacedViews::new(light, plane, height)
    }

    /// What a plate shows of them.
    ///
    /// # Errors
    /// As [`Self::placed`].
    pub(super) fn object(&self, plate: &Plate, plane: &Segments) -> Result<Object> {
        Ok(Object::Views(Box::new(self.placed(plate, plane)?)))
    }

    /// Pictures that say nothing of where they stand: as large as the plate's middle lets them be, seen from the viewer's distance.
    fn pictures(&self, plate: &Plate, plane: &Segments) -> Result<LightField> {
        let files = self.files()?;
        let rows = self.reading.rows.unwrap_or(1);
        if rows == 0 || files.len() % rows != 0 {
            let what = format!("{rows} do not divide the {} pictures of {}", files.len(), self.path.display());
            return Err(Error::parameter("view-rows", what));
        }
        let spacing = self.reading.spacing.ok_or_else(|| {
            let what = format!(
                "says how far apart the places of neighbouring views are, for the {} pictures of {}: --view-spacing 2mm",
                files.len(),
                self.path.display()
            );
            Error::parameter("view-spacing", what)
        })?;
        let columns = files.len() / rows;
        let eyes = EyeGrid { distance: plate.view.viewer, center: DVec2::ZERO, spacing, columns, rows };
        let window = lattice(plane)?;
        let mut light = LightField::black(eyes, window, 1)?;
        light.depth = [plate.view.place; 2];
        let mut size = None;
        for (index, path) in files.iter().enumerate() {
            let picture = pictures::open(path)?;
            let own = (picture.width(), picture.height());
            let first = *size.get_or_insert(own);
            if own != first {
                let what = format!("{} × {} pixels, the first has {} × {}", own.0, own.1, first.0, first.1);
                return Err(Error::input(path, what));
            }
            let view = LightField::of_picture(picture, Self::fitted(own, plane)?)?.resampled(window)?;
            light.channels[0][index * window.len()..][..window.len()].copy_from_slice(&view.channels[0]);
        }
        Ok(light)
    }

    /// The window of pictures of a size that stand in a plate's middle, undistorted.
    fn fitted((width, height): (u32, u32), plane: &Segments) -> Result<Grid> {
        let across = plane.grid.extent_x() / f64::from(width.max(1));
        let down = plane.grid.extent_y() / f64::from(height.max(1));
        let side = across.min(down);
        Grid::new(width as usize, height as usize, side, side)
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().to_string()
}

/// A name as it is sorted: numbers in it by their value, and by their text where these are alike.
fn counted(name: &str) -> (Vec<(String, u128)>, String) {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let word = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let digits = rest[word..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |n| word + n);
        // Numbers that no counter has are words.
        let number = rest[word..digits].parse().unwrap_or(u128::MAX);
        parts.push((rest[..word].to_lowercase(), number));
        rest = &rest[digits..];
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::print::preview::PreviewSettings;
    use crate::print::{PlateJob, PlateView, PrintSettings, Shard, Source};
    use crate::progress::Progress;
    use crate::reconstruction::Picture;
    use crate::reconstruction::metrics::blocks;
    use crate::segments::SceneOptions;

    #[test]
    fn names_are_sorted_by_the_numbers_in_them() {
        let mut names = ["view10.png", "view9.png", "View_2.png", "view1b.png", "view1.png", "a.png", "view007.png"];
        names.sort_by_cached_key(|name| counted(name));
        assert_eq!(names, ["a.png", "view1.png", "view1b.png", "view007.png", "view9.png", "view10.png", "View_2.png"]);
    }

    /// 2 × 2 mm in segments of 64 µm, looked at from 60 mm.
    fn plate() -> Plate {
        let text = "name = \"t\"\nsize = [2048, 2048]\npitch = \"1um\"\nwavelength = \"633nm\"\nbits = 8\ntile = 512\nsegment = 64\n\
                    [reference]\nangle = [\"9deg\", \"0deg\"]\n[scene]\nviewer = \"60mm\"\ndistance = \"1mm\"\n";
        Plate::parse(text, Path::new("t.toml")).expect("plate")
    }

    /// Three pictures that nobody mistakes for each other: bright on the left, in the middle, below.
    fn write_views(folder: &Path) {
        std::fs::create_dir_all(folder).expect("folder");
        let shapes: [fn(u32, u32) -> bool; 3] =
            [|x, _| x < 24, |x, y| (16..48).contains(&x) && (16..48).contains(&y), |_, y| y > 40];
        for (k, shape) in shapes.into_iter().enumerate() {
            let picture = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([if shape(x, y) { 255 } else { 20 }]));
            // 8, 9, 10: by their numbers.
            picture.save(folder.join(format!("view{}.png", 8 + k))).expect("picture");
        }
    }

    fn settings(folder: &Path, views: &Path, reading: ViewReading) -> PrintSettings {
        PrintSettings {
            plate: plate(),
            input: Source::Views(ViewFiles::new(views, reading)),
            options: SceneOptions::default(),
            folder: folder.into(),
            shard: Shard::default(),
            dry_run: false,
        }
    }

    #[test]
    fn from_each_place_a_printed_sequence_shows_the_view_of_that_place() {
        let folder = tempfile::tempdir().expect("folder");
        let (views, out) = (folder.path().join("views"), folder.path().join("plate"));
        write_views(&views);
        let reading = ViewReading { spacing: Some(2e-3), height: Some(2e-3), ..ViewReading::default() };
        let progress = Progress::new();
        let mut job = PlateJob::new(settings(&out, &views, reading.clone()), &progress).expect("job");
        let plan = job.plan(&progress).expect("plan").expect("new");
        // λD/h = 0.593 mm: four places across a zone and four down, of three views.
        assert_eq!((plan.points[1], plan.rays), (48, 0));
        assert!(plan.warnings.iter().all(|warning| !warning.contains("same from everywhere")), "{:?}", plan.warnings);
        assert!(job.run(&progress).expect("run").complete);
        let input = Source::Views(ViewFiles::new(&views, ViewReading::default()));
        let look = |x: f64| {
            let settings = PreviewSettings {
                eye: [x, 0.0, 60e-3],
                pupil: 1.6e-3,
                focus: -1e-3,
                size: Some((128, 128)),
                part: None,
                wavelength: None,
                lamp: None,
                places: 1,
                memory: 1 << 30,
            };
            let mut view = PlateView::new(&out, &settings, &progress).expect("view");
            view.compare(&input, &folder.path().join("target.png"), true, &progress).expect("compared");
            let shown = image::open(folder.path().join("target.png")).expect("target").to_luma8();
            let target =
                Picture { width: 128, height: 128, values: shown.pixels().map(|p| f32::from(p.0[0])).collect() };
            (blocks(&view.luminance(), 8), blocks(&target, 8))
        };
        let looks = [-2e-3, 0.0, 2e-3].map(look);
        for (k, (seen, _)) in looks.iter().enumerate() {
            let alike = [0, 1, 2].map(|other: usize| correlation(&seen.values, &looks[other].1.values));
            println!("from place {k}: {alike:.3?}");
            for (other, alike) in alike.into_iter().enumerate() {
                assert!(
                    if other == k { alike > 0.9 } else { alike < 0.7 },
                    "from place {k} view {other} is alike by {alike}"
                );
            }
        }
        // Beside the box it is dark.
        let light = |x: f64| look(x).0.values.iter().sum::<f32>();
        assert!(light(5.5e-3) < 0.1 * light(2e-3), "{}", light(5.5e-3) / light(2e-3));
        // Gone on with, and begun by other pictures.
        let again = PlateJob::new(settings(&out, &views, reading.clone()), &progress).expect("the same");
        assert_eq!(again.run(&progress).expect("run").done.computed, 0);
        image::GrayImage::new(64, 64).save(views.join("view9.png")).expect("picture");
        let refused = |result: Result<PlateJob>| result.err().expect("refused").to_string();
        assert!(refused(PlateJob::new(settings(&out, &views, reading), &progress)).contains("inputs"));
    }

    fn correlation(a: &[f32], b: &[f32]) -> f64 {
        let mean = |v: &[f32]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            a.iter().zip(b).map(|(a, b)| f(f64::from(*a) - ma, f64::from(*b) - mb)).sum()
        };
        sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
    }

    #[test]
    fn sequences_that_say_too_little_are_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let views = folder.path().join("views");
        std::fs::create_dir_all(&views).expect("folder");
        let said = |reading: ViewReading| {
            let job = PlateJob::new(settings(&folder.path().join("plate"), &views, reading), &Progress::new());
            let said = job.err().expect("refused").to_string();
            assert!(!said.contains('\n'), "{said}");
            said
        };
        assert!(said(ViewReading::default()).contains("holds no pictures"));
        write_views(&views);
        std::fs::write(views.join("sequence.json"), r#"{"views": 2}"#).expect("json");
        assert!(said(ViewReading::default()).contains("sequence.json: says 2 views, and 3 pictures"));
        std::fs::write(views.join("sequence.json"), r#"{"views": 3}"#).expect("json");
        assert!(said(ViewReading::default()).contains("--view-spacing"));
        let far = ViewReading { spacing: Some(2e-3), ..ViewReading::default() };
        assert!(said(ViewReading { rows: Some(2), ..far.clone() }).contains("2 do not divide the 3 pictures"));
        assert!(said(ViewReading { rows: Some(3), height: Some(1e-3), ..far.clone() }).contains("one row"));
        image::GrayImage::new(64, 63).save(views.join("view9.png")).expect("picture");
        assert!(said(far).contains("view9.png: 64 × 63"));
        assert!(!folder.path().join("plate").exists(), "nothing is begun");
    }
}
