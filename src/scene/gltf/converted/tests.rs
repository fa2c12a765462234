use crate::scene::gltf::{LoadOptions, Loaded, is_scene, load};
use crate::scene::{AlphaMode, Scene};
use glam::{Vec2, Vec3};
use std::path::Path;

const OBJ: &str = "# a quad and a triangle, in a material each\nmtllib the\\materials.mtl\nv 0 0 0 1 1 1\nv 2 0 0 1 1 1\nv 2 1 0 1 1 1\nv 0 1 0 1 1 1\n\
    v 0 0 1 1 0.5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 \\\n 3/3/1 4/4/1\nusemtl lamp\nf -1 1 2\n";
const MTL: &str = "newmtl red\nKd 0.5 0.1 0.2\nNs 98\nd 0.25\nmap_Kd -s 1 1 1 wood.png\nnewmtl lamp\nKd 0\nKs spectral a.rfl\nKe 3 1.5 0\n";

fn loaded(files: &[(&str, &[u8])]) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().expect("folder");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("parent")).expect("folder");
        std::fs::write(path, bytes).expect("write");
    }
    let path = folder.path().join(files[0].0);
    assert!(is_scene(&path));
    load(&path, &LoadOptions::default()).map_err(|why| why.to_string())
}

fn material_of(scene: &Scene, at: usize) -> &crate::scene::Material {
    scene.material(at as u32)
}

#[test]
fn obj_has_its_faces_materials_and_pictures() {
    let mut png = Vec::new();
    let wood = image::RgbaImage::from_pixel(2, 2, image::Rgba([255, 0, 0, 255]));
    wood.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).expect("png");
    let files = [("a.obj", OBJ.as_bytes()), ("the/materials.mtl", MTL.as_bytes()), ("wood.png", &png)];
    let Loaded { scene, warnings } = loaded(&files).expect("scene");
    assert_eq!(scene.triangles.len(), 3);
    let first = &scene.triangles[0];
    assert_eq!(first.positions[..2], [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0)]);
    // The picture's bottom left is the first corner's.
    assert_eq!(first.texcoords[0][0], Vec2::new(0.0, 1.0));
    assert_eq!(first.normals[0], Vec3::Z);
    let (red, lamp) = (material_of(&scene, 0), material_of(&scene, 2));
    assert!((red.base_color - Vec3::new(0.5, 0.1, 0.2)).length() < 1e-6, "{red:?}");
    assert!((red.roughness - 0.02f32.powf(0.25)).abs() < 1e-6 && red.metallic == 0.0);
    assert!(matches!(red.alpha_mode, AlphaMode::Blend) && (red.alpha - 0.25).abs() < 1e-6);
    assert!(red.base_color_texture.is_some() && scene.textures.len() == 1);
    assert!((lamp.emissive - Vec3::new(3.0, 1.5, 0.0)).length() < 1e-5, "{:?}", lamp.emissive);
    assert!(warnings.iter().any(|w| w.0.contains("no unit")), "{warnings:?}");
}

#[test]
fn obj_without_its_materials_is_grey_and_says_so() {
    let Loaded { scene, warnings } = loaded(&[("a.obj", OBJ.as_bytes())]).expect("scene");
    assert_eq!(scene.triangles.len(), 3);
    assert!(material_of(&scene, 0).base_color.x == 0.7);
    assert!(warnings.iter().any(|w| w.0.contains("materials are not read")), "{warnings:?}");
    // Neither a folder above nor an absolute path is read.
    for outside in ["../m.mtl", "/etc/hostname"] {
        let text = OBJ.replace("the\\materials.mtl", outside);
        let warnings = loaded(&[("x/a.obj", text.as_bytes()), ("m.mtl", MTL.as_bytes())]).expect("scene").warnings;
        assert!(warnings.iter().any(|w| w.0.contains("materials are not read")), "{outside}: {warnings:?}");
    }
}

#[test]
fn a_wrong_obj_names_its_line() {
    for (text, word) in
        [("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n", "line 4"), ("v 0 0 0\nv 1 0 x\nv 1 1 0\nf 1 2 3\n", "line 2")]
    {
        let said = loaded(&[("a.obj", text.as_bytes())]).expect_err("refused");
        assert!(said.contains(word), "{said}");
    }
    let folder = tempfile::tempdir().expect("folder");
    let cloud = folder.path().join("cloud.obj");
    std::fs::write(&cloud, "v 0 0 0\nv 1 0 0\n").expect("write");
    assert!(!is_scene(&cloud) && !is_scene(Path::new("no/such.obj")));
}

fn stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(1u32.to_le_bytes());
    // A normal that says nothing, and three corners of which one is above.
    for number in [0.0f32, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend([0, 0]);
    bytes
}

#[test]
fn stl_as_text_or_binary_stands_upright() {
    let text = "solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 2\nendloop\nendfacet\nendsolid a\n";
    for bytes in [stl(), text.as_bytes().to_vec()] {
        let Loaded { scene, warnings } = loaded(&[("a.stl", &bytes)]).expect("scene");
        let wanted = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::Y];
        let found = scene.triangles[0].positions;
        assert!(found.iter().zip(wanted).all(|(found, wanted)| found.distance(wanted) < 1e-6), "{found:?}");
        assert!(warnings.iter().any(|w| w.0.contains("z as up")), "{warnings:?}");
    }
    for cut in 0..stl().len() {
        let said = loaded(&[("a.stl", &stl()[..cut])]).expect_err("refused");
        assert!(!said.contains('\n'), "{said}");
    }
}

#[test]
fn careless_programs_files_are_read_from_both_sides() {
    // A material without a name; clockwise from the front.
    let obj = b"v 0 0 0\nv 0 1 0\nv 1 0 0\nusemtl \nf 1 2 3\nusemtl\nf 1 3 2\n";
    let scene = loaded(&[("a.obj", obj)]).expect("scene").scene;
    assert!(scene.triangles.len() == 2 && material_of(&scene, 0).double_sided);
    let stl = b"solid\tball\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    let scene = loaded(&[("a.stl", stl)]).expect("scene").scene;
    assert!(scene.triangles.len() == 1 && material_of(&scene, 0).double_sided);
}
