//! What a plate shows, as it is asked for: a scene or points in a file, pictures at depths, or views.

use super::plate::Plate;
use super::view_files::ViewFiles;
use crate::error::{Error, Result};
use crate::points::depth_map::DepthReading;
use crate::points::images::RgbDepth;
use crate::points::lattice::{FlatPicture, LatticePoints, Pictures};
use crate::points::placement::{Phase, path_phase};
use crate::points::{Placement, PointSource};
use crate::segments::{Object, PointPhase, Segments};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a plate shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A scene (glTF, OBJ, STL), or points (a cloud).
    File(PathBuf),
    /// Pictures.
    Pictures(PictureFiles),
    /// Views from several places.
    Views(ViewFiles),
}

/// Pictures, and where they stand.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureFiles {
    /// The files: flat pictures, or a picture and its depth map.
    pub files: Vec<PathBuf>,
    /// Where they stand.
    pub depths: PictureDepths,
}

/// Where pictures stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PictureDepths {
    /// The depth z of each flat picture [m].
    Flat(Vec<f64>),
    /// One picture with a depth map.
    Relief {
        /// Where the map's near end stands, z [m].
        near: f64,
        /// Where its far end stands, z [m].
        far: f64,
        /// How the map is read.
        reading: DepthReading,
    },
}

impl Source {
    /// Its first file.
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Views(views) => &views.path,
            Self::Pictures(pictures) => pictures.files.first().map_or(Path::new(""), PathBuf::as_path),
        }
    }
}

impl PictureFiles {
    /// Points of the pictures before a plate, all phases zero.
    ///
    /// # Errors
    /// Those of the files; as [`Pictures::points`].
    pub(super) fn points(&self, plate: &Plate) -> Result<LatticePoints> {
        let viewer = plate.view.viewer;
        let pictures = match (&self.depths, self.files.as_slice()) {
            (PictureDepths::Flat(depths), files) if depths.len() == files.len() => {
                let read = |(path, z): (&PathBuf, &f64)| Ok((FlatPicture::read(path)?, *z));
                let mut flat = files.iter().zip(depths).map(read).collect::<Result<Vec<_>>>()?;
                flat.sort_by(|a, b| b.1.total_cmp(&a.1));
                Pictures::Flat(flat)
            }
            (&PictureDepths::Relief { near, far, ref reading }, [rgb, depth]) => {
                if !(far <= near && near < viewer) {
                    let what = format!("near {near} m, far {far} m and the viewer at {viewer} m are not in order");
                    return Err(Error::parameter("near/far", what));
                }
                let placement = Placement::Window { eye: viewer, near, far };
                Pictures::Relief(Box::new(RgbDepth::read(rgb, depth, reading, &placement)?))
            }
            _ => return Err(Error::parameter("picture", "has not as many depths as files")),
        };
        pictures.points(viewer, plate.view.resolution, &plate.raster.grid())
    }

    /// What a plate shows of them.
    ///
    /// # Errors
    /// As [`Self::points`].
    pub(super) fn object(&self, plate: &Plate, plane: &Segments) -> Result<Object> {
        let mut object = Object::of_cloud(&self.points(plate)?.cloud, plane)?
            .ok_or_else(|| Error::input(self.files.first().cloned().unwrap_or_default(), "has no points that shine"))?;
        let height = plate.slit.as_ref().map_or(0.0, |slit| slit.y);
        let eye = DVec3::new(0.0, height, plate.view.viewer);
        let wavelengths = plate.wavelengths();
        let put = |points: &mut [PointSource], wavelength: f64| {
            for (index, point) in points.iter_mut().enumerate() {
                point.phase = match plate.view.phase {
                    PointPhase::Random => Phase::Random { seed: plate.seed }.of(index, 0.0, wavelength),
                    PointPhase::Path => path_phase((eye - point.position).length(), wavelength),
                };
            }
        };
        match &mut object {
            Object::Points(points) => put(points, plate.wavelength),
            Object::ColorPoints(lists) => {
                // Red first, as the lists are.
                let mut sorted = wavelengths.to_vec();
                sorted.sort_by(|a, b| b.total_cmp(a));
                lists.iter_mut().zip(sorted).for_each(|(points, wavelength)| put(points, wavelength));
            }
            Object::Scene(_) | Object::Views(_) => {}
        }
        Ok(object)
    }
}
