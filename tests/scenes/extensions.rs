//! What newer and older exporters write: extensions, and files whose own light is too little to see by.

use super::builder::{Builder, assert_refused, warns};
use glam::Vec3;
use serde_json::json;
use std::io::Cursor;

/// A red matt triangle without light of its own.
fn matt() -> Builder {
    let mut file = Builder::triangle();
    file.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}}]);
    file
}

#[test]
fn copies_of_a_mesh_stand_where_their_attributes_say() {
    let mut file = matt();
    let places = file.floats(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 7.0, 0.0], "VEC3");
    let sizes = file.floats(&[1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0], "VEC3");
    file.json["nodes"][0]["translation"] = json!([0, 0, -1]);
    file.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places, "SCALE": sizes}}});
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = file.load().expect("loads").scene;
    let corners: Vec<Vec3> = scene.triangles.iter().map(|t| t.positions[1]).collect();
    assert_eq!(corners, [Vec3::new(1.0, 0.0, -1.0), Vec3::new(7.0, 0.0, -1.0), Vec3::new(1.0, 7.0, -1.0)]);
    let few = file.floats(&[1.0, 1.0, 1.0], "VEC3");
    file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(few);
    assert_refused(file.load(), "different numbers");
}

#[test]
fn hidden_nodes_hide_what_hangs_on_them() {
    let mut file = matt();
    file.node(json!({"children": [2], "extensions": {"KHR_node_visibility": {"visible": false}}}));
    file.push("nodes", json!({"mesh": 0, "translation": [3, 0, 0]}));
    file.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    assert_eq!(file.load().expect("loads").scene.triangles.len(), 1);
    file.json["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = json!(true);
    assert_eq!(file.load().expect("loads").scene.triangles.len(), 2);
}

#[test]
fn channels_without_a_node_and_scenes_without_nodes_are_no_damage() {
    let mut file = matt();
    let times = file.floats(&[0.0, 1.0], "SCALAR");
    file.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer":
            {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}}}}],
            "samplers": [{"input": times, "output": times}]}),
    );
    file.json["extensionsUsed"] = json!(["KHR_animation_pointer"]);
    file.push("scenes", json!({"name": "empty"}));
    let loaded = file.load().expect("loads");
    assert!(warns(&loaded, "KHR_animation_pointer"), "{:?}", loaded.warnings);
    assert_eq!(loaded.warnings.iter().filter(|w| w.0.contains("pointer")).count(), 1);
}

#[test]
fn variants_are_read_with_their_default_and_what_is_unknown_refused_in_one_line() {
    let mut file = matt();
    file.json["extensionsRequired"] = json!(["KHR_materials_variants"]);
    file.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "blue"}]}});
    assert_eq!(file.load().expect("loads").scene.materials[0].base_color, Vec3::X);
    for name in ["EXT_mesh_of_the_future", "KHR_texture_of_the_future"] {
        file.json["extensionsRequired"] = json!([name]);
        assert_refused(file.load(), name);
    }
}

#[test]
fn a_webp_picture_takes_the_place_of_its_fallback() {
    let mut file = matt();
    let mut webp = Vec::new();
    let pixels = image::RgbaImage::from_pixel(2, 2, image::Rgba([0, 255, 0, 255]));
    pixels.write_to(&mut Cursor::new(&mut webp), image::ImageFormat::WebP).expect("encode");
    let view = file.view(&webp);
    file.push("images", json!({"bufferView": view, "mimeType": "image/webp"}));
    file.push("textures", json!({"extensions": {"EXT_texture_webp": {"source": 0}}}));
    file.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    file.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    let loaded = file.load().expect("loads");
    let texel = loaded.scene.textures[0].levels[0].texels[0];
    assert!(texel.y > 0.99 && texel.x < 0.01, "{texel}");
    assert!(!loaded.warnings.iter().any(|w| w.0.contains("texture") || w.0.contains("image")), "{:?}", loaded.warnings);
}

#[test]
fn specular_and_glossy_materials_keep_their_colour() {
    let mut file = matt();
    file.json["materials"] = json!([{"extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.8, 0.1, 0.0, 1], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.0
    }}}]);
    let material = &file.load().expect("loads").scene.materials[0];
    assert!(material.base_color.distance(Vec3::new(0.8, 0.1, 0.0)) < 0.02, "{}", material.base_color);
    assert_eq!((material.metallic, material.roughness), (0.0, 1.0));
}

#[test]
fn copies_in_one_place_count_once() {
    let mut file = matt();
    for _ in 0..2000 {
        file.node(json!({"mesh": 0}));
    }
    let loaded = file.load().expect("loads");
    assert_eq!(loaded.scene.triangles.len(), 1);
    assert!(warns(&loaded, "2000 triangles stand exactly on others"), "{:?}", loaded.warnings);
}

/// A square of a side about a middle, facing +z.
fn square(file: &mut Builder, middle: [f32; 3], side: f32, material: usize) {
    let [x, y, z] = middle;
    let h = 0.5 * side;
    let corners = [x - h, y - h, z, x + h, y - h, z, x + h, y + h, z, x - h, y + h, z];
    let mesh = file.mesh(&corners, &[0, 1, 2, 0, 2, 3], material);
    file.node(json!({"mesh": mesh}));
}

#[test]
fn light_is_added_where_a_glowing_detail_lights_nothing_and_nowhere_else() {
    let model = |detail: f32, emission: f32, wall: f32| {
        let mut file = Builder::empty();
        file.push("materials", json!({"pbrMetallicRoughness": {"metallicFactor": 0}}));
        file.push("materials", json!({"emissiveFactor": [emission, emission, emission]}));
        square(&mut file, [0.0, 0.0, 0.0], wall, 0);
        square(&mut file, [0.3, 0.3, 0.01], detail, 1);
        file.load().expect("loads")
    };
    // An LED before a wall: its light leaves the wall dark.
    let led = model(0.05, 1.0, 1.0);
    assert!(warns(&led, "lights") && led.scene.environment.is_some(), "{:?}", led.warnings);
    // The same where all that is seen glows.
    let glow = model(1.0, 1.0, 0.2);
    assert!(glow.scene.lights.is_empty() && glow.scene.environment.is_none(), "{:?}", glow.warnings);
    // A lamp that shines on the wall is enough.
    let mut file = Builder::empty();
    file.push("materials", json!({"pbrMetallicRoughness": {"metallicFactor": 0}}));
    file.push("materials", json!({"emissiveFactor": [1, 1, 1], "doubleSided": true}));
    square(&mut file, [0.0, 0.0, 0.0], 2.0, 0);
    square(&mut file, [0.0, 0.0, 0.8], 0.3, 1);
    let lamp = file.load().expect("loads");
    assert!(lamp.scene.lights.is_empty(), "{:?}", lamp.warnings);
}

#[test]
fn a_lamp_shines_as_its_makers_file_says() {
    let mut file = matt();
    let profile = b"IESNA:LM-63-2002\r\nTILT=NONE\r\n1 1000 1 3 1 1 2 0 0 0 1 1 60\r\n0 45 90\r\n0\r\n100 50 10\r\n";
    let view = file.view(profile);
    file.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    file.json["extensions"] = json!({"EXT_lights_ies": {"lights": [
        {"uri": "lamp.ies"}, {"bufferView": view, "mimeType": "application/x-ies-lm-63"}]}});
    // Turned by a quarter about +x it aims at −y instead of −z.
    let turn = [-std::f32::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    let ies = json!({"EXT_lights_ies": {"light": 1, "multiplier": 0.5, "color": [1, 0.5, 0]}});
    let node = file.node(json!({"translation": [0, 3, 0], "rotation": turn, "extensions": ies}));
    let loaded = file.load().expect("loads");
    assert!(!warns(&loaded, "no light"), "{:?}", loaded.warnings);
    let [lamp] = &loaded.scene.lights[..] else { panic!("{:?}", loaded.scene.lights) };
    assert_eq!((lamp.position, lamp.intensity), (Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.5, 0.25, 0.0)));
    let measured = lamp.measured.as_ref().expect("measured");
    for (direction, candela) in [(glam::DVec3::NEG_Y, 100.0), (glam::DVec3::X, 10.0), (glam::DVec3::Y, 0.0)] {
        assert!((measured.towards(direction) - candela).abs() < 1e-2, "{direction}");
    }
    for (light, word) in [
        (json!({"light": 0}), "lamp.ies"),
        (json!({"light": 2}), "there are 2"),
        (json!({"light": 1, "multiplier": -1}), "below zero"),
        (json!({"multiplier": 1}), "light"),
    ] {
        file.json["nodes"][node]["extensions"] = json!({"EXT_lights_ies": light});
        assert_refused(file.load(), word);
    }
}

#[test]
fn an_environment_of_the_file_lights_from_where_its_cube_says() {
    let mut file = matt();
    let face = |file: &mut Builder, rgba: [u8; 4]| {
        let mut png = Vec::new();
        let picture = image::RgbaImage::from_pixel(4, 4, image::Rgba(rgba));
        picture.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).expect("png");
        let view = file.view(&png);
        file.push("images", json!({"bufferView": view, "mimeType": "image/png"}))
    };
    // Red to the right, green above, and blue behind, of a fourth of the alpha: four times as bright.
    let colours = [[255, 0, 0, 255], [0, 0, 0, 255], [0, 255, 0, 255], [0, 0, 0, 255], [0, 0, 0, 255], [0, 0, 255, 64]];
    let faces: Vec<usize> = colours.map(|colour| face(&mut file, colour)).to_vec();
    // A quarter turn about +y takes +x to −z.
    let turn = [0.0, std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    file.json["extensionsUsed"] = json!(["EXT_lights_image_based"]);
    let light = json!({"intensity": 0.5, "rotation": turn, "irradianceCoefficients": vec![[0, 0, 0]; 9],
        "specularImageSize": 4, "specularImages": [faces]});
    file.json["extensions"] = json!({"EXT_lights_image_based": {"lights": [light]}});
    file.json["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    let loaded = file.load().expect("loads");
    assert!(!warns(&loaded, "no light") && loaded.scene.lights.is_empty(), "{:?}", loaded.warnings);
    let around = loaded.scene.environment.as_ref().expect("environment");
    for (direction, wanted) in [
        (glam::DVec3::NEG_Z, [0.5, 0.0, 0.0]),
        (glam::DVec3::Y, [0.0, 0.5, 0.0]),
        // What was at −z is at −x.
        (glam::DVec3::NEG_X, [0.0, 0.0, 0.5 * 255.0 / 64.0]),
        (glam::DVec3::Z, [0.0; 3]),
    ] {
        let seen = around.radiance(direction);
        assert!((seen - glam::Vec3::from(wanted)).length() < 1e-3, "{direction}: {seen}");
    }
    file.json["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 7}});
    assert!(file.load().unwrap_err().to_string().contains("not there"));
}
