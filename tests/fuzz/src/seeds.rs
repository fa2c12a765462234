//! Good inputs, each a few kilobytes, made here by the writers of the program and of the crates that it reads with.

use crate::archive::pack;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage as _};
use holodrive::field::arrays::{self, Named, Values};
use holodrive::field::{Complex32, Grid, npy};
use holodrive::glam::{DVec2, DVec3};
use holodrive::light_field::{EyeGrid, LightField};
use holodrive::panel::{Frame, PanelProfile};
use holodrive::print::{Manifest, Plate, Settings, Source};
use holodrive::segments::SceneOptions;
use image::ImageFormat;
use serde_json::{Value, json};
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Why a seed could not be made.
pub type Fault = Box<dyn std::error::Error>;

/// Inputs of a parser.
pub type Seeds = Result<Vec<Vec<u8>>, Fault>;

const DRACO: &str = "445241434f02020101000000050401040000026f01ff0111ff02444002ff000000000001000903000002010309020001020101\
    01000f07cd0c2b353303f2df82ffffff1f00fcfffebf0080f8ff0080000000f8ff022000000000ff3f00000000000000000000000000000000803f0e\
    010101000d07cd0c23353303f2df82ffffffffefffe8ff000000fe0f00000000ff0f000000000000000000000000803f0c";
const MESHOPT: [&str; 2] = [
    "a000000133000000ffff0133c000007e7d7e0000010cc00000ffff010c0000007e0000010fc00000ffffff010fc000007c7b7e0000000000000000000000000000000000000000000000000000000000000000",
    "e1fe1000040f08007687566778a9866589689801690000",
];

fn hex(text: &str) -> Vec<u8> {
    (0..text.len() / 2).filter_map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).ok()).collect()
}

/// The panel that frames and protocols are for.
pub fn panel() -> Result<PanelProfile, Fault> {
    Ok(PanelProfile::phase(12, 8, 8e-6, 8, 532e-9)?)
}

/// A triangle with everything beside it that a glTF may have, its numbers in `data.bin`.
fn rich() -> (Value, Vec<u8>) {
    let mut data: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    data.extend([0.0f32, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0].iter().flat_map(|v| v.to_le_bytes()));
    data.extend([0.0f32, 0.0, 1.0, 0.0, 0.0, 1.0].iter().flat_map(|v| v.to_le_bytes()));
    data.extend([0u16, 1, 2, 1].iter().flat_map(|v| v.to_le_bytes()));
    data.extend([0u8, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    data.extend([1.0f32, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    data.extend([0.0f32, 1.0].iter().flat_map(|v| v.to_le_bytes()));
    data.extend([0.0f32, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    let mut views = Vec::new();
    let mut at = 0;
    for long in [36, 36, 24, 8, 12, 48, 8, 32] {
        views.push(json!({"buffer": 0, "byteOffset": at, "byteLength": long}));
        at += long;
    }
    let png = BASE64_STANDARD.encode(picture(ImageFormat::Png).unwrap_or_default());
    let told = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "extensionsUsed": ["KHR_lights_punctual", "EXT_mesh_gpu_instancing", "KHR_materials_variants", "KHR_node_visibility"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}, "intensity": 10}]},
                       "KHR_materials_variants": {"variants": [{"name": "a"}]}},
        "nodes": [
            {"mesh": 0, "skin": 0, "scale": [-1, 1, 1], "weights": [0.5]},
            {"children": [2, 3], "camera": 0, "translation": [0, 0, 3]},
            {"translation": [0, 1, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "rotation": [0, 0, 0, 1], "extensions": {"KHR_node_visibility": {"visible": true},
                "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 1, "JOINTS_0": 4,
            "WEIGHTS_0": 5}, "indices": 3, "material": 0, "targets": [{"POSITION": 1}],
            "extensions": {"KHR_materials_variants": {"mappings": [{"material": 0, "variants": [0]}]}}}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 1], "metallicFactor": 0.5, "roughnessFactor": 0.3,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 1}}}},
            "normalTexture": {"index": 0, "scale": 0.5}, "emissiveFactor": [0.1, 0, 0], "alphaMode": "MASK", "alphaCutoff": 0.3,
            "extensions": {"KHR_materials_volume": {"thicknessFactor": 1}, "KHR_materials_transmission": {"transmissionFactor": 0.5},
                "KHR_materials_ior": {"ior": 1.4}, "KHR_materials_emissive_strength": {"emissiveStrength": 3}}}],
        "textures": [{"source": 0, "sampler": 0}], "samplers": [{"magFilter": 9729, "wrapS": 33071}],
        "images": [{"uri": format!("data:image/png;base64,{png}")}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        "skins": [{"joints": [1, 2]}],
        "animations": [{"channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 3, "path": "weights"}}],
            "samplers": [{"input": 6, "output": 7}, {"input": 6, "output": 6}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3",
             "sparse": {"count": 1, "indices": {"bufferView": 3, "byteOffset": 2, "componentType": 5123}, "values": {"bufferView": 0}}},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 4, "componentType": 5121, "count": 3, "type": "VEC4"},
            {"bufferView": 5, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 6, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"bufferView": 7, "componentType": 5126, "count": 2, "type": "VEC4"}
        ],
        "bufferViews": views, "buffers": [{"byteLength": data.len(), "uri": "data.bin"}]
    });
    (told, data)
}

fn scene_of(name: &str, accessors: Value, views: Value, buffers: Value, primitive: Value) -> Value {
    json!({
        "asset": {"version": "2.0"}, "extensionsUsed": [name], "extensionsRequired": [name], "scene": 0,
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}],
        "accessors": accessors, "bufferViews": views, "buffers": buffers
    })
}

/// glTF with its buffer beside it: plain, Draco, meshopt.
pub fn gltf() -> Seeds {
    let (told, data) = rich();
    let draco = hex(DRACO);
    let packed = scene_of(
        "KHR_draco_mesh_compression",
        json!([{"componentType": 5123, "count": 12, "type": "SCALAR"}, {"componentType": 5126, "count": 5, "type": "VEC3"},
               {"componentType": 5126, "count": 5, "type": "VEC2"}]),
        json!([{"buffer": 0, "byteLength": draco.len()}]),
        json!([{"byteLength": draco.len(), "uri": "data.bin"}]),
        json!({"attributes": {"POSITION": 1, "TEXCOORD_0": 2}, "indices": 0, "extensions": {"KHR_draco_mesh_compression":
            {"bufferView": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}}}),
    );
    let [vertices, indices] = MESHOPT.map(hex);
    let name = "EXT_meshopt_compression";
    let coded = scene_of(
        name,
        json!([{"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"},
               {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]),
        json!([{"buffer": 1, "byteLength": 60, "byteStride": 12, "extensions": {name: {"buffer": 0, "byteLength": vertices.len(),
                "byteStride": 12, "count": 5, "mode": "ATTRIBUTES"}}},
               {"buffer": 1, "byteOffset": 60, "byteLength": 24, "extensions": {name: {"buffer": 0, "byteOffset": vertices.len(),
                "byteLength": indices.len(), "byteStride": 2, "count": 12, "mode": "TRIANGLES", "filter": "NONE"}}}]),
        json!([{"byteLength": vertices.len() + indices.len(), "uri": "data.bin"},
               {"byteLength": 84, "extensions": {name: {"fallback": true}}}]),
        json!({"attributes": {"POSITION": 0}, "indices": 1}),
    );
    let files = [(told, data), (packed, draco), (coded, [vertices, indices].concat())];
    Ok(files.iter().map(|(told, data)| pack(&[("a.gltf", told.to_string().as_bytes()), ("data.bin", data)])).collect())
}

/// The same triangle in one file.
pub fn glb() -> Seeds {
    let (mut told, mut data) = rich();
    told["buffers"][0].as_object_mut().map(|buffer| buffer.remove("uri"));
    let mut text = told.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend(((28 + text.len() + data.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &data)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    Ok(vec![pack(&[("a.glb", &glb)])])
}

/// Pictures as a scene's texture.
pub fn textures() -> Seeds {
    let scene = |name: &str| {
        let (mut told, data) = rich();
        told["images"] = json!([{"uri": name}]);
        if name.ends_with("ktx2") {
            told["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
            told["extensionsUsed"] = json!(["KHR_texture_basisu"]);
        }
        (told.to_string().into_bytes(), data)
    };
    let mut ktx2 = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let words = |out: &mut Vec<u8>, words: &[u32]| words.iter().for_each(|w| out.extend(w.to_le_bytes()));
    words(&mut ktx2, &[23, 1, 2, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 104, 0, 6, 0, 0, 0]);
    ktx2.extend([1, 2, 3, 4, 5, 6]);
    // UASTC: two blocks of one colour each.
    let mut basis = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    words(&mut basis, &[0, 1, 6, 3, 0, 0, 1, 1, 0, 104, 44, 0, 0, 0, 0, 0, 0, 148, 0, 32, 0, 32, 0]);
    words(
        &mut basis,
        &[44, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0, 3 << 24 | 127 << 16, 0, 0, u32::MAX],
    );
    for colour in [[10, 20, 30, 255], [200, 100, 0, 128]] {
        basis.extend((0x17 | u128::from(u32::from_le_bytes(colour)) << 5).to_le_bytes());
    }
    let pictures = [
        ("i.png", picture(ImageFormat::Png)?),
        ("i.jpg", picture(ImageFormat::Jpeg)?),
        ("i.webp", picture(ImageFormat::WebP)?),
        ("i.ktx2", ktx2),
        ("i.ktx2", basis),
    ];
    // The picture first: it is what is damaged most.
    let packed = pictures.iter().map(|(name, bytes)| {
        let (told, data) = scene(name);
        pack(&[(name, bytes), ("a.gltf", &told), ("data.bin", &data)])
    });
    Ok(packed.collect())
}

/// OBJ with its materials, STL of both kinds.
pub fn meshes() -> Seeds {
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 \
        3/3/1\nf -1 -2 -3 -4\n";
    let mtl = b"newmtl red\nKd 0.5 0.1 0.2\nKe 1 1 0\nNs 200\nd 0.5\nillum 3\nmap_Kd i.png\n";
    let ascii = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let mut binary = vec![b' '; 80];
    binary.extend(1u32.to_le_bytes());
    binary.extend([0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    binary.extend([0, 0]);
    let png = picture(ImageFormat::Png)?;
    Ok(vec![
        pack(&[("a.obj", obj), ("a.mtl", mtl), ("i.png", &png)]),
        pack(&[("a.stl", ascii)]),
        pack(&[("a.stl", &binary)]),
    ])
}

/// PLY as text and in both orders of bytes, with lists, and of splats.
pub fn ply() -> Seeds {
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment a\nelement vertex 2\nproperty float x\nproperty float y\nproperty double z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float intensity\nelement face 1\nproperty list \
             uchar int vertex_indices\nend_header\n"
        )
        .into_bytes()
    };
    let mut ascii = head("ascii");
    ascii.extend(b"0.001 0.002 -0.1 255 0 10 0.5\n-0.001 nan -0.2 1 2 3 1e3\n3 0 1 0\n");
    let binary = |big: bool| {
        let mut out = head(if big { "binary_big_endian" } else { "binary_little_endian" });
        let mut put = |bytes: &mut [u8]| {
            if big {
                bytes.reverse();
            }
            out.extend_from_slice(bytes);
        };
        for _ in 0..2 {
            put(&mut 0.001f32.to_le_bytes());
            put(&mut 0.002f32.to_le_bytes());
            put(&mut (-0.1f64).to_le_bytes());
            [9u8, 8, 7].iter().for_each(|c| put(&mut [*c]));
            put(&mut 0.5f32.to_le_bytes());
        }
        put(&mut [3]);
        [0i32, 1, 0].iter().for_each(|i| put(&mut i.to_le_bytes()));
        out
    };
    let splat = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float f_dc_0\n\
        property float f_dc_1\nproperty float f_dc_2\nproperty float opacity\nproperty float scale_0\nend_header\n0 0 1 0.5 -1 2 3 \
        -4\n";
    Ok([ascii, binary(false), binary(true), splat.to_vec()].iter().map(|bytes| pack(&[("a.ply", bytes)])).collect())
}

/// Clouds as tables, PCD, OBJ vertices, LAS.
pub fn clouds() -> Seeds {
    let pcd = |data: &str| {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 \
             1 0 0 0\nPOINTS 2\nDATA {data}\n"
        )
        .into_bytes()
    };
    let rows = [1.0f32, 2.0, -3.0, 1e-38, 4.0, 5.0, -6.0, 2e-38].map(f32::to_le_bytes).concat();
    let (mut ascii, mut binary, mut packed) = (pcd("ascii"), pcd("binary"), pcd("binary_compressed"));
    ascii.extend(b"1 2 -3 1e-38\n4 5 -6 2e-38\n");
    binary.extend(&rows);
    // A run of 32 bytes as they are.
    packed.extend([33u32, 32].map(u32::to_le_bytes).concat());
    packed.push(31);
    packed.extend(&rows);
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(2)?;
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), builder.into_header()?)?;
    for x in [1.0, 2.0] {
        let color = Some(las::Color { red: 9, green: 8, blue: 7 });
        writer.write_point(las::Point { x, y: 3.0, z: -4.5, intensity: 7, color, ..Default::default() })?;
    }
    let scan = writer.into_inner()?.into_inner();
    let files: [(&str, &[u8]); 8] = [
        ("a.xyz", b"0.1 0.2 -0.3 255 0 0\n1 2 3 0 255 0\n# c\n4 5 6 1 2 3\n"),
        ("a.csv", b"X,Y,Z,intensity\n1,2,3,0.5\n4;5;6;0.1\n"),
        ("a.pts", b"2\n1 2 3 10 255 0 0\n4 5 6 20 0 0 255\n"),
        ("a.pcd", &ascii),
        ("a.pcd", &binary),
        ("a.pcd", &packed),
        ("a.obj", b"v 0 0 0 1 0.5 0\nv 1 1 1 0 0 1\nvn 0 0 1\n"),
        ("a.las", &scan),
    ];
    Ok(files.iter().map(|(name, bytes)| pack(&[(name, bytes)])).collect())
}

/// What a function writes at a path of that name.
fn written(name: &str, write: impl FnOnce(&Path) -> Result<(), Fault>) -> Result<Vec<u8>, Fault> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join(name);
    write(&path)?;
    Ok(fs::read(path)?)
}

/// Complex, real and whole arrays in every kind of file of that ending.
pub fn arrays(ending: &str) -> Seeds {
    let name = format!("a.{ending}");
    let complex = Values::Complex((0..12).map(|i| Complex32::new(i as f32, 0.5)).collect());
    let real = Values::Real((0..12).map(f64::from).collect());
    let whole = Values::Whole((0..12).collect());
    let scalar = Values::Real(vec![532e-9]);
    let mut out = Vec::new();
    for values in [&complex, &real, &whole] {
        let named =
            [Named { name: "U", shape: [3, 4], values }, Named { name: "wavelength", shape: [1, 1], values: &scalar }];
        if ending == "tif" && matches!(values, Values::Complex(_)) {
            continue;
        }
        out.push(pack(&[(&name, &written(&name, |path| Ok(arrays::write(path, &named)?))?)]));
    }
    Ok(out)
}

/// Fields with what stands beside them.
pub fn sidecars() -> Seeds {
    let field = written("a.npy", |path| Ok(npy::write_intensity(path, 3, 2, &[0.5; 6])?))?;
    let beside =
        json!({"wavelength": 532e-9, "pitch": [8e-6, 8e-6], "center": [0, 0], "content": "object", "origin": "x"});
    let wavefront = json!({"wavelength": 532e-9, "unit": "rad", "convention": ""});
    Ok(vec![
        pack(&[("a.json", beside.to_string().as_bytes()), ("a.npy", &field)]),
        pack(&[("a.json", wavefront.to_string().as_bytes()), ("a.npy", &field)]),
    ])
}

/// Light fields as an archive and as a folder.
pub fn light_fields() -> Seeds {
    let eyes = EyeGrid::over(DVec3::new(0.0, 0.0, 0.6), DVec2::new(1e-3, 0.0), 1e-3)?;
    let field = LightField::black(eyes, Grid::new(4, 3, 8e-6, 8e-6)?, 3)?;
    let npz = written("a.npz", |path| Ok(field.write_npz(path)?))?;
    let folder = tempfile::tempdir()?;
    let at = folder.path().join("f");
    field.write_folder(&at)?;
    let mut parts = vec![("light-field.json".to_owned(), fs::read(at.join("light-field.json"))?)];
    for entry in fs::read_dir(&at)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with("png") {
            parts.push((name, fs::read(entry.path())?));
        }
    }
    let parts: Vec<(&str, &[u8])> = parts.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    Ok(vec![pack(&[("a.npz", &npz)]), pack(&parts)])
}

/// One channel of an EXR, packed in several ways.
pub fn exr() -> Seeds {
    let encodings =
        [Encoding::UNCOMPRESSED, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS, Encoding::SMALL_FAST_LOSSLESS];
    let make = |encoding: Encoding| {
        let channels = [
            AnyChannel::new("R", FlatSamples::F16(vec![exr::prelude::f16::from_f32(0.5); 12])),
            AnyChannel::new("Z", FlatSamples::F32((0..12).map(|i| i as f32).collect())),
            AnyChannel::new("id", FlatSamples::U32((0..12).collect())),
        ];
        let layer = Layer::new(
            (4, 3),
            LayerAttributes::named("v"),
            encoding,
            AnyChannels::sort(channels.into_iter().collect()),
        );
        let mut out = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut out)?;
        Ok::<_, Fault>(pack(&[("a.exr", &out.into_inner())]))
    };
    encodings.into_iter().map(make).collect()
}

fn picture(format: ImageFormat) -> Result<Vec<u8>, Fault> {
    let mut out = Cursor::new(Vec::new());
    image::RgbImage::from_fn(12, 8, |x, y| image::Rgb([(20 * x) as u8, (30 * y) as u8, 7]))
        .write_to(&mut out, format)?;
    Ok(out.into_inner())
}

/// Pictures of every kind, of the panel's size.
pub fn pictures() -> Seeds {
    let gray = written("a.png", |path| {
        let wide =
            image::ImageBuffer::<image::Luma<u16>, _>::from_fn(12, 8, |x, y| image::Luma([(5000 * x + y) as u16]));
        Ok(wide.save(path)?)
    })?;
    let levels = Values::Whole((0..96).collect());
    let tif =
        written("a.tif", |path| Ok(arrays::write(path, &[Named { name: "", shape: [8, 12], values: &levels }])?))?;
    let files = [
        ("a.png", picture(ImageFormat::Png)?),
        ("a.png", gray),
        ("a.jpg", picture(ImageFormat::Jpeg)?),
        ("a.bmp", picture(ImageFormat::Bmp)?),
        ("a.webp", picture(ImageFormat::WebP)?),
        ("a.tif", tif),
    ];
    Ok(files.iter().map(|(name, bytes)| pack(&[(name, bytes)])).collect())
}

/// Frames that say for which panel they are.
pub fn frames() -> Seeds {
    let panel = panel()?;
    let frame = Frame::new(&panel, 532e-9, (0..96).collect())?;
    let png = written("a.png", |path| Ok(frame.write(path)?))?;
    Ok(vec![pack(&[("a.png", &png)])])
}

/// The text that a frame's picture carries, by itself.
pub fn frame_texts() -> Seeds {
    let panel = panel()?;
    let frame = Frame::new(&panel, 532e-9, vec![0; 96])?;
    Ok(vec![pack(&[("a.json", &serde_json::to_vec(&frame.metadata)?)])])
}

/// Depths as PFM, DPT and pictures.
pub fn depths() -> Seeds {
    let values: Vec<u8> = (0..12).flat_map(|i| (0.5 + i as f32).to_le_bytes()).collect();
    let pfm = [b"Pf\n4 3\n-1.0\n".as_slice(), &values].concat();
    let dpt = [b"PIEH\x04\0\0\0\x03\0\0\0".as_slice(), &values].concat();
    let png = written("a.png", |path| {
        let wide = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(4, 3, |x, _| image::Luma([600 * x as u16]));
        Ok(wide.save(path)?)
    })?;
    Ok([("a.pfm", pfm), ("a.dpt", dpt), ("a.png", png)].iter().map(|(name, bytes)| pack(&[(name, bytes)])).collect())
}

/// The files of a folder with that beginning and ending, by themselves.
pub fn texts(folder: &Path, begins: &str, plates: bool) -> Seeds {
    let mut out = Vec::new();
    for entry in fs::read_dir(folder)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with("toml") && name.starts_with("plate-") == plates && name.starts_with(begins) {
            out.push(pack(&[("a.toml", &fs::read(entry.path())?)]));
        }
    }
    Ok(out)
}

/// What a plate's folder says of it.
pub fn manifests(root: &Path) -> Seeds {
    let plate = Plate::read(&root.join("calib/plate-small.toml"))?;
    let input = root.join("scenes/cornell.gltf");
    let settings = Settings::new(&plate, &Source::File(input), &SceneOptions::default())?;
    let folder = tempfile::tempdir()?;
    let whole =
        json!({"settings": settings, "instruction_set": "scalar", "amplitude": 1.0, "white": 1.0, "tiles": ["00"]});
    let name = "manifest.json";
    fs::write(folder.path().join(name), whole.to_string())?;
    Manifest::read(folder.path())?;
    Ok(vec![pack(&[(name, whole.to_string().as_bytes())])])
}

/// Tables of makers and of measurements.
pub fn tables() -> Seeds {
    let lines = |row: &dyn Fn(usize) -> String, count: usize| (0..count).map(row).collect::<String>().into_bytes();
    let hamamatsu = lines(&|i| format!("{:.4}\t{}\n", i as f64 / 63.5, 2 * i), 128);
    let meadowlark = lines(&|i| format!("{i} {}\n", 255 - i), 256);
    let santec = b"Y/X,0,1,2\n0,1,2,1023\n1,4,5,6\n".to_vec();
    let powers = b"# c\nlevel,power,x\n0,1.5,a\n128,2e-3,b\n255,0,c\n".to_vec();
    let regions = b"level,column,row,power\n0,0,1,1.5\n9,1,0,2\n".to_vec();
    let files = [
        ("hamamatsu.lut", hamamatsu),
        ("meadowlark.lut", meadowlark),
        ("a.csv", santec),
        ("powers.csv", powers),
        ("powers.csv", regions),
    ];
    Ok(files.iter().map(|(name, bytes)| pack(&[(name, bytes)])).collect())
}

/// What a monitor says of itself: a base block and an extension.
pub fn edids() -> Seeds {
    let mut edid = [0u8; 256];
    edid[..8].copy_from_slice(&[0, 255, 255, 255, 255, 255, 255, 0]);
    edid[8..10].copy_from_slice(&(8 << 10 | 15 << 5 | 5u16).to_be_bytes());
    edid[18..21].copy_from_slice(&[1, 4, 0xa5]);
    edid[54..72]
        .copy_from_slice(&[2, 0x3a, 0x80, 0x18, 0x71, 0x38, 0x2d, 0x40, 0x58, 0x2c, 0x45, 0, 0, 0, 0, 0, 0, 0x1e]);
    edid[72..90].copy_from_slice(b"\0\0\0\xFC\0HE PLUTO-2.1\n");
    edid[90..108].copy_from_slice(b"\0\0\0\xFF\x000123456789\n  ");
    edid[126] = 1;
    edid[128..136].copy_from_slice(&[2, 3, 9, 0, 0x65, 3, 0x0c, 0]);
    Ok(vec![pack(&[("edid", &edid)])])
}

/// Conversations with the server.
pub fn conversations(protocol: &str) -> Seeds {
    let quoted = |text: String| text.replace('{', "%7B").replace('"', "%22").replace(' ', "+") + "\n";
    let said: Vec<Vec<u8>> = match protocol {
        "slmsuite" => vec![
            quoted(json!({"name": "panel", "command": "ping", "args": [], "kwargs": {}}).to_string()).into(),
            quoted(json!({"name": "panel", "command": "pickle", "args": [], "kwargs": {"attributes": false}}).to_string()).into(),
            // 96 zeros in zlib.
            quoted(
                json!({"name": "panel", "command": "_set_phase_hw", "args": [], "kwargs": {"display":
                    {"__zlib__": "eJxjYKAtAAAAYAAB", "__shape__": [8, 12], "__dtype__": "uint8"}, "block": true}})
                .to_string(),
            )
            .into(),
            (json!({"name": "panel", "command": "ping"}).to_string() + "\n").into(),
        ],
        "slmpy" => vec![
            [96u32.to_le_bytes().as_slice(), &[7; 96]].concat(),
            [12u32.to_le_bytes().as_slice(), &BASE64_STANDARD.decode("eJxjYKAtAAAAYAAB")?, &96u32.to_le_bytes(), &[9; 96]].concat(),
        ],
        _ => vec![
            b"{\"mapped\": true}\n{\"show\": \"levels\", \"dtype\": \"uint8\"}\n{\"show\": \"phase\", \"dtype\": \"float32\"}\n".to_vec(),
            b"{\"show\": \"phase\", \"dtype\": \"float64\"}\n".to_vec(),
        ],
    };
    Ok(said.iter().map(|bytes| pack(&[(protocol, bytes)])).collect())
}
