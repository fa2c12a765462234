//! PLY out.

use super::Metadata;
use crate::error::{Error, Result};
use crate::files;
use crate::points::PointCloud;
use std::io::Write;
use std::path::Path;

/// Writes the cloud as binary little-endian PLY, whole or not at all.
pub fn write(path: &Path, cloud: &PointCloud, metadata: &Metadata) -> Result<()> {
    let json = serde_json::to_string(metadata).map_err(|e| Error::input(path, e.to_string()))?;
    let amplitudes = match cloud.rgb {
        Some(_) => "property float amplitude_r\nproperty float amplitude_g\nproperty float amplitude_b\n",
        None => "property float amplitude\n",
    };
    files::write_whole(path, |out| {
        let head = format!(
            "ply\nformat binary_little_endian 1.0\ncomment point sources: metres, +x right, +y up, +z to the viewer; wave a exp(i phase) exp(+ikr)/r behind the panel\ncomment holodrive {json}\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n{amplitudes}property double phase\nend_header\n",
            cloud.points.len()
        );
        let mut bytes = head.into_bytes();
        for (index, point) in cloud.points.iter().enumerate() {
            for v in point.position.to_array() {
                bytes.extend(v.to_le_bytes());
            }
            match &cloud.rgb {
                Some(rgb) => rgb[index].iter().for_each(|a| bytes.extend(a.to_le_bytes())),
                None => bytes.extend(point.amplitude.to_le_bytes()),
            }
            bytes.extend(point.phase.to_le_bytes());
            if bytes.len() > 1 << 20 {
                out.write_all(&bytes).map_err(Error::io(path))?;
                bytes.clear();
            }
        }
        out.write_all(&bytes).map_err(Error::io(path))
    })
}
