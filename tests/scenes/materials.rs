//! Materials, textures and images.

use super::builder::{Builder, assert_refused, warns};
use glam::{Vec2, Vec3, Vec4};
use holodrive::scene::gltf::LoadOptions;
use holodrive::scene::texture::{Wrap, linear_from_srgb};
use holodrive::scene::{AlphaMode, Material, Scene, TextureRef};
use serde_json::json;
use std::io::Cursor;
use std::sync::Arc;

fn encoded(texels: &[[u8; 4]], width: u32, format: image::ImageFormat) -> Vec<u8> {
    let picture = image::RgbaImage::from_raw(width, texels.len() as u32 / width, texels.concat()).expect("picture");
    let mut bytes = Vec::new();
    let picture = image::DynamicImage::from(picture);
    let picture = if format == image::ImageFormat::Jpeg { picture.to_rgb8().into() } else { picture };
    picture.write_to(&mut Cursor::new(&mut bytes), format).expect("encode");
    bytes
}

/// The triangle file with texture 0: red, green over blue, half-transparent white.
fn textured() -> Builder {
    let mut file = Builder::triangle();
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 128]];
    let view = file.view(&encoded(&texels, 2, image::ImageFormat::Png));
    let image = file.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "four"}));
    let sampler = file.push("samplers", json!({"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}));
    file.push("textures", json!({"source": image, "sampler": sampler}));
    file
}

fn scene(file: &Builder) -> Arc<Scene> {
    file.load().expect("loads").scene
}

#[test]
fn factors_and_extensions() {
    let mut file = Builder::triangle();
    file.json["materials"] = json!([{
        "name": "everything", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6},
        "emissiveFactor": [0.5, 0.25, 1],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 0.7},
            "KHR_materials_volume": {"thicknessFactor": 0.02, "attenuationDistance": 3, "attenuationColor": [1, 0.5, 0]},
            "KHR_materials_specular": {"specularFactor": 0.9}
        }
    }]);
    let loaded = file.load().expect("loads");
    let only_the_camera = |w: &[holodrive::scene::Warning]| w.len() == 1 && w[0].0.contains("camera");
    assert!(only_the_camera(&loaded.warnings), "{:?}", loaded.warnings);
    let expected = Material {
        name: "everything".into(),
        base_color: Vec3::new(0.1, 0.2, 0.3),
        alpha: 0.4,
        metallic: 0.5,
        roughness: 0.6,
        emissive: Vec3::new(4.0, 2.0, 8.0),
        alpha_mode: AlphaMode::Mask(0.25),
        double_sided: true,
        transmission: 0.7,
        ior: 1.33,
        specular: 0.9,
        thickness: 0.02,
        attenuation_distance: 3.0,
        attenuation_color: Vec3::new(1.0, 0.5, 0.0),
        ..Material::default()
    };
    assert_eq!(loaded.scene.materials, [expected]);

    // Defaults of the specification, also for a primitive without material.
    file.json["materials"] = json!([{"emissiveFactor": [1, 1, 1]}]);
    let mut bare = file.primitive().clone();
    bare.as_object_mut().expect("primitive").remove("material");
    file.json["meshes"][0]["primitives"].as_array_mut().expect("primitives").push(bare);
    let scene = scene(&file);
    assert_eq!(scene.materials[0], Material { name: "material 0".into(), emissive: Vec3::ONE, ..Material::default() });
    assert_eq!(scene.materials[1], Material::default());
    assert_eq!([scene.triangles[0].material, scene.triangles[1].material], [0, 1]);
}

#[test]
fn factors_outside_their_domain_are_named() {
    let mut file = Builder::triangle();
    file.json["materials"][0]["pbrMetallicRoughness"] = json!({"roughnessFactor": 2, "baseColorFactor": [1, -1, 1, 1]});
    file.json["materials"][0]["extensions"] = json!({"KHR_materials_ior": {"ior": 0.5}});
    let loaded = file.load().expect("loads");
    assert!(warns(&loaded, "roughnessFactor 2") && warns(&loaded, "baseColorFactor -1") && warns(&loaded, "ior 0.5"));
    let material = &loaded.scene.materials[0];
    assert_eq!((material.roughness, material.base_color, material.ior), (1.0, Vec3::new(1.0, 0.0, 1.0), 1.5));
}

#[test]
fn textures_of_all_kinds() {
    let mut file = textured();
    file.json["materials"][0] = json!({
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1},
                                 "metallicRoughnessTexture": {"index": 0}},
        "normalTexture": {"index": 0, "scale": 0.5,
                          "extensions": {"KHR_texture_transform": {"scale": [2, 3], "texCoord": 1}}},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 0}}}
    });
    let scene = scene(&file);
    let material = &scene.materials[0];
    // One picture, decoded as colour and as data.
    assert_eq!(scene.textures.len(), 2);
    let color = material.base_color_texture.expect("base colour");
    let plain = TextureRef { texture: color.texture, texcoord: 0, scale: Vec2::ONE, rotation: 0.0, offset: Vec2::ZERO };
    assert_eq!(color, TextureRef { texcoord: 1, ..plain });
    assert_eq!(material.emissive_texture, Some(plain));
    let data = material.metallic_roughness_texture.expect("metallic and roughness");
    assert_ne!(data.texture, color.texture);
    assert_eq!(material.transmission_texture, Some(data));
    assert_eq!(material.normal_texture, Some((TextureRef { scale: Vec2::new(2.0, 3.0), texcoord: 1, ..data }, 0.5)));

    let texture = &scene.textures[color.texture as usize];
    assert_eq!((texture.wrap, texture.linear), ([Wrap::ClampToEdge, Wrap::MirroredRepeat], false));
    // Row 0 of the picture is at v = 0, on top.
    assert_eq!(texture.sample(Vec2::new(0.25, 0.25), 0.0), Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(texture.sample(Vec2::new(0.25, 0.75), 0.0), Vec4::new(0.0, 0.0, 1.0, 1.0));
    // Alpha is not sRGB-coded.
    assert!((texture.sample(Vec2::new(0.75, 0.75), 0.0).w - 128.0 / 255.0).abs() < 1e-6);
}

#[test]
fn colour_is_srgb_and_data_is_linear() {
    let mut file = Builder::triangle();
    let view = file.view(&encoded(&[[128, 128, 128, 255]; 64], 8, image::ImageFormat::Jpeg));
    file.push("images", json!({"bufferView": view, "mimeType": "image/jpeg"}));
    file.push("textures", json!({"source": 0}));
    file.json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}});
    let scene = scene(&file);
    let texel =
        |t: Option<TextureRef>| scene.textures[t.expect("texture").texture as usize].sample(Vec2::splat(0.5), 0.0);
    // JPEG may be off by a level.
    let level = 1.5 / 255.0;
    assert!((texel(scene.materials[0].metallic_roughness_texture).x - 128.0 / 255.0).abs() < level);
    assert!((texel(scene.materials[0].base_color_texture).x - linear_from_srgb(128.0 / 255.0)).abs() < level);
    // Without a sampler: repeated and interpolated.
    assert_eq!((scene.textures[0].wrap, scene.textures[0].linear), ([Wrap::Repeat; 2], true));
}

#[test]
fn texture_transform_is_that_of_the_extension() {
    let mut file = textured();
    let transform = json!({"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]});
    file.json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": transform}}});
    let texture = scene(&file).materials[0].base_color_texture.expect("texture");
    // The extension's own example: "only the lower left quadrant of the source image, rotated clockwise 90°".
    for (uv, expected) in [
        (Vec2::new(0.0, 0.0), Vec2::new(0.0, 1.0)),
        (Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.5)),
        (Vec2::new(0.0, 1.0), Vec2::new(0.5, 1.0)),
        (Vec2::new(1.0, 1.0), Vec2::new(0.5, 0.5)),
    ] {
        assert!(texture.transform(uv).distance(expected) < 1e-6, "{uv} {}", texture.transform(uv));
    }
}

#[test]
fn images_that_cannot_be_decoded_are_named_and_their_factor_stays() {
    let with_image = |image: serde_json::Value, content: &[u8]| {
        let mut file = textured();
        file.json["images"][0] = image;
        let view = file.view(content);
        if file.json["images"][0]["uri"].is_null() {
            file.json["images"][0]["bufferView"] = json!(view);
        }
        file.json["materials"][0]["pbrMetallicRoughness"] =
            json!({"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}});
        let loaded = file.load().expect("an image is no reason to refuse a scene");
        assert!(loaded.scene.textures.is_empty() && loaded.scene.materials[0].base_color_texture.is_none());
        let about: Vec<_> = loaded.warnings.iter().filter(|w| w.0.starts_with("image")).cloned().collect();
        assert_eq!(about.len(), 1, "one warning for an image, however often it is used: {about:?}");
        about[0].0.clone()
    };
    let ktx2 = b"\xabKTX 20\xbb\r\n\x1a\n0000000000000000";
    let said = with_image(json!({"name": "wood"}), ktx2);
    assert!(said.contains("'wood'") && said.contains("KTX2"), "{said}");
    assert!(with_image(json!({"name": "wood"}), b"RIFF0000WEBPVP8 ").contains("cannot be decoded"));
    assert!(with_image(json!({"uri": "gone.png"}), b"").contains("'gone.png'"));
    let png = encoded(&[[9; 4]; 4], 2, image::ImageFormat::Png);
    assert!(with_image(json!({"name": "half"}), &png[..png.len() / 2]).contains("'half': it cannot be decoded"));
}

#[test]
fn unused_images_are_not_touched() {
    let mut file = textured();
    file.push("images", json!({"uri": "gone.png"}));
    file.push("textures", json!({"source": 1}));
    // A material that no triangle uses, and a texture of a used one that light does not need.
    file.push("materials", json!({"emissiveTexture": {"index": 1}}));
    file.json["materials"][0]["occlusionTexture"] = json!({"index": 1});
    let loaded = file.load().expect("loads");
    assert!(!warns(&loaded, "gone.png") && loaded.scene.textures.is_empty());
}

#[test]
fn textures_without_an_image_or_with_wrong_numbers() {
    let mut file = textured();
    file.json["textures"][0] = json!({});
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    assert!(warns(&file.load().expect("loads"), "it has no image"));
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 0, "texCoord": 2});
    assert!(warns(&file.load().expect("loads"), "TEXCOORD_2"));
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 7});
    assert_refused(file.load_with(&LoadOptions::default()), "not there");
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    file.json["textures"][0] = json!({"source": 0, "sampler": 7});
    assert_refused(file.load(), "not there");
}

#[test]
fn a_large_picture_is_reduced() {
    let mut file = Builder::triangle();
    let texels = vec![[255; 4]; 8192 * 2];
    let view = file.view(&encoded(&texels, 8192, image::ImageFormat::Png));
    file.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "long"}));
    file.push("textures", json!({"source": 0}));
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    let loaded = file.load().expect("loads");
    let finest = &loaded.scene.textures[0].levels[0];
    assert_eq!((finest.width, finest.height), (4096, 1));
    assert!(warns(&loaded, "8192 × 2 texels are reduced to 4096 × 1"));
}

#[test]
fn a_black_emission_picture_is_no_light() {
    let mut file = textured();
    let view = file.view(&encoded(&[[0, 0, 0, 255]; 4], 2, image::ImageFormat::Png));
    file.json["images"][0]["bufferView"] = json!(view);
    file.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    assert!(warns(&file.load().expect("loads"), "no light"));
}
