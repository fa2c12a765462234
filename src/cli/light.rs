//! What was done with a scene's light, in lines for people and values for machines.

use super::report::{Report, count, step};
use crate::points::PointCloud;
use crate::points::budget::{Limit, Rays};
use crate::points::colour::{Gamut, Lasers};
use crate::points::depth_map::DepthMap;
use crate::points::{ScenePoints, WhiteLevel};
use crate::units::show_length;
use serde_json::json;

pub(super) fn report_cloud(cloud: &PointCloud, elapsed: f64, report: &mut Report) {
    let (points, depth) = (cloud.points.len(), cloud.depth_range());
    report.section(json!({ "points": points, "depth": depth, "points_seconds": elapsed }));
    let range =
        depth.map(|(far, near)| format!(", z {} … {}", show_length(far), show_length(near))).unwrap_or_default();
    report.line(step("points", elapsed, format!("{} points{range}", count(points))));
}

/// How a depth map was read.
pub(super) fn report_map(map: &DepthMap, report: &mut Report) {
    report.warn(map.warnings.iter());
    report.section(json!({ "depth_map": map.origin, "unmeasured": map.unmeasured }));
    let all = map.parts.len();
    let left_out = match map.unmeasured {
        0 => String::new(),
        pixels => format!("; {} of {} pixels without measurement left out", count(pixels), count(all)),
    };
    report.line(format!("depth map              {}{left_out}", map.origin));
}

pub(super) fn report_light(scene: &ScenePoints, elapsed: f64, report: &mut Report) {
    report.warn(scene.warnings.iter());
    let (light, trace, placed) = (&scene.illumination, &scene.trace, &scene.placed);
    let (energy, convergence) = (&light.energy, &light.convergence);
    let load = (elapsed - light.seconds - trace.seconds).max(0.0);
    report.section(json!({
        "scene_seconds": load,
        "energy_emitted": energy.emitted.to_array(),
        "energy_absorbed": energy.absorbed.to_array(),
        "energy_escaped": energy.escaped.to_array(),
        "lamp_images": light.lamp_images,
        "photons": light.photons,
        "light_error": scene.light_error,
        "light_residual": convergence.residual,
        "light_seconds": light.seconds,
        "patches": light.patches,
        "rays": trace.rays,
        "trace_seconds": trace.seconds,
        "mirrored_points": trace.by_mirror,
        "beyond_cone": placed.beyond_cone,
        "beyond_cone_light": placed.beyond_cone_light,
    }));
    report.line(step("scene", load, ""));
    let mut optics = String::new();
    if light.lamp_images > 0 {
        optics += &format!(", {} mirror images of lamps", count(light.lamp_images));
    }
    if light.photons > 0 {
        optics += &format!(", {} photons by way of optics", count(light.photons));
    }
    let what = format!(
        "{} patches{optics}, {} iterations to a residual of {:.1e}; energy in = absorbed + escaped within {:.2} %",
        count(light.patches),
        convergence.iterations,
        convergence.residual,
        100.0 * energy.imbalance()
    );
    report.line(step("light", light.seconds, what));
    report.line(step("rays", trace.seconds, format!("{} rays", count(trace.rays as usize))));
    if let Some(error) = scene.light_error {
        let share = format!("{:.2} %", 100.0 * error);
        report.line(format!("light error            about {share} of the mean (root mean square over blocks of 5 × 5 rays, from a second look)"));
    }
    if let Some(rays) = &scene.rays {
        report_budget(rays, scene, report);
    }
    report_cloud(&placed.cloud, 0.0, report);
    report_white(&scene.white, report);
    if placed.beyond_cone > 0 {
        report.warn([format!(
            "{} points ({:.1} % of the light) stand where the panel cannot send light to the eye; move the viewer back or use a finer pitch",
            count(placed.beyond_cone),
            100.0 * placed.beyond_cone_light
        )]);
    }
}

/// What a budget chose, and why.
fn report_budget(rays: &Rays, scene: &ScenePoints, report: &mut Report) {
    let [eye, panel] =
        [rays.resolution.eye, rays.resolution.panel].map(|[x, y]| format!("{:.0} × {:.0}", x.floor(), y.floor()));
    let why = match rays.limit {
        Limit::Budget => "as asked",
        Limit::Eye => "all that the eye resolves",
        Limit::Panel => "all that the panel resolves",
    };
    let viewer = show_length(scene.view.placing.eye.z);
    let [across, down] = rays.size;
    report.value("budget", rays);
    report.line(format!("budget                 {across} × {down} rays, {why}; an eye at {viewer} resolves {eye} (1/60°), the panel {panel} (pitch, or λz/D)"));
}

fn report_white(exposed: &WhiteLevel, report: &mut Report) {
    report.section(json!({
        "exposure": exposed,
        "white": exposed.white,
        "clipped_light": exposed.clipped_light(),
        "clipped_points": exposed.clipped_points(),
    }));
    let share = format!(
        "{} points ({:.2} %) with {:.2} % of the light",
        count(exposed.brighter_points),
        100.0 * exposed.brighter_share,
        100.0 * exposed.light_above
    );
    let did = match (exposed.brighter_points, exposed.clips) {
        (0, _) => "nothing is brighter".to_string(),
        (_, true) => format!(
            "{share} above it are clipped to it, the brightest from {:.1} times white (--white none keeps all)",
            exposed.brightest / exposed.white
        ),
        (_, false) => format!(
            "{share} above it are kept, the brightest {:.1} times white (--white auto clips)",
            exposed.brightest / exposed.white
        ),
    };
    report.line(format!("exposure               white is {:.3} W/(m² sr); {did}", exposed.white));
}

/// The three lasers, and the light that they cannot make.
pub(super) fn report_gamut(lasers: &Lasers, gamut: &Gamut, report: &mut Report) {
    let names = lasers.wavelengths().map(show_length).join(", ");
    let powers = lasers.white();
    let sum: f64 = powers.iter().sum();
    let powers = powers.map(|p| format!("{:.3}", p / sum)).join(" : ");
    let outside = match gamut.outside_points {
        0 => "all colours are inside the lasers' gamut".to_string(),
        points => format!(
            "{} points ({:.2} %) with {:.2} % of the light are outside the lasers' gamut and brought in towards gray of their luminance, keeping {:.0} % of their saturation or more",
            count(points),
            100.0 * gamut.outside_share,
            100.0 * gamut.outside_light,
            100.0 * gamut.least_kept
        ),
    };
    report.value("gamut", gamut);
    report.line(format!("colour                 {names}; white (D65) is powers of {powers}; {outside}"));
}
