//! Third-party files, in the folder that HOLODRIVE_ASSETS names; without it these tests say so and check nothing.

use super::builder::warns;
use glam::DVec3;
use holodrive::scene::gltf::{Clip, LoadOptions, Loaded, load};
use std::path::{Path, PathBuf};

fn assets() -> Option<PathBuf> {
    let folder = std::env::var_os("HOLODRIVE_ASSETS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("HOLODRIVE_ASSETS is not set: nothing was checked here");
    }
    folder
}

fn loaded(path: &Path, clip: Clip, time: f64) -> Loaded {
    load(path, &LoadOptions { clip, time, ..LoadOptions::default() }).unwrap_or_else(|why| panic!("{why}"))
}

/// Largest distance that a corner moves between two poses of the same file [m].
fn largest_move(a: &Loaded, b: &Loaded) -> f64 {
    assert_eq!(a.scene.triangles.len(), b.scene.triangles.len());
    let moved = |(a, b): (&holodrive::scene::Triangle, &holodrive::scene::Triangle)| {
        (0..3).map(|i| a.corners()[i].distance(b.corners()[i])).fold(0.0, f64::max)
    };
    a.scene.triangles.iter().zip(&b.scene.triangles).map(moved).fold(0.0, f64::max)
}

#[test]
fn all_load_with_the_counts_that_are_known_of_them() {
    let Some(folder) = assets() else { return };
    for (name, triangles, textures, cameras) in [
        ("bevy_CornellBox.glb", 36, 0, 0),
        ("BoxTextured.glb", 12, 1, 0),
        ("Box_embedded.gltf", 12, 0, 0),
        ("Duck.glb", 4212, 1, 1),
        ("CesiumMilkTruck.glb", 3624, 1, 0),
        ("Fox.glb", 576, 1, 0),
        ("MorphStressTest.gltf", 2412, 2, 0),
        ("AnisotropyBarnLamp/AnisotropyBarnLamp.gltf", 10_203, 3, 0),
    ] {
        let Loaded { scene, warnings } = loaded(&folder.join(name), Clip::First, 0.0);
        assert_eq!(scene.triangles.len(), triangles, "{name}");
        assert_eq!(scene.textures.len(), textures, "{name}");
        let no_camera = warnings.iter().any(|w| w.0.contains("no camera"));
        assert!(no_camera == (cameras == 0) && scene.cameras.len() == 1, "{name}");
        assert!(scene.triangles.iter().all(|t| t.area() > 0.0), "{name}");
        for normal in scene.triangles.iter().flat_map(|t| t.normals) {
            assert!((normal.length() - 1.0).abs() < 1e-5, "{name}: {normal}");
        }
    }
}

#[test]
fn known_extents_and_materials() {
    let Some(folder) = assets() else { return };
    // A cube of 1 m whose node turns +z into +y.
    let cube = loaded(&folder.join("BoxTextured.glb"), Clip::First, 0.0).scene;
    assert_eq!(cube.bounds(), Some((DVec3::splat(-0.5), DVec3::splat(0.5))));
    assert!(cube.triangles.iter().all(|t| t.normal().dot(t.corners()[0]) > 0.0), "a face looks inwards");
    assert!(cube.materials[0].base_color_texture.is_some());

    let room = loaded(&folder.join("bevy_CornellBox.glb"), Clip::First, 0.0).scene;
    let light = room.materials.iter().find(|m| m.emissive.max_element() > 1.0).expect("an emitter stronger than 1");
    assert!(light.name.contains("Emitter") && room.lights.is_empty());

    // 0.01 of 165 units, by a node of its own.
    let (low, high) = loaded(&folder.join("Duck.glb"), Clip::First, 0.0).scene.bounds().expect("a duck");
    assert!((high - low).distance(DVec3::new(1.6548, 1.5404, 1.1525)) < 1e-3, "{}", high - low);
}

#[test]
fn ktx2_images_of_plain_texels_are_read() {
    let Some(folder) = assets() else { return };
    let lamp = loaded(&folder.join("AnisotropyBarnLamp/AnisotropyBarnLamp.gltf"), Clip::First, 0.0);
    // 8-bit RGB by Zstandard, which no extension announces.
    assert!(!warns(&lamp, ".ktx2") && warns(&lamp, "KHR_materials_anisotropy"));
    let metal = lamp.scene.materials.iter().find(|m| m.name == "Lamp Metal").expect("metal");
    assert!(metal.base_color_texture.is_some() && metal.normal_texture.is_some());
    let map = metal.metallic_roughness_texture.as_ref().expect("a map");
    let map = &lamp.scene.textures[map.texture as usize];
    let coarsest = map.levels.last().expect("levels").texels[0];
    // Occlusion, roughness, metal: much of the lamp is painted.
    assert!(
        (map.levels[0].width, map.levels[0].height) == (512, 512) && coarsest.z > 0.05 && coarsest.z < 0.95,
        "{coarsest}"
    );
    let glass = lamp.scene.materials.iter().find(|m| m.name == "Lamp Glass").expect("glass");
    assert!(glass.transmission > 0.0);
}

#[test]
fn animations_move_what_they_should() {
    let Some(folder) = assets() else { return };
    let fox = folder.join("Fox.glb");
    let start = loaded(&fox, Clip::Of("Walk".into()), 0.0);
    let later = loaded(&fox, Clip::Of("Walk".into()), 0.35);
    // The fox is 155 units long and swings its legs.
    let step = largest_move(&start, &later);
    assert!((5.0..60.0).contains(&step), "{step}");
    assert_eq!(largest_move(&start, &loaded(&fox, Clip::Of("1".into()), -1.0)), 0.0);
    let rest = loaded(&fox, Clip::Rest, 0.0);
    let (low, high) = rest.scene.bounds().expect("a fox");
    assert!((high - low).max_element() > 100.0 && low.y > -2.0, "{low} {high}");

    let truck = folder.join("CesiumMilkTruck.glb");
    let turned = largest_move(&loaded(&truck, Clip::First, 0.0), &loaded(&truck, Clip::First, 0.5));
    assert!(turned > 0.1 && turned < 1.0, "wheels of 0.4 m radius turn: {turned}");

    // In the middle of this clip all eight weights are 1, and the targets raise the cubes' tops by 1.
    let keys = folder.join("MorphStressTest.gltf");
    let pulse = || Clip::Of("Pulse".into());
    let raised = largest_move(&loaded(&keys, pulse(), 0.0), &loaded(&keys, pulse(), 19.0 / 6.0));
    assert!((raised - 1.0).abs() < 0.01, "{raised}");
}

#[test]
fn the_reference_room_loads_without_a_word() {
    let Some(folder) = assets() else { return };
    let Some(references) = folder.parent().map(|p| p.join("references")).filter(|p| p.is_dir()) else {
        eprintln!("there is no folder references beside the assets: nothing was checked here");
        return;
    };
    let room = loaded(&references.join("cornell_diffuse.gltf"), Clip::First, 0.0);
    assert_eq!(room.warnings, []);
    let light = room.scene.materials.iter().find(|m| m.name == "light").expect("light");
    assert!(light.emissive.distance(glam::Vec3::new(17.0, 12.0, 4.0)) < 1e-5);
    assert!(room.scene.materials.iter().all(|m| m.specular == 0.0 && m.metallic == 0.0 && !m.double_sided));
}
