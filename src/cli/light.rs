//! What was done with a scene's light, in lines for people and values for machines.

use super::report::{Report, count, seconds};
use holodrive::points::PointCloud;
use holodrive::points::budget::{Limit, Rays};
use holodrive::points::colour::{Gamut, Lasers};
use holodrive::points::{ScenePoints, WhiteLevel};
use holodrive::units::show_length;
use serde_json::Value;

pub(super) fn report_cloud(cloud: &PointCloud, elapsed: f64, report: &mut Report) {
    let depth = cloud.depth_range();
    report.add("points", cloud.points.len(), "");
    report.add_serialised("depth", &depth, "");
    let range =
        depth.map(|(far, near)| format!(", z {} … {}", show_length(far), show_length(near))).unwrap_or_default();
    report.add(
        "points_seconds",
        elapsed,
        format!("points       {:>8}  {} points{range}", seconds(elapsed), count(cloud.points.len())),
    );
}

pub(super) fn report_light(scene: &ScenePoints, elapsed: f64, report: &mut Report) {
    report.warn(scene.warnings.iter());
    let (light, trace) = (&scene.illumination, &scene.trace);
    let load = (elapsed - light.seconds - trace.seconds).max(0.0);
    report.add("scene_seconds", load, format!("scene        {:>8}", seconds(load)));
    let energy = &light.energy;
    for (key, value) in
        [("energy_emitted", energy.emitted), ("energy_absorbed", energy.absorbed), ("energy_escaped", energy.escaped)]
    {
        report.add(key, value.to_array().to_vec(), "");
    }
    report.add("lamp_images", light.lamp_images, "");
    report.add("photons", light.photons, "");
    let mut optics = String::new();
    if light.lamp_images > 0 {
        optics += &format!(", {} mirror images of lamps", count(light.lamp_images));
    }
    if light.photons > 0 {
        optics += &format!(", {} photons by way of optics", count(light.photons));
    }
    report.add("light_residual", light.convergence.residual, "");
    report.add(
        "light_seconds",
        light.seconds,
        format!(
            "light        {:>8}  {} patches{optics}, {} iterations to a residual of {:.1e}; energy in = absorbed + escaped within {:.2} %",
            seconds(light.seconds),
            count(light.patches),
            light.convergence.iterations,
            light.convergence.residual,
            100.0 * light.energy.imbalance()
        ),
    );
    report.add("patches", light.patches, "");
    report.add("rays", trace.rays, "");
    report.add(
        "trace_seconds",
        trace.seconds,
        format!("rays         {:>8}  {} rays", seconds(trace.seconds), count(trace.rays as usize)),
    );
    if let Some(rays) = &scene.rays {
        report_budget(rays, scene, report);
    }
    report_cloud(&scene.placed.cloud, 0.0, report);
    report_exposure(&scene.white, report);
    report.add("mirrored_points", trace.by_mirror, "");
    report.add("beyond_cone", scene.placed.beyond_cone, "");
    report.add("beyond_cone_light", scene.placed.beyond_cone_light, "");
    if scene.placed.beyond_cone > 0 {
        report.warn([format!(
            "{} points ({:.1} % of the light) stand where the panel cannot send light to the eye; move the viewer back or use a finer pitch",
            count(scene.placed.beyond_cone),
            100.0 * scene.placed.beyond_cone_light
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
    report.add_serialised("budget", rays, "");
    report.add("", Value::Null, format!("budget                 {across} × {down} rays, {why}; an eye at {viewer} resolves {eye} (1/60°), the panel {panel} (pitch, or λz/D)"));
}

fn report_exposure(exposed: &WhiteLevel, report: &mut Report) {
    report.add_serialised("exposure", exposed, "");
    report.add("white", exposed.white, "");
    report.add("clipped_light", exposed.clipped_light(), "");
    report.add("clipped_points", exposed.clipped_points(), "");
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
    report.add("", Value::Null, format!("exposure               white is {:.3} W/(m² sr); {did}", exposed.white));
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
    report.add_serialised("gamut", gamut, "");
    report.add(
        "",
        Value::Null,
        format!("colour                 {names}; white (D65) is powers of {powers}; {outside}"),
    );
}
