//! How like each other two pictures or two fields are.

use crate::arrays::{Kind, array, complex_plane, kind, plane, real_plane, shown};
use crate::errors::refused;
use holodrive::field::relative_error;
use holodrive::reconstruction::metrics::{field_error, likeness, speckle_contrast, uniformity};
use holodrive::reconstruction::{Picture, Scale};
use numpy::PyArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// How like `seen` is to `wanted`: two pictures of linear light, or two complex fields, of one shape.
///
/// >>> import holodrive, numpy as np
/// >>> wanted = np.linspace(0, 1, 400).reshape(20, 20)
/// >>> figures = holodrive.metrics(3 * wanted, wanted)
/// >>> round(figures["gain"], 6), round(figures["ssim"], 6)
/// (0.333333, 1.0)
///
/// :param seen: array of shape (rows, columns), :class:`Picture` or :class:`Field`.
/// :param wanted: the same.
/// :param white: of pictures: the value of `wanted` that is shown as white; by default its largest.
/// :return: of pictures: "gain" by which seen was multiplied (least squares, linear light), "psnr" [dB] and "ssim" of the
///     sRGB-coded pictures, "psnr_blocks" after both are averaged over 5 × 5 blocks, "contrast" σ/μ and "uniformity"
///     1 − (max − min)/(max + min) of seen. Of fields: "relative_error" √(Σ\|a−b\|²/Σ\|b\|²), and "field_error", the least
///     Σ\|c·a−b\|²/Σ\|b\|² over complex factors c.
#[pyfunction]
#[pyo3(signature = (seen, wanted, *, white = None))]
pub(crate) fn metrics<'py>(
    seen: &Bound<'py, PyAny>,
    wanted: &Bound<'py, PyAny>,
    white: Option<f32>,
) -> PyResult<Bound<'py, PyDict>> {
    let py = seen.py();
    let (a, b) = (array(seen)?, array(wanted)?);
    let told = PyDict::new(py);
    let sizes = (plane(&a, "seen")?, plane(&b, "wanted")?);
    if sizes.0 != sizes.1 {
        let what = format!("shapes {} and {} are not those of one picture", shown(&sizes.0), shown(&sizes.1));
        return refused(py, "seen, wanted", what);
    }
    match (kind(&a, "seen")?, kind(&b, "wanted")?) {
        (Kind::Complex, Kind::Complex) => {
            let (a, b) = (complex_plane(&a, "seen")?.1, complex_plane(&b, "wanted")?.1);
            let (a, b) = (a.try_readonly()?, b.try_readonly()?);
            let (a, b) = (a.as_slice()?, b.as_slice()?);
            let (relative, best) = py.detach(|| (relative_error(a, b), field_error(a, b)));
            told.set_item("relative_error", relative)?;
            told.set_item("field_error", best)?;
        }
        (Kind::Complex, _) | (_, Kind::Complex) => {
            return refused(
                py,
                "seen, wanted",
                "one is complex, the other is not: compare fields, or their intensities",
            );
        }
        _ => {
            let picture = |value, name| {
                let ([height, width], values) = real_plane(value, name)?;
                PyResult::Ok(Picture { width, height, values })
            };
            let (seen, wanted) = (picture(seen, "seen")?, picture(wanted, "wanted")?);
            let white = white.unwrap_or_else(|| wanted.white(Scale::Percentile(1.0)));
            if !(white > 0.0 && white.is_finite()) {
                return refused(py, "white", format!("{white} must be greater than zero"));
            }
            let (like, contrast, even) = py
                .detach(|| (likeness(&seen, &wanted, white), speckle_contrast(&seen.values), uniformity(&seen.values)));
            told.set_item("psnr", like.psnr)?;
            told.set_item("ssim", like.ssim)?;
            told.set_item("psnr_blocks", like.psnr_blocks)?;
            told.set_item("gain", like.gain)?;
            told.set_item("contrast", contrast)?;
            told.set_item("uniformity", even)?;
        }
    }
    Ok(told)
}
